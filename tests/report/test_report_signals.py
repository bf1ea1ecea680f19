"""Heat maps, curves and spectrograms of the arrays and further channels of a grasp, as a page shows them."""

import json
import re
from math import isnan, nan, pi

import numpy as np
import pytest
from attrs import evolve
from traces import made_trace

from graspsense.core.components.channels import as_json, from_json
from graspsense.core.values.signals import Phase
from graspsense.core.values.trace import ImageTrace, SampleTrace
from graspsense.plugin_api import Channel, FastChannel, TactileArray
from graspsense.report.further_channels import INTERVALS, channel_figures, envelope, spectrogram
from graspsense.report.tactile import layout_of, moments, tactile_figures

TICKS, RATE_HZ = 1000, 3000.0
PALM = TactileArray("palm", "N", 100.0, finger="palm", rows=2, columns=3)
TIP = TactileArray("pads", "counts", 25.0, positions_m=((nan, nan), (0.01, 0.0), (0.0, 0.0), (0.0, 0.005)))
ACCELERATION = FastChannel("acceleration", "m/s2", RATE_HZ, samples=3, axes=("x", "y"))
TEMPERATURE = Channel("motor_temperature", "K", 1000.0)
CHANNELS = (PALM, TIP, ACCELERATION, TEMPERATURE)


def grasp():
    """A grasp of a second: contact at 0.3 s, peak at 0.6 s, rest at 0.7 s, release at 0.9 s; a tone of 400 Hz."""
    t = np.arange(TICKS) / 1000.0
    force = np.interp(t, [0.3, 0.6, 0.7, 0.9], [0.0, 9.0, 6.0, 6.0])
    phases = np.select(
        [t < 0.3, t < 0.7, t < 0.9],
        [int(Phase.APPROACH), int(Phase.SQUEEZE), int(Phase.HOLD)],
        int(Phase.RELEASE),
    )
    trace = made_trace([(0.05, value, value) for value in force], phases=phases)
    images = np.arange(0.005, 1.0, 0.01)
    pressed = np.interp(images, t, force)
    cells = 100.0 + pressed[:, None] * np.arange(6)
    fast = np.arange(3 * TICKS) / RATE_HZ
    values = np.stack([np.sin(2 * pi * 400.0 * fast), np.zeros_like(fast)], axis=1)
    values[1700, 1] = 7.0
    tip = np.tile(50.0, (len(images), 4)) + pressed[:, None] * np.array([0.0, 1.0, 2.0, 3.0])
    return evolve(
        trace,
        pad_t_s=images,
        pad_left=tip,
        pad_right=tip + 1.0,
        signals={
            "palm": ImageTrace(t_s=images, cells=cells),
            "acceleration": SampleTrace(t_s=fast, values=values, lost=4),
            "motor_temperature": 300.0 + t,
        },
    )


def cells_of(figure):
    """The values that the cells of a figure show under the pointer, by moment and cell."""
    cells = re.findall(r"<title>([^<]*), cell (\d+): (\S+) [^<]*</title>", figure)
    return {(moment, int(cell)): float(value.replace("−", "-")) for moment, cell, value in cells}


def test_an_array_is_shown_at_contact_peak_and_rest_as_its_change_since_before_contact():
    _, palm = tactile_figures(grasp(), CHANNELS)
    shown = cells_of(palm)

    assert [shown["contact", cell] for cell in range(6)] == pytest.approx([0.0] * 6, abs=0.2)
    # The last image before the peak at 0.6 s is from 0.595 s, where the force is 8.85 N.
    for moment, force_n in (("peak", 8.85), ("rest", 6.15)):
        for cell in range(6):
            assert shown[moment, cell] == pytest.approx(force_n * cell, rel=1e-3)
    assert "44.2 N" in palm
    assert "on the palm: 6 cells. " in palm


def test_both_fingertips_share_a_figure_and_a_scale_and_cells_without_a_place_are_told():
    tips, _ = tactile_figures(grasp(), CHANNELS)
    shown = cells_of(tips)

    assert shown["peak, left", 3] == shown["peak, right", 3] == pytest.approx(26.55, rel=1e-3)
    assert "are elsewhere" in tips


def test_cells_are_drawn_at_their_places():
    elsewhere, far, near, beside = layout_of(TIP).cells

    # 10 mm along the finger are two pitches of 5 mm; the far end of the finger is at the top.
    assert near.y - far.y == pytest.approx(2 * near.side)
    assert beside.x - near.x == pytest.approx(near.side)
    assert elsewhere.y > near.y + near.side


def test_a_grasp_without_contact_shows_the_end():
    trace = made_trace([(0.05, 0.0, 0.0)] * 10, phase=Phase.APPROACH)
    assert list(moments(trace)) == ["peak", "end"]
    assert moments(made_trace([])) == {}


def test_an_undeclared_array_and_missing_values_are_shown_too():
    trace = grasp()
    cells = trace.signals["palm"].cells.copy()
    cells[:, 2] = nan
    (palm,) = tactile_figures(
        evolve(trace, pad_t_s=np.empty(0), signals={"palm": evolve(trace.signals["palm"], cells=cells)}), ()
    )
    assert "peak, cell 2: missing" in palm


def test_fast_and_scalar_channels_have_curves_and_a_fast_one_its_spectrogram():
    acceleration, temperature = channel_figures(grasp(), CHANNELS)

    assert 'data-name="x m/s2"' in acceleration
    assert 'data-name="y m/s2"' in acceleration
    assert "spectrogram, power " in acceleration
    assert "4 samples were lost" in acceleration
    assert "frequency, Hz" in acceleration
    assert "Motor temperature, in K." in temperature
    assert "spectrogram" not in temperature


def test_a_curve_keeps_the_single_highest_sample_and_a_spectrogram_has_its_maximum_at_the_tone():
    signal = grasp().signals["acceleration"]
    points = envelope(signal.t_s, signal.values[:, 1])
    assert max(value for _, value in points) == 7.0
    assert len(points) <= 2 * INTERVALS

    _, frequencies, decibels = spectrogram(signal.t_s, {"x": signal.values[:, 0]})
    assert frequencies[decibels.max(axis=1).argmax()] == pytest.approx(400.0, abs=RATE_HZ / 256)
    assert decibels.max() == 0.0
    assert spectrogram(signal.t_s[:20], {"x": signal.values[:20, 0]}) is None
    assert spectrogram(signal.t_s, {"x": np.zeros(len(signal.t_s))}) is None


def test_a_recorded_declaration_keeps_cells_without_a_place():
    again = from_json(json.loads(json.dumps(as_json(TIP)).replace("NaN", "null")))
    assert isnan(again.positions_m[0][0])
    assert again.positions_m[1:] == TIP.positions_m[1:]
