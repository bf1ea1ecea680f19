"""Runs the checks of a component: all at once, or as cases of pytest."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, Final

from attrs import define, field, frozen

from graspsense.core.components.entries import ConformanceCheckEntry
from graspsense.core.components.registry import Component, Plugins, installed
from graspsense.core.components.strict import keys_of
from graspsense.core.values.errors import ConfigError, PluginUnavailable, UnknownName
from graspsense.testing import (
    backend,
    classifier,
    commands,
    component,
    controller,
    features,
    package,
    protection,
    reader,
    readings,
    recorded,
)
from graspsense.testing.checks import Check, ConformanceReport, Result, checks_of, outcome_of
from graspsense.testing.subject import Package, Subject, package_of

CHECKS: Final[Mapping[str, tuple[Check, ...]]] = {
    "distribution": checks_of(package, reader),
    "sensor-backend": checks_of(component, readings, commands, backend, recorded, protection),
    "controller": checks_of(component, controller),
    "feature-set": checks_of(component, features),
    "classifier": checks_of(component, classifier),
}
"""The checks of each role, and of a distribution as a whole."""


def checks_for(subject: Subject | Package) -> tuple[Check, ...]:
    """Return the checks of a component or distribution, with those that other plugins contribute."""
    contributed = package.contributed_checks(subject) if isinstance(subject, Package) else ()
    return (*CHECKS[subject.role], *contributed)


@frozen
class ConformanceCase:
    """A case of pytest: its name, which begins with the component, and what raises the outcome that pytest expects."""

    id: str
    run: Callable[[], None]


@define(eq=False)
class Examined:
    """Components under check, with the results so far."""

    subjects: tuple[Subject | Package, ...]
    expected: Mapping[str, str] = field(factory=dict)
    _results: dict[tuple[str, str], Result] = field(factory=dict, init=False)

    def result(self, subject: Subject | Package, check: Check) -> Result:
        """Return the result of one check, which is run at the first call."""
        key = (f"{subject.role} {subject.name}", check.id)
        if key not in self._results:
            self._results[key] = self._run(subject, check)
        return self._results[key]

    def _run(self, subject: Subject | Package, check: Check) -> Result:
        basic = CHECKS[subject.role][0]
        if check is not basic and self.result(subject, basic).state == "failed":
            why = f"no other check can run before {basic.id} passes"
            return Result(subject.name, subject.role, check.id, check.title, "skipped", why)
        return outcome_of(check, subject, self.expected)

    def cases(self) -> Iterator[ConformanceCase]:
        """Yield every check of every component."""
        for subject in self.subjects:
            for check in checks_for(subject):
                yield ConformanceCase(f"{subject.name}:{check.id}", partial(self._test, subject, check))

    def _test(self, subject: Subject | Package, check: Check) -> None:
        """Run a check as a test of pytest."""
        import pytest

        result = self.result(subject, check)
        if result.state == "failed":
            pytest.fail(result.text, pytrace=False)
        if result.state == "expected failure":
            pytest.xfail(result.text)
        if result.state == "skipped":
            pytest.skip(result.text)

    def report(self, told: Callable[[Result], None] = lambda _: None) -> ConformanceReport:
        """Run every check and return the results; `told` is called with each of them.

        A component whose first check fails cannot be had, and no other check of it is run.
        """
        report = ConformanceReport()
        for subject in self.subjects:
            for check in checks_for(subject):
                result = self.result(subject, check)
                report.results.append(result)
                told(result)
                if check is CHECKS[subject.role][0] and result.state == "failed":
                    break
        return report


def examine(
    name: str,
    *,
    keys: Mapping[str, Any] | None = None,
    unplugged: Mapping[str, Any] | None = None,
    absent: Mapping[str, Any] | None = None,
    expected_failures: Mapping[str, str] | None = None,
    wheel: bool = True,
    data: Mapping[str, str] | None = None,
    plugins: Plugins | None = None,
) -> Examined:
    """Return the components with this name, ready to be checked.

    `name` is a distribution, for itself and all its components, or a component (`NAME` or `DISTRIBUTION/NAME`). `keys`
    are settings as in a pipeline file. `unplugged` and `absent` are further settings of a gripper: those under which it
    vanishes during a grasp, and those under which it is not there. `expected_failures` maps the id of a check to the
    reason of its failure. `wheel` is False if no wheel is to be built. `data` maps each data set of a distribution to a
    folder of sound examples. `plugins` are searched for the name, by default those
    that are installed. Raises UnknownName, and ConfigError for keys that no component has.
    """
    plugins = installed() if plugins is None else plugins
    whole = package_of(name, plugins, builds=wheel, data=data)
    components = [
        component for component in plugins.components() if name in (component.name, component.qualified)
    ]
    if whole is None and not components:
        raise plugins.unknown(name)
    expected = dict(expected_failures or {})
    known = {check.id for checks in CHECKS.values() for check in checks}
    known |= {contributed.name for contributed in plugins.resources(ConformanceCheckEntry)}
    strangers = set(expected) - known
    if strangers:
        raise UnknownName(f"there is no check named {', '.join(sorted(strangers))}")

    parts = components if whole is None else whole.components
    asked = {**(keys or {}), **(unplugged or {}), **(absent or {})}
    taken = [_taken_keys(part, asked) for part in parts]
    if wrong := set(asked).difference(*taken):
        lacking, has = (", ".join(map(repr, sorted(group))) for group in (wrong, set().union(*taken) - wrong))
        raise ConfigError(f"{name} has no key {lacking}. It has: {has or 'none'}")
    subjects: list[Subject | Package] = [] if whole is None else [whole]
    for part, names in zip(parts, taken, strict=True):
        mine = {key: value for key, value in (keys or {}).items() if key in names}
        subjects.append(Subject(component=part, keys=mine, unplugged=unplugged, absent=absent))
    return Examined(tuple(subjects), expected)


def _taken_keys(component: Component, asked: Mapping[str, Any]) -> set[str]:
    """Return the keys of a component; all that are asked for where its class cannot be had, as its first check says."""
    try:
        return set(keys_of(component.config_class()))
    except PluginUnavailable:
        return set(asked)


def parametrize_checks(name: str, **options: Any) -> Any:
    """Return the pytest mark that runs a test with every check of a component, as the argument `check`.

    The test is `def test_conformance(check): check.run()`. The options are those of `examine`, which
    docs/tcp_gripper.md explains.

    >>> from graspsense.testing_api import parametrize_checks
    >>> @parametrize_checks("graspsense/knn")
    ... def test_conformance(check):
    ...     check.run()
    """
    import pytest

    cases = list(examine(name, **options).cases())
    return pytest.mark.parametrize("check", cases, ids=[case.id for case in cases])
