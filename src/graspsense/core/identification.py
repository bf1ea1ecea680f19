"""What `graspsense identify` passes to a simulator, and what comes back: an object, and what is known of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from attrs import field, frozen

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.trace import Trace

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much of it is done, and how much there is."""


@frozen(kw_only=True, eq=False)
class RecordedSqueeze:
    """A recorded grasp of an object that is to be identified.

    `sha256` is the hash of its file or of its frames. `label` and `instance` are empty where they are not known.
    `gripper` holds the settings of the gripper that it was recorded with, where the recording has them.
    """

    name: str
    sha256: str
    trace: Trace
    label: str = ""
    instance: str = ""
    gripper: Mapping[str, Any] = field(factory=dict)
    simulated: bool = False


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
    """A candidate: its terms, its number of free parameters, and its error on data that it was not fitted to.

    `error` is the rms residual over the peak force, of held-out recordings or held-out stretches. `verdict` says
    why the candidate was chosen or not.
    """

    terms: str
    parameters: int
    error: float
    fit_error: float
    verdict: str
    chosen: bool = False


@frozen(kw_only=True)
class Undetermined:
    """A quantity that the recordings do not determine: why, and what would determine it."""

    what: str
    reason: str
    remedy: str


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

    `scene` is the text of a scene file. `draws` has a row for each draw of the parameters, in their order.
    """

    label: str
    scene: str
    parameters: tuple[IdentifiedParameter, ...]
    candidates: tuple[CandidateScore, ...]
    undetermined: tuple[Undetermined, ...]
    fits: tuple[SqueezeFit, ...]
    checks: tuple[PredictiveCheck, ...] = ()
    draws: NDArray[Any] | None = None
    notes: tuple[str, ...] = ()
    seconds: float = 0.0
