"""What people see in a terminal: tables and texts that fit its width, and colour only where it can be shown."""

import json
import re
import sys

import pytest
from cases import every_case
from commands import answered, graspsense, printed, python
from hypothesis import given
from hypothesis import strategies as st
from terminals import in_terminal

from graspsense.cli import terminal

WIDTHS = (60, 140)

TABLE = """
from graspsense.cli.terminal import Style, echo_table
text = "a sentence that is longer than any terminal on which it is read, so that it has to be wrapped within its column"
echo_table(
    ("ROLE", "NAME", "STATE", "WHAT"),
    [("sensor-backend", "graspsense-sim-gripper/sim", "broken", text), ("classifier", "c45", "loaded", text)],
    {"STATE": lambda cell: Style.BAD if cell == "broken" else Style.GOOD},
)
"""


def assert_fits(shown, width, unbroken=None):
    """Demand that a command ended well and that its lines fit, but those with the name of this file or folder."""
    assert shown.code == 0
    assert all(len(line) <= width for line in shown.lines if unbroken is None or str(unbroken) not in line)


@every_case("width", [40, 140])
def test_a_table_fits_the_terminal_and_keeps_every_word(width):
    shown = in_terminal([TABLE], width, program=[sys.executable, "-c"])

    assert_fits(shown, width)
    assert "graspsense-sim-gripper/sim" in shown.text
    assert shown.text.split().count("wrapped") == 2
    assert shown.coloured


def test_a_piped_table_keeps_whole_values_on_one_line_each():
    ran = python("-c", TABLE, check=True, env={"COLUMNS": "40"})

    lines = ran.stdout.splitlines()
    assert len(lines) == 3
    assert all(line.endswith("so that it has to be wrapped within its column") for line in lines[1:])
    assert "\x1b" not in ran.stdout


def test_columns_stand_below_each_other_under_wide_and_combining_characters(capsys):
    terminal.echo_table(
        ("LABEL", "RATE"), [("瓶子满", "66.7 %"), ("bu\u0308gel", "100.0 %"), ("can", "5.0 %")]
    )
    wide = "瓶子满   66.7 %"  # three characters that take six columns
    assert capsys.readouterr().out == f"LABEL      RATE\n{wide}\nbu\u0308gel   100.0 %\ncan       5.0 %\n"


def test_no_colour_where_it_is_not_wanted_or_not_understood_and_columns_override_the_width():
    for environment in ({"NO_COLOR": "1"}, {"TERM": "dumb"}):
        assert not in_terminal([TABLE], 80, program=[sys.executable, "-c"], **environment).coloured
    shown = in_terminal([TABLE], 140, program=[sys.executable, "-c"], COLUMNS="60")
    assert 40 < max(map(len, shown.lines)) <= 60


@pytest.mark.slow
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("lang", ["C", "C.UTF-8"])
def test_the_list_of_plugins_fits_the_terminal(width, lang):
    shown = in_terminal(["plugins", "list"], width, LANG=lang)

    assert_fits(shown, width)
    assert "hybrid" in shown.text


def test_an_error_is_red_and_fits_the_terminal():
    shown = in_terminal(["run", "-o", "controller.nosuch=1"], 60)

    assert shown.code == 2
    assert max(map(len, shown.lines)) <= 60
    assert shown.coloured


@given(
    rows=st.lists(
        st.tuples(*[st.text("ab -", max_size=40)] * 3),
        min_size=1,
        max_size=4,
    ),
    room=st.integers(10, 120),
    short=st.sampled_from((8, 24)),
)
def test_columns_never_take_more_room_than_there_is(rows, room, short):
    header = ("ONE", "TWO", "THREE")
    natural = [max(len(row[k]) for row in (header, *rows)) for k in range(3)]
    widths = terminal._fitted(header, rows, natural, room, short)

    if widths is None:
        words = [max(len(word) for row in (header, *rows) for word in row[k].split()) for k in range(3)]
        assert sum(min(n, max(short, word)) for n, word in zip(natural, words, strict=True)) > room
    else:
        assert sum(widths) <= room
        assert all(width <= most for width, most in zip(widths, natural, strict=True))


@pytest.mark.slow
def test_json_is_the_same_in_a_terminal_and_in_a_pipe():
    shown = in_terminal(["plugins", "list", "--json"], 60)

    assert json.loads(shown.text) == answered("plugins", "list")
    assert not shown.coloured


@pytest.mark.slow
@pytest.mark.parametrize("width", WIDTHS)
def test_a_grasp_fits_the_terminal_with_outcome_prediction_and_warning_in_colour(width):
    shown = in_terminal(["run", "-o", "gripper.explain=true"], width)

    assert_fits(shown, width)
    for word in ("steady", "odwalla:full_closed", "trained on simulated"):
        assert re.search(r"(\x1b\[[0-9;]*m)+" + word, shown.raw), word
    assert not re.search(r"[0-9] m(/s)?\b(?! )", shown.text), "lengths are in mm"
    assert "100%" not in shown.text
    assert re.search(r"about \d\d %: \d+ of \d+ training", " ".join(shown.text.split()))


@pytest.mark.slow
def test_one_unit_for_lengths_and_results_on_stdout_when_piped():
    ran = graspsense("run")

    assert not re.search(r"[0-9] m(/s)?\b", ran.stdout + ran.stderr)
    assert "warning     trained on simulated" in ran.stdout
    assert "outcome     steady" in ran.stdout
    assert "\x1b" not in ran.stdout + ran.stderr
    tested = re.findall(r"^ +(?:\S+ \S+ < )?(\w+) = ", ran.stdout, re.MULTILINE)
    assert len(tested) == len(set(tested)), "each feature has one range"


@pytest.fixture
def csv(tmp_path):
    path = tmp_path / "grasps.csv"
    widths, forces = {"can": 0.066, "jar": 0.055}, {"full": 9.0, "empty": 4.0}
    lines = ["what,thing,p_first [m],f_steady [N]"]
    for i in range(48):
        kind, state = ("can", "jar")[i % 2], ("full", "empty")[(i // 2) % 2]
        width, force = widths[kind] + 1e-5 * i, forces[state] + 0.01 * i
        lines.append(f"{kind}:{state},{kind}{i % 6},{width:.5f},{force:.3f}")
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.slow
@pytest.mark.parametrize("width", WIDTHS)
def test_evaluate_says_its_verdict_first_and_fits_the_terminal(csv, width):
    shown = in_terminal(["evaluate", str(csv), "--label", "what", "--instance", "thing"], width)

    said = " ".join(shown.text.split())
    assert re.match(r"c45 recognises.*97.9 % of 48 trials of \S+grasps.csv \(95 %", said)
    assert "label (25.0 %)." in said
    assert "The width alone" in said
    assert "was not measured" in said
    assert said.index("The width alone") < said.index("PROTOCOL") if width == 140 else True
    # The name of the file is one word, which is not broken.
    assert_fits(shown, width, unbroken=csv)


@pytest.mark.slow
@pytest.mark.parametrize("width", WIDTHS)
def test_predictions_fit_the_terminal_and_count_their_training_trials(csv, tmp_path, width):
    model = tmp_path / "m.json"
    printed("train", csv, "--label", "what", "--instance", "thing", "--out", model)
    shown = in_terminal(["predict", str(model), str(csv)], width)

    assert_fits(shown, width, unbroken=tmp_path)
    assert "can:full" in shown.text
    assert "no certainty" in shown.text or "not calibrated" in shown.text  # by so few instances
    assert "100 %" not in shown.text
    assert "mm" in shown.text
    assert not re.search(r"[0-9] m\b", shown.text)


@pytest.mark.slow
@pytest.mark.parametrize("width", WIDTHS)
def test_the_list_of_experiments_says_how_long_each_takes(width):
    shown = in_terminal(["experiment"], width)

    assert_fits(shown, width)
    rows = printed("experiment").partition("\n\n")[0].splitlines()[1:]
    assert len(rows) > 30
    for row in rows:
        assert re.match(r"\w+ +\d[\d.]* (s|min|h)  ", row), row


@pytest.mark.slow
@pytest.mark.parametrize("width", WIDTHS)
def test_a_dry_run_of_an_experiment_is_a_summary(tmp_path, width):
    options = ["experiment", "probing_force", "-o", "seeds=10000", "--dry-run", "--out", str(tmp_path / "e")]
    shown = in_terminal(options, width)

    assert len(shown.lines) < 20
    said = " ".join(shown.text.split())
    assert "30000: 3 cases with 10000 seeds" in said
    assert "2880000 simulated grasps" in said
    assert re.search(r"time about [\d.]+ h with \d+ processes", said)
    assert not (tmp_path / "e").exists()
    assert_fits(shown, width, unbroken=tmp_path)


@pytest.mark.slow
def test_collect_shows_keys_then_what_was_felt_and_what_the_model_takes_it_for(tmp_path):
    arguments = ["collect", "--labels", "can:full_open", "--each", "1", "--save", str(tmp_path / "t")]
    shown = in_terminal(arguments, 60, typed="\n")

    said = " ".join(shown.text.split())
    assert_fits(shown, 60)
    keys, felt, prediction = said.index("keys: Enter"), said.index("felt p_first"), said.index("prediction ")
    assert keys < felt < prediction
    assert re.search(r"felt p_first [\d.]+ mm, p_steady [\d.]+ mm, f_steady [\d.]+ N,", said)
    assert re.search(r"prediction (can|naked|water|odwalla):\w+ \(about \d+ %: ", said)
