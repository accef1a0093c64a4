"""Where tasks are run: processes of this machine, or a cluster of Dask."""
