"""Grasps of a simulator in the interpreter of another process, because loops in one process share the interpreter lock.

The process is a new interpreter, so that the script of the caller is not imported a second time. It reads a line of
JSON with what all grasps have in common, and then a line for each grasp. It answers with a line of JSON, followed by
the columns of the trace in numpy's npz format.
"""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from types import TracebackType
from typing import IO, Any, Final, NamedTuple, Self

import numpy as np
from attrs import asdict, fields

from graspsense.core.components.roles import Controller
from graspsense.core.components.run_config import RunConfig
from graspsense.core.settings.selected import create, recipe_of
from graspsense.core.values.signals import GraspEvent, Outcome, Phase
from graspsense.core.values.trace import Trace

COLUMNS: Final = tuple(
    column.name for column in fields(Trace) if column.name not in ("units", "signals", "events")
)
"""The columns of a trace that a process hands over."""


class NotHandedOver(Exception):
    """A grasp cannot run in another process, or failed there; the text gives the reason.

    The caller then runs it here, which raises the original exception.
    """


class HandedGrasp(NamedTuple):
    """What a process hands over of a grasp: `further` is what it knows besides, in JSON values."""

    outcome: Outcome
    reason: str
    trace: Trace | None
    further: Mapping[str, Any]


class GraspProcess:
    """A process that runs grasps. Use it as a context manager, which starts and ends the process.

    `target` is the text `module:function` of a function that gets the controller, the settings of the run, and
    `common`, the JSON values that all grasps share. It is called in the process before the first grasp, and returns
    what runs the grasp of a scene with a seed. Signals of a trace are not handed over. Raises NotHandedOver if the
    controller cannot be created again from its name and settings.
    """

    def __init__(
        self, target: str, controller: Controller[Any], run: RunConfig, common: Mapping[str, Any]
    ) -> None:
        self._target = target
        try:
            self._greeting = _line(
                {
                    # The process has to find the same classes: the same folders, in the same order.
                    "path": [folder or os.getcwd() for folder in sys.path],
                    "controller": _named(controller),
                    "run": asdict(run),
                    "common": common,
                }
            )
        except Exception as error:
            raise NotHandedOver(f"the controller cannot be given to other processes: {error}") from error

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", f"from {__name__} import main; main()", self._target],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.communicate()

    def grasp(self, scene: str, seed: int) -> HandedGrasp:
        """Run a grasp there. Raises NotHandedOver, also if the process has ended."""
        requests, answers = self._process.stdin, self._process.stdout
        assert requests is not None
        assert answers is not None
        try:
            requests.write(self._greeting + _line([scene, int(seed)]))
            requests.flush()
            self._greeting = b""
            answer = _read_line(answers)
            columns = io.BytesIO(_read(answers, answer["bytes"]))
        except (OSError, EOFError) as error:
            raise NotHandedOver(f"the process for plain grasps has ended ({error})") from error
        if "refused" in answer:
            raise NotHandedOver(answer["refused"])
        trace = None
        if answer["bytes"]:
            events = (GraspEvent(t_s, Phase(phase), *told) for t_s, phase, *told in answer["events"])
            with np.load(columns, allow_pickle=False) as stored:
                trace = Trace(**stored, events=tuple(events))
        return HandedGrasp(Outcome(answer["outcome"]), answer["reason"], trace, answer["further"])


def main() -> None:
    """Answer the requests on the standard input until it ends, by the target that the command line names."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    # Text that other code prints must not appear between the answers.
    os.dup2(2, 1)
    asked, grasp = sys.stdin.buffer, None
    try:
        greeting = _read_line(asked)
        sys.path[:] = greeting["path"]
        while True:
            wanted, columns = _read_line(asked), io.BytesIO()
            try:
                grasp = grasp or _made(sys.argv[1], greeting)
                answer = _answer(grasp(*wanted), columns)
            except Exception as error:
                what = "the controller" if grasp is None else "a plain grasp"
                columns = io.BytesIO()
                answer = {"refused": f"{what} fails in another process: {type(error).__name__}: {error}"}
            answers.write(_line({**answer, "bytes": columns.tell()}) + columns.getbuffer())
            answers.flush()
    except EOFError:
        return


def _made(target: str, greeting: Mapping[str, Any]) -> Callable[[str, int], HandedGrasp]:
    name, values = greeting["controller"]
    controller, run = create("controller", name, **values), RunConfig(**greeting["run"])
    module, _, function = target.partition(":")
    grasp: Callable[[str, int], HandedGrasp] = getattr(import_module(module), function)(
        controller, run, greeting["common"]
    )
    return grasp


def _answer(grasp: HandedGrasp, columns: IO[bytes]) -> dict[str, Any]:
    """Return a grasp as JSON values, and write the columns of its trace."""
    events: list[list[Any]] = []
    if grasp.trace is not None:
        np.savez(columns, allow_pickle=False, **{name: getattr(grasp.trace, name) for name in COLUMNS})
        events = [[event.t_s, int(event.phase), event.what, event.source] for event in grasp.trace.events]
    return {
        "outcome": grasp.outcome.value,
        "reason": grasp.reason,
        "events": events,
        "further": dict(grasp.further),
    }


def _named(controller: Controller[Any]) -> tuple[str, dict[str, Any]]:
    """Return the registered name and the settings of a controller.

    Raises ValueError if a controller that is created from these has other parameters or another initial state.
    """
    name, values = recipe_of("controller", controller)
    twin = create("controller", name, **values)
    # Compared as text, because NaN is not equal to itself.
    if repr((twin.params(), twin.init())) != repr((controller.params(), controller.init())):
        raise ValueError(f"another {name} with its settings has other numbers")
    return name, values


def _line(value: Any) -> bytes:
    return json.dumps(value).encode() + b"\n"


def _read_line(stream: IO[bytes]) -> Any:
    line = stream.readline()
    if not line.endswith(b"\n"):
        raise EOFError("it gave no answer")
    return json.loads(line)


def _read(stream: IO[bytes], n: int) -> bytes:
    data = stream.read(n)
    if len(data) < n:
        raise EOFError("an answer is incomplete")
    return data
