"""Saving what a killed program left: recordings without an end, and recordings without a row.

Nothing is deleted: of a recording that was cut a whole one is written, and the cut one stays beside it as `.cut`.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

from attrs import evolve, frozen

from graspsense.core.config import build
from graspsense.core.errors import ConfigError, DataDamaged, GraspsenseError
from graspsense.core.features import Features
from graspsense.core.plugins import installed
from graspsense.recording.before_contact import before_contact
from graspsense.recording.layout import DEVICE, PART, START, TICK
from graspsense.recording.layout import PADS as PADS_STRUCT
from graspsense.recording.reader import RecordedGrasp, read_recorded
from graspsense.recording.recorder import NotKept
from graspsense.recording.trial_record import Ending, Row, beginning_in, ending_in
from graspsense.recording.writer import RecordingFile, Written
from graspsense.store.store import RecordingFacts, Store

if TYPE_CHECKING:
    from graspsense.core.trace import Trace

CUT: Final = ".cut"
RECOVERED: Final = "-recovered.mcap"


@frozen(kw_only=True)
class Recovered:
    """What became of one file.

    `kept` is a whole trial that only lacked its row, `saved` the beginning of one that was cut, `empty` a file
    in which nothing was felt, `busy` one that is being written, `failed` one of which nothing could be saved.
    """

    file: Path
    what: Literal["kept", "saved", "empty", "busy", "failed"]
    trial: int | None = None
    recording: Path | None = None
    ticks: int = 0
    why: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON values."""
        return {
            "file": str(self.file),
            "what": self.what,
            "trial": self.trial,
            "recording": None if self.recording is None else str(self.recording),
            "ticks": self.ticks,
            "why": self.why,
        }


def recover_store(store: Store) -> list[Recovered]:
    """Give every recording of a store that has none its row, cut recordings an end first. Raises NotKept."""
    found = []
    known = store.names()
    folder = store.recordings
    for path in sorted(folder.glob(f"*{RECOVERED}{PART}")):
        with _locked(path) as mine:
            if mine:  # an unfinished copy: what it is made from is still there
                path.unlink()
    for path in sorted(folder.glob("*.mcap")):
        if path.name not in known:
            found.append(_adopted(store, path))
    for path in sorted(folder.glob(f"*.mcap{PART}")):
        with _locked(path) as mine:
            if not mine:
                found.append(Recovered(file=path, what="busy", why="it is being written"))
            elif path.is_file():
                found.append(_finished(store, path))
    return found


def recover_file(path: str | Path, out: str | Path | None = None) -> Recovered:
    """Write what can be read of a recording into a new one; the file itself is not touched.

    `out` is by default `NAME-recovered.mcap` beside it. Raises ConfigError where there is no such file or nothing
    is to be done, DataDamaged where nothing can be read, NotKept where the new one cannot be written.
    """
    path = Path(path).expanduser()
    with _locked(path) as mine:
        if not mine:
            raise ConfigError(f"{path} is being written")
        grasp = read_recorded(path, salvage=True)
        if grasp.whole and not path.name.endswith(PART):
            raise ConfigError(f"{path} is whole: there is nothing to recover")
        if not len(grasp):
            raise DataDamaged(f"no tick can be read from {path}: {grasp.damage or 'there is none in it'}")
        target = Path(out).expanduser() if out else _beside(path)
        with _writing(target):
            write_again(grasp, target)
    return Recovered(file=path, what="saved", recording=target, ticks=len(grasp), why=_why(grasp))


def write_again(grasp: RecordedGrasp, path: Path) -> Written:
    """Write a recorded grasp as a new, whole recording. Raises OSError."""
    file = RecordingFile(path, grasp.base_ns)
    try:
        for name in (START, DEVICE):
            if name in grasp.metadata:
                file.metadata(name, grasp.metadata[name])
        at, t_of_pads = 0, grasp.pads["t_s"].tolist()
        for k, row in enumerate(grasp.ticks.tolist()):
            while at < len(t_of_pads) and grasp.pads_before[at] <= k:
                file.pads(t_of_pads[at], PADS_STRUCT.pack(*grasp.pads[at].item()))
                at += 1
            file.tick(row[0], TICK.pack(*row))
        for name in grasp.metadata:
            if name not in (START, DEVICE):
                file.metadata(name, grasp.metadata[name])
        return file.finish()
    except BaseException:
        file.remove()
        raise


def facts_of(path: Path, ticks: int, images: int) -> RecordingFacts:
    """Return what the store knows of a recording that lies in its folder. Raises OSError."""
    with path.open("rb") as file:
        sha256 = hashlib.file_digest(file, "sha256").hexdigest()
    return RecordingFacts(
        name=path.name, sha256=sha256, size=path.stat().st_size, counts={"ticks": ticks, "images": images}
    )


def _finished(store: Store, part: Path) -> Recovered:
    """Make a whole recording of a part, and a row of that."""
    path, copy = part.with_name(part.name.removesuffix(PART)), _beside(part)
    try:
        grasp = read_recorded(part, salvage=True)
        if not len(grasp):
            part.rename(part.with_name(path.name + CUT))
            return Recovered(file=part, what="empty", why=grasp.damage or "no tick is in it")
        if grasp.whole:
            with part.open("rb") as file:
                os.fsync(file.fileno())
            part.rename(path)
            return evolve(_adopted(store, path), file=part)
        if not copy.exists():
            with _writing(copy):
                write_again(grasp, copy)
        result = _adopted(store, copy)
        if result.trial is not None:
            part.rename(part.with_name(path.name + CUT))
        return evolve(result, file=part, why=result.why or _why(grasp))
    except NotKept:
        raise
    except GraspsenseError as error:
        return Recovered(file=part, what="failed", why=str(error))


def _adopted(store: Store, path: Path) -> Recovered:
    """Make a row of a whole recording, as far as its grasp came."""
    try:
        grasp = read_recorded(path)
        start = beginning_in(grasp.metadata, str(path))
        end = ending_in(grasp.metadata, str(path))
        whole = end is not None
        if end is None:
            end = _broken_off(grasp, start.settings)
        facts = facts_of(path, len(grasp), len(grasp.pads))
        number = store.add(start, end, grasp.device, facts, whole=whole)
    except NotKept:
        raise
    except GraspsenseError as error:
        return Recovered(file=path, what="failed", why=str(error))
    except (tomllib.TOMLDecodeError, KeyError, AttributeError, OSError) as error:
        why = f"its settings cannot be read: {error}"
        return Recovered(file=path, what="failed", recording=path, ticks=len(grasp), why=why)
    return Recovered(
        file=path, what="kept" if whole else "saved", trial=number, recording=path, ticks=len(grasp)
    )


def _broken_off(grasp: RecordedGrasp, settings: str) -> Ending:
    """Return the ending of a grasp that has none: aborted, with the features of what there is."""
    trace = grasp.trace()
    seconds = float(trace.t_s[-1] - trace.t_s[0]) if len(trace) else 0.0
    why = f"the program was killed; {seconds:.3f} s of the grasp were recovered"
    features = _features(trace, settings, why)
    return Ending(
        trial={"outcome": "aborted", "reason": why}, features=features, before=Row.of(before_contact(trace))
    )


def _features(trace: Trace, settings: str, why: str) -> Row:
    table = tomllib.loads(settings)["features"]
    try:
        component = installed().find("feature-set", table["type"])
        config = build(component, {key: value for key, value in table.items() if key != "type"})
        extracted: Features = component.create(config).extract(trace)
    except GraspsenseError as error:
        return Row(features=(), values=(), reasons={"": f"{why}; its features cannot be drawn here: {error}"})
    return Row.of(extracted)


def _beside(path: Path) -> Path:
    return path.with_name(path.name.removesuffix(PART).removesuffix(".mcap") + RECOVERED)


def _why(grasp: RecordedGrasp) -> str:
    lost = f"; {grasp.lost} messages in it are lost" if grasp.lost else ""
    return (grasp.damage or "it has no end") + lost


@contextmanager
def _locked(path: Path) -> Iterator[bool]:
    """Hold the lock that a writer of this file would hold; False where one does."""
    try:
        file = path.open("rb")
    except FileNotFoundError:
        raise ConfigError(f"there is no recording {path}") from None
    except OSError as error:
        raise ConfigError(f"the recording {path} cannot be read: {error.strerror}") from error
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
            return
        yield True


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except FileExistsError as error:
        raise NotKept(f"{path} is there already: name another file, or move it away") from error
    except OSError as error:
        raise NotKept(f"{path} cannot be written: {error.strerror}") from error
