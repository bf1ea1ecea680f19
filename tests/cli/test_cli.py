"""The command line: what is printed where, exit codes, and no traceback for a user's mistake."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from importlib import import_module

import click
import pytest
from cases import every_case
from commands import graspsense, python
from parts import implementing, offering
from repository import ROOT

from graspsense import __version__
from graspsense.cli.main import COMMANDS
from graspsense.core.components.entries import CommandEntry, FoundDevice
from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.components.registry import plugins as loader
from graspsense.core.values.errors import DeviceLost, NoDevice
from graspsense.plugin_api import ClassifierEntry, SensorBackendEntry

REPLAY = ["--gripper", "replay", "-o", "gripper.recording=icub:some/file.txt", "-o", "classifier.type=none"]
"""What is here without any other distribution; the default pipeline's classifier is not."""


@pytest.fixture
def run(monkeypatch):
    monkeypatch.delenv("GRASPSENSE_TRACEBACK", raising=False)
    # By the patch, not as a context: a test that patches it again is then undone in the right order.
    monkeypatch.setattr(loader, "_current", IsolatedPlugins())
    return graspsense


def adding(name: str, command: click.Command):
    """Return a plugin that adds this command."""
    module = f"command_{name}"
    sys.modules[module] = type(sys)(module)
    sys.modules[module].command = command
    entry = CommandEntry(name, f"{module}:command", "a command of a plugin")
    return implementing("graspsense_commands", lambda self: [entry])


def failing(error: Exception):
    @click.command()
    @click.option("--json", "as_json", is_flag=True)
    def fail(as_json):
        raise error

    return adding("fail", fail)


def test_the_table_names_commands_that_are_there():
    for target, summary in COMMANDS.values():
        module, _, name = target.partition(":")
        assert isinstance(getattr(import_module(module), name), click.Command)
        assert summary.endswith(".")


def test_help_lists_the_commands(run):
    for arguments in ([], ["--help"], ["-h"]):
        ran = run(*arguments)
        assert (ran.returncode, ran.stderr) == (0, "")
        assert re.findall(r"^  (\w+)  +\w", ran.stdout, re.MULTILINE) == list(COMMANDS)


def test_version_is_that_of_the_distribution(run):
    with (ROOT / "pyproject.toml").open("rb") as file:
        assert tomllib.load(file)["project"]["version"] == __version__
    assert run("--version").stdout == f"graspsense, version {__version__}\n"


@every_case(
    ("arguments", "said"),
    [
        (["plugin"], ["no command named 'plugin'. Known: ", "Did you mean 'plugins'?"]),
        (["--jsn"], ["No such option '--jsn'", "graspsense --help shows"]),
        (["config", "shwo"], ["Did you mean 'show'?", "graspsense config --help shows"]),
        (
            ["config", "show", "a.toml", "--pipeline", "b.toml"],
            ["a.toml and --pipeline b.toml", "show --help"],
        ),
        (["config", "validate", "nosuch"], ["no pipeline named 'nosuch'", "given with its ending .toml"]),
        (["plugins", "show", "replai"], ["Known: backprop, ", "Did you mean 'replay'?"]),
    ],
)
def test_a_mistake_is_told_on_stderr_with_code_2(run, arguments, said):
    ran = run(*arguments)

    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr.startswith("graspsense: ")
    assert [words for words in said if words not in ran.stderr] == []


def test_with_json_an_error_is_an_object_on_stdout_too(run):
    ran = run("config", "show", *REPLAY, "-o", "controller.ramp_s=-1", "--json")

    message = "-o controller.ramp_s=-1: expected a number of at least 0, found -1.0"
    assert ran.returncode == 2
    assert ran.stderr == f"graspsense: {message}\n"
    assert ran.json == {"error": {"kind": "ConfigError", "message": message, "exit_code": 2}}


@pytest.mark.slow
def test_what_a_library_prints_beside_python_is_not_among_the_values():
    done = python(
        "-c",
        "import os\n"
        "from graspsense.cli.main import main\n"
        "from graspsense.plugins.features.chitta import ChittaFeatures as Loud\n"
        "extract = Loud.extract\n"
        "Loud.extract = lambda self, trace: (os.write(1, b'noise of C'), extract(self, trace))[1]\n"
        "main(['import', 'samples/manifest.toml', '--check', '--json'])",
        cwd=ROOT,
    )
    assert len(json.loads(done.stdout)) > 0
    assert "noise of C" in done.stderr


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (NoDevice("no gripper on any bus"), 3, "graspsense: no gripper on any bus\n"),
        (DeviceLost("no frame for 100 ms"), 4, "graspsense: no frame for 100 ms\n"),
        (
            PermissionError(13, "Permission denied", "/root/x"),
            2,
            "graspsense: Permission denied: /root/x\n"
            "  Choose another folder, or change who may read and write this one\n",
        ),
        (KeyboardInterrupt(), 130, "interrupted\n"),
        (
            KeyError("gap"),
            70,
            "graspsense: internal error: KeyError: 'gap'\n  This is a bug, ours or a plugin's. "
            "Run it again with GRASPSENSE_TRACEBACK=1 to see where it happened.\n",
        ),
    ],
)
def test_every_error_has_its_code_and_no_traceback(run, error, code, said):
    loader.installed().add(failing(error))

    ran = run("fail")

    assert (ran.returncode, ran.stdout, ran.stderr) == (code, "", said)


def test_an_internal_error_names_the_plugin_and_the_place(run, site, monkeypatch):
    site.install(
        "lab-faulty",
        """
        import click
        from graspsense.plugin_api import CommandEntry, hookimpl

        GRASPSENSE_API = (2, 0)

        @hookimpl
        def graspsense_commands():
            yield CommandEntry(name="fault", target=f"{__name__}:fault", summary="fails")

        @click.command()
        def fault():
            {}["gap"]
        """,
    )
    monkeypatch.setattr(loader, "_current", None)

    ran = run("fault")

    assert ran.returncode == 70
    assert "plugin lab-faulty" in ran.stderr
    assert "lab_faulty_plugin.py:13 in fault" in " ".join(ran.stderr.split())


def test_the_traceback_is_there_on_demand(run, monkeypatch):
    monkeypatch.setenv("GRASPSENSE_TRACEBACK", "1")
    loader.installed().add(failing(KeyError("gap")))

    ran = run("fail", "--json")

    assert ran.returncode == 70
    assert ran.stderr.startswith("Traceback (most recent call last):")
    assert "raise error" in ran.stderr
    assert ran.json["error"] == {"kind": "KeyError", "message": "KeyError: 'gap'", "exit_code": 70}


def test_with_strict_plugins_the_broken_one_is_named(run, site, monkeypatch):
    site.install("lab-broken", "import no_such_driver")
    monkeypatch.setattr(loader, "_current", None)
    monkeypatch.setenv("GRASPSENSE_STRICT_PLUGINS", "1")
    monkeypatch.setenv("GRASPSENSE_PLUGINS", "lab-broken")

    ran = run("plugins", "list")

    assert ran.returncode == 70
    assert ran.stderr.startswith(
        "graspsense: internal error: ModuleNotFoundError: No module named 'no_such_driver'\n"
        "  while loading main of lab-broken 0.2\n"
    )


def test_a_command_of_a_plugin_is_found_by_its_short_and_its_qualified_name(run):
    @click.command()
    @click.argument("word")
    def say(word):
        click.echo(word)

    loader.installed().add(adding("say", say), "lab-a")

    assert run("say", "hello").stdout == run("lab-a/say", "hello").stdout == "hello\n"
    assert "'say'?" in run("sya").stderr


def test_a_command_of_a_plugin_that_is_none_says_so(run):
    loader.installed().add(adding("say", print), "lab-a")
    said = "command 'say' of lab-a 0.1 cannot be used here: command_say:command is not a click command"

    ran = run("say")

    assert (ran.returncode, ran.stderr) == (2, f"graspsense: {said}\n")


def test_the_list_of_plugins_as_json_has_one_object_a_component(run):
    rows = run("plugins", "list", "--json").json

    assert {"role", "name", "distribution", "version", "state"} <= set(rows[0])
    named = {(row["role"], row["name"]): row for row in rows}
    hybrid = named["controller", "hybrid"]
    told = {"distribution": "graspsense", "version": __version__, "state": "loaded"}
    assert hybrid | told == hybrid
    c45 = named["classifier", "c45"]
    assert (c45["version"], c45["state"]) == (None, "not installed")
    assert c45["reason"].startswith("in a clone: pip install -r requirements-all.txt ")


def test_a_broken_and_an_observing_plugin_are_listed_and_shown(run, site, monkeypatch):
    site.install("lab-broken", "import no_such_driver", version="3.1")
    observer = """
        from graspsense.plugin_api import hookimpl
        GRASPSENSE_API = (2, 0)
        @hookimpl
        def graspsense_run_starting(run): pass
        """
    site.install("lab-observer", observer)
    monkeypatch.setattr(loader, "_current", site.discover(GRASPSENSE_DISABLED_PLUGINS="lab-off"))
    missing = "ModuleNotFoundError: No module named 'no_such_driver' (`pip check` says what is not installed)"
    reason = f"{missing} in installed/lab_broken_plugin.py:1"

    rows = {row["distribution"]: row for row in run("plugins", "list", "--json").json}

    broken = rows["lab-broken"]
    assert (broken["role"], broken["name"], broken["version"]) == (None, "main", "3.1")
    assert (broken["state"], broken["reason"]) == ("broken", reason)
    assert rows["lab-observer"]["summary"] == "graspsense_run_starting"
    row = rf"^- +main +lab-broken +3\.1 +broken +{re.escape(reason)}$"
    assert re.search(row, run("plugins", "list").stdout, re.MULTILINE)

    shown = run("plugins", "show", "lab-broken")
    assert shown.returncode == 0
    assert "state        broken: ModuleNotFoundError" in shown.stdout
    assert "import no_such_driver" in shown.stdout
    (status,) = run("plugins", "show", "lab-broken", "--json").json["plugins"]
    assert status["state"] == "broken"


def test_a_component_is_shown_with_its_keys(run):
    ran = run("plugins", "show", "hybrid")

    assert "controller graspsense/hybrid" in ran.stdout
    assert "requires     gap in m, velocity in m/s, force_left in N, force_right in N\n" in ran.stdout
    assert "    loop: 'open' | 'closed'; default \"open\"\n" in ran.stdout
    assert (
        "    closing_speed_m_s: float; m/s; above 0; plausible 0.0001 to 0.2 m/s; default 0.01\n"
        "        Closing speed "
    ) in ran.stdout
    assert "recording: str; must be given" in run("plugins", "show", "graspsense/replay").stdout
    assert "p_first in m" in run("plugins", "show", "chitta").stdout

    (component,) = run("plugins", "show", "hybrid", "--json").json["components"]
    assert component["qualified"] == "graspsense/hybrid"
    ramp = component["keys"]["ramp_s"]
    assert ramp.pop("meaning").startswith("Time over which the effort changes")
    assert (ramp["type"], ramp["required"], ramp["default"], ramp["unit"]) == ("float", False, 0.0, "s")
    assert (ramp["allowed"], ramp["plausible"]) == ("at least 0", "0 to 10 s")
    assert component["entry"]["commands"] == ["effort"]


def test_a_component_whose_config_cannot_be_imported_is_shown_with_the_reason(run):
    odd = ClassifierEntry("odd", "no_lab:A", "odd", "pip install lab")
    loader.installed().add(implementing("graspsense_classifiers", lambda self: [odd]), "lab-odd")

    ran = run("plugins", "show", "odd")

    assert ran.returncode == 0
    assert "'odd' of lab-odd 0.1" in ran.stdout
    assert "needs: pip install lab" in ran.stdout


class TestConfig:
    def test_show_prints_a_file_that_shows_the_same(self, run, tmp_path):
        shown = run("config", "show", *REPLAY, "--seed", "3")
        assert (shown.returncode, shown.stderr) == (0, "")
        file = tmp_path / "again.toml"
        file.write_text(shown.stdout)

        again = run("config", "show", str(file), "--json").json
        asked = run("config", "show", *REPLAY, "--seed", "3", "--json").json

        assert again["values"] == asked["values"]
        assert asked["origins"]["run.seed"] == "--seed"
        assert asked["origins"]["controller.probing_force_n"].startswith("pipeline graspsense/default:")
        assert asked["origins"]["controller.ramp_s"] == "default"
        assert "seed = 3                                  # --seed\n" in shown.stdout

    def test_show_takes_the_pipeline_either_way_and_json_has_no_infinity(self, run):
        shown = run("config", "show", *REPLAY).stdout
        assert run("config", "show", "default", *REPLAY).stdout == shown
        assert run("config", "show", "--pipeline", "default", *REPLAY).stdout == shown
        ran = run("config", "show", *REPLAY, "-o", "run.late_periods=inf", "--json")
        assert ran.json["values"]["run"]["late_periods"] == "inf"

    def test_validate_says_yes_and_names_the_components(self, run):
        ran = run("config", "validate", *REPLAY)
        assert (ran.returncode, ran.stderr) == (0, "")
        assert ran.stdout == (
            "default is valid: graspsense/replay 0.1.0, graspsense/hybrid 0.1.0, graspsense/chitta 0.1.0\n"
        )
        assert run("config", "validate", *REPLAY, "--json").json["valid"] is True

    def test_validate_checks_the_wiring(self, run, monkeypatch):
        deaf = SensorBackendEntry("deaf", "x:Y", "", config="parts:NoKeys", channels=(), accepts=("effort",))
        loader.installed().add(offering(deaf), "lab-deaf")

        ran = run("config", "validate", "--gripper", "deaf", "-o", "classifier.type=none", "--json")

        assert ran.returncode == 2
        assert ran.json["error"]["kind"] == "WiringError"
        assert "gripper lab-deaf/deaf" in ran.stderr


class TestDevices:
    def test_nobody_looks(self, run):
        ran = run("devices")
        assert (ran.returncode, ran.stderr) == (0, "")
        assert ran.stdout == "no installed plugin looks for devices (graspsense plugins list)\n"
        assert (
            run("devices", "--timeout", "0").returncode == run("devices", "--timeout", "nan").returncode == 2
        )

    def test_found_and_failed(self, run):
        def look(self, timeout_s):
            assert timeout_s == 0.5
            return [FoundDevice("hand", "42", "bus 1", ready=False, advice="add a udev rule")]

        def fail(self, timeout_s):
            raise OSError("no bus")

        for probe, distribution in ((fail, "lab-a"), (look, "lab-b")):
            loader.installed().add(implementing("graspsense_probe_devices", probe), distribution)

        ran = run("devices", "--timeout", "0.5")
        assert ran.returncode == 0
        assert ran.stderr == "lab-a could not look for its devices: OSError: no bus\n"
        assert ran.stdout == (
            "GRIPPER  SERIAL  WHERE  STATE      ADVICE\nhand     42      bus 1  not ready  add a udev rule\n"
        )
        answer = run("devices", "--timeout", "0.5", "--json").json
        (device,) = answer["devices"]
        told = {"backend": "hand", "serial": "42", "where": "bus 1", "advice": "add a udev rule"}
        assert device | told | {"ready": False, "distribution": "lab-b"} == device
        assert answer["failed"] == {"lab-a": "OSError: no bus"}


class TestCompletion:
    def test_the_script_calls_us_back(self, run):
        for shell in ("bash", "zsh", "fish"):
            ran = run("completion", shell)
            assert ran.returncode == 0
            assert f"_GRASPSENSE_COMPLETE={shell}_complete" in ran.stdout

    @every_case(
        ("words", "offered"),
        [
            ("graspsense ", list(COMMANDS)),
            ("graspsense p", ["predict", "plugins"]),
            ("graspsense config ", ["show", "validate"]),
            ("graspsense config show --g", ["--gripper"]),
        ],
    )
    def test_what_is_offered(self, run, monkeypatch, words, offered):
        monkeypatch.setenv("_GRASPSENSE_COMPLETE", "bash_complete")
        monkeypatch.setenv("COMP_WORDS", words)
        monkeypatch.setenv("COMP_CWORD", str(len(words.split(" ")) - 1))

        lines = run().stdout.split()

        assert [line.partition(",")[2] for line in lines] == offered


def test_a_reader_that_goes_away_is_no_error():
    code = "from graspsense.cli.main import main; main(['--help'])"
    child = subprocess.Popen(
        [sys.executable, "-u", "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    child.stdout.close()
    err = child.stderr.read()
    child.stderr.close()

    assert child.wait(timeout=300) == 141
    assert err == ""


def test_an_interrupt_before_the_commands_are_imported_is_quiet():
    code = """
import sys
class Interrupting:
    def find_spec(self, name, path, target=None):
        if name == "graspsense.cli.main":
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupting())
from graspsense.cli.entry import main
main()
"""
    done = python("-c", code)

    assert (done.returncode, done.stderr) == (130, "interrupted\n")


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="needs a shell that closes streams")
@pytest.mark.parametrize(
    ("command", "code", "says"),
    [
        ("run -o classifier.type=none >&-", 2, "standard output"),
        ("run -o classifier.type=none --json >&-", 2, "standard output"),
        (
            "collect --labels can:full_open --each 1 --save trials -o classifier.type=none <&-",
            0,
            "next: can:full_open",
        ),
    ],
)
def test_a_closed_stream_is_said(tmp_path, command, code, says):
    done = subprocess.run(
        ["sh", "-c", f"{sys.executable} -m graspsense {command}"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )

    assert done.returncode == code
    assert says in done.stderr
    assert "internal error" not in done.stderr
