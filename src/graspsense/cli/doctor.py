"""`graspsense doctor`: what is plugged in, which way to it works, and what to do where none does."""

from __future__ import annotations

from typing import Any, Final

import attrs
import click

from graspsense.cli.options import GRIPPER_ALONE, pipeline_options, settings_of, timeout_option
from graspsense.cli.output import echo_values, json_option
from graspsense.cli.terminal import Style, echo, echo_as_it_is, echo_entry, state_style
from graspsense.core.components.entries import Finding
from graspsense.core.components.registry import HookAnswer, Plugins, installed
from graspsense.core.control.garbage_collection import no_collection
from graspsense.core.settings.resolved import Settings
from graspsense.core.values.errors import ExitCode, GraspsenseError

_MARK: Final = 11
"""Width of a mark with its margins."""


@click.command()
@pipeline_options
@timeout_option(4.0, "Measuring time")
@click.option(
    "--latency",
    "repetitions",
    type=click.IntRange(1, 100),
    is_flag=False,
    flag_value=5,
    help="Move the gripper, 5 times or as often as given: time from a command to the first motion, and to the first "
    "force on a block between its fingers.",
)
@json_option()
def doctor(timeout_s: float, repetitions: int | None, **asked: Any) -> None:
    """Check plugins, libraries, permissions and devices; measure rate, loss and latency.

    Nothing moves without --latency. With --gripper and -o, it looks for that gripper (-o gripper.vendor_id=...,
    -o gripper.serial=...), and reports a problem if it is missing. Exit code 0: no problem; 1: a problem.
    """
    plugins = installed()
    config = None
    settings = None
    if any(asked.values()):
        settings = settings_of(**{**asked, "options": (*GRIPPER_ALONE, *asked["options"])})
        config = settings.gripper.config
    # A collection within a measurement would be told as a late report of the device.
    with no_collection():
        diagnoses = [HookAnswer("graspsense", _ourselves(plugins)), *plugins.diagnose(config, timeout_s)]
        if repetitions is not None:
            diagnoses.append(_latency(settings, repetitions))
    problems = sum(diagnosis.error != "" for diagnosis in diagnoses) + sum(
        finding.state == "problem" for diagnosis in diagnoses for finding in diagnosis.given
    )
    echo_values({"problems": problems, "diagnoses": [_as_json(diagnosis) for diagnosis in diagnoses]})
    for diagnosis in diagnoses:
        if diagnosis.given or diagnosis.error:
            _print(diagnosis)
    echo(f"{problems} problem(s)", Style.BAD) if problems else echo("no problem found", Style.GOOD)
    if problems:
        raise click.exceptions.Exit(ExitCode.CHECK_FAILED)


def _ourselves(plugins: Plugins) -> tuple[Finding, ...]:
    """Return what holds for every gripper: versions, and plugins that do not work."""
    import platform
    from importlib.metadata import PackageNotFoundError, version

    findings = [
        Finding("system", "ok", f"Python {platform.python_version()} on {platform.platform()}",
                numbers={"python": platform.python_version(), "platform": platform.platform()}),
    ]  # fmt: skip
    for name in ("numpy", "scipy", "scikit-learn", "numba"):
        try:
            findings.append(
                Finding(f"library {name}", "ok", version(name), numbers={"version": version(name)})
            )
        except PackageNotFoundError:
            findings.append(Finding(f"library {name}", "note", "not installed"))
    for status in plugins.statuses:
        broken = status.state == "broken"
        findings.append(
            Finding(
                f"plugin {status.distribution}",
                "problem" if broken else "ok" if status.state == "loaded" else "note",
                f"{status.version} {'does not load: ' if broken else ''}{status.reason}".rstrip(),
                f"graspsense plugins show {status.distribution}" if broken else "",
                {"version": status.version, "state": status.state},
            )
        )
    return tuple(findings)


def _latency(settings: Settings | None, repetitions: int) -> HookAnswer[Finding]:
    """Return the measured latencies of the gripper of these settings. It is left open, whatever happens."""
    from graspsense.core.grasp.latency import latency_findings

    if settings is None:
        raise click.UsageError("--latency moves a gripper: name it by --gripper or --pipeline")
    gripper, run = settings.gripper, settings.run
    backend = gripper.create()
    try:
        info = backend.open(run.seed)
        findings = latency_findings(backend, gripper.declared.accepts, info, run, repetitions)
        return HookAnswer(gripper.component.qualified, findings)
    except GraspsenseError as error:
        return HookAnswer(gripper.component.qualified, error=str(error))
    finally:
        backend.close()


def _as_json(diagnosis: HookAnswer[Finding]) -> dict[str, Any]:
    return {
        "distribution": diagnosis.distribution,
        "error": diagnosis.error,
        "findings": [
            {"found" if name == "words" else name: value for name, value in attrs.asdict(finding).items()}
            for finding in diagnosis.given
        ],
    }


def _print(diagnosis: HookAnswer[Finding]) -> None:
    echo(diagnosis.distribution, Style.HEADING)
    if diagnosis.error:
        echo_entry("  PROBLEM", f"could not look: {diagnosis.error}", Style.BAD, width=_MARK)
    for finding in diagnosis.given:
        style = None if finding.state == "ok" else state_style(finding.state)
        mark = "PROBLEM" if finding.state == "problem" else finding.state
        echo_entry(f"  {mark}", f"{finding.subject}: {finding.words}", style, width=_MARK)
        if finding.state != "ok" and finding.advice:
            # Several lines are not wrapped: those of a file, or commands, are copied.
            say = echo_as_it_is if "\n" in finding.advice else echo
            for line in filter(None, finding.advice.split("\n")):
                say(f"             {line}")
