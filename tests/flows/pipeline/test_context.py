import threading
import time
from concurrent.futures import CancelledError

import pytest
from distributed import Client

from glint.flows.pipeline.context import Surroundings, _known, share, surroundings
from glint.flows.runtime.dask_cluster import Cluster

pytestmark = pytest.mark.server


def test_flows_find_what_was_shared_and_else_a_client_of_their_own(cluster: Cluster) -> None:
    share("tcp://shared", cluster.client)
    assert surroundings("tcp://shared").client is cluster.client
    _known.pop(cluster.address, None)
    opened = surroundings(cluster.address).client
    assert opened is not cluster.client
    assert surroundings(cluster.address).client is opened
    opened.close()
    del _known[cluster.address]


def test_what_waits_for_a_worker_fails_when_the_run_is_abandoned(cluster: Cluster) -> None:
    here = Surroundings(Client(cluster.address, set_as_default=False))
    here.check()
    raised: list[BaseException] = []

    def wait() -> None:
        try:
            here.client.submit(time.sleep, 30, pure=False).result()
        except BaseException as error:
            raised.append(error)

    waiting = threading.Thread(target=wait)
    waiting.start()
    time.sleep(0.5)
    here.abandon()
    waiting.join(15)
    assert not waiting.is_alive()
    assert isinstance(raised[0], CancelledError)
    with pytest.raises(CancelledError):
        here.check()


def test_what_an_abandoned_run_breaks_is_told_as_interrupted(cluster: Cluster) -> None:
    here = Surroundings(Client(cluster.address, set_as_default=False))
    with pytest.raises(OSError, match="a reason of its own"), here.interruptible():
        raise OSError("a reason of its own")
    here.abandon()
    with pytest.raises(CancelledError, match="interrupted"), here.interruptible():
        raise OSError("Client is closed")
