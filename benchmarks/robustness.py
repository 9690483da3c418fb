"""How far parameters, and a pose prior, may be off: the paper's V-C on public data, and its question of VI.

    python benchmarks/robustness.py [--parts parameters prior] [--each 12] [--logs DIR] [--pairs DIR]

parameters: pairs that the `consecutive` heuristic integrates rightly at the shipped defaults in paper mode, some of
every log, with one parameter at a time through its range (`segmap.walkthrough.SWEPT`): the share that stays right,
and the range over which at least nine in ten do. The paper, on three pairs of its own, reports 3 to 13 mm for
PointDistanceTolerance, 0.16 to 1.53 rad for AngleDifferenceTolerance, 8 to 131 for SegmentDistanceThreshold.
prior: consecutive and wide pairs of every log in verified mode, with a prior on the pose whose mean is off the truth by
a given distance and angle in a direction drawn by lot, once with honest standard deviations (as large as the error)
and once with ones of 0.3 m and 0.1 rad whatever the error: right answers, and accepted ones that are wrong.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from common import LogPairs, arguments, load, markdown, percent, provenance

from segmap.benchmark import Pair, is_right
from segmap.integration import Match, Verdict, match_maps
from segmap.parameters import Parameters, preset
from segmap.pose import Pose2
from segmap.priors import PosePrior
from segmap.segments import SegmentMap
from segmap.walkthrough import SWEPT, sweep

SWEEPS = ("point_distance_tolerance", "angle_difference_tolerance", "segment_distance_threshold")
ERRORS = ((0.0, 0.0), (0.1, 0.03), (0.3, 0.1), (0.6, 0.2), (1.0, 0.35), (2.0, 0.7), (4.0, 1.4))
"""metres and radians by which the mean of the prior is off"""
CONFIDENT = 0.3, 0.1
"""standard deviations, metres and radians, of a prior that is sure of itself whatever its error"""
LEAST = 0.05, 0.02
"""of an honest one, at the least"""
STAYS = 0.9
Chosen = list[tuple[LogPairs, Pair]]


def some(logs: Sequence[LogPairs], kinds: Sequence[str], each: int) -> Chosen:
    """``each`` pairs of every kind of every log, evenly taken."""
    chosen: Chosen = []
    for held in logs:
        for kind in kinds:
            pairs = held.of_kind(kind)
            chosen += [(held, pair) for pair in pairs[:: max(1, len(pairs) // each)][:each]]
    return chosen


# --- parameters (V-C) -------------------------------------------------------------------------------


def robust(logs: Sequence[LogPairs], each: int) -> Iterator[str]:
    """A table for each parameter."""
    parameters = Parameters()
    right = [(held, pair) for held, pair in some(logs, ("consecutive",), 3 * each) if _right(held, pair, parameters)]
    yield f"{len(right)} pairs that are right at the defaults"
    for name in SWEEPS:
        hits = np.zeros(len(SWEPT[name]))
        for held, pair in right:
            how = pair.truth, parameters, "consecutive", "paper", name
            hits += [bool(run.right) for run in sweep(partial(held.maps, pair), *how)]
        shares = hits / len(right)
        values = sorted(SWEPT[name])
        rows = [(f"{value:g}", percent(share)) for value, share in zip(values, shares, strict=True)]
        stays = [value for value, share in zip(values, shares, strict=True) if share >= STAYS]
        within = f"{stays[0]:g} to {stays[-1]:g}" if stays else "nowhere"
        told = f"at least {100 * STAYS:.0f} % right: {within}; now {getattr(parameters, name):g}"
        yield f"#### {name}\n\n{markdown((name, 'right %'), rows)}\n\n{told}"


def _right(held: LogPairs, pair: Pair, parameters: Parameters) -> bool:
    match = match_maps(*held.maps(pair, parameters), parameters, "consecutive", "paper")
    return is_right(match.T_1_2, pair.truth)


# --- pose prior (VI) --------------------------------------------------------------------------------


def sensitive(logs: Sequence[LogPairs], each: int) -> str:
    """Right answers by the error of the prior's mean."""
    parameters, generator = preset("verified"), np.random.default_rng(0)
    chosen = some(logs, ("consecutive", "wide"), each)
    maps = [held.maps(pair, parameters) for held, pair in chosen]
    alone = _scored(chosen, [match_maps(*both, parameters, None, "verified") for both in maps])
    rows: list[tuple[str, ...]] = [("no prior", *alone, *alone)]
    for metres, radians in ERRORS:
        turns = generator.uniform(-math.pi, math.pi, len(chosen))
        signs = generator.choice((-1.0, 1.0), len(chosen))
        means = [
            _off(pair.truth, metres, radians * sign, turn)
            for (_, pair), turn, sign in zip(chosen, turns, signs, strict=True)
        ]
        honest = max(metres, LEAST[0]), max(radians, LEAST[1])
        told = [_scored(chosen, _with_priors(maps, means, how, parameters)) for how in (honest, CONFIDENT)]
        rows.append((f"{metres:g} m, {radians:g} rad", *told[0], *told[1]))
    head = ("mean off by", "honest: right %", "accepted %", "accepted wrong %")
    return f"{len(chosen)} pairs\n\n" + markdown((*head, "sure: right %", "accepted %", "accepted wrong %"), rows)


def _off(truth: Pose2 | None, metres: float, radians: float, turn: float) -> Pose2:
    assert truth is not None
    return Pose2(truth.x + metres * math.cos(turn), truth.y + metres * math.sin(turn), truth.theta + radians)


def _with_priors(
    maps: Sequence[tuple[SegmentMap, SegmentMap]],
    means: Sequence[Pose2],
    deviations: tuple[float, float],
    parameters: Parameters,
) -> list[Match]:
    metres, radians = deviations
    priors = [PosePrior.with_deviations(mean, metres, metres, radians) for mean in means]
    return [
        match_maps(*both, parameters, None, "verified", prior=prior) for both, prior in zip(maps, priors, strict=True)
    ]


def _scored(chosen: Chosen, matches: Sequence[Match]) -> tuple[str, str, str]:
    right = [is_right(match.T_1_2, pair.truth) for (_, pair), match in zip(chosen, matches, strict=True)]
    accepted = [match.verdict is Verdict.ACCEPTED for match in matches]
    wrong = [said and not hit for said, hit in zip(accepted, right, strict=True)]
    return percent(float(np.mean(right))), percent(float(np.mean(accepted))), percent(float(np.mean(wrong)))


def main() -> None:
    """Measure and print."""
    parser = arguments(__doc__)
    parser.add_argument("--parts", nargs="+", choices=("parameters", "prior"), default=("parameters", "prior"))
    parser.add_argument("--each", type=int, default=12, help="pairs of each kind of each log")
    options = parser.parse_args()
    logs = load(options.logs, options.pairs)
    print(provenance(), end="\n\n", flush=True)
    if "parameters" in options.parts:
        print("### Parameters (V-C)", *robust(logs, options.each), sep="\n\n", end="\n\n", flush=True)
    if "prior" in options.parts:
        print("### A prior that is off (VI)", sensitive(logs, options.each), sep="\n\n", flush=True)


if __name__ == "__main__":
    main()
