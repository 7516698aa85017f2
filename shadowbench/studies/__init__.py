"""Studies: what to measure, read from a file or options; running it; run folders and their tables."""
