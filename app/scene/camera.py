"""Where the camera of each browser stands.

There is no orthographic camera: 2D is a field of view of one degree from far away, straight down.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from itertools import product
from typing import TypeAlias

import numpy as np
import viser

from app.drawables import Box
from app.drawing import Picture
from segmap.pose import FloatArray

__all__ = ["Cameras", "reach", "stand"]

Triple: TypeAlias = tuple[float, float, float]

FIELD_OF_VIEW = {2: math.radians(1.0), 3: math.radians(45.0)}
MARGIN = 1.12
MOVED = 1e-3
"""of the distance: a camera farther from where it was put was moved by a person"""
LEAST = 0.5
"""metres from the middle to the edge of the window, at least"""
TALL = 0.4
"""in 3D: height to be seen, in widths, so that the space of poses is in sight too"""
UP_2D, BACK_2D = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
UP_3D = np.array([0.0, 0.0, 1.0])
BACK_3D = np.array([-0.45, -0.75, 0.75]) / np.linalg.norm([-0.45, -0.75, 0.75])
"""from what is looked at to the camera"""
PICK_PIXELS = 10.0


@dataclass(frozen=True)
class _Stand:
    """Where a camera stands."""

    fov: float
    near: float
    far: float
    up: Triple
    position: Triple
    look_at: Triple

    @classmethod
    def of(cls, camera: viser.CameraHandle) -> _Stand:
        distance = float(np.linalg.norm(np.subtract(camera.position, camera.look_at)))
        places = (_triple(np.asarray(one)) for one in (camera.up_direction, camera.position, camera.look_at))
        return cls(camera.fov, *near_far(distance), *places)

    def take(self, camera: viser.CameraHandle) -> None:
        """Put a camera there."""
        camera.fov, camera.near, camera.far = self.fov, self.near, self.far
        camera.up_direction, camera.position, camera.look_at = self.up, self.position, self.look_at


class Cameras:
    """Fits the cameras of all browsers to what is shown, and again when their windows change."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._lock = threading.Lock()
        self._picture: Picture | None = None
        self._fits = -1
        self._put: dict[int, tuple[float, Triple]] = {}
        self._followers: list[Cameras] = []
        self._led: _Stand | None = None

    def follow(self, picture: Picture, fits: int) -> None:
        """Fit all cameras if something else is looked at, from another side, or if somebody asked for it."""
        with self._lock:
            before, self._picture = self._picture, picture
            asked, self._fits = fits != self._fits, fits
        changed = before is None or (before.subject, before.dimension) != (picture.subject, picture.dimension)
        if changed or asked:
            self._begin(picture)
            for client in self._server.get_clients().values():
                self.fit(client)

    def _begin(self, picture: Picture) -> None:
        """How browsers that connect from now on start."""
        camera = self._server.initial_camera
        position, look_at, up = stand(picture.bounds, picture.dimension, 16.0 / 9.0)
        camera.fov = FIELD_OF_VIEW[picture.dimension]
        distance = float(np.linalg.norm(np.subtract(position, look_at)))
        camera.near, camera.far = near_far(distance)
        camera.up, camera.look_at, camera.position = up, look_at, position

    def welcome(self, client: viser.ClientHandle) -> None:
        """Fit a browser that has just connected, and look out for changes of its window."""
        self.fit(client)
        self._imitate(client)
        client.camera.on_update(lambda camera: self._moved(camera.client))

    def lead(self, followers: Cameras) -> None:
        """Let the cameras of another scene look where those of this one look; the last one moved is followed."""
        self._followers.append(followers)
        for client in self._server.get_clients().values():
            followers.look(_Stand.of(client.camera))

    def look(self, stand: _Stand) -> None:
        """Put all cameras where somebody else's stands."""
        self._led = stand
        for client in self._server.get_clients().values():
            self._imitate(client)

    def _imitate(self, client: viser.ClientHandle) -> None:
        if self._led is not None:
            with client.atomic():
                self._led.take(client.camera)

    def _moved(self, client: viser.ClientHandle) -> None:
        """A camera was moved, or its window changed."""
        if self._led is None:
            self._keep_fitted(client)
        stand = _Stand.of(client.camera) if self._followers else None
        for follower in self._followers:
            if stand is not None:
                follower.look(stand)

    def forget(self, client: viser.ClientHandle) -> None:
        """A browser has gone."""
        with self._lock:
            self._put.pop(client.client_id, None)

    def fit(self, client: viser.ClientHandle) -> None:
        """Bring everything into one browser's sight."""
        with self._lock:
            picture = self._picture
            if picture is None:
                return
            aspect = client.camera.aspect
            position, look_at, up = stand(picture.bounds, picture.dimension, aspect)
            self._put[client.client_id] = (aspect, position)
        distance = float(np.linalg.norm(np.subtract(position, look_at)))
        with client.atomic():
            client.camera.fov = FIELD_OF_VIEW[picture.dimension]
            client.camera.near, client.camera.far = near_far(distance)
            client.camera.max_orbit_distance = 20.0 * distance
            client.camera.up_direction = up
            client.camera.position = position
            client.camera.look_at = look_at

    def _keep_fitted(self, client: viser.ClientHandle) -> None:
        """Fit again when the window's shape changed, unless a person has moved the camera."""
        if client.client_id not in self._server.get_clients():
            return  # it has gone since
        with self._lock:
            aspect, position = self._put.get(client.client_id, (0.0, (0.0, 0.0, 0.0)))
        if abs(client.camera.aspect - aspect) < 1e-3:
            return
        distance = float(np.linalg.norm(np.subtract(position, client.camera.look_at)))
        if float(np.linalg.norm(np.subtract(position, client.camera.position))) <= MOVED * distance:
            self.fit(client)


def stand(bounds: Box, dimension: int, aspect: float) -> tuple[Triple, Triple, Triple]:
    """Position, point looked at and up direction of a camera that sees all of a box, in a window of that shape."""
    left, bottom, right, top = bounds
    height = TALL * max(right - left, top - bottom) if dimension == 3 else 0.0
    corners = np.array(list(product((left, right), (bottom, top), (0.0, height))))
    centre = np.array([(left + right) / 2.0, (bottom + top) / 2.0, height / 2.0])
    up, back = (UP_2D, BACK_2D) if dimension == 2 else (UP_3D, BACK_3D)
    position = centre + _distance(corners - centre, up, back, dimension, max(aspect, 1e-3)) * back
    return _triple(position), _triple(centre), _triple(up)


def _distance(corners: FloatArray, up: FloatArray, back: FloatArray, dimension: int, aspect: float) -> float:
    """From how far all corners, given from the centre, are within the window."""
    sideways = np.cross(up, back) / np.linalg.norm(np.cross(up, back))
    upwards = np.cross(back, sideways)
    tangent = math.tan(FIELD_OF_VIEW[dimension] / 2.0)
    across = np.maximum(abs(corners @ upwards), abs(corners @ sideways) / aspect)
    return float(np.max(np.maximum(across * MARGIN, LEAST) / tangent + corners @ back))


def _triple(point: FloatArray) -> Triple:
    x, y, z = point
    return float(x), float(y), float(z)


def near_far(distance: float) -> tuple[float, float]:
    """Clipping planes for a camera at a distance from what it looks at, with room to come nearer and go away."""
    return distance / 200.0, distance * 25.0


def reach(client: viser.ClientHandle) -> float:
    """How far from a click something may be and is still meant, metres."""
    camera = client.camera
    distance = float(np.linalg.norm(np.subtract(camera.position, camera.look_at)))
    pixel = 2.0 * distance * math.tan(camera.fov / 2.0) / max(1, camera.image_height)
    return PICK_PIXELS * pixel
