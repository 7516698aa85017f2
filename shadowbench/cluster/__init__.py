"""Measuring on the workers of a Dask cluster: needs the extra `dask`, and is imported for --dask only."""
