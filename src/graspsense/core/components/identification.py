"""What `graspsense identify` passes to a simulator, and what comes back: an object, and what is known of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from attrs import field, frozen

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.values.trace import Trace

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much of it is done, and how much there is."""


@frozen(kw_only=True, eq=False)
class RecordedSqueeze:
    """A recorded grasp of an object that is to be identified.

    `sha256` is the hash of its file or of its frames. `label` and `instance` are empty where they are not known.
    `gripper` holds the settings of the gripper that it was recorded with, where the recording has them. `warnings` are
    sentences on what looks wrong in it.
    """

    name: str
    sha256: str
    trace: Trace
    label: str = ""
    instance: str = ""
    gripper: Mapping[str, Any] = field(factory=dict)
    simulated: bool = False
    warnings: tuple[str, ...] = ()


@frozen(kw_only=True)
class IdentifiedParameter:
    """A parameter with its 90 % interval, in SI units; `basis` says what the interval was computed from."""

    name: str
    unit: str
    value: float
    low: float
    high: float
    basis: str


@frozen(kw_only=True)
class CandidateScore:
    """A candidate: its terms, its number of free parameters, and the error by which it is compared with others.

    `error` is the rms residual over the peak force, of recordings that its terms were not fitted to, each with a width
    and a stiffness of its own; of a single recording, that of stretches which it was not fitted to. `verdict` says why
    the candidate was chosen or not.
    """

    terms: str
    parameters: int
    error: float
    fit_error: float
    verdict: str
    chosen: bool = False


@frozen(kw_only=True)
class Undetermined:
    """A quantity that the recordings do not determine: why, and what would determine it.

    `in_scene`: whether it is a number of the scene, whose value then means nothing.
    """

    what: str
    reason: str
    remedy: str
    in_scene: bool = False


@frozen(kw_only=True, eq=False)
class SqueezeFit:
    """The fit of one recording: measured and fitted forces (N) at the times of the measurements."""

    name: str
    t_s: NDArray[Any]
    compression_m: NDArray[Any]
    measured_n: NDArray[Any]
    fitted_n: NDArray[Any]
    rms_n: float
    peak_n: float

    @property
    def residual(self) -> float:
        """The rms difference between fitted and measured force, relative to the peak."""
        return self.rms_n / self.peak_n


COMPARED: Final = 20
"""Number of compressions at which squeezes are compared."""
LEAST_COMPRESSION: Final = 0.1
"""The smallest of them, relative to the largest compression that all squeezes reach."""


def repeatability(fits: Sequence[SqueezeFit]) -> float:
    """Return how much squeezes differ: the standard deviation of their loading force, relative to the mean peak.

    The rms over compressions that all squeezes reach while they are loaded; NaN for a single squeeze. A fit cannot be
    expected to be closer to a further squeeze than this.
    """
    import numpy as np

    if len(fits) < 2:
        return math.nan
    deepest = min(float(np.max(fit.compression_m)) for fit in fits)
    compression_m = np.linspace(LEAST_COMPRESSION * deepest, deepest, COMPARED)
    forces = []
    for fit in fits:
        load = slice(0, int(np.argmax(fit.compression_m)) + 1)
        forces.append(
            np.interp(compression_m, np.maximum.accumulate(fit.compression_m[load]), fit.measured_n[load])
        )
    deviation = float(np.sqrt(np.mean(np.var(forces, axis=0, ddof=1))))
    return deviation / float(np.mean([fit.peak_n for fit in fits]))


def held_out_in_words(errors: Sequence[float]) -> str:
    """Return how well squeezes are predicted from the other recordings."""
    rms = math.sqrt(sum(error * error for error in errors) / len(errors))
    return (
        f"{100.0 * rms:.1f} % of the peak ({100.0 * min(errors):.1f} to {100.0 * max(errors):.1f}): each recording "
        "predicted from others, with a width of its own"
    )


@frozen(kw_only=True)
class PredictiveCheck:
    """A statistic of the recorded squeezes beside that of simulated ones.

    `p` is the posterior predictive p-value: the share of simulated squeezes whose statistic is at least as large.
    """

    statistic: str
    unit: str
    recorded: tuple[float, ...]
    simulated: tuple[float, ...]
    p: float


@frozen(kw_only=True, eq=False)
class Identification:
    """An object identified from recorded squeezes.

    `scene` is the text of a scene file. `draws` has a row for each draw of the parameters, in their order. `held_out`
    has the rms error over the peak of each squeeze, predicted from other recordings, with only a width of its own; it
    is empty for a single recording. `refusals` says why the scene is not to be used.
    """

    label: str
    scene: str
    parameters: tuple[IdentifiedParameter, ...]
    candidates: tuple[CandidateScore, ...]
    undetermined: tuple[Undetermined, ...]
    fits: tuple[SqueezeFit, ...]
    held_out: tuple[float, ...] = ()
    refusals: tuple[str, ...] = ()
    checks: tuple[PredictiveCheck, ...] = ()
    draws: NDArray[Any] | None = None
    notes: tuple[str, ...] = ()
    seconds: float = 0.0
