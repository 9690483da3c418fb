"""Many maps -> one map, or as many as the evidence holds together (Section IV)."""

from segmap.merging.components import METHODS, Accepted, Component, Merge, map_hash, merge, merge_accepted, neighbours

__all__ = ["METHODS", "Accepted", "Component", "Merge", "map_hash", "merge", "merge_accepted", "neighbours"]
