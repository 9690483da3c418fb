"""The one option for a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from segmap.errors import ParameterError

__all__ = ["cluster"]

PATIENCE = "10s"
"""until a scheduler has to answer"""


@contextmanager
def cluster(address: str | None) -> Iterator[str]:
    """The backend that pairs are matched by, while it lasts: the cluster at an address, else this machine.

    Raises:
        ParameterError: Dask is not installed, or there is no cluster at the address.
    """
    if address is None:
        yield "processes"
        return
    try:
        from distributed import Client
    except ImportError:
        raise ParameterError("--dask needs Dask: pip install 'segmap[cluster]'.") from None
    try:
        client = Client(address, timeout=PATIENCE)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise ParameterError(f"There is no Dask scheduler at {address}: {error or 'it does not answer'}.") from None
    with client:
        yield "dask"
