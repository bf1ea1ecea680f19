"""The characteristics of pycatch22 as a feature set."""

import sys

import pytest
from attrs import evolve

from graspsense.core.components.registry import Plugins
from graspsense.core.values.errors import PluginUnavailable
from graspsense.plugin_api import create
from graspsense.testing.samples import squeeze


def extract(trace):
    return create("feature-set", "graspsense/catch22").extract(trace)


def test_force_and_duration_do_not_count_but_the_course_does():
    trace = squeeze()
    # Twice the contact force as well, so that the contact is at the same time.
    stronger = evolve(trace, force_left_n=2.0 * trace.force_left_n, force_right_n=2.0 * trace.force_right_n)
    twice = create("feature-set", "graspsense/catch22", contact_force_n=1.25).extract(stronger)
    assert twice.values == pytest.approx(extract(trace).values, rel=1e-6)
    slower = evolve(trace, t_s=3.0 * trace.t_s)
    assert extract(slower).values == pytest.approx(extract(trace).values, rel=1e-6)
    relaxed = extract(trace.until(1.85))
    squeezed = extract(trace.until(1.45))
    assert squeezed["stretch_decreasing"] < relaxed["stretch_decreasing"]


def test_a_grasp_without_contact_or_course_has_none_with_the_reason():
    assert "never felt" in extract(squeeze(contacts=(-1.0, -1.0))).reasons["trev"]
    assert "fewer than 8 samples" in extract(squeeze().until(1.022)).reasons["trev"]


def test_without_pycatch22_the_message_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "pycatch22", None)
    monkeypatch.delitem(sys.modules, "graspsense.plugins.features.catch22", raising=False)
    with pytest.raises(PluginUnavailable, match=r"graspsense\[catch22\]"):
        Plugins.discover().find("feature-set", "catch22").config_class()
