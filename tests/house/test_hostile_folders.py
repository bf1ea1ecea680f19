"""A data folder is data: no command runs what it contains, and the commit is recorded without its configuration."""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from cases import every_case
from grippers import bottle, squeezing
from repository import ROOT
from wayward import CSV

from graspsense.recording.checkout import checkout_state
from graspsense.recording.provenance import commit_text

PROGRAM = Path(sys.executable).parent / "graspsense"
MODULES = (
    *("attr", "attrs", "click", "dask", "distributed", "json", "mcap", "multiprocessing"),
    *("numba", "numpy", "pickle", "pluggy", "runpy", "scipy", "selectors", "sitecustomize"),
    *("sklearn", "socket", "threading", "usercustomize", "yaml", "zstandard", "graspsense"),
)
EXPERIMENT = """
title = "Recognised from a table"
seeds = 2
classifiers = ["c45"]

[data]
source = "trials.csv"
label = "what"

[judge]
folds = 2
controls = false
grasps = 0
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with modules that nearly every program imports; each leaves its name in a file if it is imported."""
    folder = tmp_path / "data"
    folder.mkdir()
    for name in MODULES:
        (folder / f"{name}.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'a').write('{name}\\n')\n")
    (folder / "trials.csv").write_text(CSV)
    rows = (f"{k / 1000},{squeezing(k / 1000)},{bottle(k / 1000)[0]}" for k in range(2200))
    (folder / "grasp.csv").write_text("\n".join(["t,g,f", *rows]))
    (folder / "it.toml").write_text(EXPERIMENT)
    return folder


def ran(folder):
    mark = folder.parent / "ran"
    return mark.read_text().split() if mark.exists() else []


def run(folder, *arguments):
    done = subprocess.run(
        [PROGRAM, *arguments], cwd=folder, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        "run --save kept -o classifier.type=none",
        "experiment it.toml --out out --executor processes --workers 2",
        "import grasp.csv --time t --gap g --force f --force f --label can --save kept",
        "plugins check graspsense-c45 --no-wheel",
        "evaluate simulated --objects block,can:full_open --instances 2 --trials 2 --folds 2 -o gripper.compile=never",
    ],
    ids=["run", "processes", "import", "plugins", "evaluate"],
)
def test_no_command_imports_from_the_current_folder(folder, command):
    run(folder, *command.split())
    assert ran(folder) == []


def test_every_python_process_is_started_without_the_current_folder():
    """The rule for all the code: whatever starts an interpreter gives it `-P` first."""
    starts = []
    for path in (*ROOT.glob("src/**/*.py"), *ROOT.glob("plugins/*/src/**/*.py")):
        text = path.read_text()
        for node in ast.walk(ast.parse(text)) if "sys.executable" in text else ():
            words = [ast.unparse(word) for word in getattr(node, "elts", [])]
            if "sys.executable" in words:
                starts.append((str(path), words[:2]))
    assert len(starts) >= 5
    assert [place for place, words in starts if words != ["sys.executable", "'-P'"]] == []


@pytest.mark.parametrize(
    ("dirty", "told"), [(True, " (with changes)"), (False, ""), (None, " (changes unknown)")]
)
def test_a_report_says_whether_the_files_had_changes_or_that_nobody_knows(dirty, told):
    made = {"git": {"graspsense": {"commit": "0123456789abcdef" * 2, "dirty": dirty}}}
    assert commit_text(made) == "0123456789ab" + told
    assert commit_text({"git": {"graspsense": None}}) == commit_text({}) == "unknown"


needs_git = pytest.mark.skipif(shutil.which("git") is None, reason="needs git")


def git(folder, *arguments):
    # Nothing of the machine's configuration, such as a rule that commits are signed.
    environ = {**os.environ, "GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_NOSYSTEM": "1"}
    who = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "init.defaultBranch=main"]
    done = subprocess.run(
        ["git", *who, *arguments], cwd=folder, env=environ, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


@pytest.fixture
def checkout(tmp_path):
    """A checkout with one commit of one file."""
    folder = tmp_path / "checkout"
    folder.mkdir()
    git(folder, "init", ".")
    (folder / "code.py").write_text("x = 1\n")
    git(folder, "add", ".")
    git(folder, "commit", "-m", "first")
    return folder


@needs_git
def test_the_commit_and_whether_files_were_changed(checkout):
    head = git(checkout, "rev-parse", "HEAD")
    assert checkout_state(checkout) == {"commit": head, "dirty": False}
    (checkout / "untracked").write_text("y")
    (checkout / "below").mkdir()
    assert checkout_state(checkout / "below") == {"commit": head, "dirty": False}
    (checkout / "code.py").write_text("x = 2\n")
    assert checkout_state(checkout) == {"commit": head, "dirty": True}
    git(checkout, "add", "code.py")
    assert checkout_state(checkout) == {"commit": head, "dirty": True}
    git(checkout, "commit", "-m", "second")
    assert checkout_state(checkout) == {"commit": git(checkout, "rev-parse", "HEAD"), "dirty": False}


@needs_git
def test_the_commit_of_packed_branches_linked_worktrees_and_no_branch(checkout, tmp_path):
    head = git(checkout, "rev-parse", "HEAD")
    git(checkout, "worktree", "add", "-b", "other/branch", str(tmp_path / "linked"))
    git(checkout, "pack-refs", "--all")
    for folder in (checkout, tmp_path / "linked"):
        assert checkout_state(folder) == {"commit": head, "dirty": False}
    git(checkout, "checkout", "--detach")
    assert checkout_state(checkout) == {"commit": head, "dirty": False}
    git(tmp_path, "init", "new")
    assert checkout_state(tmp_path / "new") is None
    assert checkout_state(tmp_path) is None


@needs_git
def test_the_commit_in_a_repository_with_sha256(tmp_path):
    git(tmp_path, "init", "--object-format=sha256", ".")
    (tmp_path / "code.py").write_text("x = 1\n")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-m", "first")
    assert checkout_state(tmp_path) == {"commit": git(tmp_path, "rev-parse", "HEAD"), "dirty": False}


def hostile(checkout, mark):
    """Make each program that the configuration of a checkout can name one that leaves a mark."""
    script = checkout.parent / "script"
    script.write_text(f"#!/bin/sh\necho ran >> {mark}\ncat\n")
    script.chmod(0o755)
    hooks = checkout.parent / "hooks"
    hooks.mkdir()
    for hook in ("post-index-change", "fsmonitor-watchman", "query-watchman", "post-checkout"):
        shutil.copy(script, hooks / hook)
    included = checkout / "included"
    included.write_text(f"[core]\n fsmonitor = {script}\n")
    settings = {
        "core.fsmonitor": script,
        "core.hooksPath": hooks,
        "core.pager": script,
        "core.sshCommand": script,
        "core.gitProxy": script,
        "alias.status": f"!{script}",
        "diff.external": script,
        "include.path": included,
        "filter.evil.clean": script,
        "filter.evil.smudge": script,
        "filter.evil.process": script,
        "filter.evil.required": "true",
        "diff.evil.textconv": script,
        "diff.evil.command": script,
        "remote.origin.url": f"ext::{script}",
        "remote.origin.promisor": "true",
        "extensions.partialClone": "origin",
        "protocol.ext.allow": "always",
    }
    for name, value in settings.items():
        git(checkout, "config", name, str(value))
    (checkout / ".gitattributes").write_text("* filter=evil diff=evil\n")
    (checkout / ".git" / "info" / "attributes").write_text("* filter=evil diff=evil\n")


@needs_git
def test_no_program_of_a_checkout_is_run(checkout, tmp_path):
    head = git(checkout, "rev-parse", "HEAD")
    mark = tmp_path / "ran"
    hostile(checkout, mark)
    os.utime(checkout / "code.py", (1, 1))  # git has to look at the content, which goes through the filter
    contents = {path: path.read_bytes() for path in (checkout / ".git").rglob("*") if path.is_file()}

    assert checkout_state(checkout) == {"commit": head, "dirty": False}
    (checkout / "code.py").write_text("x = 2\n")
    assert checkout_state(checkout) == {"commit": head, "dirty": True}

    assert not mark.exists()
    assert {path: path.read_bytes() for path in contents} == contents
    # The trap is a trap: git itself springs it.
    subprocess.run(["git", "status"], cwd=checkout, capture_output=True, check=False)
    assert mark.exists()


@pytest.mark.slow
@needs_git
def test_a_command_in_a_hostile_checkout_runs_nothing_of_it(checkout, tmp_path):
    hostile(checkout, tmp_path / "ran")
    os.utime(checkout / "code.py", (1, 1))
    run(checkout, "run", "--save", "kept", "-o", "classifier.type=none")
    assert not (tmp_path / "ran").exists()


@needs_git
def test_objects_that_are_missing_are_not_fetched(checkout, tmp_path):
    head = git(checkout, "rev-parse", "HEAD")
    hostile(checkout, tmp_path / "ran")
    shutil.rmtree(checkout / ".git" / "objects")
    (checkout / ".git" / "objects").mkdir()
    assert checkout_state(checkout) == {"commit": head, "dirty": None}
    assert not (tmp_path / "ran").exists()


@every_case(
    "head",
    [
        "",
        "ref: refs/heads/../../../secret",
        "ref: /etc/passwd",
        "0" * 39,
        "\xff",
        "ref: refs/heads/none",
        "a pipe",
        "a pipe in place of the folder",
    ],
)
def test_a_folder_of_git_that_is_no_such_has_no_commit(tmp_path, head):
    (tmp_path / "secret").write_text("1" * 40)
    if head.endswith("folder"):
        os.mkfifo(tmp_path / ".git")  # opening it would wait without end
    else:
        (tmp_path / ".git").mkdir()
        (tmp_path / ".git" / "packed-refs").write_text("")
        place = tmp_path / ".git" / "HEAD"
        os.mkfifo(place) if head == "a pipe" else place.write_text(head)
    assert checkout_state(tmp_path) is None


def test_a_program_named_git_in_the_current_folder_is_not_run(checkout, tmp_path, monkeypatch):
    (checkout / "git").write_text(f"#!/bin/sh\ntouch {tmp_path / 'ran'}\n")
    (checkout / "git").chmod(0o755)
    monkeypatch.chdir(checkout)
    for path in (".", "", f".:{os.environ['PATH']}"):
        monkeypatch.setenv("PATH", path)
        assert checkout_state(Path.cwd())["dirty"] in (None, False)
    assert not (tmp_path / "ran").exists()
