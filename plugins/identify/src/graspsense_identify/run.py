"""Identifying an object: prepare, choose, refine, intervals, what stays open, and the scene."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from attrs import evolve, fields_dict

from graspsense.plugin_api import ConfigError
from graspsense.simulator_api import (
    Identification,
    IdentifiedParameter,
    RecordedSqueeze,
    SqueezeFit,
)
from graspsense_identify.block import lag_of_block, with_fingertips_of_block
from graspsense_identify.check import predictive_checks
from graspsense_identify.choose import choose
from graspsense_identify.delay import Delay, Lag, delay_of
from graspsense_identify.fit import Fitted
from graspsense_identify.forward import ForwardModel
from graspsense_identify.fracture import FractureFit, fracture_of, not_broken
from graspsense_identify.held_out import held_out_errors
from graspsense_identify.individual import Individual, simplest_alone
from graspsense_identify.interval import interval_of_mean
from graspsense_identify.laws import DataScale, memories
from graspsense_identify.path_error import without_path_error
from graspsense_identify.prepare import FULL, NoSqueeze, Squeeze, prepared, resolution
from graspsense_identify.random_effects import OwnSpread, as_parameters, own_spreads
from graspsense_identify.refuse import refusals, shows_memory, undetermined
from graspsense_identify.share import measured_share
from graspsense_identify.spread import Uncertainty, uncertainty
from graspsense_identify.used_delay import Timed, with_delay
from graspsense_identify.write import SceneFacts, scene_text
from graspsense_sim_gripper.run.identification import CELLS, Drive, SimConfig, drive_and_pads

Progress = Callable[[str, int, int], None]

PADS_DIFFER: Final = 0.2
"""Share of the largest force by which the forces on both pads may differ without a note."""
MAX_SQUEEZES: Final = 30
"""More recordings hardly narrow the intervals, and a fit of all takes minutes."""

UNITS: Final = {
    "n_m": "N/m",
    "n_m3": "N/m3",
    "n_m15": "N/m1.5",
    "n": "N",
    "m": "m",
    "s": "s",
    "n_s_m": "N s/m",
    "n_s2_m2": "N s2/m2",
}
"""The units by the ends of names."""
OF_FINGERTIPS: Final = (
    *("pad_stiffness_n_m", "pad_damping_n_s_m", "pad_creep_n_m", "pad_creep_s"),
    *("pad_hardening_m", "pad_exponent"),
)
"""The settings of the gripper with which an object is identified, and has to be simulated."""


def identify(
    config: SimConfig,
    squeezes: Sequence[RecordedSqueeze],
    progress: Progress,
    block: Sequence[RecordedSqueeze] = (),
) -> Identification:
    """Return the object of these squeezes; `config` is that of a gripper whose recordings say nothing of their own.

    `block`: squeezes of a rigid block, from which the fingertips are identified before. A note names each recording
    that is left out: a copy, or one without contact or with too few measurements of the force. Raises ConfigError if
    all are.
    """
    begin = time.monotonic()
    config, notes = _settings(config, squeezes, block)
    (model := ForwardModel(pads=drive_and_pads(config)[1])).compile()
    recorded, cells = _used(_distinct(squeezes, notes), notes), _has_cells(config, squeezes)

    def timed(lag: Lag) -> Timed:
        parts = _ready(config, recorded, [] if lag.lag_s else notes, cells=cells, lag_s=lag.lag_s)
        return Timed(*parts, _chosen(model, parts[1], progress), lag)

    used, delay = with_delay(timed, lambda used: _delay(model, used, config.force_delay_s), model)
    progress("computing intervals", 0, 1)
    ready, shares, choice = used.ready, used.shares, used.individual.choice
    share_error = _share_error(config, ready) if cells else 0.0
    fitted, intervals = _with_uncertainty(model, used, share_error, delay)
    values, parameters = _values(fitted, intervals, shares if cells else (), share_error)
    own, fracture = _between_objects(model, used.individual, ready, shares)
    open_ = [*delay.undetermined, *undetermined(fitted, intervals, ready, shares, cells)]
    open_ += fracture.undetermined if fracture else []
    parameters += [*delay.parameters, *as_parameters(fitted, own), *(fracture.parameters if fracture else [])]
    fits, held_out = _fits(model, fitted, ready), held_out_errors(model, choice.fitted, ready)
    facts = SceneFacts(
        label=next((squeeze.label for squeeze in used.recorded if squeeze.label), ""),
        fitted=fitted,
        parameters=parameters,
        values=values,
        gripper=_fingertips(config),
        delay=delay,
        squeezes=ready,
        candidates=choice.scores,
        undetermined=open_,
        spreads={spread.place: spread.scatter.value for spread in own},
        fracture=fracture,
    )
    return Identification(
        label=facts.label,
        scene=scene_text(facts),
        parameters=tuple(parameters),
        candidates=choice.scores,
        undetermined=tuple(open_),
        fits=tuple(fits),
        held_out=held_out,
        refusals=refusals(open_, fits, held_out),
        checks=predictive_checks(model, fitted, intervals, ready),
        draws=intervals.draws,
        notes=tuple(notes),
        seconds=time.monotonic() - begin,
    )


def _delay(model: ForwardModel, used: Timed, settings_s: float) -> Delay:
    """Return the delay that the recordings show for the terms of a choice."""
    damper = memories(_scale(used.ready))[0]
    return delay_of(model, used.individual.choice.fitted, damper, used.ready, settings_s, used.lag)


def _distinct(squeezes: Sequence[RecordedSqueeze], notes: list[str]) -> list[RecordedSqueeze]:
    """Return the recordings without copies, which would confirm each other; a note names each copy."""
    by_content: dict[bytes, RecordedSqueeze] = {}
    for squeeze in squeezes:
        trace = squeeze.trace
        content = b"".join(
            column.tobytes() for column in (trace.t_s, trace.gap_m, trace.force_left_n, trace.force_right_n)
        )
        if content in by_content:
            notes.append(f"left out: {squeeze.name} is a copy of {by_content[content].name}")
        by_content.setdefault(content, squeeze)
    return list(by_content.values())


def _chosen(model: ForwardModel, squeezes: Sequence[Squeeze], progress: Progress) -> Individual:
    choice = choose(
        model,
        squeezes,
        _scale(squeezes),
        has_memory=shows_memory(squeezes),
        progress=lambda done, total: progress("fitting candidates", done, total),
    )
    return simplest_alone(model, choice, squeezes)


def _with_uncertainty(
    model: ForwardModel, used: Timed, share_error: float, delay: Delay
) -> tuple[Fitted, Uncertainty]:
    """Return the chosen fit and its uncertainty, both without the error of the path."""
    fitted, scale = used.individual.choice.fitted, share_error / math.sqrt(len(used.ready))
    lag_error_s = math.hypot(used.lag.error_s, delay.error_s)
    intervals = uncertainty(model, fitted, used.ready, scale, lag_error_s, used.individual.of_each)
    return without_path_error(model, fitted, intervals, used.ready)


def _ready(
    config: SimConfig,
    squeezes: Sequence[RecordedSqueeze],
    notes: list[str],
    *,
    cells: bool,
    lag_s: float = 0.0,
) -> tuple[list[RecordedSqueeze], list[Squeeze], list[float]]:
    """Return the squeezes that can be fitted, as recorded and prepared, and the share of the force that `cells` measure
    in each.

    The forces of the prepared ones are whole. A note names each other squeeze. `lag_s`: by how much the force lags
    beyond the delay of the settings. Raises NoSqueeze if there is none.
    """
    kept, ready = _fit_to_use(config, squeezes, notes, lag_s)
    if not cells:
        return kept, ready, [1.0] * len(ready)
    drive, _ = drive_and_pads(config)
    shares = _measured_shares(kept, ready, drive)
    share = _share(shares)
    return kept, [_with_share(squeeze, share) for squeeze in ready], shares


def _fit_to_use(
    config: SimConfig, squeezes: Sequence[RecordedSqueeze], notes: list[str], lag_s: float = 0.0
) -> tuple[list[RecordedSqueeze], list[Squeeze]]:
    """Return the squeezes with contact and enough measurements, as recorded and prepared."""
    kept, ready, refusals = [], [], []
    for squeeze in squeezes:
        try:
            ready.append(prepared(squeeze, config.force_delay_s, resolution(len(squeezes)), lag_s))
        except NoSqueeze as refusal:
            refusals.append(refusal)
        else:
            kept.append(squeeze)
    if not ready:
        raise refusals[0]
    for i in not_broken(ready):
        parts = resolution(len(squeezes))
        ready[i] = prepared(kept[i], config.force_delay_s, parts, lag_s, may_break=False)
    notes += [f"left out: {refusal}" for refusal in refusals]
    apart = max(squeeze.pad_difference for squeeze in ready)
    if apart > PADS_DIFFER:
        notes.append(
            f"the forces on the two pads differ by up to {apart:.0%} of the largest force. If the object is fixed off "
            "the centre, one finger touches it before the other, and the chosen terms are wrong: centre it, or let it "
            "stand free"
        )
    return kept, ready


def _shares(config: SimConfig, block: Sequence[RecordedSqueeze], lag_s: float) -> list[float]:
    """Return the share of the force that the cells measure in squeezes of a block: one for all of them."""
    if not _has_cells(config, block):
        return [1.0] * len(block)
    drive, _ = drive_and_pads(config)
    ready = [prepared(squeeze, config.force_delay_s, FULL, lag_s) for squeeze in block]
    return [_share(_measured_shares(block, ready, drive))] * len(block)


def _measured_shares(
    recorded: Sequence[RecordedSqueeze], ready: Sequence[Squeeze], drive: Drive
) -> list[float]:
    """Return the share of each squeeze by itself; NaN where it cannot be measured."""
    return [measured_share(squeeze.trace, two, drive) for squeeze, two in zip(recorded, ready, strict=True)]


def _settings(
    config: SimConfig, squeezes: Sequence[RecordedSqueeze], block: Sequence[RecordedSqueeze]
) -> tuple[SimConfig, list[str]]:
    """Return the settings of the gripper with the fingertips of the block, if there is one, and notes on them."""
    config, notes = _own_settings(config, squeezes)
    if not block:
        return config, notes
    lag_s = lag_of_block(config, block)
    config, said = with_fingertips_of_block(config, block, _shares(config, block, lag_s), lag_s)
    return config, [said]


def _own_settings(config: SimConfig, squeezes: Sequence[RecordedSqueeze]) -> tuple[SimConfig, list[str]]:
    """Return the settings of the gripper of the recordings: their own, or those given. Raises ConfigError."""
    known = fields_dict(SimConfig).keys() - {"object", "explain", "compile"}
    own: list[dict[str, Any]] = [
        {key: value for key, value in squeeze.gripper.items() if key in known}
        for squeeze in squeezes
        if squeeze.gripper
    ]
    if own and any(row != own[0] for row in own):
        raise ConfigError(
            "the recordings were made with different settings of the gripper: identify those of one setting together"
        )
    if own and len(own) == len(squeezes):
        return evolve(config, **own[0]), _overruled(config, own[0])
    stiffness = config.pad_stiffness_n_m
    return config, [
        f"the fingertips are taken as {stiffness:.3g} N/m each: -o gripper.pad_stiffness_n_m=VALUE (inf: rigid). "
        "The scene is of the object behind these fingertips"
    ]


def _overruled(config: SimConfig, own: Mapping[str, Any]) -> list[str]:
    """Return a note on each setting that was given, and which the recordings have with another value."""
    default = SimConfig()
    return [
        f"gripper.{key} is {value} in the recordings, which is used, not {getattr(config, key)}"
        for key, value in own.items()
        if getattr(config, key) not in (value, getattr(default, key))
    ]


def _used(squeezes: Sequence[RecordedSqueeze], notes: list[str]) -> Sequence[RecordedSqueeze]:
    """Return at most `MAX_SQUEEZES` squeezes, of as many objects as possible; a note says if some are left out."""
    if len(squeezes) <= MAX_SQUEEZES:
        return squeezes
    turn: dict[str, int] = {}
    turns = []
    for i, squeeze in enumerate(squeezes):
        turn[squeeze.instance] = turn.get(squeeze.instance, -1) + 1
        turns.append((turn[squeeze.instance], i))
    # The first squeeze of every object, then the second ones; among these evenly over the whole order.
    order = [i for _, i in sorted(turns)]
    last = turns[order[MAX_SQUEEZES - 1]][0]
    earlier = [i for i in order if turns[i][0] < last]
    same = [i for i in order if turns[i][0] == last]
    missing = MAX_SQUEEZES - len(earlier)
    chosen = sorted(earlier + [same[k * len(same) // missing] for k in range(missing)])
    notes.append(f"{MAX_SQUEEZES} of the {len(squeezes)} recordings are used, of as many objects as possible")
    return [squeezes[i] for i in chosen]


def _has_cells(config: SimConfig, squeezes: Sequence[RecordedSqueeze]) -> bool:
    """Whether the force was measured by the cells of PR2 fingertips, on which a part of the force lands."""
    if squeezes[0].gripper:
        return config.sensor == "pads"
    return all(
        squeeze.trace.pad_left.ndim == 2 and squeeze.trace.pad_left.shape[1] == CELLS for squeeze in squeezes
    )


def _share(shares: Sequence[float]) -> float:
    """Return the mean share. The scatter of a median is a quarter larger, which `_share_error` does not count."""
    known = [share for share in shares if math.isfinite(share)]
    return min(float(np.mean(known)), 1.0) if known else 1.0


def _between_objects(
    model: ForwardModel, individual: Individual, squeezes: Sequence[Squeeze], shares: Sequence[float]
) -> tuple[list[OwnSpread], FractureFit | None]:
    """Return the parameters that differ between the objects, and how the objects broke."""
    fitted, force_scatter = individual.choice.fitted, _force_scatter(shares)
    own = own_spreads(model, fitted, individual.fits, squeezes, force_scatter)
    return own, fracture_of(model, fitted, squeezes, force_scatter)


def _force_scatter(shares: Sequence[float]) -> float:
    """Return the standard deviation of the logarithm of the share between squeezes."""
    known = [share for share in shares if math.isfinite(share)]
    return float(np.std(np.log(known), ddof=1)) if len(known) > 1 else 0.0


def _fingertips(config: SimConfig) -> dict[str, float]:
    """Return the settings of the fingertips that are set."""
    values = {name: getattr(config, name) for name in OF_FINGERTIPS}
    return {name: float(value) for name, value in values.items() if value is not None}


def _share_error(config: SimConfig, squeezes: Sequence[Squeeze]) -> float:
    """Return the relative error of the share of one squeeze: that of the Coulomb friction over the mean force.

    The mean is over the way of the fingers, as in the balance of energy that the share follows from.
    """
    drive, _ = drive_and_pads(config)
    mean_n = float(np.median([_mean_over_way(squeeze) for squeeze in squeezes]))
    return float(config.coulomb_spread_n / ((1.0 + drive.friction.load_friction_coefficient) * mean_n))


def _mean_over_way(squeeze: Squeeze) -> float:
    """Return the mean force during the compression, over the way of the fingers."""
    gap = squeeze.gap_m[squeeze.sample]
    closing = slice(0, int(np.argmin(gap)) + 1)
    force, way = squeeze.force_n[closing], gap[closing]
    work_j = -float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(way)))
    return max(work_j / squeeze.depth_m, 0.1 * squeeze.peak_n)


def _with_share(squeeze: Squeeze, share: float) -> Squeeze:
    """Return the squeeze with the whole force in place of the measured share."""
    broken = None if squeeze.broken_n is None else squeeze.broken_n / share
    force, noise = squeeze.force_n / share, squeeze.noise_n / share
    return evolve(squeeze, force_n=force, noise_n=noise, share=share, broken_n=broken)


def _scale(squeezes: Sequence[Squeeze]) -> DataScale:
    times = [squeeze.stretches for squeeze in squeezes]
    return DataScale(
        force_n=float(np.median([squeeze.peak_n for squeeze in squeezes])),
        depth_m=float(np.median([squeeze.depth_m for squeeze in squeezes])),
        load_s=float(np.median([timing.load_s for timing in times])),
        memory_s=max(timing.load_s + timing.hold_s for timing in times),
        sample_s=float(np.median([np.median(np.diff(squeeze.t_s[squeeze.sample])) for squeeze in squeezes])),
    )


def _values(
    fitted: Fitted, intervals: Uncertainty, shares: Sequence[float], share_error: float
) -> tuple[dict[str, float], list[IdentifiedParameter]]:
    """Return the keys of the scene's object, and every identified parameter.

    `shares`: those of each squeeze, none without cells. `share_error`: the relative error of each.
    """
    widths = np.array(fitted.widths_m)
    known = np.array([share for share in shares if math.isfinite(share)])
    parameters = [_mean("width_m", "m", widths)]
    values = {"width_m": float(widths.mean())}
    width_spread = (
        intervals.width_objects_m if math.isfinite(intervals.width_objects_m) else intervals.width_squeezes_m
    )
    if math.isfinite(width_spread) and width_spread > 0.0:
        values["width_spread_m"] = width_spread
    # Without numbers of the objects, the spread is that between squeezes, whatever it comes from.
    between = (
        intervals.between_objects if math.isfinite(intervals.between_objects) else intervals.between_squeezes
    )
    if math.isfinite(between) and between > 0.0:
        values["stiffness_spread"] = between
    if len(known):
        values["share"] = _share(shares)
        parameters.append(_mean("share", "", known))
        beyond = share_spread(known.tolist(), share_error)
        if beyond > 0.0:
            values["share_spread"] = beyond
    for i, parameter in enumerate(fitted.candidate.free):
        ends = sorted((parameter.sign * intervals.low[i], parameter.sign * intervals.high[i]))
        parameters.append(
            IdentifiedParameter(
                name=parameter.label,
                unit=_unit(parameter.name),
                value=parameter.sign * fitted.values[i],
                low=ends[0],
                high=ends[1],
                basis=intervals.basis,
            )
        )
    return values, parameters


def share_spread(shares: Sequence[float], share_error: float) -> float:
    """Return the standard deviation of the share beyond the relative error of each of these; 0 if there is none.

    The error is that of the friction of the drive. It varies in every simulated squeeze, too.
    """
    if len(shares) < 2:
        return 0.0
    error = float(np.mean(shares)) * share_error
    return math.sqrt(max(float(np.var(shares, ddof=1)) - error * error, 0.0))


def _mean(name: str, unit: str, values: Any) -> IdentifiedParameter:
    """Return the mean of a quantity of each squeeze, with the interval of Student's t; a single one has none."""
    n, (low, high) = len(values), interval_of_mean(values)
    basis = f"between {n} squeezes" if n > 1 else "one squeeze: no interval"
    return IdentifiedParameter(
        name=name, unit=unit, value=float(np.mean(values)), low=low, high=high, basis=basis
    )


def _unit(name: str) -> str:
    ends = sorted((end for end in UNITS if name.endswith(f"_{end}")), key=len)
    return UNITS[ends[-1]] if ends else ""


def _fits(model: ForwardModel, fitted: Fitted, squeezes: Sequence[Squeeze]) -> list[SqueezeFit]:
    result = []
    for squeeze, width, factor in zip(squeezes, fitted.widths_m, fitted.factors, strict=True):
        forces = model.forces(squeeze, fitted.candidate, fitted.values, width, factor)
        closure = width - squeeze.gap_m[squeeze.sample]
        result.append(
            SqueezeFit(
                name=squeeze.name,
                t_s=squeeze.t_s[squeeze.sample],
                compression_m=closure - model.compressed_m(forces),
                measured_n=squeeze.force_n,
                fitted_n=forces,
                rms_n=float(np.sqrt(np.mean((forces - squeeze.force_n) ** 2))),
                peak_n=squeeze.peak_n,
            )
        )
    return result
