"""One way to make a row: the worker, the session, timing, rows and their keys."""
