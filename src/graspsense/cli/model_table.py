"""The table of `run --explain-model`: how much each term of a simulated object did in this grasp."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import click


def print_model(model: Mapping[str, Any]) -> None:
    """Print what a simulated gripper reports as `model`: one row a term."""
    click.echo()
    if not model["touched"]:
        click.echo("model       no contact, so no term contributed")
        return
    click.echo(
        f"model       peak force {model['peak_n']:.2f} N, compression {model['compression_m'] * 1e3:.3f} mm, "
        f"of the pads {model['pads_m'] * 1e3:.3f} mm"
    )
    click.echo(
        f"{'term':<16}{'peak':>10}{'at peak':>12}{'share':>8}{'work':>11}{'lost':>11}{'expected':>11}"
        "  time constants"
    )
    for row in model["terms"]:
        click.echo(
            f"{row['term']:<16}{row['peak_n']:>8.3f} N{row['at_peak_n']:>10.3f} N{row['share']:>8.1%}"
            f"{row['work_j'] * 1e3:>8.2f} mJ{row['lost_j'] * 1e3:>8.2f} mJ{row['expected_n']:>9.3f} N"
            f"  {_times(row['rates'])}"
        )


def print_selection(selection: Mapping[str, Any]) -> None:
    """Print what a simulated gripper reports as `selection`: what became of each term, why, and the error of that."""
    click.echo()
    level, verified = selection["level"], selection["verified"]
    click.echo(
        f"accuracy    {selection['accuracy']:.3g} required, {selection['error']:.2g} estimated for what is left out "
        f"(tolerance {level['model_tol']:.2g}); {selection['steps']} steps (tolerance {level['step_tol']:.2g})"
    )
    click.echo(
        "verified    not by a trial grasp"
        if verified is None
        else f"verified    {verified['error']:.2g} in {verified['quantity']}, by {verified['grasps']} trial grasps, at "
        f"{selection['expected_force_n']:.3g} N and {selection['expected_speed_m_s'] * 1e3:.3g} mm/s"
    )
    for row in selection["decisions"]:
        click.echo(
            f"{row['term']:<16}{row['decision']:<28}{row['error']:>9.2g}  {row['number']:.3g} ({row['what']})"
        )


def _times(rates: Iterable[Mapping[str, Any]]) -> str:
    return (
        ", ".join(f"{rate['what']} in {1.0 / rate['per_s']:.3g} s" for rate in rates if rate["per_s"] > 0.0)
        or "-"
    )
