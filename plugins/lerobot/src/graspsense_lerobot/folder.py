"""The folder of a LeRobot data set, v2.1 or v3.0: its description, its tasks, and the table of each episode.

What a file of the folder says is compared with the other files before it is used. A path in `meta/info.json` is a
pattern of which only the known fields are filled in, and it may not leave the folder.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, lru_cache, partial
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import Any, Final

import numpy as np
from attrs import frozen

from graspsense.gripper_api import ColumnTable, TooLarge, read_parquet
from graspsense.plugin_api import (
    ConfigError,
    DataDamaged,
    UnreadableRecording,
    each_readable,
)

INFO: Final = "meta/info.json"
DESCRIPTION_BYTES: Final = 64 * 2**20
"""Largest size of a JSON file of a data set."""
DATA_PATHS: Final = {
    2: "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
    3: "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
}
VIDEO_PATHS: Final = {
    2: "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
    3: "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
}
PLACE: Final = ("chunk_index", "file_index")
"""The columns that say in which file an episode is, v3.0."""
LFS: Final = b"version https://git-lfs"
"""What a file begins with that was cloned without its content."""
_FIELD: Final = re.compile(r"\{(?P<name>[a-z_]+)(?::0?(?P<width>[0-9])d)?\}")


@frozen(kw_only=True, eq=False)
class DataColumn:
    """A feature as `meta/info.json` declares it; `names` has a name for each number if it has one dimension."""

    key: str
    dtype: str
    shape: tuple[int, ...]
    names: tuple[str, ...]
    units: tuple[str, ...] = ()
    """The unit of each number, where the metadata of the feature has them."""


@frozen(kw_only=True, eq=False)
class Episode:
    """The frames of an episode, the task of each, and the videos that show it.

    `videos` has the path of each video within the folder, and the time (s) of its first frame of the episode.
    """

    index: int
    table: ColumnTable
    tasks: Sequence[str]
    videos: Mapping[str, tuple[str, float]]


@frozen(kw_only=True, eq=False)
class Folder:
    """A data set: its folder, its version (2 or 3), its frames per second, and its features by key."""

    place: Path
    version: int
    fps: float
    features: Mapping[str, DataColumn]
    info: Mapping[str, Any]

    @cached_property
    def tasks(self) -> Mapping[int, str]:
        """The text of each task. Raises DataDamaged."""
        if self.version == 2:
            rows = json_lines(self.place, "meta/tasks.jsonl")
            return {_whole(row, "task_index", "meta/tasks.jsonl"): str(row.get("task", "")) for row in rows}
        table = self.parquet("meta/tasks.parquet")
        texts = table.texts.get("task") or next(iter(table.texts.values()), None)
        if texts is None or "task_index" not in table.numbers:
            raise DataDamaged(f"{self.place}/meta/tasks.parquet needs the columns task and task_index")
        return dict(zip(map(int, table.numbers["task_index"]), texts, strict=True))

    def episodes(self) -> Iterator[Episode | UnreadableRecording]:
        """Yield every episode, in order, and of what is missing or cannot be read the reason. Raises DataDamaged."""
        rows = {_whole(row, "episode_index", "meta/episodes"): row for row in self._episode_rows()}
        if not rows:
            raise DataDamaged(f"{self.place}: no episode is described in meta/episodes")
        frames = sum(_whole(row, "length", "meta/episodes") for row in rows.values())
        told = [
            f"{INFO} says {claimed} {what}, and meta/episodes describes {described}"
            for what, described in (("episodes", len(rows)), ("frames", frames))
            if isinstance(claimed := self.info.get(f"total_{what}"), int) and claimed != described
        ]
        told += [
            f"meta/episodes goes from episode {earlier} to {later}"
            for earlier, later in pairwise((-1, *sorted(rows)))
            if later != earlier + 1
        ]
        for text in told:
            yield UnreadableRecording(source=INFO, error=DataDamaged(f"{self.place}: {text}"))
        # A file can have many episodes.
        table_of = lru_cache(maxsize=1)(partial(self.parquet, wanted=self._wanted))
        for index, row in sorted(rows.items()):
            yield from each_readable(f"episode {index}", partial(self._read_episode, row, table_of))

    def _read_episode(self, row: Mapping[str, Any], table_of: Callable[[str], ColumnTable]) -> tuple[Episode]:
        """Return an episode, from what `table_of` gives for its data file."""
        path = self._filled("data_path", self._numbers(row, "data/"))
        return (self._episode(row, path, table_of(path)),)

    def parquet(self, path: str, wanted: Sequence[str] | None = None) -> ColumnTable:
        """Return these columns of a Parquet file of the folder, or all. Raises DataDamaged, TooLarge."""
        file = self.place / path
        if not file.is_file():
            raise DataDamaged(f"{self.place}: {path} is missing")
        with file.open("rb") as opened:
            if opened.read(len(LFS)) == LFS:
                raise DataDamaged(
                    f"{self.place}: {path} is a pointer of Git LFS, not its content: git lfs pull"
                )
        return read_parquet(file, wanted)[0]

    @cached_property
    def _wanted(self) -> tuple[str, ...]:
        """The columns of a data file that are numbers."""
        numbers = [
            feature.key
            for feature in self.features.values()
            if feature.dtype not in ("video", "image", "string", "language")
        ]
        return tuple(dict.fromkeys((*numbers, "timestamp", "frame_index", "episode_index", "task_index")))

    def _episode_rows(self) -> Iterator[Mapping[str, Any]]:
        """Yield what `meta/episodes` says of each episode."""
        if self.version == 2:
            yield from json_lines(self.place, "meta/episodes.jsonl")
            return
        files = sorted((self.place / "meta" / "episodes").glob("*/*.parquet"))
        if not files:
            raise DataDamaged(f"{self.place}: meta/episodes has no Parquet file")
        videos = [
            f"videos/{feature.key}/{what}"
            for feature in self.features.values()
            if feature.dtype == "video"
            for what in ("chunk_index", "file_index", "from_timestamp")
        ]
        for file in files:
            table = read_parquet(
                file, ("episode_index", "length", "data/chunk_index", "data/file_index", *videos)
            )[0]
            for k in range(len(table)):
                yield {name: float(values[k]) for name, values in table.numbers.items() if values.ndim == 1}

    def _numbers(self, row: Mapping[str, Any], prefix: str) -> dict[str, int | str]:
        """Return the fields of the path of an episode's data, or of a video, whose columns begin with `prefix`."""
        index = _whole(row, "episode_index", "meta/episodes")
        if self.version == 2:
            return {"episode_chunk": index // self._chunk_size, "episode_index": index}
        numbers = {name: _whole(row, prefix + name, "meta/episodes") for name in PLACE}
        return {**numbers, "episode_index": index}

    @property
    def _chunk_size(self) -> int:
        size = self.info.get("chunks_size", 1000)
        if not isinstance(size, int) or size < 1:
            raise DataDamaged(f"{self.place}: chunks_size in {INFO} is {size!r}, not a whole number above 0")
        return size

    def _filled(self, key: str, fields: Mapping[str, int | str]) -> str:
        """Return a path of `meta/info.json` with its fields. Raises DataDamaged if it leaves the folder."""
        default = (DATA_PATHS if key == "data_path" else VIDEO_PATHS)[self.version]
        pattern = self.info.get(key) or default

        def value(match: re.Match[str]) -> str:
            filling = fields.get(match["name"])
            if filling is None:
                raise DataDamaged(
                    f"{self.place}: {key} in {INFO} has the unknown field {match['name']!r}; known are "
                    f"{', '.join(fields)}"
                )
            return str(filling).rjust(int(match["width"] or 0), "0")

        path = _FIELD.sub(value, str(pattern))
        parts = PurePosixPath(path)
        if parts.is_absolute() or ".." in parts.parts or "{" in path or "\\" in path or "\0" in path:
            raise DataDamaged(
                f"{self.place}: {key} in {INFO} is {str(pattern)[:80]!r}, which is no path in the folder"
            )
        return path

    def _episode(self, row: Mapping[str, Any], path: str, table: ColumnTable) -> Episode:
        index = _whole(row, "episode_index", "meta/episodes")
        observed = [name for name in self._wanted if name.startswith("observation") and name in table.texts]
        missing = [
            name
            for name in ("timestamp", "frame_index", "episode_index", *observed)
            if name not in table.numbers
        ]
        if missing:
            raise DataDamaged(
                f"{self.place}/{path} has no column of numbers, as many in each row, {', '.join(missing)}"
            )
        kept = table.numbers["episode_index"] == index
        length = _whole(row, "length", "meta/episodes")
        if int(kept.sum()) != length or not length:
            raise DataDamaged(
                f"{self.place}/{path} has {int(kept.sum())} frames of episode {index}, and meta/episodes says {length}"
            )
        frames = table.rows(np.flatnonzero(kept))
        return Episode(index=index, table=frames, tasks=self._tasks(frames, index), videos=self._videos(row))

    def _tasks(self, frames: ColumnTable, index: int) -> list[str]:
        numbers = frames.numbers.get("task_index")
        if numbers is None or not np.isfinite(numbers).all():
            return [""] * len(frames)
        tasks = [self.tasks.get(int(number)) for number in numbers]
        if None in tasks:
            raise DataDamaged(
                f"{self.place}: episode {index} has task_index {int(numbers[tasks.index(None)])}, and meta/tasks has "
                f"{len(self.tasks)} tasks"
            )
        return [task or "" for task in tasks]

    def _videos(self, row: Mapping[str, Any]) -> dict[str, tuple[str, float]]:
        videos = {}
        for feature in self.features.values():
            prefix = f"videos/{feature.key}/"
            known = self.version == 2 or all(prefix + name in row for name in PLACE)
            if feature.dtype == "video" and known:
                fields = {**self._numbers(row, prefix), "video_key": feature.key}
                start_s = float(row.get(f"{prefix}from_timestamp", 0.0))
                videos[feature.key] = self._filled("video_path", fields), start_s
        return videos


def read_folder(place: Path) -> Folder:
    """Return the data set in this folder. Raises ConfigError if it is none, DataDamaged."""
    if not place.is_dir():
        raise ConfigError(
            f"there is no folder {place}: name the folder of a LeRobot data set, which has {INFO}"
        )
    if not (place / INFO).is_file():
        raise ConfigError(f"{place} is not a LeRobot data set: it has no {INFO}")
    info = _json(_text(place, INFO), f"{place}/{INFO}")
    named = str(info.get("codebase_version", ""))
    match = re.fullmatch(r"v?(?:2\.1|3\.0)", named)
    if match is None:
        raise DataDamaged(
            f"{place}/{INFO} has the codebase_version {named[:40]!r}; v2.1 and v3.0 are read. LeRobot converts others"
        )
    fps = info.get("fps")
    if not isinstance(fps, int | float) or isinstance(fps, bool) or not 0 < fps < 1e6:
        raise DataDamaged(f"{place}/{INFO} has fps = {str(fps)[:40]}, not a number of frames per second")
    features = info.get("features")
    if not isinstance(features, dict) or not features:
        raise DataDamaged(f"{place}/{INFO} declares no features")
    return Folder(
        place=place,
        version=2 if "2." in named else 3,
        fps=float(fps),
        features={key: _feature(place, key, value) for key, value in features.items()},
        info=info,
    )


def _feature(place: Path, key: str, value: Any) -> DataColumn:
    shape = value.get("shape") if isinstance(value, dict) else None
    if not isinstance(shape, list) or not all(isinstance(size, int) and 0 < size < 10**7 for size in shape):
        raise DataDamaged(f"{place}/{INFO}: the feature {key[:80]!r} has no shape of whole numbers")
    given = _flat(value.get("names"))
    about = value.get("info")
    units = about.get("units") if isinstance(about, dict) else None
    return DataColumn(
        key=key,
        dtype=str(value.get("dtype", "")),
        shape=tuple(shape),
        names=given,
        units=tuple(map(str, units)) if isinstance(units, list) and len(units) == len(given) else (),
    )


def _flat(names: Any) -> tuple[str, ...]:
    """Return names that are in a list, in lists of a list, or in the lists of a table by the kind of motor."""
    if isinstance(names, dict):
        nested = all(isinstance(part, list | dict) for part in names.values())
        return _flat(list(names.values()) if nested else list(names))
    if isinstance(names, list):
        return tuple(name for part in names for name in _flat(part))
    return () if names is None else (str(names),)


def _json(text: str, where: str) -> dict[str, Any]:
    """Return the table of keys that a text of this place is. Raises DataDamaged."""
    try:
        values = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DataDamaged(f"{where} is not JSON: {error}") from error
    if not isinstance(values, dict):
        raise DataDamaged(f"{where} is not a table of keys")
    return values


def json_lines(place: Path, name: str) -> list[dict[str, Any]]:
    """Return the tables of a file with a JSON table in each line. Raises DataDamaged."""
    lines = enumerate(_text(place, name).splitlines(), 1)
    return [_json(line, f"{place}/{name}, line {number},") for number, line in lines if line.strip()]


def _text(place: Path, name: str) -> str:
    path = place / name
    if not path.is_file():
        raise DataDamaged(f"{place}: {name} is missing")
    size = path.stat().st_size
    if size > DESCRIPTION_BYTES:
        raise TooLarge(f"{path} has {size} bytes; at most {DESCRIPTION_BYTES} are read")
    try:
        return path.read_text("utf-8")
    except UnicodeDecodeError as error:
        raise DataDamaged(f"{path} is not UTF-8: {error}") from error


def _whole(row: Mapping[str, Any], key: str, where: str) -> int:
    value: Any = row.get(key)
    # NaN fails each comparison, so it never gets to int().
    whole = isinstance(value, int | float) and 0 <= value < 2**53 and value == int(value)
    if whole and not isinstance(value, bool):
        return int(value)
    raise DataDamaged(f"{where}: {key} is {str(value)[:40]}, not a whole number from 0 on")
