"""The feature set `contact-image`: known contacts on an array, with three forces a cell, and before a camera."""

import math

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st
from traces import made_trace

from graspsense.core.values.signals import Phase
from graspsense.core.values.trace import ImageTrace
from graspsense.plugin_api import create
from graspsense.plugins.features.contact_image import moments
from graspsense.testing.samples import squeeze

ROWS, COLUMNS = 12, 16
PLACES = np.indices((ROWS, COLUMNS)).astype(np.float64)


def bump(row, column, long=1.0, short=1.0, angle=0.0):
    """A pressure whose first axis has this angle from the direction of a row; `long` and `short` are deviations."""
    down, along = PLACES[0] - row, PLACES[1] - column
    first_axis = along * math.cos(angle) + down * math.sin(angle)
    second_axis = down * math.cos(angle) - along * math.sin(angle)
    return np.exp(-0.5 * ((first_axis / long) ** 2 + (second_axis / short) ** 2))


WHOLE = (Phase.APPROACH, Phase.SQUEEZE, Phase.HOLD, Phase.RELEASE)
ZERO = np.zeros((ROWS, COLUMNS))


def grasp(images, phases=WHOLE):
    """A trace of four ticks, one image in each."""
    t_s = 0.1 * np.arange(len(images))
    trace = made_trace(np.zeros((len(images), 3)), phases=phases[: len(images)], t_s=t_s)
    return evolve(trace, signals={"tactile": ImageTrace(t_s=t_s, cells=cells_of(images))})


def cells_of(images):
    """Return the images with their cells in one row, as a gripper without three forces a cell gives them."""
    images = np.asarray(images)
    return images.reshape(len(images), -1) if images.shape[1:] == (ROWS, COLUMNS) else images


def extract(images, phases=WHOLE, **settings):
    settings = {"array": "tactile", "rows": ROWS, "columns": COLUMNS, "least_share": 1e-3, **settings}
    return create("feature-set", "contact-image", **settings).extract(grasp(images, phases))


def test_a_turned_ellipse_has_its_place_its_axes_and_its_angle():
    pressed = bump(5.5, 8.0, 2.0, 1.0, 0.5)
    # The image in the release, which is twice as strong, does not count.
    f = extract([3.0 + share * pressed for share in (0.0, 0.6, 1.0, 2.0)])
    assert (f["centre_row"], f["centre_column"]) == pytest.approx((5.5, 8.0), abs=0.02)
    assert (f["long_axis"], f["short_axis"]) == pytest.approx((2.0, 1.0), rel=0.02)
    assert f["angle"] == pytest.approx(0.5, abs=0.01)
    assert (f["total"], f["largest"]) == pytest.approx((float(np.sum(pressed)), float(np.max(pressed))))
    assert f["shift_row_50"] == pytest.approx(0.0, abs=1e-9)
    assert f.reasons["shear_first"] == f.reasons["shear_second"]


def test_the_centre_shifts_from_where_half_of_the_total_is_reached():
    f = extract([ZERO, 0.6 * bump(4.0, 6.0), bump(5.0, 9.0)])
    assert (f["shift_row_50"], f["shift_column_50"]) == pytest.approx((1.0, 3.0), abs=0.01)


def test_the_contact_grows_from_where_a_quarter_and_three_quarters_of_the_total_are_reached():
    wide, narrow = bump(5.5, 8.0, 2.0), bump(5.5, 7.0, 1.0, 0.5)
    share = float(np.sum(wide) / np.sum(narrow))
    f = extract([ZERO, 0.3 * share * narrow, 0.8 * wide, wide])
    assert (f["growth_long_25"], f["growth_short_25"]) == pytest.approx((1.0, 0.5), abs=0.05)
    assert f["shift_column_25"] == pytest.approx(1.0, abs=0.01)
    assert [f[f"growth_long_{share}"] for share in (50, 75)] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_three_forces_a_cell_give_pressure_and_shear():
    pressed = bump(5.0, 8.0, 1.5)
    forces = np.stack([0.2 * pressed, -0.1 * pressed, pressed], axis=-1).reshape(-1, 3)
    offset = np.array([1.0, 2.0, 3.0])
    f = extract([np.tile(offset, (len(forces), 1)), forces + offset], components=3)
    expected = np.array([1.0, 0.2, -0.1]) * float(np.sum(pressed))
    assert [f[name] for name in ("total", "shear_first", "shear_second")] == pytest.approx(expected.tolist())


def test_several_arrays_have_the_features_of_each_with_its_name_in_front():
    trace = grasp([ZERO, bump(4.0, 6.0)])
    tactile = trace.signals["tactile"]
    both = evolve(trace, signals={"tactile": tactile, "thumb": evolve(tactile, cells=tactile.cells * 2)})
    one_array, features = (
        create("feature-set", "contact-image", array=names, rows=ROWS, columns=COLUMNS)
        for names in ("tactile", "tactile, thumb")
    )
    alone, f = one_array.extract(both), features.extract(both)
    assert [channel.name for channel in features.requires] == ["tactile", "thumb"]
    assert set(f.names) == {feature.name for feature in features.features}
    assert (f["tactile_total"], f["thumb_total"]) == pytest.approx((alone["total"], 2.0 * alone["total"]))
    assert f["thumb_centre_row"] == pytest.approx(alone["centre_row"])


def test_a_camera_counts_how_much_its_colours_change_in_either_direction():
    empty = np.full((ROWS, COLUMNS, 3), 100, np.uint8)
    touched = empty.copy()
    touched[3:5, 6:10, 0] += 90
    touched[3:5, 6:10, 1] -= 60
    f = extract([empty, touched], components=3, dtype="uint8", unit="1")
    assert (f["area"], f["total"]) == pytest.approx((8 / (ROWS * COLUMNS), 8 * 50.0))
    assert (f["centre_row"], f["centre_column"], f["angle"]) == pytest.approx((3.5, 7.5, 0.0))
    assert "shear_first" in f.reasons


PRESSED = bump(5.0, 8.0)
LOST = np.where(np.arange(ROWS * COLUMNS).reshape(ROWS, COLUMNS) == 0, math.nan, PRESSED)


@every_case(
    ("images", "phases"),
    [
        # The zero is the mean of the images before the squeeze, and without phases the first one.
        ((ZERO + 1.0, ZERO + 3.0, PRESSED + 2.0), (Phase.APPROACH, Phase.APPROACH, Phase.SQUEEZE)),
        ((ZERO, PRESSED, PRESSED), (Phase.APPROACH,) * 3),
        # A cell without a number does not change.
        ((ZERO, LOST), (Phase.APPROACH, Phase.SQUEEZE)),
    ],
)
def test_the_total_is_that_of_the_change_from_the_zero(images, phases):
    assert extract(images, phases)["total"] == pytest.approx(float(np.sum(PRESSED)), abs=1e-6)


@every_case(
    ("images", "missing"),
    [
        ([ZERO], {"total", "area"}),
        ([ZERO] * 2, {"area", "centre_row", "angle", "shift_row_50"}),
        ([ZERO, ZERO - 1.0], {"area", "centre_row"}),
        ([ZERO, np.eye(ROWS, COLUMNS, 4) * (PLACES[0] == 1)], {"angle"}),
    ],
)
def test_what_an_image_does_not_show_is_missing_with_a_reason(images, missing):
    f = extract(images)
    assert missing <= set(f.reasons)
    assert all(math.isnan(f[name]) for name in missing)


def test_fingertips_have_features_for_each_side():
    left, right = (bump(5.0, column).ravel() for column in (4.0, 9.0))
    trace = grasp([np.zeros(1)] * 3)
    sides = {"pad_left": np.outer([0.0, 0.5, 1.0], left), "pad_right": np.outer([0.0, 0.0, 2.0], right)}
    features = create("feature-set", "contact-image", rows=ROWS, columns=COLUMNS)
    f = features.extract(evolve(trace, pad_t_s=trace.t_s, **sides))
    assert (f["left_centre_column"], f["right_centre_column"]) == pytest.approx((4.0, 9.0), abs=0.01)
    assert f["right_total"] == pytest.approx(2.0 * f["left_total"], rel=1e-5)


def test_cells_in_no_such_grid_have_a_total_and_no_centre_and_no_array_has_nothing():
    """The fingertips of the sample have 22 cells."""
    f = create("feature-set", "contact-image").extract(squeeze())
    assert f["left_total"] > f["left_largest"] > 0.0
    assert "features.rows" in f.reasons["left_centre_row"]
    without = create("feature-set", "contact-image", array="palm").extract(squeeze())
    assert "palm" in without.reasons["total"]


@given(st.integers(-3, 3), st.integers(-4, 4), st.floats(1e-200, 1e200), st.integers(0, 2**32 - 1))
def test_a_contact_that_is_moved_or_pressed_harder_keeps_its_shape(down, along, factor, seed):
    change = np.zeros((16, 20))
    change[5:9, 7:12] = np.random.default_rng(seed).random((4, 5))
    here, there = moments(change, 0.1), moments(factor * np.roll(change, (down, along), (0, 1)), 0.1)
    assert there.centre == pytest.approx((here.centre[0] + down, here.centre[1] + along))
    assert (there.axes, there.area) == (pytest.approx(here.axes), here.area)
    turned = moments(change[:, ::-1], 0.1)
    assert math.sin(turned.angle + here.angle) == pytest.approx(0.0, abs=1e-6)
