"""The guided lesson: stops on the sample logs, each an address that restores exactly one view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode

__all__ = ["LESSON", "Stop", "lesson_document"]

LABORATORY = {"sample": "laboratory", "pair": "0.0-0.1", "mode": "paper", "heuristic": "consecutive"}
HALL = {"sample": "hall", "pair": "0.8-0.9", "mode": "paper"}
CORRIDOR = {"sample": "office", "pair": "0.46-0.48", "heuristic": "all"}
MERGE = {"sample": "hall", "merge": "0.10-0.16", "mode": "verified"}


@dataclass(frozen=True)
class Stop:
    """One stop of the lesson."""

    title: str
    say: str
    asked: dict[str, str]
    """which walkthrough"""
    stage: str
    step: str
    """a number, or the label of a mark"""

    def url(self, number: int) -> str:
        """The address of the view."""
        return "/walk?" + urlencode({**self.asked, "stage": self.stage, "step": self.step, "lesson": number})


LESSON = (
    Stop(
        "A scan is a row of points",
        "The sensor turned once and measured how far it is to the next thing in each direction. Points close together"
        " in the row are one cluster. Step on and watch each cluster become straight segments.",
        LABORATORY,
        "points-1",
        "clusters",
    ),
    Stop(
        "Nobody knows where the scans were taken",
        "Blue and orange are two scans of one room. Where was the robot when it took the second one? Without a pose to"
        " start from, something must be found that looks the same from both places.",
        LABORATORY,
        "candidates",
        "the idea",
    ),
    Stop(
        "Why angles",
        "The length of a wall depends on how much of it one saw. The angle between two walls does not: it is the same"
        " from everywhere. Lay an angle of one scan on an equal angle of the other, and all of it falls into place, or"
        " not. Each such guess is a candidate.",
        LABORATORY,
        "candidates",
        "the candidate that turns out best",
    ),
    Stop(
        "What a candidate is worth",
        "Under a good candidate many segments lie along each other. The common length, in metres, is its value. Step"
        " back and forth: wrong candidates have small values.",
        LABORATORY,
        "evaluation",
        "the moment the best candidate was found",
    ),
    Stop(
        "A metre is not always a metre",
        "What two segments that do not touch have in common is multiplied by 0.95 for each tolerance of distance"
        " between them. a and b are how far the ends of the one lie from the line of the other, c and d the other way"
        " round; the larger of each two, and of these the smaller, is what counts.",
        {**HALL, "heuristic": "consecutive"},
        "pairs:best",
        "a strong penalty (Fig. 3)",
    ),
    Stop(
        "Why some are thrown away at once",
        "Two long walls that go through each other: no building looks like that. Such a candidate is discarded before"
        " anything is added up. Short segments may cross, they may be a chair that was moved.",
        {**HALL, "heuristic": "all"},
        "evaluation",
        "the first candidate that is discarded",
    ),
    Stop(
        "Why long segments",
        "A short segment is mostly noise: its direction is known badly, and one finds another like it everywhere. The"
        " random heuristic therefore draws from the longest segments first. Compare the draws of round 1 with those of"
        " the last round.",
        {**HALL, "heuristic": "random"},
        "draws",
        "round 1",
    ),
    Stop(
        "Buildings have two directions",
        "Add up the length of the segments by direction: in a building two bars stand out, along the walls and across."
        " The histogram heuristic takes only angles between the two, and has far fewer candidates to try.",
        {**HALL, "heuristic": "histogram"},
        "angles-1",
        "the idea",
    ),
    Stop(
        "Why corridors are ambiguous",
        "Two parallel walls fit each other wherever one slides the scan along them. Here the candidate of the highest"
        " value says that the robot did not move at all. It is wrong by two metres.",
        {**CORRIDOR, "mode": "paper"},
        "evaluation",
        "the moment the best candidate was found",
    ),
    Stop(
        "The truth is among the candidates",
        "This candidate has a lower value, and is right: few segments tell where along the corridor one is. Value alone"
        " cannot see it.",
        {**CORRIDOR, "mode": "paper"},
        "evaluation",
        "the candidate nearest to the truth",
    ),
    Stop(
        "What beams know that segments do not",
        "Along every beam the way is free up to the point it met. A candidate that puts a wall of one scan where the"
        " other one looked through is contradicted. By this verified mode finds the right place in the same corridor.",
        {**CORRIDOR, "mode": "verified"},
        "sight",
        "both scans",
    ),
    Stop(
        "Chains",
        "Once the maps lie on each other, everything that hangs together by matching is one wall, or walls that join,"
        " seen twice: a chain."
        " Chains that are found are what the two scans really have in common.",
        {**HALL, "heuristic": "consecutive"},
        "chains",
        "all chains",
    ),
    Stop(
        "One polyline for each wall",
        "A polyline takes the place of a chain. It is bent through the segment that lies farthest from it, again and"
        " again. Greedy uses each segment once; plain may go round in circles and is then stopped.",
        {**HALL, "heuristic": "consecutive"},
        "polylines",
        "the largest chain",
    ),
    Stop(
        "Why the tree method doubles walls",
        "The tree integrates maps that share all scans but two: the same walls are fused over and over, each time not"
        " quite alike, and what does not fuse stays twice. Compare it with the pivot method, which fuses each scan"
        " once.",
        MERGE,
        "comparison",
        "tree",
    ),
    Stop(
        "Everything at once",
        "Each integration is a little wrong. The pose graph moves all scans until all integrations together fit best;"
        " one that contradicts the others is silenced.",
        MERGE,
        "graph",
        "the beginning",
    ),
)
"""in the order they are to be seen"""


def lesson_document() -> dict[str, Any]:
    """The lesson as plain data."""
    stops = [{"title": stop.title, "say": stop.say, "url": stop.url(number)} for number, stop in enumerate(LESSON, 1)]
    return {"stops": stops}
