"""Being asked to stop, at any moment of a run: it ends, with its workers, and the dashboard knows."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest

from glint.flows.runtime import signals
from tests.polling import PATIENCE

pytestmark = pytest.mark.server
GLINT = [sys.executable, "-m", "glint", "run"]
ROOT = Path(__file__).parents[3]


def catches_signals(pid: int) -> bool:
    """Whether a process has a handler of SIGTERM, which Python itself does not install."""
    caught = next(
        line for line in Path(f"/proc/{pid}/status").read_text().splitlines() if line.startswith("SigCgt")
    ).split()[1]
    return bool(int(caught, 16) >> (signal.SIGTERM - 1) & 1)


def is_server(process: psutil.Process) -> bool:
    """Return whether a process is the Prefect server; one that has ended is none."""
    try:
        return "uvicorn" in process.cmdline()
    except psutil.Error:
        return False


@pytest.mark.parametrize(
    ("number", "moment"),
    [
        (signal.SIGTERM, "start"),
        pytest.param(signal.SIGTERM, "stage", marks=pytest.mark.slow),
        (signal.SIGINT, "stage"),
    ],
)
def test_a_run_that_is_asked_to_stop_leaves_nothing(
    number: signal.Signals, moment: str, tmp_path: Path, simulated: Path, glint_home: Path
) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PREFECT", "GLINT"))}
    environment |= {"GLINT_HOME": str(glint_home), "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [*GLINT, str(simulated), "--store", "store", "--workers", "1", "--json"],
        cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    if moment == "start":
        while not catches_signals(process.pid):
            time.sleep(0.005)
        time.sleep(1.5)
    else:
        for line in process.stdout:
            if '"frames", "seconds"' in line:
                break
    family = psutil.Process(process.pid).children(recursive=True)
    process.send_signal(number)
    _, errors = process.communicate(timeout=2 * PATIENCE)
    assert process.returncode == 130 and "Traceback" not in errors
    # The server outlives every run; what else is left would be a worker.
    assert not psutil.wait_procs([each for each in family if not is_server(each)], PATIENCE)[1]


@pytest.mark.parametrize(
    "seconds", [0.0, 0.6, *(pytest.param(later, marks=pytest.mark.slow) for later in (0.2, 1.5, 3.0))]
)
def test_an_interrupt_at_any_moment_is_one_line(
    seconds: float, tmp_path: Path, simulated: Path, glint_home: Path
) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PREFECT", "GLINT"))}
    environment |= {"GLINT_HOME": str(glint_home), "PYTHONPATH": str(ROOT)}
    words = [sys.executable, "-m", "glint", "run", str(simulated), "--store", "store", "--workers", "1", "--json"]
    process = subprocess.Popen(
        words, cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    while not catches_signals(process.pid):
        time.sleep(0.005)
    time.sleep(seconds)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE)
    assert (process.returncode, [line[:18] for line in errors.splitlines()]) == (130, ["glint: interrupted"])


def test_an_interrupt_within_a_string_that_is_executed_ends_with_the_status(tmp_path: Path) -> None:
    (tmp_path / "command.py").write_text(
        "import sys\nfrom glint.flows.cli import main\n"
        "def app():\n"
        "    try:\n"
        "        exec('raise KeyboardInterrupt')\n"
        "    except KeyboardInterrupt:\n"
        "        sys.exit(130)\n"
        "main.app = app\nmain.main()"
    )
    ended = subprocess.run(
        [sys.executable, "-m", "command"], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, check=False
    )
    assert ended.returncode == 130


def test_a_coroutine_that_an_interrupt_leaves_behind_is_not_told() -> None:
    code = (
        "import os, signal\nfrom glint.flows.runtime import signals\nsignals.install()\n"
        "async def begin(): pass\n"
        "for number in (signal.SIGINT, signal.SIGTERM):\n"
        "    left = begin()\n"
        "    try:\n"
        "        os.kill(os.getpid(), number)\n"
        "    except KeyboardInterrupt:\n"
        "        del left\n"
        "    signals._repeated.clear()\n"
        "left = begin()"
    )
    ended = subprocess.run([sys.executable, "-c", code], cwd=ROOT, stderr=subprocess.PIPE, text=True, check=True)
    assert ended.stderr.splitlines() == [signals.LINE]


def test_a_second_interrupt_ends_at_once() -> None:
    code = (
        "import threading, time\nfrom glint.flows.runtime import signals\nsignals.REPEAT_SECONDS = 0.2\n"
        "signals.GRACE_SECONDS = 600\n"
        "signals.install()\nthreading.Thread(target=time.sleep, args=[60]).start()\nprint('ready', flush=True)\n"
        "time.sleep(60)"
    )
    process = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None and process.stdout.readline()
    process.send_signal(signal.SIGINT)
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=50)
    assert process.returncode == 130 and errors.decode().splitlines() == [signals.LINE]


def test_a_run_that_does_not_end_by_itself_is_ended() -> None:
    code = (
        "import threading, time\nfrom glint.flows.runtime import signals\nsignals.GRACE_SECONDS = 0.5\n"
        "signals.install()\nthreading.Thread(target=time.sleep, args=[60]).start()\nprint('ready', flush=True)\n"
        "time.sleep(60)"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert process.stdout is not None and process.stdout.readline()
    process.terminate()
    assert process.wait(50) == 130


def test_an_interrupt_counts_where_nobody_reads_its_line_any_more() -> None:
    code = (
        "import threading, time\nfrom glint.flows.runtime import signals\nsignals.GRACE_SECONDS = 0.5\n"
        "signals.install()\nthreading.Thread(target=time.sleep, args=[60]).start()\n"
        "try:\n"
        "    print('ready', flush=True)\n"
        "    time.sleep(60)\n"
        "except KeyboardInterrupt:\n"
        "    print('interrupted', flush=True)"
    )
    reader, writer = os.pipe()
    process = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE, stderr=writer)
    for end in (reader, writer):
        os.close(end)
    assert process.stdout is not None and process.stdout.readline()
    process.terminate()
    assert process.stdout.readline() == b"interrupted\n" and process.wait(50) == 130


def test_a_signal_that_a_library_swallowed_is_remembered(monkeypatch: pytest.MonkeyPatch) -> None:
    before = [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]
    try:
        signals.install()
        signals.raise_if_interrupted()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt):
            signals.raise_if_interrupted()
    finally:
        signals._interrupted.clear()
        signals._repeated.clear()
        for timer in [each for each in threading.enumerate() if isinstance(each, threading.Timer)]:
            timer.cancel()
        for each, handler in zip((signal.SIGINT, signal.SIGTERM), before, strict=True):
            signal.signal(each, handler)


def test_a_command_says_what_its_end_leaves() -> None:
    code = "import os, signal; from glint.flows.runtime import signals; signals.install(); "
    code += "signals.describe_end('glint: the page has stopped'); os.kill(os.getpid(), signal.SIGINT)"
    ended = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert ended.stderr == "glint: the page has stopped\n"
