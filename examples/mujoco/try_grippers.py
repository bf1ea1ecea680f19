"""Grasp the block and the egg with each gripper file: python try_grippers.py GRIPPER.toml...

Ends with an error where a grasp is not steady, or the egg breaks. With `--pictures FOLDER` it also writes a picture of
each gripper that holds the egg (needs PyOpenGL, and EGL or OSMesa).
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from math import isfinite
from pathlib import Path

from graspsense import load_pipeline

FORCE_N = 8.0
SIZE = (200, 150)
"""Of a picture (pixels)."""


def options(file: Path) -> list[str]:
    """Return the settings of a grasp with a gripper file."""
    return [
        "gripper.type=mujoco",
        f"gripper.file={file}",
        "classifier.type=none",
        "gripper.spread=false",
        "controller.sends=velocity",
        f"controller.probing_force_n={FORCE_N}",
    ]


def write_picture(file: Path, target: Path) -> None:
    """Write a small picture of a gripper that holds the egg, as `graspsense run --picture` takes it."""
    from PIL import Image

    target.parent.mkdir(parents=True, exist_ok=True)
    settings = [word for option in options(file) for word in ("-o", option)]
    command = [sys.executable, "-m", "graspsense", "run", "--object", "egg", "--seed", "0", *settings]
    subprocess.run([*command, "--picture", str(target)], check=True, capture_output=True)
    with Image.open(target) as picture:
        small = picture.convert("RGB").resize(SIZE, Image.Resampling.LANCZOS)
    small.quantize(48).save(target, optimize=True)


def grasped(file: Path, thing: str) -> str:
    """Grasp a thing; return what came of it. Raises SystemExit where it was not held whole."""
    trial = load_pipeline("default", options=options(file)).grasp(object=thing, seed=0)
    features = trial.features
    said = f"{file.stem:14} {thing:6} {trial.outcome.words}: {features['p_steady'] * 1e3:.1f} mm"
    said += f", {features['f_steady']:.1f} N, at most {trial.report['greatest_force_n']:.1f} N"
    if trial.outcome.words != "steady" or trial.report["broken"] or not isfinite(features["f_steady"]):
        sys.exit(f"not held: {said} {dict(trial.report)}")
    return said


def main() -> None:
    """Grasp with each gripper, and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--pictures", type=Path)
    arguments = parser.parse_args()
    for file in arguments.files:
        for thing in ("block", "egg"):
            print(grasped(file, thing), flush=True)  # noqa: T201 (what was asked for)
        if arguments.pictures is not None:
            write_picture(file, arguments.pictures / f"{file.stem}.png")


if __name__ == "__main__":
    main()
