"""Several threads read one repository at once: none waits for ever."""

import subprocess
import sys
from pathlib import Path

import numpy as np

from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository

READS = 12
"""Times that each thread opens and reads the repository: enough for a wait that some thread never ends."""
SCRIPT = """
import sys, threading
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository

def read():
    for _ in range(int(sys.argv[2])):
        assert ObjectRepository.open(Location.parse(sys.argv[1]), "vase", create=False).records("front")

threads = [threading.Thread(target=read) for _ in range(5)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
"""


def test_threads_that_open_a_repository_at_once_all_go_on(tmp_path: Path) -> None:
    repository = ObjectRepository.open(Location.parse(tmp_path), "vase")
    for number in range(6):
        repository.save("front", f"stage{number}", "key", {"mask": np.ones((8, 8), bool)}, {"seconds": 1.0})
    repository.publish(["front"], {})
    # A process of its own: threads that wait for ever hold the interpreter's lock, and no time limit would end them.
    subprocess.run([sys.executable, "-c", SCRIPT, str(tmp_path), str(READS)], check=True, timeout=120)
