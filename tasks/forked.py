"""What a process has loaded before workers are forked from it: compiled kernels, which all of them then share.

Importing this module loads them. It starts no threads, since a fork does not copy them.
"""

from glint.tasks.engine.threads import use_one_thread
from glint.tasks.warm_up import load_kernels

use_one_thread()
load_kernels()
