"""The faults of the emulated board: each does from its time on what its setting says, and nothing before."""

import pytest
from cases import every_case

from graspsense.plugin_api import EFFORT, Command, ConfigError, create
from graspsense_pr2_gripper.config import FaultConfig
from graspsense_pr2_gripper.protocol import (
    EFFORT_KIND,
    LEFT_ABSENT,
    OWN_LIMIT,
    RIGHT_ABSENT,
    SLICE_CELLS,
    OutputReport,
    decode_input,
    encode_output,
)

SIDES = {"left": range(22), "right": range(22, 44), "both": range(44)}
AT_S = 0.2
"""Device time from which on the faults act: after four cell images."""


def reports(wire, count=600):
    return [decode_input(data) for _ in range(count) for data in wire.step()]


def commanded(wire, newtons, count=20):
    """Return the reports of a board that is commanded this effort before each."""
    effort = OutputReport(1, EFFORT_KIND, round(newtons * 1e6), OWN_LIMIT, OWN_LIMIT)
    sent = []
    for counter in range(count):
        wire.output(encode_output(effort._replace(counter=counter)))
        sent += reports(wire, 1)
    return sent


def by_cell(sent):
    """Return device time and value of each cell, as they come."""
    values = {cell: [] for cell in range(44)}
    for report in sent:
        if report.image:
            for i, value in enumerate(report.cells):
                values[report.slice * SLICE_CELLS + i].append((report.time_us, value))
    return values


@pytest.fixture(scope="module")
def healthy(board):
    """What a healthy board sends."""
    return reports(board())


def faulty_reports(board, **faults):
    return reports(board(faults=FaultConfig(**faults)))


@pytest.mark.slow
@every_case(("kind", "side"), [("stuck", "left"), ("numb", "right"), ("zero", "both")])
def test_cells_of_a_fingertip_go_wrong_from_a_time_on(board, healthy, kind, side):
    faulty = faulty_reports(board, pad_fault=kind, pad_side=side, pad_at_s=AT_S)
    good, bad = by_cell(healthy), by_cell(faulty)
    assert {report.status for report in faulty} == {0}
    for cell in range(44):
        healthy_values = [value for time_us, value in bad[cell] if time_us < AT_S * 1e6]
        after = [value for time_us, value in bad[cell] if time_us >= AT_S * 1e6]
        assert healthy_values == [value for time_us, value in good[cell] if time_us < AT_S * 1e6]
        if cell not in SIDES[side]:
            assert bad[cell] == good[cell]
        elif kind == "numb":
            assert 5 <= len(set(after)) <= 7
            assert max(after) - min(after) <= 6
        else:
            assert len(set(after)) == 1
            assert (after[0] > 0) == (kind == "stuck")
    assert any(len({value for _, value in good[cell]}) > 3 for cell in SIDES[side]), "a healthy cell varies"


@every_case(
    ("faults", "bits"),
    [
        ({"pad_fault": "absent", "pad_side": "right", "pad_at_s": AT_S}, RIGHT_ABSENT),
        ({"pad_fault": "absent", "pad_side": "both", "pad_at_s": AT_S}, LEFT_ABSENT | RIGHT_ABSENT),
        ({"status_bits": 0x8005, "status_at_s": AT_S}, 0x8005),
    ],
)
def test_status_bits_are_set_from_a_time_on_and_change_no_cell(board, healthy, faults, bits):
    faulty = faulty_reports(board, **faults)
    assert by_cell(faulty) == by_cell(healthy)
    assert [report.status for report in faulty] == [0] * 200 + [bits] * 400


@every_case("side", SIDES)
def test_cells_drift_on_the_side_and_from_the_time_that_are_set(board, healthy, side):
    faulty = faulty_reports(board, drift_counts_s=500.0, pad_side=side, pad_at_s=AT_S)
    good, bad = by_cell(healthy), by_cell(faulty)
    for cell in range(44):
        for (time_us, value), (_, drifted) in zip(good[cell], bad[cell], strict=True):
            drifts = cell in SIDES[side] and time_us >= AT_S * 1e6
            assert drifted - value == (round(500.0 * (time_us * 1e-6 - AT_S)) if drifts else 0)


def test_image_counter_stands_still_and_only_a_stale_image_tells_its_age(board, healthy):
    frozen, stale = (
        faulty_reports(board, image_fault=fault, image_at_s=AT_S) for fault in ("frozen", "stale")
    )
    assert healthy[-1].image == 14, "0.6 s, with an image each 41 ms"
    for sent in (frozen, stale):
        assert [report.image for report in sent[:200]] == [report.image for report in healthy[:200]]
        assert {report.image for report in sent[200:]} == {healthy[200].image}
    assert max(report.image_age_us for report in frozen) <= 41_000
    ages = [report.image_age_us for report in stale[200:]]
    assert ages[:10] == list(range(ages[0], ages[0] + 10_000, 1000))
    assert ages[-1] == 0xFFFF


@every_case(
    ("kind", "gain", "reported", "applied_n", "strong_s"),
    [
        ("motor", 5.0, 75_000_000, 75.0, 0.009),
        ("motor", 0.5, 7_500_000, 15.0, 0.0),
        ("motor", 0.0, 0, 15.0, 0.0),
        ("motor", -1.0, -15_000_000, 15.0, 0.0),
        ("effort_report", 0.2, 3_000_000, 15.0, 0.0),
    ],
)
def test_motor_or_its_report_is_a_multiple_of_the_command(board, kind, gain, reported, applied_n, strong_s):
    wire = board(faults=FaultConfig(**{f"{kind}_gain": gain, f"{kind}_at_s": 0.01}))
    sent = commanded(wire, 15.0)
    assert {report.effort_un for report in sent[1:10]} == {15_000_000}
    assert {report.effort_un for report in sent[11:]} == {reported}
    assert wire.firmware.largest_effort_n == applied_n
    assert wire.firmware.strong_s == pytest.approx(strong_s)


@every_case("rate", [0.0, 2.0])
def test_clock_of_the_device_runs_at_another_rate(board, rate):
    faulty = faulty_reports(board, clock_rate=rate, clock_at_s=AT_S)
    assert [report.time_us for report in faulty[:201]] == list(range(0, 201_000, 1000))
    assert [report.time_us - 200_000 for report in faulty[200:]] == [
        round(1000 * rate * i) for i in range(400)
    ]
    assert [report.sequence for report in faulty] == list(range(600))


@every_case(
    ("keys", "said"),
    [
        ({"pad_side": "left"}, "pad_fault"),
        ({"pad_at_s": 1}, "drift_counts_s"),
        ({"image_at_s": 1}, "image_fault"),
        ({"status_at_s": 1}, "status_bits"),
        ({"motor_at_s": 1}, "motor_gain"),
        ({"effort_report_at_s": 1}, "effort_report_gain"),
        ({"clock_at_s": 1}, "clock_rate"),
        ({"identity": {"magic": 7}}, "watchdog_ms"),
        ({"identity": {"watchdog_ms": 0.5}}, "whole number"),
        ({"identity": {"watchdog_ms": 70000}}, "65535"),
    ],
)
def test_fault_that_cannot_act_is_a_users_mistake(keys, said):
    with pytest.raises(ConfigError, match=said):
        create("sensor-backend", "pr2", transport="emulated", faults=keys).open(0)


def test_report_of_a_grasp_tells_what_the_body_felt_whatever_the_board_reported():
    """40 N for 100 ms and 20 N for 100 ms, of which the board reports a tenth; the fingers do not reach the object."""
    backend = create("sensor-backend", "pr2", transport="emulated", faults={"effort_report_gain": 0.1})
    backend.open(0)
    efforts = []
    for value in [40.0] * 100 + [20.0] * 100:
        efforts.append(backend.read(0.1).frame.effort_n)
        backend.apply(Command(EFFORT, value, float("inf"), float("inf")))
    backend.close()
    report = backend.report()
    assert max(efforts) == pytest.approx(4.0)
    assert (report["largest_effort_n"], report["seconds_above_30_n"]) == (40.0, pytest.approx(0.1))
    assert report["largest_force_n"] == report["true_peak_force_n"]
