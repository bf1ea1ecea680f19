"""Spreadsheets hold the same tables and recordings as text files, and a hostile one does no more harm."""

import csv
import datetime
import zipfile

import numpy as np
import openpyxl
import pytest
from cases import every_case

from graspsense.core.values.errors import ConfigError, DataDamaged, GraspsenseError
from graspsense.sources.formats.spreadsheet import spreadsheet_text
from graspsense.sources.manifest.reader import read_recordings
from graspsense.sources.trial_table.features_csv import read_labelled

BEGIN = datetime.datetime(2026, 3, 1, 9)
TRIALS = [
    ["Instrument", "bench"],
    [],
    ["object", "instance", "p_first [mm]", "open", "when"],
    *(
        [
            1 + k % 2,
            f"no {k % 4}",
            None if k == 3 else 57.0 + k / 8,
            k % 3 == 0,
            BEGIN + k * datetime.timedelta(minutes=7),
        ]
        for k in range(12)
    ),
]
T_S = np.arange(200) * 0.01
GAP_MM = np.maximum(60.0 - 20.0 * T_S, 40.0)


def workbook(path, *sheets):
    """Write sheets (title, rows, state) with the library that most Python programs write them with."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    for title, rows, state in sheets:
        sheet = book.create_sheet(title)
        sheet.sheet_state = state
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def squeeze(stiffness_n_mm):
    force = stiffness_n_mm * np.maximum(50.0 - GAP_MM, 0.0)
    return [["Time", "Travel", "Load"], ["s", "mm", "N"], *np.column_stack([T_S, GAP_MM, force]).tolist()]


def test_a_spreadsheet_is_the_table_that_a_text_file_is(tmp_path):
    sheets = ("Sheet1", TRIALS, "visible"), ("Sheet2", [], "visible"), ("old", [["x"], [1]], "hidden")
    book = workbook(tmp_path / "trials.xlsx", *sheets)
    with (tmp_path / "trials.csv").open("w", newline="") as file:
        csv.writer(file).writerows(TRIALS)
    read, expected = (read_labelled(path, "object") for path in (book, tmp_path / "trials.csv"))
    assert (read.labels, read.instances) == (expected.labels, expected.instances)
    assert read.labels[:2] == ("1", "2")
    assert (read.table.names, read.table.units) == (expected.table.names, expected.table.units)
    assert read.table.names == ("p_first", "open=False", "open=True")
    np.testing.assert_array_equal(read.table.values, expected.table.values)


def test_an_error_names_the_row_of_the_sheet(tmp_path):
    rows = [[], [], *TRIALS[:8], [1, "no 1", "wide", True, BEGIN], *TRIALS[8:]]
    with pytest.raises(DataDamaged, match="line 11: p_first"):
        read_labelled(workbook(tmp_path / "t.xlsx", ("a", rows, "visible")), "object")


def test_sheets_are_grasps_where_the_manifest_says_so(tmp_path):
    sheets = [(title, squeeze(k), "visible") for k, title in enumerate(("jar_1", "tin_2"), 1)]
    workbook(tmp_path / "grasps.xlsx", *sheets)
    columns = 'time = "Time"\ngap = "Travel"\nforce = "Load"\n'
    start = r"start = '^sheet (?P<label>\w+)_(?P<order>\d+)'"
    (tmp_path / "m.toml").write_text(f'files = "grasps.xlsx"\n{start}\n{columns}')
    grasps = list(read_recordings(str(tmp_path / "m.toml")))
    assert [(grasp.label, grasp.order) for grasp in grasps] == [("jar", 1.0), ("tin", 2.0)]
    peaks = [max(reading.frame.force_left_n for reading in grasp.recording.readings) for grasp in grasps]
    assert peaks == pytest.approx([10.0, 20.0])
    (tmp_path / "m.toml").write_text(f'files = "grasps.xlsx"\nlabel = "jar"\n{columns}')
    (unread,) = read_recordings(str(tmp_path / "m.toml"))
    assert isinstance(unread.error, ConfigError)
    assert "jar_1, tin_2" in str(unread.error)


def test_cells_are_written_as_numbers_times_and_durations(tmp_path):
    half_past = datetime.time(9, 30, 0, 500000)
    rows = [
        ["a", "b", "c", "d"],
        *([k, 1e-7 * k, half_past, datetime.timedelta(seconds=75.25)] for k in range(5)),
    ]
    text = spreadsheet_text(workbook(tmp_path / "t.xlsx", ("s", rows, "visible")), "")
    assert text.splitlines()[4] == "3\t3e-07\t09:30:00.500000\t75.25"


def test_an_open_document_is_read_too(tmp_path):
    cells = "".join(
        f'<table:table-row><table:table-cell office:value-type="string"><text:p>{label}</text:p></table:table-cell>'
        f'<table:table-cell office:value-type="float" office:value="{value}"><text:p>{value:.1f}</text:p>'
        "</table:table-cell></table:table-row>"
        for label, value in (("a", 1.25), ("b", 2.5)) * 4
    )
    head = "".join(
        f'<table:table-cell office:value-type="string"><text:p>{name}</text:p></table:table-cell>'
        for name in ("object", "f_steady")
    )
    names = "urn:oasis:names:tc:opendocument:xmlns"
    content = (
        f'<office:document-content xmlns:office="{names}:office:1.0" xmlns:table="{names}:table:1.0" '
        f'xmlns:text="{names}:text:1.0"><office:body><office:spreadsheet><table:table table:name="t">'
        f"<table:table-row>{head}</table:table-row>{cells}"
        "</table:table></office:spreadsheet></office:body></office:document-content>"
    )
    with zipfile.ZipFile(tmp_path / "t.ods", "w") as file:
        file.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        file.writestr("META-INF/manifest.xml", "<manifest/>")
        file.writestr("content.xml", content)
    # The cell shows 1.2, and its value is 1.25.
    assert set(read_labelled(tmp_path / "t.ods", "object").table.values[:, 0]) == {1.25, 2.5}


def _many_texts(path):
    """Write a small file with a text of a megabyte in each of 100 cells."""
    short = workbook(path.with_suffix(".short"), ("s", [["x"] * 10] * 10, "visible"))
    with zipfile.ZipFile(short) as book, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as large:
        for name in book.namelist():
            part = book.read(name)
            large.writestr(name, part.replace(b">x<", b">" + 1_000_000 * b"x" + b"<"))


def _distant_cells(path):
    """Write a file with two cells that a table of 17 thousand million has at its corners."""
    book = openpyxl.Workbook()
    book.active["A1"] = book.active["XFD1048576"] = 1
    book.save(path)


def _cut(path):
    path.write_bytes(workbook(path, ("s", TRIALS, "visible")).read_bytes()[:3000])


@pytest.mark.slow
@every_case(
    "write", [_many_texts, _distant_cells, _cut, lambda path: path.write_bytes(b"PK\x03\x04 no archive")]
)
def test_a_hostile_or_damaged_file_is_refused_within_the_limits(tmp_path, monkeypatch, write):
    monkeypatch.setenv("GRASPSENSE_MAX_UNPACKED_MB", "20")
    write(tmp_path / "t.xlsx")
    with pytest.raises(GraspsenseError, match=r"t\.xlsx (unpacks|cannot be read)"):
        read_labelled(tmp_path / "t.xlsx", "object")
