"""Bags of several laser topics in the command line and the workbench: each topic is a log."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bags import ROS_1, ROS_2, SCAN, laser_scan, write_ros1, write_ros2

from app.resources import samples_folder
from segmap.logs import read_log
from segmap.scans import LaserScan
from segmap.store import Store


@pytest.fixture(scope="module")
def held() -> tuple[LaserScan, ...]:
    """Six scans that follow each other."""
    return read_log(samples_folder() / "hall.log")[:6]


def recorded(store: Any, held: tuple[LaserScan, ...]) -> list[Any]:
    """The scans on two topics, the second one hundred seconds later."""
    angles = {"angle_min": held[0].first_angle, "angle_increment": held[0].angle_step}
    rows = [np.nan_to_num(scan.ranges, nan=np.inf).astype(np.float32) for scan in held]
    return [
        (topic, SCAN, laser_scan(store, 100 * late + i, row, **angles))
        for i, row in enumerate(rows)
        for late, topic in enumerate(("/front/scan", "/rear"))
    ]


@pytest.fixture
def bag(held: tuple[LaserScan, ...], tmp_path: Path) -> Path:
    """A ROS 1 bag of both topics."""
    write_ros1(tmp_path / "run.bag", recorded(ROS_1, held))
    return tmp_path / "run.bag"


def test_a_topic_is_named_behind_the_file(run: Any, bag: Path) -> None:
    """Without a topic the command says which there are; with one it reads that."""
    status, _, err = run("info", bag)
    assert status == 2
    assert "several laser topics, /front/scan (6 scans), /rear (6 scans)" in err
    assert f"{bag.name}#/front/scan" in err
    status, out, _ = run("info", f"{bag}#/rear", "--json")
    facts = json.loads(out)
    assert (status, facts["format"], facts["topic"], facts["scans"]) == (0, "ROS 1 bag", "/rear", 6)
    assert run("segments", f"{bag}#/front/scan", "--scan", 2)[0] == 0
    assert "no laser topic /top" in run("info", f"{bag}#/top")[2]


def test_merging_a_bag_keeps_both_topics_in_the_project(run: Any, bag: Path, tmp_path: Path) -> None:
    """Each topic is a log of the project, with its scans and times, and the project replays to the same map."""
    status, out, _ = run("merge", bag, "--project", tmp_path / "p.segmap", "--json")
    assert status == 0
    with Store.open(tmp_path / "p.segmap") as store:
        logs = store.state.logs
    assert [(log.name, log.topic, log.scans) for log in logs] == [
        ("run.bag front.scan", "/front/scan", 6),
        ("run.bag rear", "/rear", 6),
    ]
    assert run("replay", tmp_path / "p.segmap")[1].strip() == json.loads(out)["hash"]


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_the_workbench_takes_bags(
    make_client: Callable[..., Any], held: tuple[LaserScan, ...], tmp_path: Path, storage: str
) -> None:
    """An uploaded bag, a database too, becomes a project of a log for each topic, and is read again after a restart."""
    client = make_client()
    content = write_ros2(tmp_path / "bag", recorded(ROS_2, held), storage)
    made = client.upload(("run.db3", content))
    assert made.status_code == 201, made.text
    id = made.json()["id"]
    client.settle(id)
    client = make_client()
    session = client.settle(id)
    project = client.get(f"/api/projects/{id}").json()
    assert [(log["name"], log["scans"]) for log in project["logs"]] == [("run.db3 front.scan", 6), ("run.db3 rear", 6)]
    times = [session.scan(scan).time for scan in session.scan_ids]
    assert times == [1000.5 + 100 * late + i for late in (0, 1) for i in range(6)]
