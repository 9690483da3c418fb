"""An operator's protocol: a log dropped on the page, reviewed, and exported as a map. What did it take of a person?

    python benchmarks/protocol.py LOG [--scans N] [--loops] [--project FILE.segmap]

Plays a person at the API that the page uses: drops the log, waits until it is matched, accepts and rejects in bulk what
the program is sure of (one decision each), decides one by one on the rest, optionally searches for loop closures and
does the same with them, waits for the merged map and saves it for ROS. The person knows the truth: of a pair that needs
one they accept the candidate that lies within 0.25 m and 5 degrees of the logged poses, and reject it where none does.

Printed: the decisions they had to take, and the seconds the machine made them wait, by step; scans placed, and what was
accepted wrongly, by the logged poses.
"""

from __future__ import annotations

import argparse
import gzip
import math
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
from browser_map import Served
from common import markdown, provenance

from segmap.logs import read_log
from segmap.pose import Pose2
from segmap.scans import LaserLog, ScanId

NEAR = 0.25, math.radians(5.0)
"""metres and radians; a pose nearer to the truth is right"""


@dataclass
class Protocol:
    """What was done, step by step."""

    steps: list[tuple[str, int, float]] = field(default_factory=list)
    """what, decisions of a person, seconds they waited"""

    def add(self, what: str, decisions: int, seconds: float) -> None:
        self.steps.append((what, decisions, seconds))

    def table(self) -> str:
        """The steps, and their sums."""
        rows = [[what, decisions, f"{seconds:.1f}"] for what, decisions, seconds in self.steps]
        total = ["all", sum(step[1] for step in self.steps), f"{sum(step[2] for step in self.steps):.1f}"]
        return markdown(["step", "decisions", "seconds waited"], [*rows, total])


class Operator:
    """A person who knows the truth, at the API of the page."""

    def __init__(self, client: httpx.Client, log: LaserLog, protocol: Protocol) -> None:
        self._client, self._log, self._protocol = client, log, protocol
        self._url = ""

    def drop(self, name: str, content: bytes) -> str:
        """Make a project of the log and wait until every pair is matched; its id."""
        start = time.perf_counter()
        answer = self._client.post("/api/projects", files={"files": (name, content)})
        id = str(answer.raise_for_status().json()["id"])
        self._url = f"/api/projects/{id}"
        self._protocol.add("drop the log", 0, time.perf_counter() - start)
        self.wait("all pairs matched", lambda info: info["progress"]["done"] < info["progress"]["total"])
        return id

    def wait(self, what: str, busy: Any) -> dict[str, Any]:
        """Wait as long as something of the project is busy."""
        start = time.perf_counter()
        while busy(info := self.get("")):
            time.sleep(0.1)
        self._protocol.add(what, 0, time.perf_counter() - start)
        return dict(info)

    def get(self, path: str) -> Any:
        """What the API says of the project."""
        return self._client.get(self._url + path).raise_for_status().json()

    def rows(self) -> list[dict[str, Any]]:
        """What waits for a decision, the one that most needs a person first."""
        rows = self.get("/integrations")["integrations"]
        return [row for row in rows if row["state"] in ("pending", "none")]

    def bulk(self) -> None:
        """Accept what the program is sure of, reject what it is sure is nothing: a click each."""
        start, clicks = time.perf_counter(), 0
        for verdict in ("accepted", "rejected"):
            ids = [row["id"] for row in self.rows() if row["verdict"] == verdict]
            if ids:
                self._decide({"integrations": ids, "verdict": verdict})
                clicks += 1
        self._protocol.add("in bulk", clicks, time.perf_counter() - start)

    def review(self, what: str) -> None:
        """Decide on the rest, one by one."""
        start, clicks = time.perf_counter(), 0
        while waiting := [row for row in self.rows() if row["state"] == "pending"]:
            self._one(waiting[0])
            clicks += 1
        self._protocol.add(what, clicks, time.perf_counter() - start)

    def _one(self, row: dict[str, Any]) -> None:
        ranked = (self.get(f"/integrations/{row['id']}")["match"] or {"ranked": []})["ranked"]
        right = [k for k, candidate in enumerate(ranked) if self.is_right(row, candidate["T_1_2"])]
        choice = {"verdict": "accepted", "candidate": right[0]} if right else {"verdict": "rejected"}
        self._decide({"integrations": [row["id"]], **choice, "who": "operator"})

    def _decide(self, body: dict[str, Any]) -> None:
        self._client.post(f"{self._url}/decisions", json=body).raise_for_status()

    def is_right(self, row: dict[str, Any], pose: dict[str, float]) -> bool:
        """Whether a pose is the truth, by the logged poses."""
        first, second = (self._log.scan(ScanId.parse(row[side]).scan).logged_pose for side in ("first", "second"))
        if first is None or second is None:
            raise SystemExit("The log has no poses to know the truth by: take a corrected one.")
        shift, turn = Pose2(pose["x"], pose["y"], pose["theta"]).distance(first.inverse() @ second)
        return shift <= NEAR[0] and turn <= NEAR[1]

    def search(self) -> None:
        """Search for loop closures, and wait until they are matched too."""
        self._client.post(f"{self._url}/loops", json={"action": "start"}).raise_for_status()
        self.wait("loop closures found", lambda info: info["search"]["running"])
        self.wait("and matched", lambda info: info["progress"]["done"] < info["progress"]["total"])

    def save(self) -> int:
        """Wait for the map and save it; how many bytes it has."""
        self.wait("merged map", lambda info: info["merging"] or info["graph"]["optimising"])
        start = time.perf_counter()
        content = self._client.get(f"{self._url}/export/ros").raise_for_status().content
        self._protocol.add("saved for ROS", 0, time.perf_counter() - start)
        return len(content)

    def wrong(self) -> int:
        """How many accepted integrations are not right."""
        rows = [row for row in self.get("/integrations")["integrations"] if row["state"] == "accepted"]
        return sum(not self.is_right(row, self._accepted(row["id"])) for row in rows)

    def _accepted(self, id: str) -> dict[str, float]:
        ranked = self.get(f"/integrations/{id}")["match"]["ranked"]
        value = self.get(f"/integrations/{id}")["row"]["value"]
        pose: dict[str, float] = min(ranked, key=lambda candidate: abs(candidate["value"] - value))["T_1_2"]
        return pose


def head_of(content: bytes, scans: int) -> bytes:
    """The first scans of a CARMEN log."""
    kept, count = [], 0
    for line in content.splitlines(keepends=True):
        count += line.startswith((b"FLASER", b"ROBOTLASER1"))
        if count > scans:
            break
        kept.append(line)
    return b"".join(kept)


def main() -> None:
    """Play the person, print what it took."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", type=Path, help="a corrected CARMEN log, whose poses are the truth")
    parser.add_argument("--scans", type=int, help="only the first so many")
    parser.add_argument("--loops", action="store_true", help="search for loop closures, too")
    parser.add_argument("--project", type=Path, help="keep the project here")
    chosen = parser.parse_args()
    content = chosen.log.read_bytes()
    if chosen.scans:
        content = head_of(gzip.decompress(content) if content[:2] == b"\x1f\x8b" else content, chosen.scans)
    name = chosen.log.name.removesuffix(".gz") if chosen.scans else chosen.log.name
    with tempfile.TemporaryDirectory() as folder:
        served, protocol = Served(Path(folder)), Protocol()
        try:
            operator = Operator(served.client, read_log(content, name), protocol)
            operator.drop(name, content)
            operator.bulk()
            operator.review("one by one")
            if chosen.loops:
                operator.search()
                operator.bulk()
                operator.review("closures one by one")
            size, info = operator.save(), operator.get("")
            told = f"{info['counts']['total']} integrations, {info['counts']['accepted']} accepted"
            wrong = operator.wrong()
            if chosen.project:
                chosen.project.write_bytes(served.client.get(f"{operator._url}/download").content)
        finally:
            served.close()
    print(provenance())
    print(protocol.table())
    parts = [part for part in info["components"] if len(part["scans"]) > 1]
    placed = ", ".join(str(len(part["scans"])) for part in parts)
    print(f"{told}, {wrong} of them wrong; scans in the map, by component: {placed}; {size} bytes saved.")


if __name__ == "__main__":
    main()
