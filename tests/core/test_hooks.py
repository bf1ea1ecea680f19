"""Every hook has a test, `test_hook_NAME` or a case of its kind, and an example in its docstring that runs."""

from __future__ import annotations

import logging
import re
import types

import click
import pytest
from cases import every_case
from parts import implementing
from repository import ROOT, script_of_docs

from graspsense.core.components import hookspecs
from graspsense.core.components.entries import (
    ConformanceCheckEntry,
    EmulatorEntry,
    ExperimentEntry,
    Finding,
    FoundDevice,
    IdentifierEntry,
    LiveObserverEntry,
    ModelEntry,
)
from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.values.events import GraspEvent
from graspsense.core.values.features import Features
from graspsense.core.values.signals import Outcome, Phase
from graspsense.core.values.trace import trace_of
from graspsense.core.values.trial import RunInfo, Trial
from graspsense.experiment_api import ExperimentKindEntry
from graspsense.plugin_api import (
    CommandEntry,
    DatasetEntry,
    PipelineEntry,
    PluginUnavailable,
    UnknownName,
)
from graspsense.simulator_api import collect

HOOKS = {name: spec for name, spec in vars(hookspecs).items() if name.startswith("graspsense_")}
PAGES = script_of_docs("role_pages")
DOCS = (ROOT / "docs" / "hooks.md").read_text(encoding="utf-8")
RUN = RunInfo(components={"gripper": "graspsense/replay 0.1.0"}, settings={"run": {"seed": 7}}, seed=7)
EVENT = GraspEvent(1.5, Phase.SQUEEZE, "both pads touch")


def example(hook: str) -> types.ModuleType:
    """Return the plugin module that the docstring of this hook gives as its example."""
    code = PAGES.hook_example(HOOKS[hook])
    assert code, f"the docstring of {hook} has no example"
    module = types.ModuleType(f"example_of_{hook}")
    vars(module)["GRASPSENSE_API"] = (2, 0)
    exec(code, vars(module))
    return module


def raising(error: BaseException):
    """Return an implementation of a hook that raises this error, whatever it is given."""

    def raise_it(self):
        raise error

    return raise_it


def trial() -> Trial:
    return Trial(
        run=RUN,
        trace=trace_of([], [], [], []),
        outcome=Outcome.NEVER_STEADY,
        reason="",
        features=Features(names=(), values=(), units=()),
        prediction=None,
        device={},
        report={},
        counts={},
        events=(),
        seconds_simulated=None,
        seconds_wall=0.0,
    )


COMPONENTS = {
    "graspsense_sensor_backends": ("sensor-backend", "lab-hand", "lab_hand.backend:LabHand"),
    "graspsense_controllers": ("controller", "gentle", "lab_hand.gentle:GentleController"),
    "graspsense_feature_sets": ("feature-set", "stiffness", "lab_hand.stiffness:Stiffness"),
    "graspsense_classifiers": ("classifier", "nearest", "lab_hand.nearest:Nearest"),
}
"""Hooks of components; the role, the name and the target of what its example gives."""


RESOURCES = {
    "graspsense_models": (ModelEntry, "lab-cans", {"resource": "lab_hand:models/cans.json"}),
    "graspsense_datasets": (DatasetEntry, "lab-csv", {"recordings": "lab_hand.csv:recordings"}),
    "graspsense_emulators": (
        EmulatorEntry,
        "lab-hand",
        {"target": "lab_hand.emulator:emulate", "wires": ("pty",), "options": ()},
    ),
    "graspsense_live_observers": (LiveObserverEntry, "lab-wall", {"target": "lab_hand.wall:observe"}),
    "graspsense_conformance_checks": (
        ConformanceCheckEntry,
        "fingers-have-names",
        {"hook": "lab_hand_fingers"},
    ),
}
"""Hooks of resources; the kind, the name and the fields of what its example gives."""
OBSERVERS = {
    "graspsense_run_starting": ("run_starting", (RUN,), "started", 7),
    "graspsense_grasp_event": ("grasp_event", (RUN, EVENT), "events", "both pads touch"),
    "graspsense_run_finished": ("run_finished", (RUN, trial()), "outcomes", "never steady"),
}
"""Hooks that observe a grasp; how they are called, and what the example appends to which list."""


@every_case("hook", HOOKS)
def test_every_hook_has_a_test(hook):
    assert hook in {*COMPONENTS, *RESOURCES, *OBSERVERS} or f"test_hook_{hook}" in globals()


@every_case("hook", RESOURCES)
def test_a_resource_hook_gives_its_resource(hook):
    kind, name, fields = RESOURCES[hook]
    (resource,) = IsolatedPlugins(example(hook), builtins=False).resources(kind)

    assert resource.name == name
    assert {field: getattr(resource.entry, field) for field in fields} == fields


@every_case("hook", OBSERVERS)
def test_an_observer_hook_is_called_with_what_it_observes(hook):
    method, arguments, kept, value = OBSERVERS[hook]
    module = example(hook)

    getattr(IsolatedPlugins(module), method)(*arguments)

    assert getattr(module, kept) == [value]


@every_case("hook", COMPONENTS)
def test_a_component_hook_gives_components_of_its_role(hook):
    role, name, target = COMPONENTS[hook]
    plugins = IsolatedPlugins(example(hook), builtins=False)

    assert [(component.role, component.name) for component in plugins.components()] == [(role, name)]
    assert plugins.find(role, name).qualified == f"graspsense-test/{name}"
    assert plugins.find(role, name).entry.target == target


def test_the_documented_hand_has_the_channels_of_its_fingers():
    (code,) = (
        source
        for source in re.findall(r"```python\n(from .*?)```", DOCS, re.DOTALL)
        if "class LabHand(" in source
    )
    names: dict = {}
    exec(compile(code, "hooks.md", "exec", dont_inherit=True), names)

    class Hand(names["LabHand"]):
        open = read = apply = tare = close = None

    config = names["LabHandConfig"]
    assert [channel.name for channel in Hand(config()).channels] == ["gap", "velocity"]
    assert [channel.name for channel in Hand(config(fingers="force-sensing")).channels][2:] == [
        "force_left",
        "force_right",
    ]


def test_hook_graspsense_pipelines():
    plugins = IsolatedPlugins(example("graspsense_pipelines"))

    assert [pipeline.name for pipeline in plugins.resources(PipelineEntry)] == ["best", "default", "lab"]
    assert "[gripper]" in plugins.resource(PipelineEntry, "graspsense/default").file().read_text()


def test_hook_graspsense_commands():
    again = CommandEntry("again", "click:Command", "a class that is there to be imported")
    plugin = implementing("graspsense_commands", lambda self: [again])
    plugins = IsolatedPlugins(example("graspsense_commands"), plugin)

    assert [command.name for command in plugins.resources(CommandEntry)] == ["again", "home-hand"]
    assert plugins.resource(CommandEntry, "again").load() is click.Command


def test_hook_graspsense_identifiers():
    plugins = IsolatedPlugins(example("graspsense_identifiers"))

    assert plugins.resource(IdentifierEntry, "lab-sim").entry.target == "lab_sim.identification:identify"
    with pytest.raises(UnknownName, match=r"graspsense-identify:\n.*graspsense\[identify\]"):
        plugins.resource(IdentifierEntry, "sim")
    with pytest.raises(UnknownName, match=r"'replay'.*lab-sim"):
        plugins.resource(IdentifierEntry, "replay")


def test_hook_graspsense_experiment_kinds():
    plugins = IsolatedPlugins(example("graspsense_experiment_kinds"))

    assert plugins.resource(ExperimentKindEntry, "wear").targets == ("run", "keys", "result", "findings")
    with pytest.raises(ValueError, match="both 'run' and 'keys'"):
        ExperimentKindEntry(name="wear", run="lab_study.wear:run", summary="without keys")


def test_hook_graspsense_experiments():
    plugins = IsolatedPlugins(example("graspsense_experiments"))

    worn = plugins.resource(ExperimentEntry, "graspsense-test/worn-cans")
    assert worn.entry.resource == "lab_study:experiments/worn_cans.toml"
    with pytest.raises(PluginUnavailable, match="lab_study"):
        worn.file()


def test_hook_graspsense_diagnose():
    def told(self, config, timeout_s):
        return [Finding("what I was told", "ok", f"{config} for {timeout_s} s")]

    hook = "graspsense_diagnose"
    plugins = IsolatedPlugins(builtins=False)
    plugins.add(implementing(hook, raising(PermissionError("cannot list the bus"))), "lab-a")
    plugins.add(example(hook), "lab-b")
    plugins.add(implementing(hook, told), "lab-c")

    failed, diagnoses, told_findings = plugins.diagnose("these settings", 0.25)

    assert (failed.given, failed.error) == ((), "PermissionError: cannot list the bus")
    assert (diagnoses.given[0].state, diagnoses.given[0].numbers) == ("problem", {"baud": 115200})
    assert told_findings.given[0].words == "these settings for 0.25 s"


def test_a_finding_is_in_one_of_three_states():
    with pytest.raises(ValueError, match=r"'state' is 'fine'; there are ok, note, problem"):
        Finding("cable", "fine", "straight")  # type: ignore[arg-type]


def test_hook_graspsense_probe_devices():
    def timed(self, timeout_s):
        return [FoundDevice("mine", str(timeout_s), "bus 1", ready=True)]

    hook = "graspsense_probe_devices"
    plugins = IsolatedPlugins(builtins=False)
    plugins.add(implementing(hook, raising(PermissionError("cannot list the bus"))), "lab-a")
    plugins.add(example(hook), "lab-b")
    plugins.add(implementing(hook, timed), "lab-c")
    plugins.add(implementing(hook, lambda self: ["/dev/ttyUSB0"]), "lab-d")

    failed, devices, timed_devices, other = plugins.probe_devices(0.25)

    assert (failed.distribution, failed.given) == ("lab-a", ())
    assert failed.error == "PermissionError: cannot list the bus"
    assert (devices.error, devices.given[0].advice) == ("", "add yourself to the group dialout")
    assert timed_devices.given[0].serial == "0.25"
    assert other.error == "graspsense_probe_devices gave '/dev/ttyUSB0': it takes FoundDevice only"


@pytest.mark.parametrize("failure", [RuntimeError("no room on the disk"), SystemExit("no room on the disk")])
def test_an_observer_that_raises_stops_nobody_and_is_reported_once(caplog, failure):
    seen = example("graspsense_grasp_event")
    failing = implementing("graspsense_grasp_event", raising(failure))
    plugins = IsolatedPlugins()
    for plugin, name in ((failing, "lab-first"), (seen, "lab-seen"), (type(failing)(), "lab-last")):
        plugins.add(plugin, name)

    with caplog.at_level(logging.WARNING, "graspsense.plugins"):
        plugins.grasp_event(RUN, EVENT)
        plugins.grasp_event(RUN, EVENT)

    assert seen.events == ["both pads touch", "both pads touch"]
    assert [record.getMessage() for record in caplog.records] == [
        f"{name} 0.1 failed in graspsense_grasp_event and is passed over: "
        f"{type(failure).__name__}: no room on the disk"
        for name in ("lab-first", "lab-last")
    ]


def test_an_observer_does_not_swallow_an_interrupt():
    interrupted = implementing("graspsense_run_starting", raising(KeyboardInterrupt()))

    with pytest.raises(KeyboardInterrupt):
        IsolatedPlugins(interrupted).run_starting(RUN)


def test_a_hook_that_a_plugin_owns_collects_from_all_that_implement_it(caplog):
    def stiff(self, scale):
        return 2.0 * scale

    failing = raising(ValueError("no such term"))
    with IsolatedPlugins(builtins=False) as plugins:
        for implementation, name in ((stiff, "lab-a"), (failing, "lab-b"), (stiff, "lab-c")):
            plugins.add(implementing("lab_terms", implementation, optionalhook=True), name)

        assert collect("lab_terms", scale=3.0) == (("lab-a", 6.0), ("lab-c", 6.0))
        assert collect("nobody_implements_this") == ()
    assert "lab-b 0.1 failed in lab_terms" in caplog.text
