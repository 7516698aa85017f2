"""Rows to HTML, Markdown and figures: reports read run folders, and measure nothing."""
