"""Whole grasps through the driver: the same bottle as without it, and every way in which the wire can fail."""

import math
import random
from collections import Counter

import numpy as np
import pytest
from attrs import evolve
from cases import every_case

from graspsense import load_pipeline
from graspsense.core.grasp.dry_run import dry_run
from graspsense.core.grasp.runner import run_grasp
from graspsense.gripper_api import Outcome, Phase
from graspsense.plugin_api import ConfigError, create
from graspsense.simulator_api import RunConfig
from graspsense_pr2_gripper.backend import Pr2Backend
from graspsense_pr2_gripper.config import FaultConfig, Pr2Config
from graspsense_pr2_gripper.faults import Wire
from graspsense_pr2_gripper.linkage import FRICTION_N
from graspsense_pr2_gripper.protocol import EFFORT_KIND, decode_output
from graspsense_sim_gripper.run.build import device_info

BARE = "classifier.type=none"
EMULATED = ("gripper.type=pr2", "gripper.transport=emulated", BARE)


PATIENT = RunConfig(seed=1, frame_timeout_s=60.0)
"""For a board that runs by the clock: how long a frame takes on a busy machine is not what is tested."""


@pytest.mark.slow
def test_only_an_emulated_gripper_can_be_given_an_object():
    emulated, real = Pr2Backend(Pr2Config(transport="emulated")), Pr2Backend(Pr2Config())
    assert emulated.with_object("can:full_open").config.object == "can:full_open"
    assert any(kind.default for kind in emulated.objects())
    assert not real.objects()
    with pytest.raises(ConfigError, match="'blok'"):
        emulated.with_object("blok")
    with pytest.raises(ConfigError, match="object 'can:full_open'"):
        real.with_object("can:full_open")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("thing", "seed"),
    [
        ("odwalla:full_closed", 0),
        pytest.param("odwalla:full_open", 3, marks=pytest.mark.long),
        ("can:empty_open", 1),
        ("none", 1),
    ],
)
def test_grasp_through_the_driver_is_the_direct_one(thing, seed, monkeypatch):
    """The direct run is given the 10 ms that eleven slices take after the first, and the protection of a real gripper.

    An encoder tick is 0.3 to 0.4 um of the gap, over which both may differ at any instant; a count is 1/1600 N on one
    pad. What the last bits of a velocity may move is an instant by two ticks of 1 ms. (In the grasp of a full, open
    odwalla bottle with seed 2 they move it by 16: the speed there stays at the threshold of rest.)
    """
    monkeypatch.setattr(
        "graspsense_sim_gripper.run.backend.device_info",
        lambda config: evolve(device_info(config), harmless=False, friction_n=FRICTION_N),
    )
    direct = load_pipeline(options=["gripper.pad_delay_s=0.01", BARE]).grasp(object=thing, seed=seed)
    through = load_pipeline(options=EMULATED).grasp(object=thing, seed=seed)
    assert through.outcome == direct.outcome
    assert through.outcome == (Outcome.NOTHING_THERE if thing == "none" else Outcome.STEADY)
    a, b = direct.features.as_dict(), through.features.as_dict()
    if thing == "none":
        assert all(value is None for value in b.values())
        return
    tick, count, delta_t = 0.4e-6, 1.0 / 1600.0, a["delta_t"]
    allowed = {"p_first": tick, "p_steady": tick, "f_steady": count, "delta_t": 0.0021}
    for rate, step in (("dp_dt", tick), ("df_dt", count)):
        allowed[rate] = (2 * step + 0.0021 * abs(a[rate])) / delta_t
    assert {name for name in allowed if abs(b[name] - a[name]) > allowed[name]} == set()
    approaching = int((direct.trace.pad_t_s < direct.events[-3].t_s - 0.05).sum())
    assert approaching >= 50
    for side in ("pad_left", "pad_right"):
        pads = (getattr(grasp.trace, side)[:approaching] for grasp in (through, direct))
        np.testing.assert_array_equal(*pads)
    assert through.report["lost"] == through.report["corrupt"] == through.report["images_lost"] == 0


class Watched(Wire):
    """A wire with a witness to every command that passes."""

    def __init__(self, *given):
        super().__init__(*given)
        self.commands = []

    def output(self, data):
        command = decode_output(data)  # what the driver sends is never damaged
        if command.kind == EFFORT_KIND:
            self.commands.append(command.effort_un)
        super().output(data)


def random_faults(chance):
    """Between none and all of them at once; a grasp lasts some 3 to 5 s."""

    def some(most):
        return chance.random() * most if chance.random() < 0.4 else 0.0

    def chance_time(odds):
        return chance.random() * 5.0 if chance.random() < odds else math.inf

    return FaultConfig(
        drop=some(0.2), corrupt=some(0.2), repeat=some(0.2), reorder=some(0.2), delay=some(0.1),
        delay_s=0.001 + 0.05 * chance.random(), drop_command=some(0.3), corrupt_command=some(0.3),
        stall_at_s=chance_time(0.3), stall_s=0.001 + 0.2 * chance.random(), unplug_at_s=chance_time(0.2),
        freeze_cell=chance.randrange(-1, 44), freeze_at_s=5.0 * chance.random(),
        drift_counts_s=chance.uniform(-200.0, 200.0) if chance.random() < 0.3 else 0.0,
    )  # fmt: skip


def random_board_faults(chance):
    """One to three faults of the board itself, at any time of a grasp, and some lost reports."""

    def at_s():
        return 4.0 * chance.random()

    kinds = [
        {"pad_fault": chance.choice(["absent", "stuck", "numb", "zero"]), "pad_at_s": at_s(),
         "pad_side": chance.choice(["left", "right", "both"])},
        {"image_fault": chance.choice(["frozen", "stale"]), "image_at_s": at_s()},
        {"status_bits": 1 << chance.randrange(16), "status_at_s": at_s()},
        {"motor_gain": chance.choice([-1.0, 0.0, 0.3, 2.0, 5.0]), "motor_at_s": at_s()},
        {"effort_report_gain": chance.choice([-1.0, 0.0, 5.0]), "effort_report_at_s": at_s()},
        {"clock_rate": chance.choice([0.0, 0.5, 1.01, 3.0]), "clock_at_s": at_s()},
    ]  # fmt: skip
    keys = {"drop": 0.02}
    for kind in chance.sample(kinds, chance.randint(1, 3)):
        keys |= kind
    return FaultConfig(**keys)


OBJECTS = ("odwalla:full_closed", "odwalla:empty_open", "can:empty_open", "naked:full_open", "block", "none")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("grasps", "seed", "faults", "twice"),
    [
        pytest.param(6, 22, random_faults, "STEADY", id="wire"),
        pytest.param(8, 20, random_board_faults, "ABORTED", id="board"),
        pytest.param(1000, 12, random_faults, "STEADY", id="wire, often", marks=pytest.mark.long),
    ],
)
def test_commands_stay_within_limits_whatever_wire_and_board_do(wires, grasps, seed, faults, twice):
    chance, made, outcomes = random.Random(seed), wires(Watched), Counter()
    for i in range(grasps):
        probing_n = chance.choice([17.0, 20.0, 23.0, 90.0, 500.0])
        controller = create("controller", "hybrid", probing_force_n=probing_n, closing_speed_m_s=0.03)
        near = {"object": chance.choice(OBJECTS), "body_config": {"open_gap_m": 0.07}}
        config = Pr2Config(transport="emulated", faults=faults(chance), **near)
        backend = Pr2Backend(config)
        ended = run_grasp(backend, controller, RunConfig(seed=i))
        outcomes[ended.outcome.name] += 1
        witness = made.pop()
        assert all(abs(effort) <= 100_000_000 for effort in witness.commands)
        assert not np.isnan(ended.trace.command).any()
        assert np.max(np.abs(ended.trace.command), initial=0.0) <= 100.0
        assert witness.firmware.effort_un == 0, "whatever happened, it has let go"
        assert backend.report()["let_go_after_s"] <= 0.1
        assert ended.reason or ended.outcome != Outcome.DEVICE_LOST
    assert outcomes[twice] >= 2
    # A board whose clock is wrong can still be told to open: it ends the grasp, and is not lost.
    assert (outcomes["DEVICE_LOST"] >= 1) == (faults is random_faults)


@pytest.mark.slow
@every_case(
    ("fault", "word"), [({"unplug_at_s": 1.4}, "cable"), ({"stall_at_s": 1.4, "stall_s": 2.0}, "no frame")]
)
def test_device_lost_in_the_squeeze_has_let_go(near, grasped, fault, word):
    """In test_device_lost.py it is lost at any time, under every law."""
    ended = grasped(near(fault))
    assert ended.outcome == Outcome.DEVICE_LOST
    assert word in ended.reason
    assert ended.report["let_go_after_s"] <= 0.1
    assert ended.trace.phase[-1] == ended.events[-1].phase == Phase.SQUEEZE
    assert ended.trace.t_s[-1] == pytest.approx(1.399), "the trace holds the last frame there was"


@pytest.mark.usefixtures("answered")
@pytest.mark.parametrize(
    "phase",
    [
        pytest.param(phase, id=phase.name.lower(), marks=() if phase is Phase.SQUEEZE else pytest.mark.slow)
        for phase in Phase
    ],
)
def test_cable_pulled_between_a_frame_and_its_command(near, grasped, phase):
    """At the instant a phase begins: its frame was read, its command finds nobody."""
    backend = near(pace="device" if phase is Phase.HOLD else "lock-step")

    def pull(event):
        if event.phase == phase:
            backend._open().emulation.wire.unplugged = True

    ended = grasped(backend, run=PATIENT, on_event=pull)
    assert ended.outcome == Outcome.DEVICE_LOST
    assert ended.events[-1].phase == phase
    assert ended.report["let_go_after_s"] <= 0.1
    if phase > Phase.APPROACH:
        assert ended.trace.phase[-1] == phase
        assert ended.trace.t_s[-1] == ended.events[-1].t_s


@pytest.mark.slow
def test_short_stall_is_survived_and_counted_as_late(near, grasped):
    ended = grasped(near({"stall_at_s": 0.6, "stall_s": 0.05}))
    assert ended.outcome == Outcome.STEADY
    assert ended.report["lost"] == 50
    assert np.max(np.diff(ended.trace.t_s)) == pytest.approx(0.051)


@pytest.mark.slow
@every_case(
    ("fault", "rate", "counter"),
    [("drop", 0.05, "lost"), ("corrupt", 0.05, "corrupt"), ("repeat", 0.1, "repeated"),
     ("reorder", 0.1, "out_of_order"), ("delay", 0.05, "out_of_order"), ("drop_command", 0.2, ""),
     ("corrupt_command", 0.2, ""), ("freeze_cell", 10, ""), ("drift_counts_s", 1.0, "")],
)  # fmt: skip
def test_one_fault_at_a_time_is_survived_and_counted(near, grasped, fault, rate, counter):
    ended = grasped(near({fault: rate}))
    assert ended.outcome == Outcome.STEADY
    report = ended.report
    if counter:
        sent = report["reports"] + report["lost"] + report["out_of_order"]
        assert report[counter] == pytest.approx(rate * sent, rel=0.4)
    # What is lost follows from damage, too.
    assert {report[other] for other in {"corrupt", "repeated", "out_of_order"} - {counter}} == {0}


def test_object_with_a_real_wire_is_a_users_mistake():
    with pytest.raises(ConfigError, match=r"gripper\.object.*'hidraw'"):
        load_pipeline(options=["gripper.type=pr2", 'gripper.object="block"'])


@pytest.mark.slow
def test_dry_run_shows_a_first_close_that_is_slow_and_weak(monkeypatch):
    """12 N and 15 mm/s until a contact has been seen (run.first_effort_n, run.first_speed_m_s), 20 N after it.

    A squeeze begins with the effort that the approach needed, until the contact is clear.
    """
    looked = []
    monkeypatch.setattr("graspsense_pr2_gripper.opening.search", looked.append)
    rehearsed = dry_run(Pr2Backend(Pr2Config()), create("controller", "hybrid"), RunConfig())
    assert looked == [], "nothing is opened, nor looked for"
    assert rehearsed.outcome == "steady"
    phases = {phase.phase: phase for phase in rehearsed.phases}
    assert list(phases) == ["opening", "taring", "approach", "squeeze", "hold", "release"]
    efforts = {name: (phase.least_n, phase.most_n) for name, phase in phases.items()}
    assert efforts["opening"] == (-12.0, -12.0)
    assert efforts["taring"] == (0.0, 0.0)
    assert efforts["approach"][1] == 12.0
    assert phases["approach"].limited > 0
    assert phases["approach"].fastest_m_s < 0.015
    assert 7.0 < efforts["squeeze"][0] <= efforts["squeeze"][1] == 20.0
    assert efforts["hold"] == (20.0, 20.0)
    assert efforts["release"][0] == -20.0


def test_dry_run_of_a_gripper_without_a_stand_in_says_nothing_of_commands():
    assert dry_run(create("sensor-backend", "sim"), create("controller", "hybrid"), RunConfig()) is None
