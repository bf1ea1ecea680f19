"""What a user probably meant who typed a command that is refused."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from difflib import get_close_matches
from errno import ENOSPC
from pathlib import Path

import click

from graspsense.core.components.entries import PipelineEntry
from graspsense.core.components.registry import installed
from graspsense.core.settings.layers import read_toml, toml_kind
from graspsense.core.values.errors import GraspsenseError


def advice(error: BaseException, arguments: Sequence[str]) -> list[str]:
    """Return what to type instead of these arguments of the program, which were refused with this error."""
    advised = list(_split_options(arguments))
    if isinstance(error, PermissionError):
        advised.append("Choose another folder, or change who may read and write this one")
    if isinstance(error, OSError) and error.errno == ENOSPC:
        advised.append("Free some space, or write to another disk")
    context = getattr(error, "ctx", None)
    if not advised and isinstance(error, click.UsageError) and context is not None:
        advised = list(_misplaced_words(context, arguments))
    return advised


def message_of(error: click.ClickException) -> str:
    """Return the message of an error; of a number that an option does not take, what it takes."""
    kind = getattr(getattr(error, "param", None), "type", None)
    typed, refused, _ = error.message.partition(" is not ")
    if (
        isinstance(error, click.BadParameter)
        and error.param is not None
        and isinstance(kind, type(click.INT) | type(click.FLOAT))
        and refused
    ):
        return f"{error.param.opts[0]} {typed}: give {_allowed(kind)}"
    return error.format_message().expandtabs(2)


def _allowed(kind: click.types.IntParamType | click.types.FloatParamType) -> str:
    """Return the numbers that an option takes, in words: `a whole number from 2 to 1000`."""
    words = "a whole number" if isinstance(kind, type(click.INT)) else "a number"
    least, most, above = (getattr(kind, name, None) for name in ("min", "max", "min_open"))
    if least is not None and most is not None and not above:
        return f"{words} from {least:.10g} to {most:.10g}"
    words += "" if least is None else f" {'above' if above else 'of at least'} {least:.10g}"
    return words if most is None else f"{words}, at most {most:.10g}"


def _split_options(arguments: Sequence[str]) -> Iterator[str]:
    """Yield the option for each `-o KEY VALUE` and `-o KEY= VALUE`, whose value belongs behind a `=`."""
    for place, word in enumerate(arguments[:-2]):
        key, *after = arguments[place + 1 : place + 4]
        value = after[1] if after[0] == "=" and len(after) > 1 else after[0]
        if word != "-o" or key.startswith("-") or value.startswith("-o"):
            continue
        if "=" not in key or key.endswith("="):
            yield f"Write -o {key.rstrip('=')}={value.removeprefix('=')}, without a space"


def _misplaced_words(context: click.Context, arguments: Sequence[str]) -> Iterator[str]:
    """Yield the option for each word that is no argument of the command, but may be the value of an option."""
    command = context.command
    options = {name for param in command.params if isinstance(param, click.Option) for name in param.opts}
    words = (
        list(arguments[arguments.index(str(context.info_name)) + 1 :])
        if context.info_name in arguments
        else []
    )
    with suppress(click.UsageError):
        _, left, _ = command.make_parser(context).parse_args(words)
        for word in left:
            option, value = _option_for(word)
            if option == "--object" and "--labels" in options:
                option = "--labels"
            if option in options and word[:1].isalpha():
                yield f"Write {option} {value}"


def _option_for(word: str) -> tuple[str, str]:
    """Return the option whose value this word probably is, and that value: of a name nearly written, the name."""
    if word.endswith(".toml"):
        with suppress(GraspsenseError):
            if toml_kind(read_toml(Path(word), word, "TOML").values) == "scene":
                return "--object", word
        return "--pipeline", word
    if "=" in word:
        return "-o", word
    options = {component.name: "--gripper" for component in installed().components("sensor-backend")}
    options |= {pipeline.name: "--pipeline" for pipeline in installed().resources(PipelineEntry)}
    # Objects are not asked for: a word that is hardly like the name of a pipeline is one of them.
    near = word if word in options else next(iter(get_close_matches(word, options, n=1, cutoff=0.8)), "")
    return (options[near], near) if near else ("--object", word)
