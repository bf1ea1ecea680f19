"""The declaration of a setting: its default, meaning, unit, allowed range and plausible range, in one place.

A config class declares each of its keys by `setting`:

    @frozen(kw_only=True)
    class SqueezeConfig:
        closing_speed_m_s: float = setting(
            default=0.01, unit="m/s", above=0.0, plausible=(1e-4, 0.2), meaning="Closing speed of the gap."
        )

The declaration is carried in the attrs metadata of the field. From it come the check of a value, the refusal of an
implausible one, and what `graspsense config show` and `graspsense plugins show` print.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Final, Literal, NamedTuple, cast, get_args, get_origin

import attrs
from attrs import frozen, validators

from graspsense.core.values.units import display_unit, without_underscores

_DECLARATION: Final = "graspsense.setting"
_EFFECT: Final = "graspsense.effect"
_FOLLOWS: Final = "graspsense.follows"
_GIVES: Final = "graspsense.gives"

ORIGINS: Final = ("measured", "datasheet", "published elsewhere", "assumed")
"""The possible origins of a number of a model, besides a fit.

What is compared with the paper follows these origins: a result that a number was fitted to is not predicted. Nor is a
claim that a number gives by itself, such as static friction that a commanded force below it moves nothing.
"""
FITTED_TO: Final = "fitted to "
"""Begins the origin of a fitted number; the ids of the results follow, separated by commas."""

CHANGES_NO_RESULT: Final[Mapping[str, Any]] = {_EFFECT: "changes no result"}
"""Effect of a setting that changes what is reported, or how fast, but not the result beyond its stated accuracy."""
NAMES_INPUT: Final[Mapping[str, Any]] = {_EFFECT: "names an input"}
"""Effect of a setting that names what is grasped, replayed or loaded: it differs from run to run."""

UNIT_OF_ENDING: Final[Mapping[str, str]] = {
    "_m_s": "m/s",
    "_n_m": "N/m",
    "_n_s": "N/s",
    "_n_s_m": "N s/m",
    "_1_s": "1/s",
    "_kg_m2": "kg m2",
    "_counts_s": "counts/s",
    "_counts": "counts",
    "_hz": "Hz",
    "_kg": "kg",
    "_m": "m",
    "_n": "N",
    "_s": "s",
}
"""Ending of a key to the unit of its value, the longer endings first."""


@frozen(kw_only=True)
class Declaration:
    """What a setting declares besides its type and default; empty texts if it declares nothing.

    `allowed` describes the values that are accepted at all, in words. A value outside of `plausible` is refused unless
    the user insists.
    """

    meaning: str = ""
    unit: str = ""
    allowed: str = ""
    plausible: tuple[float, float] | None = None
    origin: str = ""
    """Where the default of a number of a model comes from, as `fitted_results` takes it; empty for other settings."""

    @property
    def plausible_words(self) -> str:
        """The plausible range with its unit, in words; empty if there is none."""
        if self.plausible is None:
            return ""
        low, high = self.plausible
        text = f"{low:g} or more" if math.isinf(high) else f"{low:g} to {high:g}"
        return f"{text} {self.unit}".rstrip()


def setting(
    *,
    meaning: str,
    default: Any = attrs.NOTHING,
    factory: Callable[[], Any] | None = None,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    above: float | None = None,
    below: float | None = None,
    plausible: tuple[float, float] | None = None,
    validator: Callable[[Any, Any, Any], None] | None = None,
    effect: Mapping[str, Any] | None = None,
    follows: str = "",
    origin: str = "",
    gives: str = "",
) -> Any:
    """Return the attrs field of a setting.

    A setting without `default` and `factory` must be given. `minimum` and `maximum` are themselves allowed, `above` and
    `below` are not. A number must be finite, unless `maximum` or the default is infinite. Values outside of `plausible`
    are refused unless the user adds `--force`. A key with a `Literal` type accepts its values only. None is accepted
    where it is the default. `validator` is a further validator of attrs. `effect` is `CHANGES_NO_RESULT` or
    `NAMES_INPUT`; a setting without either is part of the set-up: two grasps that differ in it are not comparable.
    `follows` names the setting that owns the value (`controller.contact_force_n`): where a pipeline does not give this
    one, and has that one, their values are equal. `origin` is that of a number of a model (`fitted_results`). `gives`
    is the id of a claim of the paper that the number gives by itself unless it is 0 (`given_claims`).

    Raises TypeError if the declaration contradicts itself.

    >>> @attrs.frozen(kw_only=True)
    ... class GentleConfig:
    ...     speed_m_s: float = setting(default=0.02, unit="m/s", above=0.0, meaning="Speed of closing.")
    >>> assert GentleConfig(speed_m_s=0.01).speed_m_s == 0.01
    """
    if not meaning.strip():
        raise TypeError("a setting needs a meaning: say in a sentence what its value does")
    if factory is not None and default is not attrs.NOTHING:
        raise TypeError("a setting has one default: give `default` or `factory`")
    limits = _Limits(minimum, above, maximum, below)
    _check_limits(limits, default)
    try:
        _ = fitted_results(origin) if origin else ()
    except ValueError as error:
        raise TypeError(str(error)) from error
    checks = _checks(limits, default, number=bool(unit) or plausible is not None or _is_number(default))
    if validator is not None:
        checks.append(validator)
    check: Any = validators.and_(*checks) if checks else None
    if check is not None and default is None:
        check = validators.optional(check)
    declaration = Declaration(
        meaning=meaning, unit=unit, allowed=limits.words, plausible=plausible, origin=origin
    )
    _check_plausible(declaration, default)
    metadata = {_DECLARATION: declaration, **(effect or {}), **({_FOLLOWS: follows} if follows else {})}
    metadata |= {_GIVES: gives} if gives else {}
    if factory is not None:
        return attrs.field(factory=factory, validator=check, metadata=metadata)
    return attrs.field(default=default, validator=check, metadata=metadata)


def _check_plausible(declaration: Declaration, default: Any) -> None:
    """Raise TypeError if the plausible range is empty, or does not contain the default."""
    plausible = declaration.plausible
    if plausible is not None and not plausible[0] < plausible[1]:
        raise TypeError(f"the plausible range {plausible} is empty: write (smallest, largest)")
    if implausible(declaration, default):
        raise TypeError(f"the default {default} is not in the plausible range {plausible}")


class _Limits(NamedTuple):
    """The limits of a setting: None where there is none."""

    minimum: float | None
    above: float | None
    maximum: float | None
    below: float | None

    @property
    def words(self) -> str:
        """The values that are allowed, in words; empty if all are."""
        if self.minimum is not None and self.maximum is not None and not math.isinf(self.maximum):
            return f"{self.minimum:g} to {self.maximum:g}"
        given = zip(("at least", "above", "at most", "below"), self, strict=True)
        return ", ".join(
            "may be inf" if limit == math.inf else f"{words} {limit:g}"
            for words, limit in given
            if limit is not None
        )


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _check_limits(limits: _Limits, default: Any) -> None:
    """Raise TypeError for two lower or two upper limits, and for a default outside of them or that can be changed."""
    if isinstance(default, list | dict | set):
        raise TypeError(
            f"the default {default!r} would be one for all: give it as factory=lambda: {default!r}"
        )
    minimum, above, maximum, below = limits
    if (minimum is not None and above is not None) or (maximum is not None and below is not None):
        raise TypeError(
            "a setting has one lower and one upper limit: `minimum` or `above`, `maximum` or `below`"
        )
    if not _is_number(default):
        return
    outside = (minimum is not None and default < minimum) or (maximum is not None and default > maximum)
    if outside or (above is not None and default <= above) or (below is not None and default >= below):
        raise TypeError(f"the default {default} is not allowed: a value is {limits.words}")


def declared(field: attrs.Attribute[Any]) -> Declaration:
    """Return what this field of a config class declares."""
    return cast(Declaration, field.metadata.get(_DECLARATION, Declaration()))


def _fields(cls: type) -> tuple[attrs.Attribute[Any], ...]:
    """Return the fields of a class; none if it is not an attrs class."""
    return attrs.fields(cls) if attrs.has(cls) else ()


def followed_settings(config_class: type) -> dict[str, str]:
    """Return the names of the settings of this class that follow another one, with the name of that one."""
    return {
        field.name: str(field.metadata[_FOLLOWS])
        for field in _fields(config_class)
        if _FOLLOWS in field.metadata
    }


def unit_of_name(key: str) -> str:
    """Return the unit that the ending of a key stands for, empty if it has none of `UNIT_OF_ENDING`."""
    return next((unit for ending, unit in UNIT_OF_ENDING.items() if key.endswith(ending)), "")


def implausible(declaration: Declaration, value: Any) -> str:
    """Return why this value is not plausible; empty if it is."""
    if declaration.plausible is None or isinstance(value, bool) or not isinstance(value, int | float):
        return ""
    low, high = declaration.plausible
    if low <= value <= high:
        return ""
    shown = f"{value:g} {declaration.unit}".rstrip()
    return f"{shown} is not plausible: the plausible range is {declaration.plausible_words}"


def fitted_defaults(config: Any) -> frozenset[str]:
    """Return the ids of the published results to which defaults were fitted that this config still has."""
    return frozenset(
        result
        for field in _fields(type(config))
        if (origin := declared(field).origin) and getattr(config, field.name) == field.default
        for result in fitted_results(origin)
    )


def settings_marked(config_class: type, effect: Mapping[str, Any]) -> frozenset[str]:
    """Return the names of the settings of this class with the effect `CHANGES_NO_RESULT` or `NAMES_INPUT`.

    A class that is not an attrs class has none.
    """
    wanted = effect[_EFFECT]
    return frozenset(field.name for field in _fields(config_class) if field.metadata.get(_EFFECT) == wanted)


def fitted_results(origin: str) -> tuple[str, ...]:
    """Return the ids of the results that a number of this origin was fitted to; none if it was not fitted.

    Raises ValueError with the known origins if the text is not one.

    >>> fitted_results("fitted to table_2, table_3")
    ('table_2', 'table_3')
    >>> fitted_results("assumed")
    ()
    """
    if origin in ORIGINS:
        return ()
    results = tuple(origin.removeprefix(FITTED_TO).split(", "))
    if not origin.startswith(FITTED_TO) or not all(result.isidentifier() for result in results):
        raise ValueError(
            f"{origin!r} is not an origin. Known: {', '.join(ORIGINS)}, or {FITTED_TO}the ids of published results"
        )
    return results


def gives(claim: str) -> Mapping[str, str]:
    """Return the metadata of the attrs field of a number which, unless it is 0, gives this claim by itself."""
    return {_GIVES: claim}


def given_claims(values: Any) -> frozenset[str]:
    """Return the ids of the claims that numbers of this attrs instance give by themselves; none for other values."""
    return frozenset(
        field.metadata[_GIVES]
        for field in _fields(type(values))
        if _GIVES in field.metadata and getattr(values, field.name) != 0
    )


def _checks(limits: _Limits, default: Any, *, number: bool) -> list[Any]:
    """Return the validators of the allowed range, and of the choices of a `Literal`."""
    if isinstance(default, str):
        return [_is_a_choice]
    whole = isinstance(default, int) and not isinstance(default, bool)
    checks: list[Any] = [validators.instance_of(int)] if whole else []
    kinds = (validators.ge, validators.gt, validators.le, validators.lt)
    checks += [kind(limit) for kind, limit in zip(kinds, limits, strict=True) if limit is not None]
    if isinstance(default, float) and math.isinf(default):
        return [*checks, validators.ge(-math.inf)]  # which NaN is not
    if number and limits.maximum is None and limits.below is None:
        checks.append(validators.lt(math.inf))
    if number and limits.minimum is None and limits.above is None:
        checks.append(validators.gt(-math.inf))
    return checks


def _is_a_choice(instance: Any, attribute: attrs.Attribute[Any], value: Any) -> None:
    """Raise ValueError for a value that the `Literal` type of its key does not list; other types allow any."""
    attrs.resolve_types(type(instance))
    kind = cast(Any, attribute.type)
    if get_origin(kind) is Literal and value not in get_args(kind):
        raise ValueError(
            f"{attribute.name!r} must be one of {', '.join(map(repr, get_args(kind)))}: {value!r}"
        )


def worded(key: str, value: Any) -> tuple[str, str]:
    """Return a key and its value in words: `probing_force_n`, 20 as `probing force`, `20 N`."""
    ending = next((ending for ending in UNIT_OF_ENDING if key.endswith(ending)), "")
    if not ending or isinstance(value, bool) or not isinstance(value, int | float):
        return without_underscores(key), str(value)
    unit, factor = display_unit(UNIT_OF_ENDING[ending])
    return without_underscores(key.removesuffix(ending)), f"{value * factor:g} {unit}"
