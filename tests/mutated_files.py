"""Changes of files that their format still allows: records framed anew, members packed anew, other cells and tokens.

A change of random bytes ends at the first checksum. These get behind it, to what a reader makes of the content.
"""

from __future__ import annotations

import io
import json
import random
import re
import resource
import signal
import sqlite3
import struct
import warnings
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import numpy as np
import zstandard

HOSTILE_NUMBERS = (0, 1, -1, 2, 99, 100, 255, 65535, 2**31 - 1, 2**32 - 1, 2**53, 2**63 - 1, -(2**63))
HOSTILE_FLOATS = (0.0, -0.0, float("nan"), float("inf"), float("-inf"), 1e308, -1e308, 5e-324, 1e18, -1.0)
HOSTILE_WORDS = (
    *'"\'\\[]{}()=,;#%*?./~|@:<>-+ \t\r\n\v\f\0',
    "\ufeff", "\u2028", "\udcff", "é", "٣", "nan", "inf", "-inf", "1e400", "1e308", "-1e308", "5e-324", "-0", "1_0",
    "1,5", "9223372036854775808", "-9223372036854775809", "9" * 5000, "0x" + "f" * 3000, "1e99999", "0", "-1", "1e9",
    "true", "[]", "{}", '"""', "'''", "x" * 600, "F" * 3000, "9**9**9", "F/0", "'a'*9", "first(F)", "sum('*')", "F[9]",
    "(a+)+$", "(?=a)", r"(\\w)\\1", "(?P<label>", "(?P<label>x)", "a{1000}{1000}", "((((((((a*)*)*)*)*)*)*)*)*$",
    "**/", "{label}", "{label:d}", "{label}{label}", "../..", "~nobody", "store:", "#3", "1970-01-01", "[mm]", "[N]",
    "a." * 200 + "a", "[" * 200, "{a=" * 200, "@data", "@attribute", "@attribute x {a,a}", "{0 1}", "= 1", "[[terms]]",
    "[data]", "\n\n", ",,,", "null", "NaN", "[[[[[[[[[[", "=1+cmd|' /C calc'!A0", "\x1b[2J", "/etc/passwd",
)  # fmt: skip
TOML_NUMBERS = (
    "0", "-1", "0.0", "-0.0", "1e308", "5e-324", "inf", "-inf", "nan", "9223372036854775807", "-9223372036854775808",
    "9223372036854775808", "1e9", "1000000", "0.5", "3", "1" * 4000, "0x" + "f" * 3000, "4294967296", "1.0e-300",
)  # fmt: skip
TOML_KEYS = (
    "files", "list", "folder", "start", "split", "time", "rate_hz", "gap", "force", "left", "effort", "velocity",
    "channels", "fast", "zero", "cut", "resample_hz", "duplicates", "label", "instance", "recorded", "order", "values",
    "seeds", "seed", "total", "trials", "instances", "folds", "grasps", "objects", "checkpoints_s", "type", "extends",
    "parts", "variants", "sweep", "timeout_s", "width_m", "offset_m", "share", "held", "patch", "named", "groups",
)  # fmt: skip


def bytes_of(data: bytes, rng: random.Random) -> bytes:
    """Return the bytes cut short, with some changed, a piece missing, twice there, or zeroed."""
    changed = bytearray(data)
    position = rng.randrange(max(len(changed), 1))
    length = min(rng.choice([1, 4, 64, 4096]), len(changed) - position)
    match rng.randrange(6):
        case 0:
            del changed[position:]
        case 1:
            for _ in range(rng.choice([1, 1, 4, 40])):
                if changed:
                    changed[rng.randrange(len(changed))] = rng.randrange(256)
        case 2:
            del changed[position : position + length]
        case 3:
            changed[position:position] = changed[position : position + length]
        case 4:
            changed[position : position + length] = bytes(length)
        case _:
            if changed:
                changed[position] ^= 1 << rng.randrange(8)
    return bytes(changed)


def numbers_of(data: bytes, rng: random.Random) -> bytes:
    """Return the bytes with a field of 1, 2, 4 or 8 bytes that says something else."""
    changed = bytearray(data)
    if len(changed) < 8:
        return bytes_of(data, rng)
    position = rng.randrange(len(changed) - 7)
    if rng.random() < 0.4:
        changed[position : position + 8] = struct.pack("<d", rng.choice(HOSTILE_FLOATS))
    else:
        width = rng.choice((1, 2, 4, 8))
        number = rng.choice(HOSTILE_NUMBERS) & ((1 << 8 * width) - 1)
        changed[position : position + width] = number.to_bytes(width, "little")
    return bytes(changed)


def tokens_of(text: str, rng: random.Random) -> str:
    """Return the text with a few of its words, spaces and signs in disorder."""
    tokens = re.findall(r"\w+|\s|[^\w\s]", text)
    for _ in range(rng.choice((1, 1, 2, 3, 8))):
        if not tokens:
            break
        i, j = rng.randrange(len(tokens)), rng.randrange(len(tokens))
        match rng.randrange(7):
            case 0:
                tokens[i] = rng.choice(HOSTILE_WORDS)
            case 1:
                tokens.insert(i, rng.choice(HOSTILE_WORDS))
            case 2:
                del tokens[i : i + rng.choice((1, 1, 5))]
            case 3:
                tokens[i:i] = tokens[i : i + rng.choice((1, 3, 12))]
            case 4:
                tokens[i] *= rng.choice((2, 300))
            case 5:
                tokens[i], tokens[j] = tokens[j], tokens[i]
            case _:
                tokens[i] = tokens[j]
    return "".join(tokens)


def _name(rng: random.Random) -> str:
    """Return a word that UTF-8 can write."""
    return rng.choice(HOSTILE_WORDS).encode("utf-8", "replace").decode()


def _either(data: bytes, rng: random.Random) -> bytes:
    return numbers_of(data, rng) if rng.random() < 0.7 else bytes_of(data, rng)


def any_bytes(path: Path, rng: random.Random) -> None:
    path.write_bytes(_either(path.read_bytes(), rng))


def _toml_value(rng: random.Random) -> str:
    """Return a strange value that is TOML."""
    match rng.randrange(6):
        case 0:
            return rng.choice(TOML_NUMBERS)
        case 1:
            return f"[{', '.join(rng.choices(TOML_NUMBERS, k=rng.choice((0, 1, 3, 20))))}]"
        case 2:
            return rng.choice(
                ("true", "{}", "[]", "[[]]", "1979-05-27T07:32:00", "{ a = 1 }", '["a", 1]', "[{}, {}]")
            )
        case _:
            return json.dumps(_name(rng), ensure_ascii=False)


def _value_of(text: str, rng: random.Random) -> str:
    """Return the text with a value of a key, a key, a cell or a row changed, still well formed."""
    lines = text.split("\n")
    place = rng.choice([k for k, line in enumerate(lines) if line])
    key, equals, _ = lines[place].partition(" = ")
    cells = lines[place].split(",")
    if rng.randrange(8) == 0 and len(lines[place]) < 1000:
        lines[place:place] = [lines[place]] * rng.choice((1, 400))
    elif equals and rng.randrange(6):
        lines[place] = f"{key} = {_toml_value(rng)}"
    elif equals:
        lines.insert(place, f"{rng.choice(TOML_KEYS)} = {_toml_value(rng)}")
    else:
        cells[rng.randrange(len(cells))] = re.sub(r'[,"\r\n]', "", rng.choice(HOSTILE_WORDS))
        lines[place] = ",".join(cells)
    return "\n".join(lines)


def text_of(text: str, rng: random.Random) -> bytes:
    """Return a changed text: two of three are still well formed, the others have tokens in disorder."""
    if rng.randrange(3):
        for _ in range(rng.choice((1, 1, 1, 2, 4))):
            text = _value_of(text, rng)
        return text.encode("utf-8", "surrogateescape")
    data = tokens_of(text, rng).encode("utf-8", "surrogateescape")
    match rng.randrange(12):
        case 0:
            data = data[: rng.randrange(len(data) + 1)]
        case 1:
            data = b"\xef\xbb\xbf" + data
        case 2:
            data = data.decode("utf-8", "replace").encode("utf-16")
        case 3:
            data = data.replace(b"\n", b"\r\n")
    return data


def text_file(path: Path, rng: random.Random) -> None:
    data = path.read_bytes()
    path.write_bytes(bytes_of(data, rng) if rng.random() < 0.2 else text_of(data.decode(), rng))


def npy_file(path: Path, rng: random.Random) -> None:
    path.write_bytes(_npy(path.read_bytes(), rng))


def _npy(data: bytes, rng: random.Random) -> bytes:
    """Return an array with another header of the right length, other numbers, or a part missing."""
    if not data.startswith(b"\x93NUMPY") or rng.random() < 0.2:
        return _either(data, rng)
    (length,) = struct.unpack_from("<H", data, 8)
    header, body = data[10 : 10 + length].decode("latin-1"), data[10 + length :]
    if rng.random() < 0.6:
        descr = rng.choice(("<f8", "|O", "<U4", "|b1", ">i2", "|V8", "<c16", "<M8[s]", "|S0", "<f2"))
        lengths = rng.choices((0, 1, 2, 4, 10, 40, 41, 160, -1, 2**31, 2**63), k=rng.randrange(5))
        header = (
            f"{{'descr': '{descr}', 'fortran_order': {rng.random() < 0.5}, 'shape': {tuple(lengths)!r}, }}"
        )
    if rng.random() < 0.4:
        header = tokens_of(header, rng)
    if rng.random() < 0.4:
        body = _either(body, rng)
    encoded = header.rstrip().encode("latin-1", "replace").ljust(117) + b"\n"
    return data[:8] + struct.pack("<H", len(encoded) & 0xFFFF) + encoded + body


def npz_file(path: Path, rng: random.Random) -> None:
    """Pack the members anew, one of them changed, missing, twice there, or with another compression."""
    with zipfile.ZipFile(path) as archive:
        members = [(name, archive.read(name)) for name in archive.namelist()]
    i = rng.randrange(len(members))
    name, content = members[i]
    kind = rng.choice((zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED))
    match rng.randrange(8):
        case 0:
            del members[i]
        case 1:
            members.append((name, content))
        case 2:
            members[i] = (_name(rng) + ".npy", content)
        case 3:
            kind = rng.choice((zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA))
        case 4 if b"{" in content[-4000:] and b"declared" in name.encode():
            members[i] = (name, _npy(content, rng))
        case _:
            members[i] = (name, _npy(content, rng))
    with suppress(UserWarning), zipfile.ZipFile(path, "w", kind) as archive:
        for member, data in members:
            archive.writestr(zipfile.ZipInfo(member), data, kind)
    if rng.random() < 0.15:
        any_bytes(path, rng)


_MAGIC = b"\x89MCAP0\r\n"


def _records(data: bytes) -> list[tuple[int, bytes]]:
    records, offset = [], 0
    while offset + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, offset)
        records.append((opcode, data[offset + 9 : offset + 9 + length]))
        offset += 9 + length
    return records


def _framed(records: list[tuple[int, bytes]]) -> bytes:
    return b"".join(struct.pack("<BQ", opcode, len(body)) + body for opcode, body in records)


def mcap_file(path: Path, rng: random.Random) -> None:
    """Change a record, in a chunk or outside, and frame all of them anew with right sizes and checksums."""
    changed = []
    records = _records(path.read_bytes()[len(_MAGIC) : -len(_MAGIC)])
    summary = next((i for i, (opcode, _) in enumerate(records) if opcode == 15), len(records))
    records = records[:summary]
    chunks = [i for i, (opcode, _) in enumerate(records) if opcode == 6]
    chosen = rng.choice(chunks) if chunks and rng.random() < 0.6 else rng.randrange(len(records))
    for i, (opcode, body) in enumerate(records):
        if i != chosen:
            changed.append((opcode, body))
        elif opcode == 6:
            changed.append((opcode, _chunk(body, rng)))
        else:
            changed += _mutated_records([(opcode, body)], rng)
    end = [(15, bytes(4)), (2, bytes(20))]
    path.write_bytes(_MAGIC + _framed([*changed, *end]) + _MAGIC)
    if rng.random() < 0.1:
        any_bytes(path, rng)


def _chunk(body: bytes, rng: random.Random) -> bytes:
    begin, end, _, _, name_length = struct.unpack_from("<QQQII", body)
    name = body[32 : 32 + name_length].decode()
    packed = body[40 + name_length :]
    inner = zstandard.decompress(packed) if name == "zstd" else packed
    if name not in ("", "zstd"):
        return _either(body, rng)
    records = _mutated_records(_records(inner), rng)
    data = _framed(records)
    name = rng.choice(("zstd", "zstd", "", "lz4", "brotli")) if rng.random() < 0.2 else "zstd"
    packed = zstandard.compress(data) if name == "zstd" else data
    size = rng.choice(HOSTILE_NUMBERS) & (2**64 - 1) if rng.random() < 0.1 else len(data)
    head = struct.pack("<QQQII", begin, end, size, zlib.crc32(data), len(name)) + name.encode()
    return head + struct.pack("<Q", len(packed)) + packed


def _mutated_records(records: list[tuple[int, bytes]], rng: random.Random) -> list[tuple[int, bytes]]:
    records = list(records)
    i, j = rng.randrange(len(records)), rng.randrange(len(records))
    opcode, body = records[i]
    match rng.randrange(8):
        case 0:
            del records[i]
        case 1:
            records.insert(j, records[i])
        case 2:
            records[i], records[j] = records[j], records[i]
        case 3:
            records[i] = (rng.choice((0, 1, 3, 4, 5, 6, 9, 12, 128)), body)
        case 4 | 5 if opcode == 12:
            records[i] = (opcode, _metadata(body, rng))
        case _:
            records[i] = (opcode, _either(body, rng))
    return records


def _metadata(body: bytes, rng: random.Random) -> bytes:
    """Return a record of metadata one of whose texts has other tokens, or is JSON with another value."""
    texts, offset = [], 0
    (length,) = struct.unpack_from("<I", body, offset)
    name, offset = body[4 : 4 + length], 4 + length + 4
    while offset < len(body):
        (length,) = struct.unpack_from("<I", body, offset)
        texts.append(body[offset + 4 : offset + 4 + length].decode())
        offset += 4 + length
    i = rng.randrange(1, len(texts), 2) if len(texts) > 1 else 0
    texts[i] = json_text(texts[i], rng) if rng.random() < 0.6 else tokens_of(texts[i], rng)
    encoded = [text.encode("utf-8", "replace") for text in texts]
    pairs = b"".join(struct.pack("<I", len(text)) + text for text in encoded)
    return struct.pack("<I", len(name)) + name + struct.pack("<I", len(pairs)) + pairs


def json_text(text: str, rng: random.Random) -> str:
    """Return the JSON text with another value in one place."""
    try:
        value = json.loads(text)
    except ValueError:
        return tokens_of(text, rng)
    whole = {"": value}
    holder: object = whole
    root, key = whole, ""
    while isinstance(holder, dict | list) and len(holder):
        root, key = holder, rng.choice(list(holder) if isinstance(holder, dict) else range(len(holder)))
        holder = root[key]
        if rng.random() < 0.3:
            break
    root[key] = rng.choice(
        (
            None,
            True,
            0,
            -1,
            1e308,
            10**400,
            "",
            "x",
            [],
            {},
            [[[]]],
            [None],
            {"a": 1},
            "9" * 30,
            [1, "a", None],
        )
    )
    with suppress(ValueError):
        return json.dumps(whole[""])
    return tokens_of(text, rng)


def parquet_file(path: Path, rng: random.Random) -> None:
    """Write the table anew with another column, or change bytes."""
    import pyarrow
    import pyarrow.parquet

    if rng.random() < 0.4:
        any_bytes(path, rng)
        return
    table = pyarrow.parquet.read_table(path)
    n = table.num_rows
    columns = list(table.columns)
    names = list(table.column_names)
    i = rng.randrange(len(names))
    match rng.randrange(7):
        case 0:
            names[i] = _name(rng)
        case 1:
            del names[i], columns[i]
        case 2:
            names.append(names[i])
            columns.append(columns[i])
        case 3:
            table = table.slice(0, rng.randrange(3))
            columns = list(table.columns)
        case _:
            columns[i] = rng.choice(
                (
                    pyarrow.array([rng.choice(HOSTILE_FLOATS) for _ in range(n)]),
                    pyarrow.array([rng.choice((1, None)) for _ in range(n)]),
                    pyarrow.array([[1.0] * rng.randrange(4) for _ in range(n)]),
                    pyarrow.array([[[1.0, 2.0]] * 2 for _ in range(n)]),
                    pyarrow.array([{"a": k} for k in range(n)]),
                    pyarrow.array(["1.5"] * n),
                    pyarrow.array([b"\xff\x00"] * n),
                    pyarrow.nulls(n),
                    pyarrow.array([2**63] * n, pyarrow.uint64()),
                    pyarrow.array([0] * n, pyarrow.timestamp("ns")),
                    pyarrow.array(["a", "b"][k % 2] for k in range(n)).dictionary_encode(),
                    pyarrow.array([True] * n),
                    pyarrow.array([[None]] * n, pyarrow.list_(pyarrow.float64())),
                )
            )
    pyarrow.parquet.write_table(pyarrow.Table.from_arrays(columns, names=names), path)


def sqlite_file(path: Path, rng: random.Random) -> None:
    """Change a cell, a row or bytes of a database."""
    if rng.random() < 0.2:
        any_bytes(path, rng)
        return
    with closing(sqlite3.connect(path)) as connection, suppress(sqlite3.Error):
        connection.execute("PRAGMA ignore_check_constraints = ON")
        tables = [
            name for (name,) in connection.execute("SELECT name FROM sqlite_schema WHERE type = 'table'")
        ]
        for _ in range(rng.choice((1, 1, 3))):
            table = rng.choice(tables)
            columns = [row[1] for row in connection.execute(f"PRAGMA table_info('{table}')")]
            rows = [row for (row,) in connection.execute(f"SELECT rowid FROM '{table}'")]
            if not rows:
                continue
            column, row = rng.choice(columns), rng.choice(rows)
            ((value,),) = connection.execute(f'SELECT "{column}" FROM "{table}" WHERE rowid = {row}')
            if rng.random() < 0.1:
                connection.execute(f'DELETE FROM "{table}" WHERE rowid = {row}')
                continue
            if isinstance(value, str) and rng.random() < 0.6:
                new: object = json_text(value, rng)
            elif isinstance(value, bytes) and rng.random() < 0.6:
                new = _either(value, rng)
            else:
                new = rng.choice((None, "", "x", b"\xff", 2**63 - 1, -1, 1e308, 0, "[]", "{}"))
            with suppress(sqlite3.Error, UnicodeEncodeError):
                connection.execute(f'UPDATE "{table}" SET "{column}" = ? WHERE rowid = {row}', (new,))
        connection.commit()
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")


def mat_file(path: Path, rng: random.Random) -> None:
    """Write the variables anew with another one, or change bytes, also within what is compressed."""
    from scipy.io import loadmat, savemat

    data = path.read_bytes()
    if rng.random() < 0.5:
        head, out, offset = data[:128], b"", 128
        while offset + 8 <= len(data):
            kind, size = struct.unpack_from("<II", data, offset)
            body = data[offset + 8 : offset + 8 + size]
            if kind == 15 and rng.random() < 0.5:
                with suppress(zlib.error):
                    body = zlib.compress(_either(zlib.decompress(body), rng))
            elif rng.random() < 0.3:
                body = _either(body, rng)
            out += struct.pack("<II", kind, len(body)) + body
            offset += 8 + size
        path.write_bytes(head + out)
        return
    variables = {
        name: value for name, value in loadmat(io.BytesIO(data)).items() if not name.startswith("__")
    }
    name = rng.choice(list(variables))
    variables[name] = rng.choice(
        (
            np.array([]), np.zeros((0, 5)), np.array(["a", "b"]), np.array([[1, "a"]], dtype=object), {"a": 1.0}, 1.0,
            np.full(40, np.nan), np.zeros((40, 2, 3, 4)), np.arange(40) * 1j, np.arange(40, dtype=np.uint8),
            np.zeros(39), np.full(40, 1e308),
        )
    )  # fmt: skip
    savemat(path, variables, do_compression=rng.random() < 0.5)


def bag_file(path: Path, rng: random.Random) -> None:
    """Change bytes of a ROS 1 bag."""
    data = path.read_bytes()
    for _ in range(rng.choice((1, 1, 3))):
        data = _either(data, rng)
    path.write_bytes(data)


def ros2_folder(path: Path, rng: random.Random) -> None:
    """Change the description of a ROS 2 bag, or its file."""
    (file,) = (part for part in path.iterdir() if part.suffix in (".db3", ".mcap"))
    if rng.random() < 0.3:
        text_file(path / "metadata.yaml", rng)
    elif file.suffix == ".db3":
        sqlite_file(file, rng)
    else:
        any_bytes(file, rng)


MEMORY = 1_500_000_000
"""Bytes that reading may take beside what the process has."""
WORK_S = 60.0
"""Seconds of the processor after which a reader is taken for one that does not end."""


class DoesNotEndError(BaseException):
    """A reader works longer than any file needs; not an Exception, so that no reader takes it for a damaged file."""


@contextmanager
def bounded(work_s: float = WORK_S, warned: str = "ignore") -> Iterator[None]:
    """Limit memory and work of what runs here; warnings are ignored, or `error`s."""

    def stop(number: int, frame: object) -> None:
        raise DoesNotEndError

    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    handler = signal.signal(signal.SIGVTALRM, stop)
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, hard))
    signal.setitimer(signal.ITIMER_VIRTUAL, work_s)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter(warned)
            yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, handler)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
