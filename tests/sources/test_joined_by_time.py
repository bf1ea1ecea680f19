"""Gap and forces that were recorded apart: in files of their own, or in one column of values with names."""

from datetime import UTC, datetime

import numpy as np
import pytest
from cases import every_case

from graspsense.core.values.errors import DataDamaged
from graspsense.sources.manifest.reader import read_recordings

T_S = np.arange(0.0, 3.0, 0.01)
GAP_MM = np.maximum(80.0 - 20.0 * T_S, 45.0)


def force(t_s):
    return 2.0 * np.maximum(50.0 - np.maximum(80.0 - 20.0 * t_s, 45.0), 0.0)


def written(path, header, *columns):
    lines = [",".join(map(str, row)) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([header, *lines]) + "\n")


def frames(folder, columns):
    (folder / "m.toml").write_text(f"files = '{{label}}.csv'\ntime = 't'\n{columns}\n")
    (grasp,) = read_recordings(str(folder / "m.toml"))
    if not hasattr(grasp, "recording"):
        raise grasp.error
    rows = [(r.frame.t_s, r.frame.gap_m, r.frame.force_left_n) for r in grasp.recording.readings]
    return *np.array(rows).T, grasp.notices


BESIDE = "beside = 'pad.tsv'\ngap = 'gap [mm]'\nforce = \"'pad.N'\""


def seconds(t_s):
    return [f"{time:.4f}" for time in t_s]


def stamps(t_s):
    return [datetime.fromtimestamp(1.7e9 + time, UTC).isoformat() for time in t_s.tolist()]


def milliseconds(t_s):
    return [f"{1e3 * (1.7e9 + time):.1f}" for time in t_s]


def nanoseconds(t_s):
    return [f"{1_700_000_000 * 10**9 + round(1e9 * time)}" for time in t_s.tolist()]


@pytest.mark.slow
@every_case("write", [seconds, stamps, milliseconds, nanoseconds])
@every_case("times", [np.arange(0.0, 3.0, 0.004), np.arange(0.5, 2.9, 0.03), np.arange(-1.0, 4.0, 0.01)])
def test_a_file_beside_with_a_rate_of_its_own_is_joined_by_time(tmp_path, write, times):
    written(tmp_path / "jar.csv", "t,gap", write(T_S), GAP_MM)
    written(tmp_path / "pad.tsv", "t,N", write(times), force(times))
    t_s, gap, forces, notices = frames(tmp_path, BESIDE)
    begin, end = max(0.0, times[0]), min(3.0, times[-1])
    at_s = t_s - t_s[0] + begin
    assert at_s[-1] == pytest.approx(end, abs=0.04)
    # A value is at most as old as the time to the next one: 0.03 s of 40 N/s, and 0.01 s of 20 mm/s.
    assert forces == pytest.approx(force(at_s), abs=40.0 * 0.03 + 0.01)
    assert gap * 1e3 == pytest.approx(np.maximum(80.0 - 20.0 * at_s, 45.0), abs=20.0 * 0.011)
    assert any("left out" in notice for notice in notices) == (begin > 0.15 or times[-1] - times[0] > 3.5)


def test_files_of_several_recordings_in_a_folder_are_joined_by_the_fields_of_their_names(tmp_path):
    times = np.arange(0.0, 3.0, 0.01)
    for number in (1, 2):
        written(tmp_path / f"jar_{number}_gap.csv", "t,gap", seconds(T_S), GAP_MM)
        written(tmp_path / f"jar_{number}_pad.csv", "t,N", seconds(times), number * force(times))
    (tmp_path / "m.toml").write_text(
        "files = '{label}_{number:d}_gap.csv'\ntime = 't'\ngap = 'gap [mm]'\n"
        "beside = '{label}_{number}_pad.csv'\nforce = \"'pad.N'\"\n"
    )
    grasps = read_recordings(str(tmp_path / "m.toml"))
    peaks = [max(r.frame.force_left_n for r in grasp.recording.readings) for grasp in grasps]
    assert peaks[1] == pytest.approx(2.0 * peaks[0], rel=1e-6)


def test_a_hole_and_another_clock_in_a_file_beside_are_told(tmp_path):
    written(tmp_path / "jar.csv", "t,gap", seconds(T_S), GAP_MM)
    times = np.arange(0.0, 3.0, 0.03)
    hole = times[(times < 1.6) | (times > 1.9)]
    written(tmp_path / "pad.tsv", "t,N", seconds(hole), force(hole))
    assert any("no values" in notice for notice in frames(tmp_path, BESIDE)[3])
    written(tmp_path / "pad.tsv", "t,N", seconds(times + 1e5), force(times))
    with pytest.raises(DataDamaged, match="no t"):
        frames(tmp_path, BESIDE)
    (tmp_path / "pad.tsv").write_text("t,N\nms,N\n0,0\n10,0\n20,0\n")
    with pytest.raises(DataDamaged, match="in different units"):
        frames(tmp_path, BESIDE)


def test_as_many_rows_with_other_times_in_words_are_told(tmp_path):
    written(tmp_path / "jar.csv", "t,gap", stamps(T_S), GAP_MM)
    for late_s, told in ((0.0, False), (0.004, False), (0.5, True), (-10.0, True)):
        written(tmp_path / "pad.tsv", "t,N", stamps(T_S + late_s), force(T_S))
        assert any("row by row" in notice for notice in frames(tmp_path, BESIDE)[3]) == told


@every_case("late_s", [0.0, 0.003])
def test_a_column_of_values_with_names_is_a_column_for_each_name(tmp_path, late_s):
    rows = [(t, "gap", g) for t, g in zip(T_S, GAP_MM, strict=True)]
    rows += [(t + late_s, "left pad", f) for t, f in zip(T_S, force(T_S), strict=True)]
    rows.sort(key=lambda row: row[0])
    written(tmp_path / "jar.csv", "t,what,value", *zip(*rows, strict=True))
    t_s, gap, forces, notices = frames(tmp_path, "gap = \"'gap.value' [mm]\"\nforce = \"'left pad.value'\"")
    assert len(t_s) >= 299
    assert gap * 1e3 == pytest.approx(np.maximum(80.0 - 20.0 * t_s, 45.0), abs=0.1)
    assert forces == pytest.approx(force(t_s), abs=40.0 * 0.01 + 0.01)
    assert notices == ()
