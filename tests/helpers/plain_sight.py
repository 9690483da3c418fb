"""A plain reading of what beams say, point by point and straight from the definitions.

The twin of the compiled kernels of lines of sight and of refinement: the beams around a point are found by
sorting headings, distances by looking at every piece, derivatives by differences.
"""

import math
from itertools import pairwise

import numpy as np

from segmap._sight_kernels import CONTRADICTED, SHADOWED, SUPPORTED, UNSEEN
from segmap.pose import Pose2

GAP = 0.5
"""metres; neighbouring returns closer than this are one surface"""


def turned(angle):
    return angle % (2.0 * math.pi)


def around(scan, heading, each):
    """The beams next to a heading, ``each`` on either side, from right to left; None where there is no beam."""
    turns = turned(scan.angles - heading)
    order = np.argsort(turns, kind="stable").tolist()
    if scan.all_round:
        left, right = order[:each], order[::-1][:each]
        return [*[None] * (each - len(right)), *right[::-1], *left, *[None] * (each - len(left))]
    slots = [None] * (2 * each)
    for k in order:
        steps = (turns[k] if turns[k] < math.pi else turns[k] - 2.0 * math.pi) / abs(scan.angle_step)
        if -each <= steps < each:
            slots[each + math.floor(steps)] = k
    return slots


def returned(scan, beam):
    """Where a beam's return is, in the sensor's frame; None without one."""
    if beam is None or math.isnan(scan.ranges[beam]):
        return None
    angle = scan.first_angle + beam * scan.angle_step
    return scan.ranges[beam] * np.array([math.cos(angle), math.sin(angle)])


def to_piece(point, a, b):
    """Distance from the line segment a b, and the share along it of the foot, not limited to the segment."""
    share = (point - a) @ (b - a) / ((b - a) @ (b - a))
    return math.dist(point, a + min(1.0, max(0.0, share)) * (b - a)), share


def goes_on(scan, right, left):
    """Whether the surface goes on between the returns of two neighbouring beams.

    It does where they are near to each other; and along a wall at a grazing angle, where the return beyond one of
    them lies on their line, not much nearer than they are to each other.
    """
    a, b = returned(scan, right), returned(scan, left)
    if a is None or b is None or math.dist(a, b) == 0.0:
        return False
    if math.dist(a, b) < GAP:
        return True
    beyond = (returned(scan, beside(scan, right, -1)), a, b), (returned(scan, beside(scan, left, 1)), b, a)
    return math.dist(a, b) < 4.0 and any(c is not None and in_a_row(c, near, far) for c, near, far in beyond)


def in_a_row(c, near, far):
    """Whether a return c goes before two others: at most 4 cm off their line, and not too near to the first."""
    along = (far - near) / math.dist(near, far)
    back = near - c
    across = abs(along[0] * back[1] - along[1] * back[0])
    return across < 0.04 and 2.5 * (along @ back) > math.dist(near, far)


def beside(scan, beam, step):
    """The next beam to the left (step 1) or to the right (-1); None where there is none."""
    following = beam + (step if scan.angle_step > 0.0 else -step)
    if scan.all_round:
        return following % len(scan)
    return following if 0 <= following < len(scan) else None


def to_surface(point, scan, beams):
    """Distance from the polyline through the returns of beams (None: none), joined where the surface goes on."""
    known = [returned(scan, beam) for beam in beams if returned(scan, beam) is not None]
    distances = [math.dist(point, corner) for corner in known]
    for right, left in pairwise(beams):
        if right is not None and left is not None and goes_on(scan, right, left):
            distances.append(to_piece(point, returned(scan, right), returned(scan, left))[0])
    return min(distances, default=math.inf)


def seen(sight, point, parameters):
    """How one sensor sees a point of the map, and how far the point is from where that changes, metres."""
    local = sight.T_map_sensor.inverse() @ np.asarray(point)
    heading, far = math.atan2(local[1], local[0]), math.hypot(*local)
    beams = around(sight.scan, heading, 2)
    clear = [far * min(turned(heading - angle), turned(angle - heading)) for angle in sight.scan.angles]
    if beams[1] is None and beams[2] is None:
        return UNSEEN, min(clear)
    corners = [returned(sight.scan, beam) for beam in beams]
    distance = to_surface(local, sight.scan, beams)
    clear.append(abs(distance - parameters.sight_tolerance))
    if distance <= parameters.sight_tolerance:
        return SUPPORTED, min(clear)
    if corners[1] is None or corners[2] is None:
        return UNSEEN, min(clear)
    ranges = [math.hypot(*corner) for corner in corners[1:3]]
    borders = (*ranges, max(ranges) + parameters.shadow_depth)
    clear += [abs(far - border) for border in borders]
    if far < min(ranges):
        return CONTRADICTED, min(clear)
    if max(ranges) < far < max(ranges) + parameters.shadow_depth:
        return SHADOWED, min(clear)
    return UNSEEN, min(clear)


def classes(sights, points, parameters):
    """The class of each point by all sensors together, and how clear it is: the least of the sensors."""
    found = [[seen(sight, point, parameters) for sight in sights] for point in points]
    return np.array([min(c for c, _ in row) for row in found]), np.array([min(m for _, m in row) for row in found])


# --- refinement -----------------------------------------------------------------------------------


def surface_line(scan, point, gate, reach=3):
    """The line of the surface nearest to a point, as (normal, offset, distance); and whether two are as near."""
    beams = around(scan, math.atan2(point[1], point[0]), reach + 1)
    found = []
    for right, left in pairwise(beams):
        if right is None or left is None or not goes_on(scan, right, left):
            continue
        distance, share = to_piece(point, returned(scan, right), returned(scan, left))
        if -0.5 <= share <= 1.5 and distance < gate:
            found.append((distance, right, left))
    if not found:
        return None, False
    found.sort()
    tie = len(found) > 1 and found[1][0] - found[0][0] < 1e-9
    distance, right, left = found[0]
    return (*line_through(scan, right, left), distance), tie


def line_through(scan, right, left):
    """The line through two neighbouring returns, over one more on either side where the surface goes on."""
    before, after = beside(scan, right, -1), beside(scan, left, 1)
    first = before if before is not None and goes_on(scan, before, right) else right
    last = after if after is not None and goes_on(scan, left, after) else left
    first, last = returned(scan, first), returned(scan, last)
    x, y = (last - first) / math.dist(first, last)
    return np.array([-y, x]), np.array([-y, x]) @ (first + last) / 2.0


def normal_equations(scan_1, scan_2, points_1, points_2, pose, gate):
    """J^T W J and -J^T W r at a pose (x, y, theta) ``T_1_2`` of two scans at their origins."""
    rows, weights, residuals = [], [], []

    def moved_2(p, points=points_2):
        return Pose2(*p) @ points

    def moved_1(p, points=points_1):
        return Pose2(*p).inverse() @ points

    for scan, moved in ((scan_1, moved_2), (scan_2, moved_1)):
        places = moved(pose)
        slopes = np.stack([(moved(pose + h) - moved(pose - h)) / 2e-6 for h in 1e-6 * np.eye(3)], axis=-1)
        for place, slope in zip(places, slopes, strict=True):
            line, _ = surface_line(scan, place, gate)
            if line is not None:
                normal, offset, distance = line
                rows.append(normal @ slope)
                weights.append((1.0 - (distance / gate) ** 2) ** 2)
                residuals.append(normal @ place - offset)
    jacobian, weighted = np.array(rows), np.array(rows) * np.array(weights)[:, None]
    return weighted.T @ jacobian, -weighted.T @ np.array(residuals)


# --- refinement in fields -------------------------------------------------------------------------


def pieces(scan):
    """The surface between neighbouring beams' returns, by beam: (from, to, normal, offset)."""
    found = []
    for k in range(len(scan)):
        left = (k + 1) % len(scan)
        if left == 0 and not scan.all_round:
            continue
        if goes_on(scan, k, left):
            found.append((returned(scan, k), returned(scan, left), *line_through(scan, k, left)))
    return found


def normal_equations_in_fields(ways, pose, gate):
    """J^T W J, -J^T W r and the sum of W at a pose ``T_1_2``.

    Of each way: a scan, its field, the other one's points, 1 where the pose moves them and -1 where its inverse does.
    """
    rows, weights, residuals = [], [], []
    for scan, field, points, way in ways:
        surface = pieces(scan)

        def moved(p, points=points[:, :2], way=way):
            return (Pose2(*p) if way > 0 else Pose2(*p).inverse()) @ points

        places = moved(pose)
        slopes = np.stack([(moved(pose + h) - moved(pose - h)) / 2e-6 for h in 1e-6 * np.eye(3)], axis=-1)
        for place, slope in zip(places, slopes, strict=True):
            column, row = np.floor((place - field.frame[:2]) * field.frame[2]).astype(int)
            inside = 0 <= row < field.nearest.shape[0] and 0 <= column < field.nearest.shape[1]
            if not inside or field.nearest[row, column] < 0:
                continue
            a, b, normal, offset = surface[field.nearest[row, column]]
            distance, share = to_piece(place, a, b)
            if distance < gate and -0.5 <= share <= 1.5:
                rows.append(normal @ slope)
                weights.append((1.0 - (distance / gate) ** 2) ** 2)
                residuals.append(normal @ place - offset)
    jacobian, weighted = np.array(rows), np.array(rows) * np.array(weights)[:, None]
    return weighted.T @ jacobian, -weighted.T @ np.array(residuals), sum(weights)
