"""Components to write."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pytest

from segmap.pose import Pose2
from segmap.scans import ScanId
from segmap.segments import Order, SegmentMap, Source


@dataclass(frozen=True)
class Part:
    """What a writer needs of a component."""

    name: str
    scans: tuple[ScanId, ...]
    map: SegmentMap
    poses: Mapping[ScanId, Pose2] = field(default_factory=dict)


@pytest.fixture(scope="session")
def part() -> Callable[..., Part]:
    """A component of a name and rows of x1, y1, x2, y2, as if merged from scans 0.0 and 0.1."""

    def make(name: str, *rows: tuple[float, float, float, float]) -> Part:
        sources = tuple((Source(0, 0, i), Source(0, 1, i + 1))[: i % 3] for i in range(len(rows)))
        directed = [i % 2 == 0 for i in range(len(rows))]
        return Part(
            name,
            (ScanId(0, 0), ScanId(0, 1)),
            SegmentMap(np.array(rows), Order.NONE, np.array(directed, bool), sources),
            {ScanId(0, 0): Pose2.identity(), ScanId(0, 1): Pose2(1.0, 0.5, 0.25)},
        )

    return make


@pytest.fixture(scope="session")
def corner(part) -> Part:
    """A long foot along x, an upright along y, a short arm at the top."""
    return part("corner", (0.0, 0.0, 4.0, 0.0), (0.0, 0.0, 0.0, 2.0), (0.0, 2.0, 0.5, 2.0))
