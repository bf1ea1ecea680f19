"""What is felt of the plant: encoder, its filter, the cells and their clock."""

from functools import cache

import numpy as np
import pytest
from cases import every_case

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.gripper_api import Phase, revolutions_at
from graspsense.plugin_api import create
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.drive_models import ENCODER_TICKS, LINKAGES
from graspsense_sim_gripper.plant.sensing import PAD_COUNTS_PER_N
from graspsense_sim_gripper.run.backend import SimBackend

HYBRID = create("controller", "hybrid")


def grasp_anew(seed=0, controller=HYBRID, **config):
    return run_grasp(SimBackend(SimConfig(fidelity="fixed", **config)), controller, RunConfig(seed=seed))


grasp = cache(grasp_anew)


@every_case("period_s", [0.041, 0.01, 0.2])
def test_images_come_every_41_ms_or_as_often_as_is_set_beside_frames_every_millisecond(period_s):
    trace = grasp(open_gap_m=0.064, pad_period_s=period_s).trace
    assert np.diff(trace.t_s) == pytest.approx(0.001)
    assert np.diff(trace.pad_t_s) == pytest.approx(period_s, abs=0.0011)
    # Between images the forces stand still.
    assert np.count_nonzero(np.diff(trace.force_left_n)) <= len(trace.pad_t_s)


def test_cells_are_whole_counts_of_16_bits_with_an_offset_of_their_own():
    trace = grasp().trace
    cells = np.concatenate([trace.pad_left, trace.pad_right])
    assert np.array_equal(cells, np.round(cells))
    assert 0 <= cells.min() <= cells.max() <= 65535
    unloaded = trace.pad_left[0]
    assert (unloaded.min() > 2000, unloaded.std() > 50) == (True, True)


def test_after_the_tare_an_unloaded_pad_reads_nothing_within_its_noise():
    trace = grasp(object="none").trace
    # 15 cells of 15 counts of noise, over 1600 counts a newton: 0.036 N, and as much again from the tare.
    assert np.abs([trace.force_left_n[10:], trace.force_right_n[10:]]).max() < 6 * 0.04
    assert trace.force_left_n.std() > 0.01


def test_the_share_of_the_force_on_the_cells_is_what_is_felt():
    result = grasp(object="odwalla:full_closed", spread=False, noise_counts=0.0)
    held = result.trace.phase == Phase.HOLD
    # The gripper is stuck after its overshoot, so the peak is what it holds, but for the shell's creep.
    felt_n, true_n = result.trace.force_left_n[held][-1], result.report["true_peak_force_n"]
    assert felt_n == pytest.approx(0.42 * true_n, rel=0.06)


def test_a_bottle_loads_the_cells_across_its_line_of_contact():
    trace = grasp(object="odwalla:full_closed", spread=False, noise_counts=0.0).trace
    loaded = (trace.pad_left[trace.pad_t_s < trace.t_s[-1]].max(axis=0) - trace.pad_left[0])[7:].reshape(5, 3)
    assert loaded.sum(axis=1).argmax() == 2
    assert loaded[2] == pytest.approx([loaded[2].mean()] * 3, abs=1.5)
    assert loaded.sum() / PAD_COUNTS_PER_N > 5.0


def test_a_saturated_cell_stays_at_its_largest_count():
    # The middle cell of a small patch bears more than 38 N, which 1600 counts a newton carry beyond 16 bits.
    force = create("controller", "force", probing_force_n=100.0)
    scene = 'width_m = 0.05\npatch = "point"\nshare = 1.0\n[[terms]]\ntype = "elastic"\nk1_n_m = 1e5\n'
    trace = grasp(controller=force, object=scene, spread=False, open_gap_m=0.055).trace
    assert trace.pad_left.max() == 65535


def test_the_gap_is_read_in_encoder_ticks_and_the_rate_through_its_filter():
    trace = grasp(spread=False).trace
    approaching = trace.phase == Phase.APPROACH
    ticks = np.array([revolutions_at(LINKAGES["pr2"], gap) for gap in trace.gap_m.tolist()]) * ENCODER_TICKS
    assert ticks == pytest.approx(np.round(ticks), abs=1e-5)
    # At speed the filtered rate is the set 10 mm/s, within what one tick (0.33 um/ms) leaves through 3 ms.
    cruising = trace.velocity_m_s[approaching][500:1500]
    assert cruising == pytest.approx(-0.010, abs=2.5e-4)


def test_the_ideal_sensor_feels_the_true_force_at_every_tick_and_has_no_cells():
    result = grasp(sensor="ideal", spread=False)
    trace = result.trace
    assert len(trace.pad_t_s) == 0
    assert trace.force_left_n.max() == pytest.approx(result.report["true_peak_force_n"])
    squeezing = trace.phase == Phase.SQUEEZE
    assert np.count_nonzero(np.diff(trace.force_left_n[squeezing])) > 0.9 * squeezing.sum()


@pytest.mark.slow
def test_the_ideal_sensor_sees_contact_when_it_happens_the_pads_up_to_an_image_later():
    # From wider apart the contact falls into another phase of the pads' clock: 41 ms at 10 mm/s is 0.41 mm.
    delays = []
    for k in range(8):
        contact_s = []
        for sensor in ("ideal", "pads"):
            trace = grasp(sensor=sensor, spread=False, open_gap_m=0.065 + k * 0.41e-3 / 8).trace
            contact_s.append(trace.t_s[trace.phase == Phase.SQUEEZE][0] - trace.t_s[0])
        delays.append(contact_s[1] - contact_s[0])
    # tau_1 is met on the cells when a bottle's 42 % share of the force has grown that far: some 30 ms later still.
    assert 0.0 < min(delays) < 0.060
    assert max(delays) - min(delays) == pytest.approx(0.041, abs=0.008)


@pytest.mark.slow
def test_cells_that_are_not_there_read_their_offset_and_the_others_as_before():
    whole, middle = (
        grasp(object="odwalla:full_closed", spread=False, pad_cells=cells).trace for cells in (15, 3)
    )
    moved = np.ptp(middle.pad_left[:, 7:], axis=0) > 0
    assert np.flatnonzero(moved).tolist() == [6, 7, 8]  # the middle row, across the line of contact
    early = whole.pad_left[whole.pad_t_s < 2.0]
    assert np.array_equal(middle.pad_left[middle.pad_t_s < 2.0][:, 13:16], early[:, 13:16])
