"""Projects that were deleted: set aside until somebody wants them back, or wants them gone for good."""

from __future__ import annotations

from pathlib import Path

from app.errors import RequestError, UnknownError

__all__ = ["Trash"]

FOLDER = ".deleted"
SIDES = ("", "-wal", "-shm")
"""what may lie beside a project file and is part of it"""


class Trash:
    """A folder inside that of the projects, with the same names in it."""

    def __init__(self, projects: Path, suffix: str) -> None:
        self._projects, self._suffix = projects, suffix

    @property
    def ids(self) -> list[str]:
        """Of all projects in it, in order."""
        return sorted(path.stem for path in self._folder.glob(f"*{self._suffix}"))

    def path(self, id: str) -> Path:
        """The file of a deleted project.

        Raises:
            UnknownError: none of this name was deleted.
        """
        if id not in self.ids:
            raise UnknownError(f"No project {id[:80]!r} is among the deleted ones: it may be back, or gone for good.")
        return self._folder / f"{id}{self._suffix}"

    def put(self, id: str) -> None:
        """Set a project aside."""
        self._folder.mkdir(exist_ok=True)
        _move(self._projects / f"{id}{self._suffix}", self._folder)

    def take_back(self, id: str) -> None:
        """Put a project back in its place. Raises UnknownError where none of this name was deleted."""
        _move(self.path(id), self._projects)

    def remove(self, id: str) -> None:
        """Remove a project for good. Raises UnknownError where none of this name was deleted."""
        path = self.path(id)
        for side in SIDES:
            path.with_name(path.name + side).unlink(missing_ok=True)

    @property
    def _folder(self) -> Path:
        return self._projects / FOLDER


def _move(path: Path, folder: Path) -> None:
    """Move a project file with what lies beside it.

    Raises:
        RequestError: it cannot be moved.
    """
    try:
        for side in reversed(SIDES):
            beside = path.with_name(path.name + side)
            if beside.exists():
                beside.rename(folder / beside.name)
    except OSError as error:
        raise RequestError(f"{path.name} cannot be moved to {folder}: {error.strerror}.") from None
