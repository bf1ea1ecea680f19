"""Reads a damaged model in a process with limited memory: each damage is refused, or the model still answers.

    python damaged_models.py SEED PLACES DAMAGES FILE.json ...

The damages are those of `graspsense.testing.damage` at PLACES values of each file, and DAMAGES of each value, chosen by
SEED (all of them for 0). Each has a hash that fits. Prints `ok COUNT`, or the first damage that was neither refused as
damaged nor answered.
"""

import json
import math
import random
import resource
import sys
import warnings
from pathlib import Path

import numpy as np

from graspsense.core.components.registry import installed
from graspsense.core.learn.model_content import digest
from graspsense.core.learn.model_file import load_model
from graspsense.core.values.errors import ConfigError, DataDamaged, UnknownName
from graspsense.core.values.features import FeatureTable
from graspsense.testing.damage import damaged_at, paths

MEMORY = 300 * 2**20
"""Bytes that reading a model may take beyond those of the imported packages."""
SECONDS = 60
"""Processor time that one damaged model may take."""


def sealed(content: object) -> bytes:
    """The content as a file with the hash that fits; NaN and infinity as Python's JSON writes them."""
    if not isinstance(content, dict):
        return json.dumps(content).encode()
    fields = {key: value for key, value in content.items() if key != "sha256"}
    return json.dumps({**fields, "sha256": digest(fields)}).encode()


def answered(path: Path) -> None:
    """Predict three trials in every way there is; each must have probabilities that sum to one."""
    model = load_model(str(path), installed())
    values = np.array([[1e308] * len(model.names), [math.nan] * len(model.names), [0.06] * len(model.names)])
    table = FeatureTable(names=model.names, units=model.units, values=values)
    for part in (model, *(part for _, part in model.checkpoints)):
        shares = part.answers(table).probabilities
        assert np.abs(shares.sum(axis=1) - 1.0).max() < 1e-6
        part.predictions(table)
        for i in range(len(table)):
            prediction = part.predict(table.row(i))
            assert abs(sum(prediction.probabilities.values()) - 1.0) < 1e-6
            json.dumps(prediction.as_json(), allow_nan=False)
    assert model.in_a_line


def used_memory() -> int:
    """The address space of this process (bytes)."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return pages * resource.getpagesize()


def read_all(path: Path, seed: int, places: int, damages: int) -> int:
    """Read each damage of a file, and return how many there were."""
    good = json.loads(path.read_text())
    resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    answered(path)  # imports what this model needs
    resource.setrlimit(resource.RLIMIT_AS, (used_memory() + MEMORY, resource.RLIM_INFINITY))
    rng = random.Random(seed)
    keys_of_good = list(paths({key: value for key, value in good.items() if key != "sha256"}))
    chosen = rng.sample(keys_of_good, min(places, len(keys_of_good))) if places else keys_of_good
    count = 0
    for place in chosen:
        others = list(damaged_at(good, place))
        for damaged in rng.sample(others, damages) if damages else others:
            resource.setrlimit(resource.RLIMIT_CPU, (int(sum(resource.getrusage(0)[:2])) + SECONDS, -1))
            path.write_bytes(sealed(damaged))
            what = f"{'.'.join(map(str, place))} = {str(value_at(damaged, place))[:60]}"
            sys.stderr.write(f"{what}\n")  # the last line, if the process is killed
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error", RuntimeWarning)
                    answered(path)
            except DataDamaged:
                pass
            except (ConfigError, UnknownName):
                assert place[:1] in ((), ("classifier",), ("format",)), what  # another component, or format
            count += 1
    return count


def value_at(document: object, place: tuple[str | int, ...]) -> object:
    for step in place:
        document = document[step]  # type: ignore[index]
    return document


if __name__ == "__main__":
    numbers = [int(number) for number in sys.argv[1:4]]
    counts = [read_all(Path(name), *numbers) for name in sys.argv[4:]]
    sys.stdout.write(f"ok {sum(counts)}")
