"""The four roles that a component can have, as abstract base classes.

A component is constructed from its config (an attrs class). Its constructor must not open files or devices, and must
not prompt the user.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, update_wrapper
from math import nan
from types import FunctionType
from typing import (
    TYPE_CHECKING,
    Any,
    ClassVar,
    Generic,
    Literal,
    Protocol,
    TypedDict,
    TypeVar,
    Unpack,
)

from attrs import field, frozen

from graspsense.core.components.setting import NAMES_INPUT, setting
from graspsense.core.components.step_params import params_of
from graspsense.core.control.contact import CONTACT_FORCE_N
from graspsense.core.control.free_motion import FreeMotion
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.signals import Command, Outcome, Pads, Reading

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from graspsense.core.components.compiled_features import CompiledFeatures
    from graspsense.core.components.entries import Feature
    from graspsense.core.components.run_config import RunConfig
    from graspsense.core.values.channel import Channel
    from graspsense.core.values.features import Features, FeatureTable, Prediction
    from graspsense.core.values.reasons import TreeNode
    from graspsense.core.values.trace import Trace

ConfigT = TypeVar("ConfigT")


@frozen(kw_only=True)
class ObjectKind:
    """A kind of object that a simulated gripper can grasp.

    Its full names are `name:state` for each of `states`, or `name` alone if it has no states. With `default` it
    belongs to the set of objects that trials are simulated with if the user names none. `fitted_to` names the published
    results that figures of its model were fitted to, `gives` the claims that figures of it give by themselves.
    """

    name: str
    states: tuple[str, ...] = ()
    default: bool = False
    fitted_to: frozenset[str] = frozenset()
    gives: frozenset[str] = frozenset()

    @property
    def full_names(self) -> tuple[str, ...]:
        """The names of this kind in each of its states."""
        return tuple(f"{self.name}:{state}" for state in self.states) or (self.name,)


class Viewer(Protocol):
    """Who wants to see a grasp: how many pictures a second of the gripper (0: none), and whether in a window too."""

    frames_hz: float
    window: bool

    def picture(self, image: Any) -> None:
        """Receive a picture, an array of rows x columns x 3 values from 0 to 255. It must not block."""


class SensorBackend(ABC, Generic[ConfigT]):
    """A gripper with its sensors, real, simulated, emulated or recorded.

    The methods are called in the order `expect` (optional), `open`, `read` and `apply` in turn, `close`. The config is
    `self.config`. The class declares its `channels` and what it `accepts`.
    """

    accepts: ClassVar[tuple[str, ...]]
    """The kinds of command that it accepts: any of effort, velocity, position, force."""
    closes_itself: Mapping[str, str] = {}
    """For a gripper that closes by itself to a target, with a speed and a force: what each kind of command becomes.

    `{"position": "the target, with its speed and force", "force": "the closed position, with this force at 20 mm/s"}`
    names every kind that it accepts. An effort has no speed, so such a gripper accepts none. `run` shows it."""
    least_force_n: float = 0.0
    """The least force (N) with which it can squeeze, whatever it is commanded; 0 if there is none."""
    least_speed_m_s: float = 0.0
    """The least speed (m/s) of the gap at which it can move; 0 if there is none."""
    least_step_m: float = 0.0
    """The least change of the gap (m) that it can be commanded; 0 if there is none."""
    command_delay_s: float = 0.0
    """The longest time (s) from a command to the first motion or force that follows from it; 0 if it is not known."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The channels that `read` delivers, each with its unit and rate.

        A class attribute where they are always the same: `channels = (Channel("gap", "m", 100.0),)`. A property of
        `self.config` where they depend on the settings, for example on which fingers are mounted. They are read before
        the gripper is opened, so a property opens nothing.
        """
        raise NotImplementedError(f"{type(self).__name__} does not declare `channels`")

    def __init__(self, config: ConfigT) -> None:
        self.config = config

    def objects(self) -> Sequence[ObjectKind]:
        """Return the kinds of object that this backend can simulate; empty if it grasps real objects.

        A gripper that is opened as `simulated` has at least one: `collect` tells it by `with_object` what to hold.

        `ObjectKind(name="foam", states=("dry", "wet"), default=True)` stands for `foam:dry` and `foam:wet`; without
        `states`, for `foam`. Simulated trials for which the user names no objects are of the kinds with `default`.
        """
        return ()

    def with_object(self, name: str) -> SensorBackend[ConfigT]:
        """Return a backend with the same config, but with this object between its fingers.

        `name` is a full name of `objects()`, or any other name that the backend knows. A name that it does not know
        raises UnknownName, at the latest in `open`. Raises ConfigError if the backend cannot be given an object.

        Simulated and collected trials append the number of an instance, as in `foam:dry#2`: a backend whose objects
        do not differ ignores what follows `#`. Usually `return type(self)(attrs.evolve(self.config, object=name))`.
        Declare the key that holds the object with `setting(..., effect=NAMES_INPUT)`. A model that was trained with
        several objects would otherwise warn that another one is grasped.
        """
        raise ConfigError(
            f"{type(self).__name__} grasps real objects, so it cannot be given the object {name!r}. "
            "Choose a simulated gripper, as in gripper.type = 'sim'"
        )

    def expect(self, controller: Controller[Any], run: RunConfig) -> None:
        """Announce, before `open`, the controller and the settings of the next grasp.

        A simulator selects its model by them; a real gripper ignores them. Nothing is opened.
        """
        del controller, run

    def expect_features(self, feature_set: FeatureSet[Any]) -> None:
        """Announce, before `open` or a batch, the feature set that extracts from the next grasps.

        A simulator verifies that these features are as accurate as it was asked to be; a real gripper ignores it.
        """
        del feature_set

    def see(self, viewer: Viewer) -> None:
        """Announce, before `open`, that the next grasp is to be seen, for a gripper that has a picture of itself.

        Raises ConfigError if there is no picture, with what is missing for it.
        """
        del viewer
        raise ConfigError(
            "this gripper has no picture of its grasps. --plot draws the measured forces of any gripper"
        )

    @abstractmethod
    def open(self, seed: int) -> DeviceInfo:
        """Open the gripper in a bounded time, without user interaction, and describe it.

        `seed` determines everything that the backend draws at random; a real gripper ignores it. Raises NoDevice if the
        gripper is not connected; the message says what was searched for and what to try.
        """

    @abstractmethod
    def read(self, timeout_s: float) -> Reading | None:
        """Return the next frame with the last cell image, or None if none came within `timeout_s`.

        With a device clock it waits for the next frame. A gripper that has to be asked is asked at multiples of the
        period of `rate_hz`, so that the duration of an exchange does not lower the rate.

        Raises DeviceLost if the gripper no longer responds, RecordingEnded after the last recorded frame.
        """

    @abstractmethod
    def apply(self, command: Command) -> None:
        """Apply this command until the next one. Raises DeviceLost.

        The guard has limited the command. With a device clock, it limits effort and speed to `run.first_effort_n` and
        `run.first_speed_m_s` (by default 12 N and 15 mm/s) until a pad touches, so a fast approach needs larger ones.
        """

    def tare(self, images: Sequence[Pads]) -> None:
        """Set the zero of the pads from these cell images, taken with nothing touching. Raises TareRefused.

        By default nothing is done, for a gripper whose forces have a zero.
        """
        del images

    @abstractmethod
    def close(self) -> None:
        """Make the gripper safe and release the device, in a bounded time. May be called in any state, and twice."""

    def report(self) -> Mapping[str, float | int | str | bool]:
        """Return counters, and values that the frames do not contain (a simulator knows the true force).

        A simulator names under `not_verified` the quantities and features (a list) whose accuracy it does not guarantee
        in this grasp, and under `unstable_loop` why the loop of controller and fingers is unstable. `run`, `train`,
        `evaluate` and experiments print both.
        """
        return {}

    def recorded_commands(self) -> Sequence[float] | None:
        """Return the value that was commanded after each frame, for a recording that knows them; otherwise None.

        A trace then holds these values, since what a controller commands has no effect on a recording.
        """
        return None

    def dry_run_backend(self) -> SensorBackend[Any] | None:
        """Return an emulated gripper that takes the same commands, for a dry run; None if there is none.

        Usually `return type(self)(attrs.evolve(self.config, host="fake"))`, or whichever setting emulates it.
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
    """Settings of a simulated gripper with a certain trade-off between accuracy and time.

    `settings` are keys of the gripper's own table. Variants of one `method` and `fidelity` form a curve, on which
    `step` names the point. The `role` is `reference` for the variant that errors are measured against. Recognition is
    measured for the reference and for the variants that are `for_recognition`.
    """

    method: str
    fidelity: str
    step: str
    settings: Mapping[str, Any]
    role: Literal["curve", "reference"] = "curve"
    for_recognition: bool = False


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
    """A backend that can run many grasps at once."""

    ideal_sensors: Mapping[str, Any] = {}
    """The settings that make its sensors ideal, as `{"sensor": "ideal"}`; empty if there are none."""

    def variants(self) -> Sequence[SimulationVariant]:
        """Return the variants that trade accuracy for time; empty if there are none."""
        return ()

    @abstractmethod
    def run_many(
        self,
        controller: Controller[Any],
        scenes: Sequence[str],
        seeds: Sequence[int],
        **options: Unpack[BatchOptions],
    ) -> Sequence[Grasped]:
        """Run a grasp of each scene with its seed under this controller, and return the results in the same order.

        A seed gives the same trace as `read` and `apply` under the runner, up to rounding. Raises ValueError if seeds
        and scenes differ in number, and UnknownName or ConfigError for a scene before any grasp is run.
        """


class ControllerState(Protocol):
    """The fields that the state of every controller must have.

    A controller that tells events also has a field `events: int`: bit i is 1 in a tick in which the i-th of
    `Controller.events` happened. It holds for that tick only, so a later tick sets it to 0 again.
    """

    @property
    def phase(self) -> int:
        """`APPROACH`, `SQUEEZE` or `HOLD`."""

    @property
    def outcome(self) -> int:
        """`RUNNING` until the controller ends the grasp, then the number of an `Outcome`."""


def _copy(function: FunctionType) -> FunctionType:
    same = FunctionType(
        function.__code__,
        function.__globals__,
        function.__name__,
        function.__defaults__,
        function.__closure__,
    )
    same.__kwdefaults__ = function.__kwdefaults__
    update_wrapper(same, function)
    del same.__wrapped__  # type: ignore[attr-defined]
    return same


def _mark(cls: type, method: str, name: str, value: Any) -> None:
    """Set an attribute of a method of this class; of a copy, if the method is inherited from a class without it."""
    function = getattr(cls, method)
    if not isinstance(function, FunctionType):
        return
    if method not in vars(cls):
        function = _copy(function)
        setattr(cls, method, staticmethod(function) if method == "step" else function)
    setattr(function, name, value)


class Controller(ABC, Generic[ConfigT]):
    """A control law: a pure step function of named tuples of numbers.

    Write `step` as a module function and assign it: `step = staticmethod(step)`. It must not use a clock, input, output
    or objects, and must stay within the subset of Python that numba compiles. The same function then drives a gripper,
    runs in a debugger, and is compiled together with a simulated plant. The class declares what it `requires` and its
    `commands`. It may declare `free_motion`, by which a simulated grasp takes less time.
    """

    requires: ClassVar[tuple[Channel, ...]]
    """The channels that `step` reads, each with the least rate that it needs (0: any rate)."""
    commands: ClassVar[tuple[str, ...]]
    """The kinds of command that `step` may return: any of effort, velocity, position, force."""
    alternatives: ClassVar[tuple[str, ...]] = ()
    """The kinds that it can send instead, each alone; the key `sends` of its config then names one kind."""
    becomes: ClassVar[Mapping[str, str]] = {}
    """What the law does with a gripper that closes by itself, for each kind that it can send there. `run` shows it."""
    events: ClassVar[tuple[str, ...]] = ()
    """The names of the events that it tells by the field `events` of its state: `("contact", "slip")`."""
    free_motion: ClassVar[FreeMotion | None] = None
    """What `step` does while only position and speed of the fingers change, by which a simulator is faster.

    It belongs to the `step` that the class has: a subclass with another `step` declares its own, or has none."""

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        # What composes a tick has the function alone, so the function carries what is declared about it.
        if cls.events and not getattr(cls.step, "tells_events", False):
            _mark(cls, "step", "tells_events", True)
        if "free_motion" in vars(cls) and getattr(cls.step, "free_motion", None) is not cls.free_motion:
            _mark(cls, "step", "free_motion", cls.free_motion)

    def __init__(self, config: ConfigT) -> None:
        self.config = config

    @staticmethod
    @abstractmethod
    def step(params: Any, state: Any, reading: Reading) -> tuple[Command, Any]:
        """Return the command for this tick, and the state after it."""

    def asked_force_n(self) -> float | None:
        """Return the greatest force (N) on each finger that this law asks for; None if it asks for none.

        The effort of a real gripper stays below it, plus a margin and the friction of the drive, whatever `step`
        commands (`run.effort_ceiling_n`). A law that squeezes with a force returns that force. A gripper that cannot
        squeeze as gently (`gentlest_force_n`) is refused before it is opened.
        """
        return None

    def gentlest_force_n(self) -> float | None:
        """Return the least force (N) on each finger that this law asks for; by default `asked_force_n`."""
        return self.asked_force_n()

    def asked_speed_m_s(self) -> float | None:
        """Return the least speed (m/s) of the gap at which this law closes the fingers; None if it asks for none.

        A gripper that cannot move as slowly is refused before it is opened.
        """
        return None

    def asked_step_m(self) -> float | None:
        """Return the least change of the gap (m) that this law commands by a position; None if it commands none.

        A gripper that cannot carry out so small a step is refused before it is opened.
        """
        return None

    def asked_interval_s(self) -> float | None:
        """Return the time (s) for which this law waits for a command to act; None if it waits for none.

        A gripper that takes longer is refused before it is opened.
        """
        return None

    def contact_force_n(self) -> float:
        """Return the force (N) on a pad from which on this law takes it to touch the object."""
        return CONTACT_FORCE_N

    def params(self) -> Any:
        """Return the parameters of `step`, a named tuple of floats and integers.

        By default these are the numbers of the config, under the names that they have there, and for a law with several
        kinds of command the number of the kind that `sends` names.
        """
        return params_of(self.config)

    @abstractmethod
    def init(self) -> ControllerState:
        """Return the state before the first tick."""

    def reason(self, state: Any) -> str:
        """Return why a grasp ended as it did, where the outcome of its last state does not say it."""
        del state
        return ""


class FeatureSet(ABC, Generic[ConfigT]):
    """Extracts features from a trace. The class declares what it `requires`, and its `features`.

    It may declare `compiled`, by which a batch of simulated grasps takes less time.
    """

    requires: ClassVar[tuple[Channel, ...]]
    """The channels that `extract` reads."""
    features: ClassVar[tuple[Feature, ...]]
    """The features with their units and meanings, in the order in which they are returned."""
    compiled: ClassVar[CompiledFeatures | None] = None
    """The same features in a form that a simulator compiles (`compiled_features.CompiledFeatures`).

    It belongs to the `extract` that the class has: a subclass with another `extract` declares its own, or has none."""

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        # A batch has the method alone, so the method carries what is declared about it.
        if "compiled" in vars(cls):
            _mark(cls, "extract", "compiled", cls.compiled)

    def __init__(self, config: ConfigT) -> None:
        self.config = config

    @abstractmethod
    def extract(self, trace: Trace) -> Features:
        """Return the features of this trace. Any trace is allowed: an undefined feature is NaN with a reason."""

    @cached_property
    def _declared_units(self) -> tuple[str, ...]:
        return tuple(feature.unit for feature in self.features)

    def units_in(self, units_of: Mapping[str, str]) -> tuple[str, ...]:
        """Return the declared units as those of a trace with the units `units_of`, which can count time in frames."""
        from graspsense.core.values.features import units_in

        return units_in(units_of["t"], units_of["gap"], units_of["force_left"], self._declared_units)

    def result(
        self,
        values: Mapping[str, float],
        reasons: Mapping[str, str] | None = None,
        units_of: Mapping[str, str] | None = None,
    ) -> Features:
        """Return the declared features with these values, for `extract` to return.

        A feature without a value is NaN, and `reasons` says why. `units_of` are the units of the trace, which can count
        time in frames; not given, the declared units hold. Raises ValueError for a name that the class does not
        declare, for what is no number or infinite, and for a NaN without a reason.
        """
        from graspsense.core.values.features import Features

        names = tuple(feature.name for feature in self.features)
        units = self._declared_units if units_of is None else self.units_in(units_of)
        for name in values.keys() - set(names):
            raise ValueError(f"{type(self).__name__} declares no feature {name!r}; it has {', '.join(names)}")
        numbers = []
        try:
            for name in names:
                numbers.append(float(values.get(name, nan)))
        except (TypeError, ValueError) as error:
            kind = type(values[name]).__name__
            raise ValueError(f"feature {name!r} is of type {kind}: give one number") from error
        return Features(names=names, values=tuple(numbers), units=units, reasons=dict(reasons or {}))

    def undefined(self, reason: str, units_of: Mapping[str, str] | None = None) -> Features:
        """Return the declared features, all of them NaN for this reason; `units_of` is as in `result`."""
        return self.result({}, {feature.name: reason for feature in self.features}, units_of)


@frozen(kw_only=True)
class ClassifierConfig:
    """The settings of every classifier; the config class of a classifier extends this one."""

    model: str | None = setting(
        default=None,
        effect=NAMES_INPUT,
        meaning="The trained model: the name of a model that a plugin ships, or a .json file.",
    )


class Classifier(ABC, Generic[ConfigT]):
    """Learns labels from a table of features, and explains its predictions.

    NaN in a table is a missing value, which every classifier must handle. Classifiers do not answer `unknown`:
    `graspsense.core.learn.novelty` decides this by the same rule for all of them.
    """

    def __init__(self, config: ConfigT) -> None:
        self.config = config

    @abstractmethod
    def fit(self, table: FeatureTable, labels: Sequence[str], seed: int) -> None:
        """Fit the model to these trials. The same table, labels and seed give the same model.

        Raises ValueError if nothing can be learned from them.
        """

    @abstractmethod
    def classes(self) -> tuple[str, ...]:
        """Return the labels that it can predict, in the order of the columns of `probabilities`."""

    @abstractmethod
    def probabilities(self, table: FeatureTable) -> NDArray[np.float64]:
        """Return the probability of each class for each trial, shape (trials, classes); each row sums to 1.

        The features may be in another order than in `fit`: `table.columns(names)` finds them by their names.
        """

    def support(self, table: FeatureTable) -> NDArray[np.float64] | None:
        """Return the number of training trials that each answer rests on, as in the leaf of a tree, shape (trials,).

        NaN is a trial without such a number; None if there is none for any. Answers with the same probability are
        calibrated separately by it, so it is useful only where it differs between trials.
        """
        del table
        return None

    @abstractmethod
    def explain(self, features: Features) -> Prediction:
        """Return the prediction for one trial, with the reason in words and units."""

    def tree(self) -> Sequence[TreeNode] | None:
        """Return the nodes of the fitted model, the root first, if it is a decision tree; else None."""
        return None

    @abstractmethod
    def to_json(self) -> dict[str, Any]:
        """Return the fitted model as values that JSON represents exactly."""

    @abstractmethod
    def from_json(self, model: Mapping[str, Any]) -> None:
        """Load a model that `to_json` returned. Nothing that the model names may be executed or imported.

        Raises KeyError, TypeError, ValueError or DataDamaged if the values are not such a model. A model file comes
        from anywhere: `StoredValues` checks types, ranges and sizes before anything is made of them.
        """
