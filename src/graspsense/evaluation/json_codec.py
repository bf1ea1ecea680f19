"""The JSON form of results: one codec for everything that an evaluation or an experiment returns.

`to_json` and `from_json` are inverse for attrs classes of numbers, texts, tuples, mappings and other such classes.
A rate is written with its share, for those who read the JSON.
"""

from __future__ import annotations

from typing import Any, Final, TypeVar

import attrs
import cattrs
from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn

from graspsense.core.values.json_values import json_ready
from graspsense.evaluation.intervals import RecognitionRate

T = TypeVar("T")


def to_json(value: Any) -> Any:
    """Return a result as JSON values; NaN becomes None."""
    return json_ready(_CONVERTER.unstructure(value))


def from_json(values: Any, cls: type[T]) -> T:
    """Return the result of this class from JSON values. Raises ValueError if they do not describe one."""
    try:
        return _CONVERTER.structure(values, cls)
    except Exception as error:
        raise ValueError("; ".join(cattrs.transform_error(error, path=cls.__name__))) from error


def _write_rate(rate: RecognitionRate) -> dict[str, Any]:
    return {
        "correct": rate.correct,
        "n": rate.n,
        "rate": rate.rate,
        "interval": None if rate.interval is None else list(rate.interval),
        "no_interval": rate.no_interval,
        "instances": rate.instances,
    }


_CONVERTER: Final = cattrs.Converter()
# A key of the JSON is the alias of its field: it stays where the field has a new name.
_CONVERTER.register_unstructure_hook_factory(
    attrs.has, lambda cls: make_dict_unstructure_fn(cls, _CONVERTER, _cattrs_use_alias=True)
)
_CONVERTER.register_structure_hook_factory(
    attrs.has, lambda cls: make_dict_structure_fn(cls, _CONVERTER, _cattrs_use_alias=True)
)
_CONVERTER.register_unstructure_hook(RecognitionRate, _write_rate)
