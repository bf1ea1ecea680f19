"""Chooses the executor that `--executor` names."""

from __future__ import annotations

import os
from collections.abc import Callable

from graspsense.core.components.caller import option
from graspsense.core.values.errors import ConfigError, suggestion
from graspsense.experiments.executors.executor import Executor, Serial

NAMES = ("serial", "processes", "dask:ADDRESS")


def chosen(asked: str | None, workers: int | None = None) -> Callable[[], Executor]:
    """Return a function that makes the executor named `asked`. None stands for processes, or for serial on one core.

    Raises ConfigError for an unknown name, and for fewer than one worker.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if workers is not None and workers < 1:
        raise ConfigError(f"{option('workers', str(workers))}: give at least 1")
    number = workers or cores
    name, _, address = (asked or ("processes" if number > 1 else "serial")).partition(":")
    if name not in (("dask",) if address else ("serial", "processes")):
        raise ConfigError(
            f"there is no executor {asked!r}.{suggestion(name, NAMES)} There are {', '.join(NAMES)}, as in "
            "dask:tcp://10.0.0.1:8786"
        )
    if name == "serial":
        return Serial
    if name == "processes":
        from graspsense.experiments.executors.processes import Processes

        return lambda: Processes(number)
    from graspsense.experiments.executors.dask import DaskCluster

    return lambda: DaskCluster(address)
