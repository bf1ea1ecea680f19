"""The tables of `run --explain-model`: what each term did in this grasp, and what the scene would lose without it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final

from graspsense.cli.terminal import echo, echo_entry, echo_rows, echo_table

MOST_CHANGES: Final = 4
"""Features whose changes are listed for a term; of the others there is only the number."""


def print_report(report: Mapping[str, Any]) -> None:
    """Print what a simulated gripper reports of its model: what is not verified, and where asked for, its terms."""
    _print_not_verified(report)
    if "model" in report:
        _print_model(report["model"])
        if "selection" in report:
            print_without(report["model"].get("without", ()), report["selection"]["accuracy"])
            _print_selection(report["selection"])


def _print_model(model: Mapping[str, Any]) -> None:
    """Print what a simulated gripper reports as `model`: one row a term."""
    echo()
    if not model["touched"]:
        echo_entry("model", "no contact, so no term contributed")
        return
    echo_entry(
        "model",
        f"peak force {model['peak_n']:.2f} N, compression {model['compression_m'] * 1e3:.3f} mm, "
        f"of the pads {model['pads_m'] * 1e3:.3f} mm",
    )
    columns: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
        "TERM": lambda row: row["term"],
        "PEAK": lambda row: f"{row['peak_n']:.3f} N",
        "AT PEAK": lambda row: f"{row['at_peak_n']:.3f} N",
        "SHARE": lambda row: f"{100 * row['share']:.1f} %",
        "WORK": lambda row: f"{row['work_j'] * 1e3:.2f} mJ",
        "LOST": lambda row: f"{row['lost_j'] * 1e3:.2f} mJ",
        "TIME CONSTANTS": lambda row: _times(row["rates"]),
    }
    echo_rows(model["terms"], columns)


def print_without(rows: Iterable[Mapping[str, Any]], accuracy: float) -> None:
    """Print what a simulated gripper reports as `model.without`: what the scene would lose without each term.

    A change of at most `accuracy` (relative) counts as none.
    """
    lines = [(row["term"], _loss(row, accuracy)) for row in rows]
    if lines:
        echo()
        echo_table(("WITHOUT", "CHANGES"), lines)


def _loss(row: Mapping[str, Any], accuracy: float) -> str:
    """Return in words what the absence of a term changes, the largest changes first."""
    if row["failed"]:
        return str(row["failed"])
    lost = [
        (math.inf if effect["change"] is None else abs(effect["change"]), name, effect)
        for name, effect in row["changes"].items()
    ]
    beyond = sorted((change for change in lost if change[0] > accuracy), key=lambda change: -change[0])
    if not beyond and row["same_outcome"]:
        return f"nothing by more than {accuracy:.2g}: it can be left out of the scene"
    words = [_change(name, effect) for _, name, effect in beyond[:MOST_CHANGES]]
    if len(beyond) > MOST_CHANGES:
        words.append(f"and {len(beyond) - MOST_CHANGES} more")
    return ", ".join(words if row["same_outcome"] else ["the outcome", *words])


def _change(name: str, effect: Mapping[str, Any]) -> str:
    if effect["change"] is not None:
        return f"{name} {100 * effect['change']:+.1f} %"
    return f"{name} is no longer defined" if effect["without"] is None else f"{name} becomes defined"


def _print_not_verified(report: Mapping[str, Any]) -> None:
    """Print for which quantities a simulated gripper does not guarantee its accuracy, if any, and an unstable loop."""
    if report.get("unstable_loop"):
        echo_entry("simulation", report["unstable_loop"])
    names, selection = report.get("not_verified"), report.get("selection") or {}
    if names:
        why = "reasons: --explain-model"
        if not selection.get("within", True):
            most_n, reached_n = selection["expected_force_n"], report["true_peak_force_n"]
            why = f"it was verified up to {most_n:.3g} N, and this grasp reached {reached_n:.3g} N"
        echo_entry("simulation", f"its accuracy is not verified for: {', '.join(names)} ({why})")


def _print_selection(selection: Mapping[str, Any]) -> None:
    """Print what a simulated gripper reports as `selection`: the steps of the grasp, and what verified them."""
    echo()
    level, verified = selection["level"], selection["verified"]
    echo_entry(
        "accuracy",
        f"{selection['accuracy']:.3g} required; {selection['steps']} steps (tolerance {level['step_tol']:.2g})",
    )
    echo_entry(
        "verified",
        "not by a trial grasp"
        if verified is None
        else f"{verified['error']:.2g} in {verified['quantity']}, by {verified['grasps']} trial grasps, at "
        f"{selection['expected_force_n']:.3g} N",
    )
    rows = [
        (row["subject"], row["decision"], f"{row['what']} = {row['number']:.3g}")
        for row in selection["decisions"]
    ]
    echo_table(("SUBJECT", "DECISION", "REASON"), rows)


def _times(rates: Iterable[Mapping[str, Any]]) -> str:
    return (
        ", ".join(f"{rate['what']} in {1.0 / rate['per_s']:.3g} s" for rate in rates if rate["per_s"] > 0.0)
        or "-"
    )
