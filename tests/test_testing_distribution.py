"""The kit's checks of a whole distribution: each catches one that is broken in just that way."""

from __future__ import annotations

import json

import pytest

from graspsense.core.plugins import HEAVY
from graspsense.testing import CHECKS
from graspsense.testing.checks import outcome_of
from graspsense.testing.subject import package_of

HEAD = """
    from graspsense.plugin_api import Feature, FeatureSetEntry, PipelineEntry, hookimpl
    GRASPSENSE_API = (1, 0)
"""

SOUND = (
    HEAD
    + """
    @hookimpl
    def graspsense_feature_sets():
        peak = Feature("peak", "N", "largest force")
        yield FeatureSetEntry("summit", "parts:Peak", "parts:PeakConfig", "peak", (), (peak,))

    @hookimpl
    def graspsense_run_finished(run, trial):
        run.labels.get("object")

    @hookimpl
    def graspsense_probe_devices(timeout_s):
        return []

    @hookimpl
    def graspsense_pipelines():
        yield PipelineEntry("lab", "lab_pipes:lab.toml", "a recording")

    @hookimpl(optionalhook=True)
    def graspsense_sim_terms():
        import lab_term
        return [lab_term.TERM]
"""
)

TERM = """
    from types import SimpleNamespace
    from typing import NamedTuple

    class Params(NamedTuple):
        k_n_m: float

    class State(NamedTuple):
        worst_m: float

    def law(params, state, d0, d1, h, v1):
        return {force}, {after}

    class Form(NamedTuple):
        spring_n_m: float = 0.0
        damper_n_s_m: float = 0.0
        rates: tuple = ()
        by_compression: tuple = ()
        by_speed: tuple = ()
        force: tuple = ()
        curve: object = None

    def linear(params):
        return {form}

    TERM = SimpleNamespace(name="gel", params=Params, law=law, at_rest=State(0.0), linear=linear)
"""
FORCE, AFTER = "params.k_n_m * d1", "State(max(d1, state.worst_m))"


PIPELINE = """
    [gripper]
    type = "replay"
    recording = "csv:somewhere.csv"
    [controller]
    type = "hybrid"
    [features]
    type = "{features}"
    [classifier]
    type = "none"
"""


def check(site, name, plugin=SOUND, force=FORCE, after=AFTER, features="chitta", form="Form(params.k_n_m)"):
    site.install("lab-thing", plugin)
    (site.folder / "lab_pipes").mkdir()
    (site.folder / "lab_pipes" / "__init__.py").touch()
    (site.folder / "lab_pipes" / "lab.toml").write_text(PIPELINE.format(features=features))
    site.modules.append("lab_pipes")
    site.write(lab_term=TERM.format(force=force, after=after, form=form))
    package = package_of("lab-thing", site.discover())
    (one,) = [one for one in CHECKS["distribution"] if one.id == name]
    return outcome_of(one, package, {})


@pytest.mark.parametrize("name", [one.id for one in CHECKS["distribution"]])
def test_a_sound_distribution_passes(site, name):
    result = check(site, name)

    assert (result.state, result.text) == ("passed", "")


MUTANTS = {
    "plugins-load": (HEAD + "    import no_such_driver", "is broken: ModuleNotFoundError: No module named"),
    "plugin-modules-are-light": (
        HEAD + "    import numpy",
        "listing it imports numpy: in the module of the entry point import",
    ),
    "everything-declared-is-there": (
        SOUND.replace("parts:Peak", "lab_nowhere:Peak"),
        "No module named 'lab_nowhere'",
    ),
    "names-are-free": (
        SOUND.replace('"summit"', '"chitta"'),
        "the name 'chitta' is taken by graspsense/chitta: choose another name in the entry",
    ),
    "observers-disturb-nobody": (
        SOUND.replace('run.labels.get("object")', 'run.labels["object"] = "mine"'),
        "an observer changed what it was shown: work on a copy",
    ),
    "probe-keeps-its-time": (
        SOUND.replace("return []", "raise PermissionError('no bus')"),
        "graspsense_probe_devices raised PermissionError: no bus: return what was found",
    ),
}


@pytest.mark.parametrize("name", MUTANTS)
def test_a_check_catches_its_mutant(site, name):
    plugin, says = MUTANTS[name]

    result = check(site, name, plugin)

    assert result.state == "failed"
    assert says in result.text


def test_a_pipeline_that_does_not_resolve_is_caught(site):
    result = check(site, "pipelines-fit-together", features="chita")

    assert result.state == "failed"
    assert "no feature set named 'chita'" in result.text


@pytest.mark.parametrize(
    ("force", "after", "says"),
    [
        ("0", AFTER, "gives the force 0 (int)"),
        ("1.0 / (d1 - 0.001)", AFTER, "raised ZeroDivisionError"),
        ("float('inf')", AFTER, "a finite float"),
        ("__import__('time').perf_counter()", AFTER, "it may know its arguments only"),
        (FORCE, "State(1)", "its numbers of the same types"),
    ],
)
def test_a_term_that_is_no_law_is_caught(site, force, after, says):
    result = check(site, "simulator-terms-are-laws", force=force, after=after)

    assert result.state == "failed"
    assert says in result.text


ARM = {
    "force": "(q := (state.worst_m * (1.0 - 10.0 * h) + params.k_n_m * (d1 - d0)) / (1.0 + 10.0 * h))",
    "after": "State(q)",
}
"""An arm that relaxes in 50 ms, by trapezoids."""


@pytest.mark.parametrize(
    ("law", "form", "says"),
    [
        ({}, "None", ""),
        ({}, "Form(2.0 * params.k_n_m)", "the linear form of term 'gel' gives"),
        ({}, "Form(0.0, 1.0, ((1.0, 0.0), (0.0, 1.0)))", "has 2 states and its law 1"),
        ({}, "Form(curve=lambda d: params.k_n_m * d)", ""),
        ({}, "Form(params.k_n_m, curve=lambda d: d * d)", "the linear form of term 'gel' gives"),
        (ARM, "Form(0.0, 0.0, ((-20.0,),), (0.0,), (params.k_n_m,), (1.0,))", ""),
        (
            ARM,
            "Form(0.0, 0.0, ((-400.0,),), (0.0,), (params.k_n_m,), (1.0,))",
            "return None where it is not linear",
        ),
    ],
)
def test_a_linear_form_that_is_not_the_law_is_caught(site, law, form, says):
    result = check(site, "simulator-terms-are-laws", form=form, **law)

    assert result.state == ("failed" if says else "passed"), result.text
    assert says in result.text


def test_an_observer_that_raises_or_returns_is_caught(site):
    raising = SOUND.replace('run.labels.get("object")', "run.nothing")
    assert "catch what may go wrong" in check(site, "observers-disturb-nobody", raising).text


def test_an_observer_that_returns_something_is_caught(site):
    returning = SOUND.replace('run.labels.get("object")', "return 1")
    assert "an observer returns nothing" in check(site, "observers-disturb-nobody", returning).text


def test_every_check_of_a_distribution_has_a_mutant():
    others = {"simulator-terms-are-laws", "wheel-is-complete", "pipelines-fit-together"}
    assert {one.id for one in CHECKS["distribution"]} == set(MUTANTS) | others
    assert "numpy" in HEAVY


@pytest.mark.slow
@pytest.mark.parametrize(
    ("packed", "says"),
    [
        ('packages = ["lab_thing"]', ""),
        (
            'packages = ["lab_thing"]\nexclude = ["*.toml"]',
            "has no file lab_thing/lab.toml: it is in the folder",
        ),
        (
            'packages = ["lab_thing"]\nexclude = ["features.py"]',
            "has no module lab_thing.features: it is in the",
        ),
        (
            'packages = ["lab_thing"]\nexclude = ["table.csv"]',
            "lacks lab_thing/table.csv: it is in the folder",
        ),
    ],
)
def test_what_is_missing_from_the_wheel_is_named(site, tmp_path, packed, says):
    folder = tmp_path / "project"
    (folder / "lab_thing").mkdir(parents=True)
    (folder / "pyproject.toml").write_text(
        '[build-system]\nrequires = ["hatchling"]\nbuild-backend = "hatchling.build"\n'
        '[project]\nname = "lab-thing"\nversion = "0.2"\n[tool.hatch.build.targets.wheel]\n' + packed
    )
    plugin = """
from graspsense.plugin_api import Feature, FeatureSetEntry, PipelineEntry, hookimpl
GRASPSENSE_API = (1, 0)
@hookimpl
def graspsense_feature_sets():
    peak = Feature("peak", "N", "largest force")
    yield FeatureSetEntry(
        "summit", "lab_thing.features:Peak", "lab_thing.features:PeakConfig", "peak", (), (peak,)
    )
@hookimpl
def graspsense_pipelines():
    yield PipelineEntry("lab", "lab_thing:lab.toml", "ours")
"""
    contents = {"__init__.py": "", "plugin.py": plugin, "features.py": "", "lab.toml": "", "table.csv": "1"}
    for name, text in contents.items():
        (folder / "lab_thing" / name).write_text(text)
    site.patch.syspath_prepend(folder)
    site.modules.extend(["lab_thing", "lab_thing.plugin", "lab_thing.features"])
    site.metadata("lab-thing", "0.2", "[graspsense.plugins]\nlab = lab_thing.plugin\n")
    (site.folder / "lab_thing-0.2.dist-info" / "direct_url.json").write_text(
        json.dumps({"url": folder.as_uri(), "dir_info": {"editable": True}})
    )
    (one,) = [one for one in CHECKS["distribution"] if one.id == "wheel-is-complete"]

    result = outcome_of(one, package_of("lab-thing", site.discover()), {})

    assert result.state == ("failed" if says else "passed")
    assert says in result.text
