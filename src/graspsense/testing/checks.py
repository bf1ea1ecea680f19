"""Checks and their results."""

from __future__ import annotations

import locale
import os
import random
import signal
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from types import ModuleType
from typing import Any, Final, Literal

import numpy as np
from attrs import define, field, frozen

from graspsense.core.values.errors import FAILURES, GraspsenseError, NoDevice, exits_raise, named, place_of

State = Literal["passed", "failed", "skipped", "expected failure"]


class CheckFailed(AssertionError):
    """A defect of a component: what was found, what is allowed, what to do.

    Several checks can fail for one `cause`, such as an exception from one line.
    """

    def __init__(self, text: str, cause: str = "") -> None:
        super().__init__(text)
        self.cause = cause or text


class CheckSkipped(Exception):
    """The reason why a check does not apply."""


class CheckNotTried(CheckSkipped):
    """The reason why a check that may apply was not tried: what it needs was not given."""


_SIGNATURES: Final = ({"subject": "Subject", "return": "None"}, {"package": "Package", "return": "None"})
"""The annotations of a function that is a check."""


@frozen
class Check:
    """One requirement. Its title is the first line of the docstring of its function."""

    id: str
    title: str
    test: Callable[[Any], None]


@frozen
class Result:
    """The result of one check of one component."""

    subject: str
    role: str
    check: str
    title: str
    state: State
    text: str = ""
    cause: str = ""
    """Equal for failures of a component that have one cause."""
    untried: bool = False
    """Whether it was skipped because what it needs was not given."""


def checks_of(*modules: ModuleType) -> tuple[Check, ...]:
    """Return the checks that these modules define: their public functions of a subject alone, which return nothing."""
    return tuple(
        Check(
            name.replace("_", "-"),
            (function.__doc__ or "").partition("\n")[0].rstrip("."),
            function,
        )
        for module in modules
        for name, function in vars(module).items()
        if getattr(function, "__module__", "") == module.__name__
        and not name.startswith("_")
        and getattr(function, "__annotations__", {}) in _SIGNATURES
    )


def demand(holds: bool, text: str) -> None:
    """Raise CheckFailed with this text unless `holds`."""
    if not holds:
        raise CheckFailed(text)


@contextmanager
def raises_nothing(what: str, advice: str) -> Iterator[None]:
    """Raise CheckFailed for what is raised in this context: `what` raised it, and the advice."""
    try:
        yield
    except (CheckFailed, NoDevice):
        raise
    except Exception as error:
        cause = f"{what} raised {named(error)}{place_of(error)}"
        raise CheckFailed(f"{cause}{advice}", cause) from error


@contextmanager
def _leaving_nothing() -> Iterator[None]:
    """Raise CheckFailed for what the code in this context prints, changes in the process, or leaves running."""
    printed, threads = StringIO(), set(threading.enumerate())
    with redirect_stdout(printed), redirect_stderr(sys.stderr), exits_raise():
        earlier = _process_state()
        yield
        changed = [name for name, value in _process_state().items() if value != earlier[name]]
    if printed.getvalue():
        lines = [f"{line!r:.60}" for line in printed.getvalue().splitlines() if line.strip()]
        line = lines[0] if lines else "an empty line"
        raise CheckFailed(
            f"it prints {line}, where the results of a command go: use logging, or print to sys.stderr",
            "it prints",
        )
    os.chdir(earlier["the working folder"])
    if "the handler of Ctrl-C" in changed:
        signal.signal(signal.SIGINT, earlier["the handler of Ctrl-C"])
    demand(
        not changed,
        f"it changes {', '.join(changed)} for the whole process: give it back, or work without it (a context as "
        "np.errstate, a generator of its own)",
    )
    demand_ended(
        [thread for thread in threading.enumerate() if thread not in threads and not thread.daemon],
        "which keeps the program from ending: end it in `close`, or make it a daemon",
    )


def demand_ended(threads: Iterable[threading.Thread], advice: str) -> None:
    """Raise CheckFailed for a thread that goes on for another second."""
    for thread in threads:
        thread.join(1.0)
        demand(not thread.is_alive(), f"it leaves the thread {thread.name!r} running, {advice}")


@contextmanager
def leaving_no_thread(doing: str) -> Iterator[None]:
    """Raise CheckFailed for a thread that what is done in this context, not for the first time, leaves running.

    The first time may start the threads of a library, which serve all further ones.
    """
    earlier = set(threading.enumerate())
    yield
    more = [thread for thread in threading.enumerate() if thread not in earlier]
    demand_ended(more, f"one more each time {doing}: end it with the call, or in `close`")


def _process_state() -> dict[str, Any]:
    return {
        "the working folder": os.getcwd(),
        "sys.stdout": sys.stdout,
        "sys.stderr": sys.stderr,
        "the handler of Ctrl-C": signal.getsignal(signal.SIGINT),
        "the locale": locale.setlocale(locale.LC_ALL),
        "np.seterr": np.geterr(),
        "the random numbers of numpy": repr(np.random.get_state()),  # noqa: NPY002 (that others draw)
        "the random numbers of Python": random.getstate(),
    }


def outcome_of(check: Check, subject: Any, expected: Mapping[str, str]) -> Result:
    """Run one check of a component or distribution; `expected` maps the ids of checks that fail to the reasons.

    Any exception of the component is a failure. A check that was expected to fail and passes is a failure too.
    """
    state: State = "passed"
    text, cause, untried = "", "", False
    try:
        with _leaving_nothing():
            check.test(subject)
    except KeyboardInterrupt as error:
        error.add_note(f"in the check {check.id} of {subject.name}{place_of(error)}")
        raise
    except CheckSkipped as skipped:
        state, text, untried = "skipped", str(skipped), isinstance(skipped, CheckNotTried)
    except CheckFailed as failed:
        state, text, cause = "failed", str(failed), failed.cause
    except GraspsenseError as error:  # its message says what to do
        state, text = "failed", str(error)
    except FAILURES as error:
        where = place_of(error)
        state, text = "failed", f"it raised {named(error)}{where}: catch it there, or return what is required"
    if check.id in expected:
        if state == "failed":
            state, text = "expected failure", f"{expected[check.id]} ({text})"
        elif state == "passed":
            state = "failed"
            text = f"it was expected to fail ({expected[check.id]}) and passes: take it out of the expected failures"
    return Result(subject.name, subject.role, check.id, check.title, state, text, cause or text, untried)


@define
class ConformanceReport:
    """The results of the checks of one or several components."""

    results: list[Result] = field(factory=list)

    @property
    def failures(self) -> list[str]:
        """Return the reasons why the components do not conform, each cause once with the checks that it fails."""
        causes: dict[tuple[str, str], list[Result]] = {}
        for result in self.results:
            if result.state == "failed":
                causes.setdefault((result.subject, result.cause), []).append(result)
        return [
            f"{subject}: {', '.join(result.check for result in failed)}: {failed[0].text}"
            for (subject, _), failed in causes.items()
        ]

    def counts(self) -> str:
        """Return a line for each component: the numbers of checks that passed, failed, were skipped."""
        counts: dict[str, Counter[str]] = {}
        for result in self.results:
            counts.setdefault(f"{result.role} {result.subject}", Counter())[result.state] += 1
        return "\n".join(
            f"{component}: {states.total()} checks: {', '.join(f'{n} {state}' for state, n in states.items())}"
            for component, states in counts.items()
        )
