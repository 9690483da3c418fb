"""TUM trajectories, read back as numbers."""

from __future__ import annotations

import os
import shutil
import subprocess

import numpy as np
import pytest

from segmap.export import Content, export_files
from segmap.export.tum import trajectory
from segmap.pose import Pose2
from segmap.scans import ScanId

POSES = [Pose2(0.0, 0.0, 0.0), Pose2(1.5, -2.0, 3.0), Pose2(-1.0, 0.25, -1.0)]


def read_back(content: bytes) -> np.ndarray:
    return np.loadtxt(content.decode().splitlines())


def test_round_trip():
    """Time, place and turn of every pose are read back, whatever the remarks."""
    rows = read_back(trajectory(POSES, [10.0, 10.5, 12.0], ["component 1\nof 2"]))
    assert rows[:, 0].tolist() == [10.0, 10.5, 12.0]
    theta = 2.0 * np.arctan2(rows[:, 6], rows[:, 7])
    assert np.column_stack((rows[:, 1:3], theta)) == pytest.approx(np.array([list(pose) for pose in POSES]), abs=1e-6)
    assert (rows[:, 3:6] == 0.0).all()


@pytest.mark.parametrize("times", [[1.0, None, 3.0], [1.0, 1.0, 2.0], [3.0, 2.0, 4.0]])
def test_numbered_without_times(times):
    """Times that are missing or do not grow are replaced by numbers, and the file says so."""
    content = trajectory(POSES, times)
    assert read_back(content)[:, 0].tolist() == [0.0, 1.0, 2.0]
    assert b"# number x y z" in content


@pytest.mark.slow
def test_evo_reads_the_same_poses(tmp_path):
    """evo, by which people score trajectories, finds every pose where it was written; run as a program only."""
    evo = shutil.which("evo_traj")
    if evo is None:
        pytest.skip("evo is not there: pipx install evo")
    (tmp_path / "map.tum").write_bytes(trajectory(POSES, [10.0, 10.5, 12.0], ["component 1", "map_hash: 5f3a"]))
    home = {"HOME": str(tmp_path), "PATH": os.environ["PATH"], "MPLBACKEND": "Agg"}
    command = [evo, "tum", "map.tum", "--save_as_kitti", "--no_warnings"]
    subprocess.run(command, cwd=tmp_path, env=home, check=True, capture_output=True, timeout=300)
    (turned_x, _, _, x), (turned_y, _, _, y), _ = (
        np.loadtxt(tmp_path / "map.kitti").reshape(-1, 3, 4).transpose(1, 2, 0)
    )
    found = np.column_stack((x, y, np.arctan2(turned_y, turned_x)))
    assert found == pytest.approx(np.array([list(pose) for pose in POSES]), abs=1e-6)


def test_empty():
    """No poses are a file of remarks."""
    assert trajectory([], [], ["nothing"]).startswith(b"# nothing\n")


def test_largest_component(corner, part):
    """The poses of the largest component with their times; the scans of the others are named in comments."""
    small = type(corner)("small", (ScanId(1, 4),), corner.map, {ScanId(1, 4): Pose2.identity()})
    times = {ScanId(0, 0): 5.0, ScanId(0, 1): 6.5}
    content = export_files(Content([small, corner], {"map_hash": "5f3a"}, times=times), "tum")["map.tum"]
    assert read_back(content)[:, :3].tolist() == [[5.0, 0.0, 0.0], [6.5, 1.0, 0.5]]
    assert b"# map_hash: 5f3a\n# not in this frame: small, scans 1.4\n" in content
