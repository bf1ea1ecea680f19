"""Other people's squeezes: a CSV whose columns their user names, through the pipeline and into a store."""

import json
import re
import sys

import pytest
from cases import every_case
from commands import answered, graspsense, printed, refused
from grippers import bottle, squeezing

from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.signals import Phase
from graspsense.recording.reader import read_recorded
from graspsense.sources.recordings.grasp_csv import named, read_squeeze
from graspsense.store.store import Store

TICKS = 2200


@pytest.fixture
def squeeze(tmp_path):
    """A squeeze in milliseconds and millimetres, at odd times, with semicolons."""
    path = tmp_path / "squeeze.csv"
    lines = ["stamp ms;opening;F left;F right;note"]
    for k in range(TICKS):
        left, right = bottle(k * 0.001)
        lines.append(f"{5000 + k};{squeezing(k * 0.001) * 1000:.9g};{left:.9g};{right:.9g};x")
    path.write_text("\n".join(lines) + "\n")
    return path


def name_of(path, force=("F left", "F right"), time="stamp ms*0.001", gap="opening*0.001"):
    return named(str(path), {"time": [time], "gap": [gap], "force": list(force)})


def test_columns_are_what_the_user_says_in_si_units(squeeze):
    recording = read_squeeze(name_of(squeeze))
    assert len(recording.readings) == TICKS
    assert recording.rate_hz == pytest.approx(1000.0)
    frame = recording.readings[1200].frame
    assert frame.t_s == pytest.approx(6.2)
    assert frame.gap_m == pytest.approx(squeezing(1.2))
    assert (frame.force_left_n, frame.force_right_n) == pytest.approx(bottle(1.2))
    assert frame.velocity_m_s == pytest.approx(-0.012, rel=1e-3)
    assert frame.effort_n != frame.effort_n  # nobody said which column it is
    # One force is that of both pads, and said so.
    recording = read_squeeze(name_of(squeeze, force=["F left"]))
    frame = recording.readings[-1].frame
    assert frame.force_left_n == frame.force_right_n > 1.0
    assert any("single force" in note for note in recording.notes)


@every_case(
    ("columns", "says"),
    [
        ({"gap": "opening"}, r"reaches 74 m, which no.*\[mm\]"),
        ({"gap": "opening*-0.01"}, r"reaches -0\.74 m, .*Plausible is -0\.05 to 0\.5 m"),
        ({"force": ["F left*1000", "F right"]}, r"reaches .* N, .*\[mN\], in counts \[counts\]"),
        ({"time": "stamp ms*10"}, r"reaches 10 s, .*behind it: \[ms\]"),
    ],
)
def test_a_quantity_that_no_gripper_has_is_refused(squeeze, columns, says):
    with pytest.raises(DataDamaged, match=says):
        read_squeeze(name_of(squeeze, **columns))


@every_case(
    ("query", "says"),
    [
        ("", "which column of .* is time"),
        ("?time=stamp ms&gap=opening", "is force"),
        ("?time=stamp ms&gap=opning&force=F left", "no column 'opning'.*'opening'"),
        ("?time=stamp ms&gap=opening&force=F left&forse=x", "'forse'.*grasp.*'force'"),
        (
            "?time=stamp ms&gap=opening*mm&force=F left",
            r"gap, for squeeze.csv: no column 'mm'\. Columns: 'stamp ms', opening, 'F left'",
        ),
        ("?time=stamp ms&gap=opening*&force=F left", "gap: .*expression"),
        ("?time=stamp ms&gap=opening&gap=opening&force=F left", "2 columns .*gap.*1"),
    ],
)
def test_a_name_that_makes_no_sense_is_told(squeeze, query, says):
    with pytest.raises(ConfigError, match=says):
        read_squeeze(f"{squeeze}{query}")


def test_it_is_kept_whole_with_its_label_and_its_features_worked_out_by_hand(squeeze, tmp_path):
    forces = ("--force", "F left", "--force", "F right")
    columns = ("--time", "stamp ms*0.001", "--gap", "opening*0.001", *forces, "--label", "jar:full#3")
    store = tmp_path / "store"
    plain = ("-o", "classifier.type=none", "--json")
    code, out, err = graspsense("import", squeeze, "--save", store, *columns, *plain)
    assert code == 0, err
    assert "2200 samples of squeeze.csv" in err
    assert json.loads(out)["trials"] == [{"source": str(squeeze), "trial": 1, "outcome": "steady"}]
    with Store.read(store) as opened:
        kept = opened.trial(1)
        assert opened.counts() == {("jar:full", "jar#3"): 1}
    assert not kept.summary.simulated
    features = kept.result.features.as_dict()
    # `squeezing` and `bottle`: contact at 1.0 s and 60 mm, rest at 1.5 s and 54 mm with 8 N.
    assert features["p_first"] == pytest.approx(0.060, abs=1e-5)
    assert features["p_steady"] == pytest.approx(0.054, abs=1e-5)
    assert features["f_steady"] == pytest.approx(8.0, abs=0.01)
    assert features["delta_t"] == pytest.approx(0.5, abs=0.002)
    # The recording goes on after the controller had enough.
    recorded = read_recorded(kept.recording)
    assert len(recorded) == TICKS
    assert recorded.readings()[-1].frame.t_s == pytest.approx(7.199)
    # Its phases are those of the controller, so that a page draws it from the contact on, as any other trial.
    first_squeeze = recorded.trace().phase.tolist().index(Phase.SQUEEZE)
    assert recorded.trace().t_s[first_squeeze] == pytest.approx(6.0, abs=0.1)
    assert answered("replay", f"{store}#1")["features"] == features
    # The page has the same phases, and its axis begins at the contact, not at the first line of the file.
    printed("report", store, "--out", tmp_path / "page")
    page = (tmp_path / "page" / "report.html").read_text()
    approach, squeeze = map(float, re.search(r"approach for ([\d.]+), squeeze for ([\d.]+)", page).groups())
    assert approach == pytest.approx(1.0, abs=0.1)
    assert squeeze == pytest.approx(0.55, abs=0.1)
    assert "the squeeze began" in page


def test_options_of_a_csv_with_another_kind_are_refused(tmp_path):
    assert "--gap" in refused("import", "icub:x.txt", "--save", tmp_path / "s", "--gap", "g")
    assert sys.exc_info() == (None, None, None)


@every_case(
    ("line", "says"),
    [
        ("5000;1;1;1;x", "line 4: the time"),
        ("5002;inf;1;1;x", "line 4: the gap"),
        ("5002;wide;1;1;x", "numbers: line 4 has 'wide'"),
        ("5002;1;1;1", "line 4: 4 values.*5 columns"),
    ],
)
def test_a_line_that_is_no_squeeze_is_told_with_its_number(squeeze, line, says):
    lines = squeeze.read_text().splitlines()
    squeeze.write_text("\n".join([*lines[:3], line, *lines[4:]]))
    with pytest.raises(DataDamaged, match=says):
        read_squeeze(name_of(squeeze))
