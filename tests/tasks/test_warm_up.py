"""Warm-up of a worker: what the process that it was forked from has loaded is not loaded again."""

import multiprocessing
from concurrent.futures import ProcessPoolExecutor

from glint.tasks import warm_up


def _loads_kernels() -> int:
    """Warm up, and return how many times this process or its parent has run the kernels."""
    warm_up.warm_up()
    return warm_up.load_kernels.cache_info().misses


def test_a_forked_worker_only_draws() -> None:
    warm_up.load_kernels()
    with ProcessPoolExecutor(1, multiprocessing.get_context("fork")) as pool:
        assert pool.submit(_loads_kernels).result() == 1
        assert pool.submit(_loads_kernels).result() == 1, "nor does a second warm-up"
