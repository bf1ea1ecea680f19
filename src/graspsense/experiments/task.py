"""A task: one unit of work as plain data, so that it can be sent to a worker, stored and repeated."""

from __future__ import annotations

import hashlib
import json
import platform
import sys
import time
import traceback
from collections.abc import Mapping
from contextlib import redirect_stdout
from typing import TYPE_CHECKING, Any, Literal

from attrs import asdict, field, frozen

from graspsense.core.learn.model_content import digest
from graspsense.core.values.errors import FAILURES, DataDamaged, GraspsenseError, named, place_of
from graspsense.core.values.json_values import json_ready, json_text
from graspsense.evaluation.json_codec import from_json
from graspsense.experiments.kinds import kind_of
from graspsense.experiments.versions import versions

if TYPE_CHECKING:
    from graspsense.experiments.task_results import AnyTaskResult

State = Literal["done", "failed"]


@frozen(kw_only=True)
class Task:
    """A kind of task (see `kinds`), its parameters as JSON values, and the seed of all random numbers.

    `name` is for messages; it is not part of the key.
    """

    kind: str
    params: Mapping[str, Any]
    seed: int
    name: str = ""

    @property
    def key(self) -> str:
        """The hash of everything that determines the result."""
        text = _text({"kind": self.kind, "params": self.params, "seed": self.seed})
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    def to_text(self) -> str:
        """Return JSON in one line. Settings may be infinite, which Python's JSON can write and read."""
        return _text(asdict(self, recurse=False))

    @classmethod
    def from_text(cls, text: str) -> Task:
        """Return the task that `to_text` wrote."""
        return cls(**json.loads(text))


@frozen(kw_only=True)
class TaskResult:
    """The result of a task as JSON values, or the `reason` why there is none.

    `made` records where, when and with which versions the task ran; it is not part of the result.
    """

    key: str
    name: str
    state: State
    result: Mapping[str, Any] | None = None
    reason: str = ""
    made: Mapping[str, Any] = field(factory=dict)

    @property
    def seconds(self) -> float:
        """The duration of the task, 0 if it is not known."""
        return float(self.made.get("seconds", 0.0))

    @property
    def cpu_seconds(self) -> float:
        """The processor time of the task, 0 if it is not known."""
        return float(self.made.get("cpu_seconds", 0.0))

    def decoded(self, kind: str) -> AnyTaskResult | None:
        """Return the result with its type, None if the task failed. Raises DataDamaged if it cannot be read."""
        if self.result is None:
            return None
        try:
            decoded: AnyTaskResult = from_json(self.result, kind_of(kind).result_class())
        except Exception as error:
            raise DataDamaged(
                f"the result of {self.name or self.key} cannot be read: {named(error)}"
            ) from error
        return decoded

    def to_text(self) -> str:
        """Return JSON in one line, with the hash of its content."""
        content = asdict(self, recurse=False)
        return json_text({**content, "sha256": digest(json_ready(content))})

    @classmethod
    def from_text(cls, text: str) -> TaskResult:
        """Return the result that `to_text` wrote. Raises ValueError, KeyError or TypeError for any other text."""
        values = json.loads(text)
        if not isinstance(values, dict):
            raise TypeError("it is no JSON object")
        if values.pop("sha256") != digest(values):
            raise ValueError("its sha256 does not match")
        if values["state"] not in ("done", "failed") or (values["result"] is None) != (
            values["state"] == "failed"
        ):
            raise ValueError("it is neither done nor failed")
        return cls(**values)

    @classmethod
    def failed(cls, task: Task, reason: str) -> TaskResult:
        """Return the result of a task that failed outside of its own function."""
        return cls(key=task.key, name=task.name, state="failed", reason=reason)


def run_task(text: str) -> str:
    """Run the task in this JSON text and return its result as JSON text; processes exchange nothing else.

    An exception of a plugin becomes a failed result with its reason.
    """
    task = Task.from_text(text)
    begun, cpu = time.time(), time.process_time()
    clock = time.monotonic()
    result: Mapping[str, Any] | None = None
    reason = where = ""
    try:
        # Plugins may print; standard output carries results only.
        with redirect_stdout(sys.stderr):
            kind = kind_of(task.kind)
            # Encoded here, so that a value of a plugin that JSON cannot hold fails this task alone, and at once.
            result = kind.encoded(kind.function()(task.params, task.seed))
    except GraspsenseError as error:
        reason = str(error)
    except FAILURES as error:
        reason, where = named(error) + place_of(error), "".join(traceback.format_exception(error)[-6:])
    made = {
        "at": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(begun)),
        "seconds": round(time.monotonic() - clock, 3),
        "cpu_seconds": round(time.process_time() - cpu, 3),
        "host": platform.node(),
        "versions": versions(),
        **({"traceback": where} if where else {}),
    }
    state: State = "failed" if result is None else "done"
    return TaskResult(
        key=task.key, name=task.name, state=state, result=result, reason=reason, made=made
    ).to_text()


def _text(values: Mapping[str, Any]) -> str:
    return json.dumps(values, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
