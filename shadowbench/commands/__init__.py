"""What each command prints and writes; `cli.py` holds their options, so that `--help` imports none of this."""
