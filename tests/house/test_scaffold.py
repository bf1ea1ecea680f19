"""`plugins new`: what it makes, and what it refuses. `.ci/scaffolds` installs and tests every one of them."""

import importlib
import itertools
import re
import sys
import tomllib

import pytest
from cases import every_case

import graspsense_sim_gripper.plugin
from graspsense.core.components.entries import TABLE_OF_ROLE, PipelineEntry
from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.pipeline.pipeline import load_pipeline
from graspsense.core.values.errors import ConfigError, WiringError
from graspsense.scaffold.make import KINDS, make

COMBINATIONS = [
    pytest.param(roles, marks=[] if count in (1, len(KINDS)) else [pytest.mark.long])
    for count in (1, 2, len(KINDS) - 1, len(KINDS))
    for roles in itertools.combinations(KINDS, count)
]
"""Each role alone and all of them; among the long tests each pair and all but one."""


@pytest.mark.parametrize("roles", COMBINATIONS, ids="+".join)
def test_a_package_is_whole(roles, tmp_path):
    make("lab-thing", roles, tmp_path / "lab-thing")

    folder = tmp_path / "lab-thing"
    for path in folder.rglob("*"):
        if path.is_file():
            text = path.read_text()
            assert not re.search(r"\$\{?[a-zA-Z]", text), f"{path.name} has a place that was not filled"
            if path.suffix == ".py":
                compile(text, str(path), "exec")
    project = tomllib.loads((folder / "pyproject.toml").read_text())
    assert project["project"]["entry-points"]["graspsense.plugins"] == {"lab-thing": "lab_thing.plugin"}
    assert (folder / "src" / "lab_thing" / "py.typed").is_file()
    assert (folder / "tests" / "test_conformance.py").is_file()


@every_case(
    ("name", "role", "says"),
    [
        ("lab-thing", "features", r"'feature-set'\?.*sensor-backend .*each grasp ended$"),
        ("Lab_Thing", "feature-set", "small letters, digits"),
        ("graspsense-chitta", "feature-set", "'chitta' .* graspsense/chitta"),
        ("numpy", "feature-set", "package numpy"),
        ("json", "feature-set", "Python .*json"),
        ("graspsense", "controller", "graspsense itself has it"),
        ("graspsense-c45", "classifier", "graspsense itself has it"),
        ("class", "observer", "class .*keyword"),
        ("hybrid", "controller", "'hybrid' .* graspsense/hybrid"),
        *(
            (name, "sensor-backend", "spaces.* lab-hand")
            for name in ("lab hand", "lab-hand ", " lab", "lab\thand")
        ),
    ],
)
def test_what_it_refuses(name, role, says, tmp_path):
    with pytest.raises(ConfigError, match=re.compile(says, re.DOTALL)):
        make(name, [role], tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_role_is_given_once(tmp_path):
    with pytest.raises(ConfigError, match=r"--role observer .*2 times"):
        make("lab-thing", ["observer", "controller", "observer"], tmp_path / "lab-thing")


@pytest.mark.parametrize(
    "roles",
    [
        pytest.param(tuple(KINDS), id="all of them"),
        *(pytest.param((kind,), id=kind, marks=pytest.mark.slow) for kind in KINDS),
    ],
)
def test_the_components_of_a_package_fit_together(roles, tmp_path, monkeypatch):
    make("lab-thing", roles, tmp_path / "lab-thing")
    monkeypatch.syspath_prepend(tmp_path / "lab-thing" / "src")
    for name in [name for name in sys.modules if name.partition(".")[0] == "lab_thing"]:
        monkeypatch.delitem(sys.modules, name)
    plugin = importlib.import_module("lab_thing.plugin")
    selected = [role for role in roles if role in TABLE_OF_ROLE]

    with IsolatedPlugins() as plugins:
        plugins.add(graspsense_sim_gripper.plugin, "graspsense-sim-gripper")
        plugins.add(plugin, "lab-thing")

        assert [
            component.role for component in plugins.components() if component.distribution == "lab-thing"
        ] == selected
        if len(selected) > 1:
            trial = load_pipeline("lab-thing", plugins=plugins).grasp()
            assert (trial.outcome.words, dict(trial.features.reasons)) == ("steady", {})
        else:
            assert not any(
                pipeline.distribution == "lab-thing" for pipeline in plugins.resources(PipelineEntry)
            )


def test_the_first_commands_find_the_scene_from_where_they_are_printed_and_from_the_package(tmp_path):
    *_, printed = make("lab-term", ["sim-term"], tmp_path / "lab-term")

    scene = tmp_path / "lab-term" / "scene.toml"
    assert printed.split() == f"graspsense run --object {scene} -o classifier.type=none".split()
    assert "graspsense run --object scene.toml -o" in (tmp_path / "lab-term" / "README.md").read_text()


@pytest.mark.slow
def test_nothing_is_written_over(tmp_path):
    make("lab-thing", ["observer"], tmp_path / "lab-thing")

    with pytest.raises(ConfigError, match=r"lab-thing .*--folder"):
        make("lab-thing", ["observer"], tmp_path / "lab-thing")


def test_a_new_gripper_grasps_with_the_default_pipeline_at_once(tmp_path, monkeypatch):
    make("lab-hand", ["sensor-backend"], tmp_path / "lab-hand")
    monkeypatch.syspath_prepend(tmp_path / "lab-hand" / "src")
    from lab_hand import plugin

    with IsolatedPlugins() as plugins:
        plugins.add(plugin, "lab-hand")
        pipeline = load_pipeline(options=["gripper.type=lab-hand", "classifier.type=none"], plugins=plugins)
        trial = pipeline.grasp()

        assert pipeline.settings.values["controller"]["sends"] == "velocity"
        assert pipeline.settings.origins["controller.sends"] == "lab-hand/lab-hand accepts velocity"
        assert (trial.outcome.words, trial.reason) == ("steady", "")
        features = trial.features.as_dict()
        assert features["p_first"] == pytest.approx(0.05, abs=0.001)
        assert features["f_steady"] == pytest.approx(20.0, abs=1.0)  # the default probing force
        with pytest.raises(WiringError, match=r"effort, .*lab-hand/lab-hand .*velocity"):
            load_pipeline(
                options=["gripper.type=lab-hand", "classifier.type=none", "controller.sends=effort"],
                plugins=plugins,
            )
