"""Many maps -> one map, or as many as the evidence holds together (Section IV).

:func:`merge` takes sequences of maps, by one of three methods; :func:`extend` adds a scan; :func:`merge_accepted`
makes the map of what was decided. A merge keeps the tree of its integrations, to be looked at one by one. What
cannot be integrated is a component of its own: nothing is ever placed without evidence.
"""

from segmap.merging.calls import Call, Decided, Given, Link, Pair
from segmap.merging.closing import Closure
from segmap.merging.components import Accepted, Component, map_hash, merge_accepted
from segmap.merging.misfit import misfit, witnesses
from segmap.merging.nodes import Flag, MergeNode, MergeStep, outline
from segmap.merging.online import extend
from segmap.merging.sequences import METHODS, Merge, calls_needed, merge, neighbours

__all__ = [
    "METHODS",
    "Accepted",
    "Call",
    "Closure",
    "Component",
    "Decided",
    "Flag",
    "Given",
    "Link",
    "Merge",
    "MergeNode",
    "MergeStep",
    "Pair",
    "calls_needed",
    "extend",
    "map_hash",
    "merge",
    "merge_accepted",
    "misfit",
    "neighbours",
    "outline",
    "witnesses",
]
