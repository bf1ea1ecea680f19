"""The text of a file: unpacked, of a spreadsheet, and in whichever encoding its bytes show."""

from __future__ import annotations

import json
import re
import unicodedata
from itertools import compress, count
from operator import ne
from pathlib import Path
from typing import Final

from graspsense.core.values.errors import DataDamaged, listed
from graspsense.core.values.limits import TEXT_BYTES
from graspsense.recording.readable import readable, refuse_devices
from graspsense.recording.unpacked import Unpacked
from graspsense.sources.formats.spreadsheet import spreadsheet_text

_UNSEEN: Final = re.compile(
    "\u00ef\u00bb\u00bf|[\u061c\u200b\u200e\u200f\u202a-\u202e\u2060\u2066-\u2069\ufeff]"
)
"""Marks that nothing shows: of writing, and the order of bytes, also in joined files, or taken for three letters."""
_SPREADSHEETS: Final = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")
"""The first bytes of a ZIP file, as which spreadsheets are saved, and of those of old programs."""
_BINARY: Final = (*_SPREADSHEETS, b"PAR1", b"ARROW1")
"""The same with those of Apache's tables."""
_CODE_PAGES: Final = (
    "cp1252", "cp1250", "iso8859-1", "iso8859-15", "cp1251", "koi8-r", "cp1253", "cp1254", "cp1255", "cp1256", "cp850",
    "mac-roman", "shift_jis", "gb18030", "big5", "euc-kr",
)  # fmt: skip
_OF_EUROPE: Final = 4
"""The first ones agree on degrees, micro and the letters of several languages."""
_SHOWN_BYTES: Final = 60
_ZEROS: Final = 10
"""One byte of so many is zero, at every second place only, in UTF-16 of a table."""
_SAMPLED_BYTES: Final = 100_000
"""Bytes from which the encoding is found."""


def text_of(path: Path, start: str = "") -> str:
    """Return the text of a file, unpacked if it is compressed by gzip; `start` is that of `read_text`.

    Raises PluginUnavailable, ConfigError if it cannot be read, TooLarge, and DataDamaged if it is not text.
    """
    refuse_devices(path)
    with readable(path), path.open("rb") as file:
        data = file.read(TEXT_BYTES.most + 1)
        size = max(path.stat().st_size, len(data))
    if data.startswith(_SPREADSHEETS):
        return spreadsheet_text(path, start)
    if data.startswith(b"\x1f\x8b"):
        with readable(path, "a file compressed by gzip"):
            data = Unpacked(path).unpack("gzip", data)
            size = max(size, len(data))
    if data.startswith(_BINARY):
        raise DataDamaged(f"{path} is an archive or a binary table: save it as CSV in UTF-8")
    if too_large := TEXT_BYTES.exceeded(size):
        raise DataDamaged(f"{path}: {too_large}")
    text = _UNSEEN.sub("", _decoded(path, data)).rstrip("\0")
    beginning, zero, _ = text.partition("\0")
    if zero:
        raise DataDamaged(
            f"{path}, line {beginning.count(chr(10)) + 1} has zero bytes. If a part of the file was not written, leave "
            "them out, and the lines that are not whole; else it is not a text file"
        )
    return text


def _decoded(path: Path, data: bytes) -> str:
    """Return the text of bytes in UTF-8, UTF-16 or UTF-32, or in a code page if those of Europe agree on it.

    Raises DataDamaged.
    """
    unicode = _unicode(data)
    if unicode == "utf-8-sig":
        data = data.rstrip(b"\0\xff")  # the part of a card that a logger did not fill
    try:
        return data.decode(unicode)
    except UnicodeDecodeError as error:
        if unicode != "utf-8-sig":
            raise DataDamaged(
                f"{path} begins as {unicode.upper()}, and is none: {error.reason}. Save it as UTF-8"
            ) from None
        data = re.sub(rb"(?<=\d)\x92(?=\d{3})", b"'", data)  # thousands, as Windows has them in Switzerland
        data = re.sub(rb"(?<=m)\xb2", b"^2", data)  # the other sign of this byte, an ogonek, stands alone
        text, *others = (data.decode(code_page, "replace") for code_page in _CODE_PAGES[:_OF_EUROPE])
        differ = [place for other in others if (place := next(compress(count(), map(ne, text, other)), None))]
        if not differ:
            return text
        place = min(differ)
        line = data.count(b"\n", 0, place) + 1
        here = f", here as {readings}" if (readings := _readings(data, place)) else ""
        raise DataDamaged(
            f"{path}, line {line}: byte 0x{data[place]:02x} is not UTF-8, and other encodings read the file in "
            f"different ways{here}. Save it as UTF-8: iconv -f ENCODING -t UTF-8 FILE"
        ) from None


def _unicode(data: bytes) -> str:
    """Return the encoding that the first bytes tell, or the zeros beside digits, signs and ends of lines."""
    encoding = json.detect_encoding(data)
    if encoding not in ("utf-8", "utf-16-le", "utf-16-be"):
        return encoding
    sample = data.rstrip(b"\0")[:_SAMPLED_BYTES]
    even, odd = (sample[k::2].count(0) * _ZEROS > len(sample) for k in (0, 1))
    return "utf-8-sig" if even == odd else "utf-16-le" if odd else "utf-16-be"


def _readings(data: bytes, place: int) -> str:
    """Return how several encodings read the cell in which this byte is."""
    begin = max(data.rfind(sign, 0, place) for sign in (b"\n", b"\r", b"\t", b",", b";")) + 1
    cell = re.split(rb"[\n\r\t,;]", data[begin : begin + _SHOWN_BYTES])[0].strip(b"\"' ")
    readings: dict[str, str] = {}
    for code_page in _CODE_PAGES:
        reading = cell.decode(code_page, "replace")
        signs = (sign for sign in reading if sign.isalpha() or not sign.isascii())
        if len({unicodedata.name(sign, "").partition(" ")[0] for sign in signs}) == 1:  # of one script
            readings.setdefault(reading, code_page)
    return listed([f"{reading} ({code_page})" for reading, code_page in readings.items()])
