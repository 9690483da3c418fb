"""INTEGRATE on two scans or two maps, recorded, as a walkthrough from the points to the verdict."""

from __future__ import annotations

from dataclasses import dataclass

from segmap import tracing
from segmap.integration import Integration, integrate
from segmap.parameters import Parameters
from segmap.pose import Pose2
from segmap.scans import LaserScan
from segmap.segments import SegmentMap, extract
from segmap.tracing import Trace
from segmap.walkthrough.angles import angles_stages, candidates_stage, draws_stage
from segmap.walkthrough.found import Found
from segmap.walkthrough.fusing import chains_stage, polylines_stage
from segmap.walkthrough.points import points_stage
from segmap.walkthrough.results import result_stage
from segmap.walkthrough.sights import refinement_stage, sight_stage
from segmap.walkthrough.steps import Stage, Walkthrough, rounded
from segmap.walkthrough.values import PAIRS, evaluation_stage, pairs_stage

__all__ = ["PairWalk", "walk_maps", "walk_scans"]


@dataclass(frozen=True, eq=False)
class PairWalk:
    """A walkthrough of one integration, with what the run found: the very same as without recording."""

    walk: Walkthrough
    integration: Integration
    found: Found


def walk_scans(
    scan_1: LaserScan,
    scan_2: LaserScan,
    parameters: Parameters | None = None,
    heuristic: str | None = None,
    mode: str = "paper",
    title: str = "",
    truth: Pose2 | None = None,
    names: tuple[str, str] = ("", ""),
) -> PairWalk:
    """A walkthrough of two scans, their points and how they become segments included.

    ``truth``, ``T_1_2`` where it is known, is shown at the end and never used. ``names``: those of the scans in their
    log, such as ``0.21``.

    Raises:
        ParameterError: there is no such heuristic or mode.
    """
    parameters = parameters or Parameters()
    with tracing.recording() as trace:
        maps = extract(scan_1, parameters, index=0), extract(scan_2, parameters, index=1)
    told = zip(trace.all("segments"), names, strict=True)
    points = [points_stage(which, event, parameters, name) for which, (event, name) in enumerate(told, start=1)]
    return _walk(maps, points, parameters, heuristic, mode, title, truth)


def walk_maps(
    map_1: SegmentMap,
    map_2: SegmentMap,
    parameters: Parameters | None = None,
    heuristic: str | None = None,
    mode: str = "paper",
    title: str = "",
) -> PairWalk:
    """A walkthrough of two maps, from their angles on.

    Raises: as :func:`walk_scans`.
    """
    return _walk((map_1, map_2), [], parameters or Parameters(), heuristic, mode, title)


def _walk(
    maps: tuple[SegmentMap, SegmentMap],
    points: list[Stage],
    parameters: Parameters,
    heuristic: str | None,
    mode: str,
    title: str,
    truth: Pose2 | None = None,
) -> PairWalk:
    with tracing.recording() as trace:
        integration = integrate(*maps, parameters, heuristic, mode)
    found = Found.of(trace, *maps, parameters)
    stages = [*points, *_stages(trace, maps, integration, found, truth)]

    def more(id: str) -> Stage | None:
        number = id.removeprefix(PAIRS)
        if number == "best" and found.best is not None:
            return pairs_stage(found, found.best)
        inside = id.startswith(PAIRS) and number.isdecimal() and len(number) < 10 and 1 <= int(number) <= len(found)
        return pairs_stage(found, int(number) - 1) if inside else None

    base = {"first": rounded(maps[0].coordinates), "second": rounded(maps[1].coordinates)}
    return PairWalk(Walkthrough(title, tuple(stages), base, more), integration, found)


def _stages(
    trace: Trace,
    maps: tuple[SegmentMap, SegmentMap],
    integration: Integration,
    found: Found,
    truth: Pose2 | None,
) -> list[Stage]:
    match, parameters = integration.match, found.parameters
    stages = [*angles_stages(trace, parameters), *draws_stage(trace, maps, parameters)]
    if len(found):
        stages += [candidates_stage(found), evaluation_stage(found, match, truth)]
    if found.best is not None:
        stages.append(pairs_stage(found, found.best))
    if match.T_1_2 is not None:
        stages += refinement_stage(trace, match, parameters, found.box)
        known_as = "The refined candidate" if match.mode != "paper" else "The best candidate"
        stages += sight_stage(maps, match.T_1_2, parameters, found.box, known_as)
        stages += [*chains_stage(trace, maps, found.box), *polylines_stage(trace, parameters)]
    return [*stages, result_stage(match, integration.fusion, found, truth)]
