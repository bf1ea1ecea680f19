"""The README's examples do what they say."""

import re
import shutil
import subprocess
import sys

import pytest
from commands import graspsense
from repository import ROOT

from graspsense.cli.main import COMMANDS

README = (ROOT / "README.md").read_text()


def block(language):
    (code,) = re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)
    return str(code)


@pytest.fixture
def pipeline_file(tmp_path):
    path = tmp_path / "my.toml"
    path.write_text(block("toml"))
    return path


def test_pipeline_example_is_valid(pipeline_file, monkeypatch):
    monkeypatch.chdir(pipeline_file.parent)
    done = graspsense("config", "validate", pipeline_file.name)
    assert (done.returncode, done.stderr) == (0, "")
    assert pipeline_file.name in done.stdout


@pytest.mark.slow
def test_python_example_runs_on_the_pipeline_example(pipeline_file):
    command = [sys.executable, "-c", block("python")]
    done = subprocess.run(command, cwd=pipeline_file.parent, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("steady {'p_first': 0.0")


SAMPLES = ROOT / "samples"
ENDED_BY_A_FAULT = 4
MINUTES = ("experiment ", "tradeoff ", "compare simulated", "evaluate simulated", "train simulated", "hold ")
"""Commands that are tried by their own tests, since they grasp for a while."""


@pytest.mark.slow
def test_each_row_of_the_table_can_be_typed_as_printed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(SAMPLES, "samples")
    rows = re.findall(r"^\| [^|]+ \| `graspsense ([^`]+)` \|", README, flags=re.MULTILINE)
    assert len(rows) > 20
    for row in rows:
        # A page of a grasp that goes on waits for a viewer.
        if row.startswith(MINUTES) or "--live" in row:
            continue
        done = graspsense(*row.split())
        expected = ENDED_BY_A_FAULT if "pad_fault" in row else 0
        assert done.returncode == expected, f"{row}: {done.stderr}"


def test_the_page_of_commands_has_every_command_and_no_other():
    page = (ROOT / "docs" / "commands.md").read_text()
    named = {line.split()[1] for line in re.findall(r"`(?:sudo )?(graspsense [^`]+)`", page)}
    assert named - {"COMMAND"} == set(COMMANDS)


def test_links_lead_somewhere():
    targets = re.findall(r"\]\((?!https?:|#)([^)]+)\)", README)
    assert "docs/icub.md" in targets
    for target in targets:
        assert (ROOT / target).is_file(), target
