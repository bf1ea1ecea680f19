"""Text files as instruments and programs write them: in recordings and in tables of trials."""

import gzip
import json
import re
from datetime import UTC, datetime

import numpy as np
import pytest
from cases import every_case

from graspsense.core.values.errors import DataDamaged
from graspsense.sources.columns.column_guess import guesses
from graspsense.sources.formats.text_format import read_text
from graspsense.sources.manifest.reader import read_recordings
from graspsense.sources.recordings.grasp_csv import named, read_squeeze
from graspsense.sources.trial_source import load_trials
from graspsense.sources.trial_table.features_csv import read_labelled
from graspsense.store.labels import labels_of

N = 200
T_S = np.arange(N) * 0.01
GAP_MM = np.where(T_S < 1.0, 80.0 - 30.0 * T_S, 50.0 - 1.5 * (1.0 - np.exp(-(T_S - 1.0) / 0.1)))
FORCE_N = np.maximum(0.0, 50.0 - GAP_MM) * 6.0
ROWS = [
    f"{t:.3f},{gap:.4f},{force:.4f},{1.02 * force:.4f}"
    for t, gap, force in zip(T_S, GAP_MM, FORCE_N, strict=True)
]
TRIPLES = [row.rpartition(",")[0] for row in ROWS]
HEADER = "t,pos,f1,f2"


def spoiled(row, text):
    return [HEADER, *ROWS[:row], text, *ROWS[row + 1 :]]


def stamped(write, rows=ROWS):
    return [HEADER, *(f"{write(k)},{row.partition(',')[2]}" for k, row in enumerate(rows))]


def iso(k):
    """Return a time in CET, and from 03:00 on in CEST: the clock jumps, the instant does not."""
    seconds = 59.0 + k * 0.01
    if seconds < 60.0:
        return f"2026-03-29T01:59:{seconds:09.6f}+01:00"
    return f"2026-03-29T03:00:{seconds - 60.0:09.6f}+02:00"


def late(k):
    """Return a time of the day: midnight is behind half a second."""
    return datetime.fromtimestamp(86399.5 + k * 0.01, UTC).strftime("%H:%M:%S.%f")


def noon(k, hours=0):
    """Return a time around noon, or so many hours later: midnight between the second and the third of March."""
    return datetime.fromtimestamp(1772452799.5 + 3600 * hours + k * 0.01, UTC)


def read(path, **columns):
    given = {"time": ["t"], "gap": ["pos [mm]"], "force": ["f1", "f2"], **columns}
    return read_squeeze(named(str(path), given))


def times(recording):
    return [reading.frame.t_s for reading in recording.readings]


DECIMAL_COMMAS = [row.replace(",", ";").replace(".", ",") for row in ROWS]
VARIANTS = {
    "preamble": ["Instrument: X", "Date: 2026-01-01", "", HEADER, *ROWS],
    "preamble of many cells": ["Units: N,,,", "Readings: Continuous,,,", "Travel Unit: mm,,,", HEADER, *ROWS],
    "preamble of two cells": ["Serial,17", "Operator,Ann", HEADER, *ROWS],
    "units": [HEADER, "s,mm,N,N", *ROWS],
    "units in brackets above": ["[s],[mm],(N),(N)", HEADER, *ROWS],
    "units and remarks": [HEADER, "s,mm,N,N", ",encoder,left pad,right pad", *ROWS],
    "separator of Excel": ["sep=;", HEADER.replace(",", ";"), *DECIMAL_COMMAS],
    "repeated header in capitals": [HEADER, *ROWS[:90], HEADER.upper(), *ROWS[90:]],
    "comments of other programs": ["// made by a logger", f"! {HEADER}", *ROWS],
    "repeated header and units": [HEADER, "s,mm,N,N", *ROWS[:90], HEADER, "s,mm,N,N", *ROWS[90:]],
    "times of the day over midnight": stamped(late),
    "numpy behind a title": ["Logger 4", "# t pos f1 f2", *(row.replace(",", " ") for row in ROWS)],
    "pandas with a blank end": ["," + HEADER, *(f"{k},{row}," for k, row in enumerate(ROWS))],
    "pandas": ["," + HEADER, *(f"{k},{row}" for k, row in enumerate(ROWS))],
    "quoted": ['"t","pos","f1","f2"', *(",".join(f'"{cell}"' for cell in row.split(",")) for row in ROWS)],
    "decimal commas": [HEADER.replace(",", ";"), *DECIMAL_COMMAS],
    "a semicolon in a text": ["t,pos,f1,f2,note", *(row + ",a;b" for row in ROWS)],
    "pipes": [line.replace(",", "|") for line in [HEADER, *ROWS]],
    "names of numpy.savetxt with another sign": ["# t,pos,f1,f2", *(row.replace(",", " ") for row in ROWS)],
    "names with another sign": [HEADER.replace(",", ";"), *ROWS],
    "two spaces": [line.replace(",", "  ") for line in [HEADER, *ROWS]],
    "numpy with names and units": ["# t pos f1 f2", "# s mm N N", *(row.replace(",", " ") for row in ROWS)],
    "MATLAB": ["% MATLAB", *(line.replace(";", " ") for line in ["t;pos;f1;f2", *DECIMAL_COMMAS])],
    "a remark": ["# written by a logger", HEADER.replace(",", ";"), *DECIMAL_COMMAS],
    "a byte order mark and the ends of Windows": ["\ufeff" + HEADER + "\r", *(row + "\r" for row in ROWS)],
    "Fortran": [HEADER, *(row.replace("0.0000", "0.0000D+00") for row in ROWS)],
    "zones": stamped(iso),
    "MATLAB's dates": stamped(lambda k: noon(k).strftime("%d-%b-%Y %H:%M:%S.%f")),
    "LabVIEW": ["***End_of_Header***", f"{HEADER},Comment", f"{ROWS[0]},start", *ROWS[1:]],
    "a device that tells something": [HEADER, *ROWS[:90], "ERROR: no answer", *ROWS[90:], "End of file"],
    "a remark with a comma": [HEADER, *ROWS[:90], "// pad moved, twice", *ROWS[90:]],
    "Markdown": [f"| {line.replace(',', ' | ')} |" for line in [HEADER, *ROWS]],
    "a rule below the names": ["t | pos | f1 | f2", "--+-----+----+---", *(row.replace(",", " | ") for row in ROWS)],
    "MATLAB's display": ["  t  pos  f1  f2", "  ___  ___  ___  ___", *(row.replace(",", "   ") for row in ROWS)],
    "an American date": stamped(lambda k: noon(k, 12).strftime("%m/%d/%Y %I:%M:%S.%f %p")),
    "a British date": stamped(lambda k: noon(k, 12).strftime("%d/%m/%Y %H:%M:%S.%f")),
    "a German date": stamped(lambda k: noon(k).strftime("%d.%m.%Y %H:%M:%S.%f")),
    "a year of two digits": stamped(lambda k: noon(k, 12).strftime("%m/%d/%y %I:%M:%S.%f %p")),
    "separators behind some rows": [HEADER, *(row + "," * (k % 4) for k, row in enumerate(ROWS))],
    "marks of writing": [f"\u200b{HEADER}", *(f"\u200e{row}" for row in ROWS)],
    "names in several lines": ['"t","pos\n","f1",f2', *ROWS],
    "minutes over the hour": stamped(lambda k: noon(k).strftime("%M:%S.%f")),
    "pandas' timedelta": stamped(lambda k: f"0 days 00:00:{0.01 * k:09.6f}"),
    "a Chinese date": stamped(lambda k: noon(k).strftime("%Y/3/3 %H:%M:%S.%f")),
    "a colon before the milliseconds": stamped(lambda k: noon(k).strftime("%H:%M:%S:%f")[:-3]),
    "words in as many cells behind": [HEADER, *ROWS, "", "Operator: Ann,lab 3,desk 2,room 4"],
    "statistics behind": [HEADER, *ROWS, "Mean,55.1,3.4,3.5", "Max,80.0,9.0,9.2"],
    "a second table behind": [HEADER, *ROWS, "", "name,value,unit", "peak,9.0,N"],
    "events in few rows": [f"{HEADER},event", *ROWS[:30], f"{ROWS[30]},start", *ROWS[31:]],
    "names in a comment before another one": [f"# {HEADER}", "# recorded in room 4", *ROWS],
    "two cells before, units behind": ["Key Word,Value", 'Units,"N","mm"', HEADER, "sec,mm,N,N", *ROWS],
    "Orange": [HEADER, "continuous,continuous,c,c", ",,class,", *ROWS],
    "texts of a spreadsheet": [
        re.sub("[^,]+", ('="\\g<0>"', '"=""\\g<0>"""')[k % 2], line) for k, line in enumerate([HEADER, *ROWS])
    ],
    "lists of one number": [HEADER, *(re.sub(r"(?<=,)([^,]+)", r"[\1]", row) for row in ROWS)],
    "milliseconds": stamped(lambda k: 1774749599000 + 10 * k),
    "nanoseconds": stamped(lambda k: 1774749599000000000 + 10_000_000 * k),
}  # fmt: skip


@pytest.mark.slow
@every_case("lines", VARIANTS.values())
def test_a_recording_is_read_as_instruments_write_it(lines, tmp_path):
    path = tmp_path / "jar.csv"
    path.write_text("\n".join(lines) + "\n")
    recording = read(path)
    assert times(recording) == pytest.approx(T_S, abs=1e-6)
    frames = [reading.frame for reading in recording.readings]
    assert [frame.gap_m for frame in frames] == pytest.approx(GAP_MM * 1e-3, abs=1e-7)
    assert [frame.force_left_n for frame in frames] == pytest.approx(FORCE_N, abs=1e-3)


def test_names_of_several_words_stand_apart_by_two_spaces(tmp_path):
    path = tmp_path / "jar.txt"
    path.write_text(
        "\n".join(["Time (s)   Jaw travel (mm)   Load (N)", *(row.replace(",", "  ") for row in TRIPLES), ""])
    )
    (table,) = read_text(path)
    assert list(table.numbers) == ["Time (s)", "Jaw travel (mm)", "Load (N)"]
    assert table.numbers["Jaw travel (mm)"] == pytest.approx(GAP_MM, abs=1e-4)


def test_a_row_whose_time_is_missing_is_left_out_and_midnight_is_still_seen(tmp_path):
    path = tmp_path / "jar.csv"
    lines = stamped(late)
    lines[51] = lines[51].partition(",")[1] + lines[51].partition(",")[2]
    path.write_text("\n".join(lines) + "\n")
    assert times(read(path)) == pytest.approx(np.delete(T_S, 50), abs=1e-6)


def test_a_line_that_numbers_the_columns_is_no_row(tmp_path):
    path = tmp_path / "jar.csv"
    numbered = [f"{k},{row}" for k, row in enumerate(ROWS)]
    for lines, named_time in ((["0,1,2,3", *ROWS], "c1"), ([",0,1,2,3", *numbered], "c2")):
        path.write_text("\n".join(lines) + "\n")
        (table,) = read_text(path)
        assert len(table) == N
        assert [name for name, column in table.numbers.items() if np.allclose(column, T_S)] == [named_time]
    path.write_text("0,1\n0.5,2\n")
    assert len(read_text(path)[0]) == 2


@every_case("quote", ['"', ""])
def test_the_numbers_of_rows_that_r_writes_without_a_name_are_the_index(tmp_path, quote):
    path = tmp_path / "t.txt"
    lines = [f"{quote}{k + 1}{quote} {quote}{'ab'[k % 2]}{quote} {k * k % 7 + 0.5}" for k in range(20)]
    path.write_text("\n".join([f"{quote}what{quote} {quote}peak{quote}", *lines, ""]))
    trials = read_labelled(path, "what")
    assert (trials.labels, trials.table.names) == (("a", "b") * 10, ("peak",))
    names = [f"{quote}can {k}{line[line.index(' ') - len(quote) :]}" for k, line in enumerate(lines)]
    for sorted_by_r in (
        lines[1::2] + lines[::2],
        names if quote else [name.replace("can ", "can") for name in names],
    ):
        path.write_text("\n".join([f"{quote}what{quote} {quote}peak{quote}", *sorted_by_r, ""]))
        assert read_labelled(path, "what").table.names == ("peak",)
    path.write_text("\n".join(["what peak", *(line.replace('"', "") for line in lines[::-1]), ""]))
    with pytest.raises(DataDamaged):  # these can be measured, and the name of another column missing
        read_labelled(path, "what")


@every_case(
    ("content", "numbers"),
    [
        (b"Load left [N]\n0.5\n1.5\n2.5\n", {"Load left [N]": [0.5, 1.5, 2.5]}),  # spaces in a single name
        (
            b"x;y\n1\x92250.5;1\n975.0;2\n",
            {"x": [1250.5, 975.0], "y": [1.0, 2.0]},
        ),  # the apostrophes of Windows
        # UTF-16 without a mark, and what a logger did not fill.
        *(
            ("ж;y\n0.5;0\n1.5;1\n".encode(code), {"ж": [0.5, 1.5], "y": [0.0, 1.0]})
            for code in ("utf-16-le", "utf-16-be")
        ),
        *(
            (b"y,z\n0.5,0\n1.5,1\n" + 512 * end, {"y": [0.5, 1.5], "z": [0.0, 1.0]})
            for end in (b"\0", b"\xff")
        ),
        (b"y,\tz\n0.5,\t0\n1.5,\t1\n", {"y": [0.5, 1.5], "z": [0.0, 1.0]}),  # a tab behind each comma
        (
            b'{"y": 0.5, "z": 0}\n{"y": 1.5, "z": 1}\n',
            {"y": [0.5, 1.5], "z": [0.0, 1.0]},
        ),  # JSON by its content
        ("y,A [mm\u00b2]\n0.5,0\n1.5,1\n".encode("cp1252"), {"y": [0.5, 1.5], "A [mm^2]": [0.0, 1.0]}),
        # A sign or a factor behind a number is no unit.
        *((f"x,y\n0.5{sign},0\n1.5{sign},1\n".encode(), {"y": [0.0, 1.0]}) for sign in ("-", "k", "M")),
    ],
)
def test_the_columns_of_numbers_are_known(content, numbers, tmp_path):
    path = tmp_path / "t.csv"
    path.write_bytes(content)
    (table,) = read_text(path)
    assert {name: column.tolist() for name, column in table.numbers.items()} == numbers
    assert "x" not in table.units


@every_case("word", ["OL", "####", "Overload"])
def test_what_meters_and_spreadsheets_write_for_a_number_that_is_too_large_is_missing(word, tmp_path):
    path = tmp_path / "t.csv"
    path.write_text(f"y,z\n0.5,0\n{word},1\n")
    (table,) = read_text(path)
    assert table.numbers["y"].tolist() == pytest.approx([0.5, np.nan], nan_ok=True)


@every_case(
    ("text", "encoding"),
    [
        ("банка", "cp1251"),
        ("βάζο", "cp1253"),
        ("słoik", "cp1250"),
        ("缶詰", "shift_jis"),
        ("Gläser", "cp850"),
    ],
)
def test_the_encodings_in_which_a_file_can_be_are_shown_by_a_text_of_it(text, encoding, tmp_path):
    path = tmp_path / "t.csv"
    path.write_bytes(f"what,y\ncan,0.5\n{text},1.5\n".encode(encoding))
    with pytest.raises(DataDamaged, match="line 3") as refused:
        read_text(path)
    assert f"{text} ({encoding})" in str(refused.value)


def test_zero_bytes_between_the_lines_are_told_with_the_line(tmp_path):
    path = tmp_path / "t.csv"
    path.write_bytes(b"x,y\n0.5,0\n" + bytes(512) + b"1.5,1\n")
    with pytest.raises(DataDamaged, match="line 3"):
        read_text(path)


def test_compressed_text_and_json_lines_are_read(tmp_path):
    compressed = tmp_path / "jar.csv.gz"
    compressed.write_bytes(gzip.compress("\n".join([HEADER, *ROWS]).encode()))
    assert times(read(compressed)) == pytest.approx(T_S)
    objects = [dict(zip(("t", "pos"), row.split(",")[:2], strict=True)) for row in ROWS]
    lines = [
        json.dumps({**thing, "pads": {"left": f, "both": [f, 2 * f]}})
        for thing, f in zip(objects, FORCE_N, strict=True)
    ]
    path = tmp_path / "jar.jsonl"
    path.write_text("\n".join(lines) + '\n{"t": 2.0, "po')
    recording = read(path, force=["pads.left".join("''"), "'pads.both.1'"])
    assert times(recording) == pytest.approx(T_S)
    assert recording.readings[-1].frame.force_right_n == pytest.approx(2 * FORCE_N[-1])
    assert [note for note in recording.notes if "line 201" in note]
    path.write_text("\n".join([*lines[:5], "[1]", *lines[5:]]))
    with pytest.raises(DataDamaged, match="line 6"):
        read(path)


def test_a_compressed_text_has_the_limits_of_a_text(tmp_path, monkeypatch):
    path = tmp_path / "jar.csv.gz"
    path.write_bytes(gzip.compress(b"1,2,3,4\n" * 500_000))
    monkeypatch.setenv("GRASPSENSE_MAX_UNPACKED_MB", "1")
    with pytest.raises(DataDamaged, match="unpacks to"):
        read(path)
    path.write_bytes(path.read_bytes()[:50])
    monkeypatch.delenv("GRASPSENSE_MAX_UNPACKED_MB")
    with pytest.raises(DataDamaged, match="gzip"):
        read(path)


@every_case(
    ("lines", "end", "left", "note"),
    [
        (spoiled(150, "1.500,48.5,NaN,NaN"), "\n", 199, r"1 sample without a number \(line 152\)"),
        (spoiled(150, "1.500,48.5,--,#DIV/0!"), "\n", 199, "line 152"),
        ([HEADER, *ROWS[:-1], ROWS[-1][:9]], "", 199, "line 201 is cut off"),
        ([HEADER, *ROWS[:-1], ROWS[-1][:-2]], "", 199, "line 201 is cut off"),
        ([HEADER, *ROWS], "", 200, ""),
        ([HEADER, *ROWS[:50], "# paused", *ROWS[50:]], "\n", 200, r"1 comment \(line 52\)"),
    ],
)
def test_what_is_left_out_is_told_and_the_recording_is_kept(lines, end, left, note, tmp_path):
    path = tmp_path / "jar.csv"
    path.write_text("\n".join(lines) + end)
    recording = read(path)
    assert len(recording.readings) == left
    assert any(re.search(note, told) for told in recording.notes) or not note


def recordings(folder, lines, text=""):
    (folder / "jar.csv").write_text("\n".join(lines) + "\n")
    keys = 'files = "{label}.csv"\ntime = "t"\ngap = "pos [mm]"\nleft = "f1"\nright = "f2"\n'
    (folder / "m.toml").write_text(text or keys)
    return list(read_recordings(str(folder / "m.toml")))


@pytest.mark.parametrize("bad", [[HEADER], [HEADER, *ROWS[:9], '0.09,"1,000.5","1.000,5",1', *ROWS[10:]]])
def test_a_part_of_a_file_that_cannot_be_read_leaves_the_others(bad, tmp_path):
    keys = 'files = "{day}.csv"\nstart = "^grasp (?P<label>\\\\w+)"\ntime = "t"\ngap = "pos [mm]"\nforce = "f1"\n'
    lines = ["grasp can", HEADER, *ROWS, "grasp cup", *bad, "grasp jar", HEADER, *ROWS]
    grasps = recordings(tmp_path, lines, keys)
    assert [getattr(recording, "label", "none") for recording in grasps] == ["can", "none", "jar"]
    assert "line" in str(grasps[1].error)


def test_a_large_loss_is_a_warning(tmp_path):
    half = [row if k % 4 else row.rpartition(",")[0] + ",nan" for k, row in enumerate(ROWS)]
    (recording,) = recordings(tmp_path, [HEADER, *half])
    assert [notice for notice in recording.notices if "50 samples" in notice]
    (few,) = recordings(tmp_path, spoiled(150, "1.500,48.5,NaN,NaN"))
    assert few.notices == ()
    (most,) = recordings(
        tmp_path, [HEADER, *(row.rpartition(",")[0] + ",nan" for row in ROWS[:150]), *ROWS[150:]]
    )
    assert "line 2" in str(most.error)


def test_a_sensor_at_a_third_of_the_rate_of_the_rows_gives_its_samples(tmp_path):
    slow = [row if k % 3 == 0 else row.rpartition(",")[0] + "," for k, row in enumerate(ROWS)]
    (recording,) = recordings(tmp_path, [HEADER, *slow])
    assert times(recording.recording) == pytest.approx(T_S[::3])
    assert [notice for notice in recording.notices if "133 samples" in notice]


def test_advice_on_repeated_times_is_tried_first(tmp_path):
    coarse = stamped(lambda k: int(k * 0.05))
    (refused,) = recordings(tmp_path, coarse)
    assert "rate_hz = 20" in str(refused.error)
    assert "drop" not in str(refused.error)
    keys = 'files = "{label}.csv"\nrate_hz = 20\ngap = "pos [mm]"\nforce = "f1"\n'
    (advised,) = recordings(tmp_path, coarse, keys)
    assert times(advised.recording)[-1] == pytest.approx(199 / 20)
    (dropped,) = recordings(tmp_path, coarse, keys.replace("rate_hz = 20", 'time = "t"\nduplicates = "drop"'))
    assert [notice for notice in dropped.notices if "190 samples" in notice]
    (repeated,) = recordings(tmp_path, [HEADER, *ROWS[:50], ROWS[49], *ROWS[50:]])
    assert 'duplicates = "drop"' in str(repeated.error)
    twice = [HEADER, *(row for row in ROWS for _ in range(2))]
    (repeated,) = recordings(tmp_path, twice)
    assert "leaves out 200 of 400" in str(repeated.error)


BEGINS_ANEW = {
    "a counter of a byte": (lambda k: (k + 100) % 256, "rate_hz"),
    "milliseconds of the second": (lambda k: (10 * k + 300) % 1000, "rate_hz"),
    "a clock of 32 bits": (lambda k: (4_294_000_000 + 10_000 * k) % 2**32, "rate_hz"),
    "the last row first": (lambda k: 200 - k, "reverse order"),
}


@every_case("clock", BEGINS_ANEW)
def test_a_clock_that_begins_anew_is_told_from_several_grasps(clock, tmp_path):
    write, says = BEGINS_ANEW[clock]
    (refused,) = recordings(tmp_path, stamped(write))
    assert says in str(refused.error)
    (several,) = recordings(tmp_path, [HEADER, *ROWS, *ROWS])
    assert "rate_hz" not in str(several.error)
    assert 'split = "time"' in str(several.error)
    keys = 'files = "{label}.csv"\ntime = "t"\ngap = "pos [mm]"\nforce = "f1"\nsplit = "time"\n'
    grasps = recordings(tmp_path, [HEADER, *ROWS, *ROWS], keys)
    assert [len(grasp.recording.readings) for grasp in grasps] == [N, N]


MS = [f"{1000 * float(t):.0f},{other}" for t, _, other in (row.partition(",") for row in ROWS)]


@every_case(
    ("lines", "keys", "gap_m", "unit"),
    [
        ([HEADER, "msec,MM,newtons,N", *MS], 'gap = "pos"', 0.0485, ""),
        ([HEADER, "ms,mm,mA,mA", *MS], 'gap = "pos"', 0.0485, "mA"),
        ([HEADER, "ms,mm,kp,daN", *MS], 'gap = "97 - pos"', 0.0485, ""),
        ([HEADER, "ms,deg,N,N", *MS], 'gap = "pos"', 48.5, ""),
        ([HEADER, *MS], 'time = "t [msec]"\ngap = "pos [Millimeters]"', 0.0485, ""),
    ],
)
def test_a_unit_in_other_words_is_used_and_another_one_is_kept(lines, keys, gap_m, unit, tmp_path):
    time = "" if "time" in keys else 'time = "t"\n'
    (recording,) = recordings(tmp_path, lines, f'files = "{{label}}.csv"\nforce = "f1"\n{time}{keys}\n')
    last = recording.recording.readings[-1].frame
    assert (last.t_s, last.gap_m) == pytest.approx((1.99, gap_m), abs=1e-3)
    assert recording.recording.units.get("force_left", "") == unit


@every_case(
    ("header", "units", "keys", "says"),
    [
        # A name that ends in another unit.
        ("t,pos,f1_mN,f2", "", 'force = "f1_mN"', r"f1_mN says.*\[mN\]"),
        ("t,pos,f1_kN,f2", "s,mm,N,", 'force = "f1_kN"', None),
        ("t,pos,f1_N,f2", "", 'force = "f1_N"', None),
        ("t,pos,f1_raw,f2", "", 'force = "f1_raw"', None),
        # A unit that contradicts the file.
        (HEADER, "s,mm,mA,mA", 'force = "f1 [N]"', r"says \[N\].*states mA"),
        (HEADER, "s,mm,N,mA", 'force = "f1"\neffort = "f2"', "states mA"),
        (HEADER, "s,mm,N,N", 'force = "-f1 [mN]"', "states N"),
        *((f"t,pos,{gf},f2", "", f"force = \"'{gf}'\"", r"\[gf\]") for gf in ("load (g)", "load_grams", "Weight")),
        *((HEADER, f"s,mm,{unit},N", 'force = "f1"', "another column") for unit in ("mm", "s", "millimeter")),
    ],
)  # fmt: skip
def test_a_unit_that_the_name_or_the_file_states_otherwise_is_told(tmp_path, header, units, keys, says):
    lines = [header, *([units] if units else []), *ROWS]
    gap = "pos" if units else "pos [mm]"
    text = f'files = "{{label}}.csv"\ntime = "t"\ngap = "{gap}"\n{keys}\n'
    (recording,) = recordings(tmp_path, lines, text)
    assert recording.recording.readings[0].frame.gap_m == pytest.approx(0.08)
    told = [notice for notice in recording.notices if re.search(says or "the name of", notice)]
    assert bool(told) == bool(says)


def test_the_unit_of_the_file_is_suggested(tmp_path):
    (tmp_path / "jar.csv").write_text("\n".join([HEADER, "s,mm,mA,mA", *ROWS]) + "\n")
    (table,) = read_text(tmp_path / "jar.csv")
    assert any(guess.value == "f1 [mA]" and "no unit" not in guess.check for guess in guesses(table))


@every_case(
    ("lines", "words"),
    [
        # A column in two notations, and numbers without a header.
        (spoiled(150, '1.500,48.5,"8,5",8.6'), ("jar.csv", "line 152", "f1", "8,5")),
        (["a,b", "a,b", "a,b", *ROWS], ('start = "',)),
        # The rows behind a repeated header are in other units.
        ([HEADER, "s,mm,N,N", *ROWS[:90], HEADER, "s,cm,N,N", *ROWS[90:]], ("jar.csv", "line 94")),
        # A logger that was started anew with a column more: the table before is not left out.
        (
            [HEADER, *ROWS[:90], f"{HEADER},temperature", *(f"{row},21" for row in ROWS[90:])],
            ("line 92", "90 lines", "two tables"),
        ),
    ],
)
def test_a_file_of_two_kinds_of_rows_is_refused(tmp_path, lines, words):
    (refused,) = recordings(tmp_path, lines)
    assert all(word in str(refused.error) for word in words)


# Tables of trials.

TRIALS = [f"{'ab'[k % 2]},{k % 5}.25,{(7 * k) % 11}.5" for k in range(12)]


def trials(folder, lines, **given):
    path = folder / "trials.csv"
    path.write_text("\n".join(lines) + "\n")
    return read_labelled(path, "what", **given)


@every_case(
    "lines",
    [
        ["what,p,q", *TRIALS],
        ["what;p;q", *(trial.replace(",", ";").replace(".", ",") for trial in TRIALS)],
        [",what,p,q", *(f"{(5 * k) % 12},{trial}" for k, trial in enumerate(TRIALS))],
        ["sep=,", "what,p,q", *TRIALS],
        ["made by a program", "", "what,p,q", *TRIALS],
        ["sheet of Ann", "what,p,q", *TRIALS],
        ["what,p,q", *(trial.replace(".5", "00.5") for trial in TRIALS)],
        ["what\tp\tq", *(f"{'ab'[k % 2]}\t{k % 5 + 0.25}\t{250 * k * k % 3700:,}" for k in range(12))],
    ],
)
def test_a_table_of_trials_is_read_by_the_same_rules(lines, tmp_path):
    labelled = trials(tmp_path, lines)
    assert labelled.table.names == ("p", "q")
    assert labelled.labels == ("a", "b") * 6
    assert labelled.table.values[:, 0].tolist() == [k % 5 + 0.25 for k in range(12)]


@every_case(
    "lines",
    [
        # Levels of pandas, and merged cells of a spreadsheet, with and without an index and units.
        ["what,pad,pad", ",p,q", *TRIALS],
        [",what,pad,pad", ",,p,q", *(f"{k},{trial}" for k, trial in enumerate(TRIALS))],
        ["what,pad,", ",p,q", ",N,N", *TRIALS],
        [",pad,pad", ",p,q", "what,,", *TRIALS],
        ["channel,pad,pad", "stat,p,q", "what,,", *TRIALS],
    ],
)
def test_names_in_several_lines_are_joined(lines, tmp_path):
    labelled = trials(tmp_path, lines)
    assert [name.rpartition("_")[2] for name in labelled.table.names] == ["p", "q"]
    assert labelled.labels == ("a", "b") * 6


@every_case(
    ("lines", "names"),
    [
        (["what,p,p", *TRIALS], ("p", "p.1")),
        (["what,p [mm],p [N]", *TRIALS], ("p", "p.1")),
        (["what,p,", *TRIALS], ("p", "c3")),
        (["what,p,q", "d,c,c", "class,,", *TRIALS], ("p", "q")),
        (["what,p,q", "discrete,continuous,continuous", "class,,", *TRIALS], ("p", "q")),
    ],
)
def test_columns_of_one_name_or_none_are_told_apart(tmp_path, lines, names):
    labelled = trials(tmp_path, lines)
    assert (labelled.table.names, labelled.labels) == (names, ("a", "b") * 6)
    assert any(names[1] in note for note in labelled.notes) == (names[1] != "q")


def test_json_lines_are_trials(tmp_path):
    path = tmp_path / "trials.jsonl"
    objects = [{"what": "ab"[k % 2], "pads": {"peak": 0.5 * (k * k % 11)}} for k in range(12)]
    path.write_text("\n".join(map(json.dumps, objects)))
    labelled = load_trials(str(path), label="what")
    assert (labelled.labels, labelled.table.names) == (("a", "b") * 6, ("pads.peak",))


def test_the_last_trials_are_kept_whatever_their_label_is(tmp_path):
    lines = [f"{k % 2},{k % 5}.25,{(7 * k) % 11}.5" for k in range(10)]
    assert trials(tmp_path, ["what,p,q", *lines, "big,0.5,1.5", "big,0.25,2"]).labels[-2:] == ("big", "big")
    lines = [f"{k * k % 11}.5,{'ab'[k % 2]},{k}" for k in range(10)]
    assert len(trials(tmp_path, ["p,what,q", *lines, "OL,a,1", "OL,b,2"]).labels) == 12


def test_a_comma_before_three_digits_is_of_decimals_between_semicolons_and_told(tmp_path):
    lines = [f"{'ab'[k % 2]};{1 + k % 5},{107 * k % 900 + 100}" for k in range(12)]
    labelled = trials(tmp_path, ["what;p", *lines])
    assert labelled.table.values[1].tolist() == [2.207]
    assert any("thousands" in note for note in labelled.notes)
    with pytest.raises(DataDamaged):
        trials(tmp_path, ["what\tp", *(line.replace(";", "\t") for line in lines)])


def test_a_first_trial_without_numbers_has_no_names(tmp_path):
    assert trials(tmp_path, ["what,p,q", "a,NA,NA", *TRIALS]).labels == ("a", *"ab" * 6)


def test_points_that_can_separate_thousands_are_told_in_a_table_with_semicolons(tmp_path):
    lines = [f"{'ab'[k % 2]};{k % 5};{12 + 7 * k % 11}.{107 * k % 900 + 100}" for k in range(12)]
    told = [note for note in trials(tmp_path, ["what;p;q", *lines]).notes if "thousands" in note]
    assert len(told) == 1
    for others in (
        ["what,p,q", *(line.replace(";", ",") for line in lines)],
        ["what;p;q", *lines, "a;0.5;12.000"],
    ):
        assert not [note for note in trials(tmp_path, others).notes if "thousands" in note]


@every_case(("mark", "other"), [(",", "0.5"), (".", "0,5")])
def test_thousands_that_only_other_columns_tell_are_told(mark, other, tmp_path):
    lines = [f"{'ab'[k % 2]};{12 + 7 * k % 11}{mark}{107 * k % 900 + 100}" for k in range(12)]
    labelled = trials(tmp_path, ["what;q;p", *(f"{line};{other}" for line in lines)])
    assert labelled.table.values[1, 0] == 19207
    assert [note for note in labelled.notes if "thousands" in note]
    labelled = trials(tmp_path, ["what;q;p", f"a;975;{other}", *(f"{line};{other}" for line in lines)])
    assert not [note for note in labelled.notes if "thousands" in note]


def test_words_for_a_missing_number_are_labels(tmp_path):
    lines = ["what,p,q", *(trial.replace("a,", "none,").replace("b,", "NA,") for trial in TRIALS)]
    assert trials(tmp_path, lines).labels == ("none", "NA") * 6
    with pytest.raises(DataDamaged, match="line 2"):
        trials(tmp_path, ["what,p,q", *(trial.replace("a,", ",") for trial in TRIALS)])
    lines = [f"{HEADER},what", *(f"{row},{'NA' if k < 100 else 'none'}" for k, row in enumerate(ROWS))]
    keys = 'files = "jar.csv"\nsplit = "what"\nlabel = "{what}"\ntime = "t"\ngap = "pos [mm]"\nforce = "f1"\n'
    assert [recording.label for recording in recordings(tmp_path, lines, keys)] == ["NA", "none"]


def test_labels_that_look_the_same_are_the_same(tmp_path):
    same = ["cafe\u0301", "caf\u00e9", "caf\u00e9\u200b", "\ufeffcaf\u00e9", "caf\u00e9\u00a0", "caf\u00e9"]
    lines = ["what,p,q", *(f"{same[k // 2] if k % 2 else '1.0' if k % 4 else '1'},{k},2" for k in range(12))]
    labelled = trials(tmp_path, lines, features=["p"])
    assert labelled.classes == ("1", "caf\u00e9")
    assert labels_of("cafe\u0301:1.0#2") == {"label": "caf\u00e9:1", "instance": "caf\u00e9#2"}


def test_rows_without_a_value_of_the_column_that_splits_are_left_out_and_told(tmp_path):
    keys = 'files = "*.csv"\nsplit = "trial"\nlabel = "jar"\ntime = "t"\ngap = "pos [mm]"\nforce = "f1"\n'
    lines = [
        f"{HEADER},trial",
        *(f"{row},{'' if k in (30, 31) else 1 + k // 100}" for k, row in enumerate(ROWS)),
    ]
    squeezes = recordings(tmp_path, lines, keys)
    assert [len(recording.recording.readings) for recording in squeezes] == [98, 100]
    assert any("trial (from line 32 on)" in note for note in squeezes[0].recording.notes)
    (refused,) = recordings(tmp_path, [f"{HEADER},trial", *(f"{row}," for row in ROWS)], keys)
    assert "value of trial" in str(refused.error)


@every_case(
    "summary",
    [
        ["1,2,3,4"],
        ["1,2,3", "4,5,6"],
        ["Peak,Mean,Least,Most", "9.1,4.2,0.0,9.1"],
        ["a,b,c,d", *["1,2,3,4"] * 4],
    ],
)
def test_a_summary_in_as_many_columns_is_left_out_and_told(summary, tmp_path):
    (labelled,) = recordings(tmp_path, [*summary, HEADER, *ROWS])
    assert len(labelled.recording.readings) == len(ROWS)
    assert any(f"line {len(summary) + 1}" in note for note in labelled.recording.notes)
