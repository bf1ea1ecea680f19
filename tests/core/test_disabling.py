"""Plugins that the user has switched off are not imported, and those that need attention are told what to do."""

import os
import sys

import pytest
from commands import graspsense, python

from graspsense.cli.plugins import _rows
from graspsense.core.components.registry import Plugins, builtin_source, installed_sources
from graspsense.core.components.registry import plugins as loader
from graspsense.core.components.registry.discovery import config_file, disabled_in_config, write_disabled
from graspsense.core.values.errors import ConfigError

FEATURES = """
    from graspsense.plugin_api import Feature, FeatureSetEntry, hookimpl
    GRASPSENSE_API = (2, 0)
    @hookimpl
    def graspsense_feature_sets():
        peak = Feature("peak", "N", "largest force")
        yield FeatureSetEntry("{name}", "lab:Peak", "peak", requires=(), features=(peak,))
"""


@pytest.fixture
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path / "config" / "graspsense" / "plugins.toml"


NAMED = "lab-loud lab-peak lab-other lab-old lab-slow lab-broken lab-sleepy"


@pytest.fixture
def run(site, monkeypatch):
    """Return a function that runs a command as if in a new process, and returns what it prints."""
    monkeypatch.setenv("GRASPSENSE_PLUGINS", NAMED)
    monkeypatch.setenv("NO_COLOR", "1")

    def run(*arguments, code=0):
        monkeypatch.setattr(loader, "_current", None)
        for name in site.modules:
            sys.modules.pop(name, None)
        done = graspsense(*arguments)
        assert done.returncode == code, done.stderr
        return done.stdout + done.stderr

    return run


def test_a_disabled_plugin_is_not_imported_until_it_is_enabled_again(home, site, run):
    site.install("lab-loud", "import sys; sys.stderr.write('I was imported'); GRASPSENSE_API = (2, 0)")

    assert "I was imported" in run("plugins", "list")
    said = run("plugins", "disable", "Lab_Loud")
    assert f"lab-loud is disabled, in {home}" in said
    assert "I was imported" not in said
    assert home.read_text() == 'disabled = ["lab-loud"]\n'

    listed = run("plugins", "list")
    assert "I was imported" not in listed
    assert f"in {home} (graspsense plugins enable lab-loud)" in listed

    run("plugins", "enable", "lab-loud")
    assert not home.exists()
    assert "I was imported" in run("plugins", "list")


def test_what_cannot_be_disabled_or_enabled(home, site, run):
    site.install("lab-loud", "GRASPSENSE_API = (2, 0)")

    assert "'lab-loud'?" in run("plugins", "disable", "lab-lout", code=2)
    assert "no installed plugin" in run("plugins", "disable", "graspsense", code=2)
    assert "not disabled" in run("plugins", "enable", "lab-loud", code=2)


def test_the_list_survives_its_file_and_one_that_is_none_says_what_it_holds(home):
    assert disabled_in_config() == ()
    assert write_disabled({"b", "a"}) == config_file() == home
    assert disabled_in_config() == ("a", "b")
    home.write_bytes(b'\xef\xbb\xbfdisabled = ["b"]\r\n')
    assert disabled_in_config() == ("b",)
    for text, says in (
        ("disabled = lab", "plugins.toml:1"),
        ('disabled = "lab-x"', "found disabled = 'lab-x'"),
        ('disable = ["lab-x"]', "found the unknown key 'disable'"),
    ):
        home.write_text(text)
        with pytest.raises(ConfigError, match=r"plugins\.toml.*disabled = \[") as caught:
            disabled_in_config()
        assert says in str(caught.value)


@pytest.mark.slow
def test_the_list_says_what_is_to_be_done(home, site):
    site.install("lab-peak", FEATURES.format(name="peak"))
    site.install("lab-other", FEATURES.format(name="peak"))
    site.install("lab-old", "GRASPSENSE_API = (0, 9)")
    site.install("lab-slow", "import numpy; GRASPSENSE_API = (2, 0)")
    site.install("lab-broken", "import no_such_driver")
    site.install("lab-sleepy", "import time; time.sleep(0.7); GRASPSENSE_API = (2, 0)")

    # A process of its own, for which numpy is not imported yet.
    environ = {**os.environ, "PYTHONPATH": str(site.folder), "NO_COLOR": "1", "GRASPSENSE_PLUGINS": NAMED}
    program = "from graspsense.cli.main import main; main(['plugins', 'list'])"
    said = python("-c", program, env=environ).stdout.partition("To be done:")[2]

    for words in (
        "lab-peak: the feature set name 'peak' is also that of lab-other/peak: write "
        'features.type = "lab-peak/peak", or disable one of them',
        "lab-old: broken: it is written for plugin API 0.9",
        "upgrade lab-old",
        "lab-slow: slow: importing lab_slow_plugin takes",
        "and imports numpy. Its author: name classes by import strings",
        "lab-sleepy: slow: importing lab_sleepy_plugin waits for 0.7 s. Its author: wait for a device",
        "GRASPSENSE_PLUGINS names lab-loud, and no plugin of that distribution is installed. Did you mean 'lab-old'",
        "lab-broken: broken: ModuleNotFoundError: No module named 'no_such_driver'",
        "; `graspsense plugins show lab-broken` has the whole of it, `graspsense plugins disable lab-broken` leaves it",
    ):
        assert words in said


def test_a_distribution_that_is_installed_twice_is_told_of(site, tmp_path, monkeypatch):
    site.install("lab-peak", FEATURES.format(name="peak"))
    other = type(site)(tmp_path / "second", monkeypatch)
    other.metadata("lab-peak", "0.1", "[graspsense.plugins]\nmain = lab_peak_plugin\n")
    monkeypatch.syspath_prepend(tmp_path / "second")

    mine = [source for source in installed_sources() if source.distribution == "lab-peak"]
    loaded = Plugins([builtin_source(), *mine], {})
    (row,) = [plugin_row for plugin_row in _rows(loaded) if plugin_row["distribution"] == "lab-peak"]

    assert len(mine) == 1
    assert "installed 2 times" in row["advice"][0]
    assert "pip uninstall lab-peak" in row["advice"][0]
