"""Every hook has a case of its kind, and an example in its docstring that runs."""

from __future__ import annotations

import logging
import re
import types
from asyncio import CancelledError

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
from graspsense.core.values.signals import GraspEvent, Phase
from graspsense.core.values.trial import RunInfo
from graspsense.experiment_api import ExperimentKindEntry
from graspsense.plugin_api import (
    CommandEntry,
    PipelineEntry,
    PluginUnavailable,
    UnknownName,
)
from graspsense.scaffold.make import KINDS
from graspsense.simulator_api import collect
from graspsense.testing.samples import a_trial

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


RESOURCES = {
    "graspsense_models": (ModelEntry, "lab-cans", "resource", "lab_hand:models/cans.json"),
    "graspsense_emulators": (EmulatorEntry, "lab-hand", "target", "lab_hand.emulator:emulate"),
    "graspsense_live_observers": (LiveObserverEntry, "lab-wall", "target", "lab_hand.wall:observe"),
    "graspsense_conformance_checks": (
        ConformanceCheckEntry,
        "fingers-have-names",
        "hook",
        "lab_hand_fingers",
    ),
    "graspsense_pipelines": (PipelineEntry, "lab", "resource", "lab_hand:pipelines/lab.toml"),
    "graspsense_commands": (CommandEntry, "home-hand", "target", "lab_hand.cli:home"),
    "graspsense_identifiers": (IdentifierEntry, "lab-sim", "target", "lab_sim.identification:identify"),
    "graspsense_experiments": (
        ExperimentEntry,
        "worn-cans",
        "resource",
        "lab_study:experiments/worn_cans.toml",
    ),
    "graspsense_experiment_kinds": (ExperimentKindEntry, "wear", "run", "lab_study.wear:run"),
}
"""Hooks of resources; the kind, the name, and a field with its value of what its example gives."""
OBSERVERS = {
    "graspsense_run_starting": ({"run": RUN}, "started", 7),
    "graspsense_grasp_event": ({"run": RUN, "event": EVENT}, "events", "both pads touch"),
    "graspsense_run_finished": ({"run": RUN, "trial": a_trial()}, "outcomes", "steady"),
}
"""Hooks that observe a grasp; with what they are called, and what the example appends to which list."""
ASKED = {
    "graspsense_diagnose": (
        ("these settings", 0.25),
        lambda self, config, timeout_s: [Finding("what I was told", "ok", f"{config} for {timeout_s} s")],
        Finding("what I was told", "ok", "these settings for 0.25 s"),
        {"state": "problem", "numbers": {"baud": 115200}},
    ),
    "graspsense_probe_devices": (
        (0.25,),
        lambda self, timeout_s: [FoundDevice("mine", str(timeout_s), "bus 1", ready=True)],
        FoundDevice("mine", "0.25", "bus 1", ready=True),
        {"advice": "add yourself to the group dialout"},
    ),
}
"""Hooks that ask for devices: with what, an answer that repeats it, and fields of what the example gives."""


def test_every_hook_has_a_test():
    scaffolded = {f"graspsense_{role.replace('-', '_')}s" for role, kind in KINDS.items() if kind.entry}
    assert set(HOOKS) == {*scaffolded, *RESOURCES, *OBSERVERS, *ASKED}


@every_case("hook", RESOURCES)
def test_a_resource_hook_gives_its_resource(hook):
    kind, name, field, value = RESOURCES[hook]
    (resource,) = IsolatedPlugins(example(hook), builtins=False).resources(kind)

    assert (resource.name, getattr(resource.entry, field)) == (name, value)


@every_case("hook", OBSERVERS)
def test_an_observer_hook_is_called_with_what_it_observes(hook):
    arguments, kept, value = OBSERVERS[hook]
    module = example(hook)

    IsolatedPlugins(module).collect(hook, **arguments)

    assert getattr(module, kept) == [value]


def test_the_documented_hand_has_the_channels_of_its_fingers():
    sources = re.findall(r"```python\n(from .*?)```", DOCS, re.DOTALL)
    (code,) = (source for source in sources if "class LabHand(" in source)
    names: dict = {}
    exec(compile(code, "hooks.md", "exec", dont_inherit=True), names)

    class Hand(names["LabHand"]):
        open = read = apply = tare = close = None

    def channels(**settings):
        return [channel.name for channel in Hand(names["LabHandConfig"](**settings)).channels]

    assert channels() == ["gap", "velocity"]
    assert channels(fingers="force-sensing") == ["gap", "velocity", "force_left", "force_right"]


def test_an_identifier_that_is_not_there_is_told_with_what_to_install():
    plugins = IsolatedPlugins(example("graspsense_identifiers"))

    with pytest.raises(UnknownName, match=r"graspsense-identify:\n.*graspsense\[identify\]"):
        plugins.resource(IdentifierEntry, "sim")
    with pytest.raises(UnknownName, match=r"'replay'.*lab-sim"):
        plugins.resource(IdentifierEntry, "replay")


def test_a_kind_of_experiment_names_what_it_runs_and_its_keys():
    kind = IsolatedPlugins(example("graspsense_experiment_kinds")).resource(ExperimentKindEntry, "wear")

    assert kind.targets == ("run", "keys", "result", "findings")
    with pytest.raises(ValueError, match="'run' and 'keys'"):
        ExperimentKindEntry(name="wear", run="lab_study.wear:run", summary="without keys")


def test_a_file_of_a_plugin_that_cannot_be_imported_is_unavailable():
    plugins = IsolatedPlugins(example("graspsense_experiments"))

    with pytest.raises(PluginUnavailable, match="lab_study"):
        plugins.resource(ExperimentEntry, "graspsense-test/worn-cans").file()


@every_case("hook", ASKED)
def test_a_hook_that_asks_for_devices_has_the_answer_or_the_error_of_each_plugin(hook):
    arguments, repeating, repeated, fields = ASKED[hook]
    plugins = IsolatedPlugins(builtins=False)
    failing = implementing(hook, raising(PermissionError("cannot list the bus")))
    wrong = implementing(hook, lambda self: ["/dev/ttyUSB0"])
    for number, plugin in enumerate((failing, example(hook), implementing(hook, repeating), wrong)):
        plugins.add(plugin, f"lab-{number}")

    failed, shown, told, other = getattr(plugins, hook.removeprefix("graspsense_"))(*arguments)

    assert (failed.distribution, failed.given) == ("lab-0", ())
    assert failed.error == "PermissionError: cannot list the bus"
    assert (shown.error, {field: getattr(shown.given[0], field) for field in fields}) == ("", fields)
    assert told.given == (repeated,)
    assert other.error == f"{hook} gave '/dev/ttyUSB0': it takes {type(repeated).__name__} only"


def test_a_finding_is_in_one_of_three_states():
    with pytest.raises(ValueError, match=r"'state'.*\('ok', 'note', 'problem'\)"):
        Finding("cable", "fine", "straight")  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [RuntimeError, SystemExit, CancelledError])
def test_an_observer_that_raises_stops_nobody_and_is_reported_once(caplog, kind):
    seen = example("graspsense_grasp_event")
    failing = implementing("graspsense_grasp_event", raising(kind("no room on the disk")))
    plugins = IsolatedPlugins()
    for plugin, name in ((failing, "lab-first"), (seen, "lab-seen"), (type(failing)(), "lab-last")):
        plugins.add(plugin, name)

    with caplog.at_level(logging.WARNING, "graspsense.plugins"):
        for _ in range(2):
            assert plugins.collect("graspsense_grasp_event", run=RUN, event=EVENT) == ()

    assert seen.events == ["both pads touch", "both pads touch"]
    assert [record.getMessage() for record in caplog.records] == [
        f"{name} 0.1 failed in graspsense_grasp_event and is passed over: {kind.__name__}: no room on the disk"
        for name in ("lab-first", "lab-last")
    ]


def test_an_observer_does_not_swallow_an_interrupt():
    interrupted = implementing("graspsense_run_starting", raising(KeyboardInterrupt()))

    with pytest.raises(KeyboardInterrupt):
        IsolatedPlugins(interrupted).collect("graspsense_run_starting", run=RUN)


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
