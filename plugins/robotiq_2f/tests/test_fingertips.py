"""The protocol of the TSF-85 fingertips, and their emulator."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from graspsense_robotiq_2f.emulator import fingertips
from graspsense_robotiq_2f.emulator.fingertips import COUNTS_PER_N, Felt, Fingertips
from graspsense_robotiq_2f.tactile_protocol import (
    CELLS,
    DYNAMIC,
    PRESSURE,
    READ,
    TIMESTAMP,
    Field,
    Packets,
    decoded,
    encoded,
    packet,
)

CELL = st.integers(0, 0xFFFF)


@given(
    st.lists(CELL, min_size=CELLS, max_size=CELLS),
    st.integers(-32768, 32767),
    st.integers(0, 2**64 - 1),
    st.integers(0, 1),
)
def test_what_is_encoded_is_decoded(cells, change, stamp, finger):
    fields = [
        Field(TIMESTAMP, finger, (stamp,)),
        Field(PRESSURE, finger, tuple(cells)),
        Field(DYNAMIC, finger, (change,)),
    ]
    [(command, data)] = Packets().fed(encoded(fields))
    assert command == READ
    assert decoded(data) == fields


@given(st.binary(max_size=300), st.integers(1, 40))
def test_any_bytes_in_any_pieces_are_taken(data, size):
    whole, pieces = Packets(), Packets()
    expected = whole.fed(data)
    assert [
        one for start in range(0, len(data), size) for one in pieces.fed(data[start : start + size])
    ] == expected
    for _, fields in expected:
        decoded(fields)


def test_a_field_that_is_cut_or_unknown_makes_a_packet_damaged():
    assert decoded(bytes((PRESSURE,)) + bytes(2 * CELLS - 1)) is None
    assert decoded(b"\x00\x00") is None


@pytest.fixture
def clock(monkeypatch):
    clock = SimpleNamespace(now_s=0.0)
    monkeypatch.setattr(fingertips, "time", SimpleNamespace(monotonic=lambda: clock.now_s))
    return clock


def test_every_period_has_one_packet_and_images_come_at_60_hz(clock):
    tips = Fingertips(lambda: Felt(2.0, 4.0))
    tips.heard(packet(0x58, bytes((1,))))
    packets = Packets()
    found = []
    for tick in range(1, 401):
        clock.now_s = tick * 0.0025
        found += [decoded(data) for _, data in packets.fed(tips.unasked())]
    stamps = [fields[0].values[0] for fields in found]
    assert {later - earlier for earlier, later in pairwise(stamps)} == {1000}
    assert 1000 <= len(stamps) <= 1001
    images = [field for fields in found for field in fields if field.kind == PRESSURE]
    # A packet each millisecond: the image of 16.7 ms is in that of 17 ms.
    assert 58 <= len(images) / 2 <= 61
    for image in images:
        force_n = (2.0, 4.0)[image.finger]
        assert sum(image.values) == pytest.approx(force_n * COUNTS_PER_N, abs=CELLS / 2)


def test_they_are_silent_until_asked_and_after_a_period_of_zero(clock):
    tips = Fingertips(lambda: Felt(0.0, 0.0))
    clock.now_s = 1.0
    assert tips.unasked() == b""
    [(command, _)] = Packets().fed(tips.heard(packet(READ)))
    assert command == READ
    tips.heard(packet(0x58, bytes((5,))) + packet(0x58, bytes((0,))))
    clock.now_s = 2.0
    assert tips.unasked() == b""
