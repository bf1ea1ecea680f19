"""A manifest written from the files of a folder, for a person to correct.

What the files state is written as it is. What is only likely is followed by `# check:` with the reason.
"""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import pairwise, permutations
from pathlib import Path
from typing import Final

import numpy as np
from attrs import evolve, frozen

from graspsense.core.values.errors import ConfigError, counted
from graspsense.core.values.printable import in_one_line
from graspsense.core.values.written_numbers import is_number
from graspsense.recording.readable import readable
from graspsense.sources.columns.column_guess import Guess, guesses, time_column
from graspsense.sources.formats.array_format import ARRAY_SUFFIXES, COLUMN, GRASP, TIME, arrays_in
from graspsense.sources.formats.raw_tables import READ_SUFFIXES, is_text, raw_tables
from graspsense.sources.formats.table import ColumnTable, TableRules
from graspsense.sources.formats.text_table import read_lines, text_suffix
from graspsense.sources.manifest.facts import iso_time
from graspsense.sources.manifest.files import tree_below

_DOCUMENTS: Final = frozenset({"readme", "license", "licence", "requirements", "changelog", "citation"})
_AT_END: Final = {
    "stamp": re.compile(r"(.*?)([-_ ]?)(\d{8}[T_-]?\d{6})"),
    "number": re.compile(r"(.*?)([-_ ]?)(\d+)"),
}
"""What a part of a path can end with, behind a text and a sign."""
_OF_A_SET: Final = re.compile("train|test|valid")
_LABELS: Final = frozenset(["label", "class", "object", "material", "kind", "fruit", "target", "item"])
_PARTS: Final = frozenset({
    "trial", "grasp", "tap", "squeeze", "episode", "run", "id", "seq", "test", "touch", "press", "repetition",
    "rep"
})  # fmt: skip
_TIMES: Final = re.compile("stamp|date|time|start|begin|record")
_MOST_LABELS: Final = 100
_ALIKE: Final = 3
"""Most arrays of a file with the same name but for its number that are not taken for grasps."""
_BEGINNING: Final = 0.1
"""Share of a recording up to which its time is at the beginning."""
_FEW: Final = 6
"""Most values of a number that is a label."""


@frozen(kw_only=True)
class Suggestion:
    """The text of a manifest, with the file that its columns were guessed from and the files that it leaves out."""

    text: str
    example: Path
    left_out: tuple[str, ...]


def suggested_manifest(folder: Path, place: Path) -> Suggestion:
    """Return a manifest, to be written into the folder `place`, for the recordings in a folder, or for one file.

    Raises ConfigError if there is none that can be read.
    """
    if os.path.isfile(folder):
        folder, files = folder.parent, [(folder.name, folder)]
    elif os.path.isdir(folder):
        files = [(name, path) for name, path in tree_below(folder) if _is_recording(path)]
    else:
        raise ConfigError(f"{folder} is not there: name the folder of the recordings, or a file")
    if not files:
        raise ConfigError(f"{folder} has no file that is read as a recording: {', '.join(READ_SUFFIXES)}")
    usual = Counter(_ending(path) for _, path in files).most_common(1)[0][0]
    names = [name for name, path in files if _ending(path) == usual]
    depth = Counter(name.count("/") for name in names).most_common(1)[0][0]
    alike = [name for name in names if name.count("/") == depth]
    example = folder / alike[0]
    pattern, fields, facts = _pattern([name.removesuffix(usual) for name in alike])
    lines = [Guess(key="files", value=pattern + usual, check=facts)]
    if folder.resolve() != place.resolve():
        lines = [Guess(key="folder", value=os.path.relpath(folder.resolve(), place.resolve())), *lines]
    table, about = _table_of(example)
    lines += about
    divided = [guess.key for guess in about]
    if _LABELS & _fields_of(about) or (not divided and _is_of_readings(table)):
        # Arrays or rows tell what was grasped.
        lines = [
            evolve(line, value=line.value.replace("{label}", "{part}")) if line.key == "files" else line
            for line in lines
        ]
        fields -= {"label"}
    lines += _label(fields | _fields_of(about), table, divided)
    of_rows = any(guess.value == "rows" for guess in lines)
    lines += [guess for guess in guesses(table) if not (of_rows and guess.key == "rate_hz")]
    left_out = tuple(name for name, _ in files if name not in set(alike))
    return Suggestion(text=_text(folder, lines, table, left_out), example=example, left_out=left_out)


def _is_recording(path: Path) -> bool:
    if path.is_dir():
        return True  # of a ROS 2 bag
    return (
        text_suffix(path) in READ_SUFFIXES and path.stem.lower() not in _DOCUMENTS and path.stat().st_size > 0
    )


def _ending(path: Path) -> str:
    ending = path.suffixes[-2:] if path.suffix == ".gz" else path.suffixes[-1:]
    return "" if path.is_dir() else "".join(ending)


def _pattern(names: Sequence[str]) -> tuple[str, set[str], str]:
    """Return the pattern of these paths without their ending, the fields in it, and what has to be checked."""
    parts = zip(*(name.split("/") for name in names), strict=True)
    pieces = [[*_pieces(part), ("same", ["/"])] for part in parts]
    flat = [(what, values) for part in pieces for what, values in part][:-1]
    label = _label_values(flat)
    written, taken, seen = "", set[str](), list[Sequence[str]]()
    for what, values in flat:
        if what == "same":
            written += values[0]
            continue
        if values in seen:
            written += "*"
            continue
        seen.append(values)
        wanted = {"text": "part", "number": "order", "stamp": "recorded"}[what]
        if values is label:
            wanted = "label"
        elif what == "number" and label is None:
            if "object" not in taken and _repeats(values):
                wanted = "object"  # folders that have several files each
        elif what == "number" and len(set(zip(label or (), values, strict=True))) == len(set(label or ())):
            wanted = "object"
        name = wanted if wanted not in taken else f"{wanted}{len(taken)}"
        taken.add(name)
        written += f"{{{name}:d}}" if what == "number" else f"{{{name}}}"
    check = "whether these parts of the path are what was grasped, and the order of recording"
    if len(names) == 1:
        check = "the only file of its kind"
    return written, taken, check


def _repeats(values: Sequence[str]) -> bool:
    """Return whether each of several values stands in several paths."""
    return len(set(values)) > 1 and min(Counter(values).values()) > 1


def _label_values(pieces: Sequence[tuple[str, Sequence[str]]]) -> Sequence[str] | None:
    """Return the piece that most likely is the label: a text with few values that do not name parts of a set."""
    texts = [values for what, values in pieces if what == "text"]
    able = [values for values in texts if not any(_OF_A_SET.search(value.lower()) for value in values)]
    return min(able or texts, key=lambda values: len(set(values)), default=None)


def _pieces(values: Sequence[str]) -> list[tuple[str, Sequence[str]]]:
    """Return the pieces of a part of a path: what stays the same, and texts, numbers or stamps that vary."""
    if len(set(values)) == 1:
        return [("same", values)]
    if all(value.isdecimal() for value in values):
        return [("number", list(values))]
    for what, pattern in _AT_END.items():
        matches = [match.groups() for value in values if (match := pattern.fullmatch(value)) is not None]
        if len(matches) == len(values) and len({sign for _, sign, _ in matches}) == 1:
            texts, signs, ends = zip(*matches, strict=True)
            return [*_pieces(texts), ("same", signs), ("same" if len(set(ends)) == 1 else what, ends)]
    ending = _common_ending(values)
    if ending:
        return [*_pieces([value.removesuffix(ending) for value in values]), ("same", [ending])]
    return [("text", list(values))]


def _common_ending(values: Sequence[str]) -> str:
    """Return what all values end with, from a sign between words on."""
    shortest = min(values, key=len)
    endings = (shortest[k:] for k in range(1, len(shortest)) if shortest[k] in "-_ ")
    return next((end for end in endings if all(value.endswith(end) for value in values)), "")


def _table_of(path: Path) -> tuple[ColumnTable, list[Guess]]:
    """Return a table of a file, and the lines that say how the file is divided. Raises ConfigError, DataDamaged."""
    if path.is_file() and is_text(path) and (start := _start(path)) is not None:
        pattern, count = start
        check = f"{count} lines begin a grasp; the names of the fields are those of the words before them"
        guess = Guess(key="start", value=pattern, check=check)
        return raw_tables(path, TableRules(start=pattern))[0], [guess]
    if path.suffix.lower() in ARRAY_SUFFIXES:
        pattern, shape = _array_pattern(path)
        if pattern:
            lines = [Guess(key="arrays", value=pattern, check="the names of the arrays")]
            axes = _axes(shape)
            if axes:
                lines.append(Guess(key="axes", value=", ".join(axes), check=f"what the axes of {shape} are"))
            return raw_tables(path, TableRules(arrays=pattern, axes=axes))[0], lines
    tables = raw_tables(path, TableRules())
    return max(tables, key=lambda table: len(table.numbers)), []


def _start(path: Path) -> tuple[str, int] | None:
    """Return the pattern of the lines that begin each grasp in a text, and their number, None if there are none."""
    lines = [line.strip() for _, line in read_lines(path)[0] if line.strip()]
    again = Counter(line for line in lines if not any(map(is_number, re.split(r"[,;\t]", line))))
    names = next((line for line, count in again.most_common(1) if count > 1), None)
    if names is None:
        return None
    begins = [number for number, line in pairwise(lines) if line == names]
    rows = [line.split(",") for line in begins]
    if len(begins) < 2 or len({len(row) for row in rows}) > 1 or len(rows[0]) == len(names.split(",")):
        return None
    written, named, taken = [], "", set[str]()
    for cells in zip(*rows, strict=True):
        if len(set(cells)) == 1 and not is_number(cells[0]):
            named = "_".join(re.findall("[a-z]+", cells[0].lower()))
            written.append(re.escape(cells[0]).replace(r"\ ", " "))
            continue
        name = named if named and named not in taken else f"field{len(taken) + 1}"
        taken.add(name)
        written.append(f"(?P<{name}>{r'[0-9]+' if all(cell.isdecimal() for cell in cells) else '[^,]+'})")
    return ",".join(written), len(begins)


def _array_pattern(path: Path) -> tuple[str, tuple[int, ...]]:
    """Return the pattern of the names of many arrays that are alike, empty if they are not, and the shape of one."""
    with readable(path):
        arrays = {name: array for name, array in arrays_in(path).items() if array.size > 1}
    shapes: dict[str, list[str]] = {}
    for name in arrays:
        if re.search(r"\d+", name):
            shapes.setdefault(re.sub(r"\d+", "#", name), []).append(name)
    many = {shape: alike for shape, alike in shapes.items() if len(alike) > _ALIKE}
    if not many:
        return "", ()
    most = max(many, key=lambda shape: len(many[shape]))
    shape = arrays[many[most][0]].shape
    if most.count("#") > 1:
        names = ("object", *(f"number{k}" for k in range(2, most.count("#") + 1)))
        pieces = most.split("#")
        return pieces[0] + "".join(f"{{{a}:d}}{b}" for a, b in zip(names, pieces[1:], strict=True)), shape
    many = {shape: alike for shape, alike in many.items() if shape.count("#") == 1}
    ends = {shape.partition("#")[2] for shape in many}
    starts = {shape.partition("#")[0] for shape in many}
    signs = {start[-1:] for start in starts}
    start = f"{{label}}{signs.pop()}" if signs in ({"_"}, {"/"}, {"."}) else "{label}"
    if len(ends) == 1:
        return f"{start}{{order:d}}{ends.pop()}", shape
    signs = {end[:1] for end in ends}
    pattern = f"{start}{{order:d}}{signs.pop()}{{{COLUMN}}}" if signs in ({"_"}, {"/"}, {"."}) else ""
    return pattern, shape


def _axes(shape: Sequence[int]) -> tuple[str, ...]:
    """Return what the axes of an array of three dimensions likely are: the longest is the time, the shortest grasps."""
    if len(shape) != 3:
        return ()
    ordered = sorted(range(3), key=lambda k: shape[k])
    names = dict(zip(ordered, (GRASP, COLUMN, TIME), strict=True))
    return tuple(names[k] for k in range(3))


def _fields_of(lines: Sequence[Guess]) -> set[str]:
    texts = [guess.value for guess in lines if guess.key in ("start", "arrays")]
    return {
        name for text in texts for name in re.findall(r"\?P<(\w+)>|\{(\w+)", text) for name in name if name
    }


def _label(fields: set[str], table: ColumnTable, divided: Sequence[str]) -> Iterator[Guess]:
    """Yield the lines on how a table is divided, and what names the object."""
    split = "" if divided else _split_column(table)
    if split:
        yield Guess(key="split", value=split, check="its value changes from grasp to grasp")
        yield Guess(key="order", value=f"{{{split}}}", check="whether it is the order of recording")
    elif not divided and (anew := _times_anew(table)):
        yield Guess(key="split", value="time", check=f"the time begins anew {counted(anew, 'time')}")
    elif not divided and _is_of_readings(table):
        yield Guess(key="split", value="rows", check="no column is a time, so each row is taken for a grasp")
        yield from _label_of_rows(table)
        return
    stamps = [name for name in sorted(fields) if re.search("stamp|date", name)]
    stamp = next((name for name in stamps if re.search("start|begin", name)), next(iter(stamps), None))
    recorded = _time_said(table.about) if stamp is None else f"{{{stamp}}}"
    if recorded:
        yield Guess(key="recorded", value=recorded, check="whether it is the time of recording")
    if "order" not in fields and "seq" in fields:
        yield Guess(key="order", value="{seq}", check="whether seq is the order of recording")
    if "label" in fields:
        return
    known = (*sorted(fields), *table.texts, *table.fields, *table.about)
    named = [name for name in known if _LABELS & set(re.findall("[a-z]+", name.lower()))]
    texts = [name for name, cells in table.texts.items() if len(set(cells)) <= _MOST_LABELS]
    name = next(iter((*named, *texts)), None)
    if name is None:
        yield Guess(key="label", value="object", check="nothing names the object: write what was grasped")
    else:
        label = f"{{{name}}}" if name in (*table.texts, *table.about) else f"object{{{name}}}"
        yield Guess(key="label", value=label, check=f"whether {name} is what was grasped")


def _time_said(about: Mapping[str, str]) -> str:
    """Return the time that the lines before a table say, also in two of them; empty if they say none."""
    named = [name for name, text in about.items() if _TIMES.search(name) and not is_number(text)]
    for names in (*permutations(named, 2), *((name,) for name in named)):
        with suppress(ValueError):
            iso_time(" ".join(about[name] for name in names))
            return " ".join(f"{{{name}}}" for name in names)
    return ""


def _label_of_rows(table: ColumnTable) -> Iterator[Guess]:
    """Yield label and object of a table with a grasp in each row."""
    few = [
        name
        for name, values in table.numbers.items()
        if values.ndim == 1
        and 1 < len(np.unique(values)) <= _FEW
        and bool((values == np.round(values)).all())
    ]
    texts = list(table.texts)
    label = f"{few[0]}{{{few[0]}}}" if few else f"{{{texts[0]}}}" if texts else "object"
    yield Guess(key="label", value=label, check="whether this is what has to be recognised")
    if few and texts:
        yield Guess(
            key="instance", value=f"{{{texts[0]}}}", check=f"whether {texts[0]} is the individual object"
        )


def _split_column(table: ColumnTable) -> str:
    """Return a column whose value stays the same during each grasp of a file, empty if there is none."""
    for name, values in table.numbers.items():
        if values.ndim == 1 and set(re.findall("[a-z]+", name.lower())) & _PARTS:
            changes, different = int((np.diff(values) != 0.0).sum()), set(values.tolist())
            # What goes from 0 to 1 and back tells of each reading whether it is so, as of a touch.
            most = len(different) * (1 if different <= {0.0, 1.0} else 2)
            if 0 < changes < len(values) / 5 and changes + 1 <= most:
                return name
    return ""


def _times_anew(table: ColumnTable) -> int:
    """Return how often the time goes back to its beginning, 0 if it also goes back otherwise."""
    if (name := time_column(table)) is None:
        return 0
    since_s = table.numbers[name] - np.nanmin(table.numbers[name])
    back = np.flatnonzero(np.diff(since_s) < 0.0)
    anew = since_s[back + 1] <= _BEGINNING * since_s[back]
    return len(back) * bool(anew.all())


def _is_of_readings(table: ColumnTable) -> bool:
    """Return whether each row is a reading of its own: many rows, no time, no gap, and a text in each row."""
    known = any(guess.key in ("time", "gap") for guess in guesses(table)) or table.t_s is not None
    return bool(table.texts) and len(table) > 1 and not known


def _text(folder: Path, lines: Sequence[Guess], table: ColumnTable, left_out: Sequence[str]) -> str:
    """Return the manifest. A key without a value is a comment, so that the manifest cannot be used as it is."""
    head = [
        f"# Suggested from the files in {folder.name or folder}. Correct the lines that say `check`, then look at:",
        "# graspsense import THIS_FILE --check",
    ]
    body = []
    for guess in lines:
        is_toml = guess.key in ("rate_hz", "channels")
        value = guess.value if is_toml else json.dumps(guess.value, ensure_ascii=False)
        line = f"{guess.key} = {value}" if guess.value else f'# {guess.key} = "COLUMN [N]"'
        body.append(f"{line}   # check: {guess.check}" if guess.check else line)
    if all(guess.key != "gap" for guess in lines) and not any(guess.value == "rows" for guess in lines):
        body.append('# gap = "COLUMN [mm]"   # check: no column is known to be a gap')
    known = [f"# columns: {', '.join(list(table.numbers)[:30])}"] if table.numbers else []
    if left_out:
        some = ", ".join(left_out[:5]) + (", ..." if len(left_out) > 5 else "")
        known.append(f"# check: {len(left_out)} other files are left out: {some}")
    return "\n".join(map(in_one_line, [*head, *body, *known])) + "\n"
