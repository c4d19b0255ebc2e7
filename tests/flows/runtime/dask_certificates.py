"""Certificates of a Dask cluster in the configuration of this process, for clients that are given its address."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import dask
from distributed import Security

from glint.flows.runtime.dask_cluster import Cluster


def settings(security: Security) -> dict[str, Any]:
    """Dask's settings that name these certificates."""
    tls = {
        "ca-file": security.tls_ca_file,
        "client.cert": security.tls_client_cert,
        "client.key": security.tls_client_key,
        "scheduler.cert": security.tls_scheduler_cert,
        "scheduler.key": security.tls_scheduler_key,
        "worker.cert": security.tls_worker_cert,
        "worker.key": security.tls_worker_key,
    }
    return {f"distributed.comm.tls.{name}": value for name, value in tls.items()}


@contextmanager
def certificates(cluster: Cluster) -> Iterator[None]:
    """Configure Dask with the certificates of a local cluster."""
    with dask.config.set(settings(cluster.client.security)):
        yield
