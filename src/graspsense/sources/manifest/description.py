"""A manifest: a TOML file that says which files are recordings of grasps, and what their columns mean."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, Literal

from attrs import Attribute, field, frozen

from graspsense.core.components.setting import setting
from graspsense.core.components.strict import ValidationFailed, structured
from graspsense.core.settings.layers import read_toml
from graspsense.core.values.errors import ConfigError, listed
from graspsense.core.values.fingers import PREFIX, FingerForce
from graspsense.core.values.limits import ENTRIES
from graspsense.core.values.signals import NOT_KNOWN
from graspsense.sources.formats.array_format import AXES, TIME
from graspsense.sources.formats.patterns import file_template, regular_expression
from graspsense.sources.manifest.expression import Expression, ExpressionError, parse

Text = str | tuple[str, ...]
"""An expression, or several of which the first is used whose columns exist."""
QUANTITIES: Final = ("time", "gap", "force", "left", "right", "effort", "velocity")
_EVENT: Final = re.compile(r"[a-z][a-z0-9 _-]{0,99}")
_AMOUNT: Final = re.compile(r"(?P<number>\d+(?:\.\d+)?)\s*(?P<unit>samples?|s|ms)")


def _is_regex(_config: object, _attribute: Attribute[str], value: str) -> None:
    regular_expression(value)


def _is_amount(_config: object, _attribute: Attribute[str], value: str) -> None:
    if value and _AMOUNT.fullmatch(value) is None:
        raise ValueError(
            f'{value!r} is neither a number of samples nor of seconds: write "10 samples" or "0.2 s"'
        )


def _is_template(_config: object, _attribute: Attribute[str], value: str) -> None:
    file_template(value)


def axes_of(text: str) -> tuple[str, ...]:
    """Return the axes that a text such as `grasp, time, column` names."""
    return tuple(text.replace(",", " ").split())


def _is_axes(_config: object, _attribute: Attribute[str], value: str) -> None:
    axes = axes_of(value)
    if value and not (len(axes) == len(set(axes)) == 3 and set(axes) <= {*AXES} and TIME in axes):
        raise ValueError(
            f'{value!r} does not name three axes: write "grasp, time, column", or "time, row, column", in the order '
            "of the file"
        )


@frozen(kw_only=True)
class Manifest:
    """The keys of a manifest."""

    folder: str = setting(default=".", meaning="Folder of the files, relative to the manifest.")
    files: Text = setting(
        default=(),
        meaning="Patterns of paths: `*` is any text in a name, `{name}` the same with a name, `{name:d}` digits.",
    )
    list: str = setting(
        default="",
        meaning="CSV file with a column `file`; each further column is a field of that row's grasp.",
    )
    beside: Text = setting(
        default=(),
        meaning="Files beside each file, joined by rows or by time; `labels.csv` and `{number}_labels.csv` have the "
        "columns `'labels.NAME'`.",
    )
    start: str = setting(
        default="",
        validator=_is_regex,
        meaning="Regular expression of the line that begins each grasp in a text file; its named groups are fields.",
    )
    split: str = setting(
        default="",
        meaning='How a file is split: a column with a value for each grasp, "force" to find the squeezes, "time" where '
        'it begins anew, or "rows".',
    )
    arrays: str = setting(
        default="",
        validator=_is_template,
        meaning="Pattern of the names of the arrays in a file, as of `files`; `{column}` names the column.",
    )
    axes: str = setting(
        default="",
        validator=_is_axes,
        meaning='What the axes of an array of three dimensions are: "grasp, time, column" or "time, row, column".',
    )
    time: Text = setting(default=(), meaning="Time.")
    rate_hz: float = setting(
        default=0.0, unit="Hz", minimum=0.0, meaning="Samples a second where there is no time."
    )
    gap: Text = setting(
        default=(),
        meaning="Distance between the fingertips, which falls on closing; none where it was not recorded.",
    )
    force: Text = setting(default=(), meaning="Force of both pads, where there is only one.")
    left: Text = setting(
        default=(), meaning="Force of the left pad, or of the finger or fingers of one side."
    )
    right: Text = setting(default=(), meaning="Force of the right pad.")
    fingers: Mapping[str, str] = setting(
        factory=dict, meaning='Force of each finger of a hand: a name and an expression, `thumb = "F1 [N]"`.'
    )
    touch: str = setting(
        default="",
        meaning='When the fingers touch: the names of those that oppose the others ("thumb"), "each", or "any".',
    )
    effort: Text = setting(default=(), meaning="Effort of the drive, positive when squeezing.")
    velocity: Text = setting(default=(), meaning="Rate of the gap, negative on closing.")
    channels: Mapping[str, str] = setting(
        factory=dict, meaning='Further channels: a name and an expression with its unit, `f1 = "F1 [N]"`.'
    )
    fast: Text = setting(
        default=(),
        meaning="Names of those `channels` whose columns are samples of a row in the order of time, not cells.",
    )
    zero: str = setting(
        default="",
        validator=_is_amount,
        meaning='What the zero of the forces is taken from: "10 samples" or "0.2 s" at the beginning.',
    )
    cut: Literal["", "rupture", "release"] = setting(
        default="", meaning="Where a grasp ends before the end of its samples."
    )
    resample_hz: float = setting(
        default=0.0, unit="Hz", minimum=0.0, meaning="Rate to which a grasp is resampled; 0 for as it is."
    )
    duplicates: Literal["refuse", "drop"] = setting(
        default="refuse", meaning="What to do with a sample that has the time of the one before."
    )
    label: str = setting(default="", meaning="The label, from fields: `{fruit}:{state}`.")
    instance: str = setting(default="", meaning="The individual object, from fields.")
    recorded: str = setting(default="", meaning="The time of the recording, from fields.")
    order: str = setting(
        default="", meaning="A number that increases in the order of recording, from fields."
    )
    values: Mapping[str, str] = setting(
        factory=dict,
        meaning="Properties of the grasp: an expression with its unit, or a file beside it with one number.",
    )
    events: Mapping[str, str] = setting(
        factory=dict,
        meaning='Labelled events: a column of 0 and 1, `slip = "slips"`, or their times, `slip = "onset [s]"`.',
    )


@frozen(kw_only=True)
class ReadManifest:
    """A manifest with its expressions parsed. `place` is the file, `base` the folder of the recordings."""

    place: Path
    base: Path
    keys: Manifest
    expressions: Mapping[str, tuple[Expression, ...]]
    channels: Mapping[str, Expression] = field(factory=dict)
    values: Mapping[str, Expression] = field(factory=dict)
    events: Mapping[str, Expression] = field(factory=dict)
    fast: frozenset[str] = frozenset()
    """Names of the channels that are fast channels."""
    value_files: Mapping[str, str] = field(factory=dict)
    """Values that are in a file beside the recording: name to the name of that file."""


def read_manifest(place: Path) -> ReadManifest:
    """Read a manifest. Raises ConfigError that names every mistake with its line."""
    layer = read_toml(place, str(place), "manifest")
    try:
        keys = structured(layer.values, Manifest, "a manifest")
    except ValidationFailed as misfit:
        raise ConfigError("\n".join(layer.complain(problem) for problem in misfit.problems)) from None
    problems = [f"{layer.where(path)}: {why}" for path, why in _too_many(keys)]
    if problems:
        raise ConfigError("\n".join(problems))

    def parsed(text: str, *path: str) -> Expression:
        try:
            return parse(text)
        except ExpressionError as error:
            problems.append(f"{layer.where(path)}: {'.'.join(path)}: {error}")
            return parse("0")  # for a manifest that is refused below

    value_files = {
        name: text for name, text in keys.values.items() if re.fullmatch(r"[^'\"*/+()]+\.(npy|txt|csv)", text)
    }
    expressions = {
        name: tuple(parsed(text, name) for text in texts_of(getattr(keys, name))) for name in QUANTITIES
    }
    tables = {
        table: {
            name: parsed(text, table, name)
            for name, text in getattr(keys, table).items()
            if table != "values" or name not in value_files
        }
        for table in ("channels", "values", "events", "fingers")
    }
    expressions |= {f"{PREFIX}{name}": (force,) for name, force in tables.pop("fingers").items()}
    wrong = (*_contradictions(keys), *_finger_problems(keys))
    problems += [f"{layer.where(path)}: {why}" for path, why in wrong]
    if problems:
        raise ConfigError("\n".join(problems))
    return ReadManifest(
        place=place,
        # expanded by os.path: pathlib raises where there is no such user
        base=place.parent / os.path.expanduser(keys.folder),
        keys=keys,
        expressions=expressions,
        **tables,
        value_files=value_files,
        fast=frozenset(texts_of(keys.fast)),
    )


def _too_many(keys: Manifest) -> list[tuple[tuple[str, ...], str]]:
    """Return which keys have more entries than are accepted, each with the reason."""
    entries = {
        "files": texts_of(keys.files),
        "beside": texts_of(keys.beside),
        **{name: getattr(keys, name) for name in ("channels", "values", "fingers", "events")},
    }
    entries |= {name: texts_of(getattr(keys, name)) for name in QUANTITIES}
    return [((name,), why) for name, entry in entries.items() if (why := ENTRIES.exceeded(len(entry)))]


def _contradictions(keys: Manifest) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield what is missing or contradicts itself, each with the key it belongs to."""
    if bool(keys.files) == bool(keys.list):
        yield ("files",), 'name the files, either by patterns (files = "{label}/*.csv") or by a list'
    if keys.force and (keys.left or keys.right):
        yield ("force",), "force stands for both pads: give it alone, or left and right"
    if not (keys.force or keys.left or keys.right or keys.fingers):
        yield ("force",), "a grasp needs its force: force, left and right, or fingers"
    for name in keys.events:
        if not _EVENT.fullmatch(name) or name.endswith(NOT_KNOWN):
            rule = (
                f"write small letters, digits, spaces, - and _, a letter first, and not{NOT_KNOWN} at the end"
            )
            yield ("events", name), rule
    unknown = [name for name in texts_of(keys.fast) if name not in keys.channels]
    if unknown:
        yield ("fast",), f"{unknown[0]!r} is not among the channels: name it there with its columns"
    elif keys.fast and keys.resample_hz:
        yield ("resample_hz",), "fast channels cannot be resampled: leave out fast or resample_hz"
    in_names = "".join((*texts_of(keys.files), keys.arrays))
    if not keys.label and not keys.list and "{label" not in in_names and "?P<label>" not in keys.start:
        yield ("label",), 'no label: write label = "{field}", or {label} in the pattern of files'


def hand_of(keys: Manifest, unit: str) -> tuple[FingerForce, ...]:
    """Return the fingers that a manifest names. Raises ValueError for a name that no finger can have."""
    rule, opposed = keys.touch, _opposing(keys)
    if rule in ("each", "any"):
        return tuple(FingerForce(f"{PREFIX}{name}", unit, touch=rule) for name in keys.fingers)  # type: ignore[arg-type]
    return tuple(
        FingerForce(f"{PREFIX}{name}", unit, side="left" if name in opposed else "right")
        for name in keys.fingers
    )


def _opposing(keys: Manifest) -> tuple[str, ...]:
    """Return the fingers of the left side; of two fingers, the first one."""
    named = axes_of(keys.touch)
    return named or (tuple(keys.fingers)[:1] if len(keys.fingers) == 2 else ())


def _finger_problems(keys: Manifest) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield what is wrong with the fingers, each with the key it belongs to."""
    names = tuple(keys.fingers)
    if not names:
        if keys.touch:
            yield ("touch",), 'touch is the rule of fingers: name them, fingers = { thumb = "F1 [N]", ... }'
        return
    if keys.force or keys.left or keys.right:
        yield ("fingers",), "the fingers give the forces of both sides: leave out force, left and right"
    if len(names) == 1:
        yield ("fingers",), "one finger is the force of both pads: write it as force"
    twice = [name for name in names if f"{PREFIX}{name}" in keys.channels]
    if twice:
        yield ("channels",), f"{PREFIX}{twice[0]} is the force of the finger {twice[0]}: leave it out here"
    if keys.touch not in ("each", "any"):
        opposing = _opposing(keys)
        unknown = [name for name in opposing if name not in names]
        if unknown:
            yield (
                ("touch",),
                f"{unknown[0]!r} is no finger: there are {listed(names)}, and the rules each and any",
            )
        elif not opposing or len(opposing) == len(names):
            yield (
                ("touch",),
                f'say when the fingers touch: touch = "{names[0]}" where it opposes the others, "each" where every '
                'finger has to touch, "any" for any two',
            )
    try:
        hand_of(keys, "N")
    except ValueError as error:
        yield ("fingers",), str(error)


def quantity_of(key: str) -> str:
    """Return the quantity that the expressions of a key give: a force for each side and each finger."""
    return "force" if key in ("left", "right") or key.startswith(PREFIX) else key


def texts_of(value: Text) -> tuple[str, ...]:
    """Return the texts of a key that holds one or several."""
    return (value,) if isinstance(value, str) else value


def samples_of(amount: str, t_s: Any) -> int:
    """Return how many samples at the beginning an amount such as `10 samples` or `0.2 s` stands for."""
    match = _AMOUNT.fullmatch(amount)
    assert match is not None
    number = float(match["number"])
    if match["unit"].startswith("sample"):
        return int(max(1.0, min(number, float(len(t_s)))))
    seconds = number * (1e-3 if match["unit"] == "ms" else 1.0)
    return max(1, int((t_s - t_s[0] < seconds).sum()))
