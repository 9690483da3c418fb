"""The sample logs that come with the program."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.creation import Source
from app.errors import UnknownError
from app.resources import samples_folder
from segmap.export import thumbnail
from segmap.merging import Component
from segmap.segments import SegmentMap

__all__ = ["Sample", "Samples"]

INDEX = "samples.json"


@dataclass(frozen=True)
class Sample:
    """A sample: one log, or several of one building."""

    name: str
    title: str
    description: str
    scans: int
    files: tuple[str, ...]
    truth: str = ""


class Samples:
    """The samples of a folder, as its index lists them."""

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder or samples_folder()

    def all(self) -> tuple[Sample, ...]:
        """Every sample, in the order of the index; none where there is no index."""
        path = self._folder / INDEX
        if not path.is_file():
            return ()
        held = json.loads(path.read_text("utf-8"))["samples"]
        return tuple(Sample(**{**entry, "files": tuple(entry["files"])}) for entry in held)

    def get(self, name: str) -> Sample:
        """The sample of a name. Raises UnknownError where there is none."""
        for sample in self.all():
            if sample.name == name:
                return sample
        raise UnknownError(f"There is no sample {name[:80]!r}.")

    def picture(self, sample: Sample) -> str:
        """A small SVG of the walls the sample was made from."""
        if not sample.truth:
            raise UnknownError(f"The sample {sample.name!r} has no picture.")
        truth = json.loads((self._folder / sample.truth).read_text("utf-8"))
        walls = SegmentMap(np.concatenate([session["walls"] for session in truth["sessions"]]))
        return thumbnail([Component(sample.name, (), {}, walls)])

    @contextmanager
    def opened(self, sample: Sample) -> Iterator[list[Source]]:
        """The logs of a sample, open."""
        with ExitStack() as stack:
            files = [(name, stack.enter_context((self._folder / name).open("rb"))) for name in sample.files]
            yield [Source(name, file) for name, file in files]
