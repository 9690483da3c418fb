"""How much memory reading a large log takes: python benchmarks/large_logs.py [--mebibytes 1024] [KIND ...]

Logs of a laser with 1,081 beams are written to a temporary folder, one of each kind, and read, each by a process of
its own; bags as the writers of rosbags write them. Printed: size, scans, what their readings alone would take, the
most memory the process had, and its processor time; status 1 where that memory is more than the file. A document of
JSON is read at once and bounded, so that a large one is refused: that is shown too.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import cycle
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from common import markdown

from segmap.errors import LogError
from segmap.logs import ANY_SIZE, read_log

BEAMS = 1081
DIFFERENT = 200
"""scans, written again and again"""
FIRST, STEP = -2.35619449, 0.00436332313
"""radians"""
SMALL = 512
"""MiB; a smaller log may take as much"""
SCAN = "sensor_msgs/msg/LaserScan"


def readings() -> Iterator[list[float]]:
    """Of different scans, metres."""
    chance = np.random.default_rng(1)
    return (chance.uniform(0.5, 30.0, BEAMS).round(2).tolist() for _ in range(DIFFERENT))


def carmen(path: Path, size: int) -> None:
    """FLASER lines."""
    texts = (" ".join(f"{r:.2f}" for r in held) for held in readings())
    _repeat(path, size, "", [f"FLASER {BEAMS} {text} 1 2 0.5 1 2 0.5 {i} host {i}\n" for i, text in enumerate(texts)])


def csv(path: Path, size: int) -> None:
    """A row for each scan."""
    rows = [f"{i},{FIRST},{STEP}," + ",".join(f"{r:.2f}" for r in held) + "\n" for i, held in enumerate(readings())]
    _repeat(path, size, "time,first_angle,angle_step,ranges\n", rows)


def json_lines(path: Path, size: int) -> None:
    """An object for each scan."""
    told = ({"time": i, "first_angle": FIRST, "angle_step": STEP, "ranges": held} for i, held in enumerate(readings()))
    _repeat(path, size, "", [json.dumps(one) + "\n" for one in told])


def json_document(path: Path, size: int) -> None:
    """One object with all of them."""
    scans = [json.dumps({"ranges": held}) + ",\n" for held in readings()]
    _repeat(path, size, f'{{"first_angle": {FIRST}, "angle_step": {STEP}, "scans": [\n', scans, "{}]}\n")


def _repeat(path: Path, size: int, head: str, lines: list[str], tail: str = "") -> None:
    with path.open("wb") as file:
        file.write(head.encode())
        block = "".join(lines).encode()
        while file.tell() < size:
            file.write(block)
        file.write(tail.encode())


def ros_1(path: Path, size: int) -> None:
    """A ROS 1 bag."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as writer:
        _record(writer, store, lambda message: bytes(store.serialize_ros1(message, SCAN)), size)


def ros_2(path: Path, size: int, storage: str = "SQLITE3") -> None:
    """A ROS 2 bag in SQLite."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, folder = get_typestore(Stores.ROS2_HUMBLE), path.with_suffix(".folder")
    with Writer(folder, version=9, storage_plugin=StoragePlugin[storage]) as writer:
        _record(writer, store, lambda message: bytes(store.serialize_cdr(message, SCAN)), size)
    (held,) = (one for one in folder.iterdir() if one.name != "metadata.yaml")
    held.rename(path)


def mcap(path: Path, size: int) -> None:
    """A ROS 2 bag in MCAP."""
    ros_2(path, size, "MCAP")


def _record(writer: Any, store: Any, serialized: Callable[[Any], bytes], size: int) -> None:
    """Scans of ranges alone: nothing in the file but what has to be held."""
    topic, written = writer.add_connection("/scan", SCAN, typestore=store), 0
    messages = [serialized(_message(store, i, held)) for i, held in enumerate(readings())]
    for number, message in enumerate(cycle(messages)):
        if written >= size:
            return
        writer.write(topic, number * 10**8, message)
        written += len(message)


def _message(store: Any, number: int, held: list[float]) -> Any:
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    seq = {"seq": number} if "seq" in header.__dataclass_fields__ else {}
    return store.types[SCAN](
        header=header(stamp=stamp(sec=number + 1, nanosec=0), frame_id="laser", **seq),
        **{"angle_min": FIRST, "angle_max": -FIRST, "angle_increment": STEP, "time_increment": 0.0, "scan_time": 0.1},
        **{"range_min": 0.02, "range_max": 30.0, "intensities": np.empty(0, np.float32)},
        ranges=np.array(held, np.float32),
    )


KINDS: dict[str, tuple[str, Callable[[Path, int], None]]] = {
    "CARMEN": ("large.log", carmen),
    "CSV": ("large.csv", csv),
    "JSON lines": ("large.jsonl", json_lines),
    "JSON": ("large.json", json_document),
    "ROS 1 bag": ("large.bag", ros_1),
    "ROS 2 bag": ("large.db3", ros_2),
    "MCAP": ("large.mcap", mcap),
}


def peak() -> int:
    """The most memory this process had, MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10


def measured(path: Path) -> tuple[object, ...]:
    """Read a file: size, scans and readings, memory before and at the most, all in MiB, seconds."""
    size, before, start = path.stat().st_size >> 20, peak(), time.process_time()
    try:
        scans = len(read_log(path, limits=ANY_SIZE))
        told = f"{scans:,} scans, {scans * BEAMS * 8 >> 20} MiB as 64 bit numbers"
    except LogError as error:
        told = f"refused: {str(error).partition(': ')[0]}"
    return size, told, before, peak(), f"{time.process_time() - start:.0f}"


def apart(work: Callable[..., Any], *given: Any) -> Any:
    """Done by a process of its own."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(work, *given).result()


def main() -> int:
    """Write, read, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mebibytes", type=int, default=1024)
    parser.add_argument("kinds", nargs="*", help="of " + ", ".join(KINDS))
    given = parser.parse_args()
    rows = []
    for kind in given.kinds or KINDS:
        name, write = KINDS[kind]
        with tempfile.TemporaryDirectory() as folder:
            apart(write, Path(folder) / name, given.mebibytes << 20)
            rows.append((kind, *apart(measured, Path(folder) / name)))
            print(rows[-1], file=sys.stderr, flush=True)
    titles = "MiB of the file", "what it holds", "MiB before", "MiB at the most", "processor s"
    print(markdown(("format", *titles), rows))
    return 0 if all(int(row[4]) <= max(int(row[1]), SMALL) for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
