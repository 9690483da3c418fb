"""benchmarks/closures.py and many_scans.py: what they measure with, on a sample log."""

import importlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from segmap.logs import read_log
from segmap.parameters import preset
from segmap.pose import Pose2
from segmap.scans import LaserLog

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def script():
    """The script, with its folder on the path as when it is run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "benchmarks"))
        yield importlib.import_module("closures")


@pytest.fixture(scope="module")
def many(script):
    """The other one."""
    return importlib.import_module("many_scans")


def test_parts_of_a_log(many):
    """Four that overlap, or that take turns where they do; nothing is left out."""
    sharing, turns = many._sharing(910), many._taking_turns(910)
    assert [len(part) for part in sharing] == [248, 268, 268, 246]
    assert set().union(*sharing) == set(range(910))
    assert sorted(i for part in turns for i in part) == list(range(910))
    shared = set(sharing[1]) & set(sharing[2])
    assert len(shared) == many.OVERLAP
    assert {i % 2 for i in shared & set(turns[1])} != {i % 2 for i in shared & set(turns[2])}


def test_poses_are_laid_on_others_at_best(many):
    """A trajectory moved and turned as a whole is not off; one scan that is moved is."""
    true = [Pose2(i * 0.5, (i % 7) * 0.3, i * 0.1) for i in range(30)]
    found = [Pose2(4.0, -2.0, 2.5) @ pose for pose in true]
    assert many._aligned(found, true) == pytest.approx(np.zeros((30, 2)), abs=1e-6)
    found[10] = found[10] @ Pose2(1.0, 0.0, 0.0)
    assert many._aligned(found, true)[10, 0] == pytest.approx(1.0, abs=0.1)


def test_pairs_beside_each_other_are_one_revisit(script):
    """Up to three scans at both ends, one leading to the next."""
    groups = script.grouped([(1, 50), (3, 48), (6, 45), (10, 45), (1, 90)])
    assert groups[0] == groups[1] == groups[2]
    assert len(set(groups)) == 3


@pytest.mark.slow
def test_what_is_found_and_what_is_injected(script, monkeypatch):
    """The search on a sample whose robot comes back: all it accepts is right; every wrong closure is silenced."""
    log = read_log(ROOT / "sample_logs" / "office.log")
    poses = json.loads((ROOT / "sample_logs" / "office.truth.json").read_text())["sessions"][0]["poses"]
    scans = [replace(scan, logged_pose=Pose2(*pose)) for scan, pose in zip(log, poses, strict=True)]
    held = script.mapped("office", LaserLog(log.name, tuple(scans[:45])), preset("verified"), 1)
    monkeypatch.setattr(script, "APART", 10)
    found = dict(zip(script.RECALL, script.recall(held), strict=True))
    right, accepted = found["accepted by default: right"].split(" of ")
    assert right == accepted
    monkeypatch.setattr(script, "INJECTED", 12)
    rows = list(script.injected(held, []))
    assert [row[1:4] for row in rows] == [[4, 4, 0], [0, 0, 0], [4, 4, 0], [8, 8, 0]]
