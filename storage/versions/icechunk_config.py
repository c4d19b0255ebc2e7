"""Configuration of icechunk repositories: what a process keeps in memory, and what a session reads in advance."""

import icechunk

_NO_PRELOAD = icechunk.ManifestPreloadConfig(
    max_total_refs=0, max_arrays_to_scan=0, preload_if=icechunk.ManifestPreloadCondition.false()
)
CONFIG = icechunk.RepositoryConfig(
    # By default the cache of snapshots takes a hundred megabytes for each open object; only the newest are read again.
    caching=icechunk.CachingConfig(num_snapshot_nodes=10_000, num_chunk_refs=100_000),
    # By default every session reads the manifests of all small arrays in advance, which takes twenty times as long as
    # the attributes that most sessions are opened for.
    manifest=icechunk.ManifestConfig(preload=_NO_PRELOAD),
)
