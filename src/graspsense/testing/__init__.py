"""The conformance kit: checks that a component must pass, for plugin authors.

    graspsense plugins check NAME                 # on the command line

    from graspsense.testing import parametrize_checks

    @parametrize_checks("NAME")
    def test_conformance(check):                  # a case for each check
        check.run()

    class TestMine(Conformance):                  # or a class with a test for each
        name = "NAME"

Only the last two import pytest.
"""

from __future__ import annotations

from graspsense.testing.checks import MINIMUM_CHECKS, Check, ConformanceReport, Result
from graspsense.testing.conformance import CHECKS, Conformance, Examined, examine, parametrize_checks

__all__ = [
    "CHECKS",
    "MINIMUM_CHECKS",
    "Check",
    "Conformance",
    "ConformanceReport",
    "Examined",
    "Result",
    "examine",
    "parametrize_checks",
]
