"""The columns of the frames of a data set: how LeRobot declares them, stores them, and sums them up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import pyarrow
from attrs import frozen

QUANTILES: Final = (0.01, 0.10, 0.50, 0.90, 0.99)


@frozen(eq=False)
class Column:
    """A column: its key, its numbers (n,) or (n, width), and the name and unit of each number."""

    key: str
    values: Any
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()

    def declared(self) -> dict[str, Any]:
        """Return the feature as `meta/info.json` declares it."""
        shape = [1] if self.values.ndim == 1 else list(self.values.shape[1:])
        names = list(self.names) or None
        about = {"info": {"units": list(self.units)}} if self.units else {}
        return {"dtype": str(self.values.dtype), "shape": shape, "names": names, **about}


def parquet_columns(columns: Sequence[Column]) -> Any:
    """Return the frames as a table: a number in each row, or a list of them where there are several."""
    return pyarrow.table({column.key: _arrow(column.values) for column in columns})


def _arrow(values: Any) -> Any:
    if values.ndim == 1:
        return pyarrow.array(values)
    width = values.shape[1]
    if width == 1:
        return pyarrow.array(np.ascontiguousarray(values[:, 0]))
    return pyarrow.FixedSizeListArray.from_arrays(np.ascontiguousarray(values).ravel(), width)


def statistics(values: Any) -> dict[str, list[float] | list[int]]:
    """Return the statistics of a column over its frames as LeRobot stores them."""
    rows = values.reshape(len(values), -1).astype(np.float64)
    summary: dict[str, list[float] | list[int]] = {
        "min": rows.min(axis=0).tolist(),
        "max": rows.max(axis=0).tolist(),
        "mean": rows.mean(axis=0).tolist(),
        "std": rows.std(axis=0).tolist(),
        "count": [len(rows)],
    }
    for share, row in zip(QUANTILES, np.quantile(rows, QUANTILES, axis=0), strict=True):
        summary[f"q{round(100 * share):02d}"] = row.tolist()
    return summary
