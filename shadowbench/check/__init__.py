"""Regression checks: comparison of runs with a baseline and with each other."""
