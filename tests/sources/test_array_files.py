"""Files of named arrays: which arrays belong to a grasp, what the axes of a solid array mean, and HDF5."""

import os
import subprocess
import sys

import h5py
import numpy as np
import pytest
import scipy
from cases import every_case
from commands import printed

from graspsense.core.values.errors import ConfigError, DataDamaged, TooLarge
from graspsense.recording.labelled_recording import UnreadableRecording
from graspsense.sources.formats.hdf5_file import hdf5_arrays
from graspsense.sources.manifest.reader import read_recordings
from graspsense.sources.trial_source import load_trials

N = 120
T_S = np.arange(N) * 0.01
GAP = np.where(T_S < 0.6, 0.08 - 0.05 * T_S, 0.05)
FORCE = np.maximum(0.0, T_S - 0.6) * 5.0


def recordings(folder, text):
    (folder / "m.toml").write_text(text)
    return list(read_recordings(str(folder / "m.toml")))


def peaks(recordings):
    return [
        max(reading.frame.force_left_n for reading in recording.recording.readings)
        for recording in recordings
    ]


def solid(grasps=3):
    return np.stack([np.column_stack([T_S, GAP, (k + 1) * FORCE]) for k in range(grasps)])


COLUMNS = 'time = "c1"\ngap = "c2"\nforce = "c3"\n'
SAVE = {"npz": lambda path, arrays: np.savez(path, **arrays), "mat": scipy.io.savemat}


@pytest.mark.slow
@every_case("ending", ["npy", "npz", "mat", "h5"])
def test_an_array_of_three_dimensions_is_read_alike_in_every_file_and_asked_about(ending, tmp_path):
    path = tmp_path / f"jar.{ending}"
    if ending == "npy":
        np.save(path, solid())
    elif ending == "h5":
        with h5py.File(path, "w") as file:
            file["data"] = solid()
    else:
        SAVE[ending](path, {"data": solid()} | ({"kind": np.array([3, 4, 5])} if ending == "npz" else {}))
    text = f'files = "{{label}}.{ending}"\norder = "{{part}}"\n{COLUMNS}'
    grasps = recordings(tmp_path, text)
    assert peaks(grasps) == pytest.approx([FORCE.max() * k for k in (1, 2, 3)])
    assert [recording.order for recording in grasps] == [0, 1, 2]
    assert all(any("axes" in notice for notice in recording.notices) for recording in grasps)
    confirmed = recordings(tmp_path, text + 'axes = "grasp, time, column"\n')
    assert peaks(confirmed) == peaks(grasps)
    assert not any("axes" in notice for recording in confirmed for notice in recording.notices)
    if ending == "npz":
        numbered = recordings(
            tmp_path, text.replace("{label}", "jar") + 'label = "kind{kind}"\naxes = "grasp, time, column"'
        )
        assert [recording.label for recording in numbered] == ["kind3", "kind4", "kind5"]


def test_the_order_of_the_axes_is_that_of_the_manifest(tmp_path):
    np.save(tmp_path / "jar.npy", np.transpose(solid(), (2, 0, 1)))
    grasps = recordings(tmp_path, f'files = "{{label}}.npy"\naxes = "column, grasp, time"\n{COLUMNS}')
    assert peaks(grasps) == pytest.approx([FORCE.max() * k for k in (1, 2, 3)])
    images = np.random.default_rng(0).normal(size=(4, 5, N))
    np.savez(tmp_path / "cup.npz", gap=GAP, force=FORCE, palm=images)
    text = 'files = "{label}.npz"\nrate_hz = 100\ngap = "gap"\nforce = "force"\nchannels = { palm = "palm [counts]" }\n'
    for given in (text, text + 'axes = "row, column, time"\n'):
        (recording,) = recordings(tmp_path, given)
        assert (recording.recording.channels[0].rows, recording.recording.channels[0].columns) == (4, 5)
        assert recording.recording.readings[7].signals.palm.cells == pytest.approx(
            images[:, :, 7].reshape(-1)
        )
    with pytest.raises(ConfigError, match=r"m\.toml:6: axes: 'time, width, column'"):
        recordings(tmp_path, text + 'axes = "time, width, column"\n')


@every_case("ending", ["mat", "npz"])
def test_named_arrays_are_told_apart_by_a_pattern(ending, tmp_path):
    names = [(label, k) for label in ("jar", "tin_can") for k in range(1, 12)]
    parts = {f"{label}_{k}_gap": GAP for label, k in names}
    parts |= {f"{label}_{k}_force": k * FORCE / 10.0 for label, k in names}
    SAVE[ending](tmp_path / f"all.{ending}", {**parts, "t": T_S})
    text = f'files = "all.{ending}"\narrays = "{{label}}_{{order:d}}_{{column}}"\n'
    text += 'time = "t"\ngap = "gap"\nforce = "force"\n'
    grasps = sorted(recordings(tmp_path, text), key=lambda recording: (recording.label, recording.order))
    assert [(recording.label, recording.order) for recording in grasps] == names
    assert peaks(grasps) == pytest.approx([k * FORCE.max() / 10.0 for _, k in names])
    (refused,) = recordings(tmp_path, text.replace("{label}_", "grasp_{label}_"))
    assert isinstance(refused, UnreadableRecording)
    assert "arrays" in str(refused.error)


def test_a_mat_file_of_version_7_3_is_read_in_the_axes_of_matlab(tmp_path):
    with h5py.File(tmp_path / "jar.mat", "w", userblock_size=512) as file:
        for name, values in {"gap": GAP[None], "data": solid()[1]}.items():
            file.create_dataset(name, data=values.T).attrs["MATLAB_class"] = np.bytes_("double")
        file.create_dataset("kind", data=np.array([[106], [97]], dtype=np.uint16)).attrs["MATLAB_class"] = (
            np.bytes_("char")
        )
    with (tmp_path / "jar.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    grasps = recordings(
        tmp_path, 'files = "*.mat"\nlabel = "{kind}"\nrate_hz = 100\ngap = "gap"\nforce = "data[2]"\n'
    )
    assert [recording.label for recording in grasps] == ["ja"]
    assert peaks(grasps) == pytest.approx([2 * FORCE.max()])


def test_nothing_outside_of_an_hdf5_file_is_read(tmp_path):
    np.ones(100).tofile(tmp_path / "secret.bin")
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["secret"] = np.ones(100)
    layout = h5py.VirtualLayout((100,), dtype="f8")
    layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "secret", (100,))
    path = tmp_path / "jar.h5"
    with h5py.File(path, "w") as file:
        file["gap"] = GAP
        file["away"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "secret")
        file["loop"] = h5py.SoftLink("/")
        file["around"] = file["/"]
        file.create_virtual_dataset("virtual", layout)
        file.create_dataset("outside", (100,), "f8", external=[(str(tmp_path / "secret.bin"), 0, 800)])
    assert list(hdf5_arrays(path)) == ["gap"]


@pytest.mark.slow
def test_a_damaged_or_large_hdf5_file_is_told_by_its_name(tmp_path, monkeypatch):
    path = tmp_path / "jar.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("gap", data=np.zeros(300_000), compression="gzip")
    monkeypatch.setenv("GRASPSENSE_MAX_UNPACKED_MB", "1")
    with pytest.raises(TooLarge, match=r"jar\.h5"):
        hdf5_arrays(path)
    monkeypatch.delenv("GRASPSENSE_MAX_UNPACKED_MB")
    whole = path.read_bytes()
    for damaged in (whole[: len(whole) // 2], b"\x89HDF\r\n\x1a\n" + os.urandom(500)):
        path.write_bytes(damaged)
        with pytest.raises(DataDamaged, match=r"jar\.h5"):
            hdf5_arrays(path)


def test_a_reader_that_is_killed_by_a_file_is_an_error_of_the_file(tmp_path, monkeypatch):
    path, run = tmp_path / "jar.h5", subprocess.run
    path.write_bytes(b"")
    killed = [sys.executable, "-c", "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"]
    monkeypatch.setattr(subprocess, "run", lambda command, **given: run(killed, **given))
    with pytest.raises(DataDamaged, match=r"jar\.h5.*-9"):
        hdf5_arrays(path)


def nominal_gaps(folder, gaps, begin=0, offset_n=0.0):
    """Write four grasps of each of two labels with a constant gap; return their manifest."""
    for label, gap in zip("ab", gaps, strict=True):
        data = solid(4)[:, begin:, [0, 2]] + (label == "b") * np.array([0.0, offset_n])
        np.savez(folder / f"{label}.npz", data=data, nominal=np.full(data.shape[:2], gap))
    text = 'files = "{label}.npz"\naxes = "grasp, time, column"\ntime = "data[0]"\ngap = "nominal"\nforce = "data[1]"\n'
    (folder / "m.toml").write_text(text)
    return folder / "m.toml"


def assert_no_width(trials):
    assert len(trials) == 8
    assert trials.width is None
    assert "no width" in trials.no_width


@every_case("gaps", [(0.06, 0.06), (0.05, 0.06)])
def test_a_gap_that_does_not_change_is_no_width(gaps, tmp_path):
    assert_no_width(load_trials(f"manifest:{nominal_gaps(tmp_path, gaps, offset_n=0.01)}"))


@pytest.mark.parametrize("begin_s", [pytest.param(0.0, marks=pytest.mark.slow), 0.3])
def test_a_store_of_recordings_with_a_constant_gap_has_no_width(begin_s, tmp_path):
    """Also where the approach is too short for features from before the contact (from 0.3 s on)."""
    place = nominal_gaps(tmp_path, (0.05, 0.06), begin=int(np.searchsorted(T_S, begin_s)))
    assert "of their beginning" not in printed("import", place, "--save", tmp_path / "store")
    assert_no_width(load_trials(f"store:{tmp_path / 'store'}"))


def test_groups_of_hdf5_are_grasps_and_the_attribute_units_is_the_unit_of_an_array(tmp_path):
    """Times in ms, gaps in mm and forces in mN, in the groups of two grasps."""
    columns = {"t": (T_S * 1e3, "ms"), "pose/gap": (GAP * 1e3, b"millimeter"), "F": (FORCE * 1e3, "mN")}
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for k in (1, 2):
            for name, (values, unit) in columns.items():
                scaled = values * (k if name == "F" else 1)
                file.create_dataset(f"trials/jar_{k}/{name}", data=scaled, compression="gzip").attrs[
                    "units"
                ] = unit
            file[f"trials/jar_{k}/who"] = "Ann"
    text = 'files = "a.h5"\narrays = "trials/{label}_{order:d}/**/{column}"\ninstance = "{who}"\n'
    grasps = recordings(tmp_path, text + 'time = "t"\ngap = "gap"\nforce = "F"\n')
    assert peaks(grasps) == pytest.approx([FORCE.max(), 2.0 * FORCE.max()])
    last = grasps[0].recording.readings[-1].frame
    assert (last.t_s, last.gap_m) == pytest.approx((1.19, 0.05))
    assert [(grasp.label, grasp.instance) for grasp in grasps] == [("jar", "Ann")] * 2


# 60000 is stored as -5536 in 16 bits with a sign; so is the largest valid number, and the filling 65535 as -1.
UNSIGNED = np.array([0, 40000, 60000, 60001, 65535], dtype="u2").view("i2")


@pytest.mark.slow
@every_case(
    ("stored", "attributes", "expected"),
    [
        # Steps of 0.01 above -5, as whole numbers.
        (
            np.int16([500, 501, 812]),
            {"scale_factor": np.array([0.01]), "add_offset": -5.0},
            [0.0, 0.01, 3.12],
        ),
        ([0.5, -1.0, 0.7], {"_FillValue": np.array([-1.0])}, [0.5, np.nan, 0.7]),
        (
            UNSIGNED,
            {
                "_Unsigned": "true",
                "_FillValue": np.int16(-1),
                "valid_max": np.int16(-5536),
                "scale_factor": 0.001,
            },
            [0.0, 40.0, 60.0, np.nan, np.nan],
        ),
        ([-9.0, 0.0, 0.05, 9.0], {"valid_range": np.array([0.0, 0.1])}, [np.nan, 0.0, 0.05, np.nan]),
        (np.int16([-5, 3]), {"_Unsigned": "false", "valid_min": np.int16(0)}, [np.nan, 3.0]),
    ],
)
def test_numbers_of_netcdf_are_unpacked_and_invalid_ones_are_missing(tmp_path, stored, attributes, expected):
    with h5py.File(tmp_path / "a.nc", "w") as file:
        file.create_dataset("F", data=np.asarray(stored)).attrs.update(attributes)
    assert hdf5_arrays(tmp_path / "a.nc")["F"] == pytest.approx(expected, nan_ok=True)
