"""Where the runs of a sweep are carried out: workers of Dask on this machine, or those of a scheduler that runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from taichi_lsm.core.errors import InputError

if TYPE_CHECKING:
    from distributed import Client

CONNECT_S = 30.0  # for which a scheduler is tried
NEEDED = "pip install 'taichi-lsm[cluster]'"


@contextmanager
def client_of(address: str | None, jobs: int) -> Iterator[Client]:
    """A client of the scheduler at `address`, or of `jobs` workers on this machine that end with the block.

    Raises
    ------
    InputError
        If Dask is not installed, or there is no scheduler at the address.
    """
    try:
        from distributed import Client, LocalCluster
    except ImportError:
        raise InputError(f"sweep: needs dask and distributed, which are not installed; {NEEDED}") from None
    if address is not None:
        try:
            client = Client(address, timeout=CONNECT_S)
        except (OSError, ValueError) as error:
            raise InputError(
                f"--scheduler {address}: there is no scheduler ({error}); start one with: dask scheduler"
            ) from error
        with client:
            yield client
        return
    # One thread each: a run is a process of its own beside the worker, which only waits. Workers may take all memory.
    with (
        LocalCluster(
            n_workers=jobs, threads_per_worker=1, memory_limit=None, dashboard_address="127.0.0.1:0", host="127.0.0.1"
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client
