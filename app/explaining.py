"""Why the candidate shown has its value and its score, as JSON: what a page lists, and marks in step with the scene."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from app.content import Content, Pair
from app.palette import hexadecimal
from segmap.explanation import Explanation, MapSight, PairTerm, explain

__all__ = ["explained"]


def explained(content: Content) -> dict[str, Any] | None:
    """The terms of the value by chain and pair of segments, those of the score by segment; lengths in metres."""
    pair = content.pair
    if pair is None or pair.candidate is None:
        return None
    told = explain(*pair.maps, pair.candidate.T_1_2, pair.parameters)
    places = _places(pair, told)
    chains = [_chain(place, told, k, content) for place, k in sorted((place, k) for k, place in places.items())]
    return {
        "integration": pair.integration,
        "names": list(pair.names),
        "value": told.value,
        "discarded": told.discarded,
        "chains": chains,
        "small": [_pair(one) for one in told.pairs if one.chain is None],
        "crossings": [asdict(crossing) for crossing in told.crossings],
        "score": told.score,
        "terms": told.terms,
        "conflicts": _conflicts(told.sights),
    }


def _places(pair: Pair, told: Explanation) -> dict[int, int]:
    """Which place among the chains as they are drawn each chain of the explanation has."""
    drawn = {(pair.chains[k].first, pair.chains[k].second): place for place, k in enumerate(pair.by_value)}
    return {k: drawn.get((chain.first, chain.second), len(drawn) + k) for k, chain in enumerate(told.chains)}


def _chain(place: int, told: Explanation, k: int, content: Content) -> dict[str, Any]:
    chain = told.chains[k]
    pairs = sorted((one for one in told.pairs if one.chain == k), key=lambda one: -one.value)
    return {
        "number": place + 1,
        "colour": hexadecimal(content.palette.chain(place)),
        "value": chain.value,
        "first": list(chain.first),
        "second": list(chain.second),
        "pairs": [_pair(one) for one in pairs],
    }


def _pair(one: PairTerm) -> dict[str, Any]:
    return asdict(one)


def _conflicts(sights: tuple[MapSight, MapSight] | None) -> list[dict[str, Any]]:
    """The segments whose returns the other scan's lines of sight deny, the worst first."""
    if sights is None:
        return []
    found: list[dict[str, Any]] = [
        {"source": source, "segment": term.segment, "contradicted": term.evidence.contradicted, "score": term.score}
        for source, side in zip(("first", "second"), sights, strict=True)
        for term in side.segments
        if term.evidence.contradicted > 0.0
    ]
    order = np.argsort([-one["contradicted"] for one in found], kind="stable")
    return [found[k] for k in order]
