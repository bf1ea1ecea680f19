"""Where the names are now that `graspsense.plugin_api` no longer has."""

from __future__ import annotations

from importlib import import_module
from typing import Final

SPECIAL: Final = ("gripper_api", "classifier_api", "testing_api", "experiment_api", "simulator_api")
"""The public modules of graspsense beside `plugin_api`, each for the plugins that need it."""

MOVED_TO_EXPERIMENTS: Final = ("ControlFeatures", "ExperimentEntry", "ExperimentKindEntry", "Labelled")
"""The names of `experiment_api` that came from `plugin_api`; it had its others before."""

REPLACED: Final = {
    "CELLS": "the number of rows and columns of the TactileArray that the gripper declares",
    "ClockLine": "the attributes of DeviceClock",
    "CommandKind": "EFFORT, VELOCITY, POSITION and FORCE",
    "ControllerState": "a NamedTuple with the fields phase and outcome",
    "FIRST_PAD_CELL": "the number of the first cell on the gripping face, as an argument",
    "FreeState": "the result of free_from of graspsense.simulator_api",
    "FreeTicks": "the result of free_parts of graspsense.simulator_api",
    "GuardParams": "the result of tick_params of graspsense.simulator_api",
    "GuardState": "the result of first_state of graspsense.simulator_api",
    "OPENING": "Phase.OPENING of graspsense.gripper_api",
    "Schedule": "the result of tick_params of graspsense.simulator_api",
    "StepLaw": "Controller.step",
    "Stillness": "from graspsense.plugin_api import RestState",
    "StoredValueError": "DataDamaged",
    "UNKNOWN": 'the answer "unknown"',
    "columns_of_ticks": "TickColumns of graspsense.simulator_api",
    "watch": "from graspsense.plugin_api import update_rest",
}
"""Name that was public to what is used in its place."""


def refuse_moved(name: str) -> None:
    """Raise an ImportError that says where a name of `graspsense.plugin_api` is now; do nothing for other names."""
    instead = REPLACED.get(name, "")
    for module in SPECIAL:
        names = import_module(f"graspsense.{module}").PUBLIC.names
        if name in (MOVED_TO_EXPERIMENTS if module == "experiment_api" else names):
            instead = instead or f"from graspsense.{module} import {name}"
    if instead:
        raise ImportError(f"graspsense.plugin_api no longer has {name}; in its place: {instead}")
