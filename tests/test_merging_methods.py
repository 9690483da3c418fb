"""The three methods as trees of integrations: their calls, their evidence, what a person decided, and bridges."""

import json
import math

import numpy as np
import pytest
from sequences import EVERY, POSES, WORLD, P, assert_true, broken, by_all, ids, nodes_of, sequence, steps_of, truth

import segmap.merging.calls
from segmap.errors import ParameterError
from segmap.integration import Match, Verdict, match_maps
from segmap.merging import METHODS, Flag, calls_needed, merge
from segmap.pose import Pose2
from segmap.scans import LaserScan, ScanId
from segmap.segments import Order, SegmentMap, Sight

WALK = [Pose2(0.1 * i, 0.05 * math.sin(i), 0.2 * i) for i in range(9)]


# --- calls and trees ------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["scan", "pair"])
@pytest.mark.parametrize("method", METHODS)
def test_every_method_makes_the_paper_s_calls_and_the_room(method, form):
    """n - 1, n (n - 1) / 2 and n - 1 calls; one component, true poses, a map no larger than the room."""
    result = by_all(sequence(), EVERY.replace(pivot_form=form), method=method)
    n = len(POSES)
    assert len(result.calls) == calls_needed([n], method) == {"tree": n * (n - 1) // 2}.get(method, n - 1)
    (component,) = result.components
    assert component.scans == tuple(sequence())
    assert_true(result)
    assert component.map.lengths.sum() == pytest.approx(WORLD.lengths.sum(), abs=0.01)
    assert component.map is component.tree.map


@pytest.mark.parametrize("method", METHODS)
def test_a_tree_holds_every_integration_once(method):
    """Leaves are the scans as they were; parts come before the whole; each integration has two parts and its map."""
    maps = sequence()
    result = by_all(maps, EVERY, method=method)
    nodes = nodes_of(result)
    assert len({id(node) for node in nodes}) == len(nodes)
    assert {node.scan: node.map for node in nodes if node.step is None} == maps
    assert len(steps_of(result)) == len(result.calls)
    for place, node in enumerate(nodes):
        if node.step:
            parts = node.step.first, node.step.second
            assert all(part in nodes[:place] for part in parts)
            assert set(node.scans) == set(parts[0].scans) | set(parts[1].scans)
            assert node.scan == parts[0].scan
            assert node.poses[parts[1].scan] == node.step.T_1_2 or method == "tree"
            assert {s.scan for sources in node.map.sources for s in sources} == {scan.scan for scan in node.scans}


def test_the_tree_integrates_maps_of_one_size():
    """Level k holds k + 1 scans: pairs, threes, and so on, each with its neighbour."""
    result = by_all(sequence(), EVERY, method="tree")
    sizes = [(len(call.first), len(call.second)) for call in result.calls]
    assert sorted(sizes) == [(1, 1)] * 4 + [(2, 2)] * 3 + [(3, 3)] * 2 + [(4, 4)]


def test_the_tree_skips_from_level_three_on():
    """S_1234 is tried with S_3456 first; where that is valid it stands for two, and fewer calls reach the end."""
    maps = sequence(WALK)
    full = by_all(maps, EVERY, method="tree")
    result = by_all(maps, P, method="tree")
    n = len(WALK)
    assert len(full.calls) == n * (n - 1) // 2
    assert all(Flag.SKIPPED not in step.flags for step in steps_of(full))
    larger = [call for call in result.calls if len(call.first) > 3]
    assert (larger[0].first, larger[0].second) == (ids(0, 1, 2, 3), ids(2, 3, 4, 5))
    assert [len(call.first) for call in result.calls[:21]] == [1] * 8 + [2] * 7 + [3] * 6
    skipped = [step for step in steps_of(result) if Flag.SKIPPED in step.flags]
    assert skipped
    assert all(len(step.first.scans) > 3 for step in skipped)
    assert len(result.calls) < len(full.calls)
    (component,) = result.components
    assert sorted(component.scans) == sorted(maps)
    assert_true(result, WALK)
    later = by_all(maps, P.replace(tree_skip_level=5), method="tree")
    assert min(len(step.first.scans) for step in steps_of(later) if Flag.SKIPPED in step.flags) == 6


@pytest.mark.parametrize("method", METHODS)
def test_what_cannot_be_integrated_begins_a_component(method):
    """A scan of another place splits the sequence in every method; nothing is guessed."""
    result = by_all(broken(), EVERY, method=method)
    assert [component.scans for component in result.components] == [ids(0, 1), ids(2), ids(3, 4)]
    assert_true(result)


@pytest.mark.parametrize("method", METHODS)
def test_every_log_is_a_sequence_of_its_own(method):
    """Scans of two logs are never integrated, and progress counts the calls of both."""
    told = []
    maps = {**sequence(POSES[:3]), **sequence(POSES[3:], log=1)}
    result = by_all(maps, EVERY, method=method, progress=lambda done, total: told.append((done, total)))
    assert [{scan.log for scan in component.scans} for component in result.components] == [{0}, {1}]
    total = calls_needed([3, 2], method)
    assert len(result.calls) == total
    assert told == [(done, total) for done in range(1, total + 1)]


def test_a_merge_of_nothing_and_of_one():
    """No scans, no components; one scan is a component by itself, without a call."""
    for method in METHODS:
        assert merge({}, P, method=method).components == ()
        (component,) = merge(dict(list(sequence().items())[:1]), P, method=method).components
        assert component.tree.step is None


def test_a_scan_that_maps_share_keeps_one_sensor():
    """However often the tree fuses a scan with itself, its sensor is there once, where the scan is."""
    scan = {i: LaserScan(np.array([1.0 + i]), 0.0, 0.1) for i in range(4)}
    maps = {
        id: SegmentMap(m.coordinates, m.order, sources=m.sources, sights=(Sight(Pose2.identity(), scan[id.scan]),))
        for id, m in sequence(POSES[:4]).items()
    }
    for method, form in (("tree", "scan"), ("pivot", "pair"), ("pivot", "scan"), ("sequential", "scan")):
        (component,) = by_all(maps, EVERY.replace(pivot_form=form), method=method).components
        sensors = {id(sight.scan): sight.T_map_sensor for sight in component.map.sights}
        assert len(component.map.sights) == len(sensors) == 4
        for held, pose in component.poses.items():
            assert max(sensors[id(scan[held.scan])].distance(pose)) < 1e-9


def test_the_pair_form_of_pivot_keeps_the_pairs():
    """Each pair's map can be looked at; that it is moved by its pivot is no call."""
    result = by_all(sequence(), EVERY.replace(pivot_form="pair"))
    pairs = [node for node in nodes_of(result) if node.step and len(node.scans) == 2]
    assert [node.scans for node in pairs] == [ids(i, i + 1) for i in range(4)]
    moved = [step for step in steps_of(result) if Flag.PIVOT in step.flags]
    assert len(moved) == 3
    assert all(step.match is None and step.second.scans == (step.pair[0], step.second.scans[1]) for step in moved)


# --- what a person, or a shared scan, has to say --------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("backwards", [False, True])
def test_a_pose_by_hand_takes_the_place_of_a_call(method, backwards):
    """The paper's S_27 to S_29: manual poses inside an automatic merge, in either direction."""
    maps = broken()
    by_hand = {(ScanId(0, 1), ScanId(0, 2)): truth(*ids(1, 2)), (ScanId(0, 2), ScanId(0, 3)): truth(*ids(2, 3))}
    if backwards:
        by_hand = {(b, a): T.inverse() for (a, b), T in by_hand.items()}
    automatic = by_all(maps, EVERY, method=method)
    result = by_all(maps, EVERY, method=method, given=by_hand)
    (component,) = result.components
    assert component.scans == tuple(maps)
    assert_true(result)
    manual = [step for step in steps_of(result) if Flag.MANUAL in step.flags]
    assert {step.pair for step in manual} == {ids(1, 2), ids(2, 3)}
    assert all(step.match is None for step in manual)
    tried = {call.pair for call in result.calls if len(call.second) == 1}
    assert not tried & {ids(1, 2), ids(2, 3)}
    assert ids(2, 3) in {call.pair for call in automatic.calls} or method == "sequential"


@pytest.mark.parametrize("method", METHODS)
def test_a_person_s_no_holds(method):
    """A pair that was rejected is not integrated, though it could be; no bridge is sought either."""
    maps = sequence()
    found = match_maps(maps[ScanId(0, 1)], maps[ScanId(0, 2)], P)
    rejected = found.judged(P.replace(value_threshold=1000.0))
    assert rejected.verdict is Verdict.REJECTED
    result = by_all(maps, EVERY, method=method, given={ids(1, 2): rejected})
    assert [component.scans for component in result.components] == [ids(0, 1), ids(2, 3, 4)]
    bridged = by_all(dict.fromkeys(ids(1, 3)) | {k: maps[k] for k in ids(1, 3)}, P, method=method,
                     given={ids(1, 3): rejected}, between=maps)  # fmt: skip
    assert len(bridged.components) == 2


@pytest.mark.parametrize("method", METHODS)
def test_a_match_found_before_is_not_searched_again(method):
    """A match in place of a call is that call's match, and not a person's pose."""
    maps = sequence()
    found = {pair: match_maps(maps[pair[0]], maps[pair[1]], P) for pair in (ids(0, 1), ids(1, 2))}
    result = by_all(maps, EVERY, method=method, given=found)
    assert isinstance(found[ids(0, 1)], Match)
    step = next(step for step in steps_of(result) if step.pair == ids(0, 1))
    assert step.match is found[ids(0, 1)]
    assert not step.flags
    assert len(result.calls) == calls_needed([5], method) - 2
    assert_true(result)


@pytest.mark.parametrize("method", METHODS)
def test_closing_the_loop_says_how_well_it_closes(method):
    """The last scan with the first: where the composed poses are right nothing is left over, and nothing moves."""
    result = by_all(sequence(), EVERY, method=method, closing=[ids(4, 0)])
    (closure,) = result.closures
    assert closure.link.pair == ids(4, 0)
    assert closure.match.verdict is Verdict.ACCEPTED
    assert max(closure.metres, closure.radians) < 1e-6
    assert_true(result)
    wrong = Pose2(0.3, 0.0, 0.0) @ truth(*ids(4, 0))
    (given,) = by_all(sequence(), EVERY, method=method, given={ids(4, 0): wrong}).closures
    assert given.metres == pytest.approx(0.3)
    assert given.link.flags == {Flag.MANUAL, Flag.CLOSING}


@pytest.mark.parametrize("pair", [ids(0, 4), ids(4, 0)])
@pytest.mark.parametrize("method", METHODS)
def test_closing_joins_what_the_sequence_could_not(method, pair):
    """The loop closed from behind: the parts before and after a gap become one, in the frame of the first."""
    result = by_all(broken(), EVERY, method=method, closing=[pair])
    assert [component.scans for component in result.components] == [ids(0, 1, 3, 4), ids(2)]
    assert_true(result)
    assert result.closures == ()
    assert Flag.CLOSING in result.components[0].tree.step.flags


def test_closing_leaves_alone_what_is_not_valid_or_not_there():
    """A pair without a valid integration joins nothing; a scan of no component is no error."""
    result = by_all(broken(), EVERY, closing=[ids(0, 2), ids(0, 77)])
    assert [component.scans for component in result.components] == [ids(0, 1), ids(2), ids(3, 4)]


@pytest.fixture
def maps_never_match(monkeypatch):
    """INTEGRATE fails wherever a partial map takes part; returns what to change of such matches."""
    changes = {"verdict": Verdict.REJECTED}

    def limited(map_1, map_2, *arguments, **options):
        match = match_maps(map_1, map_2, *arguments, **options)
        if Order.NONE not in (map_1.order, map_2.order):
            return match
        moved = [changes["shift"] @ match.T_1_2] if "shift" in changes else [match.T_1_2]
        ranked = tuple(type(c)(moved[0], *list(vars(c).values())[1:]) for c in match.ranked[:1])
        return type(match)(**{**vars(match), "verdict": changes["verdict"], "ranked": ranked})

    monkeypatch.setattr(segmap.merging.calls, "match_maps", limited)
    return changes


def test_where_the_tree_fails_the_shared_scan_serves(maps_never_match):
    """Every scan is still placed, truly, and every such integration is for review; sequential splits instead."""
    result = by_all(sequence(), EVERY, method="tree")
    assert len(result.components) == 1
    assert_true(result)
    shared = [step for step in steps_of(result) if Flag.SHARED in step.flags]
    assert len(shared) == 6
    assert all(step.review and step.remarks and step.match.verdict is Verdict.REJECTED for step in shared)
    assert [len(c.scans) for c in by_all(sequence(), EVERY, method="sequential").components] == [2, 2, 1]


def test_where_the_tree_finds_another_pose_the_shared_scan_holds(maps_never_match):
    """A valid pose a metre off is not believed against the same scan in both maps, and a person is told."""
    maps_never_match.update(verdict=Verdict.ACCEPTED, shift=Pose2(1.0, 0.0, 0.0))
    result = by_all(sequence(), EVERY, method="tree")
    assert_true(result)
    doubted = [step for step in steps_of(result) if Flag.DISAGREES in step.flags]
    assert len(doubted) == 6
    assert all("1.00 m" in step.remarks[0] and step.review for step in doubted)
    skipping = by_all(sequence(WALK), P, method="tree")
    assert not [step for step in steps_of(skipping) if Flag.SKIPPED in step.flags]


# --- outlines, errors -----------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_the_outline_is_json_and_names_parts_before_the_whole(method):
    """Every integration with its parts by place, its pose, value, verdict, flags; read back it is the same."""
    result = by_all(broken(), EVERY, method=method, closing=[ids(0, 4)], given={ids(1, 2): truth(*ids(1, 2))})
    told = json.loads(json.dumps(result.outline()))
    assert told == result.outline()
    nodes, rows = nodes_of(result), told["nodes"]
    assert [row["node"] for row in rows] == list(range(len(rows)))
    assert [row["segments"] for row in rows] == [len(node.map) for node in nodes]
    for row, node in zip(rows, nodes, strict=True):
        if node.step is None:
            assert row["scan"] == str(node.scan)
        else:
            assert rows[row["first"]]["scans"] == len(node.step.first.scans)
            assert max(row["first"], row["second"]) < row["node"]
            assert tuple(row["pose"].values()) == tuple(node.step.T_1_2)
            assert row["flags"] == sorted(node.step.flags)
            assert (row["value"] is None) == (node.step.match is None)
    assert told["calls"] == len(result.calls)


def test_unknown_heuristics_and_modes_are_told():
    """Also the one for partial maps."""
    for options in ({"heuristic": "luck"}, {"map_heuristic": "luck"}, {"mode": "luck"}):
        with pytest.raises(ParameterError, match="luck"):
            merge(sequence(), P, **options)
    with pytest.raises(ParameterError, match="sequential, tree, pivot"):
        merge(sequence(), P, method="luck")
