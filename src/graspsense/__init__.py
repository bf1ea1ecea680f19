"""graspsense: feel what a thing is and what state it is in while a gripper closes on it.

This is the door for users. Names are imported when they are first used; plugins are never loaded at import.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from graspsense.core.errors import GraspsenseError as GraspsenseError
    from graspsense.core.features import Features as Features
    from graspsense.core.features import FeatureTable as FeatureTable
    from graspsense.core.features import Prediction as Prediction
    from graspsense.core.pipeline import load_pipeline as load_pipeline
    from graspsense.core.signals import Outcome as Outcome
    from graspsense.core.signals import Phase as Phase
    from graspsense.core.trace import Trace as Trace
    from graspsense.core.trial import Trial as Trial

__version__: Final = "0.1.0"

_HOME_OF: Final = {
    "FeatureTable": "features",
    "Features": "features",
    "GraspsenseError": "errors",
    "Outcome": "signals",
    "Phase": "signals",
    "Prediction": "features",
    "Trace": "trace",
    "Trial": "trial",
    "load_pipeline": "pipeline",
}

__all__ = ["__version__", *_HOME_OF]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"graspsense.core.{_HOME_OF[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
