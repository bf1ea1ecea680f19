"""Infinity and NaN have one representation in JSON, and settings with them survive every file."""

from __future__ import annotations

import json
import tomllib
from math import inf, nan

import pytest
from attrs import asdict, evolve, field, frozen
from kept import BENCH, keep

from graspsense.core.components.registry import installed
from graspsense.core.learn.model_file import load_model, write_model
from graspsense.core.learn.training import train
from graspsense.core.settings.layers import Flag
from graspsense.core.settings.resolved import resolve
from graspsense.core.settings.settings_file import to_toml
from graspsense.core.values.json_values import json_ready, json_text, settings_from_json
from graspsense.store.dataset import labelled_store
from graspsense.store.store import Store


def test_json_has_no_infinity_and_no_nan():
    value = {"a": [inf, -inf, nan, 1.5], "b": {"c": inf}, 3: (True, None)}

    assert json_ready(value) == {"a": ["inf", "-inf", None, 1.5], "b": {"c": "inf"}, "3": [True, None]}
    assert json_text(value) == '{"3":[true,null],"a":["inf","-inf",null,1.5],"b":{"c":"inf"}}'


REAL = evolve(BENCH, simulated=False)


@frozen(kw_only=True)
class Cable:
    vanishes_s: float = inf


@frozen(kw_only=True)
class Hand:
    name: str = "inf"
    limit_n: float = inf
    floor_n: float | None = -inf
    levels: list[float] = field(factory=lambda: [1.0, inf])
    cable: Cable = field(factory=Cable)


def test_settings_are_read_back_as_they_were():
    values = asdict(Hand())
    assert settings_from_json(json.loads(json_text(values)), Hand) == values


def test_a_model_is_trained_on_a_store_that_was_collected_with_infinite_settings(tmp_path):
    """Settings of a gripper whose config has infinite defaults."""
    flags, options = (
        [Flag("--gripper", "gripper.type", "pr2")],
        ["gripper.transport=emulated", "classifier.type=none"],
    )
    emulated = resolve(flags=flags, options=options)
    settings = to_toml(emulated)
    assert tomllib.loads(settings)["gripper"]["faults"]["stall_at_s"] == inf
    with Store.open(tmp_path / "trials") as store:
        for k in range(6):
            label, values = ("can:full_open", "can:empty_open")[k % 2], (0.06 + 0.002 * (k % 2), 5.0 + k)
            keep(store, label, values=values, ticks=2, settings=settings, device=REAL)
    trials, component = labelled_store(str(tmp_path / "trials")), installed().find("classifier", "tree")

    model = train(component, component.config_class()(), trials, name="m")
    write_model(tmp_path / "m.json", model)
    again = load_model(str(tmp_path / "m.json"), installed())

    content = json.loads((tmp_path / "m.json").read_text(), parse_constant=pytest.fail)
    assert content["provenance"]["settings"]["gripper"]["faults"]["stall_at_s"] == "inf"
    for known in (model, again):
        assert known.predict(trials.table.row(0), emulated).warnings == ()
