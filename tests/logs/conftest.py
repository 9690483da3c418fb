"""Hand-made records of every kind."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest

Line = Callable[..., str]


def _words(ranges: Sequence[float]) -> str:
    return " ".join(f"{r:g}" for r in ranges)


@pytest.fixture(scope="session")
def flaser() -> Line:
    """An FLASER line of some ranges, at laser pose (1, 2, 0.5) and time 12.5."""
    return lambda *ranges, word="FLASER", rest="1 2 0.5 1.1 2.1 0.6 12.5 host 13": (
        f"{word} {len(ranges)} {_words(ranges)} {rest}"
    )


@pytest.fixture(scope="session")
def robotlaser() -> Line:
    """A ROBOTLASER1 line of some ranges, at laser pose (1, 2, 0.5) and time 12.5."""

    def line(*ranges: float, word: str = "ROBOTLASER1", reach: float = 50.0, remissions: Sequence[int] = ()) -> str:
        settings = f"0 -1.5 3.0 0.01 {reach} 0.1 0"
        reflected = " ".join(map(str, (len(remissions), *remissions)))
        poses = "" if word.startswith("RAW") else "1 2 0.5 1.1 2.1 0.6 0 0 0 0 0 "
        return f"{word} {settings} {len(ranges)} {_words(ranges)} {reflected} {poses}12.5 host 13"

    return line


@pytest.fixture(scope="session")
def small_log(flaser: Line) -> bytes:
    """A CARMEN log of six scans of eight beams, with other records between them."""
    lines = ["# message formats defined: PARAM SYNC ODOM FLASER", "PARAM robot_front_laser_max 50 nohost 0"]
    for i in range(6):
        lines += [f"ODOM {i} 0 0 0 0 0 {i} host {i}", flaser(*(1.0 + 0.37 * i + 0.11 * k for k in range(8)))]
    return "\n".join(lines).encode() + b"\n"
