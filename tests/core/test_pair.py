"""Two grippers in one run: one axis of time, one rule when one of them fails, two trials that name each other."""

from threading import Condition
from types import SimpleNamespace

import pytest
from attrs import evolve
from cases import every_case
from commands import answered, refused
from grippers import Scripted, bottle, squeezing

from graspsense.core.components.roles import SensorBackend
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.pair import Member, run_pair
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.errors import NoDevice
from graspsense.core.values.signals import Outcome, Reading
from graspsense.plugin_api import create
from graspsense.recording.reader import read_recorded


class Slow(Scripted):
    """Gives every tenth tick of another gripper, and has another name."""

    def open(self, seed):
        return evolve(super().open(seed), name="slow", rate_hz=100.0)

    def read(self, timeout_s):
        reading = super().read(timeout_s)
        self.k += 9
        return reading._replace(frame=reading.frame._replace(dt_s=0.01))


class Late(Scripted):
    """Its clock began 100 s before that of the others."""

    def read(self, timeout_s):
        frame, pads, signals = super().read(timeout_s)
        later = frame._replace(t_s=frame.t_s + 100.0), pads._replace(t_s=pads.t_s + 100.0)
        return Reading(*later, signals)


def grasping(backend, seen=None, name=""):
    """Return the grasp of a member of a pair, which fails for the other as `graspsense run` says.

    Into `seen` go the ticks of both grippers, in the order in which they came.
    """

    def grasp(member):
        def take(reading, phase, command):
            seen.append((name, reading.frame.t_s))

        sinks = [] if seen is None else [SimpleNamespace(take=take)]
        controller = create("controller", "hybrid")
        done = run_grasp(member.gripper(backend), controller, RunConfig(hold_s=0.05), sinks=sinks)
        failed = done.outcome in (Outcome.ABORTED, Outcome.DEVICE_LOST)
        return done, done.reason if failed else ""

    return grasp


def test_two_grippers_on_virtual_clocks_advance_together_whatever_their_rates():
    seen = []
    fast, slow = run_pair(
        grasping(Scripted(squeezing, bottle), seen, "fast"), grasping(Slow(squeezing, bottle), seen, "slow")
    )
    assert fast.outcome == slow.outcome == Outcome.STEADY
    latest = {}
    ends = min(grasp.trace.t_s[-1] for grasp in (fast, slow))
    for name, t_s in seen:
        latest[name] = t_s
        if len(latest) == 2 and t_s < ends:
            assert abs(latest["fast"] - latest["slow"]) <= 0.02 + 1e-9


@pytest.mark.slow
def test_a_grasp_of_a_pair_is_the_grasp_alone():
    alone, *_ = grasping(Scripted(squeezing, bottle))(SimpleNamespace(gripper=lambda backend: backend))
    left, right = run_pair(
        grasping(Scripted(squeezing, bottle)), grasping(Scripted(squeezing, bottle, clock="device"))
    )
    assert left.outcome == right.outcome == alone.outcome
    assert left.trace.t_s.tolist() == alone.trace.t_s.tolist()
    assert left.trace.force_left_n.tolist() == alone.trace.force_left_n.tolist()
    assert any("beside scripted" in note for note in left.device.notes)


@pytest.mark.slow
@every_case(("lost", "place"), [("lose_at", 0), ("silent_from", 1)])
def test_both_let_go_if_one_is_lost(lost, place):
    sound, broken = Scripted(squeezing, bottle), Scripted(squeezing, bottle, **{lost: 1300})
    grasps = run_pair(*map(grasping, [sound, broken] if place else [broken, sound]))
    kept, gone = grasps[1 - place], grasps[place]
    assert (kept.outcome, gone.outcome) == (Outcome.ABORTED, Outcome.DEVICE_LOST)
    assert "of this pair" in kept.reason
    # It was lost in the squeeze, 1.3 s after the begin: the other one opens from the same time on, then relaxes.
    assert kept.trace.t_s[-1] == pytest.approx(1.3, abs=0.01)
    assert [command.value for command in sound.commands[-2:]] == [-20.0, 0.0]
    assert sound.closed == broken.closed == 1


def test_both_let_go_if_the_user_ends_the_run():
    class Stopped(Scripted):
        """The user presses Ctrl-C in its squeeze."""

        def read(self, timeout_s):
            if self.k == 1300:
                self.k += 1
                raise KeyboardInterrupt
            return super().read(timeout_s)

    sound = Scripted(squeezing, bottle)
    stopped, other = run_pair(grasping(Stopped(squeezing, bottle)), grasping(sound))
    assert stopped.outcome == other.outcome == Outcome.ABORTED
    assert (stopped.interrupted, "interrupted" in other.reason, sound.closed) == (True, True, 1)


def test_the_clock_of_a_device_is_shifted_to_the_common_axis_with_its_images():
    sound, late = (kind(squeezing, bottle, clock="device") for kind in (Scripted, Late))
    _, shifted = run_pair(grasping(sound), grasping(late))
    assert 0.0 <= shifted.trace.t_s[0] < 50.0
    assert -100.1 < shifted.report["clock_offset_s"] < 0.0
    # Images follow the frames in which they came by less than their period.
    assert shifted.trace.pad_t_s[-1] == pytest.approx(shifted.trace.t_s[-1], abs=0.1)


def test_a_gripper_of_a_pair_declares_what_it_declares_alone():
    gripper = Scripted(squeezing, bottle)
    gripper.command_delay_s, gripper.least_force_n, gripper.closes_itself = 0.25, 3.0, {"force": "at 20 mm/s"}
    paired = Member(Condition()).gripper(gripper)
    # Of the role, so that what a gripper may declare some day is here as well.
    declared = {name for name, value in vars(SensorBackend).items() if not callable(value) and name[0] != "_"}
    for name in declared - {"channels"}:
        assert getattr(paired, name) == getattr(gripper, name), name


def test_a_gripper_that_is_not_there_is_told_and_the_other_is_closed():
    class Absent(Scripted):
        def open(self, seed):
            raise NoDevice("no gripper at port 7")

    sound = Scripted(squeezing, bottle)
    with pytest.raises(NoDevice, match="port 7"):
        run_pair(grasping(sound), grasping(Absent(squeezing, bottle)))
    assert (sound.commands, sound.closed) == ([], 1)


@pytest.mark.slow
def test_the_trials_of_a_pair_are_kept_and_name_each_other(tmp_path):
    plain, store = tmp_path / "second.toml", tmp_path / "trials"
    plain.write_text(
        '[gripper]\ntype = "sim"\nobject = "block"\nrate_hz = 250.0\n'
        '[controller]\ntype = "hybrid"\n[features]\ntype = "chitta"\n'
    )
    simple = ("--object", "block", "-o", "classifier.type=none", "-o", "gripper.rate_hz=250")
    both = answered("run", "--beside", plain, *simple, "--save", store)["grippers"]
    assert {each["kept"]["trial"] for each in both} == {1, 2}
    named = {each["labels"]["beside"] for each in both}
    paths = list((store / "recordings").glob("*.mcap"))
    assert named == {path.name for path in paths}
    for path in paths:
        assert named - {read_recorded(path).record().labels["beside"]} == {path.name}


def test_what_is_of_one_grasp_does_not_go_with_a_pair():
    assert "--beside" in refused("run", "--beside", "default", "--dry-run")
