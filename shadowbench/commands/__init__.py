"""What each command prints and writes; `cli` holds their options, so that `--help` imports none of this."""
