"""What people see in a terminal: tables and texts that fit its width, and colour only where it can be shown."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st
from terminals import COMMAND, in_terminal

from graspsense.cli import terminal

WIDTHS = (60, 80, 140)

TABLE = """
from graspsense.cli.terminal import Style, echo_table
text = "a sentence that is longer than any terminal on which it is read, so that it has to be wrapped within its column"
echo_table(
    ("ROLE", "NAME", "STATE", "WHAT"),
    [("sensor-backend", "graspsense-sim-gripper/sim", "broken", text), ("classifier", "c45", "loaded", text)],
    {"STATE": lambda cell: Style.BAD if cell == "broken" else Style.GOOD},
)
"""


@pytest.mark.parametrize("width", [40, *WIDTHS])
def test_a_table_fits_the_terminal_and_keeps_every_word(width):
    shown = in_terminal([TABLE], width, program=[sys.executable, "-c"])

    assert shown.code == 0
    assert max(map(len, shown.lines)) <= width
    assert "graspsense-sim-gripper/sim" in shown.text
    assert shown.text.split().count("wrapped") == 2
    assert shown.coloured


def test_a_piped_table_keeps_whole_values_on_one_line_each():
    ran = subprocess.run(
        [sys.executable, "-c", TABLE], capture_output=True, text=True, check=True, env={"COLUMNS": "40"}
    )

    lines = ran.stdout.splitlines()
    assert len(lines) == 3
    assert all(line.endswith("so that it has to be wrapped within its column") for line in lines[1:])
    assert "\x1b" not in ran.stdout


@pytest.mark.parametrize("environment", [{"NO_COLOR": "1"}, {"TERM": "dumb"}])
def test_no_colour_where_it_is_not_wanted_or_not_understood(environment):
    assert not in_terminal([TABLE], 80, program=[sys.executable, "-c"], **environment).coloured


def test_columns_override_the_width_of_the_terminal():
    shown = in_terminal([TABLE], 140, program=[sys.executable, "-c"], COLUMNS="60")

    assert 40 < max(map(len, shown.lines)) <= 60


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("lang", ["C", "C.UTF-8"])
def test_the_list_of_plugins_fits_the_terminal(width, lang):
    shown = in_terminal(["plugins", "list"], width, LANG=lang)

    assert shown.code == 0
    assert max(map(len, shown.lines)) <= width
    assert "hybrid" in shown.text


def test_an_error_is_red_and_fits_the_terminal():
    shown = in_terminal(["run", "-o", "controller.nosuch=1"], 60)

    assert shown.code == 2
    assert max(map(len, shown.lines)) <= 60
    assert shown.coloured


@pytest.mark.parametrize("arguments", [["--help"], ["plugins", "list"]])
def test_neither_rich_nor_numpy_is_imported_for_help_and_the_piped_list_of_plugins(arguments):
    program = (
        "import sys\ntry:\n    from graspsense.cli.main import main\n    main()\n"
        "finally:\n    print([name for name in ('rich', 'numpy') if name in sys.modules], file=sys.stderr)"
    )
    ran = subprocess.run(
        [sys.executable, "-c", program, *arguments], capture_output=True, text=True, check=True
    )

    assert ran.stderr == "[]\n"


@given(
    rows=st.lists(
        st.tuples(*[st.text("ab -", max_size=40)] * 3),
        min_size=1,
        max_size=4,
    ),
    room=st.integers(10, 120),
)
def test_columns_never_take_more_room_than_there_is(rows, room):
    header = ("ONE", "TWO", "THREE")
    natural = [max(len(row[k]) for row in (header, *rows)) for k in range(3)]
    widths = terminal._fitted(header, rows, natural, room)

    if widths is None:
        longest = [max(len(w) for row in (header, *rows) for w in row[k].split()) for k in range(3)]
        assert sum(longest) > room
    else:
        assert sum(widths) <= room
        assert all(width <= most for width, most in zip(widths, natural, strict=True))


def test_json_is_the_same_in_a_terminal_and_in_a_pipe():
    shown = in_terminal(["plugins", "list", "--json"], 60)
    piped = subprocess.run(
        [*COMMAND, "plugins", "list", "--json"], capture_output=True, text=True, check=True
    )

    assert json.loads(shown.text) == json.loads(piped.stdout)
    assert not shown.coloured
