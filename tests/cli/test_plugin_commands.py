"""`graspsense plugins check` and `new`: what they print, and how they end."""

import json

import parts
import pytest
from commands import graspsense, printed, refused
from mutants import MUTANTS

from graspsense.core.components.registry import IsolatedPlugins
from graspsense.testing import CHECKS

CHECKS_WITH_SETTINGS = {"settings-survive-a-file", "reports-a-lost-device", "reports-a-missing-device"}
"""Checks of a gripper that need the settings of the command line; the others take seconds."""


def test_a_part_that_conforms():
    with IsolatedPlugins(parts.offering(parts.ENTRIES["feature-set"])):
        code, out, err = graspsense("plugins", "check", "peak")

    count = len(CHECKS["feature-set"])
    assert code == 0
    assert out == f"feature-set graspsense-test/peak: {count} checks: {count} passed\nconforms\n"
    assert err.count("passed   graspsense-test/peak") == count


@pytest.mark.slow
def test_a_part_that_does_not():
    broken_rule = ("feature-set", "requires-what-it-reads")
    broken, *_ = [mutant for mutant in MUTANTS if (mutant.role, mutant.check) == broken_rule]
    with IsolatedPlugins(parts.offering(broken.entry)):
        code, out, _ = graspsense("plugins", "check", "peak", "--json")

    assert code == 1
    answer = json.loads(out)
    assert answer["conforms"] is False
    (failure,) = answer["failures"]
    assert failure.startswith("graspsense-test/peak: requires-what-it-reads: ")
    assert {check["state"] for check in answer["results"]} == {"passed", "failed"}


def test_settings_reach_the_part_that_is_checked(monkeypatch):
    asking = [check for check in CHECKS["sensor-backend"] if check.id in CHECKS_WITH_SETTINGS]
    assert len(asking) == len(CHECKS_WITH_SETTINGS)
    monkeypatch.setitem(CHECKS, "sensor-backend", tuple(asking))
    with IsolatedPlugins(parts.offering(parts.ENTRIES["sensor-backend"])):
        code, out, err = graspsense(
            "plugins",
            *("check", "hand", "-o", "here=true", "--unplugged", "vanishes_s=0.3", "--absent", "here=false"),
        )
        assert (code, out.splitlines()[-1]) == (0, "conforms")
        assert "skipped" not in err
        assert "not tried" not in out

        _, out, _ = graspsense("plugins", "check", "hand", "-o", "here=true")
        assert out.count("not tried") == 2

        told = refused("plugins", "check", "hand", "-o", "hear=true")
        assert all(part in told for part in ("'hear'", "'here'"))
        assert "-o nonsense: expected KEY=VALUE" in refused("plugins", "check", "hand", "-o", "nonsense")


def test_a_name_that_nobody_has():
    assert "'chitta'?" in refused("plugins", "check", "chita")


def test_a_group_without_a_command_prints_its_help_once():
    code, out, err = graspsense("plugins")

    assert code == 2
    assert (out + err).count("Usage:") == 1
    assert "shows what there is" not in err


@pytest.mark.slow
def test_a_package_is_made_for_several_roles(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = printed("plugins", "new", "lab-hand", "--role", "controller", "--role", "sensor-backend")
    assert "  pip install -e ./lab-hand pytest\n  graspsense plugins list\n" in told
    assert "graspsense run --pipeline lab-hand" in told
    assert sorted(path.name for path in (tmp_path / "lab-hand/src/lab_hand").glob("*.py")) == [
        "__init__.py",
        "backend.py",
        "law.py",
        "plugin.py",
    ]
