"""What the class of a component declares, and what its entry need not repeat."""

from __future__ import annotations

from math import inf, nan
from textwrap import dedent
from typing import Literal

import parts
import pytest
from attrs import field, frozen
from cases import every_case
from commands import python
from parts import GentleState, Hand, HandConfig, Peak, PeakConfig

from graspsense.core.components.registry import Component, IsolatedPlugins
from graspsense.core.components.step_params import params_of
from graspsense.core.pipeline.wiring import check
from graspsense.core.settings.resolved import settings_from
from graspsense.core.values.errors import PluginUnavailable, WiringError
from graspsense.plugin_api import (
    EFFORT,
    VELOCITY,
    Channel,
    ClassifierEntry,
    Controller,
    ControllerEntry,
    Feature,
    FeatureSet,
    FeatureSetEntry,
    SensorBackendEntry,
)


class Summit(Peak):
    requires = (Channel("force_left", "N"),)
    features = (
        Feature("summit", "N", "largest force of the left pad"),
        Feature("width", "m", "gap", width=True),
    )

    def extract(self, trace):
        return self.result({"summit": 3}, {"width": "no gap"})


@frozen(kw_only=True)
class FingersConfig(HandConfig):
    fingers: Literal["plain", "force"] = "plain"


class Fingers(Hand, parts.SensorBackend[FingersConfig]):
    accepts = ("effort",)

    @property
    def channels(self):
        forces = (Channel("force_left", "N", 100.0), Channel("force_right", "N", 100.0))
        motion = (Channel("gap", "m", 100.0), Channel("velocity", "m/s", 100.0))
        return motion + (forces if self.config.fingers == "force" else ())


@frozen(kw_only=True)
class LawConfig:
    speed_m_s: float = 0.02
    label: str = "slow"
    ticks: int = 3
    careful: bool = True
    sends: Literal["effort", "velocity"] = "effort"
    limits: dict[str, float] = field(factory=dict)


class Law(Controller[LawConfig]):
    requires = (Channel("gap", "m", 50.0), Channel("force_left", "N"))
    commands = ("effort",)
    step = staticmethod(parts.step)

    def init(self):
        return GentleState(2, 0, 0.0, 0)


def part(cls, entry=FeatureSetEntry, **given):
    return Component(entry("a", f"{cls.__module__}:{cls.__name__}", "a thing", **given), "lab", "0.1")


def test_an_entry_is_completed_by_the_class():
    peak = part(Summit)

    assert peak.declared().requires == (Channel("force_left", "N"),)
    assert (peak.declared().width, peak.entry.features) == ("width", None)


@every_case(
    ("name", "unit", "width", "says"),
    [
        ("peak, left", "N", False, "'name' of a feature"),
        ("peak [N]", "N", False, "'name' of a feature"),
        ("peak\n", "N", False, "'name' of a feature"),
        ("", "N", False, "'name' of a feature"),
        ("opening", "rad", True, "'opening' in rad"),
    ],
)
def test_a_feature_that_fits_no_table_or_is_no_width_is_refused(name, unit, width, says):
    with pytest.raises(ValueError, match=says):
        Feature(name, unit, "how far", width=width)
    assert Feature("Öffnung 1", "m", "how far", width=True).width


def test_the_config_class_is_that_of_the_nearest_base():
    assert part(Summit).config_class() is PeakConfig
    assert part(Fingers, SensorBackendEntry).config_class() is FingersConfig
    assert part(parts.Nearest, ClassifierEntry).config_class() is parts.ClassifierConfig


class Bare(FeatureSet):
    def extract(self, trace):
        raise NotImplementedError


class Mute(Peak):
    requires = ()


class Wrong(Summit):
    requires = (Channel("force_left", "N"), "gap")


@every_case(
    ("ask", "says"),
    [
        (part(Bare).config_class, r"Bare\(FeatureSet\[Config\]\), where Config"),
        (part(Mute).declared, r"declare `features`: write features = \(Feature"),
        (part(Wrong).declared, r"Wrong: 'requires' must be <class '.*Channel'>"),
    ],
)
def test_a_class_that_does_not_declare_what_is_needed(ask, says):
    with pytest.raises(PluginUnavailable, match=says):
        ask()


class Sided(Peak, FeatureSet[PeakConfig]):
    """Needs the pad that its settings name."""

    @property
    def requires(self):
        return (Channel(f"force_{self.config.side}", "N"),)

    features = Summit.features


def test_what_features_and_laws_require_may_depend_on_their_settings():
    sided = part(Sided)

    assert sided.declared().requires == (Channel("force_left", "N"),)
    assert sided.declared(PeakConfig(side="right")).requires == (Channel("force_right", "N"),)


def test_the_result_has_the_declared_names_and_units():
    summit = Summit(PeakConfig())
    features = summit.extract(None)

    assert (features.as_dict(), features.units) == ({"summit": 3.0, "width": None}, ("N", "m"))
    assert type(features.values[0]) is float
    for values, says in (
        ({"summits": 1.0}, "Summit declares no feature 'summits'; it has summit, width"),
        ({"summit": 1.0, "width": nan}, "feature 'width' is NaN without a reason"),
        ({"summit": inf, "width": -inf}, "feature 'summit' is inf: give NaN with a reason"),
        ({"summit": -inf, "width": inf}, "feature 'summit' is -inf: give NaN with a reason"),
    ):
        with pytest.raises(ValueError, match=says):
            summit.result(values)
    assert summit.result({"summit": 1.7e308, "width": 1.7e308}).values == (1.7e308, 1.7e308)
    assert dict(summit.undefined("empty").reasons) == {"summit": "empty", "width": "empty"}


def test_the_parameters_of_a_law_are_the_numbers_of_its_config_and_the_kind_that_it_sends():
    params = Law(LawConfig(speed_m_s=0.03, careful=False)).params()

    assert params._asdict() == {"speed_m_s": 0.03, "ticks": 3, "careful": 0, "sends": EFFORT}
    assert [type(param) for param in params] == [float, int, int, int]
    assert type(params_of(LawConfig())) is type(params)
    assert params_of(LawConfig(sends="velocity")).sends == VELOCITY
    assert params_of(parts.LawConfig())._asdict() == {"speed_m_s": 0.01}


def test_the_wiring_knows_the_channels_of_the_fitted_fingers():
    lab = parts.offering(
        SensorBackendEntry("fingers", f"{__name__}:Fingers", "a hand"),
        ControllerEntry("law", f"{__name__}:Law", "a law"),
        FeatureSetEntry("summit", f"{__name__}:Summit", "a peak"),
    )
    plugins = IsolatedPlugins(lab, builtins=False)

    def wired(fingers):
        gripper = {"type": "fingers", "fingers": fingers}
        tables = {"gripper": gripper, "controller": {"type": "law"}, "features": {"type": "summit"}}
        check(settings_from(tables, "test", plugins))

    wired("force")
    with pytest.raises(
        WiringError, match=r"'force_left' in N, .*graspsense-test/fingers .*: gap, velocity\)"
    ):
        wired("plain")
    hand = plugins.find("sensor-backend", "fingers")
    assert hand.channels_vary()
    assert [channel.name for channel in hand.declared().channels] == ["gap", "velocity"]


SLOW_LAW = """
    from attrs import frozen
    from graspsense.core.components.step_params import params_of
    from graspsense.simulator_api import compile_function
    @frozen
    class SlowConfig:
        speed_m_s: float = 0.5
        ticks: int = 3
    def law(params):
        return params.speed_m_s * params.ticks
    if __name__ == "__main__":
        compiled = compile_function(law)
        print(compiled(params_of(SlowConfig())), sum(compiled.stats.cache_hits.values()))
"""


@pytest.mark.slow
def test_a_law_with_the_numbers_of_its_config_is_compiled_once_and_then_loaded(tmp_path):
    """Another process finds the machine code, although no module defines the type of the parameters."""
    (tmp_path / "lab_slow.py").write_text(dedent(SLOW_LAW))
    environ = {"PATH": "", "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    said = [python("lab_slow.py", cwd=tmp_path, env=environ, check=True).stdout for _ in range(2)]

    assert said == ["1.5 0\n", "1.5 1\n"]
