"""MultiRocket-Hydra and a tuned boosted forest on the trials and folds of benchmarks/recognition.py.

    python benchmarks/recognition_peers.py TRIALS.npz ANSWERS.json
    python benchmarks/recognition_peers.py --short

It runs in an environment of its own with aeon 1.6 (`pip install aeon==1.6.0`), which needs other versions than
graspsense. The two classifiers:

- *MultiRocket-Hydra* on the curves: MultiRocket of aeon (C. W. Tan and others, Data Min. Knowl. Disc. 36 (2022) 1623)
  and Hydra (A. Dempster, D. F. Schmidt and G. I. Webb, Data Min. Knowl. Disc. 37 (2023) 1779), and on both a ridge
  classifier. Sizes, scaling and ridge are those of `MultiRocketHydraClassifier` of aeon. Its Hydra needs PyTorch; here
  are the same kernels in numpy. Each channel is brought to mean 0 and standard deviation 1 over the training trials,
  and not within each trial, so that widths and forces count.
- *Tuned boosted forest* on all features together: the gradient-boosted trees of scikit-learn with the learning rate and
  the size of the trees that are best in a cross-validation within the training trials, with whole instances held out.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

GROUPS, KERNELS, LENGTH = 64, 8, 9
INNER_FOLDS = 3
GRID = {"learning_rate": (0.05, 0.15), "max_leaf_nodes": (4, 12)}
ITERATIONS = 100
LEAST_KNOWN = 0.1
"""Share of the training trials that must have a feature."""


class Hydra:
    """Random kernels in groups; counts which kernel of a group fits best at each time."""

    def __init__(self, channels: int, points: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.dilations = [2**k for k in range(int(np.log2((points - 1) / (LENGTH - 1))) + 1)]
        groups = GROUPS // 2  # half of them on the differences
        size = (len(self.dilations), 2, groups, KERNELS, LENGTH)
        weights = rng.standard_normal(size)
        weights -= weights.mean(-1, keepdims=True)
        self.weights = (weights / np.abs(weights).sum(-1, keepdims=True)).astype(np.float32)
        several = int(np.clip(channels // 2, min(2, channels), 8))
        self.picked = rng.integers(0, channels, size=(len(self.dilations), 2, groups, several))

    def transform(self, curves: np.ndarray) -> np.ndarray:
        """Return the counts, shape (trials, features)."""
        curves = curves.astype(np.float32)
        n, parts = len(curves), []
        for k, dilation in enumerate(self.dilations):
            for half, values in enumerate((curves, np.diff(curves))):
                pad = (LENGTH - 1) * dilation // 2
                padded = np.pad(values, ((0, 0), (0, 0), (pad, pad)))
                for group, weights in enumerate(self.weights[k, half]):
                    one = padded[:, self.picked[k, half, group]].sum(axis=1)
                    span = one.shape[1] - (LENGTH - 1) * dilation
                    taps = np.stack(
                        [one[:, j * dilation : j * dilation + span] for j in range(LENGTH)], axis=-1
                    )
                    fit = taps @ weights.T
                    best, worst = fit.argmax(axis=-1), fit.argmin(axis=-1)
                    top = np.take_along_axis(fit, best[..., np.newaxis], axis=-1)[..., 0]
                    rows = np.repeat(np.arange(n), span) * KERNELS
                    size = n * KERNELS
                    parts.append(np.bincount(rows + best.ravel(), top.ravel(), size).reshape(n, KERNELS))
                    parts.append(np.bincount(rows + worst.ravel(), minlength=size).reshape(n, KERNELS))
        return np.concatenate(parts, axis=1).astype(np.float32)


def sparse_scaled(training: np.ndarray, test: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return Hydra's counts as its authors scale them: square roots, and a count of zero stays zero."""
    roots = [np.sqrt(np.maximum(one, 0.0)) for one in (training, test)]
    spread = roots[0].std(axis=0, ddof=1) + (roots[0] == 0).mean(axis=0) ** 4 + 1e-8
    mean = roots[0].mean(axis=0)
    scaled = [((one - mean) * (one != 0) / spread).astype(np.float32) for one in roots]
    return scaled[0], scaled[1]


def multirocket_hydra(data: dict, training: np.ndarray, test: np.ndarray, seed: int) -> np.ndarray:
    from aeon.transformations.collection.convolution_based import MultiRocket
    from sklearn.linear_model import RidgeClassifierCV
    from sklearn.preprocessing import StandardScaler

    curves = data["curves"]
    mean = curves[training].mean(axis=(0, 2), keepdims=True)
    spread = curves[training].std(axis=(0, 2), keepdims=True)
    curves = (curves - mean) / np.where(spread > 0.0, spread, 1.0)
    hydra = Hydra(curves.shape[1], curves.shape[2], seed)
    counts = sparse_scaled(hydra.transform(curves[training]), hydra.transform(curves[test]))
    rocket = MultiRocket(random_state=seed, n_jobs=1)
    rocket.fit(curves[training].astype(np.float32))
    features = [rocket.transform(curves[rows].astype(np.float32)) for rows in (training, test)]
    scaler = StandardScaler().fit(features[0])
    joined = [
        np.concatenate((count, scaler.transform(one).astype(np.float32)), axis=1)
        for count, one in zip(counts, features, strict=True)
    ]
    ridge = RidgeClassifierCV(alphas=np.logspace(-3, 3, 10))
    return ridge.fit(joined[0], data["labels"][training]).predict(joined[1])


def tuned_boosted_forest(data: dict, training: np.ndarray, test: np.ndarray, seed: int) -> np.ndarray:
    from sklearn.ensemble import HistGradientBoostingClassifier
    from sklearn.model_selection import GridSearchCV, StratifiedGroupKFold

    search = GridSearchCV(
        HistGradientBoostingClassifier(
            max_iter=ITERATIONS, l2_regularization=1.0, random_state=seed, early_stopping=False
        ),
        {name: list(values) for name, values in GRID.items()},
        cv=StratifiedGroupKFold(INNER_FOLDS, shuffle=True, random_state=seed),
    )
    # A feature that few trials have can be missing in all of a fold, which scikit-learn refuses.
    known = np.isfinite(data["features"][training]).mean(axis=0) > LEAST_KNOWN
    features = data["features"][:, known]
    search.fit(features[training], data["labels"][training], groups=data["instances"][training])
    return search.predict(features[test])


CLASSIFIERS = {"MultiRocket-Hydra": multirocket_hydra, "tuned boosted forest": tuned_boosted_forest}


def answers_of(data: dict, seed: int) -> dict:
    """Return for each classifier the predicted labels under each protocol, and the mean seconds of a fold."""
    found: dict = {}
    for name, classifier in CLASSIFIERS.items():
        predicted, seconds = {}, []
        for protocol in data["protocols"]:
            folds = data[f"folds_{protocol}"]
            labels = np.empty(len(folds), dtype=data["labels"].dtype)
            for fold in np.unique(folds):
                began = time.perf_counter()
                test = np.flatnonzero(folds == fold)
                labels[test] = classifier(data, np.flatnonzero(folds != fold), test, seed)
                seconds.append(time.perf_counter() - began)
                print(f"{name}, {protocol}, fold {fold}: {seconds[-1]:.1f} s", file=sys.stderr, flush=True)
            predicted[str(protocol)] = labels.tolist()
        found[name] = {"predicted": predicted, "training_s": float(np.mean(seconds))}
    return found


def synthetic() -> dict:
    """Return a few trials of two labels, for the short form."""
    rng = np.random.default_rng(0)
    labels = np.array(["soft", "stiff"] * 12)
    steep = np.where(labels == "stiff", 2.0, 1.0)
    curves = steep[:, np.newaxis, np.newaxis] * np.linspace(0.0, 1.0, 64) + 0.05 * rng.normal(
        size=(24, 2, 64)
    )
    return {
        "labels": labels, "instances": np.arange(24) // 2, "features": curves.mean(axis=2), "curves": curves,
        "protocols": np.array(["stratified"]), "folds_stratified": np.arange(24) // 2 % 2,
    }  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("trials", type=Path, nargs="?")
    parser.add_argument("answers", type=Path, nargs="?")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--short", action="store_true", help="a few synthetic trials, only to show that it runs"
    )
    given = parser.parse_args()
    try:
        import aeon  # noqa: F401
    except ImportError:
        print("not run: needs aeon, in an environment of its own")
        return 0 if given.short else 1
    if given.short:
        global ITERATIONS
        ITERATIONS = 5
        print(json.dumps(answers_of(synthetic(), given.seed)))
        return 0
    with np.load(given.trials) as stored:
        data = {name: stored[name] for name in stored.files}
    given.answers.write_text(json.dumps(answers_of(data, given.seed)), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
