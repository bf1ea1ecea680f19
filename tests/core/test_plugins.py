"""The loader, on distributions with real metadata and real modules."""

import re
import sys
import types

import pytest

from graspsense.core.components.entries import PipelineEntry
from graspsense.core.components.firstparty import provider
from graspsense.core.components.registry import IsolatedPlugins, installed
from graspsense.core.components.roles import SensorBackend
from graspsense.core.settings.selected import select_component
from graspsense.core.values.errors import PluginUnavailable, UnknownName

HEAD = """
    from graspsense.plugin_api import Channel, ControllerEntry, PipelineEntry, SensorBackendEntry, hookimpl
    GRASPSENSE_API = (2, 0)
"""
BROKEN = HEAD + "    import no_such_driver"
BACKEND = """
    @hookimpl
    def graspsense_sensor_backends():
        given = dict(
            name="a", target="somewhere:Backend", config="somewhere:Config", summary="a gripper",
            channels=(Channel("gap", "m", 100.0),), accepts=("effort",),
        )
        yield SensorBackendEntry(**given | dict({}))
"""


def backend(name, **changes):
    return HEAD + BACKEND.format(
        ", ".join(f"{key}={value!r}" for key, value in {"name": name, **changes}.items())
    )


def reason_of(plugins, distribution):
    return next(statuse.reason for statuse in plugins.statuses if statuse.distribution == distribution)


def states(plugins):
    return {statuse.distribution: statuse.state for statuse in plugins.statuses}


def refusal(plugins, name, role="sensor-backend"):
    """Return what is said of a name that is not found."""
    with pytest.raises(UnknownName) as caught:
        plugins.find(role, name)
    return str(caught.value)


def test_an_installed_plugin_is_found_and_its_driver_left_alone_until_used(site):
    driver = """
        from attrs import frozen
        from graspsense.plugin_api import SensorBackend
        @frozen
        class Config:
            port: str = "usb"
        class Backend(SensorBackend):
            open = read = apply = tare = close = lambda self, *given: None
        """
    given = {"target": "lab_hand_driver:Backend", "config": "lab_hand_driver:Config"}
    site.install("lab-hand", backend("hand", **given), version="1.4", lab_hand_driver=driver)

    plugins = site.discover()
    component = plugins.find("sensor-backend", "hand")

    assert (component.qualified, component.version, component.table) == ("lab-hand/hand", "1.4", "gripper")
    assert plugins.find("sensor-backend", "lab-hand/hand") is component
    assert plugins.find("sensor-backend", "Lab_Hand/hand") is component
    assert "lab_hand_driver" not in sys.modules
    made = component.create(component.config_class()(port="serial"))
    assert isinstance(made, SensorBackend)
    assert made.config.port == "serial"


def test_built_in_parts_need_no_metadata(site):
    plugins = site.discover()

    names = [component.qualified for component in plugins.components("controller")]
    assert names == [f"graspsense/{name}" for name in ("force", "hybrid", "send-and-watch", "velocity")]
    assert plugins.find("feature-set", "chitta").declared().width == "p_first"


def test_a_distribution_without_an_entry_point_is_told_apart_from_one_that_is_not_installed(site):
    plugins = site.discover()
    assert "graspsense.plugins" in str(plugins.unknown("attrs"))
    assert "graspsense.plugins" not in str(plugins.unknown("attr"))


def test_text_for_an_unknown_name(site):
    site.install("lab-pr2", backend("pr2"))
    site.install("graspsense-hid", BROKEN)

    told = refusal(site.discover(), "pr3")
    assert told.startswith("no sensor backend named 'pr3'. Known: pr2, replay. Did you mean 'pr2'?\n")
    assert "graspsense-hid 0.2 is installed" in told
    assert told.endswith("(graspsense plugins show graspsense-hid)")


def test_another_role_is_told_with_those_there_are():
    with pytest.raises(UnknownName, match=r"'classifiers'.*feature-set, classifier"):
        select_component("classifiers", "knn")


def test_text_for_a_part_of_ours_that_is_not_installed_or_is_broken(site):
    for name in ("pr2", "graspsense-pr2-gripper/pr2"):
        assert refusal(site.discover(), name) == (
            f"no sensor backend named '{name}'. It is provided by graspsense-pr2-gripper:\n"
            "  in a clone: pip install -r requirements-all.txt"
            '     published: pip install "graspsense[pr2]"'
        )
    site.install("graspsense-pr2-gripper", BROKEN)
    told = refusal(site.discover(), "pr2")
    assert "pip install" not in told
    assert "graspsense-pr2-gripper 0.2 is installed" in told


def test_what_each_distribution_of_ours_has_is_known_where_it_is_not_installed():
    """But for conformance checks, which nobody names, and parts of graspsense itself."""
    parts = [(part.role, part.name, part.distribution) for part in installed().components()]
    parts += [(part.kind, part.name, part.distribution) for part in installed().all_resources()]
    of_others = [part for part in parts if part[2] != "graspsense" and part[0] != "conformance check"]

    assert len(of_others) > 40
    for kind, name, distribution in of_others:
        provided = provider(kind, name)
        assert provided, f"{kind} {name} of {distribution}"
        assert provided.distribution == distribution


def test_text_for_a_name_that_two_distributions_provide(site):
    for distribution in ("graspsense-pr2-gripper", "lab-pr2"):
        site.install(distribution, backend("pr2"))
    plugins = site.discover()

    assert refusal(plugins, "pr2") == (
        "sensor backend 'pr2' is provided by graspsense-pr2-gripper and lab-pr2; "
        'write gripper.type = "graspsense-pr2-gripper/pr2"'
    )
    for distribution in ("graspsense-pr2-gripper", "lab-pr2"):
        assert plugins.find("sensor-backend", f"{distribution}/pr2").distribution == distribution


def test_one_entry_point_name_in_two_distributions_drops_neither(site):
    for name in ("a", "b"):
        site.install(f"lab-{name}", backend(name), entry="gripper")

    assert [part.name for part in site.discover().components("sensor-backend")] == ["a", "b", "replay"]


def test_a_distribution_found_twice_on_the_path_is_loaded_once(site, tmp_path, monkeypatch):
    site.install("lab-a", backend("a"))
    link = tmp_path / "lib64"
    link.symlink_to(site.folder)
    monkeypatch.syspath_prepend(link)

    assert [statuse.distribution for statuse in site.discover().statuses] == ["graspsense", "lab-a"]


@pytest.mark.parametrize(
    ("environ", "loaded"),
    [
        ({"GRASPSENSE_PLUGINS": ""}, []),
        ({"GRASPSENSE_PLUGINS": "Lab_B, lab-x"}, ["lab-b"]),
        ({"GRASPSENSE_DISABLED_PLUGINS": "Lab..a"}, ["lab-b"]),
    ],
)
def test_a_disabled_plugin_is_not_even_imported(site, environ, loaded):
    for name in ("a", "b"):
        site.install(f"lab-{name}", backend(name))

    plugins = site.discover(**environ)

    distributions = [component.distribution for component in plugins.components("sensor-backend")]
    assert distributions == [*loaded, "graspsense"]
    assert states(plugins)["lab-a"] == "disabled"
    assert reason_of(plugins, "lab-a").endswith(f"in {next(iter(environ))}")
    assert "lab_a_plugin" not in sys.modules
    with pytest.raises(UnknownName, match=r"lab-a 0\.2 is installed"):
        plugins.find("sensor-backend", "a")


NEWER = "it is written for plugin API {}, graspsense 0.1.0 has 2.0: upgrade graspsense"


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("", "lab_a_plugin has no GRASPSENSE_API: add GRASPSENSE_API = (2, 0)"),
        ("GRASPSENSE_API = 1", "GRASPSENSE_API is 1"),
        ("GRASPSENSE_API = (2, 1)", NEWER.format("2.1")),
        ("GRASPSENSE_API = (3, 0)", NEWER.format("3.0")),
        ("GRASPSENSE_API = (1, 0)", "graspsense 0.1.0 has 2.0: upgrade lab-a"),
    ],
)
def test_a_plugin_for_another_api_is_refused_before_its_hooks_are_looked_at(site, line, reason):
    site.install("lab-a", line)

    assert reason in reason_of(site.discover(), "lab-a")


HOOK = "@hookimpl\n    def graspsense_controllers(): "


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("@hookimpl\n    def graspsense_controlers(): return []", "'graspsense_controllers'?"),
        ("def graspsense_controllers(): return []", "write @hookimpl above it"),
        ("@hookimpl(wrapper=True)\n    def graspsense_controllers(): return (yield)", "is a wrapper"),
        ("@hookimpl\n    def graspsense_controllers(config): return []", "Argument(s) {'config'}"),
        (
            "@hookimpl\n    def graspsense_probe_devices(timeout_s=1.0): return []",
            "write graspsense_probe_devices(timeout_s)",
        ),
        (HOOK + "pass", "returned None: return the entries"),
        (HOOK + "return 'hybrid'", "returned 'hybrid'"),
        (HOOK + "yield 3", "gave 3: it takes ControllerEntry"),
        (HOOK + "raise OSError('no such file')", "OSError: no such file"),
        ("Channel('gap', 'mm')", "channel 'gap' is in m, not in 'mm'"),
        ("Channel('temperature', '')", "channel 'temperature'"),
        ("raise SystemExit(3)", "SystemExit: 3 in "),
        ("raise GeneratorExit('panicked')", "GeneratorExit: panicked in "),
    ],
)
def test_a_plugin_that_breaks_the_rules_is_broken_and_says_which(site, body, reason):
    site.install("lab-a", HEAD + f"    {body}")

    plugins = site.discover()

    assert reason in reason_of(plugins, "lab-a")
    assert plugins.find("controller", "hybrid")


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"accepts": ("torque",)}, "'accepts' .*'torque'; .* effort, vel"),
        ({"name": "Two Words"}, "'name' is 'Two Words': write small"),
        ({"target": "module.Class"}, "'target' is"),
    ],
)
def test_a_wrong_entry_breaks_its_plugin_alone(site, wrong, reason):
    site.install("lab-a", backend(**{"name": "a", **wrong}))

    assert re.search(reason, reason_of(site.discover(), "lab-a"))


def test_one_distribution_cannot_declare_one_name_twice_nor_an_entry_one_channel(site):
    site.install("lab-a", backend("a").replace("yield", "for _ in range(2): yield"))
    site.install("lab-b", backend("b").replace("100.0),)", "100.0),) * 2"))

    plugins = site.discover()
    assert reason_of(plugins, "lab-a") == "lab-a declares sensor backend 'a' twice"
    assert "channel 'gap' twice" in reason_of(plugins, "lab-b")


def test_metadata_that_cannot_be_read_is_a_broken_plugin(site):
    site.metadata("lab-a", "0.1", "[graspsense.plugins]\nthis is no entry point\n")
    site.install("lab-b", backend("b"))

    assert states(site.discover()) == {"graspsense": "loaded", "lab-a": "broken", "lab-b": "loaded"}


def test_what_a_plugin_prints_and_the_trace_of_its_hooks_do_not_reach_stdout(site, capsys):
    site.install("lab-a", backend("a") + "    print('hello from the lab')")

    site.discover(GRASPSENSE_TRACE_PLUGINS="1")

    out, err = capsys.readouterr()
    assert out == ""
    assert "hello" in err
    assert "hook graspsense_sensor_backends() of lab-a:main returned " in err


NOT_WHOLE = """
    from graspsense.plugin_api import SensorBackend
    class Backend(SensorBackend):
        open = read = close = lambda self, *given: None
    """


@pytest.mark.parametrize(
    ("driver", "why"),
    [
        (None, "ModuleNotFoundError: No module named 'lab_driver'"),
        ("1 +", "SyntaxError: invalid syntax (lab_driver.py, line 1)"),
        ("", "lab_driver has no 'Backend'"),
        ("class Backend: pass", "lab_driver:Backend is not a subclass of SensorBackend"),
        (
            NOT_WHOLE,
            "lab_driver:Backend does not implement apply, which SensorBackend of plugin_api requires",
        ),
    ],
)
def test_text_for_a_component_whose_code_cannot_be_used(site, driver, why):
    site.install("lab-a", backend("a", target="lab_driver:Backend", needs="pip install lab-driver"))
    if driver is not None:
        site.write(lab_driver=driver)

    with pytest.raises(PluginUnavailable) as caught:
        site.discover().find("sensor-backend", "a").component_class()

    assert str(caught.value) == (
        f"sensor backend 'a' of lab-a 0.2 cannot be used here: {why}\n  needs: pip install lab-driver"
    )


def test_a_config_must_be_an_attrs_class(site):
    site.install("lab-a", backend("a", config="lab_driver:Config"), lab_driver="class Config: pass")

    with pytest.raises(PluginUnavailable, match="lab_driver:Config"):
        site.discover().find("sensor-backend", "a").config_class()


def test_a_pipeline_file_left_out_of_the_wheel_is_named(site):
    entry = 'PipelineEntry(name="mine", resource="graspsense:no/such.toml", summary="")'
    site.install("lab-a", HEAD + f"    @hookimpl\n    def graspsense_pipelines(): return [{entry}]")

    with pytest.raises(PluginUnavailable, match=r"no file 'no/such\.toml'.*package 'graspsense'"):
        site.discover().resource(PipelineEntry, "mine").file()


def test_isolated_plugins_do_not_discover_and_raise_what_a_plugin_raises(site):
    site.install("lab-a", backend("a"))

    with IsolatedPlugins() as plugins:
        assert installed() is plugins
        assert {statuse.distribution for statuse in plugins.statuses} == {"graspsense"}
    assert installed() is not plugins
    with pytest.raises(Exception, match="no GRASPSENSE_API"):
        IsolatedPlugins(types.ModuleType("mine"))
