"""Faults injected in every phase of a grasp with the emulated board: nothing is crushed, and the fault is told."""

import gripper_faults
import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from gripper_faults import FAULTS

from graspsense import load_pipeline
from graspsense.core.components.registry import installed
from graspsense.core.grasp.runner import MAY_BE_CLOSED
from graspsense.core.learn.labelled import Labelled
from graspsense.core.learn.model_file import write_model
from graspsense.core.learn.training import train
from graspsense.core.settings.selected import SelectedComponent
from graspsense.core.values.features import FeatureTable
from graspsense.evaluation.doubt import calibrated
from graspsense_pr2_gripper.config import FaultConfig

pytestmark = pytest.mark.slow
CEILING_N = 1.25 * 20.0 + 7.0
"""The effort of a grasp with the usual probing force: a quarter more, and the declared friction."""
TELLS_NOTHING = {"hold", "squeeze"}
"""Within the last quarter of a second there is no time left to see a fault, and nothing moves any more."""


TICK_S = 0.001 + 1e-9
"""A fault is seen in the tick in which it comes; durations are counted in ticks."""


def check(row, healthy):
    """The invariants of one grasp: effort, true force on the object, and time until the release."""
    name = f"{row.fault}, {row.side}, {row.phase}, {row.controller}: {row.outcome} ({row.words})"
    motor = "motor" in row.fault
    allowed_n = 2.0 * CEILING_N if motor else CEILING_N
    assert row.largest_effort_n <= allowed_n + 1e-6, name
    # A motor that does twice what it is told is seen within a tenth of a second.
    assert row.strong_s <= healthy.strong_s + (0.1 if motor else TICK_S), name
    assert row.largest_force_n <= 1.5 * healthy.largest_force_n, name
    assert row.outcome != "running", name
    # Until the contact, a drift that begins late has moved the force by a quarter of a newton: it has no consequence.
    unseen = row.phase in TELLS_NOTHING or ("drift" in row.fault and row.phase == "approach, late")
    assert row.words or row.outcome != "steady" or unseen, name


NEAR = {"open_gap_m": 0.062}
"""The fingers open to a few millimetres from the bottle: a grasp of less than half the ticks."""


def grasped(controller="hybrid", seed=0, body=NEAR, **faults):
    law = gripper_faults.controller_named(controller)
    return gripper_faults.grasped(law, FaultConfig(**faults), seed, **body)


def test_a_fault_in_the_squeeze_crushes_nothing_and_without_a_fault_nothing_is_told():
    healthy = grasped()
    at_s = gripper_faults.moments(healthy)["squeeze"]
    faulty = grasped(pad_fault="stuck", pad_side="left", pad_at_s=at_s)
    row, sound = (
        gripper_faults.result_of("fingertip stuck", "left", "squeeze", "hybrid", at_s, grasp)
        for grasp in (faulty, healthy)
    )
    assert (sound.outcome, sound.words) == ("steady", "")
    check(row, sound)


@every_case(
    ("fault", "told"),
    [
        ("absent", "left fingertip absent"),
        ("zero", "left pad dead"),
        ("stuck", "left pad stuck"),
        # That the pads disagree follows from it.
        ("numb", "left pad feels more on opening"),
    ],
)
def test_of_a_fingertip_that_fails_in_the_squeeze_the_cause_alone_is_told(fault, told):
    """The squeeze begins after 0.785 s."""
    grasp = grasped(pad_fault=fault, pad_side="left", pad_at_s=0.8)
    assert [warning.split(":")[0] for warning in grasp.warnings] == [told]
    if grasp.outcome.words == "aborted":
        assert grasp.reason == grasp.warnings[0]


@pytest.mark.parametrize(
    ("controller", "faults", "sides"),
    [
        ("hybrid", FAULTS, ("left",)),
        ("velocity", FAULTS[::3], ("right",)),
        ("force", FAULTS[2::3], ("right",)),
    ],
)
def test_every_fault_in_every_phase_crushes_nothing(controller, faults, sides):
    """All of them under one law: what protects the object does not know the law."""
    # A drift is known by the way that the fingers go in free air.
    drifts, others = (
        [fault for fault in faults if ("drift" in fault.name) is drifts] for drifts in (True, False)
    )
    assert drifts
    for some, some_sides, body in ((drifts, ("right",), {}), (others, sides, NEAR)):
        healthy, *rows = gripper_faults.injected((controller,), some, some_sides, **body)
        assert healthy.outcome == "steady", healthy
        assert len(rows) == 5 * sum(len(some_sides) if fault.sided else 1 for fault in some)
        for row in rows:
            check(row, healthy)


def test_hostile_laws_crush_nothing(monkeypatch):
    # Near the object each reaches the ceiling within 1.3 s, before the fingertip is stuck; from far away, one in 10 s.
    run = evolve(gripper_faults.RUN, opening_timeout_s=1.0, grasp_timeout_s=1.0)
    monkeypatch.setattr(gripper_faults, "RUN", run)
    rows = list(gripper_faults.hostile(**NEAR))
    assert len(rows) == 8
    assert sum(row.largest_effort_n == CEILING_N for row in rows) == 6
    for row in rows:
        assert row.largest_effort_n <= CEILING_N, row
        # The ceiling less the friction of the drive.
        assert row.largest_force_n <= CEILING_N - 7.0, row
        assert row.outcome == "aborted", row


@every_case(
    ("faults", "ends"),
    [
        # The effort alone says that the motor is reversed: the fingers are opened.
        ({"effort_report_gain": -1.0, "effort_report_at_s": 0.9}, "opened to"),
        # The fingers close on the command that opens them: they are relaxed.
        ({"motor_gain": -1.0, "motor_at_s": 0.9}, "let go at"),
    ],
)
def test_only_a_motor_that_is_reversed_leaves_the_fingers_closed(faults, ends):
    """The squeeze begins after 0.785 s."""
    grasp = grasped(**faults)
    assert [warning.split(":")[0] for warning in grasp.warnings] == ["motor reversed"]
    assert grasp.events[-1].what.startswith(ends)
    assert (MAY_BE_CLOSED in grasp.reason) is (ends == "let go at")


def test_commands_that_are_lost_are_told():
    assert any(warning.startswith("commands lost") for warning in grasped(drop_command=0.85).warnings)


def test_a_pad_that_is_known_to_be_bad_refuses_the_grasp():
    grasp = grasped(pad_fault="absent", pad_side="right")
    assert grasp.outcome.words == "aborted"
    assert "right" in grasp.reason
    # The fingers never closed.
    assert grasp.report["largest_effort_n"] == 0.0


def test_a_picture_and_a_notebook_show_the_reason_and_the_warnings():
    from graspsense.report.grasp_picture import _words

    trial = emulated_grasp(pad_fault="stuck", pad_side="left", pad_at_s=0.4)
    words = _words(trial)
    assert "left fingertip stuck" in words[0]
    assert any(line.startswith("Object: ") and line.endswith(f"seed {trial.run.seed}") for line in words)
    assert "left fingertip stuck" in trial._repr_html_()


def emulated_grasp(*options, **faults):
    """Return a grasp of the default pipeline with an emulated gripper that has these faults."""
    faults = [f"gripper.faults.{key}={value}" for key, value in faults.items()]
    return load_pipeline(
        options=["gripper.type=pr2", "gripper.transport=emulated", *options, *faults]
    ).grasp()


def test_a_motor_that_reports_what_it_was_told_presses_nothing_with_more():
    grasp = grasped(
        body={}, motor_gain=3.0, motor_at_s=0.9, effort_report_gain=1.0 / 3.0, effort_report_at_s=0.9
    )
    assert grasp.reason.startswith("moves too easily")
    assert grasp.report["largest_force_n"] == 0.0


def test_no_certainty_is_given_to_a_grasp_in_which_a_fault_was_seen(tmp_path):
    """The features of a model's training, and so its certainty, are those of sound pads."""
    sizes = np.repeat([0.0586, 0.066], 30)
    sizes = np.random.default_rng(0).normal(sizes, 0.0005)[:, np.newaxis]
    table = FeatureTable(names=("p_first",), units=("m",), values=sizes)
    trials = Labelled(source="a test", table=table, labels=("bottle",) * 30 + ("can",) * 30)
    component = installed().find("classifier", "c45")
    learner = SelectedComponent(component, component.config_class()())
    model = calibrated(train(component, learner.config, trials, name="m"), learner, trials, 0)
    write_model(tmp_path / "m.json", model)
    options = (
        f"gripper.body_config.open_gap_m={NEAR['open_gap_m']}",
        f"gripper.object={gripper_faults.OBJECT}",
        f"classifier.model={tmp_path / 'm.json'}",
    )
    sound = emulated_grasp(*options).prediction
    faulty = emulated_grasp(*options, pad_fault="numb", pad_side="left", pad_at_s=0.7).prediction
    assert sound.label == faulty.label == "bottle"
    assert sound.certainty > 0.8
    assert sound.prediction_set == ("bottle",)
    assert (faulty.certainty, faulty.prediction_set, faulty.coverage) == (None, (), None)
    assert faulty.no_certainty
