"""Executors run tasks: in this process, in other processes on this machine, or on a Dask cluster."""
