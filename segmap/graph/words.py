"""What the graph makes of an edge, in words."""

from __future__ import annotations

import math

from segmap.graph.edges import Edge
from segmap.graph.optimised import Optimised, Residual
from segmap.graph.ways import Loop, Ways, loop_of

__all__ = ["described_loop", "explain", "in_words"]

SHOWN = 4
"""scans of a loop that are named; longer ones are shortened"""
_BY = {
    "matched": "You accepted {name}",
    "imported": "The imported graph holds {name}",
    "manual": "You placed {name} by hand",
}


def explain(result: Optimised, residual: Residual, ways: Ways | None = None) -> tuple[str, ...]:
    """Sentences on one edge: whether it is silenced, how far off it is, and which loop it closes.

    ``ways`` is the net of the edges that count, :meth:`Optimised.ways`; give it where many edges are explained.
    """
    edge = residual.edge
    loop = loop_of(edge, ways or result.ways())
    return (_verdict(residual, result), *_loop(edge, loop))


def _verdict(residual: Residual, result: Optimised) -> str:
    gate = result.gate
    said = _BY[residual.edge.source].format(name=residual.edge.name)
    off = f"{in_words(residual.translation, residual.rotation)}, {residual.chi:.1f} standard deviations"
    if residual.silenced:
        return (
            f"{said}, the optimiser silences it: it puts scan {residual.edge.second} {off} from where the other"
            f" edges have it; {_limit(residual, result)}."
        )
    if residual.chi > gate:
        why = "it is trusted" if residual.edge.trusted else "nothing else holds what it joins"
        return (
            f"{said}, and the graph keeps it because {why}; it is {off} off, more than the {gate:g} believed of others."
        )
    return f"{said}, and the graph agrees: it is {off} off."


def _limit(residual: Residual, result: Optimised) -> str:
    if residual.chi <= result.gate and residual.translation > result.most:
        return f"more than {result.most:g} m are not believed, however little it claims to know"
    return f"more than {result.gate:g} are not believed"


def _loop(edge: Edge, loop: Loop | None) -> tuple[str, ...]:
    if loop is None:
        return (f"Nothing checks it: no other edge joins what lies on the two sides of {edge.name}.",)
    return (described_loop(loop),)


def described_loop(loop: Loop) -> str:
    """A loop and its miss in a sentence."""
    named = loop.scans if len(loop.scans) <= SHOWN else (*loop.scans[:2], "...", *loop.scans[-2:])
    way = " - ".join(str(scan) for scan in named)
    return (
        f"It closes a loop of {len(loop.scans)} scans ({way}), which misses itself by"
        f" {in_words(loop.translation, loop.rotation)}: {loop.chi:.1f} standard deviations of its edges together."
    )


def in_words(translation: float, rotation: float) -> str:
    """Metres and degrees for people.

    >>> in_words(0.4321, 0.1)
    '0.43 m and 5.7 degrees'
    """
    return f"{translation:.2f} m and {math.degrees(rotation):.1f} degrees"
