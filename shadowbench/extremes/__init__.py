"""Stress tests: techniques swept along axes to extreme values, and their operating ranges."""
