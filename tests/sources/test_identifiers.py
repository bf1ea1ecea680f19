"""What identifies a trial is not a feature, in whatever order the lines are; what was measured is one."""

from datetime import datetime

import numpy as np
import pytest
from cases import every_case
from hypothesis import given, settings
from hypothesis import strategies as st

from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.sources.trial_table.features_csv import read_labelled
from graspsense.sources.trial_table.identifiers import identifies, text_identifies

LABELS = ("can",) * 30 + ("jar",) * 30
N = len(LABELS)


def swapped(values):
    return [values[1], values[0], *values[2:]]


def tied(values):
    return [*values[:7], values[6], *values[8:]]


COUNTERS = {
    "a trial number": range(N),
    "with gaps": np.cumsum(np.random.default_rng(0).integers(1, 9, N)),
    "with large gaps": np.cumsum(np.random.default_rng(0).integers(1, 500, N)),
    "a clock in seconds": np.cumsum(np.random.default_rng(0).normal(20.0, 3.0, N)),
    "a clock with a pause": [12.5 * i + i * i % 7 + 3000.0 * (i >= 30) for i in range(N)],
    "seconds since 1970": [1.7e9 + 31.7 * i for i in range(N)],
    "milliseconds since 1970": [1_700_000_000_123 + 31_700 * i for i in range(N)],
    "dates": [20260101 + i % 28 + 100 * (i // 28) for i in range(N)],
    "dates with the day in front": [7112024 + 1_000_000 * (i // 20) for i in range(N)],
    "dates of sessions": [20260101 + i // 15 for i in range(N)],
    "times": [20261126093000 + i % 30 + 100 * (i // 30) for i in range(N)],
    "times of the day": [int(f"{9 + k // 3600}{k // 60 % 60:02}{k % 60:02}") for k in range(0, 97 * N, 97)],
    "dates without the century": [int(f"2403{1 + i // 9:02}{9 + i % 9:02}{i * 7 % 60:02}") for i in range(N)],
    "a counter of each label": [*range(30), *range(30)],
    "a counter of four bits": [(i + 5) % 16 for i in range(N)],
    "a counter of a byte with lost numbers": np.cumsum(np.random.default_rng(1).integers(1, 9, N)) % 256,
    "minutes of the hour": [(2 * i + 20) % 60 for i in range(N)],
}
ORDERS = {"as it is": list, "falling": lambda values: list(values)[::-1], "a swap": swapped, "a tie": tied}


@every_case("order", ORDERS)
@every_case("counter", COUNTERS)
def test_a_counter_or_a_time_is_no_feature_in_any_order(counter, order):
    assert identifies("x", "", ORDERS[order](list(COUNTERS[counter])), LABELS)


def test_where_the_lines_are_shuffled_numbers_are_known_by_their_name_their_order_or_as_objects():
    order = np.random.default_rng(1).permutation(N)
    labels = [LABELS[i] for i in order]
    values = np.array(COUNTERS["with large gaps"])[order]
    for name in ("trial_id", "runNumber", "No", "index", "file"):
        assert identifies(name, "", values, labels)
    assert not identifies("force", "", values, labels)
    # A clock follows the order of recording.
    assert identifies("x", "", np.array(COUNTERS["a clock in seconds"])[order], labels, order.tolist())
    # Tenths that do not repeat, in few lines.
    assert identifies("x", "", (order[order < 20] / 10).tolist(), LABELS[20:40])
    # Numbers of objects are instances.
    objects = np.repeat(np.arange(12), 5)
    assert "--instance" in identifies("x", "", objects, LABELS)
    assert "--instance" in identifies("x", "", objects[order], labels)
    # The last object of each label has fewer lines.
    kinds = [f"kind {k // 20}" for k in range(N)]
    fewer = [10 * (k // 20) + k % 20 // 3 for k in range(N)]
    assert "--instance" in identifies("x", "", np.array(fewer)[order], [kinds[k] for k in order])
    # Few values of few lines can be measured equally often, and sizes that take turns rise with each turn.
    assert not identifies("x", "", [2, 0, 2, 1, 0, 2, 4, 5, 4, 5, 4, 5], ["can"] * 6 + ["jar"] * 6)
    assert not identifies(
        "x", "", [30 * (k % 6) + k * 7 % 5 + k // 24 for k in range(48)], [f"{k % 6}" for k in range(48)]
    )


def table(path, column, values, measured=True):
    rng = np.random.default_rng(5)
    lines = [f"{label},{value},{rng.normal():.3f}" for label, value in zip(LABELS, values, strict=True)]
    text = "\n".join(lines if measured else [line.rpartition(",")[0] for line in lines])
    path.write_text(f"object,{column}{',s' if measured else ''}\n{text}\n")
    return path


SESSIONS = {
    "letters": ["ABCDEF"[i // 10] for i in range(N)],
    "weekdays of others": [("Mo", "Di", "Fr")[i // 20] for i in range(N)],
    "months": [("January", "March", "May")[i % 3] for i in range(N)],
    **{
        f"dates as {form}": [
            datetime(2024, 3 + i % 2, 5 + i // 20, 9 + i % 2).strftime(form) for i in range(N)
        ]
        for form in ("%d-%b-%Y", "%b %d, %Y", "%A, %d %B %Y", "%a %-d %b, %-I %p")
    },
    "predictions": ["can" if i % 40 < 30 else "jar" for i in range(N)],
    "names": [("cola", "tonic", "water", "beans", "honey", "jam")[i // 10] for i in range(N)],
    "numbered, with a group in both labels": [f"group{(i + 1) // 10}" for i in range(N)],
}


@every_case("texts", SESSIONS)
def test_texts_that_name_a_session_or_an_object_are_no_feature(texts):
    assert text_identifies(SESSIONS[texts], LABELS)


def test_the_words_of_the_labels_are_a_feature_where_they_answer_another_question():
    assert not text_identifies(["can", "jar"] * (N // 2), LABELS)


KNOWN_IN_ANY_ORDER = {
    **{
        name: COUNTERS[name]
        for name in ("a trial number", "seconds since 1970", "dates", "times", "times of the day")
    },
    "times of the day with any pauses": [
        int(f"{9 + k // 3600}{k // 60 % 60:02}{k % 60:02}")
        for k in np.random.default_rng(4).integers(40, 600, N).cumsum().tolist()
    ],
    "a tenth": [0.1 * i for i in range(N)],
    "days of a table": [46_000.0 + i * 37 / 1440 + 1e-4 * (i % 3) for i in range(N)],
    "two lines each, falling": [(N - i) // 2 for i in range(N)],
    "three lines each": [(i + 1) // 3 for i in range(N)],
    "days in seconds since 1970": [1_793_404_800 + 86_400 * (i // 10) for i in range(N)],
    "the last lines of objects left out": np.repeat(np.arange(12), [5, 6, 4, 5, 6, 4] * 2),
    "hashed days": [int(x) for x in np.repeat(np.random.default_rng(0).integers(1 << 32, size=6), 10)],
}


@every_case("counter", KNOWN_IN_ANY_ORDER)
def test_a_number_with_a_rule_is_no_feature_in_any_order(counter):
    values = np.array(KNOWN_IN_ANY_ORDER[counter])
    for order in (np.arange(N), *(np.random.default_rng(seed).permutation(N) for seed in range(20))):
        assert identifies("x", "", values[order], [LABELS[i] for i in order])


def test_a_large_number_that_was_rounded_to_thousands_is_no_hash_of_an_object():
    pascals = np.repeat(1e3 * np.random.default_rng(0).integers(50_000, 900_000, size=6), 10)
    assert not identifies("modulus", "", pascals, LABELS)
    assert identifies("modulus", "", pascals + 1.0, LABELS)


@every_case("unit", ["s", "hours", "Minutes", "days", "nr", "ID"])
def test_a_time_or_a_number_with_any_steps_is_known_in_any_spelling_of_its_unit(unit):
    rises = np.random.default_rng(0).integers(1, 9, N).cumsum()
    assert identifies("x", unit, rises, LABELS)
    if unit == "s":
        assert identifies("t", unit, np.random.default_rng(0).exponential(1.0, N).cumsum(), LABELS)


@given(seed=st.integers(0, 10_000), scale=st.sampled_from([1e-6, 1e-3, 1.0, 50.0]), digits=st.integers(1, 4))
def test_a_measured_column_is_a_feature_in_any_order_of_the_lines(seed, scale, digits):
    rng = np.random.default_rng(seed)
    sizes = [f"size {i // 12}" for i in range(N)]
    rising = [scale * (i // 12 + rng.normal(0.0, 0.1)) for i in range(N)]
    noise = rng.normal(0.0, scale, N)
    for values in (rising, rising[::-1], noise, sorted(noise), np.round(noise / scale * 40.0)):
        assert not identifies("width", "", values, sizes)
    far_apart = rng.normal([0.0] * 30 + [3.0] * 30, 1.0)
    for values in (
        rng.normal([300.0] * 30 + [500.0] * 30, 60.0).round(),  # counts of an analog-to-digital converter
        rng.normal([50.0] * 30 + [70.0] * 30, 2.0).round(),  # a width in whole millimetres
        rng.poisson([3.0] * 30 + [9.0] * 30),  # contacts
        rng.integers(0, 2, N),
        scale * far_apart.round(digits),
        scale * rng.exponential(1.0, N).round(digits),
        # A value far from all others, and numbers in the range of a clock.
        *(np.append(far_apart[1:].round(4), outlier) for outlier in (1e12, 1e99)),
        *(base + far_apart.round(3) for base in (1e9, 1e12)),
    ):
        assert not identifies("x", "", values.astype(float), LABELS)
    assert not identifies("width", "mm", list(range(N)), LABELS)


def test_texts_that_describe_an_object_are_a_feature():
    rng = np.random.default_rng(2)
    colours = rng.choice(["red", "green", "blue", "grey", "white", "black"], N).tolist()
    odours = rng.choice(["a", "l", "n"], 30).tolist() + rng.choice(["f", "c", "m", "p"], 30).tolist()
    assert not text_identifies(colours, LABELS)
    assert not text_identifies(odours, LABELS)


NAMED = {
    "session": [
        (1, 2, 3, 4)[i // 15] for i in range(N)
    ],  # two for each label: too few to be known by their values
    "Robot ID": [f"arm {i // 20}" for i in range(N)],
    "Bediener": ["anna" if i < 27 else "ben" for i in range(N)],
    "randomSeed": [1234 + 8765 * (i // 30) for i in range(N)],
    "day [day]": [i // 20 for i in range(N)],
    "predicted": ["can" if i < 28 else "jar" for i in range(N)],
    "wd": ["Mon" if i < 15 else "Tue" if i < 40 else "Wed" for i in range(N)],
    # Texts, although some have digits alone.
    "hash": [f"{(i + 1) * 2654435761 % 2**32:08x}" for i in range(N - 2)] + ["12345678", "1234e567"],
    "trial_id": range(N)[::-1],
    "cv_fold": [i % 5 for i in range(N)],
    "is_train": [int(i * 7 % 10 < 8) for i in range(N)],
    "CRC-32": [(i + 1) * 2654435761 % 2**32 for i in range(N)],
    "rep_no": [i % 10 for i in range(N)],
    "progress [%]": [round(100 * i / N, 1) for i in range(N)],
}


@pytest.mark.slow
@every_case("heading", NAMED)
def test_what_tells_of_the_recording_is_a_feature_only_where_it_is_asked_for(heading, tmp_path):
    path = table(tmp_path / "t.csv", heading, NAMED[heading])
    trials = read_labelled(path, "object")
    assert trials.table.names == ("s",)
    assert any(heading.split()[0] in note and "to include them" in note for note in trials.notes)
    if heading == "trial_id":
        chosen = read_labelled(path, "object", features=["trial_id", "s"])
        assert chosen.table.names == ("trial_id", "s")
        assert any("trial_id" in note and "reveal" in note for note in chosen.notes)
        with pytest.raises(ConfigError, match=r"trial_id.*to include"):
            read_labelled(table(tmp_path / "t.csv", "trial_id", range(N), measured=False), "object")


def notes_on(path, column, values, labels=LABELS, order=None):
    # So that no order shows anything, unless one is given.
    order = np.random.default_rng(6).permutation(N) if order is None else order
    lines = [f"{labels[i]},{values[i]},{np.random.default_rng(i).normal():.4f}" for i in order]
    path.write_text("\n".join([f"object,{column},s", *lines]) + "\n")
    return [note for note in read_labelled(path, "object").notes if column.partition(" ")[0] in note]


RNG = np.random.default_rng(7)
NOISE = RNG.normal(6.0, 1.0, N).round(3).tolist()
THREE = [f"object {i // 20}" for i in range(N)]
ZERO = 0.01 * np.arange(N) + RNG.normal(0.0, 0.02, N)
DOUBTFUL = {
    "values of one label each": ("x", [(1, 2, 3, 4)[i // 15] for i in range(N)]),
    "the label in other words": ("class", [1] * 30 + [2] * 30),
    "a time": ("elapsed_h", np.cumsum(RNG.exponential(0.1, N)).round(4)),
    "a noisy counter": ("x", (np.arange(N) + RNG.normal(0.0, 0.3, N)).round(3)),
    "seconds since 1970 in thousands": ("x", 1.77e6 + 0.037 * np.arange(N) + RNG.uniform(0, 0.02, N)),
    "days of a spreadsheet": (
        "x",
        [45352.375 + 0.0007 * i + 0.02 * (i >= 30) + 1e-4 * (i % 7) for i in range(N)],
    ),
    "days of MATLAB": ("x", [739312.375 + i // 20 + 0.0007 * (i % 20) ** 1.1 for i in range(N)]),
    "values of one label only": ("x", [*NOISE[:30], *[""] * 30]),
    "values of hardly any trial of a label": ("x", [*NOISE[:33], *[""] * 27]),
    "fewer digits for a label": ("x", [*NOISE[:30], *map(round, NOISE[30:])]),
    "measured once for each object": ("weight [g]", [98.0 + 0.37 * (i // 5) for i in range(N)]),
    "a number for what is missing": ("x", [value if i % 4 else -999 for i, value in enumerate(NOISE)]),
    "a zero for what is missing": ("f [N]", [value if i % 6 else 0.0 for i, value in enumerate(NOISE)]),
    "a sensor that was stuck with one label": ("f [N]", [*[3.217] * 30, *NOISE[30:]]),
    "the end of a range": ("f [N]", [min(value, 6.5) for value in NOISE]),
    "a temperature that drifts": ("T [C]", 21.0 + 0.05 * np.arange(N) + 0.05 * RNG.normal(size=N)),
    "a gap before the contact": (
        "gap_at_start [mm]",
        [80.0 + i // 10 + RNG.normal(0.0, 0.1) for i in range(N)],
    ),
    "who grasped most trials of a label, and others": (
        "handler",
        ["CD"[i % 2] if i in (3, 40) else "AB"[i > 29] for i in range(N)],
    ),
    "a code that noise has": ("level", [(i > 29) + RNG.uniform(-0.45, 0.45) for i in range(N)]),
    "a result of a test": ("p_value", RNG.uniform(size=N).round(4)),
    "a result of a model": ("knn_distance", [*NOISE[:30], *(value + 2.0 for value in NOISE[30:])]),
    "what a model says of a label": ("dist_to_can", [*NOISE[:30], *(value + 4.0 for value in NOISE[30:])]),
    "who grasped most trials of a label": ("handler", ["AB"[(i > 29) != (i % 9 == 0)] for i in range(N)]),
    "millimetres and metres": ("x", [*NOISE[:30], *[f"{value / 1000:.6f}" for value in NOISE[30:]]]),
    # All trials of a label have it alike.
    "a rate": ("rate [Hz]", [(100.0, 99.7, 100.0)[i // 20] for i in range(N)], THREE),
    "whether it is the first": ("is_first", [int(i < 20) for i in range(N)], THREE),
    "a lid": ("lid", ["aba"[i // 20] for i in range(N)], THREE),
    # In the order of the lines.
    "a battery": ("kind [V]", 12.6 - 0.01 * np.arange(N) + RNG.normal(0.0, 0.02, N), LABELS, range(N)),
    "a version": ("kind", [1.2 if i < 27 else 1.3 for i in range(N)], LABELS, range(N)),
    "what adds up over the trials": ("energy [J]", np.cumsum(RNG.uniform(0.5, 2.0, N)).round(3)),
    "a probability": ("svm_prob", [*NOISE[:30], *(value + 4.0 for value in NOISE[30:])]),
    "a single code for a missing value": ("kind [V]", [*NOISE[:-1], -9999.0], LABELS, range(N)),
}


@pytest.mark.slow
@every_case("doubt", DOUBTFUL)
def test_a_column_that_may_reveal_the_labels_or_drifts_is_told(doubt, tmp_path):
    notes = notes_on(tmp_path / "t.csv", *DOUBTFUL[doubt])
    assert notes
    if len(DOUBTFUL[doubt]) == 4:
        assert [note for note in notes if "reveals" in note or "all other values" in note]


def test_what_drifts_is_told_in_the_order_of_recording(tmp_path):
    order = np.random.default_rng(4).permutation(N)
    lines = [f"{LABELS[i]},{ZERO[i]:.4f},{i},{NOISE[i]}" for i in order]
    (tmp_path / "t.csv").write_text("\n".join(["object,kind,nr,s", *lines]) + "\n")
    notes = read_labelled(tmp_path / "t.csv", "object", order="nr").notes
    assert any("kind" in note and "order of recording" in note for note in notes)


@pytest.mark.slow
@every_case(
    ("heading", "values"),
    [
        *((heading, NOISE) for heading in ("robot_force", "day_temperature", "number", "rise_time [s]")),
        ("gap_at_start [m]", [0.0797] * N),
        ("initial_stiffness [N/m]", [*NOISE[:30], *(value + 4.0 for value in NOISE[30:])]),
        # What a sensor gives, or a part of a name says, is no result of a model.
        ("output [V]", NOISE),
        ("loss_factor", NOISE),
        # As large as seconds since 1970, and over more years than a table is recorded in.
        ("stiffness", [3e8 * value for value in NOISE]),
        ("stiffness", [1.5e9 + 1e7 * value for value in NOISE]),
        # Slips are often zero.
        ("slip [mm]", [max(value - 6.0, 0.0) for value in NOISE]),
        # A setting that all labels have.
        ("level [N]", [5 + 5 * ((i % 2) != (i % 9 == 0)) for i in range(N)]),
        # No two units have a ratio that is beyond every number.
        ("width", np.where(np.arange(N) % 2, 1e-300, 1e29) * np.random.default_rng(10).uniform(1.0, 9.0, N)),
    ],
)
def test_what_is_measured_is_a_feature_whatever_else_its_name_says(heading, values, tmp_path):
    notes = notes_on(tmp_path / "t.csv", heading, values)
    assert len(read_labelled(tmp_path / "t.csv", "object").table.names) == 2
    assert not [note for note in notes if not note.startswith("constant")]


@every_case("n", [20, 60])
def test_minutes_of_the_day_are_told_where_the_labels_are_in_blocks(n, tmp_path):
    labels = [("can", "jar")[i // 10 % 2] for i in range(n)]
    minutes = [f"9.{i // 2 + i // 10:02}" for i in range(n)]
    assert notes_on(tmp_path / "t.csv", "x", minutes, labels, range(n))
    mixed = np.random.default_rng(2).permutation(labels).tolist()
    assert not notes_on(tmp_path / "t.csv", "x", [*minutes[:3], *minutes[:-3]], mixed, range(n))


@pytest.mark.slow
@settings(max_examples=25)
@given(seed=st.integers(0, 10_000))
def test_numbers_that_stay_for_a_few_lines_each_are_told(tmp_path_factory, seed):
    """As those of sessions of any length; measured on a grid as coarse, they are not."""
    rng = np.random.default_rng(seed)
    sessions = np.searchsorted(
        np.sort(rng.choice(np.arange(1, N), N // 5, replace=False)), range(N), side="right"
    )
    path = tmp_path_factory.mktemp("sessions") / "t.csv"
    assert notes_on(path, "x", rng.permutation(N)[sessions], order=range(N))
    assert not [
        note for note in notes_on(path, "x", rng.integers(0, 12, N), order=range(N)) if "consecutive" in note
    ]


@pytest.mark.slow
@settings(max_examples=25)
@given(
    seed=st.integers(0, 10_000), objects=st.sampled_from([1, 3, 6]), spread=st.sampled_from([0.05, 0.3, 1.0])
)
def test_objects_that_come_one_after_the_other_do_not_drift(tmp_path_factory, seed, objects, spread):
    """None of 2000 columns that were drawn so looked as if they did."""
    rng = np.random.default_rng(seed)
    widths = rng.normal(0.0, 2.0, 2).repeat(30) + rng.normal(0.0, 1.0, 2 * objects).repeat(30 // objects)
    values = (widths + rng.normal(0.0, spread, N)).round(3)
    assert not notes_on(tmp_path_factory.mktemp("blocks") / "t.csv", "width [mm]", values, order=range(N))


@every_case("dead", [lambda f: -f, lambda f: 0.02 * f, lambda f: 1000.0 * f])
def test_pads_that_disagree_in_some_trials_are_told(dead, tmp_path):
    rng = np.random.default_rng(3)
    left = rng.normal(8.0, 1.0, N)
    right = left * rng.normal(1.0, 0.1, N)

    def pads_told(left):
        lines = [f"{label},{a:.3f},{b:.3f}" for label, a, b in zip(LABELS, left, right, strict=True)]
        (tmp_path / "t.csv").write_text("\n".join(["object,f_left [N],f_right [N]", *lines]) + "\n")
        return [note for note in read_labelled(tmp_path / "t.csv", "object").notes if "f_right" in note]

    assert pads_told(np.where(np.arange(N) < 30, dead(left), left))
    assert not pads_told(left)
    assert not pads_told(rng.normal(0.0, 1.0, N))


@pytest.mark.slow
@given(seed=st.integers(0, 10_000))
def test_measured_columns_are_not_doubted(tmp_path_factory, seed):
    rng = np.random.default_rng(seed)
    path = tmp_path_factory.mktemp("measured") / "t.csv"
    for values in (
        rng.normal([0.0] * 30 + [9.0] * 30, 1.0).round(4),  # classes far apart
        rng.lognormal(0.0, 1.5, N).round(5),
        np.maximum(rng.normal(0.0, 1.0, N), 0.0).round(4),  # a force that is zero in half of the trials
        rng.normal([3.0] * 30 + [40.0] * 30, 1.0).round(),
        rng.choice([0.05, 0.1, 0.15, 0.2, 0.25], N, p=[0.5, 0.2, 0.1, 0.1, 0.1]),  # a time in samples
    ):
        assert not notes_on(path, "width [mm]", values.tolist())
    coarse = rng.normal([5.0] * 30 + [40.0] * 30, 2.0).round()
    assert not notes_on(path, "width", coarse.tolist())


def test_a_number_too_large_to_learn_from_is_refused_by_its_name(tmp_path):
    with pytest.raises(DataDamaged, match=r"'x' of trial 1 is 1e\+308"):
        read_labelled(table(tmp_path / "t.csv", "x", [1e308] * 30 + [-1e308] * 30), "object")


def test_the_number_to_predict_in_another_unit_is_told(tmp_path):
    forces = np.random.default_rng(8).normal(12.0, 3.0, N).round(3)
    widths = np.random.default_rng(9).normal(60.0, 3.0, N).round(3)
    path = tmp_path / "t.csv"
    for other in (1000.0 * forces, forces.round(), -(forces**2)):
        lines = [f"{force},{x},{width}" for force, x, width in zip(forces, other, widths, strict=True)]
        path.write_text("\n".join(["break_n,other,width", *lines]) + "\n")
        notes = read_labelled(path, None, value="break_n").notes
        assert any("other" in note and "another unit" in note for note in notes)
        assert not any("width" in note for note in notes)


def test_sessions_that_are_not_held_out_are_told(tmp_path):
    """Each session has all objects; or one of them only, so that who holds out the object holds out the session."""
    values = np.random.default_rng(0).normal(size=N).round(3)
    lines = [
        f"{label},{value},{i // 2 % 5},{label}{i % 3},{label}{i % 3}-{i % 2},{i % 7}"
        for i, (label, value) in enumerate(zip(LABELS, values, strict=True))
    ]
    path = tmp_path / "grasps.csv"
    path.write_text("\n".join(["object,width,session,item,operator,seed", *lines]))
    told = [
        note
        for note in read_labelled(path, "object", instance="item").notes
        if note.startswith("not held out")
    ]
    assert len(told) == 1
    assert "session" in told[0]
    told = [note for note in read_labelled(path, "object").notes if note.startswith("not held out")]
    assert len(told) == 2
    with pytest.raises(ConfigError, match="is the label"):
        read_labelled(path, "object", instance="object")
