"""Which cells to run, and running them: study files, the worker, rows, tables."""
