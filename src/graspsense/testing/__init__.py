"""The conformance kit: checks that a component must pass, for plugin authors.

    graspsense plugins check NAME                 # on the command line

    from graspsense.testing import parametrize_checks

    @parametrize_checks("NAME")
    def test_conformance(check):                  # a case for each check
        check.run()

Only the last imports pytest.
"""

from __future__ import annotations

from graspsense.testing.checks import Check, ConformanceReport, Result
from graspsense.testing.conformance import CHECKS, Examined, examine, parametrize_checks

__all__ = [
    "CHECKS",
    "Check",
    "ConformanceReport",
    "Examined",
    "Result",
    "examine",
    "parametrize_checks",
]
