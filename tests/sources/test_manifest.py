"""Manifests: small files in the layout of public data sets and of every format, each imported by at most ten lines."""

import json
import re
from functools import partial
from textwrap import dedent

import numpy as np
import pytest
import scipy
from attrs import evolve
from cases import every_case
from commands import answered, graspsense, printed, refused
from recorded_files import write_topics

from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.trace import signals_of
from graspsense.recording.labelled_recording import UnreadableRecording
from graspsense.recording.reader import read_recorded
from graspsense.sources.manifest.alike import compared
from graspsense.sources.manifest.understood import understood_file
from graspsense.sources.recordings.dataset_recordings import readable_or_not
from graspsense.sources.trial_source import load_trials
from graspsense.store.store import Store

RATE_HZ = 100.0
T_S = np.arange(300) / RATE_HZ


def squeezing(width_m=0.05, stiffness_n_m=2000.0, offset_n=0.0):
    """Return gap (m) and force (N) of fingers that close from 60 mm at 10 mm/s and stop after 2 s."""
    gap = np.maximum(0.06 - 0.01 * T_S, 0.04)
    return gap, stiffness_n_m * np.maximum(width_m - gap, 0.0) + offset_n


def manifest(folder, text):
    """Write a manifest of at most ten lines; return its path."""
    lines = dedent(text).strip().splitlines()
    assert len(lines) <= 10
    path = folder / "manifest.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


def recordings(folder, text):
    grasps = list(readable_or_not("manifest", str(manifest(folder, text))))
    for recording in grasps:
        if isinstance(recording, UnreadableRecording):
            raise recording.error
    return grasps


def column(recording, name):
    return np.array([getattr(reading.frame, name) for reading in recording.recording.readings])


def pandas_csv(path, columns):
    """Write columns as `DataFrame.to_csv` does: with an index column that has no name."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = zip(*columns.values(), strict=True)
    lines = [f",{','.join(columns)}", *(f"{k},{','.join(map(str, row))}" for k, row in enumerate(rows))]
    path.write_text("\n".join(lines) + "\n")


@every_case(
    ("gap", "force", "read_as_they_are"),
    [
        ("gap", "force", {"time in s", "gap in m", "force in N"}),
        ("gap [m]", "force", {"time in s", "force in N"}),
        ("'gap_mm'*0.001 [m]", "force_n*9.81", {"time in s"}),
    ],
)
def test_quantities_whose_unit_nothing_states_are_named(tmp_path, gap, force, read_as_they_are):
    m, n = squeezing()
    columns = {"t": T_S, "gap": m, "force": n, "gap_mm": 1e3 * m, "force_n": n / 9.81}
    pandas_csv(tmp_path / "cup_1.csv", columns)
    (kept,) = recordings(
        tmp_path, f"""files = "{{label}}_1.csv"\ntime = "t"\ngap = "{gap}"\nforce = "{force}" """
    )
    (note,) = (note for note in kept.recording.notes if "no unit" in note)
    assert set(note.partition(": ")[2].split(", ")) == read_as_they_are


@every_case("ending", ["npz", "mat"])
def test_images_and_blocks_of_samples_become_arrays_with_their_shape_and_fast_channels(tmp_path, ending):
    gap, force = squeezing()
    taxels = np.arange(300.0 * 28).reshape(300, 7, 4)
    shaken = np.arange(300.0 * 9).reshape(300, 3, 3)
    shaken[10, 2] = np.nan  # a tick with two samples
    sound = np.arange(300.0 * 5).reshape(300, 5)
    arrays = {"gap": gap, "force": force, "taxels": taxels, "acc": shaken, "sound": sound}
    if ending == "npz":
        np.savez(tmp_path / "cup.npz", **arrays)
    else:
        scipy.io.savemat(tmp_path / "cup.mat", {**arrays, "taxels": np.moveaxis(taxels, 0, -1)})
    text = f"""
        files = "{{label}}.{ending}"
        rate_hz = 1000
        gap = "gap"
        force = "force"
        channels = {{ palm = "taxels*0.5 [N]", acceleration = "acc [m/s2]", sound = "sound [Pa]" }}
        fast = ["acceleration", "sound"]
        """

    (recording,) = recordings(tmp_path, text)

    palm, acceleration, heard = recording.recording.channels
    assert (palm.rows, palm.columns, palm.unit) == (7, 4, "N")
    assert (acceleration.samples, acceleration.axes, acceleration.unit) == (3, ("x", "y", "z"), "m/s2")
    assert acceleration.rate_hz == pytest.approx(3000.0)
    assert (heard.samples, heard.axes) == (5, ("value",))
    signals = signals_of([reading.signals for reading in recording.recording.readings])
    assert np.array_equal(signals["palm"].cells, 0.5 * taxels.reshape(300, 28))
    rows = shaken.reshape(900, 3)
    assert np.array_equal(signals["acceleration"].values, rows[np.isfinite(rows[:, 0])])
    assert np.array_equal(signals["sound"].values[:, 0], sound.reshape(-1))
    assert signals["acceleration"].lost == 0

    with pytest.raises(ConfigError, match=r"manifest\.toml:6: 'sounds'"):
        recordings(tmp_path, text.replace('"sound"]', '"sounds"]'))
    with pytest.raises(ConfigError, match=r"manifest\.toml:7: .*resample_hz"):
        recordings(tmp_path, text + "resample_hz = 100")


# Formats.

PLAIN = """
    files = "{label}.*"
    time = "t"
    gap = "gap [mm]"
    force = "F"
"""


def test_a_text_file_is_known_by_its_ending(tmp_path):
    for ending in ("CSV", "tsv", "dat"):
        pandas_csv(
            tmp_path / f"{ending}.{ending}", {"t": T_S, "gap": squeezing()[0] * 1e3, "F": squeezing()[1]}
        )
        (recording,) = recordings(tmp_path, PLAIN.replace("*", ending.lower()))
        assert column(recording, "force_right_n") == pytest.approx(squeezing()[1], abs=1e-6)


def test_a_ros_bag_with_topics_of_different_rates(tmp_path):
    pytest.importorskip("rosbags", reason="needs the extra ros")
    from rosbags.rosbag1 import Writer

    gap, force = squeezing()
    forces = np.column_stack([force, 2 * force])
    topics = {"/hand/width": (T_S, gap), "/hand/forces": (T_S[::2], forces[::2])}
    write_topics(Writer(tmp_path / "jar.bag"), topics, ros1=True)

    (recording,) = recordings(
        tmp_path,
        """
        files = "{label}.*"
        gap = "'/hand/width.data'"
        left = "'/hand/forces.data'[0]"
        right = "'/hand/forces.data'[1]"
        """,
    )

    assert column(recording, "t_s") == pytest.approx(T_S, abs=1e-6)
    assert column(recording, "gap_m") == pytest.approx(gap)
    # The last value holds.
    assert column(recording, "force_right_n") == pytest.approx(2 * np.repeat(force[::2], 2))


# Steps.


def plain(folder, extra, *, force=None, gap=None, time=None):
    own_gap, own_force = squeezing()
    gap, force = own_gap if gap is None else gap, own_force if force is None else force
    pandas_csv(folder / "jar.csv", {"t": T_S if time is None else time, "gap": gap * 1e3, "F": force})
    return recordings(folder, PLAIN + extra)


@every_case("digits", [0, 1, 2])
def test_times_with_too_few_digits_are_refused_with_the_rate_or_its_key(tmp_path, digits):
    gap, force = squeezing()
    times = [f"{1732850000.1 + t:.{digits}f}" for t in T_S / 30.0]
    pandas_csv(tmp_path / "jar_1.csv", {"t": times, "gap": gap, "N": force})
    text = "files = '{label}_1.csv'\ntime = 't'\ngap = 'gap'\nforce = 'N'"
    with pytest.raises(DataDamaged, match="rate_hz"):
        recordings(tmp_path, text)


def test_zero_is_taken_from_the_first_samples_or_seconds(tmp_path):
    _, force = squeezing()
    for zero in ("20 samples", "0.2 s", "200 ms"):
        (recording,) = plain(tmp_path, f'zero = "{zero}"', force=force + 5.0)
        assert column(recording, "force_left_n") == pytest.approx(force, abs=1e-9)


def repeated(*factors, hold=0):
    """Return gap, force and time of a squeeze for each factor on its force, each held and released."""
    gap, force = (np.append(values, np.full(hold, values[-1])) for values in squeezing())
    forces = np.concatenate([factor * np.concatenate([force, squeezing()[1][::-1]]) for factor in factors])
    gaps = np.concatenate([gap, squeezing()[0][::-1]] * len(factors))
    return gaps, forces, np.arange(len(forces)) / RATE_HZ


def squeezes_of(folder, force, gap, time):
    return plain(folder, 'split = "force"', force=force, gap=gap, time=time)


FOUR = (1.0, 1.0, 1.0, 1.0)


@pytest.mark.slow
@every_case(
    ("factors", "change"),
    [
        # One squeeze is a tenth of the others, or twenty times as strong.
        ((1.0, 0.8, 0.12, 1.0), None),
        ((1.0, 20.0, 0.9, 1.1), None),
        # The zero drifts by a seventh of the force of a squeeze in each, 12 N in all.
        (FOUR, lambda force, time: force + 0.5 * time),
        (FOUR, lambda force, time: force - 0.5 * time),
        # Five samples of the hold are lost: no fingers open and close in 50 ms.
        (FOUR, lambda force, _: np.where((np.arange(2400) // 5) == 180, 0.0, force)),
        # One sample in a hold is a glitch.
        (FOUR, lambda force, _: np.where(np.arange(2400) == 900, 900.0, force)),
        # The code of an error, in an approach and in a hold.
        (FOUR, lambda force, _: np.where(np.arange(2400) // 5 == 244, -999.0, force)),
        (FOUR, lambda force, _: np.where(np.arange(2400) // 5 == 180, -999.0, force)),
        # A zero that changes in the second squeeze.
        (FOUR, lambda force, _: np.where(np.arange(2400) > 900, force + 8.0, force)),
        # A sensor that says one value from the second squeeze on until the fingers are open.
        (FOUR, lambda force, _: without(force, 800, 1190, force[800])),
    ],
)
def test_squeezes_of_any_force_are_found_with_drift_and_faults(factors, change, tmp_path):
    gaps, forces, time = repeated(*factors)
    squeezes = squeezes_of(tmp_path, forces if change is None else change(forces, time), gaps, time)
    begins = [column(squeeze, "t_s")[0] for squeeze in squeezes]
    assert begins == pytest.approx([0.0, 6.0, 12.0, 18.0], abs=0.6)


def without(values, begin, end, value):
    changed = values.copy()
    changed[begin:end] = value
    return changed


def bumped(newtons, force):
    """Return this force with a bump in the second approach, 0.6 s before its contact."""
    begin = 600 + int(np.argmax(force[600:] > 0.1)) - 60
    return without(force, begin, begin + 15, newtons)


@pytest.mark.slow
@every_case(
    ("factors", "change", "number", "told"),
    [
        (FOUR, None, 4, None),
        # The third one has 5 % of the force of the others.
        ((1.0, 1.0, 0.05, 1.0), None, 3, "the fingers close 1 time.*without a squeeze"),
        # A closing whose force was not measured, or is zero.
        (FOUR, lambda force: without(force, 1200, 1800, np.nan), 3, "the fingers close 1 time.*has no number"),
        (FOUR, lambda force: without(force, 1200, 1800, 0.0), 3, "the fingers close 1 time.*without a squeeze"),
        # A bump in an approach is no squeeze of its own.
        *((FOUR, partial(bumped, newtons), 4, "comes back") for newtons in (2.0, 10.0, 30.0)),
        (FOUR, lambda force: np.where(np.arange(2400) > 900, force + 8.0, force), 4, "zero"),
    ],
)  # fmt: skip
def test_what_is_no_squeeze_or_none_of_its_own_is_told(factors, change, number, told, tmp_path):
    gaps, force, time = repeated(*factors)
    squeezes = squeezes_of(tmp_path, force if change is None else change(force), gaps, time)
    assert len(squeezes) == number
    notices = [notice for squeeze in squeezes for notice in squeeze.notices]
    assert [notice for notice in notices if re.search(told, notice)] if told else not notices


def test_a_pad_that_fails_at_the_narrowest_of_several_objects_is_not_turned(tmp_path):
    """The others are held 30 mm wider, where the fingers are open for the first."""
    gaps, force, time = repeated(1.0, 1.0, 1.0)
    gaps = gaps + np.interp(time, [5.9, 6.1], [0.0, 0.03])
    columns = {"t": time, "gap": gaps * 1e3, "L": np.where(time < 6.0, 0.0, force), "R": force}
    pandas_csv(tmp_path / "jar.csv", columns)
    text = 'files = "{label}.csv"\nsplit = "force"\ntime = "t"\ngap = "gap [mm]"\nleft = "L"\nright = "R"'
    squeezes = recordings(tmp_path, text)
    assert ["left pad" in " ".join(squeeze.notices) for squeeze in squeezes] == [True, False, False]


def test_a_gap_that_stops_for_a_squeeze_does_not_join_it_with_the_next(tmp_path):
    gaps, force, time = repeated(*FOUR)
    stopped = np.where(np.arange(2400) // 600 == 2, gaps[1200], gaps)
    squeezes = squeezes_of(tmp_path, force, stopped, time)
    narrowest = [float(column(squeeze, "gap_m").min()) for squeeze in squeezes]
    assert narrowest == pytest.approx([gaps.min(), gaps.min(), gaps[1200], gaps.min()], abs=1e-3)
    assert [bool(squeeze.notices) for squeeze in squeezes] == [False, False, True, False]


@pytest.mark.slow
@every_case(
    ("pads", "gap_m", "rate", "told"),
    [
        # Noise, and forces and times that differ by a tenth, are no fault.
        ((1.1, 1.1), 0.0, 1.1, None),
        ((0.4, 0.4), 0.0, 1.0, "the force is another one at the same gap"),
        ((0.6, 1.0), 0.0, 1.0, "the right pad bears another share"),
        ((1.0, 1.0), 0.004, 1.0, "the fingers open to another gap"),
        ((1.0, 1.0), 0.0, 2.0, "samples are further apart"),
    ],
)
@every_case("split", ["force", "trial"])
def test_one_of_several_squeezes_that_is_unlike_the_others_is_told(pads, gap_m, rate, told, split, tmp_path):
    """A gain, a zero of the gap, or a rate of the clock of the third of five squeezes; the others are not doubted."""
    gaps, force, time = repeated(1.0, 1.0, 1.0, 1.0, 1.0)
    spoilt_rows = np.arange(len(time)) // 600 == 2
    noise = np.random.default_rng(7).normal(0.0, 0.05, (2, len(time)))
    left, right = (np.where(spoilt_rows, gain, 1.0) * force for gain in pads)
    columns = {
        "t": np.cumsum(np.where(spoilt_rows, rate, 1.0) * np.diff(time, prepend=time[0])),
        "gap": 1e3 * (gaps + gap_m * spoilt_rows),
        "L": left + noise[0],
        "R": right + noise[1],
    }
    pandas_csv(tmp_path / "jar.csv", columns | {"trial": np.arange(len(time)) // 600})
    keys = 'time = "t"\ngap = "gap [mm]"\nleft = "L"\nright = "R"'
    squeezes = recordings(tmp_path, f'files = "{{label}}.csv"\nsplit = "{split}"\n{keys}')
    notices = ["; ".join(squeeze.notices) for squeeze in squeezes]
    unlike = ["in most grasps" in notice for notice in notices]
    assert unlike == [False, False, told is not None, False, False], notices
    assert told is None or told in notices[2]
    of_object = compared([evolve(squeeze, notices=()) for squeeze in squeezes], of_file=False)
    assert bool(of_object[2].notices) == (told is not None and "share" in told)


@pytest.mark.slow
def test_a_grasp_is_replayed_and_evaluated_with_the_thresholds_of_its_import(tmp_path):
    """The force has noise of 0.3 N about 0.4 N without contact, in which the default finds a contact at once."""
    rng, (gap, force) = np.random.default_rng(5), squeezing(offset_n=0.4)
    for k in range(3):
        left, right = force + rng.normal(0.0, 0.3, (2, len(T_S)))
        pandas_csv(tmp_path / f"jar_{k}.csv", {"t": T_S, "gap": gap, "L": left, "R": right})
    keys = 'files = "{label}_{order:d}.csv"\ntime = "t"\ngap = "gap"\nleft = "L"\nright = "R"'
    source, store = manifest(tmp_path, keys), tmp_path / "store"
    alone = ("-o", "classifier.type=none")
    printed("import", source, "--save", store, *alone)
    stored, replayed = (
        answered("replay", place)["features"] for place in (f"{store}#2", f"manifest:{source}#2")
    )
    assert stored == replayed
    for place in f"store:{store}", f"manifest:{source}":
        width_m = load_trials(place, options=["features.type=chitta"]).table.values[:, 0]
        assert width_m == pytest.approx(0.05, abs=1.5e-3)


def test_a_force_that_drops_out_while_the_gap_stays_is_told(tmp_path):
    """For 0.3 s of a hold of 0.5 s; between squeezes the fingers open."""
    gaps, forces, time = repeated(1.0, 1.0, hold=50)
    for values, told in (forces, 0), (without(forces, 311, 340, 0.0), 1):
        squeezes = squeezes_of(tmp_path, values, gaps, time)
        notes = [note for squeeze in squeezes for note in squeeze.notices if "gone and" in note]
        assert len(notes) == told


def test_a_clock_that_begins_anew_between_two_squeezes_costs_neither_and_noise_is_no_squeeze(tmp_path):
    gaps, forces, time = repeated(1.0, 1.0)
    squeezes = squeezes_of(tmp_path, forces, gaps, np.where(time < 5.3, time, time - 5.3))
    assert [len(squeeze.recording.readings) for squeeze in squeezes] == [530, 670]
    with pytest.raises(DataDamaged, match=r"^jar.csv: "):
        squeezes_of(tmp_path, np.random.default_rng(3).normal(0.0, 0.02, len(time)), gaps, time)


@pytest.mark.slow
@every_case("turned", [lambda f: -f, lambda f: -f - 1.0, lambda f: 20.0 - f, lambda f: 999.0 - 40.0 * f])
def test_a_force_that_falls_on_closing_is_not_divided_into_squeezes_of_free_fingers(tmp_path, turned):
    gaps, force, time = repeated(1.0, 1.0, 1.0)
    pandas_csv(tmp_path / "jar.csv", {"t": time, "gap": gaps * 1e3, "F": turned(force), "good": force})

    def refused(columns):
        text = f"files = '{{label}}.csv'\nsplit = 'force'\ntime = 't'\n{columns}"
        (grasp, *_) = readable_or_not("manifest", str(manifest(tmp_path, text)))
        return isinstance(grasp, UnreadableRecording) and "the fingers close" in str(grasp.error)

    gap = "gap = 'gap [mm]'\n"
    assert refused(gap + "force = 'F [counts]'")
    assert refused(gap + "left = 'good [counts]'\nright = 'F [counts]'")
    assert refused("gap = '130 - gap [mm]'\nforce = 'good'")
    assert not refused(gap + "force = 'good'")
    assert not refused("force = 'good'")
    assert refused("force = 'F [counts]'") == (turned(force)[0] <= 0.0)


def test_files_with_a_text_where_a_pattern_wants_digits_are_told(tmp_path):
    gap, force = squeezing()
    for name in ("can_1", "can_2", "can_x", "notes", "can_1_pads", "can_2_pads"):
        pandas_csv(tmp_path / f"{name}.csv", {"t": T_S, "gap": gap * 1e3, "F": force})
    text = PLAIN.replace("{label}", "{label}_{order:d}") + 'beside = "{label}_{order}_pads.csv"\n'
    told = [
        notice for grasp in recordings(tmp_path, text) for notice in grasp.notices if "not used" in notice
    ]
    assert len(told) == 1
    assert "can_x.csv" in told[0]
    assert "pads" not in told[0]
    assert "notes" not in told[0]


@pytest.mark.slow
@every_case(
    ("spoilt", "value"), [("force", 1e6), ("force", np.nan), ("force", np.inf), ("gap", 900.0), ("time", 0.0)]
)
@every_case("samples", [1, 40])
def test_a_fault_in_one_squeeze_is_of_that_squeeze(tmp_path, spoilt, value, samples):
    gap, force = squeezing()
    columns = {
        "gap": np.concatenate([gap, gap[::-1]] * 4),
        "force": np.concatenate([force, force[::-1]] * 4),
        "time": np.arange(2400) / RATE_HZ,
    }
    columns[spoilt][1480 : 1480 + samples] = value  # at the peak of the third of four
    pandas_csv(
        tmp_path / "jar.csv", {"t": columns["time"], "gap": columns["gap"] * 1e3, "F": columns["force"]}
    )
    squeezes = list(readable_or_not("manifest", str(manifest(tmp_path, PLAIN + 'split = "force"'))))
    assert [recording.source for recording in squeezes] == [f"jar.csv, squeeze {k}" for k in range(1, 5)]
    bad = [k for k, recording in enumerate(squeezes, 1) if isinstance(recording, UnreadableRecording)]
    assert bad == ([] if np.isnan(value) else [3])  # samples without a number are left out
    told = [
        k
        for k, grasp in enumerate(squeezes, 1)
        if "without a number" in " ".join(getattr(grasp, "notices", ()))
    ]
    assert told == ([3] if np.isnan(value) and samples == 40 else [])
    good = [recording for k, recording in enumerate(squeezes, 1) if k != 3]
    assert all(column(squeeze, "force_left_n").max() == pytest.approx(20.0) for squeeze in good)


def test_squeezes_of_topics_in_one_table_are_found_without_a_false_alarm(tmp_path):
    gap, force, times = repeated(1.0, 1.0, 1.0)
    rows = [(t, f"{g}", "", "") for t, g in zip(times, gap, strict=True)]
    rows += [(t + 0.002, "", f"{f}", "") for t, f in zip(times, force, strict=True)]
    rows += [(t + 0.004, "", "", f"{f}") for t, f in zip(times, force, strict=True)]
    text = "\n".join(["t,gap,l,r", *(f"{t:.3f},{g},{left},{right}" for t, g, left, right in sorted(rows))])
    (tmp_path / "jar.csv").write_text(text + "\n")
    columns = "time = 't'\ngap = 'gap'\nleft = 'l'\nright = 'r'"
    squeezes = recordings(tmp_path, f"files = '{{label}}.csv'\nsplit = 'force'\n{columns}")
    assert len(squeezes) == 3
    assert not any(squeeze.notices for squeeze in squeezes)
    single = [f"{t:.3f},{g},{left}" for t, g, left, right in sorted(rows) if not right]
    (tmp_path / "jar.csv").write_text("\n".join(["t,gap,force", *single]) + "\n")
    assert len(understood_file(tmp_path / "jar.csv").squeezes) == 3


def test_a_grasp_is_cut_at_its_release_and_resampled(tmp_path):
    _, force = squeezing()
    force[250:] = 0.0
    (recording,) = plain(tmp_path, 'cut = "release"', force=force)
    assert len(recording.recording.readings) == 250
    (recording,) = plain(tmp_path, "resample_hz = 50")
    assert recording.recording.rate_hz == pytest.approx(50.0)
    assert column(recording, "gap_m") == pytest.approx(squeezing()[0][::2], abs=1e-9)


def test_a_list_names_files_and_rows_with_their_facts(tmp_path):
    gap, force = squeezing()
    pandas_csv(tmp_path / "all.csv", {"gap": np.tile(gap, 2), "F": np.tile(force, 2)})
    (tmp_path / "list.csv").write_text(
        "file,label,instance,recorded,order,first_row,last_row\n"
        "all.csv,jar:full,3,24.11.2024 15:13:19,1,1,300\nall.csv,jar:open,4,1732461199,2,301,600\n"
    )
    grasps = recordings(tmp_path, 'list = "list.csv"\nrate_hz = 100\ngap = "gap"\nforce = "F"')
    facts = [(grasp.label, grasp.instance, grasp.order, grasp.recorded_at) for grasp in grasps]
    when = "2024-11-24T15:13:19+00:00"
    assert facts == [("jar:full", "3", 1.0, when), ("jar:open", "4", 2.0, when)]
    assert grasps[0].source == "all.csv, rows 1 to 300"
    assert column(grasps[1], "gap_m") == pytest.approx(gap)


# What looks wrong.


GAP_M, FORCE_N = squeezing()
KEPT = {"time": T_S, "gap": GAP_M, "force": FORCE_N}


@pytest.mark.slow
@every_case(
    ("columns", "says"),
    [
        ({}, None),
        ({"gap": 0.1 - GAP_M}, 'the gap rises while the force rises: .*gap = "0.1 - POSITION"'),
        ({"force": np.round(20 * FORCE_N)}, r'whole numbers, as counts .*force = "COLUMN \[counts\]"'),
        ({"force": FORCE_N + 30.0}, 'the force does not begin at zero: .*zero = "10 samples"'),
        # A load cell that was not tared: by less than what would be a contact, and yet f_steady is 10 % too large.
        ({"force": FORCE_N + 2.0}, 'the force does not begin at zero: .*zero = "10 samples"'),
        ({"force": FORCE_N - 30.0}, 'zero = "10 samples"'),
        ({"force": 40.5 * FORCE_N}, r"the force reaches 810 N, which few grippers have: .*\[gf\]"),
        ({"force": -FORCE_N}, "the force is negative where it is largest: .*-FORCE"),
        ({"force": 10.0 + 2.0 * np.cos(T_S)}, "the recording begins in contact: there is no approach"),
        ({"gap": np.full(300, 0.05)}, "the gap does not change"),
        ({"gap": GAP_M - GAP_M.min()}, "fingers meet at 0"),
        ({"gap": 1e-3 * GAP_M}, r"the gap reaches 0\.\d+ mm only"),
        ({"force": 5e-4 * FORCE_N}, r"reaches 0.01 N, which few.*\[kN\]"),
        # From 1 N of 20 N on: the contact force is 0.625 N.
        ({"force": FORCE_N[105::2], "gap": GAP_M[105::2], "time": T_S[105::2]}, "begins in contact"),
        # A zero that was set at 1 N, before the force grew and after; and where the fingers open wider in the end.
        (
            {"force": (FORCE_N - FORCE_N[105])[105:], "gap": GAP_M[105:], "time": T_S[105:]},
            "begins in contact",
        ),
        (
            {
                "force": np.concatenate((FORCE_N[115:], FORCE_N[::-1])) - FORCE_N[115],
                "gap": np.concatenate((GAP_M[115:], GAP_M[::-1])),
                "time": np.arange(485) / RATE_HZ,
            },
            "begins in contact",
        ),
        # A clock that loses every other sample from the middle of the approach on.
        ({"time": np.where(T_S < 0.5, T_S, 0.5 + 2.0 * (T_S - 0.5))}, "from 0.5 s on, .* 2 times"),
        # Every second sample from there on: the fingers are as fast as before.
        ({name: values[(T_S < 0.5) | (np.arange(300) % 2 == 0)] for name, values in KEPT.items()}, None),
        # Three seconds in ms that are called us, in hours, and as the number of the row; a sample a second is none.
        ({"time": np.round(T_S * 1e-3, 9)}, "lasts 3 ms only"),
        ({"time": np.round(T_S / 3600, 9)}, "lasts 0.83 ms only"),
        ({"time": np.round(T_S * RATE_HZ, 9)}, 'rises by 1 in each sample.*"t \\[s\\]"'),
        ({"time": 1_700_000_000_000 + np.arange(300)}, None),  # milliseconds since 1970, at 1 kHz
    ],
)
def test_what_looks_wrong_is_noticed_with_its_remedy(columns, says, tmp_path):
    (recording,) = plain(tmp_path, "", **columns)
    told = [notice for notice in recording.notices if says and re.search(says, notice)]
    assert told if says else not recording.notices


def test_what_looks_wrong_in_the_force_of_one_pad_is_told_of_that_pad(tmp_path):
    sides = "files = 'jar.csv'\nlabel = 'jar'\ntime = 't [s]'\ngap = 'gap [mm]'\nleft = 'L'\nright = 'R'"
    # Their mean begins at 0.75 N of 20 N, or is 0; noise is neither a pull nor a contact.
    noise = np.random.default_rng(2).normal(0.0, 0.01, 300)
    for left, right, says in (
        (FORCE_N + 1.5, FORCE_N, "left pad does not begin at zero"),
        (-FORCE_N, FORCE_N, "left pad is negative"),
        (noise, noise, None),
        (-noise, -noise, None),
    ):
        pandas_csv(tmp_path / "jar.csv", {"t": T_S, "gap": GAP_M * 1e3, "L": left, "R": right})
        (recording,) = recordings(tmp_path, sides)
        if says:
            assert [says in notice for notice in recording.notices] == [True]
        else:
            assert not [notice for notice in recording.notices if "pull" in notice or "in contact" in notice]


def test_a_sample_a_second_is_no_number_of_the_row(tmp_path):
    pandas_csv(tmp_path / "jar.csv", {"t": T_S * RATE_HZ, "gap": GAP_M * 1e3, "F": FORCE_N})
    (recording,) = recordings(tmp_path, PLAIN.replace('"t"', '"t [s]"'))
    assert recording.notices == ()


def test_squeezes_that_no_key_divides_are_told(tmp_path):
    twice = {"t": np.arange(600) / RATE_HZ, "gap": np.tile(GAP_M, 2) * 1e3, "F": np.tile(FORCE_N, 2)}
    pandas_csv(tmp_path / "jar.csv", twice)
    (undivided,) = recordings(tmp_path, PLAIN)
    assert any("several squeezes" in notice for notice in undivided.notices)
    divided = recordings(tmp_path, PLAIN + 'split = "force"')
    assert [any("several" in notice for notice in squeeze.notices) for squeeze in divided] == [False, False]


def test_a_replay_tells_what_looks_wrong_in_its_recording(tmp_path):
    plain(tmp_path, "", force=squeezing()[1] + 2.0)
    assert "begin at zero" in printed("replay", f"manifest:{tmp_path / 'manifest.toml'}#1")


def test_an_empty_cell_does_not_hide_the_peak_of_its_column(tmp_path):
    gap, force = squeezing()
    cells = ["" if k == 40 else str(value) for k, value in enumerate(force)]
    pandas_csv(tmp_path / "jar.csv", {"t": T_S, "gap": gap * 1e3, "F": force, "load": cells})

    (jar,) = recordings(tmp_path, PLAIN + 'values = { most = "peak(load) [N]" }')

    assert jar.values == {"most [N]": pytest.approx(20.0)}


@every_case(
    ("text", "says"),
    [
        ('files = "{label}.csv"\ngap = "g"', r"manifest\.toml: .*force"),
        ('files = "x.csv"\ngap = "gap"\nforce = "F"', r'manifest.toml: no label: write label = "\{field\}"'),
        (PLAIN.replace('"F"', '"Force"'), r"force, for jar.csv: no column 'Force'\. Columns: index, t, gap"),
        (PLAIN.replace('"t"', '"t +"'), r"manifest.toml:\d: time"),
        (PLAIN + 'cutt = "release"', r"manifest.toml:\d: cutt: .* no key 'cutt'.*'cut'"),
        (PLAIN + 'zero = "ten"', r"manifest.toml:\d: zero: 'ten' is neither"),
        (PLAIN.replace("{label}", "{label}s"), r"no file in .* matches '\{label\}s\.\*'\. .*jar\.csv"),
        (PLAIN + 'label = "{name}"', r"label: jar.csv has no .*'name'\. It has: label, index, t, gap, F"),
        (PLAIN + 'recorded = "{label}"', "recorded: 'jar' of jar.csv"),
        (PLAIN + 'split = "trial"', "split: jar.csv.*column 'trial'"),
        (PLAIN + 'values = { hardness = "F" }', r"values.hardness changes during jar.csv: take peak"),
        (PLAIN.replace('time = "t"', ""), "jar.csv.*time: write time = .* or rate_hz = 100"),
        (PLAIN + 'channels = { force_left = "F" }', "'force_left'"),
        (PLAIN + 'channels = { class = "F" }', "'class'"),
        (PLAIN + 'channels = { F1 = "F" }', "'F1'"),
        (PLAIN + 'start = "("', r"manifest.toml:\d: start: '\('"),
        (PLAIN + 'folder = "elsewhere"', "folder .*elsewhere"),
    ],
)
def test_a_mistake_in_a_manifest_is_told_with_what_is_allowed(text, says, tmp_path):
    gap, force = squeezing()
    pandas_csv(tmp_path / "jar.csv", {"t": T_S, "gap": gap * 1e3, "F": force})
    with pytest.raises(ConfigError, match=says):
        recordings(tmp_path, text)


# The commands.


@pytest.mark.slow
def test_a_bad_file_does_not_stop_an_import_and_a_second_run_takes_only_what_is_missing(tmp_path):
    for k in range(4):
        gap, force = squeezing(stiffness_n_m=1000.0 + 100.0 * k)
        pandas_csv(tmp_path / f"jar_{k}.csv", {"t": T_S, "gap": gap * 1e3, "F": force})
    whole = (tmp_path / "jar_2.csv").read_text()
    lines = whole.splitlines()
    (tmp_path / "jar_2.csv").write_text("\n".join([*lines[:100], "3,1.0"]) + "\n")
    described = manifest(tmp_path, PLAIN.replace("{label}.csv", "{label}_{order:d}.csv"))
    command = ("import", described, "--save", tmp_path / "trials", "-o", "classifier.type=none")

    code, out, err = graspsense(*command)
    assert code == 5
    assert re.search(r"trial 3", out)
    (line,) = [line for line in err.splitlines() if "jar_2.csv" in line]
    assert re.search(r"jar_2\.csv, line 101: 2 values.*4 columns", line)
    assert "same command" in " ".join(err.split())
    # The number of a grasp in the manifest does not depend on which files can be read.
    code, _, err = graspsense("replay", f"manifest:{described}#3")
    assert (code, "line 101" in err) == (5, True)

    (tmp_path / "jar_2.csv").write_text(whole)
    out = printed(*command, "--json")
    answer = json.loads(out)
    assert [trial["source"] for trial in answer["trials"]] == ["jar_2.csv"]
    assert (len(answer["refused"]), answer["unreadable"]) == (3, [])

    # A manifest that is corrected reads other grasps from the same files.
    with open(described, "a") as file:
        file.write("\nresample_hz = 50.0\n")
    code, out, _ = graspsense(*command, "--json")
    assert [trial["earlier"] for trial in json.loads(out)["trials"]] == [1, 2, 4, 3]


# Recordings without a gap, with one finger or five, and with three components a cell.


def force_only(folder, count=4):
    """Squeezes of a glove with two sensors: forces that rise, hold, and fall, in two kinds."""
    rng = np.random.default_rng(0)
    for k in range(count):
        rise = 4.0 if k % 2 else 10.0
        force = np.clip((T_S - 0.8) * rise, 0.0, 8.0) * (T_S < 2.5)
        noise = rng.normal(0.0, 0.02, (2, len(T_S)))
        columns = {"t": T_S, "a": force + noise[0], "b": 0.8 * force + noise[1]}
        pandas_csv(folder / f"{('soft', 'hard')[k % 2]}_{k}.csv", columns)
    return manifest(folder, 'files = "{label}_{order:d}.csv"\ntime = "t"\nleft = "a"\nright = "b"')


@pytest.mark.slow
def test_a_recording_without_a_gap_is_a_trial_of_its_force(tmp_path):
    place = force_only(tmp_path)
    code, out, err = graspsense("import", place, "--save", tmp_path / "trials")
    assert code == 0
    # How far it is, is told where that takes seconds.
    assert [line for line in err.splitlines() if not line.startswith("grasps imported: ")] == []
    assert "4 force only" in out
    with Store.read(tmp_path / "trials") as store:
        (summary, *_) = store.page(limit=100)
        stored = store.trial(summary.id)
    result = read_recorded(stored.recording).record().result
    assert result.outcome == "force only"
    assert "no gap" in result.reason
    kept, given = f"store:{tmp_path / 'trials'}", f"manifest:{place}"
    curve = ("peak_force", "loading_time", "load_t50", "relaxation", "hold_t50", "pad_difference")
    quantiles = ("contact_time", "high_force_whole_max", "low_force_rate_second_max")
    for features, needed, sources in (
        ("chitta", (), (kept,)),
        ("quantiles", quantiles, (given,)),
        ("curve", curve, (kept, given)),
    ):
        for source in sources:
            table = load_trials(source, options=[f"features.type={features}"]).table
            measured = np.isfinite(table.values).any(axis=0)
            known = [name for name, finite in zip(table.names, measured, strict=True) if finite]
            assert set(needed) <= set(known)
            assert not [name for name in known if "gap" in name or "stiff" in name or name.startswith("p_")]


def test_the_squeeze_without_a_gap_ends_where_its_force_falls(tmp_path):
    trials = load_trials(f"manifest:{force_only(tmp_path)}", options=["features.type=curve"])
    table, labels = trials.table, trials.labels
    held = table.values[np.array([label == "soft" for label in labels]), table.names.index("hold_t75")]
    assert held == pytest.approx(0.9 * 8.0, rel=0.02)  # the mean of both pads


def test_cells_of_three_components(tmp_path):
    """An array of rows, columns and components of cells: forces along x, y and z."""
    gap, force = squeezing()
    cells = np.zeros((300, 2, 3, 3))
    cells[..., 0], cells[..., 2] = 0.6 * force[:, None, None], 0.8 * force[:, None, None]
    np.savez(tmp_path / "jar.npz", t=T_S, gap=gap, cells=cells)
    (recording,) = recordings(
        tmp_path,
        """
        files = "{label}.npz"
        time = "t"
        gap = "gap"
        left = "sum(norm3(cells))"
        right = "sum(cells[2::3])"
        channels = { cells = "cells [N]" }
        """,
    )
    assert column(recording, "force_left_n") == pytest.approx(6 * force)
    assert column(recording, "force_right_n") == pytest.approx(6 * 0.8 * force)
    (channel,) = recording.recording.channels
    assert (channel.rows, channel.columns, channel.components) == (2, 3, 3)
    image = recording.recording.readings[200].signals.cells
    assert image.cells == tuple(map(tuple, cells[200].reshape(6, 3).tolist()))


GIVEN = 'files = "{label}_{order:d}.csv"\ntime = "t"\ngap = "gap"\nforce = "F"\n'
COUNTS = GIVEN.replace('"F"', '"F [counts]"')


@pytest.mark.parametrize(
    ("text", "scale", "offset", "options", "says", "remedy"),
    [
        (GIVEN, 1.0, 0.0, ("-o", "controller.too_wide_m=0.05"), "end as too wide", "controller.too_wide_m=0"),
        # A signed sensor of 24 bit with an offset: no contact force above zero can be found in it.
        pytest.param(COUNTS, 2e4, -8.3e6, (), "is below zero", 'zero = "10 samples"', marks=pytest.mark.slow),
    ],
    ids=["too wide", "below zero"],
)
def test_what_spoils_most_recordings_is_an_error_that_stores_nothing(
    tmp_path, text, scale, offset, options, says, remedy
):
    gap, force = squeezing()
    for k in range(5):
        columns = {"t": T_S, "gap": gap, "F": np.round(offset + scale * (1.0 + 0.1 * k) * force, 9)}
        pandas_csv(tmp_path / f"jar_{k}.csv", columns)
    err = refused("import", manifest(tmp_path, text), "--save", tmp_path / "trials", *options)
    assert f"5 of 5 recordings {says}" in err
    assert remedy in err
    assert not (tmp_path / "trials").exists()
    mended = manifest(tmp_path, text if options else text + remedy)
    assert "5 steady" in printed("import", mended, "--save", tmp_path / "trials")


def test_counts_that_fall_on_contact_are_asked_about(tmp_path):
    gap, force = squeezing()
    rng = np.random.default_rng(0)
    counts = np.round(999.0 - 60.0 * force + rng.normal(size=len(force)))
    pandas_csv(tmp_path / "jar_0.csv", {"t": T_S, "gap": gap, "F": counts})
    (recording,) = recordings(tmp_path, COUNTS)
    assert any("the fingers close" in notice for notice in recording.notices)
    (turned,) = recordings(tmp_path, COUNTS.replace("F [counts]", "999 - F [counts]"))
    assert not turned.notices
    # A hold that relaxes falls too, but is never steady at first.
    hold = np.round(999.0 - 600.0 * (1.0 - np.exp(-(T_S - T_S[0]) / (0.1 * np.ptp(T_S)))))
    pandas_csv(
        tmp_path / "jar_0.csv", {"t": T_S, "gap": 0.05 - 0.001 * np.arange(len(gap)) / len(gap), "F": hold}
    )
    (held,) = recordings(tmp_path, COUNTS)
    assert not any("the fingers close" in notice for notice in held.notices)


@pytest.mark.parametrize(
    "again",
    [(), pytest.param(("features.type=curve",), marks=pytest.mark.slow)],
    ids=["kept", "extracted again"],
)
def test_features_are_of_the_whole_recording_and_not_of_what_the_controller_saw(tmp_path, again):
    """A squeeze that rests, and is released long after: the whole recording counts, as for a data set."""
    gap, force = squeezing()
    there = np.concatenate([gap, np.full(400, gap[-1]), gap[::-1]])
    forces = np.concatenate([force, np.full(400, force[-1]), force[::-1]])
    pandas_csv(tmp_path / "jar_1.csv", {"t": np.arange(1000) / RATE_HZ, "gap": there, "F": forces})
    place = manifest(tmp_path, GIVEN)
    features = "chitta" if again else "curve"
    given = ("-o", f"features.type={features}", "-o", "classifier.type=none")
    printed("import", place, "--save", tmp_path / "trials", *given)
    stored = load_trials(f"store:{tmp_path / 'trials'}", options=again).table
    whole = load_trials(f"manifest:{place}", options=["features.type=curve"]).table
    assert np.isfinite(stored.values[0, stored.names.index("hysteresis")])
    assert stored.values[0] == pytest.approx(whole.values[0], nan_ok=True)


@pytest.mark.slow
@pytest.mark.parametrize("resample_hz", [0, 100, 1000])
def test_rest_is_found_on_a_coarse_gap_at_any_rate(tmp_path, resample_hz):
    """A squeeze of 2.4 mm in 3 s and a hold of 1.5 s, in steps of 0.1 mm at 45 Hz."""
    times = np.arange(270) / 45.0
    gap = np.round(np.interp(times, [0.0, 1.5, 4.5], [76.0, 64.0, 61.6]), 1)
    for k in range(4):
        force = np.interp(times, [1.5, 4.5], [0.0, 6.0 + k])
        pandas_csv(tmp_path / f"jar_{k}.csv", {"t": times, "mm": gap, "F": force})
    place = manifest(
        tmp_path,
        f'files = "{{label}}_{{order:d}}.csv"\ntime = "t"\ngap = "mm [mm]"\nforce = "F"\nresample_hz = {resample_hz}',
    )
    out = printed("import", place, "--save", tmp_path / "trials")
    assert "rest_window_s" in out
    assert "steps of 0.1 mm" in out
    for source in (f"store:{tmp_path / 'trials'}", f"manifest:{place}"):
        table = load_trials(source).table
        assert table.values[:, table.names.index("f_steady")] == pytest.approx([6.0, 7.0, 8.0, 9.0], rel=0.05)
