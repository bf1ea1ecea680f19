"""Events that others labelled in recordings: read by a manifest, kept in a store, scored by `evaluate --events`."""

from __future__ import annotations

import json
import math
from typing import NamedTuple

import numpy as np
import pytest
from cases import every_case
from commands import answered, graspsense, printed, refused
from hypothesis import given
from hypothesis import strategies as st

from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.signals import GraspEvent, Phase, event_as_json, event_from_json
from graspsense.evaluation.events import LabelledEvents, evaluate_kind, outcomes
from graspsense.recording.labelled_recording import UnreadableRecording
from graspsense.sources.recordings.dataset_recordings import readable_or_not
from graspsense.sources.recordings.event_recordings import event_recordings
from graspsense.store.store import Store

RATE_HZ = 200.0
SECONDS = 6.0
T_S = np.arange(int(SECONDS * RATE_HZ)) / RATE_HZ


class Kick(NamedTuple):
    """A step of the force, which lasts for 0.1 s."""

    at_s: float
    newtons: float


def force(*kicks, level=5.0):
    """Return a force that is disturbed for 0.1 s at each of these times, with the noise of a sensor."""
    noise = 0.002 * np.random.default_rng(3).normal(size=len(T_S))
    return level + noise + sum(k.newtons * ((k.at_s <= T_S) & (k.at_s + 0.1 > T_S)) for k in kicks)


def flags(*spans):
    return np.any([(begin <= T_S) & (end >= T_S) for begin, end in spans] or [T_S < 0], axis=0).astype(int)


def write(folder, name, values, slips, head="t,F,slip"):
    rows = (f"{t:.3f},{f:.5f},{slip}" for t, f, slip in zip(T_S[: len(values)], values, slips, strict=True))
    (folder / f"{name}.csv").write_text("\n".join([head, *rows]) + "\n")


def manifest(folder, events='events = { slip = "slip" }', more=""):
    path = folder / "manifest.toml"
    path.write_text(f'files = "{{label}}_{{order:d}}.csv"\ntime = "t"\nforce = "F"\n{events}\n{more}')
    return path


def recording_in(path):
    (recording,) = readable_or_not("manifest", str(path))
    if isinstance(recording, UnreadableRecording):
        raise recording.error
    return recording.recording


def spans(events):
    return [(event.t_s, event.until_s) for event in events]


def events_in(folder, **keys):
    return {name: spans(events) for name, events in recording_in(manifest(folder, **keys)).events.items()}


# What a manifest reads.


def test_a_time_of_onset_can_be_a_column_of_the_recording(tmp_path):
    for unit, value, events in (("ms", 2500, [(2.5, 2.5)]), ("s", math.nan, [])):
        write(tmp_path, "box_1", force(), np.full(len(T_S), value))
        assert events_in(tmp_path, events=f'events = {{ slip = "slip [{unit}]" }}') == {"slip": events}


def test_an_event_from_the_start_or_behind_a_missing_label_has_no_known_begin(tmp_path):
    slips = flags((0.0, 0.5), (2.0, 3.0), (4.5, 5.0)).astype(float)
    slips[(T_S >= 2.5) & (T_S < 2.8)] = math.nan
    slips[(T_S >= 4.0) & (T_S < 4.5)] = math.nan
    write(tmp_path, "box_1", force(), slips)
    events = events_in(tmp_path)
    assert events["slip"] == [(2.0, 2.495)]
    assert events["slip not known"] == [(0.0, 0.5), (2.5, 3.0), (4.0, 5.0)]


def test_times_come_from_a_list_on_the_clock_of_the_file(tmp_path):
    stamps = T_S + 1.7e9
    for name in ("a", "b"):
        lines = ("t,F", *(f"{t:.3f},{f:.5f}" for t, f in zip(stamps, force(), strict=True)))
        (tmp_path / f"{name}.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "all.csv").write_text("file,label,slips\na.csv,box,1700000002.5;1700000001.5\nb.csv,box,\n")
    path = tmp_path / "manifest.toml"
    path.write_text('list = "all.csv"\ntime = "t"\nforce = "F"\nevents = { slip = "slips [s]" }\n')
    slipped, none = readable_or_not("manifest", str(path))
    assert [event.t_s for event in slipped.recording.events["slip"]] == pytest.approx([1.5, 2.5])
    assert none.recording.events == {"slip": ()}
    path.write_text(path.read_text().replace("slips [s]", "slipped [s]"))
    for recording in readable_or_not("manifest", str(path)):
        assert "no column 'slipped'" in str(recording.error)


def test_a_column_of_true_and_false_is_one_of_1_and_0_and_still_a_label(tmp_path):
    write(tmp_path, "box_1", force(), (T_S > 3.0).tolist())
    assert events_in(tmp_path)["slip"] == [(3.005, T_S[-1])]
    path = manifest(tmp_path, more='split = "slip"\nlabel = "slipped{slip}"')
    labels = [recording.label for recording in readable_or_not("manifest", str(path))]
    assert labels == ["slippedFalse", "slippedTrue"]


@every_case(
    ("slips", "events", "says"),
    [
        (2 * flags((1.0, 2.0)), 'events = { slip = "slip" }', "line 202.* is 2.*0 or 1"),
        (np.full(len(T_S), 7.0), 'events = { slip = "slip [s]" }', "7 s is outside"),
        (flags((1.0, 2.0)), 'events = { slip = "slip [s]" }', "2 values"),
        (flags(), 'events = { slip = "slip [mm]" }', "'mm' is not"),
        (flags(), 'events = { slip = "slid" }', "no column 'slid'"),
        (flags(), 'events = { "Slip, fast" = "slip" }', "small letters"),
        (flags(), 'events = { "slip not known" = "slip" }', "small letters"),
    ],
)
def test_wrong_labels_are_refused_with_their_place(slips, events, says, tmp_path):
    write(tmp_path, "box_1", force(), slips)
    with pytest.raises((ConfigError, DataDamaged), match=says):
        events_in(tmp_path, events=events)


def test_labels_and_times_beside_a_recording_and_cells_that_are_lists(tmp_path):
    write(tmp_path, "box_1", force(), flags())
    cells = (f'"[{k}, {2 * k}]","[{k >= 600}, None]"' for k in range(len(T_S)))
    (tmp_path / "labels.csv").write_text("\n".join(["pads,slips", *cells]) + "\n")
    beside = "beside = 'labels.csv'\nchannels = { taxels = \"'labels.pads'\" }"
    events = "events = { slip = \"'labels.slips'[0]\" }"
    recording = recording_in(manifest(tmp_path, events=events, more=beside))
    assert spans(recording.events["slip"]) == [(3.0, T_S[-1])]
    assert list(recording.readings[5].signals.taxels.cells) == [5.0, 10.0]
    (tmp_path / "labels.csv").write_text("slips\n0\n1\n")
    with pytest.raises(DataDamaged, match="1200, 2 rows"):
        events_in(tmp_path, events="events = { slip = \"'labels.slips'\" }", more=beside)


def test_lists_in_cells_count_as_cells_of_the_table(tmp_path, monkeypatch):
    monkeypatch.setenv("GRASPSENSE_MAX_CELLS", "5000")
    rows = (f'{t:.3f},1.0,"[0, 0, 0, 0, 0]"' for t in T_S)
    (tmp_path / "box_1.csv").write_text("\n".join(["t,F,slip", *rows]) + "\n")
    with pytest.raises(DataDamaged, match="GRASPSENSE_MAX_CELLS"):
        events_in(tmp_path, events='events = { slip = "slip[0]" }')


@pytest.mark.slow
def test_an_imported_trial_keeps_the_labels_among_its_events(tmp_path):
    write(tmp_path, "box_1", force(), flags((1.0, 1.5)))
    write(tmp_path, "box_2", force(Kick(2.0, 0.3)), flags())
    path = manifest(tmp_path)
    printed("import", path, "--save", tmp_path / "trials", "-o", "controller.contact_force_n=1")
    with Store.read(tmp_path / "trials") as store:
        events = store.trial(1).result.details["events"]
    assert {"t_s": 1.0, "phase": "approach", "what": "slip", "source": "label", "until_s": 1.5} in events
    assert [event["t_s"] for event in events] == sorted(event["t_s"] for event in events)
    # The second was looked at as well, so its detections count.
    score = scored(f"store:{tmp_path / 'trials'}")
    assert score == scored(f"manifest:{path}")
    assert (score["recordings"], score["kinds"]["slip"]["given"]["labelled"]) == (2, 1)


@given(st.builds(GraspEvent, st.floats(0, 1e6), st.sampled_from(Phase), st.just("slip"),
                 st.sampled_from(["runner", "controller", "model", "label"]), st.none(),
                 st.none() | st.floats(0, 1e6)))  # fmt: skip
def test_an_event_is_the_same_after_json(event):
    assert event_from_json(json.loads(json.dumps(event_as_json(event)))) == event


# The rule by which detections are matched.


@every_case(
    ("labels", "not_known", "told", "delays", "missed", "false_alarms", "repeated"),
    [
        # Each label is found once, and each detection finds one.
        ([(1.0, 1.0)], [], [0.9, 1.1], (-0.1,), 0, 1, 0),
        ([(1.0, 1.0), (1.2, 1.2)], [], [1.1], (0.1,), 1, 0, 0),
        # What is told while an event goes on is no false alarm, and finds nothing when late.
        ([(1.0, 3.0)], [], [2.0, 2.5, 3.2], (), 1, 1, 2),
        # Nothing counts where the labels are missing.
        ([], [(1.0, 2.0)], [0.8, 1.5, 2.2], (), 0, 0, 0),
        ([], [(1.0, 2.0)], [0.7], (), 0, 1, 0),
    ],
)
def test_detections_are_matched_with_labels(labels, not_known, told, delays, missed, false_alarms, repeated):
    outcome = outcomes(labels, not_known, told, 0.25)
    assert tuple(map(abs, outcome.delays_s)) == pytest.approx(tuple(map(abs, delays)))
    assert (outcome.missed, outcome.false_alarms, outcome.repeated) == (missed, false_alarms, repeated)


times = st.lists(st.floats(0, 10), max_size=8)


@given(times, times, st.floats(0.01, 2))
def test_every_label_and_every_detection_has_one_outcome(labels, told, tolerance_s):
    outcome = outcomes([(label, label) for label in labels], [], told, tolerance_s)
    assert len(outcome.delays_s) + outcome.missed == len(labels)
    assert len(outcome.delays_s) + outcome.false_alarms + outcome.repeated == len(told)
    assert all(abs(delay) <= tolerance_s for delay in outcome.delays_s)


# The score.


def scored(*arguments):
    scores = answered("evaluate", *arguments, "--events")
    del scores["source"]
    return scores


def thresholds(kinds=8, each=3):
    """Return recordings of several groups with one label each, and a detector that finds it up to a threshold of 3.

    With thresholds times less than 0.3 it has false alarms in addition.
    """
    recordings = [
        LabelledEvents(
            labelled={"slip": [(1.0 + k, 1.0 + k)]}, begin_s=0.0, end_s=60.0, group=f"g{k % kinds}"
        )
        for k in range(kinds * each)
    ]

    def told(k, factor):
        right = [1.05 + k] if factor <= 3.0 else []
        return {"slip": [*right, *([40.0, 45.0] if factor < 0.3 else [])]}

    return recordings, told


def test_the_fitted_threshold_is_the_best_one_next_to_that_of_the_unit():
    recordings, told = thresholds()
    score = evaluate_kind("slip", recordings, told, factor=10.0, tolerance_s=0.1, folds=10, seed=0)
    assert score.factors == pytest.approx([10 * 10**-0.75] * 8)  # the largest of the steps that is at most 3
    assert (score.fitted.detected, score.fitted.labelled, score.fitted.false_alarms) == (24, 24, 0)
    assert score.fitted.delay.median_s == pytest.approx(0.05)
    assert score.fitted.delay.interval == pytest.approx((0.05, 0.05))
    assert score.fitted.recall.instances == 8
    assert score.fitted.recall.interval[0] < 0.8  # 24 trials of 8 groups say no more than 8
    assert score.chance.detected == 0


def test_the_threshold_of_a_group_does_not_come_from_its_own_recordings():
    """Each of two groups needs another threshold: held out, it gets that of the other."""
    recordings, told = thresholds(kinds=2, each=3)

    def odd(k, factor):
        return told(k, factor * (1.0 if recordings[k].group == "g0" else 100.0))

    score = evaluate_kind("slip", recordings, odd, factor=1.0, tolerance_s=0.1, folds=10, seed=0)
    assert score.by_group == {"g0": (3, 3, 6), "g1": (0, 3, 0)}
    assert score.fitted.recall.interval is None
    assert "2 instances" in score.fitted.recall.no_interval
    # Of one group alone, none can be held out.
    alone = evaluate_kind("slip", *thresholds(kinds=1), factor=1.0, tolerance_s=0.1, folds=10, seed=0)
    assert (alone.fitted, alone.given.detected) == (None, 3)
    assert "held out" in alone.not_fitted


def boxes(folder, newtons=0.15):
    """Write two recordings of each of two things, with two slips in each."""
    for label, level in (("box", 5.0), ("can", 6.0)):
        for order in (1, 2):
            begin = 1.0 + 0.3 * order
            kicks = (Kick(begin, newtons), Kick(begin + 1.0, newtons))
            slips = flags(*((k.at_s, k.at_s + 0.1) for k in kicks))
            lasting = int(3.0 * RATE_HZ)
            write(folder, f"{label}_{order}", force(*kicks, level=level)[:lasting], slips[:lasting])


@pytest.mark.slow
def test_slips_of_a_force_are_found_and_what_cannot_be_told_is_said(tmp_path):
    boxes(tmp_path)
    path = manifest(tmp_path, events='events = { slip = "slip", jump = "slip" }')
    source = f"manifest:{path}"
    scores = scored(source)
    slip = scores["kinds"]["slip"]["given"]
    assert (slip["labelled"], slip["found"]) == (8, 8)
    assert 0.0 <= slip["delay"]["median_s"] <= 0.05  # the pads are sampled each 41 ms
    assert scores["held_out"] == "label"
    assert scores["not_told"] == ["jump"]
    assert scores["not_labelled"]["no acceleration is measured: placing is told by force alone"] == 4


def test_sessions_of_several_objects_are_held_out_as_a_whole(tmp_path):
    for order in range(8):
        name = f"{('box', 'can')[order % 2]}_{('mo', 'tu')[order // 4]}_{order}"
        write(tmp_path, name, force(level=5.0 + order), flags())
    path = tmp_path / "m.toml"
    path.write_text(
        'files = "{label}_{instance}_{order:d}.csv"\ntime = "t"\nforce = "F"\nevents = { slip = "slip" }\n'
    )
    read = event_recordings(f"manifest:{path}")
    assert sorted(read.groups) == ["mo"] * 4 + ["tu"] * 4
    assert any("count as sessions" in note for note in read.notes)


@pytest.mark.slow
def test_a_force_in_another_unit_is_scored_by_fitted_thresholds(tmp_path):
    boxes(tmp_path, newtons=150.0)
    path = manifest(tmp_path)
    path.write_text(path.read_text().replace('"F"', '"F [counts]"'))
    scores = scored(f"manifest:{path}")
    assert scores["kinds"]["slip"]["fitted"]["found"] == 8
    assert any("counts" in note for note in scores["notes"])


@pytest.mark.slow
def test_an_acceleration_of_one_axis_is_told_and_its_threshold_can_be_set(tmp_path):
    shock = 30.0 * ((T_S >= 2.0) & (T_S < 2.01))
    write(tmp_path, "box_1", 9.8 + shock, flags((2.0, 2.1)))
    text = 'channels = { acceleration = "F [m/s2]" }\nfast = "acceleration"\n'
    path = manifest(tmp_path, events='events = { acceleration = "slip" }', more=text)
    path.write_text(path.read_text().replace('force = "F"', 'force = "0"'))
    source = f"manifest:{path}"
    assert scored(source)["kinds"]["acceleration"]["given"]["found"] == 1
    high = ("-o", "controller.acceleration_m_s2=90")
    assert scored(source, *high)["kinds"]["acceleration"]["given"]["found"] == 0


@every_case(
    ("arguments", "code", "says"),
    [
        (("--events", "--png", "x.png"), 2, "--png"),
        (("--events", "--tolerance", "0"), 2, "tolerance"),
        (("--events", "--tolerance", "nan"), 2, "above 0, at most 60"),
        (("--events", "--instance", "box"), 2, "--instance"),
        (("--events", "--only", "jar"), 2, "0 recordings"),
        (("--events", "-o", "controller.type=grab"), 2, "no such channel"),
        (("--events", "-o", "features.type=curve"), 2, "[controller]"),
    ],
)
def test_wrong_uses_are_told(arguments, code, says, tmp_path):
    boxes(tmp_path)
    ended, _, err = graspsense("evaluate", f"manifest:{manifest(tmp_path)}", *arguments)
    assert ended == code
    assert says in err


def test_the_squeezes_of_a_file_get_the_labels_of_their_own_time(tmp_path):
    held = ((T_S > 1.0) & (T_S < 2.5)) | ((T_S > 3.5) & (T_S < 5.0))
    write(tmp_path, "box_1", 5.0 * held, flags((1.5, 1.6), (4.0, 4.2), (4.5, 4.6)))
    squeezes = readable_or_not("manifest", str(manifest(tmp_path, more='split = "force"')))
    events = [spans(squeeze.recording.events["slip"]) for squeeze in squeezes]
    assert events == [[(1.5, 1.6)], [(4.0, 4.2), (4.5, 4.6)]]


def test_recordings_without_labels_are_an_error_or_a_note(tmp_path):
    write(tmp_path, "box_1", force(), flags())
    assert "no event" in refused("evaluate", f"manifest:{manifest(tmp_path, events='')}", "--events")
    write(tmp_path, "box_2", force(level=6.0), np.full(len(T_S), math.nan))
    scores = scored(f"manifest:{manifest(tmp_path)}")
    assert scores["recordings"] == 1
    assert any("1 of 2 recordings left" in note for note in scores["notes"])
    for source in ("simulated", "icub", str(tmp_path / "box_1.csv")):
        assert "recordings" in refused("evaluate", source, "--events")
