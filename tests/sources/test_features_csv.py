from __future__ import annotations

import math

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


def test_names_units_labels_and_the_width(csv):
    trials = read_labelled(csv(GOOD), "what")

    assert trials.table.names == ("p_first", "f_steady")
    assert trials.table.units == ("m", "")
    assert trials.labels == ("a", "b") * 4
    assert trials.width is not None
    assert trials.instances is None
    assert trials.no_instances == "no column names the instance (instance=COLUMN)"


@every_case("separator", [",", ";", "\t"])
@every_case("prefix", ["", "\ufeff"])
@every_case("ending", ["\n", "\r\n"])
def test_separators_byte_order_marks_and_line_ends(csv, separator, prefix, ending):
    text = prefix + GOOD.replace(",", separator).replace("\n", ending)
    read, expected = (read_labelled(csv(given), "what").table.values.tolist() for given in (text, GOOD))
    assert read == expected


@every_case("gap", ["", "nan", "NaN", "NA", "?", "null", " "])
def test_what_counts_as_missing(csv, gap):
    trials = read_labelled(csv(GOOD.replace("a,0.05,6", f"a,{gap},6", 1)), "what")

    assert math.isnan(trials.table.values[0, 0])
    assert any(note.endswith("of all values are missing") for note in trials.notes)


@every_case(
    ("content", "error", "said"),
    [
        ("", DataDamaged, "is empty: it needs a header line"),
        ("\n\n  \n", DataDamaged, "is empty"),
        ("what,p_first\n", DataDamaged, "has a header but no trials"),
        (GOOD.replace("what", "class"), ConfigError, "'what' (the label). Its columns: class, p_first"),
        (GOOD.replace("a,0.05,6", "a,0.05", 1), DataDamaged, "line 2: 2 values, but there are 3 columns"),
        (GOOD.replace("a,0.05,6", "a,wide,6", 1), DataDamaged, "line 2: p_first is 'wide'"),
        (GOOD.replace("a,0.05,6", 'a,"0,05",6', 1), DataDamaged, "(write a decimal point)"),
        (GOOD.replace("a,0.05,6", "a,5_0,6", 1), DataDamaged, "line 2: p_first is '5_0'"),
        (GOOD.replace("a,0.05,6", "a,inf,6", 1), DataDamaged, "line 2: p_first is infinite"),
        (GOOD.replace("a,0.05,6", ",0.05,6", 1), DataDamaged, "line 2: what (the label) is empty"),
        (GOOD.replace("a,0.05,6", 'a,"0.05,6', 1), DataDamaged, "line "),
        (GOOD.replace("f_steady", "p_first"), DataDamaged, "two columns are named 'p_first'"),
        (GOOD.replace("f_steady", ""), DataDamaged, "column 3 has no name"),
        (GOOD.replace("a,", "unknown,"), ConfigError, "'unknown' cannot be a label"),
        (GOOD.encode("utf-16")[:-1], DataDamaged, "begins as UTF-16, and is none"),
        (GOOD.replace("b,", "бутылка,").encode("cp1251"), DataDamaged, "line 3: byte 0xe1 is not UTF-8"),
        (b"what,p\n\x00\x00,1\n", DataDamaged, "contains zero bytes: it is not a text file"),
        (b"PK\x03\x04\x00\x00what,p", DataDamaged, "is a spreadsheet or an archive, not text"),
        ("what,p\na,\nb,\n" * 1, DataDamaged, "no feature has any value: p"),
        ("what,name\na,x\na,y\nb,z\n", ConfigError, "has no column to learn from besides what"),
        ("what,p\n" + "".join(f"{i * 1.1},{i % 2}\n" for i in range(9)), ConfigError, "cannot be the label"),
    ],
)
def test_what_cannot_be_read_says_where_and_why(csv, content, error, said):
    with pytest.raises(error) as raised:
        read_labelled(csv(content), "what")
    assert said in str(raised.value)
    with pytest.raises(ConfigError, match="cannot be read"):
        read_labelled(csv("").with_name("nothing.csv"), "what")


@every_case("encoding", ["utf-16", "utf-16-be", "latin-1", "cp1252"])
def test_a_table_in_another_encoding_is_the_same_table(csv, encoding):
    text = GOOD.replace("b,", "öffner,").replace("f_steady", "f_steady [µm]")
    mark = b"\xfe\xff" if encoding == "utf-16-be" else b""
    read = read_labelled(csv(mark + text.encode(encoding)), "what")
    expected = read_labelled(csv(text.encode()), "what")
    assert (read.labels, read.table.units) == (expected.labels, expected.table.units)
    assert read.table.values.tolist() == expected.table.values.tolist()


def test_a_unit_in_every_cell_is_that_of_the_column_and_labels_keep_theirs(csv):
    rows = [
        (f"{500 * (1 + i % 2)} g", f"{6 + i % 2},{i} N", f"{i % 3}.5 mm" if i else "nan") for i in range(8)
    ]
    read = read_labelled(csv("size;force;gap\n" + "".join(f"{';'.join(row)}\n" for row in rows)), "size")
    assert set(read.labels) == {"500 g", "1000 g"}
    assert (read.table.names, read.table.units) == (("force", "gap"), ("N", "mm"))
    assert read.table.values[:2, 0].tolist() == [6.0, 7.1]


def test_units_that_differ_within_a_column_are_no_numbers(csv):
    rows = "".join(f"{'ab'[i % 2]},{i * 7 % 5},{i % 4} {'m' if i == 3 else 'mm'}\n" for i in range(8))
    read = read_labelled(csv("what,force,gap\n" + rows), "what")
    assert read.table.names == ("force",)
    assert any("gap" in note for note in read.notes)


def test_counters_and_texts_are_no_features_unless_asked_for(csv):
    lines = [f"{'ab'[i % 2]},{i},{100.5 + i * i},{i % 3},x{i}" for i in range(8)]
    path = csv("what,trial,time,p,comment\n" + "\n".join(lines) + "\n")

    trials = read_labelled(path, "what")
    assert trials.table.names == ("p",)
    assert any("trial, time (use columns to include them)" in note for note in trials.notes)
    assert any("hardly repeat" in note and "comment" in note for note in trials.notes)
    assert read_labelled(path, "what", features=["trial", "p"]).table.names == ("trial", "p")


def test_constant_and_empty_columns_are_noted(csv):
    lines = [f"{'ab'[i % 2]},{i % 3},7,," for i in range(8)]
    trials = read_labelled(
        csv("what,p,same,empty,\n".replace(",\n", ",void\n") + "\n".join(lines) + "\n"), "what"
    )

    assert "constant, and so without information: same" in trials.notes
    assert "not used, because they have no values: empty, void (use columns to include them)" in trials.notes
    assert trials.table.names == ("p", "same")


@every_case(
    "other",
    [
        *("Tin_can 1", "tin-can 01", "tin  can 1", "tin can \uff11"),
        *("tin c\u0430n 1", "\u03a4in can 1", "t\u0131n can 1"),
    ],
)
def test_labels_that_differ_in_spelling_only_are_noted(csv, other):
    text = GOOD.replace("\na,", "\ntin can 1,")
    trials = load_trials(str(csv(text.replace("tin can 1", other, 1))), label="what")

    assert any("differ in spelling only" in note for note in trials.notes)
    assert not any("spelling" in note for note in load_trials(str(csv(text)), label="what").notes)


def test_a_letter_of_another_alphabet_is_shown_by_its_code_and_a_selector_is_left_out(csv):
    text = GOOD.replace("\na,", "\ncan,")
    (note,) = (
        note
        for note in load_trials(str(csv(text.replace("\ncan,", "\nc\u0430n,", 1))), label="what").notes
        if "spelling" in note
    )
    assert note.endswith("'can' and 'c\\u0430n'")
    selected = load_trials(str(csv(text.replace("\ncan,", "\ncan\ufe0f,", 1))), label="what")
    assert set(selected.labels) == set(load_trials(str(csv(text)), label="what").labels)


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

    assert trials.names == ("f_steady", "p_first")
    assert trials.values[0].tolist() == [6.0, 0.05]


@every_case("word", ["mean", "Total", "Average:", "std", "median", "Summe", "Std. Dev."])
def test_statistics_below_the_trials_are_left_out_and_told(csv, word):
    for content in (GOOD + f"{word},0.05,6\n", GOOD + f"{word},0.05,6\nmax,0.07,7\n"):
        trials = read_labelled(csv(content), "what")
        assert trials.labels == ("a", "b") * 4
        assert any(word in note for note in trials.notes)


@every_case("lines", [["a mean,0.05,6", "mean (b),0.05,6"], ["Summary,,", "mean,0.05,6", "N,8,8"]])
@every_case("begin", [1, 4, 9])
def test_statistics_of_labels_and_their_heading_are_left_out(csv, begin, lines):
    given = GOOD.strip().splitlines()
    lines = lines if begin != 4 else lines[:1]
    trials = read_labelled(csv("\n".join([*given[:begin], *lines, *given[begin:], ""])), "what")
    assert trials.labels == ("a", "b") * 4


def test_a_trial_without_values_or_with_the_remark_max_is_one(csv):
    given = [f"{line},{'max' if k == 4 else 'x'}" for k, line in enumerate(GOOD.strip().splitlines())]
    trials = read_labelled(csv("\n".join([*given[:5], "a,,,", "c,,,", "c,,,", *given[5:], ""])), "what")
    assert trials.labels == ("a", "b", "a", "b", "a", "c", "c", "a", "b", "a", "b")


def test_trials_may_be_numbered_by_a_sign_that_begins_comments(csv):
    lines = [f"#{k},{line}" if k else f"nr,{line}" for k, line in enumerate(GOOD.strip().splitlines())]
    assert len(read_labelled(csv("\n".join(["# by hand", *lines, ""])), "what")) == 8


def test_tables_that_were_joined_with_their_marks_of_encoding_are_one(csv):
    assert len(read_labelled(csv(f"\ufeff{GOOD}\ufeff{GOOD}"), "what")) == 16


def test_a_table_with_a_line_for_each_feature_is_refused(csv):
    lines = [f"{k},{'ab'[k % 2]},{name},{k}.5" for k in range(12) for name in ("peak", "width")]
    with pytest.raises(DataDamaged, match="one line per trial"):
        read_labelled(csv("\n".join(["trial,what,variable,value", *lines, ""])), "what")


def test_a_mean_of_each_object_is_known_by_the_column_of_trial_numbers(csv):
    lines = [f"{k},{what},{k * 0.31 % 1:.3f}" for what in ("can", "jar") for k in range(6)]
    table = "\n".join(["trial,what,peak", *lines[:6], "mean,can,0.5", *lines[6:], "mean,jar,0.5", ""])
    assert read_labelled(csv(table), "what").labels == ("can",) * 6 + ("jar",) * 6


def test_an_object_may_have_the_name_of_a_statistic(csv):
    assert set(read_labelled(csv(GOOD.replace("b,", "total,")), "what").labels) == {"a", "total"}


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
    # Two columns name the objects: which of them is meant, only the user knows.
    assert (
        read_labelled(table(kinds, things, [thing.upper() for thing in things], forces), "what").instances
        is None
    )
