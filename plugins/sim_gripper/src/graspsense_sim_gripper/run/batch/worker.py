"""Simulating grasps in the interpreter of a separate process, because loops in one process share the interpreter lock.

The process is a new interpreter that runs `main`, so that the script of the caller is not imported a second time. It
reads one line of JSON with the settings and the registered name of the controller, and then a line for each grasp. It
answers with a line of JSON, followed by the trace in numpy's npy format. The caller extracts the features.
"""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
from types import TracebackType
from typing import IO, Any, Final

import numpy as np
from attrs import asdict, evolve, fields

from graspsense.gripper_api import Outcome, Phase
from graspsense.plugin_api import Controller, GraspEvent, Trace, create
from graspsense.simulator_api import RunConfig, recipe_of
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.accuracy.cache import restored, stored
from graspsense_sim_gripper.run.batch.job import FinishedGrasp, Job, grasp_plain
from graspsense_sim_gripper.run.batch.scenes import Scenes
from graspsense_sim_gripper.run.nested import Stored, TupleType, append
from graspsense_sim_gripper.solve.state import PlantState

_ARRAYS: Final = tuple(
    column.name for column in fields(Trace) if column.name not in ("units", "signals", "events")
)


Json = Any
"""A value that JSON can represent."""


class NotHandedOver(Exception):
    """A job cannot run in another process; the text gives the reason."""


class PlainProcess:
    """A process that runs the grasps of a job in the interpreter. Use it as a context manager, which ends the process.

    Raises NotHandedOver if the controller cannot be created again from its name and settings.
    """

    def __init__(self, scenes: Scenes) -> None:
        self._scenes = scenes
        job = scenes.job
        try:
            self._greeting = _line(
                {
                    # The process has to find the same classes: the same folders, in the same order.
                    "path": [folder or os.getcwd() for folder in sys.path],
                    "config": asdict(job.config),
                    "controller": _named(job.controller),
                    "run": asdict(job.run),
                    "models": [
                        [*key, None if model is None else stored(model)]
                        for key, model in scenes.models().items()
                    ],
                    "traces": job.traces or job.extract is not None,
                    "ends_with_hold": job.ends_with_hold,
                }
            )
        except Exception as error:
            raise NotHandedOver(f"the controller cannot be given to other processes: {error}") from error

    def __enter__(self) -> PlainProcess:
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", "from graspsense_sim_gripper.run.batch.worker import main; main()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.communicate()

    def run(self, scene: str, seed: int) -> FinishedGrasp:
        """Simulate a scene with a seed.

        Raises NotHandedOver if the process has ended, and if the grasp raises an exception in it. The caller then runs
        the grasp itself, which raises the original exception.
        """
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
        job, trace = self._scenes.job, None
        if answer["bytes"] > 0:
            trace = evolve(_read_trace(columns), events=tuple(_event(*event) for event in answer["events"]))
        return FinishedGrasp(
            outcome=Outcome(answer["outcome"]),
            reason=answer["reason"],
            end=Stored(
                TupleType.made_of(self._scenes.setup(scene, seed).state), np.array(answer["state"], float)
            ),
            extracted=None if job.extract is None or trace is None else job.extract(trace),
            kept=trace if job.traces else None,
            model=self._scenes.find(scene).model,
        )


def _numbers(state: PlantState) -> list[float]:
    numbers: list[float] = []
    append(state, numbers, [])
    return numbers


def _told(grasp: FinishedGrasp) -> list[list[Any]]:
    """Return the events that the controller told, as JSON values."""
    events = () if grasp.kept is None else grasp.kept.events
    return [[event.t_s, int(event.phase), event.what] for event in events]


def _event(t_s: float, phase: int, what: str) -> GraspEvent:
    return GraspEvent(t_s, Phase(phase), what, "controller")


def main() -> None:
    """Answer the requests on the standard input until it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    # Text that other code prints must not appear between the answers.
    os.dup2(2, 1)
    asked = sys.stdin.buffer
    try:
        greeting = _read_line(asked)
    except EOFError:
        return
    sys.path[:] = greeting["path"]
    scenes: Scenes | None = None
    while True:
        try:
            wanted = _read_line(asked)
        except EOFError:
            return
        columns = io.BytesIO()
        try:
            scenes = scenes or _scenes(greeting)
            grasp = grasp_plain(scenes.job, scenes.setup(*wanted))
            if grasp.kept is not None:
                _write_trace(columns, grasp.kept)
            answer = {
                "outcome": grasp.outcome.value,
                "reason": grasp.reason,
                "state": _numbers(grasp.state),
                "events": _told(grasp),
            }
        except Exception as error:
            what = "a plain grasp" if scenes is not None else "the controller"
            columns = io.BytesIO()
            answer = {"refused": f"{what} fails in another process: {type(error).__name__}: {error}"}
        answers.write(_line({**answer, "bytes": columns.tell()}) + columns.getbuffer())
        answers.flush()


def _scenes(greeting: dict[str, Json]) -> Scenes:
    models = {
        (scene, numbered): None if values is None else restored(values)
        for scene, numbered, values in greeting["models"]
    }
    return Scenes(_job(greeting), models)


def _job(greeting: dict[str, Json]) -> Job:
    name, values = greeting["controller"]
    return Job(
        config=SimConfig(**greeting["config"]),
        controller=create("controller", name, **values),
        run=RunConfig(**greeting["run"]),
        extract=None,
        traces=greeting["traces"],
        ends_with_hold=greeting["ends_with_hold"],
    )


def _named(controller: Controller[Any]) -> tuple[str, dict[str, Json]]:
    """Return the registered name and the settings of a controller.

    Raises ValueError if a controller that is created from these has other parameters or another initial state.
    """
    name, values = recipe_of("controller", controller)
    twin = create("controller", name, **values)
    # Compared as text, because NaN is not equal to itself.
    if repr((twin.params(), twin.init())) != repr((controller.params(), controller.init())):
        raise ValueError(f"another {name} with its settings has other numbers")
    return name, values


def _line(value: Json) -> bytes:
    return json.dumps(value).encode() + b"\n"


def _read_line(stream: IO[bytes]) -> Json:
    line = stream.readline()
    if not line.endswith(b"\n"):
        raise EOFError("it gave no answer")
    return json.loads(line)


def _read(stream: IO[bytes], n: int) -> bytes:
    data = stream.read(n)
    if len(data) < n:
        raise EOFError("an answer is incomplete")
    return data


def _write_trace(stream: IO[bytes], trace: Trace) -> None:
    for name in _ARRAYS:
        np.lib.format.write_array(stream, getattr(trace, name), allow_pickle=False)


def _read_trace(stream: IO[bytes]) -> Trace:
    parts: dict[str, Any] = {name: np.lib.format.read_array(stream, allow_pickle=False) for name in _ARRAYS}
    return Trace(**parts)
