"""A server killed while it matches and right after a click: the decisions are there, and the same map."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from crashing import new_project, victims
from killing import kill, lost, replayed

ROUNDS = int(os.environ.get("SEGMAP_CRASHES", "30")) // 5

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="the victim is forked, which this system cannot do")


@pytest.mark.slow
def test_a_killed_server_comes_back_with_every_decision_and_the_same_map(tmp_path: Path, log_bytes: bytes) -> None:
    """Again and again on one project: nothing acknowledged is lost, and replay gives the map the next server shows."""
    workspace, count = tmp_path / "projects", 0
    project = new_project(workspace, log_bytes)
    path, before = workspace / f"{project}.segmap", ""
    with victims(workspace) as process:
        for seed in range(1, 1 + ROUNDS):
            clicks = kill(process, project, seed)
            assert clicks.map_before == before
            assert lost(path, clicks) == []
            before = replayed(path)
            count += len(clicks.made)
    assert count >= ROUNDS // 2
