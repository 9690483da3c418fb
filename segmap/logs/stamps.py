"""Times of different files that mean the same moment."""

from __future__ import annotations

import numpy as np

from segmap.pose import FloatArray, IntArray

__all__ = ["SAME_TIME", "nearest_stamps"]

SAME_TIME = 0.002
"""seconds; time stamps that are nearer mean the same moment"""


def nearest_stamps(stamps: FloatArray, wanted: FloatArray, within: float = SAME_TIME) -> IntArray:
    """The place of the stamp nearest to each wanted time, (k,), seconds; -1 where none is near enough.

    ``stamps`` ascend; of two that are equally near the earlier is taken.

    >>> nearest_stamps(np.array([1.0, 2.0]), np.array([2.001, 1.5])).tolist()
    [1, -1]
    """
    if not len(stamps):
        return np.full(len(wanted), -1)
    after = np.minimum(np.searchsorted(stamps, wanted), len(stamps) - 1)
    before = np.maximum(after - 1, 0)
    places = np.where(wanted - stamps[before] <= stamps[after] - wanted, before, after)
    return np.where(np.abs(stamps[places] - wanted) <= within, places, -1)
