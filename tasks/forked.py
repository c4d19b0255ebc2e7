"""Load libraries and compiled kernels in the process from which workers are forked, so that all of them share these.

Importing this module does it. It starts no threads, since a fork does not copy them.
"""

from glint.tasks.engine.imports import collection_paused, import_open3d

with collection_paused():
    import_open3d()
    from glint.tasks.engine.threads import use_one_thread
    from glint.tasks.warm_up import load_kernels

    use_one_thread()
    load_kernels()
