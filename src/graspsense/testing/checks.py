"""What a check is, what it can say, and how many must run before a part may be called conforming."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, Literal

from attrs import define, field, frozen

from graspsense.core.errors import GraspsenseError, named

if TYPE_CHECKING:
    from graspsense.testing.subject import Subject

State = Literal["passed", "failed", "skipped", "expected failure"]


class CheckFailed(AssertionError):
    """What is wrong with a part: what was found, what is allowed, what to do."""


class CheckSkipped(Exception):
    """Why a check does not apply here."""


@frozen
class Check:
    """One demand on a part. Its title is the first line of the function's docstring."""

    id: str
    title: str
    test: Callable[[Any], None]


@frozen
class Result:
    """What came of one check on one part."""

    subject: str
    role: str
    check: str
    title: str
    state: State
    text: str = ""


FLOOR: Final[Mapping[str, int]] = {
    "distribution": 4,
    "sensor-backend": 18,
    "controller": 16,
    "feature-set": 15,
    "classifier": 15,
}
"""Checks of each role that must have run: a part of which most was skipped does not conform."""


def checks_of(*functions: Callable[[Any], None]) -> tuple[Check, ...]:
    """Return these functions as checks, named after them."""
    return tuple(
        Check(one.__name__.replace("_", "-"), (one.__doc__ or "").partition("\n")[0].rstrip("."), one)
        for one in functions
    )


def demand(holds: bool, text: str) -> None:
    """Raise CheckFailed with this text unless it holds."""
    if not holds:
        raise CheckFailed(text)


def outcome_of(check: Check, subject: Subject, expected: Mapping[str, str]) -> Result:
    """Run one check; `expected` maps the checks that are known to fail to why.

    Whatever a part raises is its failure. A check that was expected to fail and passes is a failure too.
    """
    state: State = "passed"
    text = ""
    try:
        check.test(subject)
    except CheckSkipped as skipped:
        state, text = "skipped", str(skipped)
    except CheckFailed as failed:
        state, text = "failed", str(failed)
    except GraspsenseError as error:  # it says itself what to do
        state, text = "failed", str(error)
    except (Exception, SystemExit) as error:
        where = _place(error)
        state, text = "failed", f"it raised {named(error)}{where}: catch it there, or give what was asked for"
    if check.id in expected:
        if state == "failed":
            state, text = "expected failure", f"{expected[check.id]} ({text})"
        elif state == "passed":
            state = "failed"
            text = f"it was expected to fail ({expected[check.id]}) and passes: take it out of the expected failures"
    return Result(subject.name, subject.role, check.id, check.title, state, text)


def _place(error: BaseException) -> str:
    """Return where the innermost frame of an exception lies, as ` in file.py:12`."""
    trace, place = error.__traceback__, ""
    while trace is not None:
        path = trace.tb_frame.f_code.co_filename.replace("\\", "/").rpartition("/")[2]
        place, trace = f" in {path}:{trace.tb_lineno}", trace.tb_next
    return place


@define
class Report:
    """The results on one or several parts, with their counts."""

    results: list[Result] = field(factory=list)

    @property
    def failures(self) -> list[str]:
        """Return what stands in the way of conforming, the floors included."""
        found = [f"{one.subject}: {one.check}: {one.text}" for one in self.results if one.state == "failed"]
        for subject, role in dict.fromkeys((one.subject, one.role) for one in self.results):
            text = self.below_floor(subject, role)
            if text and not any(one.startswith(f"{subject}: ") for one in found):
                found.append(f"{subject}: {text}")
        return found

    def below_floor(self, subject: str, role: str) -> str:
        """Return what is to be said where too few checks of a part ran, or an empty string."""
        mine = [one for one in self.results if (one.subject, one.role) == (subject, role)]
        ran = sum(one.state != "skipped" for one in mine)
        if ran >= FLOOR[role]:
            return ""
        skipped = "; ".join(f"{one.check}: {one.text}" for one in mine if one.state == "skipped")
        return (
            f"only {ran} of {len(mine)} checks of a {role.replace('-', ' ')} ran, {FLOOR[role]} must. "
            f"Skipped: {skipped or 'none'}"
        )

    def counts(self) -> str:
        """Return one line for each part: how many checks passed, failed, were skipped."""
        lines = []
        for subject, role in dict.fromkeys((one.subject, one.role) for one in self.results):
            states: Sequence[str] = [
                one.state for one in self.results if (one.subject, one.role) == (subject, role)
            ]
            kinds = [f"{states.count(kind)} {kind}" for kind in dict.fromkeys(states)]
            lines.append(f"{role} {subject}: {len(states)} checks: {', '.join(kinds)}; floor {FLOOR[role]}")
        return "\n".join(lines)
