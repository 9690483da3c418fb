"""Ours beside peers from PyPI: pairs chosen fairly, tables that add up, and whichever peers are installed."""

import importlib
import math
from pathlib import Path

import numpy as np
import pytest

from segmap.benchmark import Pair, is_right
from segmap.logs import read_log
from segmap.pose import Pose2

ROOT = Path(__file__).resolve().parents[1]
MOVED = Pose2(0.5, -0.25, 1.0)


@pytest.fixture(scope="module")
def script():
    """The scripts by name, with their folder on the path as when they are run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "benchmarks"))
        yield importlib.import_module


def held(script, overlaps=(), kind="wide"):
    pairs = tuple(Pair(kind=kind, i=0, j=k, x=0.0, y=0.0, theta=0.0, overlap=o) for k, o in enumerate(overlaps))
    return script("common").LogPairs("office", read_log(ROOT / "sample_logs" / "office.log"), pairs)


# --- which pairs ----------------------------------------------------------------------------------


def test_pairs_that_overlap_enough_are_drawn_once_and_for_all(script):
    """More than half, never a negative one; the same ones every time, in file order."""
    peers = script("peers")
    log = held(script, [0.3, 0.5, *np.linspace(0.51, 0.99, 30)])
    drawn, told = peers.chosen(log, 10)
    assert len(drawn) == 10
    assert all(pair.overlap > 0.5 for pair in drawn)
    assert [pair.j for pair in drawn] == sorted({pair.j for pair in drawn})
    assert drawn == peers.chosen(log, 10)[0]
    assert "10 of 30" in told
    assert len(peers.chosen(log, 80)[0]) == 30
    assert peers.chosen(held(script, [0.9], "negative"), 80)[0] == []


def test_where_overlap_is_not_known_all_positive_pairs_may_be_drawn(script):
    """And it is said."""
    drawn, told = script("peers").chosen(held(script, [None, None]), 80)
    assert len(drawn) == 2
    assert "not known" in told


# --- tables ---------------------------------------------------------------------------------------


def test_tables_by_hand(script):
    """Means over logs, pairs only one is right on, medians, and the median of the ratios."""
    peers = script("peers")

    def answers(*rows):
        return [peers.Answer(bool(right), cpu, wall) for right, cpu, wall in rows]

    mine = {"a": answers((1, 10, 20), (1, 10, 20)), "b": answers((0, 10, 20))}
    other = {"a": answers((1, 20, 20), (0, 30, 40)), "b": answers((1, 80, 90))}
    found = {peers.OURS: mine, "peer": other}
    rows = [line.strip("| ").split(" | ") for line in peers.success_table(found).splitlines()]
    assert rows[2] == [peers.OURS, "50.0", "100.0", "0.0", "0", "0"]
    assert rows[3] == ["peer", "75.0", "50.0", "100.0", "1", "1"]
    rows = [line.strip("| ").split(" | ") for line in peers.time_table(found).splitlines()]
    assert rows[3][:3] == ["peer", "30.0", "25 to 80"]
    assert rows[3][4:6] == ["3.00", "40.0"]


# --- the matchers ---------------------------------------------------------------------------------


def test_walls_stand_upright_and_poses_come_back(script):
    """Three layers over the same points; a pose survives its matrix, and what turns the plane over is none."""
    matchers = script("peer_matchers")
    layers = matchers.layered(np.array([[1.0, 2.0], [3.0, 4.0]]))
    assert layers.shape == (6, 3)
    assert sorted(set(layers[:, 2])) == [-matchers.VOXEL, 0.0, matchers.VOXEL]
    assert max(matchers.flat(matchers.matrix(MOVED)).distance(MOVED)) < 1e-12
    assert matchers.flat(np.diag([1.0, -1.0, -1.0, 1.0])) is None
    assert matchers.matrix(MOVED)[:3, 3] == pytest.approx([MOVED.x, MOVED.y, 0.0])


def test_a_peer_that_is_not_installed_is_left_out_with_the_reason(script, monkeypatch):
    """Ours alone remains, and the remedy is said."""
    peers = script("peers")

    def refuse(name):
        raise ImportError(f"No module named {name!r}")

    monkeypatch.setattr(peers, "importlib", type("none", (), {"import_module": staticmethod(refuse)}))
    tried, said = peers.matchers()
    assert [one.name for one in tried] == [peers.OURS]
    assert all("[bench]" in line and name in line for name, line in zip(("small_gicp", "open3d"), said, strict=True))


@pytest.mark.filterwarnings("ignore")  # of libraries that are not ours
def test_whoever_is_installed_matches_two_pairs(script, monkeypatch):
    """Ours and each installed peer find a scan in itself, and neighbours of a sample log where they are."""
    peers, names = script("peers"), ("small_gicp", "open3d")
    tried, said = peers.matchers()
    if len(tried) == 1:
        pytest.skip("; ".join(said))
    log = read_log(ROOT / "sample_logs" / "hall.log")
    truth = peers.ours(log[4], log[6])
    assert truth is not None
    still = Pose2.identity()
    for matcher in tried:
        assert is_right(matcher.run(log[4], log[4]), still), matcher.name
        assert is_right(matcher.run(log[4], log[6]), truth), matcher.name
    held = script("common").LogPairs("hall", log, (Pair(kind="wide", i=4, j=6, overlap=0.9, **as_json(truth)),))
    found = peers.compare([held], tried, 1, 1)
    assert all(by_log["hall"][0].right for by_log in found.values())
    assert any(name in peers.success_table(found) for name in names)


@pytest.mark.filterwarnings("ignore")
def test_peers_give_the_same_answer_twice(script):
    """Seeds are fixed and everything runs on one thread."""
    tried, said = script("peers").matchers()
    if len(tried) == 1:
        pytest.skip("; ".join(said))
    log = read_log(ROOT / "sample_logs" / "office.log")
    for matcher in tried:
        first, again = matcher.run(log[0], log[2]), matcher.run(log[0], log[2])
        assert first == again, matcher.name


def as_json(pose: Pose2) -> dict[str, float]:
    return {"x": pose.x, "y": pose.y, "theta": math.remainder(pose.theta, 2.0 * math.pi)}
