"""Files changed at random, to try readers on: a small good file of each kind, and what may happen to it."""

from __future__ import annotations

import gzip
import json
import random
import struct
import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

from bags import ECHOES, ROS_1, ROS_2, SCAN, laser_scan, multi_echo, ranges, texts, write_ros1, write_ros2

from segmap.errors import SegmapError
from segmap.events import Choice, Decide, Proposal, Propose, Rename, Undo, event_from_json
from segmap.export import export_map
from segmap.logs import Limits, ranges_json, read_logs, read_maps, read_pose_graph
from segmap.logs.tables import read_relations, read_trajectory
from segmap.merging import Component
from segmap.pose import Pose2
from segmap.project import replay
from segmap.segments import SegmentMap
from segmap.store import Store

Read = Callable[[bytes], object]
LIMITS = Limits(size=1 << 26, lines=1_000_000)
SMALL = (0, 1, 127, 128, 255)
BINARY = (
    *(struct.pack(form, number) for form in ("<B", "<H", "<I", "<Q", ">I") for number in SMALL),
    *(b"\xff" * 2, b"\xff" * 4, b"\xff" * 8, b"\0\0\0\x80", b"\xff\xff\xff\x7f", struct.pack("<I", 1 << 28)),
)
WORDS = (
    *(b"nan", b"inf", b"-inf", b"-0", b"1e999", b"1e-999", b"9" * 400, b"1_0", b"0x10", b"\xff", b"\0", b"", b"\n"),
    *(b'"', b"{", b"}", b"[" * 2000, b"]", b",", b":", b"null", b"true", b"ranges", b"<b>", b"\xe2\x80\xa8"),
)


def _texts() -> dict[str, bytes]:
    readings = " ".join(f"{1.0 + 0.11 * k:.2f}" for k in range(24))
    carmen = [f"ODOM {i} 0 0 0 0 0 {i} h {i}\nFLASER 24 {readings} 1 2 0.5 1 2 0.6 {i}.5 h {i}" for i in range(6)]
    robot = f"ROBOTLASER1 0 -1.5 3.0 0.01 50 0.1 0 24 {readings} 2 1 2 1 2 0.5 1 2 0.6 0 0 0 0 0 12.5 h 13"
    values = readings.split()
    scan = {"time": 1.5, "first_angle_deg": -90, "angle_step_deg": 1, "ranges": [float(value) for value in values]}
    return {
        "CARMEN": "\n".join(["# CARMEN Logfile", "PARAM a_b 1", *carmen, f"LASER3 24 {readings} 7 h 8"]).encode(),
        "CARMEN graph": "\n".join(["VERTEX2 0 1 2 3", robot, "EDGE2 1 0 1 2 3 1 0 1 1 0 0", robot] * 3).encode(),
        "DP-SLAM": "\n".join(f"Odometry {i} 0 0.1\nLaser 24 {readings}" for i in range(6)).encode(),
        "CSV": "\n".join(
            ["time,x,y,theta,sensor,max_range,first_angle_deg,angle_step_deg,ranges"]
            + [f"{i},1,2,3,a,8,-90,1,{','.join(values)}" for i in range(6)]
        ).encode(),
        "JSON": json.dumps({"max_range": 8, "scans": [scan] * 4}, indent=1).encode(),
        "JSON lines": "\n".join(json.dumps({**scan, "pose": [1, 2, i]}) for i in range(6)).encode(),
    }


def _scans(store: object) -> list[tuple[str, str, object]]:
    some = [("/scan", SCAN, laser_scan(store, i, ranges(i)[:24])) for i in range(4)]
    return [*some, *texts(store, 2), ("/echoes", ECHOES, multi_echo(store, 9))]


def _bags(folder: Path) -> dict[str, bytes]:
    bags = {
        "ROS 1 bag": write_ros1(folder / "plain.bag", _scans(ROS_1)),
        "ROS 1 bag, bz2": write_ros1(folder / "bz2.bag", _scans(ROS_1), "BZ2"),
        "ROS 1 bag, lz4": write_ros1(folder / "lz4.bag", _scans(ROS_1), "LZ4"),
    }
    for storage, name in (("SQLITE3", "ROS 2 bag"), ("MCAP", "MCAP")):
        bags[name] = write_ros2(folder / storage, _scans(ROS_2), storage)
        bags[f"{name}, zstd"] = write_ros2(folder / f"{storage}-zstd", _scans(ROS_2), storage, compressed=True)
    return bags


def logs() -> dict[str, bytes]:
    """A small log of each kind, by the name of its reader; and one of them compressed."""
    with tempfile.TemporaryDirectory() as folder:
        held = {**_texts(), **_bags(Path(folder))}
    return {**held, "gzip": gzip.compress(held["CARMEN"])}


def read_large(content: bytes, **how: Any) -> object:
    """Read a JSON document as one that is too large to be read at once."""
    with patch.object(ranges_json, "DOCUMENT", 1):
        return read_logs(content, **how)


def maps() -> dict[str, bytes]:
    """A small file of segment maps of each kind."""
    held = SegmentMap([[0.0, 0.0, 4.0, 0.0], [4.0, 0.0, 4.0, 3.0], [9.0, 9.0, 8.0, 8.0]])
    parts = [Component(name, (), {}, held) for name in ("hall", "office")]
    plain = {"components": [{"name": "hall", "segments": held.coordinates.tolist(), "directed": [True] * 3}]}
    return {"GeoJSON map": export_map(parts, "geojson"), "JSON map": json.dumps(plain).encode()}


def graphs() -> dict[str, bytes]:
    """A small pose graph of each kind."""
    steps = "".join(f"EDGE_SE2 {i} {i + 1} 1 0 0.1 100 0 0 100 0 400\n" for i in range(5))
    g2o = "".join(f"VERTEX_SE2 {i} {i}.5 0 0.1\n" for i in range(6)) + "FIX 0\n" + steps
    toro = "".join(f"VERTEX2 {i} {i}.5 0 0.1\n" for i in range(6))
    toro += "".join(f"EDGE2 {i} {i + 1} 1 0 0.1 100 0 100 400 0 0\n" for i in range(5))
    return {"g2o": g2o.encode(), "TORO": toro.encode()}


def relations() -> dict[str, bytes]:
    """Relations between moments."""
    return {"relations": "\n".join(f"{i}.5 {i + 1}.5 0.4 0.1 0 0 0 0.2" for i in range(6)).encode()}


def trajectories() -> dict[str, bytes]:
    """A trajectory."""
    return {"TUM": "\n".join(["# a remark", *(f"{i}.5 1 2 0 0 0 0.6 0.8" for i in range(6))]).encode()}


def projects() -> dict[str, bytes]:
    """A small project file, and the events of its history, a line each."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hall.segmap"
        with Store.create(path, "hall") as store:
            kept = store.state.fingerprint
            store.add_log("hall.log", _texts()["CARMEN"], scans=6, format="CARMEN")
            proposed = Proposal(integration="0.0-0.3", kind="closure", T_1_2=Pose2(1.0, 0.0, 0.1))
            store.append(Propose(proposals=(proposed,)))
            chosen = Choice(integration="0.0-0.1", verdict="accepted", parameters=kept, T_1_2=Pose2(0.1, 0.2, 0.3))
            store.append(Decide(choices=(chosen,), who="a person", reason="seen"))
            store.append(Rename(name="the hall"))
            store.append(Undo())
            events = store.events()
        whole = path.read_bytes()
    return {"project": whole, "history": b"\n".join(event.model_dump_json().encode() for event in events)}


def read_project(content: bytes, **_: object) -> tuple[()]:
    """Open a project file of these bytes, and read its logs."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.segmap"
        path.write_bytes(content)
        with Store.open(path) as store:
            for log in store.state.logs:
                assert sum(map(len, store.log_chunks(log.index))) <= LIMITS.size
    return ()


def read_history(content: bytes, **_: object) -> tuple[()]:
    """Replay these lines as the events of a project."""
    replay(event_from_json(line) for line in content.split(b"\n"))
    return ()


def readers() -> Mapping[str, tuple[Read, bytes]]:
    """Every reader, with a good file of its kind."""
    kinds: tuple[tuple[Any, dict[str, bytes]], ...] = (
        (read_logs, logs()),
        (read_large, {"JSON, large": _texts()["JSON"]}),
        (read_maps, maps()),
        (read_pose_graph, graphs()),
        (read_relations, relations()),
        (read_trajectory, trajectories()),
        (read_project, {"project": projects()["project"]}),
        (read_history, {"history": projects()["history"]}),
    )
    every = ((name, read, good) for read, held in kinds for name, good in held.items())
    return {name: (partial(read, name="a<b>.log", limits=LIMITS), good) for name, read, good in every}


def outcome(read: Read, content: bytes) -> str:
    """``read``, or ``refused`` by one of segmap's errors in a printable sentence; all else is a mistake of ours."""
    try:
        found = read(content)
    except SegmapError as error:
        if not str(error).isprintable():
            raise AssertionError(f"not printable: {error!s}") from error
        return "refused"
    for one in found if isinstance(found, tuple) else (found,):
        if not all(str(problem).isprintable() for problem in one.problems):
            raise AssertionError("a problem is not printable")
    return "read"


def changed(content: bytes, chance: random.Random, other: bytes = b"") -> bytes:
    """The content after some accidents; ``other`` is a file that parts may come from."""
    accidents = (_flip, _cut, _drop, _repeat, _number, _word, _mix)
    held = bytearray(content)
    for _ in range(chance.choice((1, 1, 2, 3, 8, 30))):
        if held:
            chance.choice(accidents)(held, chance, other)
    return bytes(held[: 1 << 20])


def _place(held: bytearray, chance: random.Random) -> int:
    """Anywhere, and often near the beginning, where headers are."""
    return min(chance.randrange(len(held)), chance.randrange(len(held)) if chance.random() < 0.7 else 200)


def _flip(held: bytearray, chance: random.Random, _: bytes) -> None:
    held[_place(held, chance)] ^= 1 << chance.randrange(8)


def _cut(held: bytearray, chance: random.Random, _: bytes) -> None:
    if chance.random() < 0.3:
        del held[_place(held, chance) :]


def _drop(held: bytearray, chance: random.Random, _: bytes) -> None:
    start = _place(held, chance)
    del held[start : start + chance.choice((1, 4, 64))]


def _repeat(held: bytearray, chance: random.Random, _: bytes) -> None:
    start = _place(held, chance)
    held[start:start] = held[start : start + chance.choice((1, 8, 100))] * chance.choice((1, 3, 50))


def _number(held: bytearray, chance: random.Random, _: bytes) -> None:
    start, number = _place(held, chance), chance.choice(BINARY)
    held[start : start + len(number)] = number


def _word(held: bytearray, chance: random.Random, _: bytes) -> None:
    start = _place(held, chance)
    held[start : start + chance.choice((0, 1, 4))] = chance.choice(WORDS)


def _mix(held: bytearray, chance: random.Random, other: bytes) -> None:
    if other:
        start, taken = _place(held, chance), chance.randrange(len(other))
        held[start : start + chance.choice((0, 40))] = other[taken : taken + chance.choice((4, 40, 400))]
