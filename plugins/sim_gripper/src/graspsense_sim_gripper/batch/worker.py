"""Plain grasps in a process of their own: two loops in the interpreter of one process would wait for each other.

The process is a fresh interpreter with `main` as its program, so that nothing of the caller's script runs a
second time. It is handed names and numbers: a line of JSON with the settings and the controller's registered name,
then a line with scenes and seeds at a time. It answers each with a line, and the traces behind it in numpy's own
format. The caller extracts features from the traces.
"""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from types import TracebackType
from typing import IO, Any, Final

import numpy as np
from attrs import asdict, fields

from graspsense.plugin_api import Outcome, RunConfig, Trace, create, recipe_of
from graspsense_sim_gripper.batch.job import Done, Job, chooser_of, done_of, plainly
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.setting import set_scene

_ARRAYS: Final = tuple(one.name for one in fields(Trace) if one.name != "units")


class NotHandedOver(Exception):
    """The job cannot be given to another process; the text says what of it and why."""


class PlainProcess:
    """A process that runs plain grasps of one job. Use it as a context: it ends with it."""

    def __init__(self, job: Job) -> None:
        self._job = job
        try:
            self._greeting = _line(
                {
                    # What names a class must be found where it is read: the same places, in the same order.
                    "path": [one or os.getcwd() for one in sys.path],
                    "config": asdict(job.config),
                    "controller": _named(job.controller),
                    "run": asdict(job.run),
                    "traces": job.traces or job.extract is not None,
                }
            )
        except Exception as error:
            raise NotHandedOver(f"the controller cannot be given to other processes: {error}") from error

    def __enter__(self) -> PlainProcess:
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", "from graspsense_sim_gripper.batch.worker import main; main()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.communicate()

    def run(self, scenes: Sequence[str], seeds: Sequence[int]) -> list[Done]:
        """Grasp these and return what came of each.

        Raises NotHandedOver, also where a grasp raised there: run here, it raises here.
        """
        to, of = self._process.stdin, self._process.stdout
        assert to is not None
        assert of is not None
        try:
            to.write(self._greeting + _line({"scenes": list(scenes), "seeds": [int(one) for one in seeds]}))
            to.flush()
            self._greeting = b""
            answer = _read_line(of)
            traces = io.BytesIO(_read(of, answer["bytes"]))
        except (OSError, EOFError) as error:
            raise NotHandedOver(f"the process for plain grasps has ended ({error})") from error
        if "refused" in answer:
            raise NotHandedOver(answer["refused"])
        job, found, chooser = self._job, [], chooser_of(self._job)
        for scene, seed, (outcome, reason, body) in zip(scenes, seeds, answer["done"], strict=True):
            begun = set_scene(job.config, scene, seed, chooser).body
            trace = _read_trace(traces) if job.traces or job.extract is not None else None
            found.append(done_of(job, Outcome(outcome), reason, _like(begun, body), trace))
        return found


def main() -> None:
    """Serve one caller until it hangs up."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    # What anything here prints must not get between the answers.
    os.dup2(2, 1)
    asked = sys.stdin.buffer
    try:
        greeting = _read_line(asked)
    except EOFError:
        return
    sys.path[:] = greeting["path"]
    job: Job | None = None
    while True:
        try:
            wanted = _read_line(asked)
        except EOFError:
            return
        traces = io.BytesIO()
        try:
            job = job or _job(greeting)
            done = [plainly(job, *one) for one in zip(wanted["scenes"], wanted["seeds"], strict=True)]
            for one in done:
                if one.kept is not None:
                    _write_trace(traces, one.kept)
            answer = {"done": [[one.outcome.value, one.reason, one.body] for one in done]}
            line = _line({**answer, "bytes": traces.tell()})
        except Exception as error:
            what = "a plain grasp" if job is not None else "the controller"
            traces = io.BytesIO()
            refused = f"{what} fails in another process: {type(error).__name__}: {error}"
            line = _line({"refused": refused, "bytes": 0})
        answers.write(line + traces.getbuffer())
        answers.flush()


def _job(greeting: dict[str, Any]) -> Job:
    name, values = greeting["controller"]
    return Job(
        config=SimConfig(**greeting["config"]),
        controller=create("controller", name, **values),
        run=RunConfig(**greeting["run"]),
        extract=None,
        traces=greeting["traces"],
    )


def _named(controller: Any) -> tuple[str, dict[str, Any]]:
    """Return the controller's name and settings, which must be all that there is to it."""
    name, values = recipe_of("controller", controller)
    twin = create("controller", name, **values)
    # As text, for NaN is not equal to itself.
    if repr((twin.params(), twin.init())) != repr((controller.params(), controller.init())):
        raise ValueError(f"another {name} made of its settings has other numbers")
    return name, values


def _line(value: Any) -> bytes:
    return json.dumps(value).encode() + b"\n"


def _read_line(stream: IO[bytes]) -> Any:
    line = stream.readline()
    if not line.endswith(b"\n"):
        raise EOFError("nothing more came from it")
    return json.loads(line)


def _read(stream: IO[bytes], n: int) -> bytes:
    found = stream.read(n)
    if len(found) < n:
        raise EOFError("it broke off in an answer")
    return found


def _write_trace(to: IO[bytes], trace: Trace) -> None:
    for name in _ARRAYS:
        np.lib.format.write_array(to, getattr(trace, name), allow_pickle=False)


def _read_trace(of: IO[bytes]) -> Trace:
    parts: dict[str, Any] = {name: np.lib.format.read_array(of, allow_pickle=False) for name in _ARRAYS}
    return Trace(**parts)


def _like(pattern: Any, values: Any) -> Any:
    """Return these values, lists in lists, as tuples of the kinds that `pattern` is made of."""
    if not isinstance(pattern, tuple):
        return values
    parts = [_like(*one) for one in zip(pattern, values, strict=True)]
    return type(pattern)(*parts) if hasattr(pattern, "_fields") else tuple(parts)
