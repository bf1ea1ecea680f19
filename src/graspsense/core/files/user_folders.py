"""The folders of the user for settings, data and caches, and whether a path is closed to other users.

A user without a home folder has none. A path is closed if it and each folder above it belong to this user or to root
and nobody else may write there. In a folder with the sticky bit, such as /tmp, others may add files but not replace
this user's. What others could have changed is not loaded as code or as measured numbers.
"""

from __future__ import annotations

import os
import stat
import warnings
from pathlib import Path
from typing import Final

NOWHERE: Final = "this user has no home directory: set HOME or {}, the folder to keep it in"


def config_folder() -> Path | None:
    """Return the folder for settings, whether or not it exists; None for a user without a home folder."""
    return _folder("XDG_CONFIG_HOME", ".config")


def data_folder() -> Path | None:
    """Return the folder for data, whether or not it exists; None for a user without a home folder."""
    return _folder("XDG_DATA_HOME", ".local", "share")


def cache_folder() -> Path | None:
    """Return the folder for caches, whether or not it exists; None for a user without a home folder."""
    # The temporary folder of the system is no substitute: other users could put code there.
    return _folder("XDG_CACHE_HOME", ".cache")


def _folder(variable: str, *beside: str) -> Path | None:
    given = os.environ.get(variable)
    # A relative one counts as not set, as the standard says: it would be another folder wherever the user stands.
    if given and os.path.isabs(given):
        return Path(given) / "graspsense"
    try:
        return Path.home().joinpath(*beside, "graspsense")
    except RuntimeError:
        # There is neither HOME nor an entry in the list of users, as in some containers.
        return None


MOST_LINKS: Final = 40
_WARNED: Final[set[str]] = set()


def why_open(path: Path) -> str:
    """Return why another user could change what is at `path`, or an empty text if the path is closed.

    A path that does not exist is as closed as the folder that it would be in.
    """
    try:
        return _why_open(path, [MOST_LINKS])
    except OSError as error:
        return f"{path} cannot be examined: {error.strerror}"


def is_closed(path: Path, content: str) -> bool:
    """Return whether `path` is closed to other users. If not, warn once that `content` is not used, and why."""
    reason = why_open(path)
    if reason and reason not in _WARNED:
        _WARNED.add(reason)
        warnings.warn(
            f"{content} ({path}) are not used: {reason}. Only this user and root may own it, or write to it or to a "
            "folder above it",
            stacklevel=2,
        )
    return not reason


def make_closed(folder: Path) -> None:
    """Make a folder, and those above it that are missing, for no other user to write to. Raises OSError."""
    if not folder.is_dir():
        make_closed(folder.parent)
        folder.mkdir(mode=0o755, exist_ok=True)


def _why_open(path: Path, links_left: list[int]) -> str:
    names = Path(os.path.abspath(path))
    for place in (*reversed(names.parents), names):
        try:
            status = place.lstat()
        except FileNotFoundError:
            return ""
        if status.st_uid not in (0, os.geteuid()):
            return f"{place} belongs to user {status.st_uid}"
        if stat.S_ISLNK(status.st_mode):
            links_left[0] -= 1
            if links_left[0] < 0:
                return f"{place} is one of more than {MOST_LINKS} links"
            # What follows in `path` is looked up in the target.
            target = place.parent / os.readlink(place)
            return _why_open(target / names.relative_to(place), links_left)
        if _others_may_write(place, status):
            return f"{place} can be written by other users (mode {stat.S_IMODE(status.st_mode):o})"
    return ""


def _others_may_write(place: Path, status: os.stat_result) -> bool:
    if stat.S_ISDIR(status.st_mode) and status.st_mode & stat.S_ISVTX:
        return False
    if status.st_mode & stat.S_IWOTH:
        return True
    return bool(status.st_mode & stat.S_IWGRP) and not _is_private_group(place, status.st_gid)


def _is_private_group(place: Path, gid: int) -> bool:
    """Return whether a group has this user as its only member, as most systems give one to each user."""
    import grp
    import pwd

    try:
        group, user = grp.getgrgid(gid), pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        return False
    # With a list of access rights, the bits of the group are the most that anybody on the list has.
    listed = hasattr(os, "listxattr") and "system.posix_acl_access" in os.listxattr(place)
    return group.gr_name == user and set(group.gr_mem) <= {user} and not listed
