"""Warm-up of a worker: kernels that its process, or the one that it was forked from, has loaded are not run again."""

from glint.tasks import warm_up


def test_a_process_whose_kernels_are_loaded_only_draws() -> None:
    loaded = warm_up.load_kernels()
    before = warm_up.load_kernels.cache_info().misses
    warm_up.warm_up()
    assert warm_up.load_kernels.cache_info().misses == before
    assert warm_up.load_kernels() is loaded, "and a fork inherits it"
