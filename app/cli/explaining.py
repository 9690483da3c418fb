"""``integrate --explain``: what makes up a value and a score, in tables for people."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from typing import Any

import typer

from app.cli.output import print_table
from segmap.explanation import Explanation, PairTerm, SegmentTerm
from segmap.integration import Match, findings_of
from segmap.verdict import confidence_terms
from segmap.visibility import Evidence

__all__ = ["explanation_json", "print_explanation"]

SHOWN = 10
"""rows of a table; the rest is summed up in a line"""


def explanation_json(match: Match, explanation: Explanation | None) -> dict[str, Any] | None:
    """An explanation for programs, with what adds to the logit of the confidence."""
    if explanation is None:
        return None
    return {**json.loads(explanation.to_json()), "confidence": _logit(match)}


def _logit(match: Match) -> dict[str, float] | None:
    found = findings_of(match)
    return None if found is None else confidence_terms(found)


def print_explanation(match: Match, explanation: Explanation) -> None:
    """What adds most to the value, what crosses, and what speaks against the candidate."""
    _print_value(explanation)
    _print_crossings(explanation)
    _print_score(explanation)
    logit = _logit(match)
    if logit is not None:
        typer.echo(f"\nlogit of the confidence {sum(logit.values()):.2f} = {_sum(logit)}")


def _print_value(explanation: Explanation) -> None:
    typer.echo(f"\nvalue {explanation.value:.3f} m = {len(explanation.pairs)} pairs of segments")
    best = sorted(explanation.pairs, key=lambda pair: -pair.value)
    rows = [_pair_row(pair) for pair in best[:SHOWN]]
    if rows:
        print_table(("segments", "value m", "distance m", "factor", "common 1 m", "common 2 m", "chain"), rows)
    if best[SHOWN:]:
        typer.echo(f"and {len(best) - SHOWN} more: {sum(pair.value for pair in best[SHOWN:]):.3f} m")


def _pair_row(pair: PairTerm) -> tuple[object, ...]:
    metres = (pair.value, pair.distance, pair.factor, pair.common_1, pair.common_2)
    chain = "" if pair.chain is None else pair.chain
    return f"{pair.first}, {pair.second}", *(f"{entry:.3f}" for entry in metres), chain


def _print_crossings(explanation: Explanation) -> None:
    for c in explanation.crossings[:SHOWN]:
        where = f"x {c.x:.2f} m, y {c.y:.2f} m, at {math.degrees(c.angle):.0f} deg"
        typer.echo(f"segments {c.first} and {c.second} cross at {where}: paper mode discards this candidate")
    if explanation.crossings[SHOWN:]:
        typer.echo(f"and {len(explanation.crossings) - SHOWN} more cross")


def _print_score(explanation: Explanation) -> None:
    if explanation.score is None or explanation.terms is None or explanation.sights is None:
        return
    typer.echo(f"\nscore {explanation.score:.3f} m = {_weighted(explanation.terms, explanation.evidence)}")
    worst = sorted(
        ((which, term) for which, side in enumerate(explanation.sights, 1) for term in side.segments),
        key=lambda entry: entry[1].score,
    )
    rows = [(_where(which, term), *_metres(term)) for which, term in worst[:SHOWN]]
    print_table(("worst segments", "score m", "supported m", "contradicted m", "shadowed m", "unseen m"), rows)


def _where(which: int, term: SegmentTerm) -> str:
    return f"map {which}, " + ("none" if term.segment is None else f"segment {term.segment}")


def _metres(term: SegmentTerm) -> tuple[str, ...]:
    seen = term.evidence
    parts = (term.score, seen.supported, seen.contradicted, seen.shadowed, seen.unseen)
    return tuple(f"{part:.2f}" for part in parts)


def _weighted(terms: dict[str, float], evidence: Evidence | None) -> str:
    """What a score is made of: the metres of each kind of evidence, with the weight they have where it is not one.

    >>> _weighted({"supported": 2.0, "contradicted": -0.5}, Evidence(2.0, 0.25, 0.0, 0.0, 0.0, 0.0))
    '2.00 supported - 2 x 0.25 contradicted'
    """
    seen = {} if evidence is None else asdict(evidence)
    weights = {name: abs(term) / seen[name] if seen.get(name) else 1.0 for name, term in terms.items()}
    text = " ".join(
        f"{'-' if term < 0.0 else '+'} {_times(weights[name])}{abs(term) / weights[name]:.2f} {name}"
        for name, term in terms.items()
    )
    return text.removeprefix("+ ")


def _times(weight: float) -> str:
    return "" if math.isclose(weight, 1.0) else f"{weight:g} x "


def _sum(terms: dict[str, float]) -> str:
    """Terms in a row, each with its sign.

    >>> _sum({"supported": 2.0, "contradicted": -0.5})
    '2.00 supported - 0.50 contradicted'
    """
    text = " ".join(f"{'-' if term < 0.0 else '+'} {abs(term):.2f} {name}" for name, term in terms.items())
    return text.replace("- ", "-", 1) if text.startswith("-") else text.removeprefix("+ ")
