"""Recorded squeezes of one object for `identify`, and trials of scenes that were identified."""

from __future__ import annotations

import json
import re
import sys
from contextlib import contextmanager
from importlib import import_module

import numpy as np
import pytest
from commands import printed, refused
from parts import implementing

from graspsense.core.components.identification import (
    CandidateScore,
    Identification,
    RecordedSqueeze,
    SqueezeFit,
    Undetermined,
)
from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.trace import trace_of
from graspsense.simulator_api import IdentifierEntry
from graspsense.sources import squeezes as module
from graspsense.sources.identified import gripper_flags, identified_scenes
from graspsense.sources.squeezes import recorded_squeezes
from graspsense.sources.trial_source import TrialSource, groups_of, kind_of

HERE = sys.modules[__name__]
SCENE = "width_m = 0.05\n"
CUP = 'width_m = 0.05\n[identified]\nlabel = "cup:full"\n[identified.gripper]\npad_stiffness_n_m = 8000.0\n'


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Return a store with one simulated squeeze of each of two objects."""
    folder = tmp_path_factory.mktemp("store")
    for name in ("sponge", "block"):
        quick = ("-o", "classifier.type=none", "-o", "gripper.rate_hz=250")
        printed("run", "--object", name, "--save", folder, "--label", name, *quick)
    return f"store:{folder}"


@pytest.mark.slow
def test_recordings_of_two_objects_need_a_name(store):
    with pytest.raises(ConfigError, match=r"of 2 objects.*name="):
        recorded_squeezes([store])
    (squeeze,) = recorded_squeezes([store], "sponge")
    assert squeeze.label == "sponge"
    assert len(squeeze.sha256) == 64
    assert squeeze.gripper["pad_stiffness_n_m"] == 3e4
    with pytest.raises(ConfigError, match=r"'spong'.*sponge"):
        recorded_squeezes([store], "spong")


@pytest.mark.slow
def test_one_trial_of_a_store_can_be_named(store):
    folder = store.removeprefix("store:")
    for name in (f"{folder}#2", f"store:{folder}#2"):
        (squeeze,) = recorded_squeezes([name])
        assert (squeeze.label, squeeze.name) == ("block", f"{folder}#2")
    with pytest.raises(ConfigError, match="no trial 7"):
        recorded_squeezes([f"{folder}#7"])


def test_a_class_that_the_user_names_is_one_object(monkeypatch):
    """Its states are not asked for again."""
    squeezes = {
        name: RecordedSqueeze(name=name, sha256="", trace=trace_of([], [], [], []), label=label)
        for name, label in (("a", "bottle:full"), ("b", "bottle:empty"), ("c", "can:full"))
    }
    monkeypatch.setattr(module, "_of_source", lambda source: [squeezes[source]])
    chosen = recorded_squeezes(["a", "b", "c"], "bottle")
    assert [(squeeze.name, squeeze.label) for squeeze in chosen] == [("a", "bottle"), ("b", "bottle")]
    with pytest.raises(ConfigError, match=r"of 2 objects.*name="):
        recorded_squeezes(["a", "b"])


def test_an_identified_scene_gives_its_label_and_its_fingertips(tmp_path):
    path = tmp_path / "cup.toml"
    path.write_text(CUP)
    source = f"identified:{path}"
    assert kind_of(source) == "simulated"
    (scene,) = identified_scenes(source)
    assert scene.label == "cup:full"
    assert [(flag.key, flag.value) for flag in gripper_flags(source)] == [
        ("gripper.pad_stiffness_n_m", 8000.0)
    ]
    (group,) = groups_of(TrialSource(source=source, instances=2, trials=3))
    assert dict(group.named) == {"cup:full": str(path)}
    assert group.instances == 2


def test_scenes_that_cannot_be_trained_on_together_are_refused(tmp_path):
    cup, other, own = (tmp_path / name for name in ("cup.toml", "other.toml", "own.toml"))
    cup.write_text(CUP)
    own.write_text("width_m = 0.05\n")
    other.write_text(CUP)
    with pytest.raises(ConfigError, match=r"cup.toml, .*other.toml .*'cup:full'"):
        identified_scenes(f"identified:{cup},{other}")
    other.write_text(CUP.replace("8000", "9000").replace("cup", "mug"))
    with pytest.raises(ConfigError, match="different fingertips"):
        identified_scenes(f"identified:{cup},{other}")
    with pytest.raises(ConfigError, match="no table"):
        identified_scenes(f"identified:{own}")
    own.write_text(CUP.replace("8000.0", "'8000'"))
    with pytest.raises(ConfigError, match="pad_stiffness_n_m: '8000'"):
        identified_scenes(f"identified:{own}")
    with pytest.raises(ConfigError, match=r"no\.toml"):
        identified_scenes(f"identified:{tmp_path / 'no.toml'}")


def test_the_command_refuses_what_is_not_a_scene_before_it_reads(tmp_path):
    assert "cup.json: the name" in refused("identify", "none.mcap", "--out", tmp_path / "cup.json")


def undecided(config, squeezes, progress, block) -> Identification:
    """Return a scene with a number that the squeezes do not determine."""
    del config, progress, block
    times = np.linspace(0.0, 1.0, 5)
    series = dict.fromkeys(("t_s", "compression_m", "measured_n", "fitted_n"), times)
    chosen = CandidateScore(
        terms="elastic (k1)", parameters=1, error=0.1, fit_error=0.1, verdict="chosen", chosen=True
    )
    return Identification(
        label="",
        scene=SCENE,
        parameters=(),
        candidates=(chosen,),
        undetermined=(Undetermined(what="k2", reason="too wide", remedy="squeeze deeper", in_scene=True),),
        fits=(SqueezeFit(name=squeezes[0].name, **series, rms_n=0.1, peak_n=1.0),),
        refusals=("k2 is not determined: too wide; squeeze deeper",),
    )


@contextmanager
def with_simulator(*plugins):
    """Use these plugins, our decision trees and our simulator alone."""
    with IsolatedPlugins(*plugins) as isolated:
        for name in ("c45", "sim-gripper"):
            plugin = import_module(f"graspsense_{name.replace('-', '_')}.plugin")
            isolated.add(plugin, f"graspsense-{name}")
        yield


@pytest.mark.slow
def test_a_scene_with_a_number_that_is_not_determined_is_written_with_force_only(
    store, tmp_path, monkeypatch
):
    monkeypatch.setitem(sys.modules, __name__, HERE)
    scene, page = tmp_path / "cup.toml", tmp_path / "cup.html"
    command = ("identify", store, "--class", "block", "--out", scene)
    entry = IdentifierEntry("sim", f"{__name__}:undecided", "a scene that is not to be used")
    with with_simulator(implementing("graspsense_identifiers", lambda self: [entry])):
        assert re.search(
            r"cup.toml.*written:\n  k2 is not determined.*\n  --force", refused(*command, "--page", page)
        )
        assert not scene.exists()
        assert "k2" in page.read_text()
        forced = printed(*command, "--force", "--json")
    assert scene.read_text() == SCENE
    assert json.loads(forced)["refusals"] == ["k2 is not determined: too wide; squeeze deeper"]


def test_without_the_distribution_that_identifies_the_command_says_what_to_install(tmp_path):
    with with_simulator():
        said = refused("identify", "none.mcap", "--out", tmp_path / "cup.toml")
    assert re.search(r"graspsense-identify:\n.*graspsense\[identify\]", said)


def test_a_single_scene_and_one_in_the_place_of_a_recording_are_refused_before_anything_is_simulated(
    tmp_path,
):
    path = tmp_path / "cup.toml"
    path.write_text(CUP)
    assert "classifier needs two" in refused("train", f"identified:{path}", "--out", tmp_path / "model.json")
    with pytest.raises(ConfigError, match=r"cup\.toml .*--object"):
        recorded_squeezes([str(path)])


def test_what_looks_wrong_in_an_imported_squeeze_goes_with_it(tmp_path):
    """The time is in ms, and the manifest does not say so."""
    rows = [f"{k / 1000},{80 - 0.3 * min(k, 110)},{max(0, k - 100)}" for k in range(150)]
    (tmp_path / "cup.csv").write_text("\n".join(["t,pos,F", *rows]) + "\n")
    manifest = tmp_path / "m.toml"
    manifest.write_text('files = "{label}.csv"\ntime = "t [ms]"\ngap = "pos [mm]"\nforce = "F"\n')
    (squeeze,) = recorded_squeezes([str(manifest)])
    assert any("lasts 0.15 ms only" in warning for warning in squeeze.warnings)
