"""The settings with which `graspsense tradeoff simulation` measures accuracy against time."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Final

from attrs import evolve

from graspsense.simulator_api import SimulationVariant

ACCURACIES: Final = (0.5, 0.1, 0.01, 0.001, 1e-4)
STEPS_S: Final = (1e-3, 5e-4, 2e-4, 1e-4)

_FORMS: Final = (
    SimulationVariant(
        method="halved steps",
        fidelity="reference",
        step="until all stands still",
        settings={"fidelity": "reference", "accuracy": 1e-4},
        role="reference",
    ),
    *(
        SimulationVariant(
            method="steps by their error",
            fidelity="scene",
            step=f"{accuracy:g}",
            settings={"fidelity": "scene", "accuracy": accuracy},
            for_recognition=True,
        )
        for accuracy in ACCURACIES
    ),
    *(
        SimulationVariant(
            method="even steps",
            fidelity="scene",
            step=f"{step_s * 1e3:g} ms",
            settings={"fidelity": "scene", "step_s": step_s},
        )
        for step_s in STEPS_S
    ),
    SimulationVariant(
        method="in the interpreter",
        fidelity="scene",
        step="0.01",
        settings={"fidelity": "scene", "accuracy": 0.01, "compile": "never"},
    ),
)


def variants() -> tuple[SimulationVariant, ...]:
    """Return the settings to compare: the reference, steps by their error, and even steps.

    They are compiled if numba is installed, except for the one that measures the interpreter.
    """
    compiled = "always" if find_spec("numba") is not None else "never"
    return tuple(evolve(variant, settings={"compile": compiled, **variant.settings}) for variant in _FORMS)
