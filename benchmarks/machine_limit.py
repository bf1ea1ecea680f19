"""How far the simulator is from what this machine could do: the scene of linear contact, also as a program in C.

    python benchmarks/machine_limit.py [--repeats 10] [--json] [--short]

The program does the same work as one grasp of `simulation_scene`: 7000 ticks under the closed control law, exact maps
of each tick, every change of contact located to 2^-40 of a tick, and the whole trace (position, force, command). It is
compiled by gcc for this processor, once for one grasp at a time and once with 4 or 8 grasps in the lanes of vector
registers, each of which begins a micrometre further. The error is that of the force of the first grasp against the
exact solution. Ours is a batch on one thread, with traces that are kept and without. All are measured in turn; the
median is printed, and the least and the greatest. Without gcc there is nothing to compare, which the program says.
Simulated.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import shutil
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.linalg import expm
from simulation_scene import CONFIG, TICK, TICKS, Law, _rates, exact_closed

from graspsense_sim_gripper.batch import run_many

LEVELS: Final = 40
LANES: Final = (1, 4, 8)
GRASPS: Final = 200
SOURCE: Final = r"""
#include <math.h>
#define T 1e-3
/* maps[mode][level]: 4 rows of x, v, y, w, u, 1 over a tick / 2^level */
static int pressed(const double *s) { return s[0] - s[2] > 0.02; }
static void apply(const double *m, double *s, double u) {
    double r[4];
    for (int i = 0; i < 4; i++)
        r[i] = m[6*i]*s[0] + m[6*i+1]*s[1] + m[6*i+2]*s[2] + m[6*i+3]*s[3] + m[6*i+4]*u + m[6*i+5];
    for (int i = 0; i < 4; i++) s[i] = r[i];
}
/* A tick in which the contact changes: the maps of ever shorter times up to the change, the others after it. */
static __attribute__((noinline)) int across(const double *maps, double *s, double u, int mode) {
    const double *m = maps + mode * (LEVELS + 1) * 24;
    double left = 1.0;
    for (int change = 0; change < 8 && left > 0.0; change++) {
        double share = 1.0;
        for (int k = 0; k <= LEVELS; k++, share *= 0.5) {
            if (share > left) continue;
            double next[4] = {s[0], s[1], s[2], s[3]};
            apply(m + 24 * k, next, u);
            if (pressed(next) != mode) continue;
            for (int i = 0; i < 4; i++) s[i] = next[i];
            left -= share;
        }
        if (left <= share * 4.0) break;
        apply(m + 24 * LEVELS, s, u);
        left -= share * 2.0;
        mode = 1 - mode;
        m = maps + mode * (LEVELS + 1) * 24;
    }
    return pressed(s);
}
void grasps(const double *maps, int ticks, double *xs, double *fs, double *us) {
    double s[4][LANES], integral[LANES], since[LANES], u[LANES], next[4][LANES];
    int mode[LANES], off[LANES];
    const double *free = maps, *touch = maps + (LEVELS + 1) * 24;
    for (int l = 0; l < LANES; l++) {
        s[0][l] = 1e-6 * l; s[1][l] = s[2][l] = s[3][l] = integral[l] = 0.0;
        since[l] = -1.0; mode[l] = 0;
    }
    for (int tick = 0; tick < ticks; tick++) {
        double t = tick * T;
        double ramp = t > 5.0 ? fmax(15.0 - 10.0 * (t - 5.0), 5.0) : 0.0;
        int any = 0;
        #pragma GCC ivdep
        for (int l = 0; l < LANES; l++) {
            double gap = s[0][l] - s[2][l] - 0.02, f = 2e4 * (gap > 0.0 ? gap : 0.0), v = s[1][l];
            int closing = (since[l] < 0.0) & (f <= 1.0);
            double short_of = 0.03 - v;
            integral[l] += closing ? 400.0 * short_of * T : 0.0;
            since[l] = (!closing & (since[l] < 0.0)) ? t : since[l];
            double rise = 1.0 + 10.0 * (t - since[l]);
            double wanted = rise < 15.0 ? rise : 15.0;
            wanted = t > 5.0 ? ramp : wanted;
            double c = closing ? 60.0 * short_of + integral[l] : wanted + (wanted - f) - 40.0 * v;
            c = c > -100.0 ? c : -100.0;
            u[l] = c < 100.0 ? c : 100.0;
            xs[tick * LANES + l] = s[0][l]; fs[tick * LANES + l] = f; us[tick * LANES + l] = u[l];
        }
        #pragma GCC unroll 4
        for (int i = 0; i < 4; i++)
            #pragma GCC ivdep
            for (int l = 0; l < LANES; l++) {
                double r = mode[l] ? touch[6*i+5] : free[6*i+5];
                r += (mode[l] ? touch[6*i+4] : free[6*i+4]) * u[l];
                for (int j = 0; j < 4; j++) r += (mode[l] ? touch[6*i+j] : free[6*i+j]) * s[j][l];
                next[i][l] = r;
            }
        for (int l = 0; l < LANES; l++) {
            off[l] = (next[0][l] - next[2][l] > 0.02) != mode[l];
            any |= off[l];
        }
        if (__builtin_expect(any, 0))
            for (int l = 0; l < LANES; l++)
                if (off[l]) {
                    double one[4] = {s[0][l], s[1][l], s[2][l], s[3][l]};
                    mode[l] = across(maps, one, u[l], mode[l]);
                    for (int i = 0; i < 4; i++) next[i][l] = one[i];
                }
        for (int i = 0; i < 4; i++)
            for (int l = 0; l < LANES; l++) s[i][l] = next[i][l];
    }
}
"""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--short", action="store_true", help="one repeat")
    given = parser.parse_args()
    if shutil.which("gcc") is None:
        print("not run: gcc is not installed")
        return
    repeats = 1 if given.short else given.repeats
    with tempfile.TemporaryDirectory() as folder:
        rows = measured(Path(folder), repeats)
    made = {"date": date.today().isoformat(), "load": round(os.getloadavg()[0], 1), "repeats": repeats}
    if given.json:
        print(json.dumps({"made": made, "ms_a_grasp": rows}, indent=2))
        return
    print(", ".join(f"{key} {value}" for key, value in made.items()))
    for name, row in rows.items():
        print(
            f"{name:<26}{row['ms']:8.4f} ms ({row['least']:.4f} to {row['greatest']:.4f}), error {row['error']:.1e}"
        )


def measured(folder: Path, repeats: int) -> dict[str, dict[str, float]]:
    """Return the milliseconds of processor of a grasp in each way, and the error of its force."""
    reference = exact_closed().force
    ways: dict[str, Callable[[], tuple[float, Any]]] = {
        f"C, {lanes} at a time" if lanes > 1 else "C": in_c(folder, lanes) for lanes in LANES
    }
    ways["graspsense, traces kept"] = lambda: ours(traces=True)
    ways["graspsense, no traces"] = lambda: ours(traces=False)
    spent: dict[str, list[float]] = {name: [] for name in ways}
    error = {}
    for k in range(repeats + 1):
        for name, way in ways.items():
            seconds, force = way()
            error[name] = float(np.sqrt(np.mean((force[:TICKS] - reference) ** 2)) / reference.max())
            if k:
                spent[name].append(1e3 * seconds)
    return {
        name: {"ms": statistics.median(of), "least": min(of), "greatest": max(of), "error": error[name]}
        for name, of in spent.items()
    }


def maps() -> Any:
    """Return the exact maps of a tick, its half, its quarter and so on, free and touching: (2, levels + 1, 4, 6)."""
    return np.array(
        [
            [expm(_rates(touching) * TICK / 2**level)[:4] for level in range(LEVELS + 1)]
            for touching in (False, True)
        ]
    )


def in_c(folder: Path, lanes: int) -> Callable[[], tuple[float, Any]]:
    """Return a function that runs grasps in C, and returns the seconds of each and the force of one."""
    source, library = folder / f"limit_{lanes}.c", folder / f"limit_{lanes}.so"
    source.write_text(SOURCE)
    options = ["-O3", "-march=native", "-mprefer-vector-width=512", "-fno-math-errno", "-fno-trapping-math"]
    options += [f"-DLANES={lanes}", f"-DLEVELS={LEVELS}", "-shared", "-fPIC"]
    subprocess.run(["gcc", *options, str(source), "-o", str(library), "-lm"], check=True)
    grasps = ctypes.CDLL(str(library)).grasps
    table, columns = maps(), [np.zeros((TICKS, lanes)) for _ in range(3)]

    def run() -> tuple[float, Any]:
        calls = max(GRASPS // lanes, 1)
        written = [column.ctypes.data_as(ctypes.c_void_p) for column in columns]
        begun = time.process_time()
        for _ in range(calls):
            grasps(table.ctypes.data_as(ctypes.c_void_p), TICKS, *written)
        return (time.process_time() - begun) / (calls * lanes), columns[1][:, 0].copy()

    return run


def ours(traces: bool) -> tuple[float, Any]:
    """Run grasps of the simulator, and return the seconds of each and the force of one."""
    scenes, seeds = [CONFIG.object] * GRASPS, range(GRASPS)
    begun = time.process_time()
    done = run_many(CONFIG, Law(None), scenes, seeds, compiled=True, workers=1, traces=traces)
    spent = (time.process_time() - begun) / GRASPS
    if not traces:
        done = run_many(CONFIG, Law(None), scenes[:1], seeds[:1], compiled=True, workers=1)
    return spent, done[0].trace.force_left_n


if __name__ == "__main__":
    main()
