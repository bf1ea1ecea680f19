"""MAT files: our reader against that of scipy, on what scipy writes."""

import struct
from contextlib import nullcontext

import numpy as np
import pytest
import scipy
from cases import every_case

from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.sources.formats.mat_file import mat_variables

VARIABLES = {
    "matrix": np.arange(6.0).reshape(2, 3),
    "images": np.arange(24.0).reshape(2, 3, 4),
    "single": np.float32([1.5, 2.5, -3.5]),
    "small": np.int8([1, -2]),
    "large": np.uint64([2**63]),
    "negative": np.int64([[-5]]),
    "logical": np.array([True, False]),
    "text": "glass:f\u00fcll",
    "nothing": np.zeros((0, 3)),
    "one": 3.0,
    "long": np.arange(5000) % 7,
    "a_name_that_is_longer_than_eight": 1.0,
}
OTHERS = {"waves": np.array([1j])}
TRIALS = np.array(
    [({"force": np.arange(3.0)}, "jar"), ({"force": np.arange(4.0)}, "can")],
    dtype=[("pads", "O"), ("what", "O")],
)
PARTS = {
    "grasp": {"gap": np.arange(5.0), "pads": {"left": np.arange(5.0), "note": ""}},
    "cells": np.array([[np.arange(2.0), "a"]], dtype=object),
    "trials": TRIALS,
}


def assert_same(content, expected):
    assert list(content) == list(expected)
    for name, array in expected.items():
        assert content[name].shape == array.shape
        assert content[name].dtype.kind == array.dtype.kind
        assert (content[name] == array).all()


@pytest.mark.parametrize("compressed", [False, True])
def test_numbers_and_texts_are_what_scipy_reads_and_the_rest_is_left_out(compressed, tmp_path):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, VARIABLES | OTHERS, do_compression=compressed)
    expected = {name: value for name, value in scipy.io.loadmat(path).items() if name in VARIABLES}
    assert len(expected) == len(VARIABLES)
    assert_same(mat_variables(path), expected)


@every_case(
    ("content", "says"),
    [
        (b"", "header"),
        (b"no such file at all".ljust(200), "header"),
        (b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM", "-v7"),
        (b"MATLAB 5.0".ljust(124) + b"\x00\x01IM" + struct.pack("<II", 14, 2**31), "behind"),
    ],
)
def test_what_is_no_mat_file_is_refused(content, says, tmp_path):
    path = tmp_path / "a.mat"
    with pytest.raises(ConfigError, match="no file"):
        mat_variables(path)
    path.write_bytes(content)
    with pytest.raises(DataDamaged, match=says):
        mat_variables(path)
    deep = 1.0
    for _ in range(12):
        deep = {"x": deep}
    scipy.io.savemat(path, {"deep": deep})
    with pytest.raises(DataDamaged, match="nested"):
        mat_variables(path)


@pytest.mark.parametrize("compressed", [False, True])
def test_the_parts_of_structures_and_cells_have_paths(compressed, tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", PARTS, do_compression=compressed)
    read = mat_variables(tmp_path / "a.mat")
    assert {path: array.ravel().tolist() for path, array in read.items()} == {
        "grasp/gap": [0.0, 1.0, 2.0, 3.0, 4.0],
        "grasp/pads/left": [0.0, 1.0, 2.0, 3.0, 4.0],
        "cells/1": [0.0, 1.0],
        "cells/2": ["a"],
        "trials/1/pads/force": [0.0, 1.0, 2.0],
        "trials/1/what": ["jar"],
        "trials/2/pads/force": [0.0, 1.0, 2.0, 3.0],
        "trials/2/what": ["can"],
    }


def test_what_matlab_keeps_without_a_name_is_left_out(tmp_path):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"x": np.uint8([1, 2]), "gap": np.arange(3.0)})
    path.write_bytes(path.read_bytes().replace(b"\1\0\1\0x\0\0\0", b"\1\0\0\0\0\0\0\0"))
    assert list(mat_variables(path)) == ["gap"]


def test_a_stream_without_its_end_is_read_if_its_numbers_are_there(tmp_path):
    """As MATLAB writes what fills pieces of 64 KiB."""
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"force": np.arange(8185.0)}, do_compression=True)
    head, packed = path.read_bytes()[:128], path.read_bytes()[136:]
    for lost, error in ((4, None), (2000, DataDamaged)):
        part = packed[:-lost]
        path.write_bytes(head + struct.pack("<II", 15, len(part)) + part)
        with pytest.raises(error) if error else nullcontext():
            assert mat_variables(path)["force"][0, -1] == 8184.0


def test_version_4(tmp_path):
    path = tmp_path / "a.mat"
    scipy.io.savemat(
        path, {name: VARIABLES[name] for name in ("matrix", "single", "one")} | {"text": "jar"}, format="4"
    )
    expected = {name: value for name, value in scipy.io.loadmat(path).items() if not name.startswith("__")}
    assert_same(mat_variables(path), expected)
    data = path.read_bytes()
    with path.open("ab") as file:
        file.write(data[:30])
    with pytest.raises(DataDamaged, match=r"a\.mat"):
        mat_variables(path)


def test_the_other_order_of_bytes(tmp_path):
    def element(kind, data):
        return struct.pack(">II", kind, len(data)) + data + bytes(-len(data) % 8)

    body = element(6, struct.pack(">II", 6, 0)) + element(5, struct.pack(">ii", 2, 1)) + element(1, b"t")
    body += element(9, struct.pack(">dd", 1.5, -2.0))
    path = tmp_path / "a.mat"
    path.write_bytes(b"MATLAB 5.0".ljust(124) + struct.pack(">H", 0x0100) + b"MI" + element(14, body))
    assert mat_variables(path)["t"].tolist() == [[1.5], [-2.0]]


def test_a_shape_without_its_numbers_allocates_nothing(tmp_path):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"t": np.arange(7.0)})
    data = path.read_bytes()
    position = data.index(struct.pack("<ii", 1, 7))
    for shape in ((2**31 - 1, 2**31 - 1), (-1, -7), (0, 7)):
        path.write_bytes(data[:position] + struct.pack("<ii", *shape) + data[position + 8 :])
        with pytest.raises(DataDamaged, match="shape"):
            mat_variables(path)
