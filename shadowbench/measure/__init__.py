"""Measuring cells: the worker and its session, scoring, timing, rows and their keys."""
