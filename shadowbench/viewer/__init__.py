"""The window of `shadowbench view`: what is seen is what is scored."""
