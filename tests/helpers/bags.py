"""Bags as ROS writes them, by the writers of rosbags."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

ROS_1, ROS_2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
SCAN, ECHOES, TEXT = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/MultiEchoLaserScan", "std_msgs/msg/String"
FIRST = np.linspace(1.0, 5.0, 181, dtype=np.float32)
Message = tuple[str, str, Any]
"""topic, type, message"""


def ranges(number: int) -> np.ndarray:
    """What scan ``number`` measured."""
    return (FIRST + np.float32(0.01 * number)).astype(np.float32)


def laser_scan(store: Any, number: int, readings: np.ndarray | None = None, **changes: Any) -> Any:
    """A LaserScan of half a turn, taken ``number`` seconds after second 1000."""
    type = store.types[SCAN]
    return type(**{**_told(store, number), "ranges": ranges(number) if readings is None else readings, **changes})


def multi_echo(store: Any, number: int) -> Any:
    """The same with an empty echo at beam 1 and two echoes at all others."""
    echo = store.types["sensor_msgs/msg/LaserEcho"]
    held = [echo(np.array([r, 9.0], np.float32) if k != 1 else np.empty(0, np.float32)) for k, r in enumerate(FIRST)]
    return store.types[ECHOES](**{**_told(store, number), "ranges": held, "intensities": []})


def _told(store: Any, number: int) -> dict[str, Any]:
    header, time = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    seq = {"seq": number} if "seq" in header.__dataclass_fields__ else {}
    return {
        "header": header(stamp=time(sec=1000 + number, nanosec=500_000_000), frame_id="laser", **seq),
        **{"angle_min": -1.5, "angle_max": 1.5, "angle_increment": 3.0 / 180, "time_increment": 0.0, "scan_time": 0.1},
        **{"range_min": 0.05, "range_max": 30.0, "intensities": np.empty(0, np.float32)},
    }


def texts(store: Any, count: int) -> list[Message]:
    """Messages that are no scans."""
    return [("/rosout", TEXT, store.types[TEXT](data="x" * 100)) for _ in range(count)]


def write_ros1(path: Path, messages: Sequence[Message], compression: str | None = None) -> bytes:
    """A ROS 1 bag; gives its bytes."""
    writer = Writer1(path)
    if compression:
        writer.set_compression(getattr(Writer1.CompressionFormat, compression))
    with writer:
        _write(writer, messages, ROS_1, ROS_1.serialize_ros1)
    return path.read_bytes()


def write_ros2(folder: Path, messages: Sequence[Message], storage: str, compressed: bool = False) -> bytes:
    """A ROS 2 bag in SQLite or MCAP; gives the bytes of the file that holds the messages."""
    writer = Writer2(folder, version=9, storage_plugin=StoragePlugin[storage])
    if compressed:
        mode = CompressionMode.MESSAGE if storage == "SQLITE3" else CompressionMode.STORAGE
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        _write(writer, messages, ROS_2, ROS_2.serialize_cdr)
    (path,) = (path for path in folder.iterdir() if path.name != "metadata.yaml")
    return path.read_bytes()


def _write(writer: Any, messages: Sequence[Message], store: Any, serialize: Any) -> None:
    connections: dict[str, Any] = {}
    for number, (topic, type, message) in enumerate(messages):
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, type, typestore=store)
        writer.write(connections[topic], (2000 + number) * 10**9, serialize(message, type))
