"""Public data sets through `import` and `evaluate`: the first table of benchmarks/results/other_data.md.

    python benchmarks/other_data.py FOLDER [--classifier c45] [--sets jaco,fruit] [--short]

FOLDER has a folder for each data set, with the names of docs/other_data.md. A set whose folder is missing is left out.
The manifests are those of docs/manifests. `--short` imports the recordings only.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

MANIFESTS = Path(__file__).parents[1] / "docs" / "manifests"
SETS = (
    "fruit",
    "jaco",
    "pr2_biotac",
    "palpation",
    "dataglove",
    "biotac_slide",
    "biotac_sp",
    "barrett_taps",
    "icub",
)
FEATURES = ("chitta", "curve")
ROWS = ("before_contact", "first_line", "width_only", "recording_order", "majority_class")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", default=Path("data"))
    parser.add_argument("--classifier", default="c45")
    parser.add_argument("--sets", default=",".join(SETS))
    parser.add_argument("--short", action="store_true")
    given = parser.parse_args()
    names = [name for name in given.sets.split(",") if (given.folder / name).is_dir()]
    if not names:
        print(f"not run: needs the data sets, as {given.folder}/jaco (docs/other_data.md)")
        return 0 if given.short else 1
    print("| set | features | with features | rate | " + " | ".join(ROWS) + " |")
    print("|---|---|---|---|" + "---|" * len(ROWS))
    for name in names:
        report(name, given.folder / name, given.classifier, short=given.short)
    return 0


def report(name: str, data: Path, classifier: str, *, short: bool) -> None:
    """Print the rows of a data set: imported into a store for each feature set, then evaluated."""
    if name == "biotac_sp" and not short:
        labelled(name, ["evaluate", str(data / "bts3v2_palm_down.csv"), "--label", "slipped", "--instance", "object"],
                 "the 72 numbers of a row, palm down", classifier)  # fmt: skip
        return
    for features in FEATURES:
        with tempfile.TemporaryDirectory() as folder:
            source = f"icub:{data.resolve()}"
            if name != "icub":
                source = "manifest.toml"
                text = (MANIFESTS / f"{name}.toml").read_text(encoding="utf-8")
                (Path(folder) / source).write_text(f'folder = "{data.resolve()}"\n{text}', encoding="utf-8")
            options = ["-o", "classifier.type=none", "-o", f"features.type={features}"]
            said = graspsense(folder, ["import", source, "--save", "store", *options])
            print(f"<!-- {name}: {' '.join(said.stdout.split())} -->")
            if not short:
                labelled(name, ["evaluate", f"store:{folder}/store"], features, classifier)


def labelled(name: str, command: Sequence[str], features: str, classifier: str) -> None:
    """Print the row of an evaluation."""
    result = json.loads(graspsense(".", [*command, "--classifier", classifier, "--json"]).stdout)
    cells = [rate_of(result["controls"].get(row, {})) for row in ROWS]
    having = result["by_features"].get("with features", {}) if result["by_features"] else {}
    headline = result["headline"]
    with_features = f"{having.get('n', headline['n'])} of {headline['n']}"
    print(
        f"| {name} | {features} | {with_features} | {rate_of({'rate': headline})} | {' | '.join(cells)} |",
        flush=True,
    )


def rate_of(measured: dict) -> str:
    rate = measured.get("rate")
    if not rate:
        return "not measured"
    share = f"{rate['correct']} of {rate['n']} = {rate['rate']:.3f}"
    return f"{share} ({rate['interval'][0]:.2f} to {rate['interval'][1]:.2f})" if rate["interval"] else share


def graspsense(folder: str, arguments: Sequence[str]) -> subprocess.CompletedProcess[str]:
    ran = subprocess.run(
        [sys.executable, "-m", "graspsense", *arguments],
        cwd=folder, capture_output=True, text=True, check=False, env={**os.environ, "COLUMNS": "200"},
    )  # fmt: skip
    if ran.returncode:
        raise SystemExit(f"graspsense {' '.join(arguments)}: {ran.stderr}")
    return ran


if __name__ == "__main__":
    sys.exit(main())
