"""A run, step by step, for teaching: what the library told while it worked, as pictures, lines and sentences.

>>> import numpy as np
>>> room = SegmentMap(np.array([[0.0, 0.0, 4.0, 0.0], [4.0, 0.0, 4.0, 3.0], [4.0, 3.0, 0.0, 3.0]]))
>>> walk = walk_maps(room, room).walk
>>> [stage.id for stage in walk.stages][:3]
['angles-1', 'angles-2', 'candidates']
>>> walk.stage("evaluation").step(1).line
'21'
"""

from segmap.segments import SegmentMap
from segmap.walkthrough.graphs import walk_graph
from segmap.walkthrough.lines import ALGORITHMS
from segmap.walkthrough.merges import MergeWalk, walk_merge
from segmap.walkthrough.pairs import PairWalk, walk_maps, walk_scans
from segmap.walkthrough.races import SWEPT, Run, race, sweep
from segmap.walkthrough.steps import Mark, Shape, Stage, Step, Walkthrough

__all__ = [
    "ALGORITHMS",
    "SWEPT",
    "Mark",
    "MergeWalk",
    "PairWalk",
    "Run",
    "SegmentMap",
    "Shape",
    "Stage",
    "Step",
    "Walkthrough",
    "race",
    "sweep",
    "walk_graph",
    "walk_maps",
    "walk_merge",
    "walk_scans",
]
