"""A choice that a trial grasp has checked is found again, by the same code alone."""

import os
import pwd

import pytest
from attrs import evolve

from graspsense.plugin_api import RunConfig, create
from graspsense_sim_gripper import checking
from graspsense_sim_gripper.checking import Control, checked_choice
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.objects.spec import ObjectSpec
from graspsense_sim_gripper.reduction import cache

CONFIG = SimConfig(sensor="ideal", spread=False)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "graspsense" / "choices"


@pytest.fixture
def trials(monkeypatch):
    """Return the list of the choices that were tried by a grasp."""
    tried, check = [], checking._check

    def counted(*given):
        tried.append(check(*given))
        return tried[-1]

    monkeypatch.setattr(checking, "_check", counted)
    return tried


def choice(config=CONFIG, k1=2000.0, **settings):
    """Return what a process that begins would choose."""
    checking._CHECKED.clear()
    spec = ObjectSpec(name="made up", width_m=0.05, terms=(("elastic", {"k1_n_m": k1, "k3_n_m3": 2e6}),))
    return checked_choice(config, spec, Control(create("controller", "hybrid", **settings), RunConfig()))


def test_the_next_process_finds_what_was_chosen(trials, folder):
    made = choice()
    assert choice() == made
    assert len(trials) == len(list(folder.iterdir())) == 1


def test_another_object_accuracy_or_controller_is_tried_by_itself(trials):
    first = choice()
    others = choice(k1=2001.0), choice(evolve(CONFIG, accuracy=0.03)), choice(probing_force_n=19.0)
    assert len(trials) == 4
    assert first not in others


def test_what_decides_nothing_of_the_model_finds_it_too(trials):
    choice()
    choice(evolve(CONFIG, sensor="pads", noise_counts=9.0))
    assert len(trials) == 1


def test_edited_code_finds_nothing_of_before(trials, monkeypatch):
    made = choice()
    step = type(create("controller", "hybrid")).step
    monkeypatch.setattr(step, "__code__", step.__code__.replace(co_consts=(*step.__code__.co_consts, 7)))
    assert choice() == made
    assert len(trials) == 2


@pytest.mark.parametrize("damage", [b"", b"{", b"[]", b'{"check": null}', b"\xff\xfe"])
def test_a_damaged_one_is_made_anew(trials, folder, damage):
    made = choice()
    (kept,) = folder.iterdir()
    kept.write_bytes(damage)
    assert choice() == made
    assert choice() == made
    assert len(trials) == 2


def test_a_folder_that_cannot_be_made_costs_nothing_but_time(trials, folder):
    folder.parent.write_text("no folder")
    assert choice() == choice()
    assert len(trials) == 2


def test_the_older_half_makes_room(monkeypatch, folder):
    monkeypatch.setattr(cache, "MOST", 4)
    for k in range(4):
        choice(k1=1000.0 + k)
        newest = max(folder.iterdir(), key=lambda path: path.stat().st_mtime_ns)
        os.utime(newest, (k, k))
    choice(k1=1900.0)
    assert len(list(folder.iterdir())) == 3
    assert min(path.stat().st_mtime for path in folder.iterdir()) == 2.0


def test_without_a_home_nothing_is_kept_and_every_process_chooses_anew(trials, monkeypatch):
    def unknown(uid):
        raise KeyError(f"getpwuid(): uid not found: {uid}")

    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    assert choice() == choice()
    assert len(trials) == 2
