"""What another user could have changed is not loaded. What a run starts is reached from this machine alone."""

import os
import shutil
import textwrap
from contextlib import contextmanager
from pathlib import Path

import pytest
from commands import python

from graspsense.core.files import user_folders
from graspsense.core.files.user_folders import is_closed, make_closed, why_open
from graspsense.core.grasp.calibration_files import (
    Calibration,
    calibration_path,
    calibrations_of,
    write_calibration,
)
from graspsense.core.values.errors import ConfigError

STRANGER = 4711
"""The number of a user whom nobody is."""
IS_ROOT = os.geteuid() == 0


@pytest.fixture
def to_stranger(monkeypatch):
    """Return a function that makes a path another user's: really for root, and else by the eyes of another user."""

    def give(path):
        if IS_ROOT:
            os.lchown(path, STRANGER, STRANGER)
        else:
            monkeypatch.setattr(user_folders.os, "geteuid", lambda: STRANGER)

    return give


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "cache" / "below" / "file"
    path.parent.mkdir(parents=True, mode=0o755)
    path.write_text("x")
    path.chmod(0o644)
    return path


def test_a_path_of_the_users_own_is_closed(file):
    assert why_open(file) == why_open(file.parent) == ""
    assert why_open(file.with_name("missing")) == why_open(file.parent / "no" / "folder") == ""
    assert why_open(Path("/usr/bin")) == ""


@pytest.mark.parametrize("place", [".", "..", "../.."])
def test_a_path_is_open_if_another_user_owns_it_or_others_may_write_to_it_or_a_folder_above(
    file, to_stranger, place
):
    changed = (file / place).resolve() if place != "." else file
    mode = changed.stat().st_mode
    for open_mode in (0o777, 0o757, 0o702):
        changed.chmod(open_mode)
        assert f"mode {open_mode:o}" in why_open(file)
        assert str(changed) in why_open(file)
    changed.chmod(mode)
    to_stranger(changed)
    assert f"belongs to user {STRANGER if IS_ROOT else os.getuid()}" in why_open(file)


def test_a_folder_with_the_sticky_bit_protects_what_is_in_it(file):
    file.parent.chmod(0o1777)
    assert why_open(file) == ""
    file.chmod(0o1666)  # on a file the bit protects nothing
    assert why_open(file)


def test_a_folder_that_its_group_may_write_to_is_closed_if_the_group_is_the_users_alone(file, monkeypatch):
    import grp
    import pwd

    ada = ("ada", "x", os.getuid(), 1000, "", "/home/ada", "/bin/sh")
    monkeypatch.setattr(pwd, "getpwuid", lambda uid: pwd.struct_passwd(ada))
    file.parent.chmod(0o775)
    for name in ("ada", "users"):
        for members in (["ada"], [], ["ada", "bob"], ["bob"]):
            group = grp.struct_group((name, "x", 1000, members))
            monkeypatch.setattr(grp, "getgrgid", lambda gid, group=group: group)
            assert (why_open(file) == "") == (name == "ada" and "bob" not in members)


def test_links_are_followed_and_their_places_count(file, tmp_path, to_stranger):
    link = tmp_path / "link"
    link.symlink_to(file.parent)
    assert why_open(link / "file") == ""
    file.parent.chmod(0o777)
    assert why_open(link / "file")
    file.parent.chmod(0o755)
    # In a circle they are open.
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    assert why_open(tmp_path / "a" / "file")
    to_stranger(link)
    assert why_open(link / "file")


@contextmanager
def no_mask():
    """The mask of a user whose new files everybody may write to."""
    mask = os.umask(0)
    try:
        yield
    finally:
        os.umask(mask)


def test_folders_are_made_closed_whatever_the_mask_of_the_user_is(tmp_path):
    with no_mask():
        make_closed(tmp_path / "a" / "b" / "c")
    assert why_open(tmp_path / "a" / "b" / "c") == ""


def test_there_is_one_warning_for_each_reason(file):
    file.chmod(0o666)
    with pytest.warns(UserWarning, match="used: .*mode 666") as told:
        assert [is_closed(file, "things") for _ in range(3)] == [False] * 3
    assert len(told) == 1


CALIBRATION = Calibration(
    kind="tare",
    serial="L7",
    device={},
    made="2026-11-01T10:00:00+00:00",
    data={"left": [1.0], "right": [1.0]},
)


@pytest.mark.parametrize("change", ["file", "folder", "owner"])
@pytest.mark.parametrize("named", [True, False])
def test_a_calibration_that_another_user_could_have_changed_is_refused(
    tmp_path, monkeypatch, to_stranger, change, named
):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    folder = str(tmp_path / "lab") if named else ""
    path = calibration_path(folder, "L7", "tare")
    with no_mask():
        write_calibration(path, CALIBRATION)
    assert list(calibrations_of(folder, "L7", {})) == ["tare"]
    if change == "owner":
        to_stranger(path)
    else:
        (path if change == "file" else path.parent).chmod(0o777)
    with pytest.raises(ConfigError, match=rf"(?s){path}.*gripper\.calibration=none"):
        calibrations_of(folder, "L7", {})
    assert calibrations_of("none", "L7", {}) == {}


PROGRAM = """
    import os
    os.umask(int(os.environ["MASK"], 8))
    from graspsense.simulator_api import compile_function, is_on_disk

    def law(x):
        return 2.0 * x

    kept = is_on_disk(law)
    compiled = compile_function(law)
    print(compiled(21.0), kept, sum(compiled.stats.cache_hits.values()))
"""


class Lab:
    """A program that compiles a function, the folders of its user, and a file that hostile code writes."""

    def __init__(self, folder):
        pytest.importorskip("numba", reason="numba is not installed")
        self.folder, self.mark = folder, folder / "hostile code ran"
        self.program = folder / "own" / "law.py"
        self.program.parent.mkdir()
        self.program.write_text(textwrap.dedent(PROGRAM))

    def run(self, mask="022", cwd=None, **environ):
        done = python(
            "-P",
            self.program,
            env={**os.environ, "XDG_CACHE_HOME": str(self.folder / "mine"), "MASK": mask, **environ},
            cwd=cwd or self.program.parent,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.strip(), done.stderr

    def poison(self, cache):
        """Put code in place of the index of each compiled function, which numba reads with pickle."""
        payload = f"cposix\nsystem\n(S'touch \"{self.mark}\"'\ntR.".encode()
        files = list(cache.rglob("*.nbi"))
        assert files
        for path in files:
            path.write_bytes(payload)


@pytest.fixture
def lab(tmp_path):
    return Lab(tmp_path)


@pytest.fixture(scope="module", params=["NUMBA_CACHE_DIR", "XDG_CACHE_HOME"])
def poisoned(request, tmp_path_factory):
    """A lab whose folder `cache`, to which this variable leads, is poisoned; and the variable."""
    lab = Lab(tmp_path_factory.mktemp("lab"))
    environ = {request.param: str(lab.folder / "cache")}
    assert lab.run("000", **environ) == ("42.0 False 0", "")
    # Code of the user's own is used whatever the mask.
    assert lab.run("000", **environ) == ("42.0 True 1", "")
    lab.poison(lab.folder / "cache")
    return lab, request.param


@pytest.mark.slow
def test_the_trap_is_a_trap_since_code_in_the_users_own_cache_runs(poisoned):
    lab, variable = poisoned
    lab.run(**{variable: str(lab.folder / "cache")})
    assert lab.mark.exists()
    lab.mark.unlink()


@pytest.mark.slow
@pytest.mark.parametrize("change", ["top", "sources", "files", "owner of a file", "owner of all"])
def test_compiled_code_that_another_user_could_have_put_there_is_not_run(poisoned, tmp_path, change):
    if change.startswith("owner") and not IS_ROOT:
        pytest.skip("only root can give a file away; the variants with modes run for everybody")
    lab, variable = poisoned
    cache = shutil.copytree(lab.folder / "cache", tmp_path / "cache")
    (index,) = cache.rglob("*.nbi")
    changed = {"top": [cache], "sources": [index.parent], "files": [index], "owner of a file": [index]}
    for path in changed.get(change, [cache, *cache.rglob("*")]):
        if change.startswith("owner"):
            os.chown(path, STRANGER, STRANGER)
        else:
            path.chmod(0o777)
    printed, warned = lab.run(**{"XDG_CACHE_HOME": str(tmp_path / "mine"), variable: str(cache)})
    assert printed == "42.0 False 0"
    assert "compiled code" in warned
    assert "not used" in warned
    assert not lab.mark.exists()


@pytest.mark.slow
def test_without_a_closed_cache_of_numba_the_users_own_is_used(lab):
    shared = lab.folder / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    runs = [lab.run(NUMBA_CACHE_DIR=str(shared))[0] for _ in range(2)]
    assert runs == ["42.0 False 0", "42.0 True 1"]
    assert list(shared.rglob("*")) == []


@pytest.mark.slow
def test_a_file_of_the_current_folder_does_not_choose_where_compiled_code_is(lab):
    data = lab.folder / "data"
    data.mkdir()
    lab.run(NUMBA_CACHE_DIR=str(data / "cache"))
    lab.poison(data / "cache")
    (data / ".numba_config.yaml").write_text(f"cache_dir: {data / 'cache'}\n")
    assert lab.run(cwd=data) == ("42.0 False 0", "")
    assert not lab.mark.exists()
