"""Classifiers of others on the trials and folds of benchmarks/recognition.py.

    python benchmarks/recognition_peers.py TRIALS.npz ANSWERS.json

With the environment of graspsense:

- *QUANT* on the curves (A. Dempster, D. F. Schmidt and G. I. Webb, arXiv:2308.00928): the quantiles of the feature set
  `quant` of graspsense, written from the paper, and extremely randomised trees with the settings of the paper.
- *ExtraTrees* on the curves: all their points.
- *catch22* on the curves (pycatch22): the 22 characteristics, mean and standard deviation of each channel, and
  extremely randomised trees.
With an environment of its own with aeon 1.6 (`pip install aeon==1.6.0`), which needs other versions than graspsense:

- *MultiRocket-Hydra* on the curves: MultiRocket of aeon (C. W. Tan and others, Data Min. Knowl. Disc. 36 (2022) 1623)
  and Hydra (A. Dempster, D. F. Schmidt and G. I. Webb, Data Min. Knowl. Disc. 37 (2023) 1779), and on both a ridge
  classifier. Sizes, scaling and ridge are those of `MultiRocketHydraClassifier` of aeon. Its Hydra needs PyTorch; here
  are the same kernels in numpy. Each channel is brought to mean 0 and standard deviation 1 over the training trials,
  and not within each trial, so that widths and forces count.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import sys
import time
from pathlib import Path

import numpy as np

GROUPS, KERNELS, LENGTH = 64, 8, 9
TREES = 300
QUANT_TREES = 200


def trees(
    features: np.ndarray, data: dict, training: np.ndarray, test: np.ndarray, seed: int, **given: object
) -> np.ndarray:
    from sklearn.ensemble import ExtraTreesClassifier

    model = ExtraTreesClassifier(random_state=seed, **given)
    return model.fit(features[training], data["labels"][training]).predict(features[test])


def channels_of(data: dict, transform: object) -> np.ndarray:
    return np.concatenate([transform(data["curves"][:, k]) for k in range(data["curves"].shape[1])], axis=1)


def quant(data: dict, training: np.ndarray, test: np.ndarray, seed: int) -> np.ndarray:
    from graspsense.plugins.features.quant import interval_quantiles

    features = channels_of(data, interval_quantiles)
    given = {"n_estimators": QUANT_TREES, "max_features": 0.1, "criterion": "entropy"}
    return trees(features, data, training, test, seed, **given)


def extra_trees(data: dict, training: np.ndarray, test: np.ndarray, seed: int) -> np.ndarray:
    return trees(
        data["curves"].reshape(len(data["curves"]), -1), data, training, test, seed, n_estimators=TREES
    )


def catch22(data: dict, training: np.ndarray, test: np.ndarray, seed: int) -> np.ndarray:
    import pycatch22

    def characteristics(series: np.ndarray) -> np.ndarray:
        return np.array([pycatch22.catch22_all(curve.tolist(), catch24=True)["values"] for curve in series])

    if "catch22" not in data:
        data["catch22"] = np.nan_to_num(channels_of(data, characteristics), posinf=0.0, neginf=0.0)
    return trees(data["catch22"], data, training, test, seed, n_estimators=TREES)


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
                    channels = padded[:, self.picked[k, half, group]].sum(axis=1)
                    span = channels.shape[1] - (LENGTH - 1) * dilation
                    taps = np.stack(
                        [channels[:, j * dilation : j * dilation + span] for j in range(LENGTH)], axis=-1
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
    roots = [np.sqrt(np.maximum(counts, 0.0)) for counts in (training, test)]
    spread = roots[0].std(axis=0, ddof=1) + (roots[0] == 0).mean(axis=0) ** 4 + 1e-8
    mean = roots[0].mean(axis=0)
    scaled = [((root - mean) * (root != 0) / spread).astype(np.float32) for root in roots]
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
        np.concatenate((count, scaler.transform(feature).astype(np.float32)), axis=1)
        for count, feature in zip(counts, features, strict=True)
    ]
    ridge = RidgeClassifierCV(alphas=np.logspace(-3, 3, 10))
    return ridge.fit(joined[0], data["labels"][training]).predict(joined[1])


WITH_AEON = {"MultiRocket-Hydra": multirocket_hydra}
CLASSIFIERS = {
    "QUANT": quant,
    "ExtraTrees": extra_trees,
    "catch22 and ExtraTrees": catch22,
}


def answers_of(data: dict, seed: int) -> dict:
    """Return for each classifier the predicted labels, and the mean seconds of a fold."""
    answers: dict = {}
    has_aeon = importlib.util.find_spec("aeon") is not None
    for name, classifier in (WITH_AEON if has_aeon else CLASSIFIERS).items():
        labels, seconds = np.empty(len(data["folds"]), dtype=data["labels"].dtype), []
        for fold in np.unique(data["folds"]):
            began = time.perf_counter()
            test = np.flatnonzero(data["folds"] == fold)
            labels[test] = classifier(data, np.flatnonzero(data["folds"] != fold), test, seed)
            seconds.append(time.perf_counter() - began)
        print(f"{name}: {sum(seconds):.1f} s", file=sys.stderr, flush=True)
        answers[name] = {"predicted": labels.tolist(), "training_s": float(np.mean(seconds))}
    return answers


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("trials", type=Path)
    parser.add_argument("answers", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    with np.load(given.trials) as stored:
        data = {name: stored[name] for name in stored.files}
    given.answers.write_text(json.dumps(answers_of(data, given.seed)), encoding="utf-8")


if __name__ == "__main__":
    main()
