"""Shadow techniques, one file each."""
