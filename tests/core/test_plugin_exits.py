"""What is no Exception in the code of a plugin, as SystemExit: no trace is lost, and nothing ends in silence."""

import math
from asyncio import CancelledError

import numpy as np
import pytest
from attrs import evolve, field, frozen
from cases import every_case
from commands import refused
from grippers import Scripted, bottle, law, settings_with, squeezing

from graspsense.core.components.registry import installed
from graspsense.core.components.run_config import RunConfig
from graspsense.core.components.strict import ValidationFailed, structured
from graspsense.core.grasp.runner import ended_by_itself, run_grasp
from graspsense.core.pipeline.pipeline import GraspInterrupted, grasp_with
from graspsense.core.values.errors import DeviceLost
from graspsense.core.values.signals import EFFORT, Command, Outcome
from graspsense.plugins.classifiers.knn import Knn
from graspsense.plugins.controllers.hybrid import HybridConfig, HybridController

RUN = RunConfig()
HYBRID = HybridController(HybridConfig())


def leaving(*arguments, **named):
    raise SystemExit(3)


def released(gripper):
    return gripper.closed == 1 and gripper.commands[-1].value == 0.0


@pytest.mark.slow
@every_case("error", [SystemExit(0), OSError("Input/output error"), CancelledError("the loop has ended")])
@every_case("method", ["read", "apply", "tare", "close", "report"])
def test_a_gripper_that_ends_the_program_or_fails_ends_the_grasp_and_keeps_the_trace(method, error):
    usual = getattr(Scripted, method)

    def method_of(self, *arguments):
        if self.k >= 1200:
            self.closed += method == "close"
            raise error
        return usual(self, *arguments)

    grasp = run_grasp(type("Leaving", (Scripted,), {method: method_of})(squeezing, bottle), HYBRID, RUN)
    name = type(error).__name__
    assert method == "tare" or len(grasp.trace) > 900
    if method == "report":
        assert (grasp.outcome, grasp.report) == (Outcome.STEADY, {"report_failed": f"{name}: {error}"})
    elif method == "close":
        assert f"closed: {name}: {error} (steady)" in grasp.reason
    elif method != "tare":
        assert (grasp.outcome, name in grasp.reason) == (Outcome.ABORTED, True)


def test_a_gripper_that_ends_the_program_on_opening_is_named():
    gripper = Scripted(squeezing, bottle)
    gripper.open = leaving
    with pytest.raises(DeviceLost, match=r"Scripted raised SystemExit"):
        run_grasp(gripper, HYBRID, RUN)
    assert gripper.closed == 1


@pytest.mark.slow
@every_case("outcome", [99, -1, None, "steady"])
def test_an_outcome_that_there_is_not_aborts_the_grasp_and_keeps_the_trace(outcome):
    gripper = Scripted(squeezing, bottle)
    changed = law(lambda command, state: (command, state._replace(outcome=outcome)), 1100)
    grasp = run_grasp(gripper, changed, RUN)
    assert (grasp.outcome, repr(outcome) in grasp.reason) == (Outcome.ABORTED, True)
    assert (len(grasp.trace) > 800, released(gripper)) == (True, True)
    assert ended_by_itself(0, outcome)[0] is Outcome.ABORTED


def scripted(extract, gripper=Scripted):
    """Return the settings of a scripted gripper, with a feature set whose `extract` is this."""
    settings = settings_with(lambda: gripper(squeezing, bottle))

    class Features(type(settings.features)):
        def create(self):
            features = super().create()
            features.extract = extract
            return features

    return evolve(settings, features=Features(settings.features.component, settings.features.config))


def test_a_feature_set_that_ends_the_program_loses_no_trace():
    trial = grasp_with(scripted(leaving), installed())
    assert (trial.outcome, len(trial.trace) > 900) == (Outcome.STEADY, True)
    assert "SystemExit: 3" in next(iter(trial.features.reasons.values()))


def test_ctrl_c_that_a_plugin_raises_is_not_swallowed():
    def interrupt(*arguments):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        grasp_with(scripted(interrupt), installed())

    class Interrupting(Scripted):
        def read(self, timeout_s):
            return interrupt() if self.k == 1200 else super().read(timeout_s)

    with pytest.raises(GraspInterrupted) as ended:
        grasp_with(settings_with(lambda: Interrupting(squeezing, bottle)), installed())
    assert len(ended.value.trial.trace) > 900


def test_settings_whose_class_ends_the_program_are_wrong_settings():
    @frozen
    class Leaving:
        key: int = field(default=1, validator=leaving)

    with pytest.raises(ValidationFailed) as ended:
        structured({"key": 2}, Leaving, "the test")
    assert [problem.path for problem in ended.value.problems] == [("key",)]


def test_a_plugin_that_ends_one_of_our_commands_is_told_with_its_place(monkeypatch, tmp_path):
    monkeypatch.setattr(Knn, "fit", leaving)
    table = tmp_path / "table.csv"
    table.write_text("kind,p_first\n" + "".join(f"{'ab'[k % 2]},{7 * k % 5}.5\n" for k in range(20)))
    train = ("train", table, "--label", "kind", "--classifier", "knn", "--out", tmp_path / "m.json")
    said = " ".join(refused(*train).split())
    assert "SystemExit: 3 in leaving" in said
    assert "internal error" not in said


class Deceitful(float):
    """A number that says that it is within every limit."""

    __lt__ = __gt__ = __ne__ = lambda self, other: False
    __le__ = __ge__ = __eq__ = lambda self, other: True
    __hash__ = float.__hash__

    def __neg__(self):
        return self

    def __float__(self):
        return 0.0


class TwoFaced(Command):
    """A command that has another value by its name than by its place."""

    __slots__ = ()
    value = 1e6


@pytest.mark.slow
@every_case(
    "command",
    [
        Command(EFFORT, Deceitful(1e6), math.inf, math.inf),
        Command(EFFORT, 1e6, Deceitful(1e6), Deceitful(1e6)),
        Command(EFFORT, np.float64(1e6), np.float64(math.inf), np.float32(math.inf)),
        Command(np.int64(EFFORT), 10**6, math.inf, math.inf),
        TwoFaced(EFFORT, 5.0, math.inf, math.inf),
    ],
)
def test_no_number_of_a_controller_passes_the_limits(command):
    gripper = Scripted(squeezing, bottle, lose_at=1150)
    run_grasp(gripper, law(lambda usual, state: (command, state), 900), RUN)
    squeezed = gripper.commands[1000:]
    assert {type(commanded) for commanded in squeezed} == {Command}
    assert {type(number) for commanded in squeezed for number in commanded} <= {int, float}
    assert max(float.__float__(commanded.value) for commanded in squeezed) <= 100.0


@pytest.mark.slow
@every_case(
    "command", ["20", *(Command(EFFORT, value, math.inf, math.inf) for value in (None, [20.0], "20"))]
)
def test_a_command_that_is_not_made_of_numbers_aborts_the_grasp(command):
    gripper = Scripted(squeezing, bottle)
    grasp = run_grasp(gripper, law(lambda usual, state: (command, state), 1100), RUN)
    assert (grasp.outcome, released(gripper)) == (Outcome.ABORTED, True)
