"""J48 itself beside ours, on random tables: nominal columns, missing values, weights, missing classes.

Runs where the environment variable WEKA_JAR names Weka's jar (3.9.6) and Java is there; the committed answers in
test_oracle.py are the splits of record.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from graspsense_c45 import Options, class_indices, distributions, fit, parse_arff, to_text

ASK = Path(__file__).parent / "weka" / "AskWeka.java"
OPTIONS: dict[str, dict[str, Any]] = {
    "-C 0.25 -M 2": {},
    "-U -O -J -doNotMakeSplitPointActualValue -M 2": {
        "pruning": "none", "collapse": False, "mdl_correction": False, "actual_split_value": False,
    },
    "-C 0.1 -M 1": {"confidence_factor": 0.1, "min_objects": 1},
    "-R -N 3 -Q 1 -M 2": {"pruning": "reduced_error"},
    "-B -A -C 0.25 -M 2": {"binary_splits": True, "laplace": True},
    "-S -C 0.25 -M 2": {"subtree_raising": False},
}  # fmt: skip


def random_arff(rng):
    n, n_classes, n_columns = (int(rng.integers(low, high)) for low, high in ((10, 250), (2, 6), (1, 6)))
    labels = rng.integers(0, n_classes, n)
    missing = rng.choice([0.0, 0.02, 0.3])
    lines, columns = ["@relation random"], []
    for i in range(n_columns):
        if rng.random() < 0.5:
            n_values = int(rng.choice([2, 3, 6, 40]))
            codes = np.where(rng.random(n) < 0.5, (labels * 7 + i) % n_values, rng.integers(0, n_values, n))
            lines.append(f"@attribute a{i} {{{','.join(f'v{v}' for v in range(n_values))}}}")
            cells = [f"v{code}" for code in codes]
        else:
            lines.append(f"@attribute a{i} numeric")
            cells = [repr(x) for x in np.round(labels * rng.random() * 1.5 + rng.normal(0, 1, n), i).tolist()]
        columns.append(["?" if rng.random() < missing else cell for cell in cells])
    lines += [f"@attribute class {{{','.join(f'c{k}' for k in range(n_classes + 1))}}}", "@data"]
    weights = rng.choice([0.5, 1.0, 2.25], n) if rng.random() < 0.4 else np.ones(n)
    without_class = rng.random(n) < rng.choice([0.0, 0.05])
    for row in range(n):
        label = "?" if without_class[row] else f"c{labels[row]}"
        weight = "" if weights[row] == 1 else f",{{{weights[row]}}}"
        lines.append(",".join(column[row] for column in columns) + f",{label}{weight}")
    return "\n".join(lines) + "\n"


def assert_same(ours, theirs):
    pairs = [(ours, theirs)]
    while pairs:
        mine, given = pairs.pop()
        ours = (mine.get("feature"), mine.get("threshold"), mine["class"])
        assert ours == (given.get("att"), given.get("thr"), given["class"])
        assert mine["class_weights"] == pytest.approx(given["dist"], abs=1e-6)
        pairs += list(zip(mine.get("children", []), given.get("children", []), strict=True))


@pytest.mark.slow
def test_random_tables(tmp_path):
    jar = os.environ.get("WEKA_JAR")
    if not jar or not shutil.which("java"):
        pytest.skip("WEKA_JAR does not name Weka's jar, or there is no java: J48 cannot be asked")
    rng = np.random.default_rng(11)
    questions = []
    for i in range(40):
        path = tmp_path / f"{i}.arff"
        path.write_text(random_arff(rng))
        questions += [(path, options) for options in OPTIONS]
    requests = tmp_path / "requests.txt"
    requests.write_text("".join(f"{path}\t{options}\n" for path, options in questions))
    command = ["java", "-cp", jar, str(ASK), str(requests)]
    answers = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    assert len(answers) == len(questions)
    for (path, options), line in zip(questions, answers, strict=True):
        answer = json.loads(line)
        table = parse_arff(path.read_text())
        tree = fit(table, Options(**OPTIONS[options]))
        assert_same(tree.to_dict(), answer["tree"])
        assert class_indices(tree, table.values).tolist() == answer["pred"]
        np.testing.assert_allclose(distributions(tree, table.values), answer["dist"], rtol=0, atol=1e-9)
        # With -B J48 prints thresholds with all their digits.
        if "-B" not in options:
            assert to_text(tree) == answer["text"].split("------------------\n", 1)[1]
