"""The kinds of experiments, which plugins and graspsense itself declare by entries (docs/hooks.md)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from attrs import frozen

from graspsense.core.components.entries import ExperimentKindEntry
from graspsense.core.components.registry import Resource, installed

TaskFunction = Callable[[Mapping[str, Any], int], Any]
"""Takes the parameters and the seed of a task. Returns its result, which depends on these two alone."""


@frozen
class TaskKind:
    """A kind of experiment, whose parts are imported when they are asked for. Each raises PluginUnavailable."""

    declared: Resource[ExperimentKindEntry]

    def function(self) -> TaskFunction:
        """Return the function that runs a task."""
        function: TaskFunction = self.declared.load("run")
        return function

    def keys_class(self) -> type:
        """Return the class of the keys under `[judge]`."""
        cls: type = self.declared.load("keys")
        return cls

    def result_class(self) -> type:
        """Return the class of the result."""
        if not self.declared.entry.result:
            from graspsense.experiments.task_results import RecognitionResult

            return RecognitionResult
        cls: type = self.declared.load("result")
        return cls

    def findings(self) -> Callable[[Any], Any] | None:
        """Return the function that reports the findings, None if the rates are the whole report."""
        if not self.declared.entry.findings:
            return None
        function: Callable[[Any], Any] = self.declared.load("findings")
        return function


def kind_of(name: str) -> TaskKind:
    """Return a kind by its name. Raises UnknownName."""
    return TaskKind(installed().resource(ExperimentKindEntry, name))
