"""The commit of the git checkout that contains a folder, found without running anything that the folder names.

The configuration of a checkout can name programs for nearly each command of git: filters, monitors, hooks. Therefore
the commit is read here, and git compares the files through a repository of its own, which has no configuration.
"""

from __future__ import annotations

import os
import re
import shutil
import stat
import subprocess
import tempfile
from pathlib import Path
from typing import Any, Final

GIT_S: Final = 2.0
MOST_BYTES: Final = 1 << 24
"""Limit on the size of a file of git that is read here: its list of packed references is the longest."""

_COMMIT: Final = re.compile(r"[0-9a-f]{40}|[0-9a-f]{64}")
_BRANCH: Final = re.compile(r"ref: (refs/[^\s\0]+)")


def checkout_state(folder: Path) -> dict[str, Any] | None:
    """Return commit and dirty flag of the checkout that contains this folder, or None without one.

    Untracked files and submodules do not make a checkout dirty. The flag is None where it cannot be determined.
    """
    for top in (folder, *folder.parents):
        if (top / ".git").exists():
            break
    else:
        return None
    try:
        # A linked worktree has a file that names its folder, and that names the one which all share.
        git = top / ".git"
        git = git if git.is_dir() else top / _text(git).strip().removeprefix("gitdir: ")
        link = git / "commondir"
        common = git / _text(link).strip() if link.exists() else git
        commit = _commit(git, common)
    except (OSError, ValueError):
        return None
    return None if commit is None else {"commit": commit, "dirty": _is_dirty(top, git, common, commit)}


def _commit(git: Path, common: Path) -> str | None:
    head = _text(git / "HEAD").strip()
    branch = _BRANCH.fullmatch(head)
    if branch is None:
        return head if _COMMIT.fullmatch(head) else None
    name = branch.group(1)
    if ".." in name:
        return None
    for place in (git, common):
        if (place / name).exists():
            text = _text(place / name).strip()
            return text if _COMMIT.fullmatch(text) else None
    for line in _text(common / "packed-refs").splitlines():
        commit, _, packed = line.partition(" ")
        if packed == name and _COMMIT.fullmatch(commit):
            return commit
    return None


def _is_dirty(top: Path, git: Path, common: Path, commit: str) -> bool | None:
    """Return whether a tracked file differs from the commit, or None if git cannot tell within `GIT_S`."""
    program = shutil.which("git")
    if program is None or not os.path.isabs(program):
        # A relative path in PATH could name a program of the folder.
        return None
    hashing = "" if len(commit) == 40 else "[extensions]\n objectformat = sha256\n"
    try:
        with tempfile.TemporaryDirectory(prefix="graspsense-") as empty:
            for name in ("objects", "refs"):
                Path(empty, name).mkdir()
            Path(empty, "HEAD").write_text(commit + "\n")
            Path(empty, "config").write_text(
                f"[core]\n repositoryformatversion = {1 if hashing else 0}\n{hashing}"
            )
            ours = {
                "GIT_DIR": empty,
                "GIT_OBJECT_DIRECTORY": str(common.absolute() / "objects"),
                "GIT_INDEX_FILE": str(git.absolute() / "index"),
                "GIT_WORK_TREE": str(top.absolute()),
                "GIT_CONFIG_NOSYSTEM": "1",
                "GIT_CONFIG_GLOBAL": os.devnull,
                "GIT_ATTR_NOSYSTEM": "1",
                "GIT_OPTIONAL_LOCKS": "0",
                "GIT_NO_LAZY_FETCH": "1",
                "LC_ALL": "C",
            }
            done = subprocess.run(
                [program, "status", "--porcelain", "--untracked-files=no", "--ignore-submodules=all"],
                cwd=top,
                env={key: value for key, value in os.environ.items() if not key.startswith("GIT_")} | ours,
                capture_output=True,
                timeout=GIT_S,
                check=False,
            )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return bool(done.stdout.strip()) if done.returncode == 0 else None


def _text(path: Path) -> str:
    """Return the text of a regular file. Raises OSError, ValueError for anything else: a pipe would never end."""
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise ValueError(f"{path} is not a regular file")
        data = file.read(MOST_BYTES + 1)
    if len(data) > MOST_BYTES:
        raise ValueError(f"{path} is too long")
    return data.decode()
