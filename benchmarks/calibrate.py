"""Fit the confidence of verified mode on real logs, and print the table that segmap.verdict holds.

    python benchmarks/calibrate.py [--logs FOLDER] [--pairs FOLDER] [--drawn N] [--accept 0.9]

Matched in verified mode are the pairs of the benchmark, and N more of each log (2000), drawn with a fixed seed
among all scans within 15 m of each other (benchmarks/false_accepts.py): neighbours alone would not teach how like
two places can be. A logistic model learns from the findings whether the best candidate is right. A drawn pair
counts a tenth, as it is a task a tenth as common; one that is nearly right against the log's own pose teaches
nothing, as such poses err too. Each log is judged by a model that never saw it (leave one log out), with the
doubts of segmap.verdict; the table printed last is fitted on all of them. Change the table in segmap/verdict.py
only by running this again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from common import LogPairs, arguments, load, markdown, percent, provenance
from false_accepts import WRONG_POSES, draw, logged

from segmap.benchmark import is_right
from segmap.integration import Match, match_maps
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.segments import SegmentMap, extract
from segmap.verdict import Verdict, features

RIDGE = 0.5
SEED = 7
DRAWN_WEIGHT = 0.1
NEARLY_RIGHT = 0.6, 0.2
"""metres and radians"""


@dataclass(frozen=True)
class Example:
    """The features of one pair's best candidate, and whether it is right."""

    log: str
    drawn: bool
    """drawn, not of the benchmark"""
    positive: bool
    """of the benchmark, with a common wall"""
    features: tuple[float, ...]
    """with a 1 before them, for the intercept"""
    right: bool
    doubtful: bool
    """left to a person however sure"""

    @property
    def weight(self) -> float:
        """How much it counts."""
        return DRAWN_WEIGHT if self.drawn else 1.0


def examples(held: LogPairs, drawn: int, parameters: Parameters) -> Iterator[Example]:
    """What the model learns from one log; pairs without a candidate, or whose truth is wrong, teach nothing."""

    @cache
    def scan_map(index: int) -> SegmentMap:
        return extract(held.log.scan(index), parameters)

    pairs = [(pair.i, pair.j, pair.truth, pair.truth is not None, False) for pair in held.pairs]
    pairs += [(i, j, logged(held.log, i, j), False, True) for i, j in draw(held, drawn, SEED)]
    for i, j, truth, positive, is_drawn in pairs:
        match = match_maps(scan_map(i), scan_map(j), parameters, mode="verified")
        if match.findings is None or {(held.name, i), (held.name, j)} & WRONG_POSES:
            continue
        right = is_right(match.T_1_2, truth)
        if right or not (is_drawn and _nearly(match.T_1_2, truth)):
            row = (1.0, *features(match.findings).values())
            yield Example(held.name, is_drawn, positive, row, right, _doubtful(match, parameters))


def _nearly(pose: Pose2 | None, truth: Pose2 | None) -> bool:
    if pose is None or truth is None:
        return False
    distance, angle = pose.distance(truth)
    return distance < NEARLY_RIGHT[0] and angle < NEARLY_RIGHT[1]


def _doubtful(match: Match, parameters: Parameters) -> bool:
    """Whether it is not accepted even by thresholds that accept everything."""
    lax = parameters.replace(confidence_accept=0.0, confidence_review=0.0, value_threshold=0.0)
    return match.judged(lax).verdict is not Verdict.ACCEPTED


def fit(learned: Sequence[Example]) -> np.ndarray:
    """Logistic weights with a small ridge on all but the intercept, by Newton's method."""
    rows = np.array([example.features for example in learned])
    right = np.array([example.right for example in learned], dtype=float)
    weight = np.array([example.weight for example in learned])
    scale = np.where(rows.std(axis=0) > 0.0, rows.std(axis=0), 1.0)
    scaled = rows / scale
    ridge = 2.0 * RIDGE * np.diag([0.0, *np.ones(rows.shape[1] - 1)])
    found = np.zeros(rows.shape[1])
    for _ in range(50):
        sure = _logistic(scaled @ found)
        slope = scaled.T @ (weight * (sure - right)) + ridge @ found
        step = np.linalg.solve((scaled.T * (weight * sure * (1.0 - sure) + 1e-9)) @ scaled + ridge, slope)
        found -= step * min(1.0, 2.0 / max(np.abs(step).max(), 1e-12))
    return found / scale


def _logistic(logits: np.ndarray) -> np.ndarray:
    return 1.0 / (1.0 + np.exp(-np.clip(logits, -60.0, 60.0)))


def confidences(weights: np.ndarray, judged: Sequence[Example]) -> np.ndarray:
    """The confidence of each example."""
    return _logistic(np.array([example.features for example in judged]) @ weights)


def left_out(found: Sequence[Example]) -> dict[str, np.ndarray]:
    """By log, the confidences that a model gives which never saw it."""
    logs = sorted({example.log for example in found})
    return {
        log: confidences(fit([example for example in found if example.log != log]), [e for e in found if e.log == log])
        for log in logs
    }


def table(found: Sequence[Example], accept: float) -> str:
    """What models that never saw a log accept of it, rightly and wrongly."""
    header = ["Log, left out", "benchmark: accepted, right %", "wrong", "recall at zero false accepts %"]
    header += ["drawn: pairs", "accepted, right", "wrong", "surest wrong"]
    return markdown(header, [_row(log, sure, found, accept) for log, sure in left_out(found).items()])


def _row(log: str, sure: np.ndarray, found: Sequence[Example], accept: float) -> list[object]:
    held = [example for example in found if example.log == log]
    right, drawn, doubtful, positive = (
        np.array([getattr(example, name) for example in held]) for name in ("right", "drawn", "doubtful", "positive")
    )
    accepted = (sure >= accept) & ~doubtful
    worst = sure[~positive & ~drawn].max(initial=0.0)
    return [
        log,
        percent(float((accepted & right & positive).sum() / positive.sum())),
        int((accepted & ~right & ~drawn).sum()),
        percent(float((right & positive & (sure > worst)).sum() / positive.sum())),
        int(drawn.sum()),
        int((accepted & right & drawn).sum()),
        int((accepted & ~right & drawn).sum()),
        f"{sure[~right & ~doubtful].max(initial=0.0):.3f}",
    ]


def main() -> None:
    """Match, fit, judge, print."""
    parser = arguments(__doc__)
    parser.add_argument("--drawn", type=int, default=2000, help="pairs drawn of each log beside the benchmark's")
    parser.add_argument("--accept", type=float, default=preset("verified").confidence_accept)
    options = parser.parse_args()
    parameters = preset("verified")
    found = [e for held in load(options.logs, options.pairs) for e in examples(held, options.drawn, parameters)]
    print(provenance(), table(found, options.accept), sep="\n\n")
    weights = fit(found).round(3).tolist()
    print(f"\n{sum(not e.drawn for e in found)} pairs of the benchmark, {sum(e.drawn for e in found)} drawn\n")
    print(dict(zip(("intercept", "gap", "consistency", "overlap", "detail"), weights, strict=True)))


if __name__ == "__main__":
    main()
