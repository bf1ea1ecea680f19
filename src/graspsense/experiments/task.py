"""A task: one unit of work as plain data, so that it can be sent to a worker, stored and repeated."""

from __future__ import annotations

import hashlib
import json
import platform
import re
import sys
import time
import traceback
from collections.abc import Mapping
from contextlib import redirect_stdout
from typing import TYPE_CHECKING, Any, Final

from attrs import asdict, field, frozen

from graspsense.core.components.caller import command_line
from graspsense.core.learn.model_content import digest
from graspsense.core.values.errors import FAILURES, ConfigError, GraspsenseError, listed, named, place_of
from graspsense.core.values.json_values import json_text
from graspsense.evaluation.json_codec import from_json, to_json
from graspsense.experiments.kinds import kind_of
from graspsense.experiments.versions import versions
from graspsense.sources.input_content import contents_of

if TYPE_CHECKING:
    from graspsense.experiments.task_results import AnyTaskResult

_FOLDERS: Final = re.compile(r"[^:,]*/")
"""The folders before the name of a file, also behind a colon or a comma."""


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
        """The hash of everything that determines the result: of an input name and content, wherever it lies."""
        inputs = self.params.get("inputs", {})
        params = _by_content({**self.params, "inputs": sorted(inputs.values())}, inputs)
        text = _text({"kind": self.kind, "params": params, "seed": self.seed})
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    def to_text(self) -> str:
        """Return JSON in one line. Settings may be infinite, which Python's JSON can write and read."""
        return _text(asdict(self, recurse=False))

    def failed(self, reason: str) -> TaskResult:
        """Return the result of the task if it failed outside of its own function."""
        return TaskResult(key=self.key, name=self.name, reason=reason)

    @classmethod
    def from_text(cls, text: str) -> Task:
        """Return the task that `to_text` wrote."""
        return cls(**json.loads(text))


@frozen(kw_only=True)
class Made:
    """Where, when, how long and with which versions a task ran; it is not part of the result. Zeros are not known."""

    begun_at: str = ""
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    host: str = ""
    versions: Mapping[str, str] = field(factory=dict)
    traceback: str = ""


@frozen(kw_only=True)
class TaskResult:
    """The result of a task as JSON values, or the `reason` why there is none: the task failed."""

    key: str
    name: str
    result: Mapping[str, Any] | None = None
    reason: str = ""
    made: Made = field(factory=Made)

    def decoded(self, kind: str) -> AnyTaskResult | None:
        """Return the result with its type, None if the task failed. Raises ValueError if it is of another form."""
        if self.result is None:
            return None
        decoded: AnyTaskResult = from_json(self.result, kind_of(kind).result_class())
        return decoded

    def to_text(self) -> str:
        """Return JSON in one line, with the hash of its content."""
        content = to_json(self)
        return json_text({**content, "sha256": digest(content)})

    @classmethod
    def from_text(cls, text: str) -> TaskResult:
        """Return the result that `to_text` wrote. Raises ValueError for any other text."""
        values = json.loads(text)
        if not isinstance(values, dict) or values.pop("sha256", None) != digest(values):
            raise ValueError("its sha256 does not match")
        return from_json(values, cls)


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
        # Plugins may print; standard output carries results only. Their words are the same in every process.
        with redirect_stdout(sys.stderr), command_line(taken=False):
            kind = kind_of(task.kind)
            # Encoded here, so that a value of a plugin that JSON cannot hold fails this task alone, and at once.
            result = kind.encoded(kind.declared.load("run")(task.params, task.seed))
        _refuse_other_inputs(task)
    except GraspsenseError as error:
        result, reason = None, str(error)
    except FAILURES as error:
        reason, where = named(error) + place_of(error), "".join(traceback.format_exception(error)[-6:])
    made = Made(
        begun_at=time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(begun)),
        seconds=round(time.monotonic() - clock, 3),
        cpu_seconds=round(time.process_time() - cpu, 3),
        host=platform.node(),
        versions=versions(),
        traceback=where,
    )
    return TaskResult(key=task.key, name=task.name, result=result, reason=reason, made=made).to_text()


def _refuse_other_inputs(task: Task) -> None:
    """Raise ConfigError if inputs of a task have another content here than where and when the experiment was read."""
    planned = task.params.get("inputs", {})
    params = {key: value for key, value in task.params.items() if key != "inputs"}
    # Workers have the same code, or are refused; it may write a file that it names.
    present = contents_of([task.kind, params], code=False) if planned else {}
    changed = [name for name, content in planned.items() if present.get(name, content) != content]
    if changed:
        raise ConfigError(
            f"changed while the experiment ran, or other files on {platform.node()}: {listed(changed)}. Resume the "
            "experiment"
        )


def _by_content(value: Any, inputs: Mapping[str, str]) -> Any:
    """Return parameters with the name and the content of each input in place of the text that names it."""
    if isinstance(value, str):
        return f"{_FOLDERS.sub('', value)} {inputs[value]}" if value in inputs else value
    if isinstance(value, Mapping):
        return {key: _by_content(inner, inputs) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_by_content(inner, inputs) for inner in value]
    return value


def _text(values: Mapping[str, Any]) -> str:
    return json.dumps(values, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
