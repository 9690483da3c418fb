"""The buildings of the sample logs, and the ways robots take through them.

Interior walls are 0.12 m thick; a door that is shut is a recess, one that is open has a leaf.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import pi

from segmap.simulate.world import Box, Shape, World, box, chair, disc

__all__ = [
    "HALL_WAY",
    "LABORATORY_WAY",
    "OFFICE_WAY",
    "WING_WAYS",
    "hall",
    "laboratory",
    "office",
    "wing",
    "wing_things",
]

DOOR = 0.92
RECESS = 0.09


def _desk(x: float, y: float, angle: float = 0.0) -> list[Shape]:
    """A desk with a drawer unit under one end, and a chair pushed back from it."""
    legs = chair(x, y, angle, 0.9)
    return [*legs, box(x + 0.75, y, 0.42, 0.6, angle), disc(x - 0.1, y + 0.75, 0.22, 8)]


def _all(*groups: Iterable[Shape]) -> list[Shape]:
    return [shape for group in groups for shape in group]


# An office floor: a corridor all round a core, rooms outside it.
_OFFICE_CORRIDOR: list[Box] = [
    (4.5, 4.5, 19.5, 6.3),
    (4.5, 10.7, 19.5, 12.5),
    (4.5, 4.5, 6.3, 12.5),
    (17.7, 4.5, 19.5, 12.5),
]
_OFFICE_ROOMS: list[Box] = [
    *((x1, 0.25, x2, 4.38) for x1, x2 in ((4.5, 7.6), (7.72, 10.2), (10.32, 14.7), (14.82, 17.3), (17.42, 19.5))),
    *((x1, 12.62, x2, 16.75) for x1, x2 in ((4.5, 8.4), (8.52, 11.0), (11.12, 13.6), (13.72, 19.5))),
    *((0.25, y1, 4.38, y2) for y1, y2 in ((4.5, 8.3), (8.42, 12.5))),
    *((19.62, y1, 23.75, y2) for y1, y2 in ((2.2, 7.1), (7.22, 9.9), (10.02, 14.2))),
    (6.42, 6.42, 9.0, 10.58),
    (15.1, 6.42, 17.58, 8.6),
]
_OFFICE_OPENINGS: list[Box] = [
    (12.2, 4.38, 12.2 + DOOR, 4.5),
    (5.2, 4.38, 5.2 + DOOR, 4.5),
    (15.6, 4.38, 15.6 + DOOR, 4.5),
    (19.5, 5.4, 19.62, 5.4 + DOOR),
    (19.5, 10.9, 19.62, 10.9 + DOOR),
    (14.9, 12.5, 14.9 + DOOR, 12.62),
    (9.4, 12.5, 9.4 + DOOR, 12.62),
    (4.38, 9.2, 4.5, 9.2 + DOOR),
    (7.1, 10.58, 7.1 + DOOR, 10.7),
    (10.4, 6.3, 12.9, 8.1),  # the kitchen niche
    (11.2, 9.9, 12.6, 10.7),  # the lift's landing
]
_OFFICE_SHUT: list[Box] = [
    (8.5, 4.5 - RECESS, 8.5 + DOOR, 4.5),
    (18.0, 4.5 - RECESS, 18.0 + DOOR, 4.5),
    (12.0, 12.5, 12.0 + DOOR, 12.5 + RECESS),
    (6.0, 12.5, 6.0 + DOOR, 12.5 + RECESS),
    (4.5 - RECESS, 6.6, 4.5, 6.6 + DOOR),
    (19.5, 8.0, 19.5 + RECESS, 8.0 + DOOR),
    (13.6, 6.3, 13.6 + DOOR, 6.3 + RECESS),
    (14.2, 10.7 - RECESS, 14.2 + DOOR, 10.7),
    (17.7 - RECESS, 9.1, 17.7, 9.1 + DOOR),
]
_OFFICE_SOLID: list[Box] = [
    (9.9, 4.5, 10.25, 4.68),  # pillars
    (14.6, 4.5, 14.95, 4.68),
    (10.8, 12.32, 11.15, 12.5),
    (16.4, 12.32, 16.75, 12.5),
    (6.3, 8.2, 6.48, 8.55),
    (17.52, 10.2, 17.7, 10.7),
    (7.0, 6.3, 8.2, 6.72),  # cupboards in the corridor
    (19.1, 9.2, 19.5, 10.4),
    (10.4, 7.5, 12.9, 8.1),  # the kitchen's counter
]
OFFICE_WAY = [
    (5.5, 5.4),
    (12.66, 5.45),
    (12.6, 2.6),
    (12.66, 5.45),
    (18.6, 5.4),
    (18.4, 11.6),
    (5.5, 11.5),
    (5.4, 5.5),
    (9.0, 5.4),
]


_OFFICE_LEAVES = [
    box(12.18, 3.93, 0.05, 0.9, 0.1),
    box(6.14, 3.93, 0.05, 0.9, -0.15),
    box(15.62, 3.93, 0.05, 0.9, 0.05),
    box(20.07, 6.34, 0.9, 0.05, 0.2),
    box(20.07, 10.88, 0.9, 0.05, -0.1),
    box(14.92, 13.07, 0.05, 0.9, -0.2),
    box(4.0, 10.1, 0.7, 0.05, 0.6),
]
_OFFICE_THINGS = [
    disc(19.15, 12.1, 0.2),
    disc(4.85, 12.15, 0.17, 8),
    disc(4.8, 4.85, 0.14, 8),
    box(16.9, 6.05, 0.7, 0.5, 0.04),
    box(6.05, 10.1, 0.45, 0.55, -0.12),
    box(13.4, 11.0, 0.6, 0.45, 0.3),
    box(6.05, 7.4, 0.42, 0.5, 0.05),
]
_OFFICE_DESKS = _all(
    chair(12.6, 1.15, 0.05, 1.3),
    chair(11.4, 2.3, 0.4),
    chair(13.9, 1.7, -0.7),
    chair(11.0, 1.2, 1.2),
    [box(14.45, 3.2, 0.45, 1.2), box(10.55, 3.3, 0.4, 1.6)],
    _desk(5.6, 1.6, 0.1),
    _desk(15.8, 1.5),
    _desk(22.0, 6.0, 0.2),
    _desk(22.2, 11.5, -0.2),
    _desk(15.4, 15.3),
    _desk(9.6, 15.2, 0.15),
    _desk(2.2, 9.4),
    _desk(7.2, 7.8, 0.3),
)


def office() -> World:
    """An office floor: a corridor that closes a loop of 40 m, a kitchen, offices seen through open doors."""
    free = _OFFICE_CORRIDOR + _OFFICE_ROOMS + _OFFICE_OPENINGS + _OFFICE_SHUT
    return World.build("office", free, _OFFICE_SOLID, _all(_OFFICE_THINGS, _OFFICE_LEAVES, _OFFICE_DESKS))


# A cluttered laboratory, and a store beside it.
_LAB_ROOMS: list[Box] = [
    (0.0, 0.0, 13.6, 9.4),
    (13.72, 3.0, 18.0, 9.4),
    (13.6, 5.2, 13.72, 5.2 + 1.1),
    (5.4, 9.4, 5.4 + DOOR, 9.4 + RECESS),
    (-RECESS, 1.4, 0.0, 1.4 + DOOR),
]
_LAB_SOLID: list[Box] = [
    (0.0, 0.0, 0.5, 1.1),
    (3.4, 0.0, 3.8, 0.3),
    (9.0, 0.0, 9.4, 0.3),
    (3.4, 9.1, 3.8, 9.4),
    (9.0, 9.1, 9.4, 9.4),
    (6.6, 8.8, 8.6, 9.4),
    (0.0, 4.4, 0.45, 6.6),
    (13.1, 0.9, 13.6, 3.1),
    (6.2, 4.6, 6.5, 4.9),
    (16.1, 8.8, 18.0, 9.4),
    (13.72, 3.0, 14.9, 3.5),
]
_LAB_THINGS = _all(
    [
        box(3.3, 2.9, 2.2, 0.75, 0.06),
        box(3.6, 6.5, 2.0, 0.8, -0.1),
        box(6.4, 3.9, 0.9, 0.6, 0.0),
        box(6.3, 5.6, 0.8, 0.5, 0.2),
        box(9.9, 3.1, 0.75, 2.2, 0.12),
        box(9.4, 6.1, 2.1, 0.7, 0.35),
        box(12.7, 6.9, 0.6, 0.5, 0.7),
        box(1.7, 8.2, 0.9, 0.6, 0.5),
        box(12.6, 8.7, 0.8, 0.7, 0.15),
        box(5.6, 0.6, 0.5, 0.4, 0.9),
        box(7.5, 0.5, 0.7, 0.6, 0.1),
        box(11.4, 0.5, 0.6, 0.5, -0.4),
        box(4.9, 8.6, 0.45, 0.45, 0.3),
        box(2.3, 0.5, 0.4, 0.6, 0.2),
        box(15.6, 4.1, 0.9, 0.5, 0.3),
        box(17.3, 6.6, 0.6, 1.4, -0.08),
        box(15.2, 8.5, 0.5, 0.5, 0.6),
        disc(0.55, 3.3, 0.3),
        disc(6.0, 2.6, 0.25, 8),
        disc(11.6, 4.6, 0.22, 10),
        disc(8.2, 6.9, 0.2, 8),
        disc(10.9, 8.8, 0.3),
    ],
    chair(4.6, 3.7, 0.5),
    chair(2.5, 5.7, 1.1),
    chair(7.4, 5.5, 0.3),
    chair(8.8, 2.9, 0.2),
    chair(11.8, 7.5, 0.8),
    chair(10.9, 2.4, 1.3),
    chair(16.5, 7.9, 0.7),
)
LABORATORY_WAY = [
    (1.3, 2.0),
    (1.4, 4.6),
    (5.3, 5.0),
    (5.2, 7.6),
    (10.4, 7.7),
    (11.9, 5.7),
    (14.9, 5.8),
    (16.0, 6.6),
    (14.6, 5.75),
    (12.2, 5.6),
    (12.0, 1.5),
    (8.3, 1.6),
    (8.1, 4.9),
]


def laboratory() -> World:
    """A laboratory full of benches, chairs, boxes and robots, hardly two of them parallel."""
    return World.build("laboratory", _LAB_ROOMS, _LAB_SOLID, _LAB_THINGS)


# A hall with an entrance, long walls, four columns; a passage leads away.
_HALL_ROOMS: list[Box] = [
    (0.0, 0.0, 26.0, 15.0),
    (26.0, 6.0, 33.0, 8.6),
    (9.0, -2.2, 14.0, 0.0),  # the entrance
    (4.2, 15.0, 6.0, 16.2),  # niches
    (17.0, 15.0, 20.5, 15.8),
    (-RECESS, 4.0, 0.0, 4.0 + 2 * DOOR),
    (-RECESS, 10.5, 0.0, 10.5 + DOOR),
    (21.0, -RECESS, 21.0 + 2 * DOOR, 0.0),
    (28.2, 8.6, 28.2 + DOOR, 8.6 + RECESS),
    (30.4, 6.0 - RECESS, 30.4 + DOOR, 6.0),
]
_HALL_SOLID: list[Box] = [
    (0.0, 13.2, 1.8, 15.0),
    (22.4, 14.4, 26.0, 15.0),
    (25.6, 0.0, 26.0, 2.4),
    (25.7, 10.8, 26.0, 11.2),
    (2.6, 0.0, 3.0, 0.25),
    (10.6, 14.75, 11.0, 15.0),
]
_HALL_THINGS = [
    *(disc(x, y, 0.35, 16) for x, y in ((7.0, 4.6), (7.0, 10.4), (18.6, 4.6), (18.6, 10.4))),
    box(12.9, 12.2, 3.4, 0.8, 0.0),  # the desk
    box(14.3, 12.9, 0.6, 0.8, 0.0),
    box(3.4, 7.5, 0.5, 1.9, 0.15),  # benches
    box(22.6, 3.1, 1.9, 0.5, -0.25),
    box(23.6, 12.6, 1.0, 0.6, 0.5),
    disc(1.2, 1.2, 0.45, 10),
    disc(15.2, 1.0, 0.4, 10),
    box(32.3, 7.9, 0.9, 0.6, 0.1),
]
HALL_WAY = [
    (11.4, -1.4),
    (11.5, 2.8),
    (5.0, 6.8),
    (5.2, 11.9),
    (9.8, 12.0),
    (10.2, 9.2),
    (16.2, 9.0),
    (21.5, 7.2),
    (30.6, 7.3),
]


def hall() -> World:
    """A hall of 26 m by 15 m: long perpendicular walls, four columns, little else."""
    return World.build("hall", _HALL_ROOMS, _HALL_SOLID, _HALL_THINGS)


# One wing of a building, seen by two robots.
_WING_ROOMS: list[Box] = [
    (0.0, 5.0, 24.0, 7.2),  # the corridor
    (10.6, 7.2, 12.8, 15.0),  # a second one, across
    (0.0, 0.0, 5.3, 4.88),
    (5.42, 0.0, 9.2, 4.88),
    (9.32, 0.6, 15.8, 4.88),
    (15.92, 0.0, 20.0, 4.88),
    (20.12, 1.4, 24.0, 4.88),
    (0.0, 7.32, 4.4, 11.0),
    (4.52, 7.32, 10.48, 12.6),
    (12.92, 7.32, 17.6, 13.0),
    (17.72, 7.32, 24.0, 11.2),
]
_WING_OPENINGS: list[Box] = [
    (2.0, 4.88, 2.0 + DOOR, 5.0),
    (7.4, 4.88, 7.4 + DOOR, 5.0),
    (12.2, 4.88, 12.2 + 1.5, 5.0),
    (17.2, 4.88, 17.2 + DOOR, 5.0),
    (22.0, 4.88, 22.0 + DOOR, 5.0),
    (3.0, 7.2, 3.0 + DOOR, 7.32),
    (10.48, 9.3, 10.6, 9.3 + DOOR),
    (12.8, 11.0, 12.92, 11.0 + DOOR),
    (19.0, 7.2, 19.0 + DOOR, 7.32),
]
_WING_SHUT: list[Box] = [
    (5.9, 7.2, 5.9 + DOOR, 7.2 + RECESS),
    (14.5, 7.2, 14.5 + DOOR, 7.2 + RECESS),
    (15.3, 5.0 - RECESS, 15.3 + 0.7, 5.0),
    (24.0, 5.6, 24.0 + RECESS, 5.6 + DOOR),
    (11.2, 15.0, 11.2 + DOOR, 15.0 + RECESS),
    (12.8, 8.0, 12.8 + RECESS, 8.0 + DOOR),
]
_WING_SOLID: list[Box] = [
    (4.6, 5.0, 4.95, 5.2),
    (9.9, 5.0, 10.25, 5.2),
    (19.4, 5.0, 19.75, 5.2),
    (8.2, 6.98, 8.55, 7.2),
    (16.6, 6.98, 16.95, 7.2),
    (20.6, 6.75, 22.2, 7.2),
    (12.55, 13.2, 12.8, 13.6),
    (10.6, 11.9, 11.0, 13.3),
    (9.32, 0.6, 10.4, 1.2),
    (12.92, 12.4, 15.4, 13.0),
]
WING_WAYS = (
    [(1.0, 6.1), (7.8, 6.05), (7.85, 3.0), (7.8, 6.05), (11.7, 6.2), (11.75, 10.2), (11.6, 13.4)],
    [(23.0, 6.0), (17.72, 6.1), (17.7, 3.2), (17.72, 6.1), (12.9, 6.1), (12.8, 3.2), (12.7, 6.0), (6.4, 6.1)],
)


_WING_BOTH = _all(
    [box(2.0, 4.43, 0.05, 0.9, -0.1), box(7.42, 4.43, 0.05, 0.9, 0.05), box(17.22, 4.43, 0.05, 0.9, 0.12)],
    [box(14.9, 2.0, 0.5, 1.8), box(9.55, 3.6, 0.4, 1.0), disc(10.3, 5.4, 0.18, 8), box(6.2, 5.25, 0.9, 0.4, 0.03)],
    [box(18.9, 1.2, 0.5, 0.9, 0.3), box(13.9, 5.35, 0.6, 0.45, 0.08), disc(23.5, 6.9, 0.2)],
    _desk(6.9, 1.4),
    _desk(3.0, 1.8, 0.1),
    _desk(17.2, 1.2, -0.1),
    _desk(8.6, 10.0, pi / 2),
    chair(12.4, 1.6, 0.1, 1.5),
)
_WING_FIRST = _all(
    [box(2.4, 6.9, 0.6, 0.4, 0.1), box(12.0, 14.3, 0.5, 0.5, 0.4), disc(18.3, 6.9, 0.2, 8)],
    chair(8.5, 3.9, 0.3),
    chair(11.3, 2.2, 0.9),
    chair(13.6, 1.4, 0.2),
)
_WING_SECOND = _all(
    [box(3.8, 6.85, 0.6, 0.4, 0.5), box(15.7, 6.9, 0.5, 0.4, -0.2), box(22.6, 5.35, 0.8, 0.5, 0.15)],
    chair(8.7, 3.2, 0.8),
    chair(11.0, 2.9, 0.2),
    chair(13.9, 3.7, 1.0),
    chair(18.6, 3.6, 0.6),
)


def wing() -> World:
    """Two corridors that meet, and the rooms along them, without anything that can be moved."""
    return World.build("two-robots", _WING_ROOMS + _WING_OPENINGS + _WING_SHUT, _WING_SOLID)


def wing_things(session: int) -> list[Shape]:
    """What stands in the wing in the first (0) or second (1) session: between them people moved things."""
    moved = _WING_FIRST if session == 0 else _WING_SECOND
    return _all(_WING_BOTH, moved)
