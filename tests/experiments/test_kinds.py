"""Kinds of experiments of a plugin: what their classes and functions must be, and what is said of a mistake."""

from types import SimpleNamespace

import pytest
from attrs import frozen
from cases import every_case

from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.values.errors import ComponentFailed
from graspsense.experiment_api import ExperimentKindEntry
from graspsense.experiments import page
from graspsense.experiments.kinds import TaskKind
from graspsense.plugin_api import hookimpl


@frozen(kw_only=True)
class Keys:
    squeezes: int = 3


@frozen(kw_only=True)
class Worn:
    source: str = "bottles"
    simulated: bool = False
    depth_m: float = 1e-3


@frozen(kw_only=True)
class Sourceless:
    depth_m: float


class Plain:
    pass


def raising(summary):
    raise ZeroDivisionError("no bottle")


def str_of(summary):
    return "worn"


def kind(keys="Keys", result="Worn", findings=""):
    places = {"keys": keys, "result": result, "findings": findings}
    named = {part: f"{__name__}:{name}" for part, name in places.items() if name}

    class Plugin:
        GRASPSENSE_API = (2, 0)

        @hookimpl
        def graspsense_experiment_kinds(self):
            yield ExperimentKindEntry(name="wear", run=f"{__name__}:raising", summary="wear", **named)

    return TaskKind(IsolatedPlugins(Plugin()).resource(ExperimentKindEntry, "wear"))


def test_a_result_is_kept_as_its_values():
    assert kind().encoded(Worn(depth_m=2e-3)) == {"source": "bottles", "simulated": False, "depth_m": 2e-3}


@every_case(
    ("declared", "told"),
    [
        ({"result": "Sourceless"}, "Sourceless.*has no source and no simulated"),
        ({"result": "Plain"}, "Plain.*is no class of attrs"),
    ],
)
def test_a_class_that_is_no_result_is_told(declared, told):
    with pytest.raises(ComponentFailed, match=told):
        kind(**declared).encoded(Worn())


def test_keys_of_another_class_are_told():
    with pytest.raises(ComponentFailed, match=r"`keys`.*graspsense-test/wear"):
        kind(keys="Plain").keys_class()


@every_case(
    ("returned", "told"),
    [
        (None, "value of type NoneType"),
        ({"depth_m": 1e-3}, "value of type dict"),
        (Worn(depth_m=float("nan")), r"expected float @ Worn\.depth_m"),
        (Worn(depth_m="deep"), r"expected float @ Worn\.depth_m"),
    ],
)
def test_a_task_that_returns_no_result_fails_with_what_it_returned(returned, told):
    with pytest.raises(ComponentFailed, match=told):
        kind().encoded(returned)


@every_case(
    ("findings", "told"),
    [("raising", "ZeroDivisionError: no bottle"), ("str_of", "str in place of Findings")],
)
def test_a_report_that_fails_names_its_function_and_leaves_the_results(findings, told, monkeypatch):
    monkeypatch.setattr(page, "kind_of", lambda name: kind(findings=findings))

    summary = SimpleNamespace(planned=SimpleNamespace(experiment=SimpleNamespace(kind="wear")))

    with pytest.raises(ComponentFailed, match=rf"{__name__}:{findings}.*{told}.*graspsense report DIR"):
        page.findings_of(summary)
