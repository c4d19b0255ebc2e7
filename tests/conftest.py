"""Fixtures shared by all tests."""

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests import azure_emulator, s3_gateway


@pytest.fixture(scope="session", autouse=True)
def home_of_tests(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Leave the user's home of Glint, and the server there, alone; tests of flows have a home with a server."""
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("GLINT_HOME", str(tmp_path_factory.mktemp("home-of-tests")))
        yield


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of shared captures and photographs; tests that read it are skipped where it is absent."""
    folder = Path(os.environ.get("GLINT_SHARED_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not (folder / "captures").is_dir():
        pytest.skip(f"no shared data at {folder} (set GLINT_SHARED_DATA)")
    return folder


@pytest.fixture(scope="session")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A catalogue with one small simulated capture, `hemisphere/front` of 300 frames, with markup beside it."""
    from glint.tasks.simulation.simulate import CaptureOptions, simulate

    folder = tmp_path_factory.mktemp("simulated")
    return simulate("hemisphere", folder, CaptureOptions(frames=300, scale=0.3, sphere_radius=22.0)).catalogue


@pytest.fixture(scope="session")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A catalogue with a capture `hemisphere/front` of 150 frames for tests of what goes round the stages.

    Its object is too small to be searched for symmetry, so that its stages take a quarter of the seconds.
    """
    from glint.tasks.simulation.simulate import CaptureOptions, simulate

    folder = tmp_path_factory.mktemp("tiny")
    return simulate("hemisphere", folder, CaptureOptions(frames=150, scale=0.15, sphere_radius=22.0)).catalogue


@pytest.fixture(scope="session")
def performed(tmp_path_factory: pytest.TempPathFactory, simulated: Path) -> Path:
    """A store in which all stages of the simulated capture are performed, nothing is published; to be copied.

    Its labels are smooth ones, see tests.tasks.smooth_labels.
    """
    from glint.tasks.engine.references import CaptureReference
    from tests.tasks.make_context import perform_all
    from tests.tasks.smooth_labels import smooth_labels as without_bodies

    store = tmp_path_factory.mktemp("performed") / "store"
    with without_bodies():
        perform_all(CaptureReference(str(simulated), "hemisphere", "front", str(store), "run").context())
    return store


@pytest.fixture
def smooth_labels() -> Iterator[None]:
    """Labels take a tenth of their time, see tests.tasks.smooth_labels; fixtures of modules are made before."""
    from tests.tasks.smooth_labels import smooth_labels as without_bodies

    with without_bodies():
        yield


@pytest.fixture(scope="session")
def s3() -> Iterator[s3_gateway.Gateway]:
    """An S3 server with the bucket `store`; tests that need it are skipped where it is not installed."""
    if missing := s3_gateway.missing():
        pytest.skip(f"no S3 gateway: {', '.join(missing)} missing (Debian: ceph-mon ceph-osd ceph-common radosgw curl)")
    # A short path, since sockets lie there.
    with tempfile.TemporaryDirectory(prefix="s3-") as folder, s3_gateway.Gateway(Path(folder)) as gateway:
        yield gateway


@pytest.fixture(scope="session")
def azure(tmp_path_factory: pytest.TempPathFactory) -> Iterator[azure_emulator.Emulator]:
    """An Azure blob server with the container `store`; tests that need it are skipped where it is not installed."""
    if azure_emulator.program() is None:
        pytest.skip("no Azure emulator: npm install azurite, then name its azurite-blob in GLINT_AZURITE")
    with azure_emulator.Emulator(tmp_path_factory.mktemp("azure")) as emulator:
        yield emulator
