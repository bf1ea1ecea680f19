"""How settings are declared: meaning, unit, allowed and plausible range in one place, and what is done with them."""

import math
import re
import tomllib
from typing import Literal

import pytest
from attrs import frozen
from cases import every_case
from commands import graspsense, printed

from graspsense import load_pipeline
from graspsense.core.components.registry import installed
from graspsense.core.components.run_config import RunConfig
from graspsense.core.components.setting import unit_of_name
from graspsense.core.components.strict import keys_of
from graspsense.core.grasp.runner import tick_params
from graspsense.core.settings.layers import Layer
from graspsense.core.settings.resolved import resolve, settings_from, without_followers
from graspsense.core.settings.selected import ImplausibleSettings
from graspsense.core.settings.settings_file import to_toml
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.signals import EFFORT, Command
from graspsense.experiments.experiment_file import read_experiment
from graspsense.plugin_api import setting

INFO = DeviceInfo(
    name="bench",
    clock="device",
    rate_hz=1000.0,
    effort_limit_n=50.0,
    speed_limit_m_s=0.1,
    opening=None,
    relaxed=Command(EFFORT, 0.0, math.inf, math.inf),
)
EMULATED = ["gripper.transport=emulated", "classifier.type=none"]


@frozen(kw_only=True)
class Squeeze:
    speed_m_s: float = setting(default=0.01, unit="m/s", above=0.0, plausible=(1e-4, 0.2), meaning="Speed.")
    times: int = setting(default=3, minimum=1, maximum=9, meaning="How often.")
    limit_n: float | None = setting(default=None, unit="N", minimum=0.0, meaning="Limit.")
    stiffness_n_m: float = setting(default=1e4, unit="N/m", maximum=math.inf, meaning="Stiffness.")
    loop: Literal["open", "closed"] = setting(default="open", meaning="Loop.")
    most_s: float = setting(default=math.inf, meaning="Longest wait.")


@every_case(
    "value",
    [
        {"speed_m_s": 0.0},
        {"speed_m_s": math.inf},
        {"speed_m_s": math.nan},
        {"times": 0},
        {"times": 10},
        {"times": 2.5},
        {"limit_n": -1.0},
        {"stiffness_n_m": -math.inf},
        {"most_s": math.nan},
        {"loop": "ajar"},
    ],
)
def test_a_value_outside_of_what_is_declared_is_refused(value):
    Squeeze(speed_m_s=10.0, times=9, limit_n=None, stiffness_n_m=math.inf, loop="closed")
    with pytest.raises((ValueError, TypeError), match=next(iter(value))):
        Squeeze(**value)


@every_case(
    ("declaration", "says"),
    [
        ({"default": 1.0}, "meaning"),
        ({"default": 1.0, "meaning": " "}, "needs a meaning"),
        ({"default": -1.0, "above": 0.0, "meaning": "m"}, "default -1.0.*above 0"),
        ({"default": 7, "maximum": 5, "meaning": "m"}, "the default 7.*most 5"),
        ({"default": 1.0, "meaning": "M.", "minimum": 0.0, "above": 0.0}, "one lower"),
        ({"default": 1.0, "meaning": "M.", "factory": float}, "one default"),
        ({"default": 1.0, "meaning": "M.", "plausible": (2.0, 1.0)}, "is empty"),
        ({"default": 1.0, "meaning": "M.", "plausible": (2.0, 3.0)}, "plausible range"),
    ],
)
def test_a_declaration_that_is_wrong_is_refused_when_the_class_is_made(declaration, says):
    with pytest.raises(TypeError, match=says):
        setting(**declaration)


def all_keys(keys):
    for key, declaration in keys.items():
        yield key, declaration
        yield from all_keys(declaration.get("keys", {}))


@every_case("part", [None, *installed().components()])
def test_every_shipped_setting_declares_its_meaning_and_the_unit_of_its_name(part):
    for key, declaration in all_keys(keys_of(RunConfig if part is None else part.config_class())):
        assert declaration["meaning"].endswith((".", ")")), key
        assert unit_of_name(key) in ("", None, declaration["unit"]), key


@pytest.fixture
def lab(tmp_path):
    """Return a function that writes these settings of the controller into a file."""

    def lab(setting):
        file = tmp_path / "lab.toml"
        file.write_text(f'extends = "default"\n[controller]\n{setting}\n')
        return str(file)

    return lab


def test_an_implausible_value_is_refused_with_its_place_and_accepted_with_force(lab):
    file = lab("closing_speed_m_s = 10")
    for read in (resolve, load_pipeline):
        with pytest.raises(ImplausibleSettings) as refused:
            read(file)
        assert f"{file}:3: controller.closing_speed_m_s: 10 m/s " in str(refused.value)
        assert "0.0001 to 0.2 m/s" in str(refused.value)
        assert "force=True" in refused.value.__notes__[0]
    forced = load_pipeline(file, force=True).settings
    assert forced.controller.config.closing_speed_m_s == 10.0
    # Settings that were accepted once are read back.
    assert settings_from(forced.values, "a trial").values == forced.values


def test_an_implausible_value_is_told_once_with_the_other_errors_also_in_a_table_of_a_setting():
    with pytest.raises(ImplausibleSettings, match="1000 s"):
        resolve(options=["gripper.type=pr2", *EMULATED, "gripper.faults.delay_s=1000"])
    with pytest.raises(ConfigError, match=r"at least 0, found(.|\n)*1 s"):
        resolve(options=["gripper.step_s=1", "controller.ramp_s=-1"])
    # The features have the threshold of the controller.
    with pytest.raises(ImplausibleSettings) as told:
        resolve(options=["controller.contact_force_n=500"])
    assert str(told.value).count("500 N is not plausible") == 1


@every_case(
    "command",
    [
        ("run",),
        ("collect", "--labels", "block"),
        ("config", "validate"),
        ("train", "simulated", "--out", "m.json"),
        ("evaluate", "simulated"),
        ("experiment", "probing_force", "--dry-run"),
        ("import", "a.csv", "--save", "t"),
    ],
)
def test_every_command_refuses_an_implausible_setting_and_names_force(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    code, _, err = graspsense(*command, "-o", "features.contact_force_n=500")
    assert (code, list(tmp_path.iterdir())) == (2, [])
    assert "500 N" in err
    # An import has no such option, and gives no advice that it does not follow.
    assert ("add --force" in err, "--force" in err) == (command[0] != "import",) * 2


def test_a_sweep_over_implausible_values_is_refused(tmp_path):
    text = 'title = "fast"\nsweep = { "controller.closing_speed_m_s" = [0.01, 10.0] }\n'
    (tmp_path / "fast.toml").write_text(text)

    with pytest.raises(ConfigError, match="10 m/s"):
        read_experiment(str(tmp_path / "fast.toml"))
    assert len(read_experiment(str(tmp_path / "fast.toml"), force=True).cases) == 2


def test_config_show_tells_meaning_unit_range_default_and_origin_of_each_key(lab):
    file = lab("probing_force_n = 15")
    settings = resolve(file, options=["controller.ramp_s=0.1"])
    text = to_toml(settings, origins=True)
    lines = text.splitlines()
    index = next(k for k, line in enumerate(lines) if line.startswith("probing_force_n = 15.0"))
    assert lines[index].endswith(f"# {file}:3")
    meaning = "".join(line.removeprefix("#").lstrip(" ") + " " for line in lines[index - 2 : index])
    expected = (
        "The effort of the squeeze; with loop = closed, the force on each pad. [N; above 0; plausible 0.1 "
    )
    assert meaning == expected + "to 200 N; default 20.0] "
    assert any(line.startswith("ramp_s = 0.1") and line.endswith("# -o") for line in lines)
    assert any(line.startswith("hold_s = 0.25") and line.endswith("# default") for line in lines)
    assert tomllib.loads(text) == tomllib.loads(to_toml(settings))


def test_config_show_describes_the_keys_of_a_table():
    out = printed("config", "show", "--gripper", "pr2", "-o", EMULATED[0])
    assert re.search(r"# drop: .* \[0 to 1; default 0\.0\]\n", out)
    assert tomllib.loads(out)["gripper"]["faults"]["drop"] == 0.0


def test_the_contact_threshold_stands_once():
    """Features use that of the controller, unless they are given another one, also one that was recorded."""
    setting = resolve(options=["controller.contact_force_n=1.25"])
    assert setting.values["features"]["contact_force_n"] == 1.25
    assert setting.origins["features.contact_force_n"] == "controller.contact_force_n"
    assert tick_params(INFO, setting.controller.create(), setting.run).guard.contact_force_n == 1.25
    other = resolve(options=["controller.contact_force_n=1.25", "features.contact_force_n=0.5"])
    assert other.values["features"]["contact_force_n"] == 0.5
    assert resolve().origins["features.contact_force_n"] == "default"

    recorded = without_followers(setting.values)
    assert "contact_force_n" not in recorded["features"]
    layer, option = Layer(label="a recording", values=recorded), "controller.contact_force_n=0.25"
    again = resolve(experiment=layer, options=[option], force=True)
    assert again.values["features"]["contact_force_n"] == 0.25
