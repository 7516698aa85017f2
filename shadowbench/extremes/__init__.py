"""Techniques along axes to the extremes, and the ranges in which they may be trusted."""
