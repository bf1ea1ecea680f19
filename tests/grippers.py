"""Small grippers with known behaviour, for tests of the runner and of the laws."""

from itertools import count
from math import inf

from attrs import evolve

from graspsense.core.components.registry import installed
from graspsense.core.components.roles import SensorBackend
from graspsense.core.settings.resolved import resolve
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import DeviceLost
from graspsense.core.values.signals import EFFORT, Command, Frame, Pads, Reading
from graspsense.plugins.controllers.hybrid import HybridConfig, HybridController
from graspsense.testing.model_gripper import CELLS, OPEN_M


class Scripted(SensorBackend):
    """A gripper whose fingers go where `path(t)` says from the approach on, with the forces `felt(t)` gives.

    From there they open at 50 mm/s when they are told to, and feel nothing any more.

    It keeps every command with the phase-free facts a test wants: what was asked for, in which order.
    """

    def __init__(self, path, felt, clock="virtual", frames=10**6, lose_at=None, silent_from=None):
        super().__init__(None)
        self.path, self.felt, self.clock = path, felt, clock
        self.lose_at, self.silent_from = lose_at, silent_from
        self.commands, self.tares, self.closed, self.opened = [], [], 0, 0
        self.k = -1
        self.closes, self.opens_from_s = False, inf

    def open(self, seed):
        self.opened += 1
        return DeviceInfo(
            name="scripted",
            clock=self.clock,
            rate_hz=1000.0,
            effort_limit_n=100.0,
            speed_limit_m_s=0.2,
            opening=Command(EFFORT, -20.0, inf, inf),
            relaxed=Command(EFFORT, 0.0, inf, inf),
            tare_images=3,
        )

    def read(self, timeout_s):
        self.k += 1
        if self.lose_at is not None and self.k >= self.lose_at:
            raise DeviceLost("unplugged")
        if self.silent_from is not None and self.k >= self.silent_from:
            return None
        t = self.k * 0.001
        left, right = self.felt(t) if t < self.opens_from_s + 0.02 else (0.0, 0.0)
        cells = (3000.0,) * CELLS
        return Reading(
            Frame(t, 0.001, self.gap_m(t), 0.0, 0.0, left, right, 0.0, 0.0, 0),
            Pads(t, 1 + self.k // 41, cells, cells),
        )

    def gap_m(self, t):
        opened_m = 0.05 * max(t - self.opens_from_s, 0.0)
        return self.path(t) if opened_m == 0.0 else max(self.path(t), min(self.path(t) + opened_m, OPEN_M))

    def apply(self, command):
        self.commands.append(command)
        is_effort = command.kind == EFFORT
        self.closes = self.closes or (is_effort and command.value > 0.0)
        if self.closes and is_effort and command.value < 0.0:
            self.opens_from_s = min(self.opens_from_s, self.k * 0.001)

    def tare(self, images):
        self.tares.append(list(images))

    def close(self):
        self.closed += 1


# With Scripted: 0.1 s to see that the gripper is open, then three images of 41 ms: the approach begins near 0.23 s.
CONTACT_S, REST_S = 1.0, 1.5


def squeezing(t):
    """A gap that closes at 20 mm/s, squeezes by 6 mm from CONTACT_S to REST_S, then rests."""
    if t < 0.3:
        return 0.074
    if t < CONTACT_S:
        return 0.074 - 0.02 * (t - 0.3)
    return 0.06 - 0.006 * min((t - CONTACT_S) / (REST_S - CONTACT_S), 1.0)


def bottle(t):
    """Forces that go with `squeezing`."""
    force = 0.0 if t < CONTACT_S else 1.0 + 7.0 * min((t - CONTACT_S) / (REST_S - CONTACT_S), 1.0)
    return force, force


def law(act, after):
    """The hybrid law; from its `after`-th step on, `act(command, state)` says what it returns."""
    calls = count(1)

    def step(params, state, reading):
        command, state = HybridController.step(params, state, reading)
        return act(command, state) if next(calls) >= after else (command, state)

    return type("Faulty", (HybridController,), {"step": staticmethod(step)})(HybridConfig())


def settings_with(create, *options, classifier="none"):
    """Return the settings of the pipeline `default` whose gripper this function creates, with this classifier."""
    settings = resolve("default", plugins=installed(), options=[f"classifier.type={classifier}", *options])

    class Choice(type(settings.gripper)):
        def create(self):
            return create()

    return evolve(settings, gripper=Choice(settings.gripper.component, settings.gripper.config))
