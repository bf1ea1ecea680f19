"""Where a gripper is mounted: the frame of its tool and of its fingers, as a link of a model or as a pose."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import isfinite, pi
from typing import Any, Final

from attrs import asdict, field, frozen

Triple = tuple[float, float, float]
LENGTHS: Final[Mapping[str, float]] = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
ANGLES: Final[Mapping[str, float]] = {"rad": 1.0, "deg": pi / 180.0}
_LINK: Final = re.compile(r"(?P<link>\S+) of (?P<model>\S.*)")
_NUMBERS: Final = r"(?P<{0}>\S+ \S+ \S+) (?P<{0}_unit>[a-z]+)"
_POSE: Final = re.compile(f"{_NUMBERS.format('at')}(?:, {_NUMBERS.format('turn')})?(?: in (?P<parent>\\S+))?")
_FORM: Final = (
    'write "LINK of FILE", as in "tool0 of arm.urdf", or a pose, as in "0 0 120 mm, 0 0 90 deg in flange"'
)


def _triple(values: Any) -> Triple:
    x, y, z = (float(value) for value in values)
    if not (isfinite(x) and isfinite(y) and isfinite(z)):
        raise ValueError(f"{values!r} are not three finite numbers")
    return x, y, z


@frozen(kw_only=True)
class Mounting:
    """Where a frame of a gripper is: a link of a URDF or MJCF model by its name, or a pose in another frame.

    A mounting with a `link` names the model's file in `model`. Any other is a pose: `position_m` and `rpy_rad`, the
    turns about the fixed axes x, y and z in this order, as in URDF, in the frame `parent`. Raises ValueError for
    numbers that are not finite, and for a link without a model.
    """

    link: str = ""
    model: str = ""
    position_m: Triple = field(default=(0.0, 0.0, 0.0), converter=_triple)
    rpy_rad: Triple = field(default=(0.0, 0.0, 0.0), converter=_triple)
    parent: str = ""

    def __attrs_post_init__(self) -> None:
        if bool(self.link) != bool(self.model):
            raise ValueError(f"link {self.link!r} of model {self.model!r}: give both, or neither and a pose")

    @classmethod
    def parse(cls, text: str) -> Mounting:
        """Return the mounting that a text says. Raises ValueError.

        >>> Mounting.parse("tool0 of arm.urdf").link, Mounting.parse("0 0 120 mm in flange").position_m
        ('tool0', (0.0, 0.0, 0.12))
        """
        words = " ".join(text.split())
        if link := _LINK.fullmatch(words):
            return cls(link=link["link"], model=link["model"])
        pose = _POSE.fullmatch(words)
        if pose is None:
            raise ValueError(f"{text!r} is no mounting: {_FORM}")
        return cls(
            position_m=_scaled(pose["at"], pose["at_unit"], LENGTHS),
            rpy_rad=_scaled(pose["turn"] or "0 0 0", pose["turn_unit"] or "rad", ANGLES),
            parent=pose["parent"] or "",
        )

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON values: link and model, or position, turns and parent."""
        values = asdict(self)
        kept = ("link", "model") if self.link else ("position_m", "rpy_rad", "parent")
        return {name: values[name] for name in kept}


def mounting_from_json(values: object) -> dict[str, Mounting]:
    """Return the mounting of each frame from `Mounting.as_json` of it. Raises TypeError or ValueError."""
    if not isinstance(values, dict) or not all(isinstance(value, dict) for value in values.values()):
        raise TypeError("the mounting of the gripper is not a table of tables")
    return {str(name): Mounting(**value) for name, value in values.items()}


def _scaled(numbers: str, unit: str, factors: Mapping[str, float]) -> Triple:
    if unit not in factors:
        raise ValueError(f"{unit!r} is not one of the units {', '.join(factors)}: {_FORM}")
    try:
        return _triple([factors[unit] * float(number) for number in numbers.split(" ")])
    except ValueError:
        raise ValueError(f"{numbers!r} are not three finite numbers: {_FORM}") from None
