"""The check of terms that other distributions contribute: a sound term passes, and each defect is named."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import NamedTuple

import pytest
from cases import every_case

from graspsense.core.components.entries import ConformanceCheckEntry
from graspsense.core.components.registry import installed
from graspsense.testing.conformance import checks_for
from graspsense.testing.subject import package_of
from graspsense_sim_gripper.run.conformance import check_terms
from graspsense_sim_gripper.scene.terms.registry import TERMS


class Params(NamedTuple):
    k_n_m: float


class State(NamedTuple):
    worst_m: float


def spring(params, state, d0, d1, h, v1):
    return params.k_n_m * d1, State(max(d1, state.worst_m))


CALLS = [0]


def counted(params, state, d0, d1, h, v1):
    CALLS[0] += 1
    return spring(params, state, d0, d1, h, v1)


def defects(law=spring):
    gel = SimpleNamespace(name="gel", params=Params, law=law, at_rest=State(0.0))
    return list(check_terms([[gel]]))


@pytest.mark.slow
def test_a_sound_term_has_no_defect():
    assert defects() == []
    assert list(check_terms([list(TERMS.values())])) == []


@every_case(
    ("law", "says"),
    [
        (lambda p, s, d0, d1, h, v1: (0, State(max(d1, s.worst_m))), "force 0 (int)"),
        (lambda p, s, d0, d1, h, v1: (d1 / (d1 - 0.0001 * 10), s), "raised ZeroDivisionError"),
        (lambda p, s, d0, d1, h, v1: (float("inf"), s), "a finite float"),
        (lambda p, s, d0, d1, h, v1: (time.perf_counter(), s), "arguments only"),
        (lambda p, s, d0, d1, h, v1: (p.k_n_m * d1, State(1)), "types"),
        (lambda p, s, d0, d1, h, v1: (p.k_n_m * d1 + 0.01, s), "without compression"),
        (lambda p, s, d0, d1, h, v1: (p.k_n_m * (1.1 if d1 < d0 else 1.0) * d1, s), "has given back"),
        (lambda p, s, d0, d1, h, v1: (p.k_n_m * (d1 - 1e-3 * v1), s), "has given back"),
        (counted, "changes a global"),
    ],
)
def test_a_law_with_a_defect_is_caught(law, says):
    (defect,) = defects(law)

    assert "term 'gel'" in defect
    assert says in defect


def test_the_conformance_kit_runs_it_for_a_distribution_with_terms():
    name, checks = "simulator-terms-are-laws", installed().resources(ConformanceCheckEntry)
    assert name in {resource.name for resource in checks}
    assert name not in {check.id for check in checks_for(package_of("graspsense-sim-gripper", installed()))}
