"""Which reading of a laser stands for "nothing seen", found in the data.

A laser that sees nothing writes the end of its scale (81.91, 8.19, 50, ...). Such a reading
recurs, exactly the same, far more often than any real range just below it, in several beams, and
next to nothing lies above it. That is looked for; a log without such readings has none taken.

- The last thousandth of the scale belongs together: a SICK writes several codes there
  (8183 to 8191 of 8191), and a wall that far cannot be told from them.
- "Far more often" means ``RECURS`` times the average of the next ``NEIGHBOURS`` different
  readings; ``RECURS_APART`` times is enough for a reading ``APART`` times as far as the next one;
  once is enough for a code of a known sensor that stands apart.
- A few readings above it (garbage) do not hide it: one for each ``ABOVE`` of its own, ``STRAYS`` different ones.
- The maximum range that a record declares is believed where the data agree.
- Where there is no such reading, a recurring 0 stands for nothing seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from segmap.pose import FloatArray, IntArray

__all__ = ["LONGEST", "SHORTEST", "NoReturn", "no_return"]

LONGEST = 1000.0
"""metres; no planar laser measures farther"""
SHORTEST = 0.02
"""metres; no planar laser measures nearer: smaller readings are error codes"""
MILLIMETRES = 1000
CODES = 0.001
RECURS, RECURS_APART, ABOVE, STRAYS = 10, 4, 20, 100
APART = 1.25
NEIGHBOURS = 20
FEWEST = 3
"""readings, and beams, in which it must be seen, unless it is a known sensor's code"""
BELIEVED = 0.01
"""share of all real readings that may contradict a declared maximum range"""
SENSOR_CODES = frozenset((81_830, 81_870, 81_890, 81_900, 81_910, 51_150, 65_535, 327_670, 655_350))
"""millimetres: SICK LMS in centimetres, and what is written where it sees nothing; full words"""


@dataclass(frozen=True, slots=True)
class NoReturn:
    """What stands for "nothing seen"."""

    reading: float | None
    """metres, to the millimetre; the largest reading that does; None: there is none"""
    limit: float
    """metres; readings here or beyond are no returns; infinite where no limit is known"""


def no_return(ranges: Sequence[FloatArray], declared: float | None = None) -> NoReturn:
    """Find it in all the readings of one laser; arrays of shape (beams,), metres, as written.

    ``declared`` is the maximum range that the records themselves state, metres.

    >>> no_return([np.array([1.2, 8.19, 8.19, 1.3, 8.19, 8.19])] * 3)
    NoReturn(reading=8.19, limit=8.19)
    """
    readings = np.concatenate([*ranges, np.empty(0)])
    kept = _in_range(readings)
    scale = _Scale.of(readings[kept])
    top = scale.code(_beams(ranges)[kept])
    if top is None:
        zeros = np.count_nonzero(readings == 0.0) >= FEWEST
        return NoReturn(0.0 if zeros else None, _believed(declared, readings[kept]))
    family = readings[kept & _between(readings, *top)]
    real = readings[kept & (readings < family.min())]
    return NoReturn(round(float(family.max()), 3), min(float(family.min()), _believed(declared, real)))


def _in_range(readings: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    with np.errstate(invalid="ignore"):
        return (readings > SHORTEST) & (readings < LONGEST)


def _between(readings: FloatArray, low: int, high: int) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Which readings, rounded to millimetres, lie between two numbers of millimetres."""
    with np.errstate(invalid="ignore"):
        return (readings >= (low - 0.5) / MILLIMETRES) & (readings <= (high + 0.5) / MILLIMETRES)


def _beams(ranges: Sequence[FloatArray]) -> IntArray:
    return np.concatenate([*(np.arange(len(row)) for row in ranges), np.empty(0, np.int64)])


def _believed(declared: float | None, real: FloatArray) -> float:
    if declared is None or np.count_nonzero(real > declared) > BELIEVED * len(real):
        return np.inf
    return declared


@dataclass(frozen=True, slots=True)
class _Scale:
    """All readings as whole millimetres, the different ones in order, with how often each occurs."""

    millimetres: IntArray
    values: IntArray
    counts: IntArray

    @classmethod
    def of(cls, readings: FloatArray) -> _Scale:
        millimetres = np.rint(readings * MILLIMETRES).astype(np.int64)
        return cls(millimetres, *np.unique(millimetres, return_counts=True))

    def code(self, beams: IntArray) -> tuple[int, int] | None:
        """The lowest and the highest of the codes, millimetres; ``beams``: the beam of each reading."""
        above = 0
        for top in range(len(self.values) - 1, max(len(self.values) - 1 - STRAYS, -1), -1):
            first = int(np.searchsorted(self.values, self.values[top] * (1.0 - CODES)))
            if self._is_code(first, top, above, beams):
                return int(self.values[first]), int(self.values[top])
            above += int(self.counts[top])
        return None

    def _is_code(self, first: int, top: int, above: int, beams: IntArray) -> bool:
        """Whether the most frequent of the values ``first`` to ``top`` is no range; ``above`` lie above."""
        best = first + int(np.argmax(self.counts[first : top + 1]))
        code, often = int(self.values[best]), int(self.counts[best])
        if above * ABOVE > often:
            return False
        below = self.counts[max(first - NEIGHBOURS, 0) : first]
        apart = first == 0 or self.values[first] >= APART * self.values[first - 1]
        if code in SENSOR_CODES and apart:
            return True
        if not len(below) or often < max((RECURS_APART if apart else RECURS) * below.mean(), FEWEST):
            return False
        return len(np.unique(beams[self.millimetres == code])) >= FEWEST
