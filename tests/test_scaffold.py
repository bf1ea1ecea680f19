"""`plugins new`: what it makes, and what it refuses. `.ci/scaffolds` installs and tests every one of them."""

from __future__ import annotations

import re
import tomllib

import pytest

from graspsense.core.errors import ConfigError, WiringError
from graspsense.core.pipeline import load_pipeline
from graspsense.core.plugins import IsolatedPlugins
from graspsense.scaffold.make import KINDS, make


@pytest.mark.parametrize("role", KINDS)
def test_a_package_is_whole(role, tmp_path):
    make("lab-thing", role, tmp_path / "lab-thing")

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


@pytest.mark.parametrize(
    ("name", "role", "says"),
    [
        (
            "lab-thing",
            "features",
            r"no role 'features'. There are:\n  sensor-backend .* Did you mean 'feature-set'\?",
        ),
        ("Lab_Thing", "feature-set", "small letters, digits and single hyphens"),
        ("graspsense-chitta", "feature-set", "name 'chitta' is taken by graspsense/chitta: choose another"),
        (
            "numpy",
            "feature-set",
            "name 'numpy' is taken: numpy has a package numpy, which this one would hide",
        ),
        ("json", "feature-set", "Python itself has a module json"),
        ("class", "observer", "class is a keyword of Python"),
        ("hybrid", "controller", "name 'hybrid' is taken by graspsense/hybrid: choose another"),
    ],
)
def test_what_it_refuses(name, role, says, tmp_path):
    with pytest.raises(ConfigError, match=re.compile(says, re.DOTALL)):
        make(name, role, tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_nothing_is_written_over(tmp_path):
    make("lab-thing", "observer", tmp_path / "lab-thing")

    with pytest.raises(ConfigError, match="is there already: give another name, or --folder"):
        make("lab-thing", "observer", tmp_path / "lab-thing")


def test_a_new_gripper_grasps_with_the_default_pipeline_at_once(tmp_path, monkeypatch):
    make("lab-hand", "sensor-backend", tmp_path / "lab-hand")
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
        with pytest.raises(
            WiringError, match="commands effort, which gripper lab-hand/lab-hand does not take"
        ):
            load_pipeline(
                options=["gripper.type=lab-hand", "classifier.type=none", "controller.sends=effort"],
                plugins=plugins,
            )
