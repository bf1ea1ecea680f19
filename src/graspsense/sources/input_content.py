"""The content of what a result is computed from: hashes of data, stores, scenes, models, calibrations and plugin code.

A name stays the same when its file is replaced. A result that is kept is therefore known by these hashes.
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache
from glob import escape, glob
from html import unescape
from importlib.metadata import PackageNotFoundError, requires
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from graspsense import __version__
from graspsense.core.components.entries import ConformanceCheckEntry, DatasetEntry, ExperimentKindEntry
from graspsense.core.components.registry import installed
from graspsense.core.grasp.calibration_files import calibration_folder
from graspsense.core.values.errors import GraspsenseError
from graspsense.core.values.json_values import json_text
from graspsense.recording.export_trace import all_beside
from graspsense.store.opening import STORE, as_source, place_and_number

FRAMEWORK: Final = "graspsense"
_OWN_PLUGINS: Final = "graspsense.plugins"
_CALIBRATION: Final = "calibration"
_OF_TRIALS: Final = """SELECT id, recording, recording_bytes, sha256, label, instance, set_aside IS NULL, hex("values")
    FROM trial JOIN detail ON detail.trial = id ORDER BY id"""
_OF_CHANGES: Final = """SELECT trial, "action", "before", "after" FROM change
    WHERE "action" NOT IN ('aside', 'restore') ORDER BY id"""
_REQUIREMENT: Final = re.compile(r"([\w.-]+)(?!.*\bextra\b)")
_IMPORTED: Final = re.compile(
    r"^[ \t]*from[ \t]+(\w[\w.]*)|^[ \t]*import[ \t]+([\w., \t]+)|(?:import_module|__import__)\(\s*[\"'](\w[\w.]*)",
    re.MULTILINE,
)
_QUOTED: Final = re.compile(r"\"[^\"\n]{1,1000}\"|'[^'\n]{1,1000}'")


def contents_of(params: Any, *, code: bool = True) -> dict[str, str]:
    """Return the hash of each input that these parameters name, by the text that names it, and our own version.

    Parameters are JSON values. A text names an input if it is a file, if a file or folder follows its colon
    (`store:DIR`, `identified:cup.toml,mug.toml`), or, with `code`, if it is the name of a component.
    """
    contents = {FRAMEWORK: __version__}
    codes = _codes()
    for text in set(input_names(params)) - contents.keys():
        content = _content(text, codes) if code or text not in codes else None
        if content is not None:
            contents[text] = content
    return contents


def input_names(params: Any) -> Iterator[str]:
    """Yield every text that may name an input of these parameters."""
    yield FRAMEWORK
    yield from _texts(params)


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            if key == _CALIBRATION and isinstance(inner, str):
                folder = calibration_folder(inner)
                yield from () if folder is None else (f"{_CALIBRATION}:{folder}",)
            yield from _texts(inner)
    elif isinstance(value, list | tuple):
        for inner in value:
            yield from _texts(inner)


def _content(text: str, codes: Mapping[str, list[tuple[str, str]]]) -> str | None:
    """Return the hash of what a text names; None if it names no input. `codes` are those of `_codes`."""
    if text in codes:
        return _hash(_hash_of_code(*code) for code in codes[text])
    if text.startswith(STORE):
        return _hash_of_store(place_and_number(text.removeprefix(STORE))[0])
    kind, paths = _named_places(text)
    if not paths:
        return None
    parts = [_hash_of_files(path, kind) for path in paths]
    readers = codes.get(f"{kind}:", [])
    return _hash([*parts, *(_hash_of_code(*reader) for reader in readers)])


def _named_places(text: str) -> tuple[str, list[str]]:
    """Return the files, or files and folders behind a kind and a colon, that a text names; none if it names no input.

    The name of a file may have commas and colons itself.
    """
    kind, _, places = text.partition(":")
    for scheme, names in (("", [text]), ("", text.split(",")), (kind, [places]), (kind, places.split(","))):
        paths = [_path(name) for name in names]
        if all(os.path.isfile(path) or (scheme and os.path.isdir(path)) for path in paths):
            return scheme, paths
    return "", []


def _path(place: str) -> str:
    """Return the path of a place, without the number of an object or of a recording behind it."""
    return place_and_number(os.path.expanduser(place.strip()))[0]


def located_text(text: str, base: Path) -> str:
    """Return a text that names a file or a store, or files or a folder after a colon, with absolute paths."""
    kind, colon, places = text.partition(":")
    if not colon or os.path.isfile(base / _path(text)):
        path = base / _path(text)
        is_input = (os.path.isfile(path) and path.suffix) or as_source(str(path)).startswith(STORE)
        return str(base.absolute() / os.path.expanduser(text)) if is_input else text
    located = [
        str(base.absolute() / os.path.expanduser(place))
        if place and os.path.exists(base / _path(place))
        else place
        for place in places.split(",")
    ]
    return f"{kind}:{','.join(located)}"


def _codes() -> dict[str, list[tuple[str, str]]]:
    """Return version and module of every component by its qualified name, and of every data set as `NAME:`.

    A setting may also name components of others without their distribution, as those of a union of feature sets. Kinds
    of experiments have their names. What plugins give to a hook of another one counts for the components of that one.
    """
    codes: dict[str, list[tuple[str, str]]] = {}
    added: dict[str, list[tuple[str, str]]] = {}
    for check in installed().resources(ConformanceCheckEntry):
        added.setdefault(check.distribution, []).extend(
            (status.version, status.module)
            for status in installed().statuses
            if check.entry.hook in status.hooks
        )
    for part in installed().components():
        code = [(part.version, part.entry.target.partition(":")[0]), *added.get(part.distribution, [])]
        codes.setdefault(part.qualified, []).extend(code)
        if part.distribution != FRAMEWORK:
            codes.setdefault(part.name, []).extend(code)
    for kind in installed().resources(ExperimentKindEntry):
        if kind.entry.run and kind.distribution != FRAMEWORK:
            codes.setdefault(kind.name, []).append((kind.version, kind.entry.run.partition(":")[0]))
    for dataset in installed().resources(DatasetEntry):
        target = dataset.entry.target or dataset.entry.recordings
        codes[f"{dataset.name}:"] = [(dataset.version, target.partition(":")[0])]
    return codes


@cache
def _hash_of_code(version: str, module: str) -> str:
    """Return a hash of a version, of the code of a module, and of the files and environment variables that it names."""
    package = _OWN_PLUGINS if module.startswith(f"{_OWN_PLUGINS}.") else module.partition(".")[0]
    if package == FRAMEWORK:
        return version
    code = _code_of(package)
    texts = set[str]().union(*(_texts_in(file) for files in code.values() for file in files))
    variables = {text: os.environ[text] for text in texts & os.environ.keys() if len(text) > 1}
    texts.update(variables.values())
    developed = [place for place in code if _is_developed(place)]
    above = list(map(os.path.dirname, developed))
    folders = {os.curdir, *developed, *above, *map(os.path.dirname, above)}
    files = _files_in(folders, {*texts, *(f"{text}.py" for text in texts)})
    named = sorted(files.union(*(_named_files(file, (), set()) for file in files)))
    values = [f"{name}={value}" for name, value in sorted(variables.items())]
    return _hash([version, *map(_hash_of_tree, (*code, *named)), *values])


def _code_of(package: str) -> dict[str, list[str]]:
    """Return the places of a package, and of the developed ones that its code imports, each with its files of code.

    The version of graspsense counts for its code, but for its own plugins.
    """
    code: dict[str, list[str]] = {}
    left, known = [package], {package, *sys.stdlib_module_names}
    while left:
        name = left.pop()
        for place in _places_of_package(name):
            files = glob(f"{escape(place)}/**/*.py", recursive=True) if os.path.isdir(place) else [place]
            code[place] = files if name != FRAMEWORK else []
            imported = set[str]().union(*map(_imported_in, code[place]))
            for further in sorted(imported - known):
                known.add(further)
                places = _places_of_package(further)
                if all(map(_is_developed, places)) and (further != FRAMEWORK or package == _OWN_PLUGINS):
                    left.append(further)
    return code


def _files_in(folders: Iterable[str], texts: Iterable[str]) -> set[str]:
    """Return the files with these names in these folders, and in the folders that the names lead to from there."""
    names = [os.path.expanduser(text) for text in texts if re.search(r"\w", text)]
    places = [path for folder in folders for path in _present(folder, names)]
    places += [path for folder in filter(os.path.isdir, places) for path in _present(folder, names)]
    return set(filter(os.path.isfile, places))


def _present(folder: str, names: Iterable[str]) -> list[str]:
    """Return the paths of those of these names that may exist, seen from a folder: most texts are no names."""
    entries = {"", os.curdir, os.pardir}
    with suppress(OSError):
        entries.update(os.listdir(folder))
    return [os.path.join(folder, name) for name in names if name.partition(os.sep)[0] in entries]


def required_by(distribution: str) -> set[str]:
    """Return the distributions that this one needs, without those of its extras."""
    needed: list[str] = []
    with suppress(PackageNotFoundError):
        needed = requires(distribution) or []
    return {re.sub(r"[-_.]+", "-", name[1]).lower() for name in map(_REQUIREMENT.match, needed) if name}


def developed_code(module: str) -> str:
    """Return a hash of the package of a module, and of what it imports, where they are developed; empty if installed.

    The version of a developed package says nothing of its content.
    """
    places = _code_of(module.partition(".")[0])
    return _hash(map(_hash_of_tree, places)) if all(map(_is_developed, places)) else ""


def _places_of_package(package: str) -> list[str]:
    """Return the folders of a package, or the file of a module."""
    spec = None
    with suppress(ValueError):  # a module that was made in memory
        spec = find_spec(package)
    places = [] if spec is None else spec.submodule_search_locations or [spec.origin or ""]
    return [place for place in places if os.path.exists(place)]


def _is_developed(place: str) -> bool:
    return os.path.basename(os.path.dirname(place)) not in ("site-packages", "dist-packages")


def _hash_of_store(folder: str) -> str:
    """Return a hash of the trials of a store, of changes of their labels, and of recordings that are lost or replaced.

    A recording is known by its size: to read all of them takes as long as to evaluate them.
    """
    from graspsense.store.store import Store

    try:
        with Store.read(folder) as store:
            trials = store.query(_OF_TRIALS)
            changes = store.query(_OF_CHANGES)
            paths = [store.recording_path(name) for _, name, *_ in trials]
            sizes = [path.stat().st_size if path.is_file() else 0 for path in paths]
            lost = [[*row[:2], size] for row, size in zip(trials, sizes, strict=True) if size != row[2]]
    except GraspsenseError as error:
        return _hash([str(error)])  # the task tells it
    return _hash([json_text([list(row) for row in (*trials, *changes, *lost)])])


def _hash_of_files(path: str, kind: str) -> str:
    """Return the hash of a file or a folder, and of the files that belong to it.

    Those are what it names, what was exported with it, or what it describes as a manifest.
    """
    if kind != "manifest":
        exported = map(str, all_beside(Path(path)))
        further = [*sorted(_named_files(path, (), set())), *exported]
        return _hash(_hash_of_tree(file) for file in (path, *further))
    from graspsense.sources.manifest.reader import manifest_files

    try:
        files = manifest_files(path)
    except GraspsenseError:
        files = []  # the task tells it
    names = (os.path.relpath(file, os.path.dirname(path)) for file in files)  # which can hold labels
    return _hash([_hash_of_tree(path), *names, *map(_hash_of_tree, map(str, files))])


def _named_files(path: str, folders: tuple[str, ...], known: set[str]) -> set[str]:
    """Add the files that a TOML or XML file names, and those that these name: models, their parts and meshes.

    They are in the folder of the file, in a folder that it names (meshdir), in `folders`, those of what names it, or in
    an installed package (`package:NAME:PATH`).
    """
    if not path.lower().endswith((".toml", ".xml")) or not os.path.isfile(path):
        return known
    texts = _texts_in(path)
    folder = os.path.dirname(path)
    folders += (folder, *filter(os.path.isdir, _present(folder, texts)))
    packaged = (place for text in texts for place in _places_in_package(text) if os.path.isfile(place))
    for place in sorted({*_files_in(folders, texts), *packaged} - known - {path}):
        known.add(place)
        _named_files(place, folders, known)
    return known


def _texts_in(path: str) -> set[str]:
    """Return the texts in a TOML file, or between quotes in another one; none of a file that cannot be read."""
    text = _text_of(path)
    with suppress(tomllib.TOMLDecodeError):
        return set(_texts(tomllib.loads(text)))
    return {unescape(quoted[1:-1]) for quoted in _QUOTED.findall(text)}


def _imported_in(path: str) -> set[str]:
    """Return the packages and modules that a file of code imports, but for those of its own package."""
    statements = map("".join, _IMPORTED.findall(_text_of(path)))
    names = (name.split() for statement in statements for name in statement.split(","))
    return {words[0].partition(".")[0] for words in names if words}


def _text_of(path: str) -> str:
    """Return the text of a file, empty if it cannot be read."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""  # the task tells it


def _places_in_package(text: str) -> Iterator[str]:
    """Yield where the file of an installed package can be that `package:NAME:PATH` names."""
    scheme, package, resource = (*text.split(":", 2), "", "")[:3]
    if scheme == "package" and package.isidentifier() and resource:
        for folder in _places_of_package(package):
            yield os.path.join(folder, resource)


def _hash_of_tree(path: str) -> str:
    """Return the hash of a file, or of all files below a folder with their names; hidden ones do not count.

    Links to folders are followed, each folder once.
    """
    if not os.path.isdir(path):
        return _hash_of_file(path)
    parts, entered = [], set[str]()
    for folder, folders, names in os.walk(path, followlinks=True):
        if os.path.realpath(folder) in entered:
            folders.clear()
            continue
        entered.add(os.path.realpath(folder))
        folders[:] = sorted(name for name in folders if not name.startswith((".", "__pycache__")))
        for name in sorted(names):
            file = os.path.join(folder, name)
            if not name.startswith("."):
                parts.append(f"{os.path.relpath(file, path)} {_hash_of_file(file)}")
    return _hash(parts)


def _hash_of_file(path: str) -> str:
    """Return the hash of a regular file; of what cannot be read, why."""
    try:
        if not os.path.isfile(path):
            return "no file"
        state = os.stat(path)
        return _read_hash(path, (state.st_size, state.st_ctime_ns, state.st_ino))
    except OSError as error:
        return str(error.strerror)


@cache
def _read_hash(path: str, _state: tuple[int, int, int]) -> str:
    """Return the hash of a file with this size, time of its last change (ns) and number, which is read once.

    Of a TOML file it is that of its values: comments and blank lines change no result.
    """
    with Path(path).open("rb") as file:
        if path.lower().endswith(".toml"):
            with suppress(tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError):
                return _hash([repr(tomllib.load(file))])
            file.seek(0)
        return hashlib.file_digest(file, "sha256").hexdigest()


def _hash(parts: Iterable[str]) -> str:
    return hashlib.sha256("\0".join(parts).encode(errors="surrogateescape")).hexdigest()[:32]
