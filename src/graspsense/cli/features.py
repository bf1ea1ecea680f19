"""`graspsense features`: the features of a store, extracted again with other settings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from graspsense.cli.options import keys_option
from graspsense.cli.output import check_outputs, echo_values, json_option
from graspsense.cli.progress import ProgressLine
from graspsense.cli.sources import keep_features, keep_option, named_store
from graspsense.cli.terminal import echo, echo_entries, echo_entry, echo_table
from graspsense.store.opening import STORE

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from graspsense.core.learn.labelled import Labelled


@click.command()
@click.argument("source", metavar="DIR", callback=named_store)
@keys_option(
    "Change a key of [features], [controller] or [run]: -o controller.contact_force_n=0.1.", required=True
)
@keep_option
@click.option("--overwrite", is_flag=True, help="Replace the file of --keep if it exists.")
@json_option("Print the comparison as JSON.")
def features(source: str, options: tuple[str, ...], keep: str | None, overwrite: bool) -> None:
    """Extract the features of every labelled trial of a store again, and compare them with the stored ones.

    Each recording is replayed with the changed settings, as `graspsense replay` does. The store does not change.
    `train`, `predict` and `evaluate` take the same -o.
    """
    from graspsense.store.dataset import labelled_store

    check_outputs(keep, overwrite=overwrite)
    stored = labelled_store(source)
    with ProgressLine() as progress:
        after = labelled_store(
            source, options, progress=lambda done, total: progress("extracting features", done, total)
        )
    keep_features(keep, after)
    rows = _rows(stored, after)
    echo_values(
        {
            "source": f"{STORE}{source}",
            "options": list(options),
            "trials": len(after),
            "features": rows,
            "notes": list(after.notes),
            "file": keep,
        }
    )
    cells = []
    for row in rows:
        trials = (f"{row['trials_before']} of {len(stored)}", f"{row['trials']} of {len(after)}")
        medians = (row["median_before"], row["median"])
        shown = ("" if median is None else f"{median:.4g}" for median in medians)
        cells.append((row["name"], row["unit"], *trials, *shown))
    echo_table(("FEATURE", "UNIT", "TRIALS BEFORE", "NOW", "MEDIAN BEFORE", "NOW"), cells)
    echo()
    echo_entries("note", after.notes)
    if keep:
        echo_entry("written", keep)


def _rows(stored: Labelled, after: Labelled) -> list[dict[str, Any]]:
    """Return for each feature in how many trials it is defined, and its median, before and now."""
    import numpy as np

    def known(labelled: Labelled, name: str) -> NDArray[np.float64]:
        if name not in labelled.table.names:
            return np.empty(0)
        values = labelled.table.columns([name]).values[:, 0]
        return values[~np.isnan(values)]

    rows = []
    units: dict[str, str] = {}
    for table in (after.table, stored.table):
        units = {**dict(zip(table.names, table.units, strict=True)), **units}
    for name in dict.fromkeys((*after.table.names, *stored.table.names)):
        was, now = known(stored, name), known(after, name)
        rows.append(
            {
                "name": name,
                "unit": units[name],
                "trials_before": len(was),
                "trials": len(now),
                "median_before": float(np.median(was)) if len(was) else None,
                "median": float(np.median(now)) if len(now) else None,
            }
        )
    return rows
