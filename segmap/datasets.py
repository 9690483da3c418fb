"""Public logs of real robots: where each lies, its checksum, and how it comes to this computer.

The files stay where their authors or those who kept them put them, at one commit of a public
repository; nothing is known of a file but its checksum, and no other file is taken for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from segmap.errors import DatasetError

__all__ = ["DATASETS", "Dataset", "RemoteFile", "cached", "dataset", "fetch", "folder"]

HOST = "https://raw.githubusercontent.com"
CACHE = "SEGMAP_CACHE"
"""the environment variable that names another folder to keep them in"""
SECONDS = 30.0
"""without an answer"""
_PLE = "acschaefer/ple", "cfcb5a7f12a793b616357381a688cfcc26eed347"
_FLIRTLIB = "tipaldi/flirtlib", "f608c8c486b53320a5fc701de6d70e7e803c412c"
_RELATIONS = "xiaofeng419/SLAM-2D-LIDAR-SCAN", "d469252f5b33e574bd239ad2625779497ac1d4cc"
_DP_SLAM = "OpenSLAM-org/openslam_dpslam", "6a55b243ccfec93f7e41379077949dd2e6dc11ff"


@dataclass(frozen=True, slots=True)
class RemoteFile:
    """One file at one commit of a public repository."""

    repository: str
    commit: str
    path: str
    sha256: str
    """of the file as it lies there, hexadecimal"""

    @property
    def name(self) -> str:
        """What it is called here."""
        return self.path.rpartition("/")[2]

    @property
    def url(self) -> str:
        """Where it is fetched from."""
        return f"{HOST}/{self.repository}/{self.commit}/{self.path}"


@dataclass(frozen=True, slots=True)
class Dataset:
    """A public log, and what belongs to it; the first file is the log."""

    name: str
    title: str
    scans: int
    beams: int
    files: tuple[RemoteFile, ...]


DATASETS: Mapping[str, Dataset] = {
    made.name: made
    for made in (
        Dataset(
            "intel",
            "Intel Research Lab, Seattle: offices around corridors",
            910,
            180,
            (
                RemoteFile(
                    *_PLE,
                    "data/carmen/intel-corrected.log.gz",
                    "71bef16e9926506cf7417995ef35ace09dbd5de067fd042a3aab85188b5480dc",
                ),
            ),
        ),
        Dataset(
            "intel-graph",
            "The same building, every scan, as a pose graph; with relative poses checked by hand",
            2672,
            180,
            (
                RemoteFile(
                    *_FLIRTLIB,
                    "data/intel-lab.log",
                    "dedb8eb20ca4d12ceecf7e8c0560c421de3ab9e8bcc7f8eeac4e51f9c48b21de",
                ),
                RemoteFile(
                    *_RELATIONS,
                    "DataSet/RawData/intel.relations",
                    "330378f153eeae652d6756c1746f335801f66c3e097d90611548e6c4f593c359",
                ),
            ),
        ),
        Dataset(
            "fr079-graph",
            "Freiburg, building 079, as a pose graph; with relative poses checked by hand",
            1464,
            360,
            (
                RemoteFile(
                    *_FLIRTLIB,
                    "data/fr079.log",
                    "3e07d3994f66d7835cbf9243434922f120a5ec86ad36e74c151258206af057b6",
                ),
                RemoteFile(
                    *_RELATIONS,
                    "DataSet/RawData/fr079.relations",
                    "7e7f06b4aca455cb68f1f23d04e7c7316c5e17773e872734c860ed7a274cdfc7",
                ),
            ),
        ),
        Dataset(
            "aces",
            "ACES building, Austin: long symmetric corridors, four loops",
            440,
            180,
            (
                RemoteFile(
                    *_PLE,
                    "data/carmen/aces-corrected.log.gz",
                    "5434d44384166250608a64d3a8c32de84512f82c46cb60a2657f138592024569",
                ),
            ),
        ),
        Dataset(
            "csail",
            "MIT CSAIL: offices and halls",
            406,
            361,
            (
                RemoteFile(
                    *_PLE,
                    "data/carmen/csail-corrected.log.gz",
                    "a98de24fc319651f231f9a8625b78bf1972312b86f7b00d2ddc979c4ac92ae2d",
                ),
            ),
        ),
        Dataset(
            "fr101",
            "Freiburg, building 101: sparse halls",
            292,
            360,
            (
                RemoteFile(
                    *_PLE,
                    "data/carmen/freiburg-101-corrected.log.gz",
                    "7792de88bcb050f8edba92914aea75e8ec2fb73b483c01903bd2753aa655e982",
                ),
            ),
        ),
        Dataset(
            "loop5",
            "The loop of DP-SLAM: a laser of 8 m in corridors, no truth",
            551,
            181,
            (
                RemoteFile(
                    *_DP_SLAM,
                    "loop5.log",
                    "ffe71e2e63bb3cd69f6387fd24d169a93ede496cd26c98766a45433be5f236b6",
                ),
            ),
        ),
    )
}
"""Every public log that is known, by name."""


def dataset(name: str) -> Dataset:
    """The dataset of a name.

    Raises:
        DatasetError: there is none.
    """
    try:
        return DATASETS[name]
    except KeyError:
        raise DatasetError(f"There is no dataset {name[:80]!r}. Datasets are: {', '.join(DATASETS)}.") from None


def folder() -> Path:
    """Where fetched files are kept: the computer's place for such things, or what SEGMAP_CACHE says."""
    import pooch

    return Path(pooch.create(pooch.os_cache("segmap"), "", env=CACHE).abspath)


def cached(file: RemoteFile) -> bool:
    """Whether a file is here already; its checksum is looked at when it is fetched."""
    return _place(file).is_file()


def fetch(wanted: Dataset, progress: Callable[[RemoteFile], None] | None = None) -> tuple[Path, ...]:
    """The files of a dataset on this computer, fetched where they are missing or damaged; checksums hold always.

    ``progress`` is told of each file that has to be fetched, before.

    Raises:
        DatasetError: a file cannot be fetched, kept, or is not what it should be.
    """
    return tuple(_fetched(file, progress) for file in wanted.files)


def _place(file: RemoteFile) -> Path:
    return folder() / file.sha256[:12] / file.name


def _fetched(file: RemoteFile, progress: Callable[[RemoteFile], None] | None) -> Path:
    import pooch
    from requests import RequestException

    place = _place(file)
    if progress is not None and not place.is_file():
        progress(file)
    pooch.get_logger().setLevel("WARNING")
    try:
        pooch.retrieve(
            file.url,
            known_hash=f"sha256:{file.sha256}",
            fname=place.name,
            path=place.parent,
            downloader=pooch.HTTPDownloader(timeout=SECONDS),
        )
    except RequestException as error:
        raise DatasetError(
            f"{file.name} cannot be fetched from {file.url}: {_reason(error)}."
            f" Check the network, or put the file there yourself: {place}"
        ) from None
    except ValueError:
        raise DatasetError(
            f"{file.name}, as it comes from {file.url}, is not the file that is known"
            " (its checksum differs), and was not kept."
        ) from None
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise DatasetError(
            f"{file.name} cannot be kept in {place.parent}: {reason}. Set {CACHE} to a folder."
        ) from None
    return place


def _reason(error: Exception) -> str:
    status = getattr(getattr(error, "response", None), "status_code", None)
    return f"the server answered {status}" if status else "the server cannot be reached"
