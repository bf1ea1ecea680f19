"""One test of a whole kind: a loop over its cases that tells of every case that fails, not of one alone."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import pytest

slow = partial(pytest.param, marks=pytest.mark.slow)
"""A case of `pytest.mark.parametrize` that CI runs too, and the quick run does not."""


def every_case(names: str | tuple[str, ...], cases: Iterable[Any]) -> Callable[..., Any]:
    """Run a test with each case in turn, as `pytest.mark.parametrize` does, but within one test.

    A case has a folder `tmp_path`, a `monkeypatch` and a `capsys` to itself; other fixtures are shared by all cases.
    What fails is raised as one group, each failure with its case as a note. A case that is skipped does not stop the
    others; if none fails, the test counts as skipped. Raises ValueError if there is no case.
    """
    names = (names,) if isinstance(names, str) else names
    rows = [tuple(case) if len(names) > 1 else (case,) for case in cases]
    if not rows:
        raise ValueError(f"no case of {', '.join(names)}: a test without cases checks nothing")

    def decorate(test: Callable[..., None]) -> Callable[..., None]:
        def loop(*args: Any, **fixtures: Any) -> None:
            failures, skipped = [], []
            for number, row in enumerate(rows):
                try:
                    _run(test, args, fixtures | dict(zip(names, row, strict=True)), number)
                except (Exception, pytest.fail.Exception) as error:
                    error.add_note(f"case {number}: {', '.join(map(repr, row)):.400}")
                    failures.append(error)
                except pytest.skip.Exception as error:
                    skipped.append(error)
            if failures:
                raise BaseExceptionGroup(f"{len(failures)} of {len(rows)} cases of {test.__name__}", failures)
            if skipped:
                raise skipped[0]

        signature = inspect.signature(test)
        fixtures_of_test = [fixture for name, fixture in signature.parameters.items() if name not in names]
        loop.__name__, loop.__doc__, loop.__module__ = test.__name__, test.__doc__, test.__module__
        loop.__signature__ = signature.replace(parameters=fixtures_of_test)  # type: ignore[attr-defined]
        loop.pytestmark = getattr(test, "pytestmark", [])  # type: ignore[attr-defined]
        return loop

    return decorate


def _run(test: Callable[..., None], args: tuple[Any, ...], given: dict[str, Any], number: int) -> None:
    if "tmp_path" in given:
        given["tmp_path"] = given["tmp_path"] / f"case_{number}"
        given["tmp_path"].mkdir()
    if "capsys" in given:
        given["capsys"].readouterr()
    with pytest.MonkeyPatch.context() as patch:
        if "monkeypatch" in given:
            given["monkeypatch"] = patch
        test(*args, **given)
