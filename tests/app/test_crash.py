"""A server killed at any moment loses nothing it acknowledged, and leaves no file that does not open."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from crashing import clean, crash, lost, new_project, victims

ROUNDS = int(os.environ.get("SEGMAP_CRASHES", "30")) // 5

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="the victim is forked, which this system cannot do")


@pytest.mark.slow
def test_a_killed_server_loses_nothing_it_acknowledged(tmp_path: Path, log_bytes: bytes) -> None:
    """Killed again and again while three people decide, add logs and make projects; a new server goes on each time."""
    workspace, count = tmp_path / "projects", 0
    project = new_project(workspace, log_bytes)
    with victims(workspace) as process:
        for seed in range(1, 1 + ROUNDS):
            done = crash(process, project, log_bytes, seed)
            assert lost(workspace, done) == []
            count += done.count
            clean(workspace, project)
    assert count >= ROUNDS
