"""`graspsense plugins check` and `new`: what they print, and how they end."""

import json
import os

import parts
import pytest
from commands import graspsense, printed, python, refused
from mutants import MUTANTS

from graspsense.core.components.registry import IsolatedPlugins
from graspsense.scaffold.make import make
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


OLD = """import graspsense.plugin_api as api
from graspsense.plugin_api import (
    Channel,
    Stillness,
    tare,
)
bound = api.bind
"""


@pytest.mark.slow
def test_imports_that_moved_are_printed_with_the_new_form_beside(tmp_path):
    make("lab-old", ["observer"], tmp_path / "old")
    source = tmp_path / "old" / "src"
    for path in (source / "lab_old" / "older.py", source / "lab_old" / "plugin.py"):
        path.write_text(OLD + (path.read_text() if path.exists() else ""))
    (source / "lab_old-1.dist-info").mkdir()
    (source / "lab_old-1.dist-info" / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: lab-old\nVersion: 1\n"
    )
    (source / "lab_old-1.dist-info" / "entry_points.txt").write_text(
        "[graspsense.plugins]\nlab-old = lab_old.plugin\n"
    )

    ran = python(
        "-m", "graspsense", "plugins", "check", "lab-old", env={**os.environ, "PYTHONPATH": str(source)}
    )

    assert ran.returncode == 1, ran.stderr
    said = ran.stdout + ran.stderr
    old = "from graspsense.plugin_api import"
    for module in ("older", "plugin"):
        assert f"{module}.py:4: {old} Stillness -> from graspsense.plugin_api import RestState" in said
        assert f"{module}.py:5: {old} tare -> from graspsense.gripper_api import tare" in said
        assert f"{module}.py:7: api.bind -> from graspsense.simulator_api import bind" in said
    assert "Channel ->" not in said


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
