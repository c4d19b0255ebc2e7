"""The end of a process waits for threads that Python did not start, and not for ever."""

import subprocess
import sys


def test_a_foreign_thread_is_waited_for() -> None:
    """In a process of its own, where no other foreign thread is waited for."""
    script = """
import _thread, threading, time
from glint.storage.locations.foreign_threads import await_foreign_threads
begun, ended = threading.Event(), threading.Event()
def call():
    begun.set()
    time.sleep(0.2)
    ended.set()
_thread.start_new_thread(call, ())  # unlike threading.Thread, it is not among Python's own threads
begun.wait()
await_foreign_threads(longest_wait=600.0)
assert ended.is_set()
"""
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60)


def test_threads_of_python_and_endless_ones_do_not_hold_up_the_end() -> None:
    """In a process of its own, which the endless threads would outlive."""
    script = """
import _thread, threading, time
from glint.storage.locations.foreign_threads import await_foreign_threads
threading.Thread(target=time.sleep, args=(600.0,), daemon=True).start()
await_foreign_threads(longest_wait=600.0)
_thread.start_new_thread(time.sleep, (600.0,))
_thread.start_new_thread(lambda: time.sleep(600.0), ())
await_foreign_threads(longest_wait=0.1)
"""
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60)


def test_every_reader_waits_at_its_end() -> None:
    script = """
import _thread, time
from glint.storage.locations.location import Location
def call():
    time.sleep(0.3)
    print("ended", flush=True)
_thread.start_new_thread(call, ())
time.sleep(0.1)
"""
    done = subprocess.run([sys.executable, "-c", script], check=True, timeout=60, capture_output=True, text=True)
    assert done.stdout == "ended\n"
