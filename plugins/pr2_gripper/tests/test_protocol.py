"""The codec and the document that defines it: bytes to numbers and back, and nothing wrong let through."""

import math
import random
import re
import struct
from pathlib import Path
from zlib import crc32

import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense_pr2_gripper import protocol
from graspsense_pr2_gripper.protocol import (
    InputReport,
    OutputReport,
    ProtocolError,
    decode_identity,
    decode_input,
    decode_output,
    encode_identity,
    encode_input,
    encode_output,
    limit,
    micro,
)

DOCUMENT = Path(__file__).parents[3] / "specs" / "pr2_hid.md"
U8, U16, U32 = st.integers(0, 0xFF), st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF)
I32, U64 = st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**64 - 1)

INPUTS = st.builds(
    InputReport,
    sequence=U32,
    time_us=U64,
    encoder_ticks=I32,
    velocity_mtick_s=I32,
    effort_un=I32,
    status=U16,
    echo=U16,
    samples=st.lists(U32, max_size=4).map(tuple),
    image=U16,
    slice=st.integers(0, 10),
    cells=st.tuples(U16, U16, U16, U16),
    command_result=st.integers(0, 3),
    image_age_us=U16,
)
OUTPUTS = st.builds(
    OutputReport,
    counter=U16,
    kind=st.integers(0, 1),
    effort_un=I32,
    effort_limit_un=U32,
    speed_limit_um_s=U32,
)


def tables():
    """The document's layouts: heading to (offset, type, field)."""
    layouts = {}
    heading = ""
    for line in DOCUMENT.read_text().splitlines():
        if line.startswith("## "):
            heading = line[3:]
        row = re.match(r"\| (\d+) \| ([ui]\d+)(\[\d+\])? \| (\w+) \|", line)
        if row:
            layouts.setdefault(heading, []).append((int(row[1]), row[2] + (row[3] or ""), row[4]))
    return layouts


def width(kind):
    size, _, count = kind.partition("[")
    return int(size[1:]) // 8 * int(count.rstrip("]") or 1)


TABLES = tables()
INPUT = "Report 1, input: every millisecond"
OUTPUT = "Report 2, output: a command"
FEATURE = "Report 3, feature: who the device is"


@every_case("heading", [INPUT, OUTPUT, FEATURE])
def test_document_has_no_gap_and_ends_with_the_crc_at_64_bytes(heading):
    position = 0
    for offset, kind, _ in TABLES[heading]:
        assert offset == position
        position += width(kind)
    assert TABLES[heading][0][2] == "report_id"
    assert TABLES[heading][-1][1:] == ("u32", "crc")
    assert position == protocol.REPORT_SIZE


def value_at(data, heading, field):
    offset, kind, _ = next(row for row in TABLES[heading] if row[2] == field)
    size, _, count = kind.partition("[")
    code = {"u8": "B", "u16": "H", "u32": "I", "u64": "Q", "i32": "i"}[size]
    values = struct.unpack_from(f"<{int(count.rstrip(']') or 1)}{code}", data, offset)
    return values if count else values[0]


def assert_placed(data, heading, fields):
    """Assert that these values lie where the document says, with their checksum behind them."""
    assert {field: value_at(data, heading, field) for field in fields} == fields
    assert value_at(data, heading, "crc") == crc32(data[:60])


@given(INPUTS)
def test_input_fields_lie_where_the_document_says(report):
    data, fields = encode_input(report), report._asdict()
    samples = fields.pop("samples")
    assert_placed(data, INPUT, fields | {"sample_count": len(samples)})
    assert value_at(data, INPUT, "samples")[: len(samples)] == samples
    assert decode_input(data) == report


@given(OUTPUTS)
def test_output_fields_lie_where_the_document_says(report):
    data = encode_output(report)
    assert_placed(data, OUTPUT, report._asdict())
    assert decode_output(data) == report


def test_feature_fields_lie_where_the_document_says(device_identity):
    identity = device_identity()
    data = encode_identity(identity)
    texts = {"magic": tuple(b"GSPR"), "serial": tuple(b"L7".ljust(16, b"\0"))}
    assert_placed(data, FEATURE, identity._asdict() | texts | {"protocol": 1, "transmission": 0})
    assert decode_identity(data) == identity


@every_case("name", ["pr2", "pr2_2009", "pr2_paper"])
def test_document_numbers_the_transmissions_as_the_codec_does(name, device_identity):
    number = protocol.TRANSMISSIONS.index(name)
    assert f"{number} {name}" in DOCUMENT.read_text()
    assert decode_identity(encode_identity(device_identity(transmission=name))).transmission == name


def test_document_numbers_bits_results_and_kinds_as_the_codec_does():
    text = DOCUMENT.read_text()
    bits, results = (
        re.search(rf"\| {what} .*?\n\n", text, re.S)[0] for what in ("status bit", "command result")
    )
    declared = {name: 1 << int(bit) for bit, name in re.findall(r"\| (\d+) \| (\w+) \|", bits)}
    assert declared == {name: getattr(protocol, name.upper()) for name in declared}
    assert len(declared) == 6
    numbers = [name for _, name in sorted(re.findall(r"\| (\d) \| (\w+) \|", results))]
    assert numbers == ["none", "accepted", "clamped", "refused"]
    codes = (protocol.NO_COMMAND, protocol.ACCEPTED, protocol.CLAMPED, protocol.REFUSED)
    assert codes == (0, 1, 2, 3)
    assert "0 let go, 1 effort" in text
    assert (protocol.RELEASE_KIND, protocol.EFFORT_KIND) == (0, 1)


def test_documents_report_descriptor_is_the_codecs_and_declares_63_byte_reports():
    block = DOCUMENT.read_text().split("## Report descriptor")[1]
    descriptor = bytes.fromhex("".join(re.findall(r"\b[0-9A-F]{2}\b", block)))
    assert descriptor == protocol.REPORT_DESCRIPTOR
    # Items are a prefix byte (size in its two lowest bits) and their data; 0x94 is the report count, 0x84 the id.
    items, left = [], descriptor
    while left:
        size = (0, 1, 2, 4)[left[0] & 3]
        items.append((left[0] & 0xFC, int.from_bytes(left[1 : 1 + size], "little")))
        left = left[1 + size :]
    assert [data for tag, data in items if tag == 0x84] == [1, 2, 3]
    assert [data for tag, data in items if tag == 0x94] == [63, 63, 63]
    assert items[0] == (0x04, 0xFF00)


@every_case("value", [math.nan, math.inf, -math.inf, 3000.0])
def test_what_no_report_can_hold_is_refused_before_it_is_sent(value):
    with pytest.raises(ProtocolError):
        micro(value)


def test_limits_are_rounded_down_and_infinity_is_the_devices_own():
    assert limit(math.inf) == limit(1e9) == protocol.OWN_LIMIT
    assert limit(0.0109999999) == 10_999
    for wrong in (math.nan, -1.0):
        with pytest.raises(ProtocolError):
            limit(wrong)


@every_case(
    ("what", "value"),
    [
        *(("serial", value) for value in ("", "x" * 17, "é")),
        ("transmission", "worm"),
        *((number, 0) for number in ("report_rate_hz", "encoder_ticks_rev", "pad_counts_per_n")),
    ],
)
def test_identity_that_means_nothing_is_refused(what, value, device_identity):
    with pytest.raises(ProtocolError, match=what):
        encode_identity(device_identity(**{what: value}))


@every_case(("start", "bad", "said"), [(5, b"\2", "version 2.*version 1"), (1, b"ABCD", "b'ABCD'")])
def test_another_protocol_says_which(start, bad, said, device_identity):
    body = bytearray(encode_identity(device_identity())[:60])
    body[start : start + len(bad)] = bad
    with pytest.raises(ProtocolError, match=said):
        decode_identity(bytes(body) + struct.pack("<I", crc32(body)))


def mutated(chance, good):
    kind = chance.randrange(6)
    data = bytearray(good)
    if kind == 0:
        return chance.randbytes(chance.randrange(130))
    if kind == 1:
        return chance.randbytes(64)
    if kind == 2:
        for _ in range(chance.randrange(1, 9)):
            data[chance.randrange(64)] = chance.randrange(256)
    elif kind == 3:
        data[chance.randrange(64)] ^= 1 << chance.randrange(8)
    elif kind == 4:
        return bytes(data[: chance.randrange(65)]) + chance.randbytes(chance.randrange(3))
    else:
        # Right CRC over nonsense: only the ranges are left to object.
        start = chance.randrange(1, 60)
        data[start:60] = chance.randbytes(60 - start)
        data[60:] = struct.pack("<I", crc32(data[:60]))
    return bytes(data)


@pytest.mark.parametrize(("count", "seed"), [(20_000, 7), pytest.param(1_000_000, 8, marks=pytest.mark.long)])
def test_random_and_mutated_reports_are_refused_unless_they_are_whole(count, seed, device_identity):
    chance = random.Random(seed)
    accepted = refused = 0
    good = {
        decode_input: encode_input(InputReport(7, 8, 9, 10, 11, 0, 1, (5,), 3, 2, (1, 2, 3, 4), 1, 6)),
        decode_output: encode_output(OutputReport(3, 1, -20_000_000, 100, 200)),
        decode_identity: encode_identity(device_identity()),
    }
    for _ in range(count):
        decode = chance.choice(list(good))
        data = mutated(chance, good[decode])
        try:
            decode(data)
        except ProtocolError:
            refused += 1
            continue
        accepted += 1
        assert len(data) == 64
        assert crc32(data[:60]) == int.from_bytes(data[60:], "little")
    assert accepted > count / 200, "else nothing with a right CRC was tried"
    assert refused > count / 2
