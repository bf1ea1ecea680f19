"""The reference against the differential equations of a grasp, written down once more and integrated by SciPy.

Nothing of the simulator is called in the equations: they have the numbers of its scenes. They differ from it in form:
the motion is that of the gap, with a mass that depends on the gap, where the simulator integrates the motor's angle;
the compression and the states of the terms are ordinary states, where the simulator searches a balance of forces and
uses the exact solution of each term; contact, separation, stopping, slipping and each change of a law are events of
`solve_ivp`. The fingers start near the object at a set speed, squeeze it with one effort, with a larger one, and are
then opened by a negative one.
"""

import cmath
import math
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import scipy
from unverified import unverified_setup

from graspsense.gripper_api import gap_and_rate, revolutions_at
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.state import Motion
from graspsense_sim_gripper.run.compiled.compose import composed_move, composition
from graspsense_sim_gripper.scene.spec import ObjectSpec
from graspsense_sim_gripper.scene.terms.registry import TERMS

TICK_S = 1e-3
PEAK_S = 2e-5
"""How far apart the largest force is looked for."""
WIDTH_M = 0.05
SPEED_M_S = 0.02
START_M = 3.1e-4
"""The fingers start this far from the object, so that they touch it within a tick."""
EFFORTS = ((23.0, 80), (45.0, 40), (-90.0, 150))
"""Efforts (N), and for how many ticks each is held."""

# ------------------------------------------------------------------------------------------------- the terms
#
# A term has states s, a force f(d, r, s) at the compression d with the rate r, the rates of its states, and the rate of
# its force where the force does not depend on r. `part` tells which part of its law holds; `changes` gives functions
# that become positive where another part begins, with that part. `up` is False where the object is being released.


class Term:
    states = ()
    damps = False
    first_part = 0

    def __init__(self, values):
        self.__dict__.update(values)

    def part(self, d, now):
        return now

    def changes(self, d, s, part):
        return []

    def rates(self, d, r, s, part, up):
        return ()

    def force_rate(self, d, r, s, part, up):
        """Return the rate of the force along the motion, by a central difference of 0.1 us."""
        rates = self.rates(d, r, s, part, up)
        ahead, behind = (
            self.force(d + h * r, r, [y + h * rate for y, rate in zip(s, rates, strict=True)], part)
            for h in (1e-7, -1e-7)
        )
        return (ahead - behind) / 2e-7

    def jumped(self, d0, d1, s):
        """Return the states after a sudden change of the compression."""
        return s


class Elastic(Term):
    def force(self, d, r, s, part):
        return self.k1_n_m * d + self.k3_n_m3 * d**3


class Rigid(Term):
    """Hertz, until the force exceeds the crush force; then a spring."""

    def force(self, d, r, s, part):
        return self.broken_n_m * d if part else self.hertz_n_m15 * math.copysign(abs(d) ** 1.5, d)

    def changes(self, d, s, part):
        return [] if part else [(self.force(d, 0.0, s, 0) - self.crush_force_n, 1)]


class Maxwell(Term):
    states = (0.0,)

    def force(self, d, r, s, part):
        return s[0]

    def rates(self, d, r, s, part, up):
        return (self.k_n_m * r - s[0] / self.tau_s,)

    def jumped(self, d0, d1, s):
        return [s[0] + self.k_n_m * (d1 - d0)]


class Gas(Term):
    """Mass n and energy of an ideal gas behind a wall that bulges: the states are the pressure rise and T/T_wall.

    Mass: n'/n = -q/V. Energy: T'/T = -(g - 1) (V' + q)/V - (1 - 1/T)/tau. Wall: V' = -A d' + C p'. Gas law: p V ~ n T.
    """

    states = (0.0, 1.0)

    def area(self, d):
        return self.area_m2 + self.area_slope_m * d

    def force(self, d, r, s, part):
        return self.area(d) * s[0]

    def flow(self, rise):
        """Return the flow through the vent: rise = R q + B q |q|, with R = 2 sqrt(B * 1 Pa)."""
        if self.vent_m2 == 0.0:
            return 0.0
        inertial = 0.5 * 1.2 / (0.6 * self.vent_m2) ** 2
        viscous = 2.0 * math.sqrt(inertial)
        size = (-viscous + math.sqrt(viscous**2 + 4.0 * inertial * abs(rise))) / (2.0 * inertial)
        return math.copysign(size, rise)

    def rates(self, d, r, s, part, up):
        rise, warm = s
        pressure, flow, area = self.pressure_pa + rise, self.flow(rise), self.area(d)
        swept = self.area_m2 * d + 0.5 * self.area_slope_m * d**2
        volume = self.volume_m3 - swept + self.bulge_m3_pa * rise
        cooling = 0.0 if self.heat_s == math.inf else (1.0 - 1.0 / warm) / self.heat_s
        # p'/p = -q/V + T'/T - V'/V is linear in p', and T' and V' follow from it.
        by_volume = self.exponent / volume
        pressing = by_volume * (area * r - flow) - cooling
        rising = pressing / (1.0 / pressure + by_volume * self.bulge_m3_pa)
        growing = -area * r + self.bulge_m3_pa * rising
        warming = 0.0
        if self.heat_s < math.inf:
            warming = -warm * ((self.exponent - 1.0) * (growing + flow) / volume + cooling)
        return rising, warming


class Loss(Term):
    damps = True

    def force(self, d, r, s, part):
        return self.damping_n_s_m * r


class Foam(Term):
    states = (0.0, 0.0)

    def force(self, d, r, s, part):
        return self.force_n * (max(d, 0.0) / self.at_m) ** self.exponent + s[0] + s[1]

    def rates(self, d, r, s, part, up):
        return self.arm1_n_m * r - s[0] / self.tau1_s, self.arm2_n_m * r - s[1] / self.tau2_s

    def jumped(self, d0, d1, s):
        return [s[0] + self.arm1_n_m * (d1 - d0), s[1] + self.arm2_n_m * (d1 - d0)]


class Snap(Term):
    """Rising, falling and rising again."""

    def part(self, d, now):
        return 0 if d <= self.critical_m else 1 if d < self.critical_m + self.fall_m else 2

    def force(self, d, r, s, part):
        end = self.critical_m + self.fall_m
        known = (0.0, self.critical_m, end, end + 1.0)
        top = self.k1_n_m * self.critical_m
        if d <= 0.0:
            return self.k1_n_m * d
        return float(np.interp(d, known, (0.0, top, top - self.drop_n, top - self.drop_n + self.k2_n_m)))

    def force_rate(self, d, r, s, part, up):
        return (self.k1_n_m, -self.drop_n / self.fall_m, self.k2_n_m)[part] * r

    def changes(self, d, s, part):
        end = self.critical_m + self.fall_m
        onward = [(d - (self.critical_m, end, math.inf)[part], part + 1)]
        return [*onward, ((math.inf, self.critical_m, end)[part] - d, part - 1)] if part else onward


class Worn(Term):
    """Damage 1 - exp(-W/w) of all work W; in this grasp, work is done while the shell is pressed in."""

    states = (0.0,)

    def damage(self, work):
        return 1.0 - math.exp(-(self.earlier_j + work) / self.wear_j)

    def force(self, d, r, s, part):
        e = d - self.set_m * (self.damage(s[0]) - self.damage(0.0))
        return (1.0 - self.softening * self.damage(s[0])) * (self.k1_n_m * e + self.k3_n_m3 * e**3)

    def rates(self, d, r, s, part, up):
        return (self.force(d, r, s, part) * r if up else 0.0,)

    def dent(self):
        return self.set_m * self.damage(0.0)


class Mass(Term):
    """A mass on a spring and a damper, that `pull` of the compression drives."""

    states = (0.0, 0.0)


class Surface(Mass):
    first_part = 1

    def pull(self, d, s, part):
        return self.contact_n_m * (d - s[0]) if part else 0.0

    def force(self, d, r, s, part):
        return self.pull(d, s, part)

    def rates(self, d, r, s, part, up):
        mine = self.pull(d, s, part) - self.k_n_m * s[0] - self.damping_n_s_m * s[1]
        return s[1], mine / self.mass_kg

    def changes(self, d, s, part):
        return [(s[0] - d, 0)] if part else [(d - s[0], 1)]


class Liquid(Mass):
    """A column of length L in a neck A_n, driven by the pressure that the wall of the stiffness A^2/C gives."""

    def pull(self, d, s):
        return self.area_m2**2 / self.bulge_m3_pa * (d - s[0])

    def force(self, d, r, s, part):
        return self.pull(d, s)

    def rates(self, d, r, s, part, up):
        # y is the compression whose volume A y stands in the neck: x = A y / A_n, and p A_n = rho L A_n x'' + ...
        pressure, rise, speed = self.pull(d, s) / self.area_m2, *(self.area_m2 / self.neck_m2 * y for y in s)
        weight = self.density_kg_m3 * 9.80665 * rise
        viscous = 8.0 * math.pi * self.viscosity_pa_s * self.column_m * speed / self.neck_m2
        moving = (pressure - weight - viscous) / (self.density_kg_m3 * self.column_m)
        return s[1], moving * self.neck_m2 / self.area_m2


class Slosh(Mass):
    @property
    def damps(self):
        return self.damping_ratio > 0.0

    def force(self, d, r, s, part):
        w = 2.0 * math.pi * self.frequency_hz
        return self.mass_kg * (w**2 * (d - s[0]) + 2.0 * self.damping_ratio * w * (r - s[1]))

    def rates(self, d, r, s, part, up):
        return s[1], self.force(d, r, s, part) / self.mass_kg


EQUATIONS = {kind.__name__.lower(): kind for kind in (*Term.__subclasses__(), *Mass.__subclasses__())}

# ------------------------------------------------------------------------------------------- pads and object


class Half:
    """The object between the pads: all of it, or the half at one finger of an object that is held.

    Its states are the compression d, the compression x of the pads, the force a of their creeping branch, and the
    states of the terms. It is `apart`, `pressed` or `released`.
    """

    def __init__(self, terms, pads, shift_m):
        self.terms, self.shift_m = terms, shift_m
        self.k, self.c, self.branch, self.tau = pads
        self.damps = self.c > 0.0 or any(term.damps for term in terms)
        self.mode, self.parts = "apart", [term.first_part for term in terms]

    def start(self):
        return [0.0, 0.0, 0.0, *(value for term in self.terms for value in term.states)]

    def split(self, s):
        begin, groups = 3, []
        for term in self.terms:
            groups.append(s[begin : begin + len(term.states)])
            begin += len(term.states)
        return groups

    def force(self, d, r, groups):
        return sum(t.force(d, r, g, p) for t, g, p in zip(self.terms, groups, self.parts, strict=True))

    def force_rate(self, d, r, groups, up):
        triples = zip(self.terms, groups, self.parts, strict=True)
        return sum(t.force_rate(d, r, g, p, up) for t, g, p in triples)

    def rate(self, s, closure, closing):
        """Return the rate of the compression, and whether the object is being pressed in."""
        d, _, a = s[:3]
        groups = self.split(s)
        if self.mode == "pressed" and self.k == math.inf:
            return closing, closing > 0.0

        def miss(r, up):
            """Return what has to vanish: the balance of forces, or its derivative where nothing damps."""
            if self.damps and self.mode == "pressed":
                return self.force(d, r, groups) - self.k * (closure - d) - self.c * (closing - r) - a
            if self.mode == "pressed":
                pads = (self.k + self.branch) * (closing - r) - a / self.tau
                return self.force_rate(d, r, groups, up) - pads
            if any(term.damps for term in self.terms):
                return self.force(d, r, groups)
            return self.force_rate(d, r, groups, up)

        for up in (True, False):
            at0, at1 = miss(0.0, up), miss(1.0, up)
            r = -at0 / (at1 - at0) if at1 != at0 else 0.0
            if (r > 0.0) == up:
                return r, up
        return 0.0, False

    def pad_n(self, s, closure, closing):
        """Return the force on the pads."""
        if self.mode != "pressed":
            return 0.0
        r, _ = self.rate(s, closure, closing)
        return self.force(closure if self.k == math.inf else s[0], r, self.split(s))

    def slope(self, s, closure, closing):
        """Return the rates of all states."""
        if self.mode == "apart":
            return [0.0] * len(s)
        r, up = self.rate(s, closure, closing)
        triples = zip(self.terms, self.split(s), self.parts, strict=True)
        mine = [value for t, g, p in triples for value in t.rates(s[0], r, g, p, up)]
        if self.k == math.inf:
            return [r, 0.0, 0.0, *mine]
        if self.mode == "pressed":
            xr = closing - r
        elif self.c > 0.0:
            xr = -(self.k * s[1] + s[2]) / self.c
        else:
            xr = s[2] / self.tau / (self.k + self.branch)
        return [r, xr, self.branch * xr - s[2] / self.tau, *mine]

    def events(self, s, closure, closing):
        """Return the functions that become positive at an event, each with what then happens."""
        if self.mode == "apart":
            return [(closure, "pressed")]
        crossings = [(closure - s[0] - s[1], "pressed")]
        if self.mode == "pressed":
            # Below zero, since a surface that has left the pads exerts no force at all.
            crossings = [(-self.pad_n(s, closure, closing) - 1e-10, "released")]
        for i, (term, group) in enumerate(zip(self.terms, self.split(s), strict=True)):
            crossings += [(value, (i, part)) for value, part in term.changes(s[0], group, self.parts[i])]
        return crossings

    def happen(self, what, s, closure):
        """Return the states after an event. Without a damper the compression may jump."""
        s = list(s)
        if isinstance(what, str):
            self.mode = what
            return s
        self.parts[what[0]] = what[1]
        if self.mode != "pressed" or self.k == math.inf or self.damps:
            return s
        groups = self.split(s)

        def miss(d):
            parts = [t.part(d, p) for t, p in zip(self.terms, self.parts, strict=True)]
            moved = [t.jumped(s[0], d, g) for t, g in zip(self.terms, groups, strict=True)]
            force = sum(t.force(d, 0.0, g, p) for t, g, p in zip(self.terms, moved, parts, strict=True))
            return force - self.k * (closure - d) - s[2] + self.branch * (d - s[0])

        step = 1e-9
        sides = [miss(s[0] + step), miss(s[0] - step)]
        if sides[0] > 0.0 and sides[1] < 0.0:
            return s
        way = 1.0 if sides[0] < 0.0 else -1.0
        near = s[0] + way * step
        while miss(near) * way < 0.0:
            near += way * 1e-6
        d = scipy.optimize.brentq(miss, near - way * 1e-6, near, xtol=1e-17)
        moved = [v for t, g in zip(self.terms, groups, strict=True) for v in t.jumped(s[0], d, g)]
        self.parts = [t.part(d, p) for t, p in zip(self.terms, self.parts, strict=True)]
        return [d, closure - d, s[2] - self.branch * (d - s[0]), *moved]


# ----------------------------------------------------------------------------------------------- the gripper


class Straight:
    """Jaws on a screw."""

    pitch_m, mass_kg = 4e-4, 100.0

    def gap(self, turns):
        return self.pitch_m * turns

    def mass(self, turns):
        """Return the moving mass and its derivative by the gap."""
        return self.mass_kg, 0.0

    def turns(self, gap):
        return gap / self.pitch_m

    def jacobian(self, turns):
        return self.pitch_m


class Pr2:
    """A screw of the length L0 + s n is a side of the triangle a, b; the opposite angle turns the fingers r."""

    per_turn = 4e-3 / ((729.0 / 25.0) * (22.0 / 16.0))
    l0, a, b, r = 37.5528e-3, 68.3698e-3, 43.3849e-3, 91.5e-3
    theta0, phi0, t0 = math.radians(3.6029), math.radians(29.7089), -0.1914e-3
    rotor_kg_m2 = 4e-7

    def triangle(self, turns):
        """Return the side, the cosine of the opposite angle, and the angle of the fingers."""
        side = self.l0 + self.per_turn * turns
        u = (self.a**2 + self.b**2 - side**2) / (2.0 * self.a * self.b)
        return side, u, self.theta0 - self.phi0 + cmath.acos(u)

    def gap(self, turns):
        return 2.0 * (self.t0 + self.r * (cmath.sin(self.triangle(turns)[2]) - math.sin(self.theta0)))

    def jacobian(self, turns):
        side, u, theta = self.triangle(turns)
        turned = side * self.per_turn / (self.a * self.b * cmath.sqrt(1.0 - u * u))
        return 2.0 * self.r * cmath.cos(theta) * turned

    def mass(self, turns):
        # The derivative by a complex step.
        g = self.jacobian(turns + 1e-20j)
        inertia, slope = 4.0 * math.pi**2 * self.rotor_kg_m2, g.imag / 1e-20
        return inertia / g.real**2, -2.0 * inertia * slope / g.real**4

    def turns(self, gap):
        theta = math.asin((0.5 * gap - self.t0) / self.r + math.sin(self.theta0))
        angle = theta - self.theta0 + self.phi0
        side = math.sqrt(self.a**2 + self.b**2 - 2.0 * self.a * self.b * math.cos(angle))
        return (side - self.l0) / self.per_turn


class Gripper:
    """The equations of a grasp. The state: turns of the motor, gap, speed of the gap, and the states of each half."""

    def __init__(self, terms, link, friction, pads, lag_s, offset_m, held, table_n):
        self.link, self.offset_m, self.held, self.table_n = link, offset_m, held, table_n
        self.lag_s, self.before_n, self.commanded_n, self.since_s = lag_s, 0.0, 0.0, 0.0
        # A surface may leave the pads for part of a step, which the events would miss.
        self.longest_s = 1e-4 if any(isinstance(term, Surface) for term in terms) else math.inf
        self.coulomb, self.breakaway, self.stribeck, self.by_load, self.damping = friction
        self.width_m = WIDTH_M - max((term.dent() for term in terms if isinstance(term, Worn)), default=0.0)
        shifts = (2.0 * offset_m, -2.0 * offset_m) if held else (0.0,)
        self.halves = [Half(terms, pads, shift) for shift in shifts]
        self.direction, self.table = -1.0, "before" if offset_m and not held else "done"

    def begin(self):
        gap = self.width_m + 2.0 * abs(self.offset_m) + START_M
        return [self.link.turns(gap), gap, -SPEED_M_S, *(v for half in self.halves for v in half.start())]

    def views(self, s):
        """Yield each half with its states and its closure."""
        n = (len(s) - 3) // len(self.halves)
        for i, half in enumerate(self.halves):
            yield half, s[3 + i * n : 3 + (i + 1) * n], self.width_m - s[1] - half.shift_m

    def pads_n(self, s):
        """Return the forces on the left and the right pad."""
        forces = [half.pad_n(mine, closure, -s[2]) for half, mine, closure in self.views(s)]
        left, right = forces if self.held else (forces[0], forces[0])
        if self.table in ("pushing", "against"):
            # The finger that has touched first holds the object against the table.
            if self.offset_m > 0.0:
                right = max(right, self.table_n)
            else:
                left = max(left, self.table_n)
        return left, right

    def resisting(self, velocity, load):
        bump = math.exp(-((velocity / self.stribeck) ** 2))
        return self.coulomb + self.by_load * load + (self.breakaway - self.coulomb) * bump

    def command(self, effort_n, t):
        """Command an effort from this time on; the drive follows it with its lag."""
        self.before_n, self.commanded_n, self.since_s = self.effort(t), effort_n, t

    def effort(self, t):
        if self.lag_s == 0.0:
            return self.commanded_n
        share = math.exp(-(t - self.since_s) / self.lag_s)
        return self.commanded_n + (self.before_n - self.commanded_n) * share

    def slope(self, t, s):
        velocity = s[2] if self.direction else 0.0
        halves = [v for half, mine, closure in self.views(s) for v in half.slope(mine, closure, -velocity)]
        if not self.direction:
            return [0.0, 0.0, 0.0, *halves]
        load = 0.5 * sum(self.pads_n(s))
        resisting = self.direction * self.resisting(velocity, load) + self.damping * velocity
        net = load - self.effort(t) - resisting
        mass, change = self.link.mass(s[0])
        jacobian = self.link.jacobian(s[0]).real
        return [velocity / jacobian, velocity, (net - 0.5 * change * velocity**2) / mass, *halves]

    def settle(self, t, s):
        """Set the direction of fingers that stand."""
        load = 0.5 * sum(self.pads_n(s))
        net = load - self.effort(t)
        held = abs(net) <= self.breakaway + self.by_load * load
        self.direction = 0.0 if held else math.copysign(1.0, net)

    def events(self, t, s):
        crossings = [
            (value, (half, what))
            for half, mine, closure in self.views(s)
            for value, what in half.events(mine, closure, -s[2])
        ]
        load = 0.5 * sum(self.pads_n(s))
        if self.direction:
            crossings.append((-self.direction * s[2], "stop"))
        else:
            crossings.append((abs(load - self.effort(t)) - self.breakaway - self.by_load * load, "slip"))
        if self.table == "before":
            crossings.append((self.width_m + 2.0 * abs(self.offset_m) - s[1], "pushing"))
        elif self.table == "against":
            _, mine, closure = next(self.views(s))
            crossings.append((self.halves[0].pad_n(mine, closure, -s[2]) - self.table_n, "done"))
        return crossings

    def happen(self, what, t, s):
        """Return the state after an event."""
        s = list(s)
        if isinstance(what, tuple):
            n = (len(s) - 3) // len(self.halves)
            i = self.halves.index(what[0])
            closure = self.width_m - s[1] - what[0].shift_m
            s[3 + i * n : 3 + (i + 1) * n] = what[0].happen(what[1], s[3 + i * n : 3 + (i + 1) * n], closure)
            if self.table in ("pushing", "against"):
                # A damper may press harder than the table from the first touch on.
                overcome = what[1] == "released" or self.halves[0].pad_n(s[3:], closure, -s[2]) > self.table_n
                self.table = "done" if overcome else "against"
        elif what == "stop":
            s[2] = 0.0
            self.settle(t, s)
        elif what == "slip":
            self.direction = math.copysign(1.0, 0.5 * sum(self.pads_n(s)) - self.effort(t))
        else:
            self.table = what
        return s

    def follow(self, efforts):
        """Return rows of the gap and the forces on both pads after each tick, and the largest force."""
        s, t, rows, peak = np.array(self.begin()), 0.0, [], 0.0
        for effort, n_ticks in efforts:
            end, ticks = t + n_ticks * TICK_S, len(rows)
            self.command(effort, t)
            if not self.direction:
                self.settle(t, s)
            while end - t > 1e-12:
                run = self.until_event(t, end, s)
                last, s = run.t[-1], run.y[:, -1]
                while (ticks + 1) * TICK_S <= last + 1e-12:
                    ticks += 1
                    now = run.sol(min(ticks * TICK_S, last))
                    rows.append((now[1], *self.pads_n(now)))
                for a, b in pairwise(run.t):
                    moments = np.linspace(a, b, 2 + math.ceil((b - a) / PEAK_S))
                    peak = max(peak, *(max(self.pads_n(now)) for now in run.sol(moments).T))
                if run.status == 1:
                    which = next(i for i, times in enumerate(run.t_events) if len(times))
                    s = self.happen(self.events(last, s)[which][1], last, s)
                t = last
            t = end
        return np.array(rows), peak

    def until_event(self, t, end, s):
        """Return the solution up to the next event or to `end`."""
        events = []
        for i in range(len(self.events(t, s))):
            events.append(lambda t, s, i=i: self.events(t, s)[i][0])
            events[-1].terminal, events[-1].direction = True, 1.0
        how = {"dense_output": True, "rtol": 1e-9, "atol": 1e-12, "max_step": self.longest_s}
        # The first step that is tried after an event may be far too long.
        with np.errstate(over="ignore", invalid="ignore"):
            run = scipy.integrate.solve_ivp(self.slope, (t, end), s, "DOP853", events=events, **how)
        assert run.status >= 0, run.message
        return run


# ------------------------------------------------------------------------------------------------- the scenes


def made(kind, *values, **more):
    """Return a term with these parameters, as a scene has it."""
    return kind, TERMS[kind].params(*values, **more)._asdict()


SHELL = made("elastic", 6e3, 4e7)
SOFT = made("elastic", 2e3, 0.0)
GAS = {"area_m2": 1.2e-3, "area_slope_m": 0.0, "pressure_pa": 101325.0, "exponent": 1.4, "bulge_m3_pa": 5e-11}
OBJECTS = {
    "elastic": [SHELL],
    "rigid": [made("rigid", 2e7)],
    "rigid, breaks": [made("rigid", 5e6, 15.0, 9e3)],
    "maxwell": [SHELL, made("maxwell", 8e3, 0.03)],
    "gas, sealed": [SHELL, made("gas", volume_m3=2e-5, **GAS)],
    "gas, with a vent": [SHELL, made("gas", volume_m3=2e-5, vent_m2=4e-7, **GAS | {"area_slope_m": 0.05})],
    "gas, with heat": [SHELL, made("gas", volume_m3=1e-5, heat_s=0.05, vent_m2=1e-7, **GAS)],
    "loss": [SHELL, made("loss", 900.0)],
    "foam": [made("foam", 20.0, 2e-3, 2.2)],
    "foam, creeping": [made("foam", 12.0, 2e-3, 1.6, arm1_n_m=3e3, tau1_s=0.01, arm2_n_m=2e3, tau2_s=0.2)],
    "snap, gradual": [SOFT, made("snap", 8e3, 8e-4, drop_n=3.0, fall_m=6e-4, k2_n_m=1.2e4)],
    "snap, sudden": [
        made("maxwell", 2e3, 0.05),
        made("snap", 1e4, 8e-4, drop_n=5.0, fall_m=2e-4, k2_n_m=1.2e4),
    ],
    "worn": [made("worn", 8e3, 1e7, wear_j=0.02, softening=0.5, set_m=1e-3)],
    "worn before": [
        made("loss", 120.0),
        made("worn", 9e3, 0.0, 0.03, softening=0.7, set_m=2e-3, earlier_j=0.02),
    ],
    "surface": [made("surface", 0.4, 9e3, 12.0, contact_n_m=6e4)],
    "surface on a shell": [SOFT, made("surface", 1.5, 5e3, 3.0, contact_n_m=2e4)],
    "liquid": [SOFT, made("liquid", 1.5e-3, 4e-5, 0.04, 3e-10, viscosity_pa_s=0.02)],
    "slosh": [SHELL, made("slosh", 0.8, 9.0)],
    "slosh, damped": [SHELL, made("slosh", 0.5, 25.0, 0.4)],
    "slosh, overdamped": [SHELL, made("slosh", 0.5, 12.0, 2.5)],
}
"""Terms in the order in which the simulator has them."""
RUBBING = (7.0, 8.0, 0.002, 0.5, 10.0)
SMOOTH = (0.5, 0.8, 0.002, 0.05, 60.0)
"""Coulomb friction, breakaway, Stribeck speed, friction by load, and damping of the drive."""
SPRINGS = (1.5e4, 0.0, 0.0, 1.0)
CREEPING = (1.2e4, 60.0, 8e3, 0.02)
RIGID = (math.inf, 0.0, 0.0, 1.0)
"""Stiffness, damper, branch and time constant of both pads in series."""
PLACES = {
    "centred": (0.0, False, 0.1),
    "pushed": (7e-5, False, 0.1),
    "held off centre": (6e-5, True, 0.1),
    "heavy, pushed back": (-5e-5, False, 3.0),
}
"""Distance from the centre line, whether the object is held, and its mass."""
GRIPPERS = {
    "straight": (Straight, RUBBING, SPRINGS, 0.0),
    "straight, smooth": (Straight, SMOOTH, SPRINGS, 0.0),
    "pr2": (Pr2, RUBBING, SPRINGS, 0.0),
    "pr2, smooth, creeping pads": (Pr2, SMOOTH, CREEPING, 0.0),
    "pr2, rigid pads": (Pr2, RUBBING, RIGID, 0.0),
    "pr2, smooth, rigid pads, lag": (Pr2, SMOOTH, RIGID, 4e-3),
}


@cache
def expected(name, place, gripper):
    """Return what the equations give for an object of this name."""
    link, friction, pads, lag_s = GRIPPERS[gripper]
    offset_m, held, mass_kg = PLACES[place]
    terms = [EQUATIONS[kind](values) for kind, values in OBJECTS[name]]
    table_n = 0.3 * mass_kg * 9.80665
    return Gripper(terms, link(), friction, pads, lag_s, offset_m, held, table_n).follow(EFFORTS)


def simulated(name, place, gripper, **settings):
    """Return the same of the simulator."""
    link, (coulomb, breakaway, stribeck, by_load, damping), (k, c, branch, tau), lag_s = GRIPPERS[gripper]
    offset_m, held, mass_kg = PLACES[place]
    config = SimConfig(
        sensor="ideal",
        spread=False,
        transmission="straight" if link is Straight else "pr2",
        coulomb_n=coulomb,
        breakaway_n=breakaway,
        stribeck_m_s=stribeck,
        load_friction_coefficient=by_load,
        damping_n_s_m=damping,
        pad_stiffness_n_m=2.0 * k,
        pad_damping_n_s_m=2.0 * c,
        pad_creep_n_m=2.0 * branch,
        pad_creep_s=tau,
        drive_lag_s=lag_s,
        **{"fidelity": "reference", **settings},
    )
    spec = ObjectSpec(
        name=name, width_m=WIDTH_M, offset_m=offset_m, held=held, mass_kg=mass_kg, terms=tuple(OBJECTS[name])
    )
    setup = unverified_setup(config, spec, 0)
    drive = setup.plant.drive
    turns = revolutions_at(drive.link, setup.plant.object.width_m + 2.0 * abs(offset_m) + START_M)
    gap, jacobian = gap_and_rate(drive.link, turns)
    state = setup.state._replace(motion=Motion(turns, -SPEED_M_S / jacobian, gap, jacobian))
    move, rows = composed_move(composition(setup.kinds, setup.plant)), []
    for effort, n_ticks in EFFORTS:
        for _ in range(n_ticks):
            state = move(setup.plant, state, effort, TICK_S)
            rows.append((state.motion.gap_m, state.contact.left_n, state.contact.right_n))
    assert state.step.unresolved + state.contact.unbalanced == 0
    return np.array(rows), state.peak_n


def errors(name, place, gripper, **settings):
    """Return the errors of gap, forces and peak, relative to the travel in contact and to the largest force."""
    rows, peak = simulated(name, place, gripper, **settings)
    wanted, most = expected(name, place, gripper)
    gap_m, *forces_n = np.abs(rows - wanted).max(axis=0)
    return gap_m / (WIDTH_M - wanted[:, 0].min()), max(forces_n) / most, abs(peak - most) / most


def every(count):
    """Yield each object with `count` pairs of a place and a gripper; over all objects, each pair occurs."""
    pairs = [(place, gripper) for gripper in GRIPPERS for place in PLACES]
    for i, name in enumerate(OBJECTS):
        for k in range(count):
            yield name, *pairs[(7 * i + 5 * k) % len(pairs)]


QUICK = ("snap, gradual", "heavy, pushed back", "pr2, smooth, rigid pads, lag")
"""The scene of the quick run."""


def marked(most, few):
    """Return the scenes of `every(most)`: those of `every(few)` for CI, the others but one among the long tests."""
    ci = set(every(few))
    marks = {scene: pytest.mark.slow if scene in ci else pytest.mark.long for scene in every(most)}
    return [pytest.param(*scene, marks=() if scene == QUICK else mark) for scene, mark in marks.items()]


@pytest.mark.parametrize(("name", "place", "gripper"), marked(8, 1))
def test_the_reference_is_the_solution_of_the_equations_for_every_term(name, place, gripper):
    assert max(errors(name, place, gripper)) <= 3e-5


@pytest.mark.parametrize(
    ("accuracy", "most"),
    [
        (1e-3, 1e-3),
        # The error of worn shells and of masses behind a contact is not that of the steps alone.
        *(pytest.param(a, max(a, 2e-4), marks=pytest.mark.long) for a in (0.1, 0.01, 1e-4)),
    ],
)
@pytest.mark.parametrize(("name", "place", "gripper"), marked(2, 1))
def test_steps_for_an_accuracy_have_it(name, place, gripper, accuracy, most):
    assert max(errors(name, place, gripper, fidelity="scene", accuracy=accuracy)) <= most
