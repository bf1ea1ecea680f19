"""docs/simulator.md names what there is: settings, objects, terms and keys of a scene; its examples run."""

import re
from pathlib import Path

import attrs
import pytest
from cases import every_case

from graspsense.plugin_api import create
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.scene.library import catalogue, shipped_scenes
from graspsense_sim_gripper.scene.spec import ObjectSpec, parse_scene
from graspsense_sim_gripper.scene.terms.registry import TERMS

PAGE = (Path(__file__).parents[3] / "docs" / "simulator.md").read_text(encoding="utf-8")


def section(title):
    return PAGE.partition(f"\n## {title}\n")[2].partition("\n## ")[0]


def rows(title):
    """The cells of each row of the section's tables, but for headers."""
    lines = [line for line in section(title).splitlines() if line.startswith("| `")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]


def shown(value):
    if value is None:
        return "not set"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def test_the_table_of_settings_has_the_defaults_of_its_keys():
    defaults = {field.name: shown(field.default) for field in attrs.fields(SimConfig)}
    table = {key.strip("`"): default for key, _, default, _ in rows("Settings")}
    assert len(table) > 10
    assert table == {key: defaults[key] for key in table}


# What is not written in the tables of a scene: `spreads` stands in the table of a term.
KEYS = {field.name for field in attrs.fields(ObjectSpec)} - {
    "name",
    "reasons",
    "fitted_to",
    "file",
    "spreads",
}
KINDS = {name.partition(":")[0] for name in catalogue()} | {"none"}


@every_case(("title", "expected"), [("Objects", KINDS), ("A scene of your own", KEYS), ("Terms", {*TERMS})])
def test_the_table_has_every_name(title, expected):
    assert {name for row in rows(title) for name in re.findall(r"`(\w+)`", row[0])} == expected


def test_every_shipped_scene_is_named():
    assert all(f"`{name}`" in section("Objects") for name in shipped_scenes())


def test_the_table_of_the_report_has_every_key():
    gripper = create("sensor-backend", "sim", explain=True)
    gripper.open(0)
    gripper.read(0.1)
    report = gripper.report()
    nested = {f"selection.{key}" for key in report["selection"]}
    named = {row[0].strip("`") for row in rows("What is reported")}
    assert {name for name in named if "." not in name} == set(report)
    assert {name for name in named if "." in name} <= nested


def example(title, language="python"):
    (text,) = re.findall(rf"```{language}\n(.*?)```", section(title), re.DOTALL)
    return text


def test_the_example_of_a_term_runs():
    names = {}
    exec(compile(example("A term of your own"), "simulator.md", "exec"), names)
    (term,) = names["graspsense_sim_terms"]()
    force, _ = term.law(names["Gel"](1000.0, 0.01), term.at_rest, 0.0, 0.005, 1e-3, 5.0)
    assert force == pytest.approx(10.0)


@pytest.mark.slow
def test_the_example_of_many_grasps_runs():
    names = {}
    few = example("Many grasps").replace("* 500", "* 1").replace("range(1000)", "range(2)")
    exec(compile(few, "simulator.md", "exec"), names)
    assert [grasp.outcome.words for grasp in names["done"]] == ["steady", "steady"]


def test_the_example_of_a_scene_is_one():
    assert parse_scene(example("A scene of your own", "toml"), "my_bottle", "my_bottle.toml").held
