"""How settings are declared: meaning, unit, allowed and plausible range in one place, and what is done with them."""

import math
import tomllib
from typing import Literal

import pytest
from attrs import frozen
from cases import every_case
from commands import graspsense

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
    with pytest.raises((ValueError, TypeError), match=next(iter(value))):
        Squeeze(**value)


def test_every_value_within_what_is_declared_is_accepted():
    Squeeze(speed_m_s=10.0, times=9, limit_n=None, stiffness_n_m=math.inf, loop="closed")


@every_case(
    ("declaration", "says"),
    [
        ({"default": 1.0}, "meaning"),
        ({"default": 1.0, "meaning": " "}, "needs a meaning"),
        ({"default": -1.0, "above": 0.0, "meaning": "m"}, "default -1.0 is not allowed: a value is above 0"),
        ({"default": 7, "maximum": 5, "meaning": "m"}, "the default 7 is not allowed: a value is at most 5"),
        ({"default": 1.0, "meaning": "M.", "minimum": 0.0, "above": 0.0}, "one lower"),
        ({"default": 1.0, "meaning": "M.", "factory": float}, "one default"),
        ({"default": 1.0, "meaning": "M.", "plausible": (2.0, 1.0)}, "is empty"),
        ({"default": 1.0, "meaning": "M.", "plausible": (2.0, 3.0)}, "not in the plausible range"),
    ],
)
def test_a_declaration_that_is_wrong_is_refused_when_the_class_is_made(declaration, says):
    with pytest.raises(TypeError, match=says):
        setting(**declaration)


def all_keys(keys, above=""):
    for key, declaration in keys.items():
        yield above + key, declaration
        yield from all_keys(declaration.get("keys", {}), f"{above}{key}.")


@every_case("table", ["run", *(component.qualified for component in installed().components())])
def test_every_shipped_setting_declares_its_meaning_and_the_unit_of_its_name(table):
    known = {component.qualified: component for component in installed().components()}
    keys = keys_of(RunConfig if table == "run" else known[table].config_class())
    for key, declaration in all_keys(keys):
        assert declaration["meaning"].endswith((".", ")")), key
        of_name = unit_of_name(key)
        if of_name:
            assert declaration["unit"] == of_name, key


def test_an_implausible_value_is_refused_with_its_place_and_what_is_plausible(tmp_path):
    file = tmp_path / "lab.toml"
    file.write_text('extends = "default"\n[controller]\nclosing_speed_m_s = 10\n')

    with pytest.raises(ImplausibleSettings) as refused:
        resolve(str(file))

    assert str(refused.value) == (
        f"{file}:3: controller.closing_speed_m_s: 10 m/s is not plausible: the plausible range is 0.0001 to 0.2 m/s"
    )
    assert "force=True" in refused.value.__notes__[0]
    assert resolve(str(file), force=True).values["controller"]["closing_speed_m_s"] == 10.0
    with pytest.raises(ImplausibleSettings):
        load_pipeline(file)
    assert load_pipeline(file, force=True).settings.controller.config.closing_speed_m_s == 10.0


def test_settings_that_were_accepted_once_are_read_back():
    forced = resolve(options=["controller.closing_speed_m_s=10"], force=True)

    assert settings_from(forced.values, "a trial").values == forced.values


def test_an_implausible_value_is_told_once_with_the_other_errors_also_in_a_table_of_a_setting():
    with pytest.raises(ImplausibleSettings, match="1000 s is not plausible"):
        resolve(options=["gripper.type=pr2", *EMULATED, "gripper.faults.delay_s=1000"])
    with pytest.raises(ConfigError) as refused:
        resolve(options=["gripper.step_s=1", "controller.ramp_s=-1"])
    assert "1 s is not plausible" in str(refused.value)
    assert "'ramp_s' must be >= 0.0" in str(refused.value)
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
    ],
)
def test_every_command_with_settings_refuses_an_implausible_one_and_names_force(
    tmp_path, monkeypatch, command
):
    monkeypatch.chdir(tmp_path)
    code, _, err = graspsense(*command, "-o", "gripper.step_s=1e-12")

    assert code == 2
    assert "1e-12 s is not plausible: the plausible range is 1e-05 to 0.01 s" in err
    assert "add --force" in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_force_accepts_it():
    option = ("-o", "controller.closing_speed_m_s=0.5", "-o", "classifier.type=none")

    assert graspsense("config", "validate", *option, "--force")[0] == 0
    assert graspsense("run", *option, "--force", "--json")[0] == 0


def test_import_gives_no_advice_that_it_does_not_follow(tmp_path):
    code, _, err = graspsense(
        *("import", "a.csv", "--save", str(tmp_path / "t"), "-o", "features.contact_force_n=500")
    )

    assert code == 2
    assert "500 N is not plausible" in err
    assert "--force" not in err


def test_a_sweep_over_implausible_values_is_refused(tmp_path):
    text = 'title = "fast"\nsweep = { "controller.closing_speed_m_s" = [0.01, 10.0] }\n'
    (tmp_path / "fast.toml").write_text(text)

    with pytest.raises(ConfigError, match="10 m/s is not plausible"):
        read_experiment(str(tmp_path / "fast.toml"))
    assert len(read_experiment(str(tmp_path / "fast.toml"), force=True).cases) == 2


def test_config_show_tells_meaning_unit_range_default_and_origin_of_each_key(tmp_path):
    file = tmp_path / "lab.toml"
    file.write_text('extends = "default"\n[controller]\nprobing_force_n = 15\n')

    settings = resolve(str(file), options=["controller.ramp_s=0.1"])
    text = to_toml(settings, origins=True)

    lines = text.splitlines()
    index = next(k for k, line in enumerate(lines) if line.startswith("probing_force_n = 15.0"))
    assert lines[index].endswith(f"# {file}:3")
    assert (
        lines[index - 2]
        == "# The effort of the squeeze; with loop = closed, the force on each pad. [N; above 0; plausible 0.1"
    )
    assert lines[index - 1] == "#   to 200 N; default 20.0]"
    assert any(line.startswith("ramp_s = 0.1") and line.endswith("# -o") for line in lines)
    assert any(line.startswith("hold_s = 0.25") and line.endswith("# default") for line in lines)
    assert tomllib.loads(text) == tomllib.loads(to_toml(settings))


def test_config_show_describes_the_keys_of_a_table():
    code, out, _ = graspsense("config", "show", "--gripper", "pr2", "-o", EMULATED[0])

    assert code == 0
    assert "# drop: Probability that a report is lost. [0 to 1; default 0.0]\n" in out
    assert tomllib.loads(out)["gripper"]["faults"]["drop"] == 0.0


def test_the_contact_threshold_stands_once():
    """Features use that of the controller, unless they are given another one."""
    setting = resolve(options=["controller.contact_force_n=1.25"])
    assert setting.values["features"]["contact_force_n"] == 1.25
    assert setting.origins["features.contact_force_n"] == "controller.contact_force_n"
    assert tick_params(INFO, setting.controller.create(), setting.run).guard.contact_force_n == 1.25
    other = resolve(options=["controller.contact_force_n=1.25", "features.contact_force_n=0.5"])
    assert other.values["features"]["contact_force_n"] == 0.5
    assert resolve().origins["features.contact_force_n"] == "default"


def test_a_recorded_threshold_follows_an_option_too():
    recorded = without_followers(resolve(options=["controller.contact_force_n=1.25"]).values)
    assert "contact_force_n" not in recorded["features"]
    again = resolve(
        experiment=Layer(label="a recording", values=recorded),
        options=["controller.contact_force_n=0.25"],
        force=True,
    )
    assert again.values["features"]["contact_force_n"] == 0.25
