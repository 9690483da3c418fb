"""Sequences become components; nothing is placed without evidence."""

import numpy as np
import pytest
from sequences import POSES, WORLD, P, sequence, truth

from segmap.errors import CancelledError, ParameterError
from segmap.integration import Verdict
from segmap.merging import map_hash, merge, merge_accepted, neighbours
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import Order, SegmentMap


def accepted(*pairs):
    return [(ScanId(0, a), ScanId(0, b), truth(ScanId(0, a), ScanId(0, b))) for a, b in pairs]


@pytest.mark.parametrize("form", ["scan", "pair"])
def test_pivot_places_every_scan(form):
    """n scans of one room: n - 1 calls, one component, true poses, and a map no larger than the room."""
    result = merge(sequence(), P.replace(pivot_form=form))
    (component,) = result.components
    assert len(result.matches) == len(POSES) - 1
    assert component.scans == tuple(sequence())
    for scan, pose in component.poses.items():
        assert max(pose.distance(POSES[scan.scan])) < 1e-6
    assert len(component.map) == len(WORLD)
    assert component.map.lengths.sum() == pytest.approx(WORLD.lengths.sum(), abs=0.01)
    assert {source.scan for sources in component.map.sources for source in sources} == set(range(len(POSES)))


def test_a_pair_that_fails_begins_a_component():
    """A scan of another place splits the sequence; nothing is guessed."""
    maps = sequence()
    elsewhere = np.array([[0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 1.5, 2.0]])
    maps[ScanId(0, 2)] = SegmentMap(elsewhere, Order.BEAMS)
    result = merge(maps, P)
    assert [len(c.scans) for c in result.components] == [2, 1, 2]
    assert [c.name for c in result.components] == ["component 1", "component 2", "component 3"]
    assert result.components[2].poses[ScanId(0, 3)] == Pose2.identity()


def test_threads_and_progress_change_nothing():
    """The same components on one thread and on two; progress counts every pair."""
    told = []
    one = merge(sequence(), P)
    two = merge(sequence(), P, workers=2, progress=lambda done, total: told.append((done, total)))
    assert map_hash(one.components) == map_hash(two.components)
    assert told == [(i + 1, 4) for i in range(4)]


def test_merging_can_be_stopped():
    """What the check raises ends the merge, on one thread or more."""

    def stop():
        raise CancelledError("stopped")

    for workers in (1, 2):
        with pytest.raises(CancelledError):
            merge(sequence(), P, check=stop, workers=workers)


def test_an_unknown_method_is_told():
    """The error lists the methods there are."""
    with pytest.raises(ParameterError, match="pivot"):
        merge(sequence(), P, method="magic")


def test_logs_are_sequences_of_their_own():
    """The last scan of one log is no neighbour of the first of the next."""
    maps = {**sequence(POSES[:2]), **sequence(POSES[2:], log=1)}
    assert list(neighbours(maps)) == [
        (ScanId(0, 0), ScanId(0, 1)),
        (ScanId(1, 0), ScanId(1, 1)),
        (ScanId(1, 1), ScanId(1, 2)),
    ]


# --- accepted integrations ------------------------------------------------------------------------


def test_without_decisions_every_scan_stands_alone():
    """Nothing accepted: as many components as scans, each with its own map."""
    components = merge_accepted(sequence(), [], P)
    assert [c.scans for c in components] == [(s,) for s in sequence()]
    assert all(len(c.map) == len(WORLD) for c in components)


def test_no_scans_no_components():
    """An empty log merges to nothing."""
    assert merge_accepted({}, [], P) == ()
    assert merge({}, P).components == ()


def test_any_tree_of_integrations_places_its_scans():
    """Integrations need not be between neighbours, nor in order, nor forwards."""
    components = merge_accepted(sequence(), accepted((3, 1), (0, 3), (4, 2)), P)
    assert [sorted(s.scan for s in c.scans) for c in components] == [[0, 1, 3], [2, 4]]
    for component in components:
        first = POSES[component.scans[0].scan]
        for scan, pose in component.poses.items():
            assert max(pose.distance(first.inverse() @ POSES[scan.scan])) < 1e-9


def test_a_second_path_to_a_scan_changes_no_pose():
    """The first integration that reaches a scan places it; a loop is not averaged here."""
    loop = [*accepted((0, 1), (1, 2)), (ScanId(0, 0), ScanId(0, 2), Pose2(9.0, 9.0, 1.0))]
    placed = merge_accepted(dict(list(sequence().items())[:3]), loop, P)
    assert placed[0].poses[ScanId(0, 2)] == Pose2(9.0, 9.0, 1.0)  # one step from the first scan
    assert len(placed) == 1


@pytest.mark.parametrize("form", ["scan", "pair"])
def test_continuing_is_the_same_as_beginning_again(form):
    """Components of an earlier state only save work: the hash is the same, bit for bit."""
    parameters = P.replace(pivot_form=form)
    earlier = merge_accepted(sequence(), accepted((0, 1), (1, 2)), parameters)
    later = accepted((0, 1), (1, 2), (2, 3), (3, 4))
    fresh = merge_accepted(sequence(), later, parameters)
    continued = merge_accepted(sequence(), later, parameters, previous=earlier)
    assert map_hash(fresh) == map_hash(continued)
    assert [c.map.sources for c in fresh] == [c.map.sources for c in continued]


def test_the_hash_sees_micrometres_and_components():
    """Equal maps have equal hashes; 2 micrometres or another split make another."""
    alone = merge_accepted({ScanId(0, 0): WORLD}, [], P)
    nudged = merge_accepted({ScanId(0, 0): WORLD.moved(Pose2(2e-6, 0.0, 0.0))}, [], P)
    rounding = merge_accepted({ScanId(0, 0): WORLD.moved(Pose2(1e-12, 0.0, 0.0))}, [], P)
    assert map_hash(alone) == map_hash(rounding) != map_hash(nudged)
    assert map_hash([]) != map_hash(alone)


def test_verdicts_decide_what_is_merged():
    """A threshold above every value leaves every scan alone, with the matches to look at."""
    result = merge(sequence(), P.replace(value_threshold=1000.0))
    assert len(result.components) == len(POSES)
    assert all(m.verdict is Verdict.REJECTED and m.value > 5.0 for m in result.matches.values())
