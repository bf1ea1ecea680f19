"""The union of feature sets: its values are those of the sets, its names are distinct, and it refuses wrong lists."""

import math
import sys

import pytest
from cases import every_case
from parts import NoKeys, offering

from graspsense.core.components.registry import IsolatedPlugins, installed
from graspsense.core.values.errors import ConfigError, UnknownName
from graspsense.plugin_api import Channel, Feature, FeatureSet, FeatureSetEntry, create
from graspsense.testing.samples import squeeze

HERE = sys.modules[__name__]


def union(**settings):
    return create("feature-set", "graspsense/union", **settings)


def test_each_set_gives_what_it_gives_alone():
    features = union(sets=("curve", "quantiles")).extract(squeeze())
    curve, quantiles = (create("feature-set", name).extract(squeeze()) for name in ("curve", "quantiles"))

    assert features.values == pytest.approx((*curve.values, *quantiles.values), nan_ok=True)
    assert features.names[: len(curve.names)] == curve.names
    assert len(set(features.names)) == len(features.names)
    # Both sets have a gap at the contact: that of the second is named after its set.
    assert features["quantiles_contact_gap"] == features["contact_gap"]


def test_the_thresholds_of_the_union_are_those_of_its_sets():
    strict = union(sets=("chitta", "curve"), contact_force_n=1000.0).extract(squeeze())
    assert all(math.isnan(value) for value in strict.values)
    assert set(strict.reasons) == set(strict.names)


def test_it_declares_the_features_of_its_sets_and_one_width():
    component = installed().find("feature-set", "graspsense/union")
    declared = component.declared(union(sets=("curve", "chitta")).config)
    assert [feature.name for feature in declared.features if feature.width] == ["contact_gap"]
    assert {require.name for require in declared.requires} == {"gap", "force_left", "force_right"}


@every_case(
    ("sets", "error", "says"),
    [
        ((), ConfigError, "sets"),
        (("curve", "curve"), ConfigError, "sets"),
        (("curve", "union"), ConfigError, "sets"),
        (("curv",), UnknownName, "curv"),
    ],
)
def test_a_list_that_cannot_be_united_is_refused(sets, error, says):
    with pytest.raises(error, match=says):
        union(sets=sets).extract(squeeze())


class Palm(FeatureSet[NoKeys]):
    """A set that relies on the channel that it declares."""

    requires = (Channel("palm", "N"),)
    features = (Feature("palm_force", "N", "largest force of the palm"),)

    def extract(self, trace):
        return self.result({"palm_force": trace.signals["palm"].max()})


def test_a_set_whose_channel_is_not_there_has_no_features_and_the_others_have_theirs(monkeypatch):
    palm = FeatureSetEntry(name="palm", target=f"{__name__}:Palm", summary="the palm")
    monkeypatch.setitem(sys.modules, __name__, HERE)
    with IsolatedPlugins(offering(palm)):
        features = union(sets=("chitta", "palm")).extract(squeeze())
    assert "palm" in features.reasons["palm_force"]
    assert features["p_first"] == pytest.approx(0.06, abs=1e-3)
