"""The kinds of experiments, which plugins and graspsense itself declare by entries (docs/hooks.md)."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from attrs import frozen

from graspsense.core.components.entries import ExperimentKindEntry
from graspsense.core.components.registry import Resource, installed
from graspsense.core.values.errors import ComponentFailed
from graspsense.core.values.json_values import json_text
from graspsense.evaluation.json_codec import from_json, to_json


@frozen
class TaskKind:
    """A kind of experiment, whose parts are imported when they are asked for.

    Each raises PluginUnavailable; a class that is none of a kind ComponentFailed.
    """

    declared: Resource[ExperimentKindEntry]

    def keys_class(self) -> type:
        """Return the class of the keys under `[judge]`."""
        return self.declared.class_of_kind("keys")

    def result_class(self) -> type:
        """Return the class of the result."""
        if not self.declared.entry.result:
            from graspsense.experiments.task_results import RecognitionResult

            return RecognitionResult
        return self.declared.class_of_kind("result")

    def encoded(self, returned: Any) -> Any:
        """Return the JSON values of what `run` returned. Raises ComponentFailed if it cannot be read from them."""
        cls, run = self.result_class(), self.declared.entry.run
        if not isinstance(returned, cls):
            raise ComponentFailed(
                f"{run} returned a value of type {type(returned).__name__}; the result of the kind "
                f"{self.declared.qualified} is {cls.__name__}: return that, or name another class in `result`"
            )
        values = json.loads(json_text(to_json(returned)))
        try:
            from_json(values, cls)
        except ValueError as error:
            raise ComponentFailed(
                f"{run} returned {cls.__name__} with values of other types than its fields have: {error}. JSON has no "
                "NaN: a number that may be missing is `float | None`"
            ) from error
        return values

    def findings(self) -> Callable[[Any], Any] | None:
        """Return the function that reports the findings, None if the rates are the whole report."""
        return self.declared.load("findings") if self.declared.entry.findings else None


def kind_of(name: str) -> TaskKind:
    """Return a kind by its name. Raises UnknownName."""
    return TaskKind(installed().resource(ExperimentKindEntry, name))
