"""An object with one of its parameters changed by a small share, for studies of how far a result depends on it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from attrs import evolve, frozen

from graspsense_sim_gripper.scene.spec import ObjectSpec

OF_THE_OBJECT: Final = ("width_m", "offset_m", "share", "friction", "mass_kg")
"""Numbers of an object, besides those of its terms, that change a grasp of its nominal instance."""


@frozen
class ScaledParameter:
    """A parameter of objects, as `object.width_m` or `elastic.k1_n_m`, and the share by which it is larger."""

    name: str
    share: float

    def applied_to(self, spec: ObjectSpec) -> ObjectSpec:
        """Return the object with this parameter scaled; an object without the parameter stays as it is."""
        where, _, key = self.name.rpartition(".")
        factor = 1.0 + self.share
        if where == "object":
            # A share of the force cannot exceed 1: it is made smaller instead.
            return evolve(spec, **{key: getattr(spec, key) * (1.0 / factor if key == "share" else factor)})
        terms = tuple(
            (kind, {**values, key: values[key] * factor} if kind == where and key in values else values)
            for kind, values in spec.terms
        )
        return evolve(spec, terms=terms)


def parameters_of(spec: ObjectSpec) -> Iterator[str]:
    """Yield the names of the parameters of an object that are finite and not 0."""
    for name in OF_THE_OBJECT:
        if getattr(spec, name) != 0.0:
            yield f"object.{name}"
    for kind, values in spec.terms:
        for key, value in values.items():
            if value != 0.0 and math.isfinite(value):
                yield f"{kind}.{key}"
