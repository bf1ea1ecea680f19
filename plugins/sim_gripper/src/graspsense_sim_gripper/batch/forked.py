"""Compiled grasps in forked processes, because threads of one process share the interpreter lock.

Nearly half of the time of a compiled grasp is Python around its loop, so threads keep few cores busy. A forked process
begins with all that this one has: the models, and the machine code of the loops. It is asked for the slice of the batch
that begins at some index, and answers with the numbers of its results, and with JSON for the rest. A trace, or what
Python code extracted from one, cannot be sent; what a compiled feature set measured can.
"""

from __future__ import annotations

import gc
import json
import multiprocessing
import signal
import sys
import threading
import warnings
from array import array
from collections.abc import Callable, Iterable, Sequence
from multiprocessing.connection import Connection
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import evolve, frozen

from graspsense.plugin_api import CompiledExtraction, Outcome, Trace, columns_of_ticks
from graspsense_sim_gripper.batch.job import FinishedGrasp, Job
from graspsense_sim_gripper.compiled.padding import PaddedLayout
from graspsense_sim_gripper.nested import Stored, TupleType, append_numbers
from graspsense_sim_gripper.reduction.model import Reduction

Json = Any
"""A value that JSON can represent."""


class Answer(NamedTuple):
    """The results of a slice as another process sends them."""

    rest: bytes
    """JSON: for each grasp outcome, reason, and how many numbers it has measured and in its state."""
    numbers: bytes
    """An array of doubles: for each grasp what was measured, and the state of the plant at its end."""


REFUSED: Final = Answer(b"", b"")
"""The answer to a slice that cannot be run in another process. The caller then runs it."""


class InModel(NamedTuple):
    """What the process that asks knows of a grasp of an answer."""

    plant_type: TupleType
    """That of its state, padded."""
    layout: PaddedLayout
    """That of the padded state."""
    reduction: Reduction | None
    unstable_loop: str
    """As in `FinishedGrasp`."""


def can_fork() -> bool:
    """Return whether a fork is safe: on Linux, in a process without other threads, which may hold locks."""
    return (
        sys.platform == "linux"
        and threading.active_count() == 1
        and not multiprocessing.current_process().daemon
    )


def can_be_sent(job: Job) -> bool:
    """Return whether the results of the grasps of a job are numbers, which another process can send."""
    return not job.traces and (job.extract is None or job.extraction is not None)


@frozen
class MeasuredNumbers:
    """Extracts the numbers that a compiled feature set measures on a grasp, from which its features follow."""

    of_features: CompiledExtraction

    def __call__(self, trace: Trace) -> Any:
        """Return the numbers of a trace."""
        return self.of_features.measure(self.of_features.params, columns_of_ticks(trace))

    def compiled_extraction(self) -> CompiledExtraction:
        """Return the form to compile."""
        return evolve(self.of_features, result=lambda measured: measured)


def measuring(job: Job) -> Job:
    """Return the same job, in which a grasp gives what the compiled feature set measured instead of the features."""
    return job if job.extraction is None else evolve(job, extract=MeasuredNumbers(job.extraction))


class ForkedProcess:
    """A forked process that answers for slices of a batch. Use it as a context manager, which ends the process."""

    def __init__(self, answer: Callable[[int], Answer], others: Sequence[ForkedProcess]) -> None:
        """Fork. `answer(begin)` returns what is sent; `others`: the processes that were forked before."""
        context = multiprocessing.get_context("fork")
        self._asks, answers = context.Pipe()
        inherited = [self._asks, *(other._asks for other in others)]
        self._process = context.Process(target=_serve, args=(answer, answers, inherited), daemon=True)
        with warnings.catch_warnings():
            # From Python 3.12 on it warns of the threads of BLAS too, which are safe to fork.
            warnings.simplefilter("ignore", DeprecationWarning)
            self._process.start()
        answers.close()

    def __enter__(self) -> ForkedProcess:
        return self

    def __exit__(self, *error: object) -> None:
        # A thread that waits for an answer sees the end of the process, and gives the connection back.
        self._process.kill()
        self._process.join()

    def answer(self, begin: int) -> Answer:
        """Return the answer for the slice that begins at this index; `REFUSED` if the process cannot give it."""
        try:
            self._asks.send_bytes(str(begin).encode())
            return Answer(self._asks.recv_bytes(), self._asks.recv_bytes())
        except (OSError, EOFError):
            # Another program has ended it, for example the system because memory was short.
            return REFUSED


def answer_of(grasps: Iterable[FinishedGrasp]) -> Answer:
    """Return the answer with the results of grasps.

    Raises TypeError if one of them was not compiled, so that its state is in another layout.
    """
    rest: list[Json] = []
    numbers = array("d")
    for grasp in grasps:
        begin = len(numbers)
        if grasp.extracted is not None:
            append_numbers(numbers, grasp.extracted)
        measured = len(numbers) - begin
        if not isinstance(grasp.end, Stored):
            raise TypeError("a grasp ran in the interpreter")
        numbers.frombytes(grasp.end.numbers.tobytes())
        rest.append((grasp.outcome.value, grasp.reason, measured, len(numbers) - begin - measured))
    return Answer(json.dumps(rest).encode(), numbers.tobytes())


def results(
    answer: Answer,
    form: CompiledExtraction | None,
    measured_type: TupleType | None,
    models: Iterable[InModel],
) -> list[FinishedGrasp]:
    """Return the results in an answer.

    `form`: the extraction of the job, and `measured_type` that of what it measures. `models`: what is known of each
    grasp.
    """
    numbers, begin, found = np.frombuffer(answer.numbers), 0, []
    for (outcome, reason, measured, of_state), known in zip(json.loads(answer.rest), models, strict=True):
        state, end = begin + measured, begin + measured + of_state
        extracted = None
        if form is not None and measured_type is not None:
            extracted = form.result(measured_type.filled(numbers[begin:state]))
        found.append(
            FinishedGrasp(
                outcome=Outcome(outcome),
                reason=reason,
                end=Stored(known.plant_type, numbers[state:end]),
                layout=known.layout,
                extracted=extracted,
                kept=None,
                reduction=known.reduction,
                unstable_loop=known.unstable_loop,
            )
        )
        begin = end
    return found


def _serve(answer: Callable[[int], Answer], connection: Connection, inherited: Sequence[Connection]) -> None:
    """Answer the requests of the connection until it ends."""
    # As long as this process holds them, the processes at their other ends do not see the caller end.
    for one in inherited:
        one.close()
    # Ctrl-C reaches every process of the terminal; the caller ends this one. Its own handlers are not for this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    # A collection would write to, and so copy, the memory that is shared with the caller.
    gc.freeze()
    while True:
        try:
            begin = int(connection.recv_bytes())
        except (EOFError, OSError):
            return
        try:
            reply = answer(begin)
        except Exception:
            # The caller runs the slice again, which raises the exception where it can be handled.
            reply = REFUSED
        try:
            for part in reply:
                connection.send_bytes(part)
        except OSError:
            return
