"""Results on the disk: a folder with one file per task, each complete or absent.

OUT/experiment.toml   the experiment with every value filled in; it runs again by itself
OUT/pipelines/*.toml  the resolved pipelines that it names
OUT/parts/*.toml      the experiments that it consists of, likewise
OUT/provenance.json   versions, commit, machine, hashes of all inputs
OUT/results/KEY.json  the result of a task, written and flushed when it ended
OUT/report.html       the page
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from attrs import evolve, frozen

from graspsense.core.components.caller import option
from graspsense.core.components.strict import plain
from graspsense.core.files.toml_text import toml_lines
from graspsense.core.files.whole_file import SaveFailed, locked, opened_file, write_or_replace
from graspsense.core.settings.resolved import without_followers
from graspsense.core.settings.settings_file import to_toml
from graspsense.core.values.errors import ConfigError, named
from graspsense.evaluation.json_codec import from_json
from graspsense.experiments.experiment import PipelineOf, Planned
from graspsense.experiments.experiment_file import read_plan
from graspsense.experiments.task import Task, TaskResult
from graspsense.experiments.versions import versions
from graspsense.recording.provenance import process_provenance

EXPERIMENT: Final = "experiment.toml"
PIPELINES: Final = "pipelines"
PARTS: Final = "parts"
PROVENANCE: Final = "provenance.json"
RESULTS: Final = "results"
LOCK: Final = ".lock"
_TABLES: Final[Mapping[str, Any]] = {
    "inputs": dict[str, str] | None,
    "versions": dict[str, str] | None,
    "git": dict[str, dict[str, Any] | None] | None,
}
"""What is read of the provenance, and how it is made up."""


@frozen
class Results:
    """The results in a folder."""

    folder: Path

    def path(self, key: str) -> Path:
        """Return the file of the result of a task."""
        return self.folder / RESULTS / f"{key}.json"

    def add(self, done: TaskResult) -> None:
        """Store the result of a task; when this returns, it is on the disk. Raises SaveFailed."""
        _write(self.path(done.key), done.to_text() + "\n")

    def read(self, task: Task) -> tuple[TaskResult | None, str]:
        """Return the result of a task, or None and why its file cannot be read; the reason is empty without a file."""
        path = self.path(task.key)
        try:
            with opened_file(path) as file:
                done = TaskResult.from_text(file.read().decode())
            if done.key != task.key:
                raise ValueError("it is the result of another task")
            done.decoded(task.kind)
        except FileNotFoundError:
            return None, ""
        except OSError as error:
            return None, f"{path}: {error.strerror or error}"
        except ValueError as error:
            return None, f"{path} is damaged, or of another version: {named(error)}"
        return done, ""

    def finished(self, tasks: Iterable[Task]) -> list[TaskResult]:
        """Return the results of those of these tasks that have one, in their order."""
        return [done for done, _ in map(self.read, tasks) if done is not None]

    def any(self) -> bool:
        """Whether the folder has results."""
        return next((self.folder / RESULTS).glob("*.json"), None) is not None

    def begin(self, planned: Planned, command: str) -> None:
        """Write the experiment, its pipelines and its provenance next to the results. Raises SaveFailed."""
        folders = (PIPELINES, f"{PARTS}/{PIPELINES}") if planned.parts else (PIPELINES,)
        for name, pipeline in planned.pipelines.items():
            # Without the settings that follow another one, since a sweep may change that.
            text = to_toml(evolve(pipeline, values=without_followers(pipeline.values)))
            for folder in folders:
                _write(self.folder / folder / file_of(name), text)
        _write(self.folder / EXPERIMENT, resolved(planned))
        for part in planned.parts:
            _write(self.folder / PARTS / file_of(part.name), resolved(part))
        provenance = {
            "experiment": planned.name,
            "command": command,
            "begun_at": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            "versions": dict(versions()),
            "inputs": dict(planned.inputs),
            **process_provenance(),
        }
        _write(self.folder / PROVENANCE, json.dumps(provenance, indent=2, ensure_ascii=False) + "\n")

    def provenance(self) -> dict[str, Any]:
        """Return the provenance that `begin` wrote; empty if it cannot be read."""
        try:
            document: dict[str, Any] = json.loads((self.folder / PROVENANCE).read_text(encoding="utf-8"))
            return {**document, **{key: from_json(document.get(key), kind) for key, kind in _TABLES.items()}}
        except (OSError, ValueError, TypeError, AttributeError):  # it can be any JSON
            return {}

    def experiment(self) -> Planned:
        """Return the experiment of the folder, under the name that it was run by. Raises ConfigError."""
        planned = read_plan(str(self.folder / EXPERIMENT), force=True)
        provenance = self.provenance()
        # The results are those of the inputs that there were. Without them, an earlier version made the results.
        inputs = provenance.get("inputs") or {}
        return evolve(planned, name=str(provenance.get("experiment", planned.name)), inputs=inputs)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Lock the folder against other runs. Raises ConfigError if another run has it, SaveFailed."""
        try:
            (self.folder / RESULTS).mkdir(parents=True, exist_ok=True)
            (self.folder / PIPELINES).mkdir(exist_ok=True)
            lock = os.open(self.folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)
        except OSError as error:
            raise SaveFailed(
                f"cannot write to {self.folder}: {error.strerror}. Name another folder "
                f"({option('out', python='Results')})"
            ) from error
        try:
            if locked(lock) is False:
                raise ConfigError(
                    f"another run is writing to {self.folder}: wait for it, or name another folder "
                    f"({option('out', python='Results')})"
                )
            yield
        finally:
            os.close(lock)


def file_of(name: str) -> str:
    """Return the name of the file of a pipeline or of a part, which lies in the folder whatever its own name is."""
    plain = re.fullmatch(r"\w[\w .-]{0,99}", name)
    return f"{name if plain else hashlib.sha256(name.encode(errors='surrogateescape')).hexdigest()[:16]}.toml"


def resolved(planned: Planned) -> str:
    """Return the experiment as a file with all values."""
    values: dict[str, Any] = plain(planned.experiment)
    values["seeds"] = list(planned.seeds)
    if planned.parts:
        values["parts"] = [f"{PARTS}/{file_of(part.name)}" for part in planned.parts]
    values["pipelines"] = [
        plain(PipelineOf(name=name, pipeline=f"{PIPELINES}/{file_of(name)}")) for name in planned.pipelines
    ]
    if not planned.experiment.classifiers and planned.cases and not planned.parts:
        # Those of the pipelines, unless the sweep changes them.
        swept = any(key.split(".")[0] == "classifier" for key in planned.experiment.sweep)
        varied = any(variant.classifier for variant in planned.experiment.variants)
        learners = () if swept or varied else planned.cases[0].learners
        values["classifiers"] = [
            {"name": learner.name, "type": learner.type, **learner.config} for learner in learners
        ]
    head = f"# {planned.name}, with everything filled in: `graspsense experiment FILE` gives the same again."
    return "\n".join([head, *toml_lines(values)]) + "\n"


def _write(path: Path, text: str) -> None:
    write_or_replace(path, text.encode(errors="backslashreplace"), make_folder=True)
