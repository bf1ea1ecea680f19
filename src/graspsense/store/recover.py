"""Recovering what a killed program left: recordings without an end, and recordings without a row in the store.

Nothing is deleted. An incomplete recording is copied into a complete one, and itself kept with the suffix `.cut`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, Literal

from attrs import asdict, evolve, frozen

from graspsense.core.components.registry import installed
from graspsense.core.files.whole_file import SaveFailed, locked
from graspsense.core.settings.selected import build
from graspsense.core.values.errors import FAILURES, ConfigError, DataDamaged, GraspsenseError
from graspsense.core.values.features import Features
from graspsense.core.values.trace import Trace
from graspsense.recording.before_contact import before_contact, contact_force_of
from graspsense.recording.layout import DEVICE, PART, START, TICK
from graspsense.recording.reader import read_recorded
from graspsense.recording.recorded_grasp import RecordedGrasp, TopicRows
from graspsense.recording.recording_info import RecordingInfo
from graspsense.recording.trial_record import TrialRecord, TrialResult
from graspsense.recording.writer import RecordingWriter
from graspsense.store.opening import damaged
from graspsense.store.store import Store, integrity

CUT: Final = ".cut"
RECOVERED: Final = "-recovered.mcap"
_WHY_BUSY: Final[Mapping[bool | None, str]] = {
    False: "it is being written",
    None: "this disk has no locks, so that it may be being written: recover a copy on another disk",
}


@frozen(kw_only=True)
class Recovered:
    """What was done with one file.

    `what` is `added` for a complete recording that only lacked its row, `recovered` for the readable part of an
    incomplete one, `empty` for a file without a tick, `busy` for one that is being written, and `failed` if nothing
    could be recovered. `why` gives the reason.
    """

    file: Path
    what: Literal["added", "recovered", "empty", "busy", "failed"]
    trial: int | None = None
    recording: Path | None = None
    ticks: int = 0
    why: str = ""

    @property
    def words(self) -> str:
        """What was done, in one line."""
        where = f" as trial {self.trial}" if self.trial is not None else f" in {self.recording}"
        why = f": {self.why}" if self.why else ""
        return f"{self.file.name}: {self.what}{where if self.recording else ''}, {self.ticks} ticks{why}"

    def as_json(self) -> dict[str, Any]:
        """Return the fields as JSON values."""
        return asdict(
            self, value_serializer=lambda _, field, value: str(value) if isinstance(value, Path) else value
        )


def recover_store(store: Store) -> list[Recovered]:
    """Complete every unfinished recording of a store, and add a row for each that has none.

    Raises DataDamaged, before anything is changed, if the database of the store is malformed; SaveFailed.
    """
    problems = integrity(store)
    if problems:
        raise damaged(store.folder, f"the database: {problems[0]}")
    results = []
    known = store.recording_names()
    folder = store.recordings
    for path in sorted(folder.glob(f"*{RECOVERED}{PART}")):
        if not path.is_file():
            continue
        with _locked(path) as mine:
            if mine:  # an unfinished copy, whose original still exists
                path.unlink()
    without_row = [path for path in folder.glob("*.mcap") if path.name not in known and path.is_file()]
    # With several of them the database is lost: their trials get their numbers in the order of recording.
    for path in sorted(without_row, key=_made_at) if len(without_row) > 1 else without_row:
        results.append(_add_row(store, path))
    for path in sorted(folder.glob(f"*.mcap{PART}")):
        if not path.is_file():
            continue  # `verify` names it
        with _locked(path) as mine:
            if not mine:
                results.append(Recovered(file=path, what="busy", why=_WHY_BUSY[mine]))
            elif path.is_file():
                results.append(_complete(store, path))
    return results


def recover_file(path: str | Path, out: str | Path | None = None) -> Recovered:
    """Copy what can be read of a recording into a new one; the original is not changed.

    `out` is `NAME-recovered.mcap` in the same folder by default. Raises ConfigError if the file does not exist or is
    complete, DataDamaged if no tick can be read, SaveFailed if the copy cannot be written.
    """
    path = Path(os.path.expanduser(path))
    with _locked(path) as mine:
        if not mine:
            raise ConfigError(f"{path}: {_WHY_BUSY[mine]}")
        grasp = read_recorded(path, salvage=True)
        if grasp.complete and not path.name.endswith(PART):
            raise ConfigError(f"{path} is complete: there is nothing to recover")
        if not len(grasp):
            raise DataDamaged(f"no tick can be read from {path}: {grasp.damage or 'it has none'}")
        target = Path(os.path.expanduser(out)) if out else _beside(path)
        write_copy(grasp, target)
    return Recovered(file=path, what="recovered", recording=target, ticks=len(grasp), why=_why(grasp))


def write_copy(grasp: RecordedGrasp, path: Path) -> RecordingInfo:
    """Write a recorded grasp as a new, complete recording. Raises SaveFailed."""
    try:
        return _copied(grasp, RecordingWriter(path, grasp.base_ns))
    except FileExistsError as error:
        raise SaveFailed(f"{path} already exists: name another file, or move it away") from error
    except OSError as error:
        raise SaveFailed(f"{path} cannot be written: {error.strerror}") from error


def _copied(grasp: RecordedGrasp, file: RecordingWriter) -> RecordingInfo:
    try:
        for name in (START, DEVICE):
            if name in grasp.metadata:
                file.metadata(name, grasp.metadata[name])
        messages: list[tuple[int, int, TopicRows, int]] = []
        for topic in grasp.topics.values():
            number = file.topic(topic.topic)
            messages += [(tick, number, topic, i) for i, tick in enumerate(topic.next_tick)]
        messages.sort(key=lambda message: message[0], reverse=True)
        for k, row in enumerate(grasp.ticks.tolist()):
            while messages and messages[-1][0] <= k:
                _, number, topic, i = messages.pop()
                file.signal(number, topic.topic.wire.pack(*topic.numbers(i)))
            file.tick(TICK.pack(*row))
        for name in grasp.metadata:
            if name not in (START, DEVICE):
                file.metadata(name, grasp.metadata[name])
        return file.finish()
    except BaseException:
        file.remove()
        raise


def _made_at(path: Path) -> tuple[str, str]:
    """Return when a recording was made, then its name; a recording that cannot be read comes first."""
    try:
        return read_recorded(path).record().made_at, path.name
    except GraspsenseError:
        return "", path.name


def _complete(store: Store, part: Path) -> Recovered:
    """Complete an unfinished recording and add its row."""
    path, copy = part.with_name(part.name.removesuffix(PART)), _beside(part)
    try:
        grasp = read_recorded(part, salvage=True)
        if not len(grasp):
            part.rename(part.with_name(path.name + CUT))
            return Recovered(file=part, what="empty", why=grasp.damage or "it has no tick")
        if grasp.complete and path.exists():
            return Recovered(
                file=part, what="failed", why=f"there is a {path.name} too: move one of them away"
            )
        if grasp.complete:
            with part.open("rb") as file:
                os.fsync(file.fileno())
            part.rename(path)
            return evolve(_add_row(store, path), file=part)
        if not copy.exists():
            write_copy(grasp, copy)
        result = _add_row(store, copy)
        if result.trial is not None:
            part.rename(part.with_name(path.name + CUT))
        return evolve(result, file=part, why=result.why or _why(grasp))
    except SaveFailed:
        raise
    except GraspsenseError as error:
        return Recovered(file=part, what="failed", why=str(error))


def _add_row(store: Store, path: Path) -> Recovered:
    """Add a row for a complete recording. A grasp without a result counts as aborted."""
    try:
        grasp = read_recorded(path)
        record = grasp.record()
        complete = record.result is not None
        if record.result is None:
            record = evolve(record, result=_aborted(grasp, record))
        if record.device is None:
            record = evolve(record, device=grasp.device)
        number = store.add(record, RecordingInfo.hashed(path, len(grasp), len(grasp.pads)), complete=complete)
    except SaveFailed:
        raise
    except GraspsenseError as error:
        return Recovered(file=path, what="failed", why=str(error))
    except OSError as error:
        return Recovered(file=path, what="failed", recording=path, why=str(error))
    return Recovered(
        file=path, what="added" if complete else "recovered", trial=number, recording=path, ticks=len(grasp)
    )


def _aborted(grasp: RecordedGrasp, record: TrialRecord) -> TrialResult:
    """Return the result of a grasp that was cut off: aborted, with the features of the part that exists."""
    trace = grasp.trace()
    seconds = float(trace.t_s[-1] - trace.t_s[0]) if len(trace) else 0.0
    why = f"the program was killed; {seconds:.3f} s of the grasp were recovered"
    return TrialResult(
        outcome="aborted",
        reason=why,
        features=_features(trace, record, why),
        before_contact=before_contact(trace, contact_force_of(record.settings)),
    )


def _features(trace: Trace, record: TrialRecord, why: str) -> Features:
    """Extract the features with the feature set that the trial was recorded with, if it is installed."""
    try:
        table = dict(record.settings["features"])
        component = installed().find("feature-set", table.pop("type"))
        extracted: Features = component.create(build(component, table)).extract(trace)
    except FAILURES as error:
        reason = f"{why}; its features cannot be extracted here: {error}"
        return Features(names=(), values=(), units=(), reasons={"": reason})
    return extracted


def _beside(path: Path) -> Path:
    return path.with_name(path.name.removesuffix(PART).removesuffix(".mcap") + RECOVERED)


def _why(grasp: RecordedGrasp) -> str:
    lost = f"; {grasp.lost} messages in it are lost" if grasp.lost else ""
    return (grasp.damage or "it has no end") + lost


def is_being_written(path: Path) -> bool:
    """Return whether a writer is at work on this file; a file that has gone in the meantime is finished."""
    try:
        with _locked(path) as mine:
            return mine is False
    except ConfigError:
        return True


@contextmanager
def _locked(path: Path) -> Iterator[bool | None]:
    """Hold the lock that the writer of this file holds; yield False if a writer has it, None if that is not known."""
    try:
        if path.exists() and not path.is_file():
            raise ConfigError(f"{path} is not a file")
        file = path.open("rb")
    except FileNotFoundError:
        raise ConfigError(f"there is no recording {path}") from None
    except OSError as error:
        raise ConfigError(f"the recording {path} cannot be read: {error.strerror}") from error
    with file:
        yield locked(file.fileno())
