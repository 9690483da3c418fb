"""A scan as names and values, as CSV and JSON of ranges give it: what each name means, and its units.

::

    ranges                                     metres; nothing, nan or inf: no return          needed
    first_angle, angle_step                    radians, or first_angle_deg, angle_step_deg     needed
    max_range                                  metres; readings here or beyond are no returns
    time                                       seconds
    x, y, theta (theta_deg)                    pose of the sensor in metres and radians, kept for scoring only
    sensor                                     which laser it was, where a file has several

ROS's names are known too: angle_min, angle_increment, range_max.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from segmap.logs.records import Record
from segmap.logs.text import MalformedError, printable
from segmap.pose import FloatArray, Pose2

__all__ = ["NAMES", "SENSOR", "angles_named", "scan_of"]

SENSOR = "sensor"
_UNITS = {"": 1.0, "_rad": 1.0, "_deg": math.pi / 180.0}
_ANGLES = {"first_angle": "first_angle", "angle_min": "first_angle", "theta": "theta"} | dict.fromkeys(
    ("angle_step", "angle_increment"), "angle_step"
)
_PLAIN = {"max_range": "max_range", "range_max": "max_range", "time": "time", "x": "x", "y": "y"}
NAMES: Mapping[str, tuple[str, float]] = {
    **{name: (meaning, 1.0) for name, meaning in _PLAIN.items()},
    **{f"{name}{unit}": (meaning, factor) for name, meaning in _ANGLES.items() for unit, factor in _UNITS.items()},
}
"""names of numbers: what each means, and what to multiply it by"""


def angles_named(names: set[str]) -> bool:
    """Whether first angle and angle step are among some names."""
    return {"first_angle", "angle_step"} <= {NAMES[name][0] for name in names & NAMES.keys()}


def scan_of(numbers: Mapping[str, float | None], ranges: FloatArray, line: int, sensor: str = "") -> Record:
    """The record of a scan; ``numbers`` by any of ``NAMES``, None where nothing is said.

    Raises:
        MalformedError: an angle is missing, or a number is not finite.
    """
    told = {NAMES[name][0]: value * NAMES[name][1] for name, value in numbers.items() if value is not None}
    for name in ("first_angle", "angle_step"):
        if name not in told:
            raise MalformedError(f"the scan has no {name} (radians) and no {name}_deg")
    for name, value in told.items():
        if not math.isfinite(value) and name != "max_range":
            raise MalformedError(f"{name} is {value}, not a finite number")
    reach = told.get("max_range", math.inf)
    place = [told[name] for name in ("x", "y", "theta") if name in told]
    return Record(
        sensor=printable(sensor) or "ranges",
        line=line,
        ranges=ranges,
        first_angle=told["first_angle"],
        angle_step=told["angle_step"],
        declared_range=reach if 0.0 < reach < math.inf else None,
        time=told.get("time"),
        pose=Pose2(*place) if len(place) == 3 else None,
    )
