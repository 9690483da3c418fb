"""Heuristics against each other, and one parameter through its range, on one pair of maps (Tables 2 and 3, V-C)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from segmap.benchmark import is_right
from segmap.errors import ParameterError
from segmap.integration import DEFAULT_PRESET, MODES, heuristics, match_maps
from segmap.matches import Match
from segmap.parameters import Parameters, describe, preset
from segmap.pose import Pose2
from segmap.segments import SegmentMap

__all__ = ["SWEPT", "Run", "race", "sweep"]

MapsFor = Callable[[Parameters], tuple[SegmentMap, SegmentMap]]
"""the two maps under some parameters: those of scans depend on them"""
SWEPT = {
    "point_distance_tolerance": (0.002, 0.004, 0.008, 0.015, 0.02, 0.03, 0.045, 0.06, 0.09, 0.13),
    "angle_difference_tolerance": (0.02, 0.05, 0.1, 0.16, 0.2, 0.3, 0.5, 0.8, 1.2, 1.53),
    "segment_distance_threshold": (1.0, 2.0, 4.0, 6.0, 8.0, 12.0, 20.0, 40.0, 80.0, 131.0),
    "segment_length_refuse": (0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 2.0, 4.0, 8.0),
    "segment_length_percentage": (0.0, 2.0, 5.0, 10.0, 20.0, 30.0, 40.0, 60.0),
    "fusion_tolerance": (0.005, 0.015, 0.03, 0.05, 0.1, 0.2),
    "split_tolerance": (0.01, 0.02, 0.025, 0.03, 0.05, 0.1),
}
"""parameters that are swept, and the values they take; the paper varies the first three (V-C)"""
MOST = 20
"""values of a sweep"""


@dataclass(frozen=True)
class Run:
    """One match of the pair."""

    label: str
    mode: str
    heuristic: str
    value: float
    """metres, of the best candidate; 0 where there is none"""
    tries: int
    """candidates evaluated"""
    milliseconds: float
    verdict: str
    right: bool | None
    """whether the best candidate is where the truth has it; None where the truth is not known"""
    setting: float | None = None
    """of a sweep: the value of the parameter"""


def race(maps: MapsFor, truth: Pose2 | None, parameters: Parameters | None = None) -> Iterator[Run]:
    """Every heuristic of either mode on one pair: tries, time, value, right or wrong.

    ``parameters`` are those of either mode; None: each mode's own.
    """
    for mode in MODES:
        how = parameters or preset(DEFAULT_PRESET[mode])
        map_1, map_2 = maps(how)
        for heuristic in heuristics(mode):
            match = match_maps(map_1, map_2, how, heuristic, mode)
            yield _run(match, f"{mode}, {heuristic}", truth)


def sweep(
    maps: MapsFor,
    truth: Pose2 | None,
    parameters: Parameters,
    heuristic: str,
    mode: str,
    name: str,
    values: Sequence[float] | None = None,
) -> Iterator[Run]:
    """One pair matched with one parameter at several values, ascending.

    Raises:
        ParameterError: there is no such parameter, it is no number, or there are too many values.
    """
    chosen = SWEPT.get(name) if values is None else tuple(values)
    if chosen is None:
        known = {told["name"] for told in describe()}
        what = f"{name[:80]!r} has no values to sweep" if name in known else f"There is no parameter {name[:80]!r}"
        raise ParameterError(f"{what}. Swept are: {', '.join(SWEPT)}; or give the values.")
    if not 1 <= len(chosen) <= MOST:
        raise ParameterError(f"A sweep takes 1 to {MOST} values, not {len(chosen)}.")
    for value in sorted(chosen):
        how = parameters.replace(**{name: value})
        match = match_maps(*maps(how), how, heuristic, mode)
        yield _run(match, f"{value:g}", truth, value)


def _run(match: Match, label: str, truth: Pose2 | None, setting: float | None = None) -> Run:
    right = None if truth is None else is_right(match.T_1_2, truth)
    return Run(
        label=label,
        mode=match.mode,
        heuristic=match.heuristic,
        value=match.value,
        tries=match.candidates,
        milliseconds=match.milliseconds,
        verdict=str(match.verdict),
        right=right,
        setting=setting,
    )
