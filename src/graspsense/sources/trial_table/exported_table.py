"""A CSV file that `graspsense export` wrote: the same trials, features and controls as the store that it is from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from attrs import evolve

from graspsense.core.values.errors import DataDamaged
from graspsense.core.values.label_text import is_missing_label
from graspsense.sources.formats.csv_columns import CsvColumns
from graspsense.store.export_table import ABOUT, ABOUT_BEFORE, BEFORE, FIRST, VALUE
from graspsense.store.store import NOT_ENDED
from graspsense.store.time_recorded import order_recorded

if TYPE_CHECKING:
    from graspsense.core.values.features import FeatureTable


class ExportedTable:
    """The columns of an exported store; `about` are those that describe a trial, `features` those to learn from."""

    def __init__(self, columns: CsvColumns, about: Sequence[str]) -> None:
        self.columns = columns
        self.about = tuple(about)
        further = columns.names[len(about) :]
        self.features = [name for name in further if not name.startswith((BEFORE, FIRST, VALUE))]

    def keep_complete_trials(self, label: str | None, notes: list[str]) -> None:
        """Keep the trials that a store gives: complete ones that ended by themselves, with a label if one is named.

        Of trials with several sets of features, those with that of the newest trial are kept. Raises DataDamaged if
        none is left.
        """
        columns = self.columns
        if label is not None:
            labelled = [not is_missing_label(cell) for cell in columns.column(label, "the label")]
            notes += columns.keep_where(labelled, "they have no label")
        ended = [outcome not in NOT_ENDED for outcome in columns.cells["outcome"]]
        notes += columns.keep_where(ended, "they did not end by themselves")
        if complete := columns.cells.get("complete"):
            notes += columns.keep_where([cell != "0" for cell in complete], "they are incomplete")
        if not len(columns):
            raise DataDamaged(f"{columns.path} has no labelled trial that ended by itself")
        feature_sets = columns.cells.get("feature_set", [])
        if len(set(feature_sets)) > 1:
            newest = [feature_set == feature_sets[-1] for feature_set in feature_sets]
            notes += columns.keep_where(newest, "their features differ from those of the newest trial")
            self.features = [name for name in self.features if not columns.is_blank(name)]

    def order(self) -> tuple[tuple[int, ...] | None, str]:
        """Return the position of each trial in the order of recording, or None with the reason."""
        cells = self.columns.cells
        keys = [key for key in ("recorded_at", "order") if key in self.about]
        labels: list[dict[str, str]] = [
            {key: cells[key][i] for key in keys if not is_missing_label(cells[key][i])}
            for i in range(len(self.columns))
        ]
        return order_recorded(cells["made_at"], cells["origin"], labels)

    def before_contact(self) -> FeatureTable | None:
        """Return the features from before contact, None in a table of an earlier version."""
        return self._with_prefix(BEFORE)

    def first_line(self) -> FeatureTable | None:
        """Return the numbers of the first frame of imported trials, None if there are none."""
        table = self._with_prefix(FIRST)
        return None if table is None or np.isnan(table.values).all() else table

    def _with_prefix(self, prefix: str) -> FeatureTable | None:
        names = [name for name in self.columns.names if name.startswith(prefix)]
        if not names:
            return None
        table = self.columns.table(names)
        return evolve(table, names=tuple(name.removeprefix(prefix) for name in names))


def exported(columns: CsvColumns) -> ExportedTable | None:
    """Return the table that `graspsense export` wrote, None if these columns are not one."""
    possible = (about for about in (ABOUT, ABOUT_BEFORE) if tuple(columns.names[: len(about)]) == about)
    return next((ExportedTable(columns, about) for about in possible), None)
