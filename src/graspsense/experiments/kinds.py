"""The kinds of task. To add one, write a module with a function and a settings class, and add a line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, Final

from attrs import frozen

from graspsense.core.values.errors import ConfigError, suggestion

TaskFunction = Callable[[Mapping[str, Any], int], Any]
"""Takes the parameters and the seed of a task. Returns its result, which depends on these two alone."""

_RECOGNITION: Final = "graspsense.experiments.task_results:RecognitionResult"


@frozen
class TaskKind:
    """A kind of task, as import strings.

    `run` is its function, `keys` the attrs class of its keys under `[judge]`, and `result` the class of its result.
    `report_with` is a function from a `Summary` to `Findings`, for kinds whose report is more than rates. A kind
    without a function is for experiments that consist of others.
    """

    name: str
    run: str = ""
    keys: str = ""
    report_with: str = ""
    result: str = _RECOGNITION

    def function(self) -> TaskFunction:
        """Return the function that runs such a task."""
        function: TaskFunction = _imported(self.run)
        return function

    def keys_class(self) -> type:
        """Return the class of the keys under `[judge]`."""
        cls: type = _imported(self.keys)
        return cls

    def result_class(self) -> type:
        """Return the class of the result."""
        cls: type = _imported(self.result)
        return cls

    def findings(self) -> Callable[[Any], Any] | None:
        """Return the function that reports the findings, None if the rates are the whole report."""
        if not self.report_with:
            return None
        function: Callable[[Any], Any] = _imported(self.report_with)
        return function


_TRADES: Final = "graspsense.experiments.trade.findings:findings"

KINDS: Final = {
    kind.name: kind
    for kind in (
        TaskKind(
            "recognise",
            "graspsense.experiments.recognise:recognise",
            "graspsense.experiments.recognise:EvaluationSettings",
        ),
        TaskKind(
            "grasp",
            "graspsense.experiments.grasping:grasp",
            "graspsense.experiments.grasping:GraspSettings",
            result="graspsense.experiments.task_results:GraspResult",
            report_with="graspsense.experiments.paper.findings:findings",
        ),
        TaskKind(
            "table",
            "graspsense.experiments.recognise:recognise",
            "graspsense.experiments.recognise:EvaluationSettings",
            report_with="graspsense.experiments.paper.findings:findings",
        ),
        TaskKind("paper", report_with="graspsense.experiments.paper.findings:findings"),
        TaskKind(
            "trade",
            "graspsense.experiments.trade.costs:trade",
            "graspsense.experiments.trade.costs:TradeSettings",
            report_with=_TRADES,
        ),
        *(
            TaskKind(
                name,
                f"graspsense.experiments.trade.{name}:{name}",
                f"graspsense.experiments.trade.{name}:{keys}",
                report_with=_TRADES,
            )
            for name, keys in (
                ("early", "EarlySettings"),
                ("squeezes", "RepeatSettings"),
                ("physics", "ModelErrorSettings"),
                ("next_squeeze", "NextSqueezeSettings"),
                ("compare", "ComparisonSettings"),
            )
        ),
        TaskKind("trades", report_with=_TRADES),
    )
}


def kind_of(name: str) -> TaskKind:
    """Return a kind by its name. Raises ConfigError."""
    if name not in KINDS:
        raise ConfigError(
            f"there is no kind of experiment {name!r}.{suggestion(name, KINDS)} Known: {', '.join(KINDS)}"
        )
    return KINDS[name]


def _imported(target: str) -> Any:
    module, _, name = target.partition(":")
    return getattr(import_module(module), name)
