"""Many pairs, on as many processes as one likes."""

import pytest
from simulated import noisy, other_room

from segmap.errors import CancelledError, ParameterError
from segmap.integration import match_maps
from segmap.parameters import preset
from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import extract
from segmap.spreading import BATCH, spread

PARAMETERS = preset("verified")


@pytest.fixture(scope="module")
def maps():
    """Eight scans of a room."""
    return {
        ScanId(0, i): extract(noisy(other_room(), Pose2(0.8 + 0.2 * i, 2.6, 0.9), i), PARAMETERS, 0, i)
        for i in range(8)
    }


@pytest.fixture(scope="module")
def pairs(maps):
    """All pairs of them: more than one process takes at a time."""
    scans = sorted(maps)
    found = [(a, b) for i, a in enumerate(scans) for b in scans[i + 1 :]]
    assert len(found) > BATCH
    return found


@pytest.mark.slow
def test_two_processes_find_what_one_finds(maps, pairs):
    """In the order of the pairs, to the last bit, with progress told for each."""
    told = []
    two = list(spread(maps, pairs, PARAMETERS, workers=2, progress=lambda done, total: told.append((done, total))))
    assert [pair for pair, _ in two] == pairs
    assert told == [(i + 1, len(pairs)) for i in range(len(pairs))]
    for (a, b), match in two[::5]:
        assert match.ranked == match_maps(maps[a], maps[b], PARAMETERS, mode="verified").ranked


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_it_can_be_stopped(maps, pairs, workers):
    """What was given out before is done; no process goes on with the rest."""
    stopped = []

    def check():
        if stopped:
            raise CancelledError("The work was stopped.")

    going = spread(maps, pairs, PARAMETERS, workers=workers, check=check)
    assert next(going)[0] == pairs[0]
    stopped.append(True)
    with pytest.raises(CancelledError):
        list(going)


@pytest.mark.parametrize("workers", [1, 2])
def test_what_is_known_is_not_matched_again(maps, pairs, workers):
    """What was kept until it was stopped is taken as it is, wherever it lies; the rest is kept, and all is the same."""
    kept, rest = {}, {}
    going = spread(maps, pairs, PARAMETERS, workers=workers, keep=kept.update)
    for _ in range(BATCH + 2):
        next(going)
    going.close()
    assert list(kept) == pairs[: len(kept)]
    assert BATCH + 2 <= len(kept) < len(pairs) + (workers > 1)
    del kept[pairs[3]]
    told = []
    every = spread(
        maps, pairs, PARAMETERS, workers=workers, known=kept, keep=rest.update, progress=lambda *done: told.append(done)
    )
    found = dict(every)
    assert list(found) == pairs
    assert all(found[pair] is match for pair, match in kept.items())
    assert set(rest) == set(pairs) - set(kept)
    assert told[-1] == (len(pairs), len(pairs))


def test_what_it_does_not_know_is_told(maps, pairs):
    """A backend that does not exist."""
    with pytest.raises(ParameterError, match="processes, dask"):
        list(spread(maps, pairs, PARAMETERS, backend="hope"))


def test_nothing_to_do_is_done_at_once(maps):
    """No pair, no match."""
    assert list(spread(maps, [], PARAMETERS, workers=4)) == []


def test_a_dask_cluster_finds_the_same(maps, pairs):
    """With one option the pairs go to the cluster a client is connected to."""
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as cluster,
        distributed.Client(cluster),
    ):
        found = list(spread(maps, pairs[:4], PARAMETERS, backend="dask"))
    assert [match.ranked for _, match in found] == [m.ranked for _, m in spread(maps, pairs[:4], PARAMETERS)]
