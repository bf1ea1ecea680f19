"""Checks and their results, and the number of checks that must run for a component to conform."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Final, Literal, Protocol

from attrs import define, field, frozen

from graspsense.core.values.errors import FAILURES, GraspsenseError, named, place_of

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


@frozen
class Check:
    """One requirement. Its title is the first line of the docstring of its function."""

    id: str
    title: str
    test: Callable[[Any], None]


class Named(Protocol):
    """What is checked: a component or a distribution."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def role(self) -> str:
        """Its role, or `distribution`."""


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


MINIMUM_CHECKS: Final[Mapping[str, int]] = {
    "distribution": 4,
    "sensor-backend": 18,
    "controller": 17,
    "feature-set": 15,
    "classifier": 15,
}
"""Least number of checks of each role that must run. A component with too many skipped checks does not conform."""


def checks_of(*functions: Callable[[Any], None]) -> tuple[Check, ...]:
    """Return a check for each of these functions, with its name."""
    return tuple(
        Check(
            function.__name__.replace("_", "-"),
            (function.__doc__ or "").partition("\n")[0].rstrip("."),
            function,
        )
        for function in functions
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
    except CheckFailed:
        raise
    except Exception as error:
        cause = f"{what} raised {named(error)}{place_of(error)}"
        raise CheckFailed(f"{cause}{advice}", cause) from error


def outcome_of(check: Check, subject: Named, expected: Mapping[str, str]) -> Result:
    """Run one check; `expected` maps the ids of checks that are known to fail to the reasons.

    Any exception of the component is a failure. A check that was expected to fail and passes is a failure too.
    """
    state: State = "passed"
    text, cause, untried = "", "", False
    try:
        check.test(subject)
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
        failures = [
            f"{subject}: {', '.join(result.check for result in failed)}: {failed[0].text}"
            for (subject, _), failed in causes.items()
        ]
        for subject, role in dict.fromkeys((result.subject, result.role) for result in self.results):
            text = self.too_few_ran(subject, role)
            if text and not any(failure.startswith(f"{subject}: ") for failure in failures):
                failures.append(f"{subject}: {text}")
        return failures

    def too_few_ran(self, subject: str, role: str) -> str:
        """Return a message if too few checks of a component ran, else an empty string."""
        mine = [result for result in self.results if (result.subject, result.role) == (subject, role)]
        ran = sum(result.state != "skipped" for result in mine)
        if ran >= MINIMUM_CHECKS[role]:
            return ""
        skipped = "; ".join(f"{result.check}: {result.text}" for result in mine if result.state == "skipped")
        return (
            f"only {ran} of {len(mine)} checks of a {role.replace('-', ' ')} ran, {MINIMUM_CHECKS[role]} must. "
            f"Skipped: {skipped or 'none'}"
        )

    def counts(self) -> str:
        """Return a line for each component: the numbers of checks that passed, failed, were skipped."""
        lines = []
        for subject, role in dict.fromkeys((result.subject, result.role) for result in self.results):
            states: Sequence[str] = [
                result.state for result in self.results if (result.subject, result.role) == (subject, role)
            ]
            kinds = [f"{states.count(kind)} {kind}" for kind in dict.fromkeys(states)]
            lines.append(
                f"{role} {subject}: {len(states)} checks: {', '.join(kinds)}; at least {MINIMUM_CHECKS[role]} must run"
            )
        return "\n".join(lines)
