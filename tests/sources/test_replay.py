"""Recordings: the iCub reader, its mapping onto two fingers, and the replay backend."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from cases import every_case
from commands import Done, graspsense, refused
from hypothesis import given
from hypothesis import strategies as st
from kept import keep

from graspsense.core.components.registry import IsolatedPlugins, installed
from graspsense.core.pipeline.pipeline import grasp_with
from graspsense.core.settings.layers import Flag
from graspsense.core.settings.resolved import resolve
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import ConfigError, DataDamaged, DeviceLost, RecordingEnded
from graspsense.core.values.signals import EFFORT, VELOCITY, Command, Frame, Phase
from graspsense.core.values.trace import PAD_COLUMNS, TICK_COLUMNS
from graspsense.sources.recordings.icub import IcubGrasp, read_grasp, read_recording, recording_of
from graspsense.sources.recordings.replay import ReplayBackend, ReplayConfig
from graspsense.store.record_grasp import record_grasp
from graspsense.store.store import Store
from graspsense.store.stored_grasps import recorded_settings

REST_DEG = (20.0, 80.0, 10.0, 40.0, 30.0, 50.0, 32.0, 45.0, 5.0)
"""Joints 7 to 15."""
THUMB, INDEX, MIDDLE, RING, LITTLE = range(5)

real_data = pytest.mark.skipif(
    "GRASPSENSE_ICUB" not in os.environ,
    reason="needs the iCub Grasp Dataset: name its folder in GRASPSENSE_ICUB",
)


def frame_lines(encoders: Sequence[float] = REST_DEG, pressed: dict[int, int] | None = None) -> list[str]:
    """Seven lines: `pressed` takes that many counts off one taxel of a fingertip that rests at 240."""
    taxels = np.full((5, 12), 240)
    for finger, counts in (pressed or {}).items():
        taxels[finger, 3] -= counts
    return [
        " ".join(f"{value}" for value in encoders) + " ",
        " ".join(f"{255 - row.min():.1f}" for row in taxels),
        *(" ".join(f"{value:.1f}" for value in row) for row in taxels),
    ]


def write(path: Path, *frames: list[str]) -> Path:
    path.write_bytes("".join(f"{line}\r\n" for line in ["-10000", *chain(*frames)]).encode())
    return path


def moved(**joints_deg: float) -> tuple[float, ...]:
    """The resting hand with some joints turned by these degrees: `moved(j12=8.0)`."""
    encoders = list(REST_DEG)
    for joint, by in joints_deg.items():
        encoders[int(joint[1:]) - 7] += by
    return tuple(encoders)


def frames_of(path: Path) -> list[Frame]:
    return [reading.frame for reading in recording_of(read_grasp(path), "g").readings]


def test_thumb_is_left_and_the_strongest_finger_is_right(tmp_path: Path) -> None:
    path = write(
        tmp_path / "g.txt",
        frame_lines(pressed={THUMB: 5, MIDDLE: 30}),  # the first frame is the zero
        frame_lines(pressed={THUMB: 25, MIDDLE: 30, INDEX: 9}),
        frame_lines(pressed={THUMB: 25, MIDDLE: 70, RING: 12}),
    )
    recording = read_recording(str(path))
    frames = [reading.frame for reading in recording.readings]
    assert [frame.force_left_n for frame in frames] == pytest.approx([0.0, 2.0, 2.0])
    assert [frame.force_right_n for frame in frames] == pytest.approx([0.0, 0.9, 4.0])
    # Each of the five fingers is kept beside the two forces.
    assert [channel.name for channel in recording.channels] == list(recording.readings[-1].signals._fields)
    assert list(recording.readings[-1].signals) == pytest.approx([2.0, 0.0, 4.0, 1.2, 0.0])


@every_case(
    ("joints", "closed_mm"),
    [
        *(({joint: 8.0}, 2.0) for joint in ("j9", "j10")),  # half the mean of two joints of the thumb
        *(
            ({joint: 8.0}, 1.0) for joint in ("j11", "j12", "j13", "j14")
        ),  # of four of index and middle finger
        ({"j9": 1.0, "j10": 1.0, "j11": 1.0, "j12": 1.0, "j13": 1.0, "j14": 1.0}, 1.0),
        ({"j7": 8.0, "j8": 8.0, "j15": 8.0}, 0.0),
        ({"j10": -4.0}, -1.0),
    ],
)
def test_gap_falls_as_thumb_and_fingers_flex(
    tmp_path: Path, joints: dict[str, float], closed_mm: float
) -> None:
    opened, last = frames_of(write(tmp_path / "g.txt", frame_lines(), frame_lines(moved(**joints))))
    assert opened.gap_m == 0.08
    assert (opened.gap_m - last.gap_m) * 1e3 == pytest.approx(closed_mm)
    assert last.velocity_m_s == pytest.approx(last.gap_m - opened.gap_m)
    assert opened.velocity_m_s == 0.0


@given(data=st.data())
def test_mapping_depends_on_no_later_frame_and_on_no_offset(data: st.DataObject) -> None:
    n = data.draw(st.integers(2, 6))
    rng = np.random.default_rng(data.draw(st.integers(0, 1000)))
    encoders, taxels = rng.uniform(10, 60, (n, 9)), rng.integers(100, 200, (n, 5, 12)).astype(float)

    def frames(up_to: int, angle: float, counts: float) -> list[Frame]:
        grasp = IcubGrasp(
            encoders_deg=encoders[:up_to] + angle, maxima=np.zeros((up_to, 5)), taxels=taxels[:up_to] + counts
        )
        return [reading.frame for reading in recording_of(grasp, "g").readings]

    whole, cut = frames(n, 0.0, 0.0), frames(n - 1, 0.0, 0.0)
    # A list of frames with NaN in it equals another only by its repr.
    assert repr(whole[:-1]) == repr(cut)
    shifted = frames(n, 7.5, -31.0)
    for a, b in zip(whole, shifted, strict=True):
        assert a.gap_m == pytest.approx(b.gap_m, abs=1e-12)
        assert a.force_left_n == pytest.approx(b.force_left_n, abs=1e-9)
        assert a.force_right_n == pytest.approx(b.force_right_n, abs=1e-9)


def damaged_files() -> list[tuple[str, bytes, str]]:
    good = "".join(f"{line}\r\n" for line in ["-10000", *frame_lines(), *frame_lines()]).encode()
    lines = good.split(b"\r\n")
    short = b"\r\n".join([*lines[:4], b" ".join(lines[4].split()[:11]), *lines[5:]])
    return [
        ("other", b"t,gap\n0,1\n", "line 1: it starts with 't,gap'"),
        ("binary", bytes(range(256)), "line 2: byte 0x80 is not UTF-8"),
        ("first_line_only", b"-10000\r\n", "line 1: there is no frame"),
        (
            "mid_frame",
            b"\r\n".join(lines[:11]) + b"\r\n",
            "line 11: the file ends after 3 of the 7 lines of frame 2",
        ),
        ("mid_line", good[:-4], "line 15: the file ends within this line"),
        ("taxel_lost", short, "line 5: 11 index taxel values; 12 are expected"),
        ("word", good.replace(b"45.0", b"fast", 1), "line 2: encoder value 'fast' is not a number"),
        (
            "nine_bits",
            good.replace(b"240.0", b"256.0", 1),
            "line 4: thumb taxel value '256.0' is outside 0 to 255",
        ),
    ]


@every_case(("name", "content", "says"), damaged_files())
def test_damaged_file_is_told_with_its_line(tmp_path: Path, name: str, content: bytes, says: str) -> None:
    path = tmp_path / f"{name}.txt"
    path.write_bytes(content)
    with pytest.raises(DataDamaged) as caught:
        read_grasp(path)
    assert says in str(caught.value)
    assert str(path) in str(caught.value)
    assert caught.value.exit_code == 5


def test_a_file_cut_anywhere_is_damaged_or_ends_between_two_frames(tmp_path: Path) -> None:
    frames = [frame_lines(), frame_lines(pressed={THUMB: 9})]
    path = write(tmp_path / "g.txt", *frames)
    whole = path.read_bytes()
    read = {}
    for cut in range(len(whole)):
        path.write_bytes(whole[:cut])
        with suppress(DataDamaged):
            read[cut] = read_grasp(path)
    first_frame_alone = len(write(path, frames[0]).read_bytes())
    assert list(read) == [first_frame_alone]
    assert len(read[first_frame_alone]) == 1


def test_folder_may_be_the_one_that_contains_the_data_set(tmp_path: Path) -> None:
    inside = tmp_path / "iCubGraspDataset"
    inside.mkdir()
    write(inside / "full_bottle_1.txt", frame_lines())
    for folder in (inside, tmp_path):
        assert read_recording(f"{folder}/full_bottle_1.txt").name == "iCub hand, full_bottle_1.txt"
    for place, says in (
        (f"{tmp_path}/ful_bottle_1.txt", r"no grasp.*Did you mean 'full_bottle_1.txt'\?"),
        (str(tmp_path), "is a folder: name a grasp in it"),
    ):
        with pytest.raises(ConfigError, match=says):
            read_recording(place)


KNOWN = "csv:, icub:, mcap:, npz:, parquet:, rosbag:, store:, lerobot:, manifest:"


@every_case(
    ("recording", "says"),
    [
        ("full_bottle_1.txt", f"does not say what kind of recording it is: write {KNOWN} before"),
        ("icb:full_bottle_1.txt", f"unknown kind of recording 'icb'. Known: {KNOWN}. Did you mean 'icub'?"),
        ("icub:", "names no file"),
    ],
)
def test_recording_must_name_kind_and_file(recording: str, says: str) -> None:
    with pytest.raises(ValueError, match=re.escape(says)):
        ReplayConfig(recording)


def opened(path: Path) -> tuple[ReplayBackend, DeviceInfo]:
    backend = ReplayBackend(ReplayConfig(f"icub:{path}"))
    return backend, backend.open(seed=0)


def test_backend_gives_each_frame_once_and_then_ends(tmp_path: Path) -> None:
    path = write(tmp_path / "g.txt", frame_lines(), frame_lines(moved(j9=4.0)), frame_lines())
    backend, info = opened(path)
    assert info.opening is None
    assert info.clock == "virtual"
    assert info.tare_images == 0
    readings = []
    for command in (Command(VELOCITY, -0.01, 20.0, 0.1), Command(EFFORT, 99.0, 99.0, 0.1), info.relaxed):
        readings.append(backend.read(timeout_s=0.0))
        backend.apply(command)
    assert repr(readings) == repr(list(recording_of(read_grasp(path), "g").readings))
    for _ in range(2):
        with pytest.raises(RecordingEnded):
            backend.read(timeout_s=0.0)
    assert backend.report()["frames_read"] == 3
    for _ in range(2):
        backend.close()
    with pytest.raises(DeviceLost, match="not open"):
        backend.read(timeout_s=0.0)
    backend.open(seed=1)
    assert repr(backend.read(timeout_s=0.0)) == repr(readings[0])


def test_backend_tells_a_force_that_is_the_same_all_along(tmp_path: Path) -> None:
    (tmp_path / "g.csv").write_text(
        "t,gap,l,r\n"
        + "".join(f"{k * 0.01},{0.08 - k * 0.0005},0.35,{max(0, k - 60) * 0.1}\n" for k in range(100))
    )
    (tmp_path / "m.toml").write_text(
        'files = "g.csv"\nlabel = "jar"\ntime = "t [s]"\ngap = "gap [m]"\nleft = "l [N]"\nright = "r [N]"\n'
    )
    info = ReplayBackend(ReplayConfig(f"manifest:{tmp_path}/m.toml#1")).open(seed=0)
    assert [note for note in info.notes if "left pad does" in note]
    assert not [note for note in info.notes if "right pad does" in note]


@pytest.mark.slow
@real_data
def test_every_file_of_the_data_set_reads() -> None:
    folder = Path(os.environ["GRASPSENSE_ICUB"])
    files = sorted(folder.glob("**/*_*.txt"))
    assert len(files) == 230
    lengths = [len(read_grasp(path)) for path in files]
    assert (min(lengths), max(lengths)) == (4, 24)


@real_data
def test_nothing_in_the_hand_is_no_contact_and_a_full_bottle_is() -> None:
    def touched(name: str) -> bool:
        path = f"{os.environ['GRASPSENSE_ICUB']}/{name}"
        frames = [reading.frame for reading in read_recording(path).readings]
        return any(min(frame.force_left_n, frame.force_right_n) >= 0.625 for frame in frames)

    assert [touched(f"none_{k}.txt") for k in range(1, 23)] == [False] * 22
    assert [touched(f"full_vitamin_water_{k}.txt") for k in range(1, 21)] == [True] * 20


def run(recording: str) -> Done:
    return graspsense("run", "--json", "--gripper", "replay", "-o", f"gripper.recording={recording}")


def test_run_ends_a_recorded_grasp_with_outcome_and_features(tmp_path: Path) -> None:
    """Contact in frame 2, at rest from frame 3 on, shown by frame 4: all of it worked out by hand."""
    path = write(
        tmp_path / "g.txt",
        frame_lines(),
        frame_lines(moved(j9=8.0), {THUMB: 4, INDEX: 30}),  # the thumb at 0.4 N: not yet
        frame_lines(moved(j9=16.0), {THUMB: 10, INDEX: 40}),
        frame_lines(moved(j9=20.0), {THUMB: 30, INDEX: 50}),
        frame_lines(moved(j9=20.0), {THUMB: 50, INDEX: 70}),
        frame_lines(moved(j9=40.0), {THUMB: 90, INDEX: 90}),
    )
    done = run(f"icub:{path}")
    assert done.returncode == 0, done.stderr
    grasp = json.loads(done.stdout)
    assert grasp["outcome"] == "steady"
    assert grasp["features"] == pytest.approx(
        {
            "p_first": 0.076,  # 16 degrees of one thumb joint close by a quarter of a millimetre each
            "p_steady": 0.075,
            "f_steady": 6.0,
            "delta_t": 1.0,
            "dp_dt": -0.001,
            "df_dt": 6.0 - 2.5,
        }
    )
    assert grasp["units"]["delta_t"] == "frame"
    assert any("frame numbers" in note for note in grasp["device"]["notes"])


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        (),
        ("controller.type=velocity",),  # ends otherwise than steady
        ("gripper.type=pr2", "gripper.transport=emulated", "gripper.object=can:full_open"),
    ],
)
def test_a_replayed_trial_has_the_trace_of_the_grasp_to_the_last_bit(
    tmp_path: Path, options: tuple[str, ...]
) -> None:
    settings = resolve(options=[*options, "classifier.type=none"])
    with Store.open(tmp_path) as store:
        grasp = record_grasp(store, settings, installed(), labels={}, origin="run")
    again = resolve(
        experiment=recorded_settings("store", f"{tmp_path}#1"),
        options=["classifier.type=none"],
        flags=[
            Flag("--gripper", "gripper.type", "replay"),
            Flag("RECORDING", "gripper.recording", f"store:{tmp_path}#1"),
        ],
    )
    replayed = grasp_with(again, installed())

    assert Phase.RELEASE in grasp.trial.trace.phase
    for name in (*TICK_COLUMNS, *PAD_COLUMNS):
        original, now = getattr(grasp.trial.trace, name), getattr(replayed.trace, name)
        assert original.tobytes() == now.tobytes(), name
    assert replayed.features.values == grasp.trial.features.values
    assert replayed.outcome == grasp.trial.outcome


def test_a_recording_offers_the_rate_at_which_it_was_recorded(tmp_path: Path) -> None:
    with Store.open(tmp_path) as store:
        keep(store, ticks=1000)
    replay = ReplayBackend(ReplayConfig(recording=f"store:{tmp_path}#1"))
    rates = {channel.name: channel.rate_hz for channel in replay.channels}

    assert rates.pop("pads") == pytest.approx(24.4, rel=0.02)
    assert set(rates.values()) == {1000.0}


def test_a_kind_whose_plugin_is_not_installed_is_told_with_how_to_install_it() -> None:
    with IsolatedPlugins():
        told = refused("replay", "lerobot:FOLDER#1")
    assert all(word in told for word in ("graspsense-lerobot", "not installed", "pip install"))
    assert "store.sqlite" not in told
