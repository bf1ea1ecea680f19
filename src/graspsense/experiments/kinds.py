"""The kinds of tasks there are. A further kind is a module with a function and a class, and a line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, Final

from attrs import frozen

from graspsense.core.errors import ConfigError, suggestion

TaskFunction = Callable[[Mapping[str, Any], int], Mapping[str, Any]]
"""Takes the params and the seed of a task and returns JSON values, which follow from these two alone."""


@frozen
class Kind:
    """A kind of task: the import strings of its function, and of the attrs class of its keys under `[judge]`.

    `tells` is that of a function from a `Summary` to `Findings`, where what came out is more than rates. A kind
    without a function is for experiments that consist of others.
    """

    name: str
    run: str = ""
    keys: str = ""
    tells: str = ""

    def function(self) -> TaskFunction:
        """Return what does such a task."""
        function: TaskFunction = _imported(self.run)
        return function

    def keys_class(self) -> type:
        """Return the class of its keys."""
        cls: type = _imported(self.keys)
        return cls

    def findings(self) -> Callable[[Any], Any] | None:
        """Return what tells what came out, None where rates are all."""
        if not self.tells:
            return None
        function: Callable[[Any], Any] = _imported(self.tells)
        return function


_TRADES: Final = "graspsense.experiments.trade.findings:findings"

KINDS: Final = {
    kind.name: kind
    for kind in (
        Kind(
            "recognise",
            "graspsense.experiments.recognise:recognise",
            "graspsense.experiments.recognise:Judging",
        ),
        Kind(
            "grasp",
            "graspsense.experiments.grasping:grasp",
            "graspsense.experiments.grasping:Grasping",
            tells="graspsense.experiments.paper.findings:findings",
        ),
        Kind(
            "table",
            "graspsense.experiments.recognise:recognise",
            "graspsense.experiments.recognise:Judging",
            tells="graspsense.experiments.paper.findings:findings",
        ),
        Kind("paper", tells="graspsense.experiments.paper.findings:findings"),
        Kind(
            "trade",
            "graspsense.experiments.trade.costs:trade",
            "graspsense.experiments.trade.costs:TradeJudging",
            tells=_TRADES,
        ),
        *(
            Kind(
                name,
                f"graspsense.experiments.trade.{name}:{name}",
                f"graspsense.experiments.trade.{name}:{keys}",
                tells=_TRADES,
            )
            for name, keys in (
                ("early", "Early"),
                ("squeezes", "Squeezes"),
                ("physics", "Physics"),
                ("next_squeeze", "NextSqueeze"),
                ("compare", "Comparing"),
            )
        ),
        Kind("trades", tells=_TRADES),
    )
}


def kind_of(name: str) -> Kind:
    """Return a kind by its name. Raises ConfigError."""
    if name not in KINDS:
        raise ConfigError(
            f"there is no kind of experiment {name!r}.{suggestion(name, KINDS)} Known: {', '.join(KINDS)}"
        )
    return KINDS[name]


def _imported(target: str) -> Any:
    module, _, name = target.partition(":")
    return getattr(import_module(module), name)
