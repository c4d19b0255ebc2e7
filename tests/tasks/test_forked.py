"""The process from which workers are forked: what a worker that cannot begin leaves on the terminal."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CODE = """
import multiprocessing, os, sys
from multiprocessing.synchronize import SemLock
context = multiprocessing.get_context("forkserver")
context.set_forkserver_preload(["glint.tasks.forked"])
if __name__ == "__main__":
    semaphore = context.Semaphore()
    given = {"semaphore": [semaphore], "error": [1, 0]}[sys.argv[1]]
    SemLock._cleanup(semaphore._semlock.name)
    worker = context.Process(target=divmod, args=[*given])
    worker.start()
    worker.join()
    print(worker.exitcode, flush=True)
    os._exit(0)
"""


@pytest.mark.parametrize(("given", "told"), [("semaphore", ""), ("error", "ZeroDivisionError")])
def test_a_worker_whose_run_has_ended_says_nothing(given: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "started.py").write_text(CODE)
    ended = subprocess.run(
        [sys.executable, str(tmp_path / "started.py"), given],
        env={"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert ended.stdout.strip() == "1"
    assert (told in ended.stderr) if told else not ended.stderr
