"""Fit the confidence of verified mode on the pair benchmark, and print the table that segmap.verdict holds.

    python benchmarks/calibrate.py [--logs FOLDER] PAIRS.json...

Every pair is matched in verified mode; a logistic model learns from the findings whether the best candidate
is right. Each log is judged by a model that never saw it (leave one log out); the table printed last is
fitted on all of them. Change the table in segmap/verdict.py only by running this again.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from segmap.benchmark import Outcome, PairSet, is_right, run_pairs
from segmap.integration import findings_of
from segmap.logs import read_log
from segmap.parameters import Parameters, preset
from segmap.verdict import features

RIDGE = 0.5
WRONG_TRUTH = {("csail/csail-corrected.log.gz", 42, 43)}
"""The logged pose of scan 42 is turned by 11 degrees: matches 41-42, 42-43 and 41-43 close to 1.3 cm and 0.5
degrees, and so do 42-43, 43-44 and 42-44; against the log each that touches scan 42 is off by 11 degrees."""


@dataclass(frozen=True)
class Example:
    """The features of one pair's best candidate, and whether it is right."""

    log: str
    features: tuple[float, ...]
    right: bool
    positive: bool


def examples(pair_set: PairSet, outcomes: Sequence[Outcome]) -> list[Example]:
    """What the model learns from; pairs without a candidate, or whose truth is wrong, teach nothing."""
    found = []
    for outcome in outcomes:
        pair, findings = outcome.pair, findings_of(outcome.match)
        if findings is not None and (pair_set.log, pair.i, pair.j) not in WRONG_TRUTH:
            row = (1.0, *features(findings).values())
            right = is_right(outcome.match.T_1_2, pair.truth)
            found.append(Example(pair_set.log, row, right, pair.truth is not None))
    return found


def fit(learned: Sequence[Example]) -> np.ndarray:
    """Logistic weights with a small ridge on all but the intercept."""
    rows = np.array([example.features for example in learned])
    right = np.array([example.right for example in learned], dtype=float)
    scale = np.where(rows.std(axis=0) > 0.0, rows.std(axis=0), 1.0)
    scaled = rows / scale

    def loss(weights: np.ndarray) -> tuple[float, np.ndarray]:
        logits = scaled @ weights
        ridge = np.concatenate(([0.0], weights[1:]))
        value = np.logaddexp(0.0, logits).sum() - right @ logits + RIDGE * ridge @ ridge
        return value, scaled.T @ (1.0 / (1.0 + np.exp(-logits)) - right) + 2.0 * RIDGE * ridge

    return minimize(loss, np.zeros(rows.shape[1]), jac=True).x / scale


def confidences(weights: np.ndarray, judged: Sequence[Example]) -> np.ndarray:
    """The confidence of each example."""
    return 1.0 / (1.0 + np.exp(-np.array([example.features for example in judged]) @ weights))


def leave_one_log_out(all_examples: Sequence[Example], accept: float) -> list[str]:
    """A line a log: what a model that never saw it accepts, rightly and wrongly."""
    lines = []
    for log in sorted({example.log for example in all_examples}):
        held = [example for example in all_examples if example.log == log]
        sure = confidences(fit([example for example in all_examples if example.log != log]), held)
        right = np.array([example.right for example in held])
        positives = sum(example.positive for example in held)
        accepted = sure >= accept
        lines.append(
            f"{log}: accepted and right {np.sum(accepted & right) / positives:.3f} of {positives} positives,"
            f" accepted and wrong {np.sum(accepted & ~right)}, surest wrong {sure[~right].max(initial=0.0):.3f}"
        )
    return lines


def main() -> None:
    """Match, fit, judge, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pairs", nargs="+", type=Path)
    parser.add_argument("--logs", type=Path, default=Path("../shared/datasets"))
    options = parser.parse_args()
    parameters = preset("verified")
    found = [example for path in options.pairs for example in _matched(path, options.logs, parameters)]
    print(*leave_one_log_out(found, parameters.confidence_accept), sep="\n")
    print(dict(zip(("intercept", "score", "gap", "agreement", "overlap"), fit(found).round(3).tolist(), strict=True)))


def _matched(path: Path, logs: Path, parameters: Parameters) -> list[Example]:
    pair_set = PairSet.from_json(path.read_text(), path.name)
    outcomes = run_pairs(pair_set, read_log(logs / pair_set.log), parameters, mode="verified")
    return examples(pair_set, outcomes)


if __name__ == "__main__":
    main()
