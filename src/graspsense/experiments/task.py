"""A task: what one worker does in one go, as plain data, so that it can be sent, stored and done again."""

from __future__ import annotations

import hashlib
import json
import platform
import sys
import time
import traceback
from collections.abc import Mapping
from contextlib import redirect_stdout
from typing import Any, Literal

from attrs import field, frozen

from graspsense.core.errors import GraspsenseError, named
from graspsense.core.json_values import json_text
from graspsense.experiments.kinds import kind_of
from graspsense.experiments.versions import versions

State = Literal["done", "failed"]


@frozen(kw_only=True)
class Task:
    """What is to be done: a kind of task (see `kinds`), its params as JSON values, and the seed of all randomness.

    `name` is for people; it takes no part in the key.
    """

    kind: str
    params: Mapping[str, Any]
    seed: int
    name: str = ""

    @property
    def key(self) -> str:
        """The hash of everything that the result follows from."""
        text = _text({"kind": self.kind, "params": self.params, "seed": self.seed})
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    def to_text(self) -> str:
        """Return it as JSON text, in one line; a setting may be infinite, which Python's JSON can say."""
        return _text({"kind": self.kind, "params": self.params, "seed": self.seed, "name": self.name})

    @classmethod
    def from_text(cls, text: str) -> Task:
        """Return the task that `to_text` gave."""
        return cls(**json.loads(text))


@frozen(kw_only=True)
class Done:
    """What came of a task: a `result`, or a `reason` why there is none.

    `made` says where, when and with which versions; nothing of it is part of the result.
    """

    key: str
    name: str
    state: State
    result: Mapping[str, Any] | None = None
    reason: str = ""
    made: Mapping[str, Any] = field(factory=dict)

    @property
    def seconds(self) -> float:
        """How long the task took, 0 where that is not known."""
        return float(self.made.get("seconds", 0.0))

    def to_text(self) -> str:
        """Return it as JSON text."""
        return json_text(
            {
                "key": self.key,
                "name": self.name,
                "state": self.state,
                "result": self.result,
                "reason": self.reason,
                "made": self.made,
            }
        )

    @classmethod
    def from_text(cls, text: str) -> Done:
        """Return what `to_text` gave. Raises ValueError, KeyError or TypeError for what is no such text."""
        values = json.loads(text)
        if values["state"] not in ("done", "failed") or (values["result"] is None) != (
            values["state"] == "failed"
        ):
            raise ValueError("it is neither done nor failed")
        return cls(**values)

    @classmethod
    def failed(cls, task: Task, reason: str) -> Done:
        """Return that a task has failed, for a reason that the task itself could not tell."""
        return cls(key=task.key, name=task.name, state="failed", reason=reason)


def run_task(text: str) -> str:
    """Do the task in this JSON text and return what came of it, as text: nothing else passes between processes.

    Whatever a plugin raises is a failure with its reason; only what ends the process ends this.
    """
    task = Task.from_text(text)
    begun, cpu = time.time(), time.process_time()
    clock = time.monotonic()
    result: Mapping[str, Any] | None = None
    reason = where = ""
    try:
        # What a plugin prints is no part of anybody's answer.
        with redirect_stdout(sys.stderr):
            found = kind_of(task.kind).function()(task.params, task.seed)
        # As text at once: what a plugin slipped in and JSON does not hold is found here.
        result = json.loads(json_text(found))
    except GraspsenseError as error:
        reason = str(error)
    except (Exception, SystemExit) as error:
        reason, where = named(error), "".join(traceback.format_exception(error)[-6:])
    made = {
        "at": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(begun)),
        "seconds": round(time.monotonic() - clock, 3),
        "cpu_seconds": round(time.process_time() - cpu, 3),
        "host": platform.node(),
        "versions": versions(),
        **({"traceback": where} if where else {}),
    }
    state: State = "failed" if result is None else "done"
    return Done(key=task.key, name=task.name, state=state, result=result, reason=reason, made=made).to_text()


def _text(values: Mapping[str, Any]) -> str:
    return json.dumps(values, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
