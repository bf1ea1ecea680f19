"""`graspsense identify`: a scene of the simulator from recorded squeezes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from attrs import asdict

from graspsense.cli.options import keys_option, pipeline_option
from graspsense.cli.output import check_outputs, echo_found, echo_values, file_to_write, json_option
from graspsense.cli.progress import ProgressLine
from graspsense.cli.sources import named_source
from graspsense.cli.terminal import Style, echo, echo_entry, talk
from graspsense.core.components.entries import IdentifierEntry
from graspsense.core.components.identification import Identification, held_out_in_words, repeatability
from graspsense.core.components.registry import installed
from graspsense.core.files.whole_file import write_or_replace
from graspsense.core.settings.layers import Flag
from graspsense.core.settings.resolved import resolve
from graspsense.core.values.errors import ConfigError
from graspsense.report.write import write_html


@click.command()
@click.argument(
    "sources", nargs=-1, required=True, metavar="RECORDING|store:DIR|DIR#N...", callback=named_source
)
@click.option(
    "--out", metavar="FILE.toml", callback=file_to_write(".toml"), required=True, help="File of the scene."
)
@click.option(
    "--class",
    "name",
    metavar="NAME",
    help="Use the recordings with this label or of this class, as one object.",
)
@click.option(
    "--block",
    "blocks",
    metavar="RECORDING|store:DIR",
    multiple=True,
    help="Squeezes of a rigid block, from which the fingertips are identified first. Can be repeated.",
)
@click.option("--page", metavar="FILE.html", callback=file_to_write(".html"), help="Write the report page.")
@click.option("--overwrite", is_flag=True, help="Replace the files of --out and --page if they exist.")
@pipeline_option("Pipeline with the simulated gripper.  [default: default]")
@click.option("--gripper", metavar="NAME", help="Another simulated gripper. (gripper.type)")
@keys_option("Set a key: -o gripper.pad_stiffness_n_m=inf for rigid fingertips.")
@click.option(
    "--force",
    is_flag=True,
    help="Accept settings outside of their plausible range, and write a scene that the squeezes do not determine.",
)
@json_option()
def identify(
    sources: tuple[str, ...],
    out: str,
    name: str | None,
    blocks: tuple[str, ...],
    page: str | None,
    overwrite: bool,
    pipeline: str,
    gripper: str | None,
    options: tuple[str, ...],
    force: bool,
) -> None:
    """Identify an object from recorded squeezes, and write it as a scene.

    \b
    RECORDING is a FILE.mcap, or what `graspsense import` reads: a manifest
    FILE.toml, or KIND:FILE. store:DIR are the trials of a store, and
    DIR#N is one of them.

    `graspsense run --object FILE.toml` grasps the object in simulation.
    """
    from graspsense.sources.squeezes import recorded_squeezes

    check_outputs(out, page, overwrite=overwrite, sources=sources)
    flag = Flag("--gripper", "gripper.type", gripper)
    settings = resolve(pipeline, options=options, flags=[flag], force=force)
    identifier = installed().resource(IdentifierEntry, settings.gripper.component.name)
    squeezes = recorded_squeezes(sources, name)
    with ProgressLine() as progress:
        block = recorded_squeezes(blocks) if blocks else ()
        result = identifier.made(Identification, settings.gripper.config, squeezes, progress, block)
    refused = result.refusals if not force else ()
    if not refused:
        write_or_replace(Path(out), result.scene.encode())
    if page:
        from graspsense.report.identification import identification_page

        write_html(Path(page), identification_page(result, "" if refused else Path(out).name))
    for note in result.notes:
        talk(f"note: {note}")
    echo_values(_as_values(None if refused else out, result))
    _print(result)
    if not refused:
        echo_entry("scene", out)
        echo_entry("use it", f"graspsense run --object {out}")
    if page:
        echo_entry("page", page)
    if refused:
        reasons = "".join(f"\n  {reason}" for reason in refused)
        raise ConfigError(f"{out} is not written:{reasons}\n  --force writes it all the same")


def _print(result: Identification) -> None:
    """Print the identified object, the candidates, and what is not determined."""
    from graspsense.report.identification import identification_tables, percent_of_peak

    rms = [fit.rms_n for fit in result.fits]
    relative = [fit.residual for fit in result.fits]
    echo_entry("object", result.label or "without a label")
    echo_entry("squeezes", f"{len(result.fits)}, in {result.seconds:.1f} s")
    worst, mean = max(relative), sum(relative) / len(relative)
    echo_entry(
        "residual",
        f"{1e3 * sum(rms) / len(rms):.0f} mN rms, {100.0 * mean:.2f} % of the peak (largest {100.0 * worst:.2f} %)",
    )
    if result.held_out:
        echo_entry("held out", held_out_in_words(result.held_out))
    if len(result.fits) > 1:
        echo_entry(
            "repeatable", f"squeezes differ by {percent_of_peak(repeatability(result.fits))} of the peak"
        )
    parameters, candidates, undetermined = identification_tables(result)
    echo()
    echo_found(parameters)
    echo()
    echo_found(candidates, {"VERDICT": lambda cell: Style.GOOD if cell == "chosen" else None})
    echo()
    if not result.undetermined:
        return
    echo("not determined by these recordings:")
    echo_found(undetermined)
    echo()


def _as_values(out: str | None, result: Identification) -> dict[str, Any]:
    tables = ("parameters", "candidates", "undetermined")
    return {
        "scene": out,
        "label": result.label,
        "seconds": result.seconds,
        **{name: list(map(asdict, getattr(result, name))) for name in tables},
        "fits": [{"name": fit.name, "rms_n": fit.rms_n, "peak_n": fit.peak_n} for fit in result.fits],
        "held_out": list(result.held_out),
        "refusals": list(result.refusals),
        "repeatability": None if len(result.fits) < 2 else repeatability(result.fits),
        "checks": [{"statistic": check.statistic, "p": check.p} for check in result.checks],
        "notes": list(result.notes),
    }
