"""The four roles a component can play. Each is abstract; an implementation is final.

A component is built from its config (an attrs class) and does nothing until it is used: no file, no device, no
prompt in a constructor.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Generic, Literal, NamedTuple, Protocol, TypedDict, TypeVar, Unpack

from attrs import field, frozen

from graspsense.core.errors import ConfigError
from graspsense.core.setting_meaning import NAMES_INPUT
from graspsense.core.signals import Command, Frame, Outcome, Pads

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from graspsense.core.features import Features, FeatureTable, Prediction
    from graspsense.core.run_config import RunConfig
    from graspsense.core.trace import Trace
    from graspsense.core.tree import TreeNode

ConfigT = TypeVar("ConfigT")


class Reading(NamedTuple):
    """What one read of a gripper gives: the frame of this tick and the last cell image."""

    frame: Frame
    pads: Pads


@frozen(kw_only=True)
class ObjectKind:
    """A kind of object that a simulated gripper can grasp.

    Its full names are `name:state` for each of `states`, or `name` alone where it has no states. With `default` it
    belongs to the set of objects that trials are simulated with where the user names none.
    """

    name: str
    states: tuple[str, ...] = ()
    default: bool = False

    @property
    def full_names(self) -> tuple[str, ...]:
        """The names of this kind in each of its states."""
        return tuple(f"{self.name}:{state}" for state in self.states) or (self.name,)


@frozen(kw_only=True)
class DeviceInfo:
    """A gripper as it was opened.

    `simulated` is True where forces and motion come from a model, False where a physical gripper measures them.
    On a `virtual` clock, apply-then-read advances one tick and nothing waits; on a `device` clock a read waits
    for the next frame. `opening` is the command that opens the fingers and `relaxed` the one that lets go; a
    recording has no opening (None). `tare_images` is how many unloaded cell images the tare needs (0: none).
    `calibration` names each stored calibration in use and the hash of its content; `numbers` are what the device's
    raw numbers mean (counts per newton, transmission): a stored calibration holds for these alone.
    `units` names units that are not SI, as of a recording: `{"t": "frame"}`. `notes` are
    sentences that whoever reads the result has to know.
    """

    name: str
    serial: str = ""
    firmware: str = ""
    clock: Literal["virtual", "device"]
    simulated: bool = False
    rate_hz: float = field(converter=float)
    effort_limit_n: float = field(converter=float)
    speed_limit_m_s: float = field(converter=float)
    opening: Command | None
    relaxed: Command
    tare_images: int = 0
    calibration: Mapping[str, str] = field(factory=dict)
    numbers: Mapping[str, float | str] = field(factory=dict)
    units: Mapping[str, str] = field(factory=dict)
    notes: tuple[str, ...] = ()


class SensorBackend(ABC, Generic[ConfigT]):
    """A gripper with its sensors, real, simulated, emulated or recorded.

    The order of calls is expect (if at all), open, then read and apply in turn, then close. Config is kept as
    `self.config`.
    """

    def __init__(self, config: ConfigT) -> None:
        self.config = config

    def objects(self) -> Sequence[ObjectKind]:
        """Return the kinds of object that this backend can simulate; empty where it grasps what is really there."""
        return ()

    def with_object(self, name: str) -> SensorBackend[ConfigT]:
        """Return a backend with the same config, but with this object between its fingers.

        `name` is a full name of `objects()`, or any other name that the backend knows. A name that it does not know
        raises UnknownName, at the latest in `open`. Raises ConfigError where the backend cannot be given an object.
        """
        raise ConfigError(
            f"{type(self).__name__} grasps what is really there, so it cannot be given the object {name!r}. "
            "Choose a simulated gripper, as in --gripper sim"
        )

    def expect(self, controller: Controller[Any], run: RunConfig) -> None:
        """Be told, before `open`, under which controller and settings it is to be opened next.

        Opens and does nothing. A simulator chooses its model by it; a gripper need not know.
        """
        del controller, run

    @abstractmethod
    def open(self, seed: int) -> DeviceInfo:
        """Open the gripper and describe it; bounded in time, asks nothing.

        `seed` decides whatever the backend draws at random; a real gripper ignores it.

        Raises NoDevice where the gripper is not there, saying what was looked for and what to try.
        """

    @abstractmethod
    def read(self, timeout_s: float) -> Reading | None:
        """Return the next frame with the last cell image, or None where none came within `timeout_s`.

        Raises DeviceLost where the gripper stopped answering, RecordingEnded after the last recorded frame.
        """

    @abstractmethod
    def apply(self, command: Command) -> None:
        """Ask the gripper for this until the next command. Raises DeviceLost."""

    @abstractmethod
    def tare(self, images: Sequence[Pads]) -> None:
        """Set the zero of the pads from these cell images, taken with nothing touching. Raises TareRefused."""

    @abstractmethod
    def close(self) -> None:
        """Leave the gripper safe and let go of it. Bounded in time, can be called twice and in any state."""

    def report(self) -> Mapping[str, float | int | str | bool]:
        """Return what the backend counted, or knows beyond its frames (a simulator knows the true force)."""
        return {}

    def dry_run_backend(self) -> SensorBackend[Any] | None:
        """Return an emulated gripper that takes the same commands, for a dry run; None if there is none.

        Its `DeviceInfo.clock` is `device` if that of the real gripper is, so that the same limits hold.
        """
        return None


@frozen(kw_only=True, eq=False)
class Grasped:
    """One grasp of many.

    `extracted` is what `BatchOptions.extract` returned for its trace. `trace` is None unless traces were asked for.
    `report` is as of `SensorBackend.report`.
    """

    outcome: Outcome
    reason: str = ""
    extracted: Any = None
    trace: Trace | None = None
    report: Mapping[str, float | int | str | bool] = field(factory=dict)


@frozen(kw_only=True)
class SimulationVariant:
    """One way in which a simulated gripper can trade accuracy for time.

    `settings` are the keys of its own table that make it so. Those of one `method` and `fidelity` lie on one curve,
    and `step` says which of them this is. A `role` of `reference` is what errors are measured against, `floor` what
    a fidelity comes to in steps that no longer matter: the error of the model alone.
    """

    method: str
    fidelity: str
    step: str
    settings: Mapping[str, Any]
    role: Literal["curve", "floor", "reference"] = "curve"


class BatchOptions(TypedDict, total=False):
    """How many grasps are run at once; every option may be left out."""

    run: RunConfig | None
    """The `[run]` table; its seed is not used."""
    extract: Callable[[Trace], Any] | None
    """Called with each trace, like `feature_set.extract`; its result becomes `Grasped.extracted`."""
    traces: bool
    """Whether traces are kept, half a megabyte each; False by default."""
    workers: int | None
    """How many grasps run in parallel, by default one for each core; the results do not depend on it."""
    progress: Callable[[int, int], None] | None
    """Called several times a second with the number of finished grasps and of all."""


class BatchBackend(SensorBackend[ConfigT]):
    """A backend that can do many grasps at once."""

    def variants(self) -> Sequence[SimulationVariant]:
        """Return the ways in which it trades accuracy for time; none where there is nothing to trade."""
        return ()

    @abstractmethod
    def run_many(
        self,
        controller: Controller[Any],
        scenes: Sequence[str],
        seeds: Sequence[int],
        **options: Unpack[BatchOptions],
    ) -> Sequence[Grasped]:
        """Grasp each scene with its seed under this controller and return what came of each, in that order.

        The same seed gives the same trace as `read` and `apply` under the runner, to rounding. Raises ValueError
        where seeds and scenes differ in number, and before anything runs what the scenes' names raise.
        """


class ControllerState(Protocol):
    """What every controller state carries besides its own numbers."""

    @property
    def phase(self) -> int:
        """`APPROACH`, `SQUEEZE` or `HOLD`."""

    @property
    def outcome(self) -> int:
        """`RUNNING` until the law has ended the grasp, then an `Outcome` number."""


StepLaw = Callable[[Any, Any, Frame, Pads], tuple[Command, Any]]


class Controller(ABC, Generic[ConfigT]):
    """A control law: a pure step over named tuples of numbers.

    Write `step` as a plain module function and assign it: `step = staticmethod(step)`. It has no clock, no input,
    no output and no objects, and keeps to the subset of Python that a just-in-time compiler takes, so that the
    one law drives a gripper, runs in a debugger and is compiled together with a simulated plant.
    """

    def __init__(self, config: ConfigT) -> None:
        self.config = config

    @staticmethod
    @abstractmethod
    def step(params: Any, state: Any, frame: Frame, pads: Pads) -> tuple[Command, Any]:
        """Return the command for this tick, and the state after it."""

    @abstractmethod
    def params(self) -> Any:
        """Return the law's numbers as a named tuple of floats and integers."""

    @abstractmethod
    def init(self) -> ControllerState:
        """Return the state before the first tick."""


class FeatureSet(ABC, Generic[ConfigT]):
    """Draws features from a trace."""

    def __init__(self, config: ConfigT) -> None:
        self.config = config

    @abstractmethod
    def extract(self, trace: Trace) -> Features:
        """Return the features of this trace, defined or NaN with a reason for every trace there can be."""


@frozen(kw_only=True)
class ClassifierConfig:
    """What every classifier's config has; a classifier's own config class extends it."""

    model: str | None = field(default=None, metadata=NAMES_INPUT)
    """The trained model: the name of one that a plugin offers, or a .json file."""


class Classifier(ABC, Generic[ConfigT]):
    """Learns labels from a table of features, and predicts with reasons.

    A NaN in a table is missing, and every classifier has an answer to it. Which trials are `unknown` is not its
    business: one rule for all stands in `graspsense.core.novelty`.
    """

    def __init__(self, config: ConfigT) -> None:
        self.config = config

    @abstractmethod
    def fit(self, table: FeatureTable, labels: Sequence[str], seed: int) -> None:
        """Learn from these trials. The same table, labels and seed give the same model.

        Raises ValueError where nothing can be learned from them.
        """

    @abstractmethod
    def classes(self) -> tuple[str, ...]:
        """Return the labels it can give, in the order of the columns of `probabilities`."""

    @abstractmethod
    def probabilities(self, table: FeatureTable) -> NDArray[np.float64]:
        """Return shape (trials, classes); each row sums to 1."""

    @abstractmethod
    def explain(self, features: Features) -> Prediction:
        """Return the prediction for one trial with its reason in words and units."""

    def tree(self) -> Sequence[TreeNode] | None:
        """Return the fitted model as one decision tree, the root first; None where it is none."""
        return None

    @abstractmethod
    def to_json(self) -> dict[str, Any]:
        """Return the fitted model as values that JSON holds exactly."""

    @abstractmethod
    def from_json(self, model: Mapping[str, Any]) -> None:
        """Become the model that `to_json` gave; run and import nothing that the model names.

        Raises KeyError, TypeError, ValueError or DataDamaged where it is no such model.
        """
