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


def bump(row, column, long, short, angle):
    """A pressure whose first axis has this angle from the direction of a row; `long` and `short` are deviations."""
    down, along = PLACES[0] - row, PLACES[1] - column
    left_bump, right_bump = (
        along * math.cos(angle) + down * math.sin(angle),
        down * math.cos(angle) - along * math.sin(angle),
    )
    return np.exp(-0.5 * ((left_bump / long) ** 2 + (right_bump / short) ** 2))


def grasp(images, phases=(Phase.APPROACH, Phase.SQUEEZE, Phase.HOLD, Phase.RELEASE)):
    """A trace of four ticks, one image in each."""
    t_s = 0.1 * np.arange(len(images))
    trace = made_trace(np.zeros((len(images), 3)), phases=phases[: len(images)], t_s=t_s)
    return evolve(trace, signals={"tactile": ImageTrace(t_s=t_s, cells=np.asarray(images))})


def extract(images, phases=(Phase.APPROACH, Phase.SQUEEZE, Phase.HOLD, Phase.RELEASE), **settings):
    settings = {"array": "tactile", "rows": ROWS, "columns": COLUMNS, "least_share": 1e-3, **settings}
    return create("feature-set", "contact-image", **settings).extract(grasp(images, phases))


def test_a_turned_ellipse_has_its_place_its_axes_and_its_angle():
    pressed = bump(5.5, 8.0, 2.0, 1.0, 0.5)
    zero = np.full((ROWS, COLUMNS), 3.0)
    images = [zero, zero + 0.6 * pressed, zero + pressed, zero + 2.0 * pressed]
    f = extract([image.ravel() for image in images])

    assert f["centre_row"] == pytest.approx(5.5, abs=0.02)
    assert f["centre_column"] == pytest.approx(8.0, abs=0.02)
    assert f["long_axis"] == pytest.approx(2.0, rel=0.02)
    assert f["short_axis"] == pytest.approx(1.0, rel=0.02)
    assert f["angle"] == pytest.approx(0.5, abs=0.01)
    # The image in the release, which is twice as strong, does not count.
    assert f["total"] == pytest.approx(float(np.sum(pressed)))
    assert f["largest"] == pytest.approx(float(np.max(pressed)))
    assert f["shift_row_50"] == pytest.approx(0.0, abs=1e-9)
    assert f.reasons["shear_first"] == f.reasons["shear_second"]


def test_the_centre_shifts_from_where_half_of_the_total_is_reached():
    images = [np.zeros((ROWS, COLUMNS)), 0.6 * bump(4.0, 6.0, 1.0, 1.0, 0.0), bump(5.0, 9.0, 1.0, 1.0, 0.0)]
    f = extract([image.ravel() for image in images])

    assert (f["shift_row_50"], f["shift_column_50"]) == pytest.approx((1.0, 3.0), abs=0.01)


def test_the_contact_grows_from_where_a_quarter_and_three_quarters_of_the_total_are_reached():
    wide = bump(5.5, 8.0, 2.0, 1.0, 0.0)
    narrow = bump(5.5, 7.0, 1.0, 0.5, 0.0)
    share = float(np.sum(wide) / np.sum(narrow))
    images = [np.zeros((ROWS, COLUMNS)), 0.3 * share * narrow, 0.8 * wide, wide]
    f = extract([image.ravel() for image in images])

    assert (f["growth_long_25"], f["growth_short_25"]) == pytest.approx((1.0, 0.5), abs=0.05)
    assert f["shift_column_25"] == pytest.approx(1.0, abs=0.01)
    assert [f[f"growth_long_{share}"] for share in (50, 75)] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_three_forces_a_cell_give_pressure_and_shear():
    pressed = bump(5.0, 8.0, 1.5, 1.0, 0.0)
    forces = np.stack([0.2 * pressed, -0.1 * pressed, pressed], axis=-1).reshape(-1, 3)
    offset = np.array([1.0, 2.0, 3.0])
    f = extract([np.tile(offset, (len(forces), 1)), forces + offset], components=3)

    total = float(np.sum(pressed))
    assert f["total"] == pytest.approx(total)
    assert (f["shear_first"], f["shear_second"]) == pytest.approx((0.2 * total, -0.1 * total))


def test_several_arrays_have_the_features_of_each_with_its_name_in_front():
    images = [np.zeros(ROWS * COLUMNS), bump(4.0, 6.0, 1.0, 1.0, 0.0).ravel()]
    trace = grasp(images)
    both = evolve(
        trace,
        signals={**trace.signals, "thumb": evolve(trace.signals["tactile"], cells=np.array(images) * 2)},
    )
    layout = {"rows": ROWS, "columns": COLUMNS}
    features = create("feature-set", "contact-image", array="tactile, thumb", **layout)
    layout_features = create("feature-set", "contact-image", array="tactile", **layout).extract(both)
    f = features.extract(both)

    assert [channel.name for channel in features.requires] == ["tactile", "thumb"]
    assert set(f.names) == {feature.name for feature in features.features}
    assert f["tactile_total"] == layout_features["total"]
    assert f["thumb_total"] == pytest.approx(2.0 * layout_features["total"])
    assert f["thumb_centre_row"] == pytest.approx(layout_features["centre_row"])


def test_a_camera_counts_how_much_its_colours_change_in_either_direction():
    empty = np.full((ROWS, COLUMNS, 3), 100, np.uint8)
    touched = empty.copy()
    touched[3:5, 6:10, 0] += 90
    touched[3:5, 6:10, 1] -= 60
    f = extract([empty, touched], components=3, dtype="uint8", unit="1")

    assert f["area"] == 8 / (ROWS * COLUMNS)
    assert f["total"] == pytest.approx(8 * 50.0)
    assert (f["centre_row"], f["centre_column"], f["angle"]) == pytest.approx((3.5, 7.5, 0.0))
    assert "shear_first" in f.reasons


PRESSED = bump(5.0, 8.0, 1.0, 1.0, 0.0).ravel()
NOTHING = np.zeros(ROWS * COLUMNS)


@every_case(
    ("images", "phases"),
    [
        # The zero is the mean of the images before the squeeze, and without phases the first one.
        ((NOTHING + 1.0, NOTHING + 3.0, PRESSED + 2.0), (Phase.APPROACH, Phase.APPROACH, Phase.SQUEEZE)),
        ((NOTHING, PRESSED, PRESSED), (Phase.APPROACH,) * 3),
        # A cell without a number does not change.
        ((NOTHING, np.concatenate(([math.nan], PRESSED[1:]))), (Phase.APPROACH, Phase.SQUEEZE)),
    ],
)
def test_the_total_is_that_of_the_change_from_the_zero(images, phases):
    assert extract(images, phases)["total"] == pytest.approx(float(np.sum(PRESSED)), abs=1e-6)


@every_case(
    ("images", "missing"),
    [
        ([np.zeros(ROWS * COLUMNS)], {"total", "area"}),
        ([np.zeros(ROWS * COLUMNS)] * 2, {"area", "centre_row", "angle", "shift_row_50"}),
        ([np.zeros(ROWS * COLUMNS), -np.ones(ROWS * COLUMNS)], {"area", "centre_row"}),
        ([np.zeros(ROWS * COLUMNS), np.eye(1, ROWS * COLUMNS, 20)[0]], {"angle"}),
    ],
)
def test_what_an_image_does_not_show_is_missing_with_a_reason(images, missing):
    f = extract(images)

    assert missing <= set(f.reasons)
    assert all(math.isnan(f[name]) for name in missing)


def test_fingertips_have_features_for_each_side():
    left, right = (bump(5.0, column, 1.0, 1.0, 0.0).ravel() for column in (4.0, 9.0))
    trace = grasp([np.zeros(1)] * 3, (Phase.APPROACH, Phase.SQUEEZE, Phase.HOLD))
    pads = {
        "pad_t_s": trace.t_s,
        "pad_left": np.outer([0.0, 0.5, 1.0], left),
        "pad_right": np.outer([0.0, 0.0, 2.0], right),
    }
    f = create("feature-set", "contact-image", rows=ROWS, columns=COLUMNS).extract(evolve(trace, **pads))

    assert (f["left_centre_column"], f["right_centre_column"]) == pytest.approx((4.0, 9.0), abs=0.01)
    assert f["right_total"] == pytest.approx(2.0 * f["left_total"], rel=1e-5)


def test_cells_in_no_such_grid_have_a_total_and_no_centre():
    """The fingertips of the sample have 22 cells."""
    f = create("feature-set", "contact-image").extract(squeeze())
    assert f["left_total"] > f["left_largest"] > 0.0
    assert "features.rows" in f.reasons["left_centre_row"]


def test_a_gripper_without_the_array_says_so():
    f = create("feature-set", "contact-image", array="palm").extract(squeeze())
    assert "palm" in f.reasons["total"]


@given(
    st.integers(-3, 3),
    st.integers(-4, 4),
    st.floats(1e-200, 1e200),
    st.integers(0, 2**32 - 1),
)
def test_a_contact_that_is_moved_or_pressed_harder_keeps_its_shape(down, along, factor, seed):
    change = np.zeros((16, 20))
    change[5:9, 7:12] = np.random.default_rng(seed).random((4, 5))
    here, there = moments(change, 0.1), moments(factor * np.roll(change, (down, along), (0, 1)), 0.1)

    assert there.centre == pytest.approx((here.centre[0] + down, here.centre[1] + along))
    assert there.axes == pytest.approx(here.axes)
    assert there.area == here.area
    turned = moments(change[:, ::-1], 0.1)
    assert math.sin(turned.angle + here.angle) == pytest.approx(0.0, abs=1e-6)
