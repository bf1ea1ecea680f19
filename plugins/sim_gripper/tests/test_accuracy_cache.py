"""A verified model is found again by its content, in memory and on disk, and by the same code alone."""

import json
import os
import pwd

import pytest
from attrs import evolve
from cases import every_case

from graspsense.plugin_api import create
from graspsense.simulator_api import RunConfig
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.accuracy import cache
from graspsense_sim_gripper.run.accuracy import select as selection
from graspsense_sim_gripper.run.build import Problem
from graspsense_sim_gripper.run.problem import GraspController
from graspsense_sim_gripper.scene.spec import ObjectSpec

CONFIG = SimConfig(sensor="ideal", spread=False, accuracy=0.1, rate_hz=250.0, open_gap_m=0.051)
"""Few ticks a grasp: what is kept does not depend on how long it took to select."""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "graspsense" / "chosen_steps"


@pytest.fixture
def trials(monkeypatch):
    """Return the list of the models that were selected by trial grasps."""
    selected, select = [], selection._select

    def counted(*given):
        selected.append(select(*given))
        return selected[-1]

    monkeypatch.setattr(selection, "_select", counted)
    return selected


def shell(k1=2000.0):
    return ObjectSpec(name="made up", width_m=0.05, terms=(("elastic", {"k1_n_m": k1, "k3_n_m3": 2e6}),))


def select(config=CONFIG, spec=None, **settings):
    """Return the model that a process selects which begins now."""
    cache.forget()
    return again(config, spec, **settings)


def again(config=CONFIG, spec=None, **settings):
    """Return the model that this process selects."""
    controller = GraspController(
        create("controller", "hybrid", closing_speed_m_s=0.05, **settings), RunConfig()
    )
    return selection.select(Problem(config, spec or shell()), controller)


@pytest.mark.slow
def test_memory_finds_a_model_by_content_and_not_by_object(trials):
    model = select()
    # Another object of Python with the same content, and other settings that no model depends on.
    assert again(spec=shell()) is again(evolve(CONFIG, noise_counts=9.0)) is model
    assert len(trials) == 1


@pytest.mark.slow
def test_memory_is_bounded(monkeypatch):
    monkeypatch.setattr(cache, "MAX_IN_MEMORY", 2)
    select()
    for k in range(3):
        again(spec=shell(1000.0 + k))
    assert len(cache._IN_MEMORY) == 2


def test_the_next_process_finds_what_was_selected(trials, folder):
    made = select()
    assert select() == made
    assert len(trials) == len(list(folder.iterdir())) == 1


def test_what_decides_nothing_of_the_model_finds_it_too(trials):
    select()
    select(evolve(CONFIG, sensor="pads", noise_counts=9.0))
    assert len(trials) == 1


@pytest.mark.slow
def test_another_object_accuracy_or_controller_is_tried_by_itself(trials):
    select()
    others = select(spec=shell(2001.0)), select(evolve(CONFIG, accuracy=0.2)), select(probing_force_n=19.0)
    assert (len(trials), trials[0] in others) == (4, False)


def test_edited_code_finds_nothing_of_before(trials, monkeypatch):
    made = select()
    step = type(create("controller", "hybrid")).step
    monkeypatch.setattr(step, "__code__", step.__code__.replace(co_consts=(*step.__code__.co_consts, 7)))
    assert select() == made
    assert len(trials) == 2


@every_case("source", ["config", "plant/contact", "run/loop", "scene/spec", "solve/advance"])
def test_a_file_of_any_room_of_the_simulator_belongs_to_its_code(source):
    assert f"graspsense_sim_gripper/{source}.py " in cache._own_code().decode()


@pytest.mark.slow
def test_a_damaged_one_is_made_anew(trials, folder):
    made = select()
    (kept,) = folder.iterdir()
    edited = json.loads(kept.read_text())
    edited["model"]["left_out"] = [0]
    damages = (b"", b"{", b"[]", b'{"verification": null}', b"\xff\xfe", json.dumps(edited).encode())
    for n, damage in enumerate(damages, 2):
        kept.write_bytes(damage)
        assert select() == made
        assert select() == made
        assert len(trials) == n, damage


@pytest.mark.parametrize(
    "change",
    ["file", *(pytest.param(change, marks=pytest.mark.slow) for change in ("folder", "above", "owner"))],
)
def test_one_that_another_user_could_have_written_is_not_used(trials, folder, change, monkeypatch):
    made, so_far = select(), len(trials)
    (kept,) = folder.iterdir()
    changed = {"file": kept, "folder": folder, "above": folder.parent}.get(change)
    mode = changed and changed.stat().st_mode
    if changed is not None:
        changed.chmod(0o777)
    elif os.geteuid() == 0:
        os.chown(kept, 4711, 4711)
    else:  # the same by the eyes of another user
        monkeypatch.setattr(os, "geteuid", lambda: 4711)
    with pytest.warns(UserWarning, match="choices of models .* not used"):
        assert select() == made
    assert len(trials) == so_far + 1
    if changed is not None:
        changed.chmod(mode)


@pytest.mark.slow
def test_with_any_mask_of_the_user_what_is_kept_is_used(trials):
    mask = os.umask(0)
    select()
    os.umask(mask)
    select()
    assert len(trials) == 1


def test_a_folder_that_cannot_be_made_costs_nothing_but_time(trials, folder):
    folder.parent.write_text("no folder")
    assert select() == select()
    assert len(trials) == 2


@pytest.mark.slow
def test_the_older_half_makes_room(monkeypatch, folder):
    monkeypatch.setattr(cache, "MAX_FILES", 4)
    for k in range(4):
        select(spec=shell(1000.0 + k))
        newest = max(folder.iterdir(), key=lambda path: path.stat().st_mtime_ns)
        os.utime(newest, (k, k))
    select(spec=shell(1900.0))
    assert len(list(folder.iterdir())) == 3
    assert min(path.stat().st_mtime for path in folder.iterdir()) == 2.0


@pytest.mark.slow
def test_without_a_home_nothing_is_kept_and_every_process_selects_anew(trials, monkeypatch):
    def unknown(uid):
        raise KeyError(f"getpwuid(): uid not found: {uid}")

    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    assert select() == select()
    assert len(trials) == 2
