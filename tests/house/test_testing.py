"""The conformance kit: sound parts pass it, and each check catches a part that is broken in just that way."""

import mutants
import parts
import pytest
from attrs import evolve
from cases import every_case

from graspsense.core.components.registry import Component, IsolatedPlugins
from graspsense.plugin_api import Feature, hookimpl
from graspsense.testing import CHECKS, backend, controller, examine, features, session
from graspsense.testing.checks import outcome_of
from graspsense.testing.conformance import Examined
from graspsense.testing.subject import Subject

ROLES = tuple(parts.ENTRIES)


def subject(role, entry):
    given = {"unplugged": parts.HAND_LOST, "absent": parts.HAND_ABSENT} if role == "sensor-backend" else {}
    return Subject(component=Component(entry, "graspsense-test", "0.1"), keys={}, **given)


@pytest.fixture(autouse=True)
def short_openings(monkeypatch):
    """The hand is open after a fifth of a second and touches its object within one; it is used for longer."""
    monkeypatch.setattr(session, "OPENING_S", 0.2)
    monkeypatch.setattr(session, "CLOSING_S", 1.5)


SLOW_CHECKS = {
    "ends-every-grasp",
    "answers-in-time",
    "same-features-elsewhere",
    "same-model-elsewhere",
    "what-it-delivers-is-kept",
    "squeezes-with-what-it-is-asked",
    "says-what-it-asks-for",
    "state-holds-everything",
    "hostile-laws-stay-below-the-ceiling",
    "a-silent-pad-ends-the-grasp",
}
MARKS = {
    "classifier": (),
    "feature-set": pytest.mark.slow,
    "sensor-backend": pytest.mark.slow,
    # Our own controllers pass the same checks in the slow run.
    "controller": pytest.mark.long,
}
CHECKED = [(mutant.role, mutant.check) for mutant in mutants.MUTANTS]


def marks_of(number):
    """The marks of a mutant: those of checks that take long are slow, and those of a check after its first one."""
    slow = CHECKED[number][1] in SLOW_CHECKS or CHECKED[number] in CHECKED[:number]
    return pytest.mark.slow if slow else ()


@pytest.mark.parametrize(
    "role",
    [pytest.param(role, marks=MARKS[role]) for role in ROLES],
)
def test_a_sound_part_passes_every_check(role):
    report = Examined((subject(role, parts.ENTRIES[role]),)).report()

    assert report.failures == []
    assert [result.state for result in report.results] == ["passed"] * len(CHECKS[role])


@pytest.mark.parametrize(
    "broken",
    [pytest.param(mutant, marks=marks_of(number)) for number, mutant in enumerate(mutants.MUTANTS)],
    ids=lambda broken: f"{broken.role}-{broken.check}",
)
def test_a_check_catches_its_mutant(broken, monkeypatch):
    # A law that never ends is found after five seconds of ticks as after a minute.
    monkeypatch.setattr(controller, "LONGEST_S", 5.0)
    monkeypatch.setattr(backend, "LONGEST_OPEN_S", 0.2)
    monkeypatch.setattr(features, "LONGEST_S", 0.05)
    (check,) = [check for check in CHECKS[broken.role] if check.id == broken.check]

    result = outcome_of(check, subject(broken.role, broken.entry), {})

    assert result.state == "failed"
    assert broken.says in result.text


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {
            "target": "parts:Shaking",
            "requires": (parts.ACCELERATION,),
            "features": (Feature("shaking", "m/s2", "largest acceleration"),),
        },
        {"target": "parts:NamedPeak"},
    ],
    ids=["reads a fast channel only", "is compiled with a named tuple"],
)
def test_another_sound_feature_set_passes_every_check(changes):
    entry = evolve(parts.ENTRIES["feature-set"], **changes)

    assert Examined((subject("feature-set", entry),)).report().failures == []


def test_a_read_that_other_work_held_up_once_is_within_its_timeout():
    hand = subject("sensor-backend", parts.ENTRIES["sensor-backend"])
    (check,) = (each for each in CHECKS["sensor-backend"] if each.id == "answers-in-time")
    hand.session.longest_read_s = 1.2

    assert outcome_of(check, hand, {}).state == "passed"


@every_case("role", ROLES)
def test_every_check_has_a_mutant(role):
    caught = {mutant.check for mutant in mutants.MUTANTS if mutant.role in (role, "feature-set")}
    assert {check.id for check in CHECKS[role]} - caught == set()


class Raising(parts.Peak):
    def extract(self, trace):
        raise ZeroDivisionError("it broke")


def test_one_cause_that_fails_several_checks_is_told_once():
    """An `extract` that always raises fails nearly every check, each on another trace."""
    entry = evolve(parts.ENTRIES["feature-set"], target=f"{__name__}:Raising")
    report = Examined((subject("feature-set", entry),)).report()
    failed = [result for result in report.results if result.state == "failed"]
    told = [failure for failure in report.failures if "it broke" in failure]

    assert len(failed) > 5
    assert len(told) == 1
    assert all(result.check in "".join(report.failures) for result in failed)


def test_an_expected_failure_is_no_failure_and_an_unexpected_pass_is_one():
    peak = subject("feature-set", parts.ENTRIES["feature-set"])
    checks = {check.id: check for check in CHECKS["feature-set"]}
    (broken,) = [mutant for mutant in mutants.MUTANTS if mutant.check == "same-trace-same-features"]
    expected = {"same-trace-same-features": "counts on purpose"}

    known = outcome_of(checks["same-trace-same-features"], subject("feature-set", broken.entry), expected)
    passing = outcome_of(checks["same-trace-same-features"], peak, expected)

    assert known.state == "expected failure"
    assert known.text.startswith("counts on purpose (")
    assert passing.state == "failed"
    assert "expected failures" in passing.text


@pytest.mark.slow
def test_one_part_is_found_by_name_and_a_wrong_name_by_likeness():
    class Plugin:
        GRASPSENSE_API = (2, 0)

        @hookimpl
        def graspsense_feature_sets(self):
            return [parts.ENTRIES["feature-set"]]

    plugins = IsolatedPlugins(Plugin(), builtins=False)

    assert examine("peak", plugins=plugins).report().counts() == (
        f"feature-set graspsense-test/peak: {len(CHECKS['feature-set'])} checks: "
        f"{len(CHECKS['feature-set'])} passed"
    )
    with pytest.raises(Exception, match=r"'peek'.*'peak'"):
        examine("peek", plugins=plugins)
    with pytest.raises(Exception, match="nosuch"):
        examine("peak", plugins=plugins, expected_failures={"nosuch": "why"})


def test_where_the_class_cannot_be_had_nothing_else_is_reported():
    (broken,) = [mutant for mutant in mutants.MUTANTS if "implement extract" in mutant.says]

    report = Examined((subject("feature-set", broken.entry),)).report()

    (failure,) = report.failures
    assert "extract, which FeatureSet of plugin_api requires" in failure
    assert len(report.results) == 1
