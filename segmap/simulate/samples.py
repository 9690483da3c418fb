"""The sample logs: made with a seed, the same byte for byte on every machine, truth beside them."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from segmap.pose import FloatArray, Pose2
from segmap.simulate import plans
from segmap.simulate.laser import Laser, Noise
from segmap.simulate.robot import odometry, walk
from segmap.simulate.world import World

__all__ = ["INDEX", "SAMPLES", "Sample", "Session", "write_samples"]

INDEX = "samples.json"
"""the file that says what the others are"""

HEADER = """\
# segmap sample {name}: a simulated robot, {title}
# message formats defined: PARAM FLASER
# FLASER beams ranges.. x y theta odometry_x odometry_y odometry_theta time host logger_time
# The poses are {poses}; the truth is in {truth}.
PARAM robot_frontlaser_offset 0.0 nohost 0
PARAM laser_front_laser_resolution 1.0 nohost 0
"""


@dataclass(frozen=True, eq=False)
class Session:
    """One way of one robot through a world, and what its laser reported."""

    file: str
    world: World
    poses: tuple[Pose2, ...]
    """where the robot was at each scan, in the world's frame"""
    believed: tuple[Pose2, ...]
    """where its odometry put it; all at the origin for a robot without odometry"""
    ranges: tuple[FloatArray, ...]
    """of each scan, shape (beams,), metres, no-return readings included"""


@dataclass(frozen=True)
class Sample:
    """A world and the sessions of the robots in it."""

    name: str
    title: str
    description: str
    make: Callable[[], tuple[Session, ...]]

    @property
    def truth(self) -> str:
        """The name of the file with the truth."""
        return f"{self.name}.truth.json"


def _session(
    file: str,
    world: World,
    way: Sequence[tuple[float, float]],
    seed: int,
    step: float = 1.0,
    with_odometry: bool = True,
) -> Session:
    noise, laser = Noise(seed), Laser()
    poses = walk(way, noise, step)
    believed = odometry(poses, noise) if with_odometry else [Pose2.identity()] * len(poses)
    ranges = [laser.ranges(world, pose, noise) for pose in poses]
    return Session(file, world, tuple(poses), tuple(believed), tuple(ranges))


def _office() -> tuple[Session, ...]:
    return (_session("office.log", plans.office(), plans.OFFICE_WAY, seed=2006),)


def _laboratory() -> tuple[Session, ...]:
    return (_session("laboratory.log", plans.laboratory(), plans.LABORATORY_WAY, seed=7, step=0.8),)


def _hall() -> tuple[Session, ...]:
    return (_session("hall.log", plans.hall(), plans.HALL_WAY, seed=94, step=1.1),)


def _two_robots() -> tuple[Session, ...]:
    worlds = [plans.wing().with_shapes(plans.wing_things(session)) for session in (0, 1)]
    first, second = plans.WING_WAYS
    return (
        _session("two-robots-a.log", worlds[0], first, seed=31, step=0.85),
        _session("two-robots-b.log", worlds[1], second, seed=41, step=0.85, with_odometry=False),
    )


SAMPLES = (
    Sample(
        "office",
        "An office floor",
        "A corridor that closes a loop of about 40 m, a meeting room, a kitchen, offices seen through open doors.",
        _office,
    ),
    Sample(
        "laboratory",
        "A cluttered laboratory",
        "Benches, chairs, boxes and robots at every angle: many short segments.",
        _laboratory,
    ),
    Sample(
        "hall",
        "A hall with long walls",
        "Long perpendicular walls and four columns: few segments, and not much to hold on to.",
        _hall,
    ),
    Sample(
        "two-robots",
        "One building, two robots, two sessions",
        "Two robots from the two ends of a corridor meet in the middle; chairs and boxes were moved in between.",
        _two_robots,
    ),
)


def write_samples(folder: Path) -> list[Path]:
    """Write all sample logs, the truth beside each, and their index; returns the files written.

    The same bytes each time and everywhere. ``folder`` is made where it is missing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    made = [(sample, sample.make()) for sample in SAMPLES]
    index = {"samples": [_entry(sample, sessions) for sample, sessions in made]}
    files = [file for sample, sessions in made for file in _files(sample, sessions)]
    files.append((INDEX, json.dumps(index, indent=1) + "\n"))
    for name, text in files:
        (folder / name).write_bytes(text.encode("ascii"))
    return [folder / name for name, _ in files]


def _entry(sample: Sample, sessions: Sequence[Session]) -> dict[str, Any]:
    return {
        "name": sample.name,
        "title": sample.title,
        "description": sample.description,
        "files": [session.file for session in sessions],
        "scans": sum(len(session.poses) for session in sessions),
        "truth": sample.truth,
    }


def _files(sample: Sample, sessions: Sequence[Session]) -> list[tuple[str, str]]:
    """Names and texts: a log for each session, and the truth."""
    logs = [(session.file, _carmen(sample, session)) for session in sessions]
    return [*logs, (sample.truth, _truth(sample, sessions))]


def _carmen(sample: Sample, session: Session) -> str:
    moving = any(pose != Pose2.identity() for pose in session.believed)
    poses = "odometry, and poor" if moving else "unknown: this robot has no odometry"
    head = HEADER.format(name=sample.name, title=sample.title.lower(), poses=poses, truth=sample.truth)
    rows = zip(session.ranges, session.believed, strict=True)
    return head + "".join(_flaser(ranges, pose, 1.5 * number) for number, (ranges, pose) in enumerate(rows))


def _flaser(ranges: FloatArray, pose: Pose2, time: float) -> str:
    readings = " ".join(f"{reading:.2f}" for reading in ranges)
    place = f"{pose.x:.3f} {pose.y:.3f} {pose.theta:.4f}"
    return f"FLASER {len(ranges)} {readings} {place} {place} {time:.1f} nohost {time:.1f}\n"


def _truth(sample: Sample, sessions: Sequence[Session]) -> str:
    """JSON, one row of numbers a line."""
    parts = [_session_truth(session) for session in sessions]
    about = '"about": "metres, radians; poses [x, y, theta] of the scans and walls [x1, y1, x2, y2] in one frame"'
    return f'{{\n"name": "{sample.name}",\n{about},\n"sessions": [\n' + ",\n".join(parts) + "\n]\n}\n"


def _session_truth(session: Session) -> str:
    poses = _rows([tuple(pose) for pose in session.poses])
    walls = _rows([tuple(row) for row in session.world.segments.tolist()])
    return f'{{\n"log": "{session.file}",\n"poses": {poses},\n"walls": {walls}\n}}'


def _rows(rows: Sequence[tuple[float, ...]]) -> str:
    lines = [json.dumps([round(number, 4) + 0.0 for number in row]) for row in rows]
    return "[\n" + ",\n".join(lines) + "\n]"
