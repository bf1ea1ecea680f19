"""`graspsense run` as a user meets it: from the shell, with right and with wrong input."""

import json
import os
import signal
import subprocess
import sys
from math import inf

import pytest
from attrs import evolve
from cases import every_case
from commands import graspsense, printed, python, refused
from grippers import Scripted, bottle, squeezing

from graspsense import load_pipeline
from graspsense.cli.run import effort_words, print_trial
from graspsense.core.grasp.dry_run import dry_run
from graspsense.core.settings.resolved import resolve
from graspsense.core.values.channel import Channel
from graspsense.core.values.signals import VELOCITY, Command
from graspsense.store.store import Store

COMMAND = [sys.executable, "-m", "graspsense"]


def test_without_any_option_it_grasps_a_bottle_and_shows_it_live():
    done = graspsense("run")
    assert done.returncode == 0
    for word in ("approach", "squeeze", "hold", "release"):
        assert word in done.stderr
    assert "outcome     steady" in done.stdout
    for name in ("p_first", "p_steady", "f_steady", "delta_t", "dp_dt", "df_dt"):
        assert f"\n{name}" in done.stdout
    assert "\nbecause     p_first = " in done.stdout
    assert "simulated" in done.stdout
    assert "Traceback" not in done.stderr


def test_json_has_the_promised_keys_and_says_nothing_else_on_stdout():
    done = graspsense("run", "--json", "--seed", "7", "--object", "can:empty_open")
    result = json.loads(done.stdout)
    assert result["outcome"] == "steady"
    assert list(result["features"]) == ["p_first", "p_steady", "f_steady", "delta_t", "dp_dt", "df_dt"]
    assert result["units"]["dp_dt"] == "m/s"
    assert result["seed"] == 7
    assert result["components"]["gripper"].startswith("graspsense-sim-gripper/sim ")
    assert result["seconds_simulated"] > 1.0
    assert result["seconds_wall"] > 0.0
    assert {"prediction", "reasons"} <= result.keys()
    # A 66 mm can, whatever else.
    assert result["features"]["p_first"] == pytest.approx(0.0655, abs=0.001)


@pytest.mark.slow
def test_nothing_there_is_an_outcome_with_reasons_and_exit_code_0():
    done = graspsense("run", "--json", "--object", "none")
    assert done.returncode == 0
    assert done.json["outcome"] == "nothing there"
    assert done.json["features"]["p_first"] is None
    assert "no finger felt" in done.json["reasons"]["p_first"]


@every_case(
    ("arguments", "code", "says"),
    [
        (["--gripper", "pr2"], 3, "searched for"),
        (["--object", "odwala:full_open"], 2, "'odwalla'?"),
        (["--gripper", "pr2", "--object", "block"], 2, "object"),
        (["-o", "controller.probing_forse_n=3"], 2, "probing_force_n"),
        (["-o", "controller.probing_force_n"], 2, "="),
        (["--seed", "x"], 2, "seed"),
        (["--gripper", "replay", "-o", "gripper.recording=icub:nowhere.txt"], 2, "nowhere.txt"),
    ],
)
def test_a_mistake_says_what_was_found_and_what_to_do(arguments, code, says):
    # The same as JSON, for a program.
    for options in ([], ["--json"]):
        done = graspsense("run", *options, *arguments)
        assert done.returncode == code, done.stderr
        assert "Traceback" not in done.stderr
        assert options or says in done.stderr


@pytest.mark.slow
def test_a_dry_run_opens_nothing_and_says_what_would_be_done():
    # The PR2 is not there, so anything opened would end with 3.
    told = printed("run", "--gripper", "pr2", "--dry-run")
    assert "nothing was opened" in told
    assert "controller.probing_force_n = 20.0" in told


@pytest.mark.slow
def test_a_trial_that_is_kept_runs_again_from_its_recording_and_from_its_settings(tmp_path):
    store, settings = tmp_path / "kept", tmp_path / "settings.toml"
    kept = json.loads(
        printed("run", "--json", "--seed", 5, "--object", "toy", "--save", store, "--label", "toy#1")
    )
    assert kept["kept"]["trial"] == 1
    assert kept["kept"]["recorder"]["dropped"] == 0
    assert kept["kept"]["recorder"]["ticks"] == kept["counts"]["ticks"]
    with Store.read(store) as opened:
        settings.write_text(opened.trial(1).record.settings_text)
    for again in (
        ("--gripper", "replay", "-o", f"gripper.recording=store:{store}#1"),
        ("--pipeline", settings),
    ):
        assert json.loads(printed("run", "--json", *again))["features"] == kept["features"]
    graspsense("run", "--save", store)
    with Store.read(store) as opened:
        stored = [(summary.id, summary.label, summary.instance) for summary in opened.page()]
    assert stored == [(2, None, None), (1, "toy", "toy#1")]


@pytest.mark.slow
def test_every_grasp_and_its_recording_is_drawn(tmp_path):
    pytest.importorskip("matplotlib", reason="drawing needs the extra `plot`")
    store = tmp_path / "kept"
    for k, command in enumerate(
        (
            ("run", "--save", store),
            ("run", "--object", "none"),
            ("run", "-o", "classifier.type=none"),
            ("replay", f"{store}#1"),
        )
    ):
        picture = tmp_path / f"grasp{k}.png"
        done = graspsense(*command, "--plot", picture)
        assert done.returncode == 0, done.stderr
        assert f"picture written to {picture}" in done.stderr
        assert picture.read_bytes().startswith(b"\x89PNG")
        assert picture.stat().st_size < 150_000


@pytest.mark.slow
def test_a_folder_that_cannot_be_written_is_found_out_before_the_grasp(tmp_path):
    (tmp_path / "file").write_text("in the way")
    err = refused("run", "--save", str(tmp_path / "file"))
    assert "create a store" in err
    assert "approach" not in err


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_grasp_with_the_gripper_let_go(number):
    # 1e5 ticks a second make this grasp long enough to be interrupted; the first row says that it is under way.
    process = subprocess.Popen(
        [*COMMAND, "run", "-o", "gripper.rate_hz=100000", "--object", "none"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    line = ""
    while "approach" not in line:
        line = process.stderr.readline()
        assert line, "it ended by itself"
    process.send_signal(number)
    out, err = process.communicate(timeout=300)
    assert process.returncode == 4, err
    assert "outcome     aborted: interrupted" in out
    assert "Traceback" not in err


HEAVY = ("scipy", "sklearn", "numba", "pandas", "matplotlib", "hid", "usb")


@pytest.mark.slow
def test_a_grasp_imports_nothing_heavy():
    program = (
        "import sys\nfrom graspsense.cli.main import main\nsys.argv = ['graspsense', 'run']\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code, end.code\n"
        f"print(*[name for name in {HEAVY!r} if name in sys.modules], file=sys.stderr)"
    )
    done = python("-c", program, check=True)
    assert done.stderr.splitlines()[-1] == ""


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is always full")
@pytest.mark.slow
@pytest.mark.parametrize("arguments", [["run", "--json"], ["config", "show"]])
def test_a_full_disk_under_stdout_is_told_without_a_traceback(arguments):
    with open("/dev/full", "wb") as full:
        ran = subprocess.run(
            [sys.executable, "-m", "graspsense", *arguments], stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert ran.returncode == 2
    assert ran.stderr.startswith("graspsense: No space left on device\n")
    assert "Traceback" not in ran.stderr


@pytest.mark.slow
def test_a_label_and_the_object_of_a_simulated_gripper_agree(tmp_path):
    store = str(tmp_path / "kept")
    plain = ("run", "--json", "--save", store, "-o", "classifier.type=none")
    printed(*plain, "--label", "can:full_open")
    with Store.read(store) as opened:
        assert opened.trial(1).record.settings["gripper"]["object"] == "can:full_open"
    assert "contradicts the object" in refused(
        *plain, "--label", "can:full_open", "--object", "can:empty_open"
    )
    with Store.read(store) as opened:
        assert len(opened.page()) == 1


class CommandedInVelocity(Scripted):
    """A gripper on a clock of its own that takes velocities only."""

    channels = (Channel("gap", "m", 1000.0), Channel("force_left", "N", 1000.0))
    accepts = ("velocity",)

    def open(self, seed):
        opening, relaxed = (Command(VELOCITY, speed, inf, inf) for speed in (0.03, 0.0))
        return evolve(super().open(seed), opening=opening, relaxed=relaxed)

    def dry_run_backend(self):
        return self


def test_a_dry_run_shows_what_a_gripper_commanded_in_velocity_is_commanded():
    settings = resolve(options=["controller.type=velocity", "controller.sends=velocity"])
    # Told to close at 10 mm/s, these fingers do so at 16: twice as fast would end the approach.
    gripper = CommandedInVelocity(lambda t: squeezing(0.8 * t), lambda t: bottle(0.8 * t), clock="device")
    rehearsed = dry_run(gripper, settings.controller.create(), settings.run)
    phases = {phase.phase: phase for phase in rehearsed.phases}

    for name in ("opening", "approach", "squeeze", "release"):
        assert phases[name].seconds > 0.0
        assert phases[name].kinds == ("velocity",)
    assert phases["opening"].fastest_m_s > 0.0
    # Until the contact, the guard keeps the speed and the effort of a gripper with a clock of its own low.
    assert phases["approach"].fastest_m_s <= settings.run.first_speed_m_s
    assert 0.0 < phases["approach"].most_n <= settings.run.first_effort_n


def test_the_effort_of_a_dry_run_is_told_as_a_limit_where_velocities_are_commanded():
    assert effort_words(("effort",), -15.0, 20.0) == "-15.0 to +20.0 N"
    assert effort_words(("velocity",), 5.0, 40.0) == "at most 40.0 N"
    assert effort_words(("velocity", "force"), 5.0, 40.0) == "+5.0 to +40.0 N or its limit"
    assert effort_words((), 0.0, 0.0) == ""


@pytest.mark.slow
def test_a_note_says_how_many_ticks_the_guard_limited_and_why_on_a_real_gripper(capsys):
    trial = load_pipeline(options=["gripper.object=block", "classifier.type=none"]).grasp()
    limited = "note        the guard limited the command in {} of 1000 ticks"
    why = ": until a contact, run.first_speed_m_s and run.first_effort_n limit this gripper"
    for guarded, clock, notes in (
        (0, "device", []),
        (50, "virtual", [limited.format(50)]),
        (50, "device", [limited.format(50)]),
        (500, "virtual", [limited.format(500)]),
        (500, "device", [limited.format(500) + why]),
    ):
        counts = {"ticks": 1000, "guarded": guarded}
        print_trial(evolve(trial, counts=counts, device=evolve(trial.device, clock=clock)))
        assert [line for line in capsys.readouterr().out.splitlines() if "guard" in line] == notes
