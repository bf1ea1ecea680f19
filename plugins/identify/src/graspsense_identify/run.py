"""Identifying an object: prepare, choose, refine, intervals, what stays open, and the scene."""

from __future__ import annotations

import math
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import evolve, fields_dict

from graspsense.plugin_api import ConfigError
from graspsense.simulator_api import Identification, IdentifiedParameter, RecordedSqueeze, SqueezeFit
from graspsense_identify.block import lag_of_block, with_fingertips_of_block
from graspsense_identify.checks import predictive_checks
from graspsense_identify.choose import Choice, choose
from graspsense_identify.delay import PATH_ERROR_S, Delay, delay_of, lag_of
from graspsense_identify.fit import Fitted
from graspsense_identify.forward import ForwardModel, path_forces
from graspsense_identify.fracture import explained_falls, fracture_of, not_broken, of_whole_objects
from graspsense_identify.interval import identified, identified_mean
from graspsense_identify.laws import scale_of
from graspsense_identify.parts import has_objects, means_of_objects, parts_of
from graspsense_identify.prepare import NoSqueeze, Squeeze, prepared
from graspsense_identify.refuse import PADS_DIFFER, refusals, shows_memory, undetermined
from graspsense_identify.share import WHOLE, Shares, measured_shares
from graspsense_identify.spread import Uncertainty, uncertainty
from graspsense_identify.write import scene_text
from graspsense_sim_gripper.run.identification import CELLS, SimConfig, drive_and_pads

Progress = Callable[[str, int, int], None]

WEAK_N: Final = 0.1
"""A largest force below this one is more likely in another unit than that of so weak a squeeze."""
MAX_SQUEEZES: Final = 30
"""More recordings hardly narrow the intervals, and a fit of all takes minutes."""
MAX_ROUNDS: Final = 3
"""How often the lag is corrected by that which the terms chosen with it show."""
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
    model = ForwardModel(pads=drive_and_pads(config)[1])
    # Compiled before several threads call it.
    path_forces()
    recorded = _used(_distinct(squeezes, notes), notes)
    notes += _looks_wrong(recorded)

    used, delay = _with_delay(config, model, recorded, notes, progress)
    progress("computing intervals", 0, 1)
    chosen, shares = used.choice, used.shares
    fitted = chosen.fitted
    lag_error_s = math.hypot(PATH_ERROR_S if delay.used_s != delay.settings_s else 0.0, delay.error_s)
    parts = parts_of(fitted, has_lag=lag_error_s > 0.0)
    intervals = uncertainty(fitted, parts, shares.error / math.sqrt(len(fitted.squeezes)), lag_error_s)
    fracture = fracture_of(fitted, shares.scatter)
    values, parameters = _values(fitted, intervals, shares)
    parameters += delay.parameters
    parameters += fracture.parameters
    open_ = [*delay.undetermined, *undetermined(fitted, intervals, shares), *fracture.undetermined]
    fits, held_out = _fits(fitted), parts.squeeze_errors
    result = Identification(
        label=next((squeeze.label for squeeze in recorded if squeeze.label), ""),
        scene="",
        parameters=tuple(parameters),
        candidates=chosen.scores,
        undetermined=tuple(open_),
        fits=tuple(fits),
        held_out=held_out,
        refusals=refusals(open_, fits, held_out),
        checks=predictive_checks(fitted, intervals),
        draws=intervals.draws,
        notes=tuple(notes),
    )
    scene = scene_text(result, fitted, values, _fingertips(config), delay)
    return evolve(result, scene=scene, seconds=time.monotonic() - begin)


class Timed(NamedTuple):
    """The shares of the cells, the choice, and notes, for squeezes at the times that a lag of the force gives them."""

    shares: Shares
    choice: Choice
    notes: list[str]


def _with_delay(
    config: SimConfig,
    model: ForwardModel,
    recorded: Sequence[RecordedSqueeze],
    notes: list[str],
    progress: Progress,
) -> tuple[Timed, Delay]:
    """Return the choice with the delay that is used, and add notes on the squeezes.

    That of the settings is used where the interval of the chosen terms holds it, and where the lag does not settle.
    """
    settings_s = config.force_delay_s
    by_settings = _timed(config, model, recorded, 0.0, progress)
    notes += by_settings.notes
    lag_s = lag_of(by_settings.choice)
    for _ in range(MAX_ROUNDS if lag_s else 0):
        corrected = _timed(config, model, recorded, lag_s, progress)
        shown = delay_of(corrected.choice.fitted, settings_s, lag_s)
        if shown.low_s <= settings_s <= shown.high_s:
            break
        if abs(shown.shown_s - shown.used_s) <= PATH_ERROR_S:
            return corrected, shown
        lag_s = shown.shown_s - settings_s
    return by_settings, delay_of(by_settings.choice.fitted, settings_s, 0.0)


def _timed(
    config: SimConfig,
    model: ForwardModel,
    recorded: Sequence[RecordedSqueeze],
    lag_s: float,
    progress: Progress,
) -> Timed:
    """Return the choice for squeezes whose force lags like this.

    It is made again with the whole squeezes where the chosen object explains a fall of the force that looked like a
    break.
    """
    whole, has_cells = set[str](), _has_cells(config, recorded)
    while True:
        notes: list[str] = []
        ready, shares = _ready(config, recorded, notes, has_cells, lag_s, whole)
        choice = choose(
            model, ready, scale_of(ready), shows_memory(ready), partial(progress, "fitting candidates")
        )
        explained = explained_falls(choice.fitted)
        if not explained:
            return Timed(shares, choice, notes)
        whole |= explained


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


def _looks_wrong(squeezes: Sequence[RecordedSqueeze]) -> list[str]:
    """Return what looks wrong in the recordings, each with their number, and forces that can be in another unit."""
    said = Counter(warning for squeeze in squeezes for warning in dict.fromkeys(squeeze.warnings))
    wrong = [f"{count} of the {len(squeezes)} recordings: {warning}" for warning, count in said.items()]
    pads = [pad for squeeze in squeezes for pad in (squeeze.trace.force_left_n, squeeze.trace.force_right_n)]
    strongest = max(float(np.nanmax(pad, initial=0.0)) for pad in pads)
    if 0.0 < strongest < WEAK_N:
        wrong.append(
            f"the largest force is {1e3 * strongest:.3g} mN, as if the forces were in another unit than N"
        )
    return wrong


def _ready(
    config: SimConfig,
    squeezes: Sequence[RecordedSqueeze],
    notes: list[str],
    has_cells: bool,
    lag_s: float = 0.0,
    whole: Collection[str] = (),
) -> tuple[list[Squeeze], Shares]:
    """Return the squeezes with contact and enough measurements, of objects that had not broken before, with their whole
    forces, and the shares that cells measure.

    A note names each other squeeze. `lag_s`: by how much the force lags beyond the delay of the settings. `whole`: the
    names of squeezes in which the object does not break, however its force falls. Raises NoSqueeze if there is none.
    """
    ready: dict[int, Squeeze] = {}
    refused: list[NoSqueeze] = []
    prepare = partial(prepared, delay_s=config.force_delay_s, lag_s=lag_s, squeezes=len(squeezes))
    for i, squeeze in enumerate(squeezes):
        try:
            ready[i] = prepare(squeeze, may_break=squeeze.name not in whole)
        except NoSqueeze as refusal:
            refused.append(refusal)
    alike = {i: squeeze for i, squeeze in ready.items() if squeeze.pad_difference <= PADS_DIFFER}
    if alike:
        refused += [
            NoSqueeze(f"{squeeze.name}: the forces on its pads differ, and those of other recordings do not")
            for i, squeeze in ready.items()
            if i not in alike
        ]
        ready = alike
    if not ready:
        raise NoSqueeze("\n  ".join((str(refused[0]), *_looks_wrong(squeezes))))
    kept = list(ready)
    for k in not_broken(list(ready.values())):
        ready[kept[k]] = prepare(squeezes[kept[k]], may_break=False)
    unbroken = of_whole_objects(list(ready.values()))
    notes += [
        f"left out: {ready[i].name}: its object broke in a squeeze before"
        for k, i in enumerate(kept)
        if k not in unbroken
    ]
    ready = {kept[k]: squeeze for k, squeeze in unbroken.items()}
    kept = list(ready)
    notes += [f"left out: {refusal}" for refusal in refused]
    shares = WHOLE
    if has_cells:
        shares = measured_shares(config, [squeezes[i].trace for i in kept], list(ready.values()))
    return [squeeze.with_share(shares.mean) for squeeze in ready.values()], shares


def _settings(
    config: SimConfig, squeezes: Sequence[RecordedSqueeze], block: Sequence[RecordedSqueeze]
) -> tuple[SimConfig, list[str]]:
    """Return the settings of the gripper with the fingertips of the block, if there is one, and notes on them."""
    config, notes = _own_settings(config, squeezes)
    if not block:
        return config, notes
    lag_s = lag_of_block(config, block)
    ready = [prepared(squeeze, config.force_delay_s, lag_s) for squeeze in block]
    if _has_cells(config, block):
        share = measured_shares(config, [squeeze.trace for squeeze in block], ready).mean
        ready = [squeeze.with_share(share) for squeeze in ready]
    config, said = with_fingertips_of_block(config, ready, lag_s)
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
    turns: dict[int, list[int]] = defaultdict(list)
    counts: Counter[str] = Counter()
    for i, squeeze in enumerate(squeezes):
        turns[counts[squeeze.instance]].append(i)
        counts[squeeze.instance] += 1
    # The first squeeze of every object, then the second ones; among the last of these evenly over the whole order.
    chosen: list[int] = []
    for turn in turns.values():
        missing = min(MAX_SQUEEZES - len(chosen), len(turn))
        chosen += [turn[k * len(turn) // missing] for k in range(missing)]
    notes.append(f"{MAX_SQUEEZES} of the {len(squeezes)} recordings are used, of as many objects as possible")
    return [squeezes[i] for i in sorted(chosen)]


def _has_cells(config: SimConfig, squeezes: Sequence[RecordedSqueeze]) -> bool:
    """Whether the force was measured by the cells of PR2 fingertips, on which a part of the force lands."""
    if squeezes[0].gripper:
        return config.sensor == "pads"
    return all(
        squeeze.trace.pad_left.ndim == 2 and squeeze.trace.pad_left.shape[1] == CELLS for squeeze in squeezes
    )


def _fingertips(config: SimConfig) -> dict[str, float]:
    """Return the settings of the fingertips that are set."""
    values = {name: getattr(config, name) for name in OF_FINGERTIPS}
    return {name: float(value) for name, value in values.items() if value is not None}


def _values(
    fitted: Fitted, intervals: Uncertainty, shares: Shares
) -> tuple[dict[str, float], list[IdentifiedParameter]]:
    """Return the keys of the scene's object, and every identified parameter."""
    what = "objects" if has_objects(fitted.squeezes) else "squeezes"
    parameters = [identified_mean("width_m", means_of_objects(fitted.squeezes, fitted.widths_m), what)]
    if len(shares.known):
        parameters.append(identified_mean("share", shares.known))
    for i, parameter in enumerate(fitted.candidate.free):
        value, *interval = (
            parameter.sign * number for number in (fitted.values[i], intervals.low[i], intervals.high[i])
        )
        parameters.append(identified(parameter.label, value, (interval[0], interval[1]), intervals.basis))
    # Without numbers of the objects, a spread is that between squeezes, whatever it comes from.
    spreads = {
        "width_spread_m": intervals.width_m.of_scene,
        "stiffness_spread": intervals.stiffness.of_scene,
        "share_spread": shares.spread,
    }
    values = {parameter.name: parameter.value for parameter in parameters if "." not in parameter.name}
    if "share" in values:
        values["share"] = shares.mean
    return values | {name: spread for name, spread in spreads.items() if spread > 0.0}, parameters


def _fits(fitted: Fitted) -> list[SqueezeFit]:
    """Return the measured and the fitted forces of each squeeze."""
    return [
        SqueezeFit(
            name=squeeze.name,
            t_s=squeeze.t_s[squeeze.sample],
            compression_m=width - squeeze.gap_m[squeeze.sample] - fitted.model.compressed_m(forces),
            measured_n=squeeze.force_n,
            fitted_n=forces,
            rms_n=float(np.sqrt(np.mean((forces - squeeze.force_n) ** 2))),
            peak_n=squeeze.peak_n,
        )
        for squeeze, width, forces in zip(fitted.squeezes, fitted.widths_m, fitted.forces(), strict=True)
    ]
