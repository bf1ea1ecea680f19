import math
import re

import numpy as np
import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense.core.learn.labelled import Labelled
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.features import FeatureTable
from graspsense.sources.trial_source import load_trials
from graspsense.sources.trial_table.features_csv import read_labelled, read_table, write_labelled

GOOD = "what,p_first [m],f_steady\n" + "".join(
    f"{'ab'[i % 2]},{0.05 + 0.001 * (i % 3)},{6 + i % 2}\n" for i in range(8)
)


@pytest.fixture
def csv(tmp_path):
    def write(content, name="trials.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


@every_case(
    ("content", "error", "said"),
    [
        ("", DataDamaged, "is empty"),
        ("\n\n  \n", DataDamaged, "is empty"),
        ("what,p_first\n", DataDamaged, "no trials"),
        (GOOD.replace("what", "class"), ConfigError, "'what' (the label). Its columns: class, p_first"),
        (GOOD.replace("a,0.05,6", "a,0.05", 1), DataDamaged, "line 2: 2 values"),
        (GOOD.replace("a,0.05,6", "a,wide,6", 1), DataDamaged, "line 2: p_first is 'wide'"),
        (GOOD.replace("a,0.05,6", 'a,"0,05",6', 1), DataDamaged, "a decimal point"),
        (GOOD.replace("a,0.05,6", "a,5_0,6", 1), DataDamaged, "line 2: p_first is '5_0'"),
        (GOOD.replace("a,0.05,6", "a,inf,6", 1), DataDamaged, "line 2: p_first is infinite"),
        (GOOD.replace("a,0.05,6", ",0.05,6", 1), DataDamaged, "line 2: what (the label) is empty"),
        (GOOD.replace("a,0.05,6", 'a,"0.05,6', 1), DataDamaged, "line "),
        ("what,a,b,a,b,a,b\n" + "p,1,2,3,4,5,6\n" * 3, DataDamaged, "line 1"),
        (GOOD.replace("a,", "unknown,"), ConfigError, "'unknown'"),
        (GOOD.encode("utf-16")[:-1], DataDamaged, "begins as UTF-16"),
        (GOOD.replace("b,", "бутылка,").encode("cp1251"), DataDamaged, "line 3: byte 0xf2 is not UTF-8"),
        (b"what,p\n\x00\x00,1\n", DataDamaged, "zero bytes"),
        (b"PAR1\x15\x04", DataDamaged, "a binary table"),
        (b"PK\x03\x04\x00\x00what,p", DataDamaged, "cannot be read as a spreadsheet"),
        ("what,p\na,\nb,\n" * 1, DataDamaged, "any value: p"),
        ("what,name\na,x\na,y\nb,z\n", ConfigError, "besides what"),
        ("what,p\n" + "".join(f"{i * 1.1},{i % 2}\n" for i in range(9)), ConfigError, "be the label"),
    ],
)
def test_what_cannot_be_read_says_where_and_why(csv, content, error, said):
    with pytest.raises(error) as raised:
        read_labelled(csv(content), "what")
    assert said in str(raised.value)
    with pytest.raises(ConfigError, match="cannot be read"):
        read_labelled(csv("").with_name("nothing.csv"), "what")


@every_case("encoding", ["utf-16", "utf-16-be", "utf-16-le", "utf-32", "utf-32-le", "latin-1", "cp1252"])
def test_a_table_in_another_encoding_is_the_same_table(csv, encoding):
    text = GOOD.replace("b,", "öffner,").replace("f_steady", "f_steady [µm]")
    expected = read_labelled(csv(text.encode()), "what")
    for mark in ("\ufeff", "") if "-be" in encoding or "-le" in encoding else ("",):
        read = read_labelled(csv((mark + text).encode(encoding)), "what")
        assert (read.labels, read.table.units) == (expected.labels, expected.table.units)
        assert read.table.values.tolist() == expected.table.values.tolist()


def test_a_unit_in_every_cell_is_that_of_the_column_and_labels_keep_theirs(csv):
    rows = [(f"{500 * (1 + i % 2)} g", f"{6 + i % 2},{i}", f"{i % 3}.5 mm" if i else "nan") for i in range(8)]
    read = read_labelled(
        csv("size;force (N);gap;f (min)\n" + "".join(f"{';'.join(row)};2\n" for row in rows)), "size"
    )
    assert set(read.labels) == {"500 g", "1000 g"}
    assert (read.table.names, read.table.units) == (("force (N)", "gap", "f (min)"), ("N", "mm", ""))
    assert read.table.values[:2, 0].tolist() == [6.0, 7.1]


def test_instances_order_and_what_is_known_before_the_contact(csv):
    lines = [f"{'ab'[i % 2]},thing{i % 4},{100 - i},{i % 3},{i % 5}" for i in range(12)]
    path = csv("what,thing,when,start,p\n" + "\n".join(lines) + "\n")
    trials = read_labelled(path, "what", instance="thing", order="when", known_before=["start"])

    assert trials.instances == ("thing0", "thing1", "thing2", "thing3") * 3
    assert trials.order == tuple(range(11, -1, -1))
    assert trials.before_contact is not None
    assert trials.before_contact.table.names == ("start",)
    with pytest.raises(ConfigError, match=r"^'when' "):
        read_labelled(path, "what", order="when", features=["when", "p"])


CELLS = st.one_of(st.floats(-1e100, 1e100), st.just(math.nan))


@given(st.lists(st.tuples(CELLS, st.floats(-1e9, 1e9)), min_size=4, max_size=20))
def test_what_is_written_reads_back_to_the_bit(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("kept") / "kept.csv"
    values = np.array(rows)
    labels = tuple("xy"[i % 2] for i in range(len(rows)))
    things = tuple(f"thing, {i % 3}" for i in range(len(rows)))
    table = FeatureTable(names=("p_first", "force"), units=("m", ""), values=values)

    write_labelled(path, Labelled(source="here", table=table, labels=labels, instances=things))
    again = read_labelled(path, "label", instance="instance", features=["p_first", "force"])

    assert again.table.values.tobytes() == np.where(np.isnan(values), np.nan, values).tobytes()
    assert (again.labels, again.instances, again.table.units) == (labels, things, ("m", ""))


def test_a_table_without_labels(csv):
    trials, _ = read_table(csv(GOOD), ["f_steady", "p_first"])
    assert (trials.names, trials.values[0].tolist()) == (("f_steady", "p_first"), [6.0, 0.05])
    # A line of separators between others moves the numbers of trials, one behind them does not.
    lines = GOOD.splitlines()
    spaced, notes = read_table(csv("\n".join([*lines[:3], ",,", *lines[3:], ",,"])), ["f_steady", "p_first"])
    assert spaced.values.tolist() == trials.values.tolist()
    assert [note for note in notes if "left out" in note] == ["left out: 1 line of empty cells (line 4)"]


def test_a_word_in_several_cells_of_a_column_of_numbers_counts_as_missing(csv):
    """But not in the column of the label, and not if it stands there once, or is one of several."""
    path = csv(GOOD.replace(",7\n", ",XL\n", 2).replace("a,", "1,").replace("b,", "no,"))
    trials = read_labelled(path, "what")
    assert np.isnan(trials.table.values[:, 1]).tolist() == [False, True, False, True, *[False] * 4]
    assert trials.classes == ("1", "no")
    assert any("'XL'" in note for note in trials.notes)
    for text in (
        GOOD.replace(",7\n", ",XL\n", 1),
        GOOD.replace(",7\n", ",XL\n", 2).replace(",6\n", ",UL\n", 2),
    ):
        with pytest.raises(DataDamaged, match=r"'XL'|'UL'"):
            read_labelled(csv(text), "what")


def test_values_of_a_nominal_column_that_a_model_does_not_know_are_told(csv):
    path = csv(
        "what,colour,p\n" + "".join(f"{'ab'[i % 2]},{('red', 'blue', 'Red')[i % 3]},{i}\n" for i in range(9))
    )
    table, notes = read_table(path, ["colour=red", "colour=blue", "p"])
    assert np.isnan(table.values[:, 0]).tolist() == [False, False, True] * 3
    assert [note for note in notes if "3 trials" in note and "'Red' and 'red'" in note]
    assert read_table(path, ["colour=red", "colour=blue", "colour=Red"])[1] == ()


def test_a_table_with_a_line_for_each_feature_is_refused(csv):
    lines = [f"{k},{'ab'[k % 2]},{name},{k}.5" for k in range(12) for name in ("peak", "width")]
    for names in ("variable,value", "Merkmal,Wert"):
        with pytest.raises(DataDamaged, match="per trial"):
            read_labelled(csv("\n".join([f"trial,what,{names}", *lines, ""])), "what")


def test_a_table_that_is_repeated_gives_the_notes_of_its_lines(csv):
    rng = np.random.default_rng(0)
    lines = [f"{'ab'[k % 2]},{rng.normal():.6f},{rng.integers(2):d},{1e3 * k:.0f}" for k in range(40)]
    single, double = (
        read_labelled(csv("\n".join(["what,peak,valid,clock", *(lines * times), ""])), "what")
        for times in (1, 2)
    )
    assert double.table.names == single.table.names == ("peak", "valid")
    assert double.notes == single.notes
    assert len(double) == 2 * len(single)


def test_objects_that_a_column_names_are_held_out_unless_a_column_is_named(csv):
    """Six cups and six cans, each grasped twice: both trials of a cup are in one fold."""
    kinds = [kind for kind in ("cup", "can") for _ in range(12)]
    things = [f"{kind}-{'abcdef'[i % 12 // 2]}" for i, kind in enumerate(kinds)]
    forces = np.random.default_rng(1).normal(5.0, 1.0, 24).round(3).tolist()
    turns = [f"s{i % 2}" for i in range(24)]

    def table(*columns):
        return csv(
            "what,thing,second,force\n"
            + "".join(f"{','.join(map(str, row))}\n" for row in zip(*columns, strict=True))
        )

    path = table(kinds, things, turns, forces)
    assert read_labelled(path, "what").instances == tuple(things)
    assert read_labelled(path, "what", instance="second").instances == tuple(turns)
    assert read_labelled(path, "what", features=["thing", "force"]).instances is None
    # Things of either kind that are open and closed are named by the user alone, and are no feature.
    states = [f"{kind} {'open' if i % 2 else 'closed'}" for i, kind in enumerate(kinds)]
    for names, used in ((things, ()), ([f"n{i % 5}" for i in range(24)], ("thing",))):
        trials = read_labelled(table(states, names, turns, forces), "what")
        assert trials.instances is None
        assert {"thing", *used} & {name.partition("=")[0] for name in trials.table.names} == {*used}
    # Two columns name the objects: which of them is meant, only the user knows.
    assert (
        read_labelled(table(kinds, things, [thing.upper() for thing in things], forces), "what").instances
        is None
    )


HEAD, *TRIALS = GOOD.strip().splitlines()
ANNOTATED = [f"{line},x" for line in TRIALS]
STATISTICS = ["mean", "Total", "Average:", "std", "median", "Summe", "Std. Dev."]
UNEVEN = [f"{'ab'[k % 2]},{k * 0.137 % 1:.3f},{k * k * 0.313 % 7:.3f}" for k in range(8)]
ZEROS = [re.sub("[^,]*$", ("0.000", "0.812")[k % 4 == 0], line) for k, line in enumerate(UNEVEN)]
MEANS = [sum(float(line.split(",")[k]) for line in UNEVEN) / 8 for k in (1, 2)]
BELOW = [",".join(f"{sum(float(line.split(',')[k]) for line in part) / 4:.4f}" for k in (1, 2))
         for part in (UNEVEN[:4], UNEVEN[4:])]  # fmt: skip
OBJECTS = [f"{k},{what},{k * 0.31 % 1:.3f}" for what in ("can", "jar") for k in range(6)]


@every_case(
    ("lines", "labels"),
    [
        *(([HEAD, *TRIALS, f"{word},0.05,6"], "abababab") for word in STATISTICS),
        ([HEAD, *TRIALS, "mean,0.05,6", "max,0.07,7"], "abababab"),
        # Statistics of labels, with their heading, above, among and below the trials.
        *(([HEAD, *TRIALS[:k], "a mean,0.05,6", "mean (b),0.05,6", *TRIALS[k:]], "abababab") for k in (0, 8)),
        ([HEAD, *TRIALS[:3], "a mean,0.05,6", *TRIALS[3:]], "abababab"),
        *(([HEAD, *TRIALS[:k], "Summary,,", "mean,0.05,6", "N,8,8", *TRIALS[k:]], "abababab") for k in (0, 8)),
        # Means and sums are known by their numbers, under any name, and so are the lines below them.
        *(([HEAD, *UNEVEN, f"{word},{times * MEANS[0]:.5f},{times * MEANS[1]:.4f}", "b,0.1,0.1"], "abababab")
          for word in ("a", "", "\u5e73\u5747") for times in (1, 8)),
        ([HEAD, *UNEVEN, "b,0.5,2.25"], "ababababb"),
        # So are those below each group of lines, with lines of one name beside them.
        ([HEAD, *UNEVEN[:4], f"Mean,{BELOW[0]}", "sd,1,1", *UNEVEN[4:], f"Mean,{BELOW[1]}", "sd,1,2"], "abababab"),
        ([HEAD, *UNEVEN[:4], "mean,0.1,0.2", *UNEVEN[4:], "mean,0.1,0.1"], [*"abab", "mean", *"abab", "mean"]),
        # Zeros that are written with three places are no rounded means, and two numbers can be means by chance.
        ([HEAD, *ZEROS, f"b,{MEANS[0]:.3f},0.000", "a,0.1,0.1"], "ababababba"),
        ([HEAD, *UNEVEN, f"b,{MEANS[0]:.3f},{MEANS[1]:.2f}", "a,0.1,0.1"], "ababababba"),
        # A trial without values, or with the remark `max`, is one.
        ([f"{HEAD},x", *ANNOTATED[:3], f"{TRIALS[3]},max", "a,,,", "c,,,", "c,,,", *ANNOTATED[4:]], "ababaccabab"),
        # Levels of filling are no quartiles.
        *(([HEAD, *(line.replace("a,", "50%,").replace("b,", f"{full},") for line in TRIALS)], ("50%", full) * 4)
          for full in ("100%", "75%")),
        # An object may have the name of a statistic.
        ([HEAD, *(line.replace("b,", "total,") for line in TRIALS)], ("a", "total") * 4),
        # Units that are repeated with the names, also of a column of texts.
        ([HEAD, ",m,N", *TRIALS[:4], HEAD, ",m,N", *TRIALS[4:]], "abababab"),
        # A mean of each object is known by the column of trial numbers.
        (["trial,what,peak", *OBJECTS[:6], "mean,can,0.5", *OBJECTS[6:], "mean,jar,0.5"], ("can",) * 6 + ("jar",) * 6),
        # Trials that are numbered by a sign that begins comments.
        (["# by hand", f"nr,{HEAD}", *(f"#{k},{line}" for k, line in enumerate(TRIALS))], "abababab"),
        # Tables that were joined with their marks of encoding.
        ([f"\ufeff{HEAD}", *TRIALS, f"\ufeff{HEAD}", *TRIALS], "abababababababab"),
    ],
)  # fmt: skip
def test_the_trials_are_read_whatever_is_between_them(csv, lines, labels):
    assert read_labelled(csv("\n".join([*lines, ""])), "what").labels == tuple(labels)


@every_case(
    ("columns", "rows", "names", "notes"),
    [
        # Counters and texts are no features unless they are asked for.
        ("trial,time,p,comment", [f"{i},{100.5 + i * i},{i % 3},x{i}" for i in range(8)], ("p",),
         ["trial, time (use columns to include them)", "hardly repeat"]),
        ("p,,q", [f"{i % 3},,{i % 4}" for i in range(8)], ("p", "q"), []),
        ("p,same,empty,void", [f"{i % 3},7,," for i in range(8)], ("p", "same"),
         ["constant, and so without information: same", "no values: empty, void (use columns to include them)"]),
        # Units that differ within a column are no numbers.
        ("force,gap", [f"{i * 7 % 5},{i % 4} {'m' if i == 3 else 'mm'}" for i in range(8)], ("force",), ["gap"]),
        *(("p,f", [f"{gap if i == 3 else i % 3},{i % 2}" for i in range(8)], ("p", "f"), ["of all values are missing"])
          for gap in ("", "nan", "NaN", "NA", "?", "null", " ")),
    ],
)  # fmt: skip
def test_what_is_no_feature_or_is_missing_is_noted(csv, columns, rows, names, notes):
    path = csv("\n".join([f"what,{columns}", *(f"{'ab'[i % 2]},{row}" for i, row in enumerate(rows)), ""]))
    trials = read_labelled(path, "what")
    assert trials.table.names == names
    assert all(any(words in note for note in trials.notes) for words in notes)
    asked = columns.split(",")[:3:2]
    assert read_labelled(path, "what", features=asked).table.names == tuple(asked)


@every_case(
    ("asked", "names"),
    [
        (["pad_*"], ("pad_l", "pad_r")),
        (["-pad_*"], ("gap", "-x")),
        (["pad_*", "gap", "-pad_l"], ("pad_r", "gap")),
        (["-x"], ("-x",)),
        (["--x", "-gap"], ("pad_l", "pad_r")),
        (["*"], ("pad_l", "pad_r", "gap", "-x")),
    ],
)
def test_features_are_chosen_by_patterns_and_left_out(csv, asked, names):
    rows = [f"{'ab'[i % 2]},{i * 7 % 5},{i * 3 % 4},{i % 3},{i * i % 7}" for i in range(12)]
    path = csv("\n".join(["what,pad_l,pad_r,gap,-x", *rows, ""]))
    assert read_labelled(path, "what", features=asked).table.names == names
    for wrong in (["-nix"], ["gap", "-gap"], ["-*"], ["what"]):
        with pytest.raises(ConfigError):
            read_labelled(path, "what", features=wrong)


def test_a_column_that_tells_another_order_than_the_lines_is_proposed(csv):
    order = np.random.default_rng(0).permutation(30).tolist()
    rows = {
        "elapsed": [f"{60.0 * i:.1f}" for i in order],
        "made": [f"2026-11-26 10:{i:02d}:00" for i in order],
        "sorted": [f"2026-11-26 10:{i:02d}:00" for i in range(30)],
        "force": [f"{force:.3f}" for force in np.random.default_rng(1).normal(size=30)],
    }
    lines = [
        f"{'ab'[i % 2]},{','.join(row)}"
        for i, row in zip(order, zip(*rows.values(), strict=True), strict=True)
    ]
    path = csv("\n".join([f"what,{','.join(rows)}", *lines, ""]))
    told = next(note for note in read_labelled(path, "what").notes if "order of recording" in note)
    assert "elapsed" in told
    assert "made" in told
    assert "sorted" not in told
    assert "force" not in told
    assert not [
        note for note in read_labelled(path, "what", order="made").notes if "order of recording" in note
    ]


def test_a_heading_in_decomposed_letters_is_that_in_composed_ones(csv):
    assert read_labelled(csv(GOOD.replace("what", "Beha\u0308lter")), "Beh\u00e4lter").classes == ("a", "b")


@pytest.mark.slow
@every_case(
    "other",
    [
        "Tin_can 1",
        "tin-can 01",
        "tin  can 1",
        "tin can \uff11",
        "tin c\u0430n 1",
        "\u03a4in can 1",
        "t\u0131n can 1",
        "t\u00efn can 1",
        "\u201ctin can 1\u201d",
        "T\u0130N CAN 1",
    ],
)
def test_labels_that_differ_in_spelling_only_are_noted(csv, other):
    """A letter of another alphabet is shown by its code, and a selector of a form is left out."""

    def spelling(changed, label):
        text = GOOD.replace("\na,", f"\n{label},").replace(f"\n{label},", f"\n{changed},", 1)
        return [note for note in load_trials(str(csv(text)), label="what").notes if "spelling" in note]

    assert len(spelling(other, "tin can 1")) == 1
    assert spelling("c\u0430n", "can")[0].endswith("'can' and 'c\\u0430n'")
    assert spelling("C", "can")
    assert not spelling("can\ufe0f", "can")
    assert not spelling("tin can 1", "tin can 1")
