"""Loop closures on public logs, as Markdown: what is found, and what is wrongly believed.

    python benchmarks/closures.py [--tables recall wrong] [--logs DIR] [--names intel aces ...]

``recall``: the search on a whole log against the log's own poses. A true revisit is two scans more than 30 apart in
the log, within 2 m, with at least half of what they see in common; pairs no more than 3 scans from each other at both
ends are one revisit. A closure is right within 0.25 m and 5 degrees of the log's poses, which are themselves good to
0.16 m and 2.5 degrees (95 %). ``wrong``: 100 wrong closures injected into the graph the search curated: a third
random, a third the best candidates of pairs that share no wall, a third right ones shifted along their weakest
direction by 0.5 to 3 m, each with the covariance its geometry gives there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from common import arguments, load, markdown, provenance
from scipy.spatial import cKDTree

from segmap.benchmark import NEGATIVE, Pair, is_right
from segmap.graph import Edge, Optimised, optimise
from segmap.graph.edges import Parts
from segmap.integration import Verdict, match_maps
from segmap.links import DOUBT, FLOOR, Link, covariance_of
from segmap.logs import read_log
from segmap.loops import Scene
from segmap.mapping import WholeMap, map_scans
from segmap.parameters import Parameters, preset
from segmap.pose import FloatArray, Pose2
from segmap.refinement import uncertainties
from segmap.revisits import CLOSING, neighbours, proposed
from segmap.scans import LaserLog, ScanId
from segmap.segments import SegmentMap, extract
from segmap.spreading import spread
from segmap.verification import views

LOGS = {
    "intel": "intel/intel-corrected.log.gz",
    "aces": "aces/aces-corrected.log.gz",
    "csail": "csail/csail-corrected.log.gz",
    "fr101": "fr101/freiburg-101-corrected.log.gz",
}
APART, NEAR, SHARED_VIEW = 30, 2.0, 0.5
"""scans, metres, share of what is seen: what makes a true revisit"""
BESIDE = 3
"""scans; pairs no farther from each other at both ends are one revisit"""
INJECTED = 100
FAR_OFF = 0.4
"""metres; as the workbench has it"""
SHIFTS = 0.5, 3.0
"""metres"""
SAMPLE = 1000
"""true pairs that are matched one by one, whatever the search would do with them"""
FLOORED = np.diag([FLOOR[0] ** 2, FLOOR[0] ** 2, FLOOR[1] ** 2])


@dataclass(frozen=True, eq=False)
class Held:
    """A log, its segments, and the whole map of it."""

    name: str
    log: LaserLog
    maps: Mapping[ScanId, SegmentMap]
    whole: WholeMap
    parameters: Parameters

    def true(self, a: ScanId, b: ScanId) -> Pose2:
        """``T_a_b`` by the log's own poses."""
        return pose_of(self.log, a.scan).inverse() @ pose_of(self.log, b.scan)

    @property
    def closures(self) -> list[Link]:
        """What the search believes."""
        pairs = zip(self.whole.links, self.whole.optimised.residuals, strict=True)
        return [link for link, fate in pairs if link.why in CLOSING and not fate.silenced]


def pose_of(log: LaserLog, scan: int) -> Pose2:
    """A pose the log gives."""
    pose = log[scan].logged_pose
    assert pose is not None
    return pose


def maps_of(log: LaserLog, parameters: Parameters) -> dict[ScanId, SegmentMap]:
    """The segments of all scans of a log."""
    return {ScanId(0, i): extract(scan, parameters, 0, i) for i, scan in enumerate(log)}


def mapped(name: str, log: LaserLog, parameters: Parameters, workers: int) -> Held:
    """A log and its whole map."""
    maps = maps_of(log, parameters)
    return Held(name, log, maps, map_scans(maps, parameters, workers=workers), parameters)


# --- recall and precision -------------------------------------------------------------------------


def true_revisits(held: Held) -> list[tuple[int, int]]:
    """The true revisits of a log."""
    scene = Scene(held.maps, sorted(held.maps), held.parameters)
    places = np.array([(pose_of(held.log, i).x, pose_of(held.log, i).y) for i in range(len(held.log))])
    found = []
    for i, j in sorted(cKDTree(places).query_pairs(NEAR)):
        a, b = ScanId(0, i), ScanId(0, j)
        if j - i > APART and scene.overlap((a, b), held.true(a, b)) >= SHARED_VIEW:
            found.append((i, j))
    return found


def grouped(pairs: Sequence[tuple[int, int]]) -> list[int]:
    """The revisit each pair belongs to."""
    parts = Parts(len(pairs))
    for a, b in sorted(cKDTree(np.array(pairs)).query_pairs(BESIDE, p=math.inf)):
        parts.join(a, b)
    return [parts.of(i) for i in range(len(pairs))]


def recall(held: Held) -> list[object]:
    """One line of the table."""
    true = true_revisits(held)
    closures = [link for link in held.closures if link.second.scan - link.first.scan > APART]
    wrong = [link for link in closures if not is_right(link.T_1_2, held.true(*link.pair))]
    right = [(link.first.scan, link.second.scan) for link in closures if link not in wrong]
    near = cKDTree(np.array(right).reshape(-1, 2)).query(np.array(true), p=math.inf)[0] <= BESIDE
    groups = np.array(grouped(true))
    found = {int(group) for group in groups[near]}
    asked = proposed(held.whole, beside(held))
    sample = [true[i] for i in np.random.default_rng(0).permutation(len(true))[:SAMPLE]]
    return [
        held.name,
        f"{len(true):,}",
        len(set(groups.tolist())),
        f"{len(found) / len(set(groups.tolist())):.1%}",
        f"{near.mean():.1%}",
        f"{len(set(true) & set(right)) / len(true):.1%}",
        f"{exhaustive(held, sample):.1%}",
        f"{len(closures):,}",
        f"{1.0 - len(wrong) / len(closures):.2%}",
        "; ".join(_off(held, link) for link in wrong),
        f"{len(asked.chosen)} + {len(asked.ties)}",
        _default(held, [*asked.chosen, *asked.ties]),
        f"{asked.others:,}",
    ]


RECALL = (
    "log", "true pairs", "revisits", "revisits found", "true pairs by a found one", "recall by pair",
    "exhaustive, by pair", "closures believed", "right", "the others", "proposed", "accepted by default: right",
    "not proposed",
)  # fmt: skip


def _default(held: Held, links: Iterable[Link]) -> str:
    """How many of the proposed the program would accept, and how many of these are right."""
    accepted = [link for link in links if held.whole.matches[link.pair].verdict is Verdict.ACCEPTED and not link.rank]
    right = sum(is_right(link.T_1_2, held.true(*link.pair)) for link in accepted)
    return f"{right} of {len(accepted)}"


def beside(held: Held) -> dict[tuple[ScanId, ScanId], object]:
    """The matches of neighbours."""
    pairs = neighbours(held.whole.scans)
    return dict(spread(held.maps, pairs, held.parameters, workers=2, known=held.whole.matches))


def exhaustive(held: Held, pairs: Iterable[tuple[int, int]]) -> float:
    """The share of true pairs that are accepted and right when each is matched."""
    wanted = [(ScanId(0, i), ScanId(0, j)) for i, j in pairs]
    found = spread(held.maps, wanted, held.parameters, workers=2, known=held.whole.matches)
    accepted = [(pair, m.T_1_2) for pair, m in found if m.verdict is Verdict.ACCEPTED and m.T_1_2 is not None]
    return sum(is_right(T_1_2, held.true(*pair)) for pair, T_1_2 in accepted) / len(wanted)


def _off(held: Held, link: Link) -> str:
    distance, turn = link.T_1_2.distance(held.true(*link.pair))
    return f"{link.first.scan}-{link.second.scan} {distance:.2f} m {math.degrees(turn):.1f}"


# --- wrong closures -------------------------------------------------------------------------------


def injected(held: Held, negative: Sequence[Pair]) -> Iterator[list[object]]:
    """A line for each kind of wrong closures and one for all of them together, in the curated graph."""
    clean = [link.edge for link in _curated(held)]
    before = optimise(clean, most=FAR_OFF)
    kinds = {
        "random": _random(held, before, INJECTED // 3),
        "best of negative pairs": _best_of(held, before, negative, INJECTED // 3),
        "shifted along the weakest direction": _shifted(held, INJECTED - 2 * (INJECTED // 3)),
    }
    every = [edge for edges in kinds.values() for edge in edges]
    for name, wrong in (*kinds.items(), ("all of them", every)):
        after = optimise([*clean, *wrong], most=FAR_OFF)
        flagged = after.residuals[len(clean) :]
        lost = sum(residual.silenced for residual in after.residuals[: len(clean)])
        moved = max(pose.distance(before.poses[scan])[0] for scan, pose in after.poses.items())
        least = min((residual.chi for residual in flagged), default=math.inf)
        silenced = sum(residual.silenced for residual in flagged)
        believed = "; ".join(_described(residual.edge, before) for residual in flagged if not residual.silenced)
        yield [
            name,
            len(wrong),
            silenced,
            len(wrong) - silenced,
            f"{least:.1f}",
            lost,
            f"{1000.0 * moved:.1f}",
            believed,
        ]


WRONG = (
    "kind", "injected", "silenced", "believed", "least chi", "right ones silenced", "poses moved, mm", "the believed",
)  # fmt: skip


def _curated(held: Held) -> list[Link]:
    fates = zip(held.whole.links, held.whole.optimised.residuals, strict=True)
    return [link for link, fate in fates if not fate.silenced]


def _described(edge: Edge, graph: Optimised) -> str:
    T_1_2 = graph.poses[edge.first].inverse() @ graph.poses[edge.second]
    return f"{edge.name}, {edge.T_1_2.distance(T_1_2)[0]:.2f} m off"


def _random(held: Held, graph: Optimised, count: int) -> list[Edge]:
    """Any two scans of the largest component, anywhere."""
    rng = np.random.default_rng(1)
    scans = max(graph.components, key=len)
    right = held.closures
    edges = []
    while len(edges) < count:
        a, b = sorted(scans[i] for i in rng.choice(len(scans), 2, replace=False))
        T_1_2 = Pose2(*rng.uniform(-5.0, 5.0, 2), rng.uniform(-math.pi, math.pi))
        if not is_right(T_1_2, held.true(a, b)):
            edges.append(Edge(a, b, T_1_2, right[rng.integers(len(right))].covariance))
    return edges


def _best_of(held: Held, graph: Optimised, negative: Sequence[Pair], count: int) -> list[Edge]:
    """The best candidates of pairs that share no wall, those our own verdict likes most."""
    found: list[tuple[float, Edge]] = []
    part = set(max(graph.components, key=len))
    for pair in negative:
        a, b = sorted((ScanId(0, pair.i), ScanId(0, pair.j)))
        match = match_maps(held.maps[a], held.maps[b], held.parameters, mode="verified")
        if match.best is not None and match.best.uncertainty is not None and {a, b} <= part:
            edge = Edge(a, b, match.best.T_1_2, covariance_of(match.best))
            found.append((match.confidence or 0.0, edge))
    return [edge for _, edge in sorted(found, key=lambda one: (-one[0], one[1].name))[:count]]


def _shifted(held: Held, count: int) -> list[Edge]:
    """Right closures shifted along their weakest direction, known there as well as the geometry says."""
    rng = np.random.default_rng(2)
    right = held.closures
    edges: list[Edge] = []
    while len(edges) < count:
        link = right[rng.integers(len(right))]
        values, vectors = np.linalg.eigh(np.array(link.covariance)[:2, :2])
        x, y = vectors[:, int(np.argmax(values))] * rng.choice((-1.0, 1.0)) * rng.uniform(*SHIFTS)
        T_1_2 = Pose2(link.T_1_2.x + x, link.T_1_2.y + y, link.T_1_2.theta)
        edges.append(Edge(*link.pair, T_1_2, _known(held, link, T_1_2)))
    return edges


def _known(held: Held, link: Link, T_1_2: Pose2) -> FloatArray:
    """How well a pose of two scans is known, by their geometry there."""
    maps = [held.maps[scan] for scan in link.pair]
    seen = views(*maps, held.parameters)
    assert seen is not None
    known = uncertainties(*seen.maps, *seen.seen, np.array([tuple(T_1_2)]), held.parameters)[0]
    return np.array(link.covariance) if known is None else DOUBT * np.array(known.covariance) + FLOORED


# --- all of it ------------------------------------------------------------------------------------


def main() -> None:
    """Measure and print."""
    parser = arguments(__doc__)
    parser.add_argument("--names", nargs="+", choices=LOGS, default=["intel"])
    parser.add_argument("--tables", nargs="+", default=("recall", "wrong"))
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    print(provenance(), end="\n\n", flush=True)
    parameters = preset("verified")
    logs = {name: read_log(options.logs / LOGS[name]) for name in options.names}
    held = {name: mapped(name, log, parameters, options.workers) for name, log in logs.items()}
    sets = {one.name: one.of_kind(NEGATIVE) for one in load(options.logs, options.pairs)}
    tables: dict[str, tuple[str, Sequence[str], Callable[[], Iterable[list[object]]]]] = {
        "recall": ("Search for closures", RECALL, lambda: map(recall, held.values())),
        "wrong": ("Wrong closures", ("log", *WRONG), lambda: _by_log(held, sets)),
    }
    for name in options.tables:
        title, header, rows = tables[name]
        print(f"### {title}\n\n{markdown(header, list(rows()))}", end="\n\n", flush=True)


def _by_log(held: Mapping[str, Held], negative: Mapping[str, Sequence[Pair]]) -> Iterator[list[object]]:
    for name, one in held.items():
        for row in injected(one, negative[name]):
            yield [name, *row]


if __name__ == "__main__":
    main()
