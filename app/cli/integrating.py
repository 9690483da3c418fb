"""``integrate``: two scans of a log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Annotated, Any

import typer

from app.cli.compiling import compiling
from app.cli.explaining import explanation_json, print_explanation
from app.cli.options import (
    DEFAULT_MODE,
    Explain,
    Heuristic,
    Json,
    Log,
    Mode,
    Preset,
    Prior,
    PriorDeviations,
    Setting,
    method_of,
    prior_of,
    segment_maps,
)
from app.cli.output import pose_json, print_facts, print_json, show_pose
from segmap.explanation import explain
from segmap.integration import Candidate, Match, match_maps

__all__ = ["integrate"]


def integrate(
    log: Log,
    first: Annotated[int, typer.Argument(metavar="I", help="Index of the first scan, from 0.", show_default=False)],
    second: Annotated[int, typer.Argument(metavar="J", help="Index of the second scan.", show_default=False)],
    mode: Mode = DEFAULT_MODE,
    heuristic: Heuristic = None,
    preset: Preset = None,
    settings: Setting = None,
    prior: Prior = None,
    prior_std: PriorDeviations = None,
    explained: Explain = False,
    as_json: Json = False,
) -> None:
    """Find the pose of scan J in the frame of scan I, from their segments alone.

    A file of segment maps, such as an exported GeoJSON file, takes the place of a log: I and J are then its maps.
    """
    method = method_of(mode, heuristic, preset, settings)
    name, map_of = segment_maps(log, method.parameters)
    map_1, map_2 = map_of(first), map_of(second)
    expected = prior_of(prior, prior_std)
    with compiling() as compiled:
        match = match_maps(map_1, map_2, method.parameters, method.heuristic, method.mode, prior=expected)
    match = replace(match, milliseconds=max(0.0, match.milliseconds - compiled.milliseconds))
    explanation = None
    if explained and match.T_1_2 is not None:
        explanation = explain(map_1, map_2, match.T_1_2, method.parameters, sights=method.mode != "paper")
    if as_json:
        more = {"explanation": explanation_json(match, explanation)} if explained else {}
        print_json({"log": name, "scans": [first, second], **_document(match), **more})
        return
    print_facts(_facts(match, first, second))
    if explanation is not None:
        print_explanation(match, explanation)


def _document(match: Match) -> dict[str, Any]:
    draws = {} if match.draws is None else {"draws": match.draws}
    return {
        "pose": pose_json(match.T_1_2),
        "value": match.value,
        "mode": match.mode,
        "heuristic": match.heuristic,
        "candidates": match.candidates,
        **draws,
        "discarded": match.discarded,
        "confidence": match.confidence,
        "verdict": str(match.verdict),
        "reasons": list(match.reasons),
        "chains": [[list(pair[:2]) for pair in chain.pairs] for chain in match.chains],
        "segments": list(match.segments),
        "milliseconds": match.milliseconds,
        **({} if match.confidence is None or match.best is None else _verified(match.best, match.ranked[1:])),
    }


def _verified(best: Candidate, rivals: Sequence[Candidate]) -> dict[str, Any]:
    """What verified mode knows of the best candidate, and of its distinct rivals."""
    told = [{"pose": pose_json(rival.T_1_2), "value": rival.value, **_grounds(rival)} for rival in rivals]
    return {**_grounds(best), "rivals": told}


def _grounds(candidate: Candidate) -> dict[str, Any]:
    seen, held = candidate.evidence, candidate.uncertainty
    return {
        "score": candidate.score,
        "evidence": None if seen is None else {**asdict(seen), "agreement": seen.agreement, "overlap": seen.overlap},
        "uncertainty": None if held is None else asdict(held),
    }


def _facts(match: Match, first: int, second: int) -> dict[str, object]:
    draws = "" if match.draws is None else f" of {match.draws} draws"
    return {
        "verdict": match.verdict,
        "reasons": " ".join(match.reasons),
        f"pose of {second} in {first}": show_pose(match.T_1_2),
        "value": f"{match.value:.3f} m",
        **({} if match.confidence is None else {"confidence": f"{match.confidence:.1%}"}),
        "chains": f"{len(match.chains)}, of {sum(len(chain.pairs) for chain in match.chains)} pairs of segments",
        "candidates": f"{match.candidates}{draws}, {match.discarded} discarded ({match.mode}, {match.heuristic})",
        "segments": " and ".join(map(str, match.segments)),
        "time": f"{match.milliseconds:.1f} ms",
    }
