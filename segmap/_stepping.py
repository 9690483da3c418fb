"""The step that both refinements take: in the exact beams, and in fields drawn of them."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

__all__ = ["step_down"]

MOVE_STEP = 0.3
"""metres; refinement moves no farther in one step"""
TURN_STEP = 0.1
"""radians; nor turns farther"""


@njit(cache=True, nogil=True, error_model="numpy")
def step_down(normal, rhs, pose):  # type: ignore[no-untyped-def]
    """One damped, bounded Gauss-Newton step."""
    damped = normal.copy()
    damping = 1e-5 * (normal[0, 0] + normal[1, 1]) + 1e-9
    for i in range(3):
        damped[i, i] += damping
    delta = np.linalg.solve(damped, rhs)
    length = math.sqrt(delta[0] * delta[0] + delta[1] * delta[1])
    shrink = min(1.0, MOVE_STEP / max(length, 1e-12))
    pose[0] += shrink * delta[0]
    pose[1] += shrink * delta[1]
    pose[2] += min(TURN_STEP, max(-TURN_STEP, delta[2]))
