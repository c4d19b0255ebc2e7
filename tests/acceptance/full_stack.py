"""The whole of Glint as in production, on this machine: `python -m tests.acceptance.full_stack`.

Postgres, a Prefect server on it, a Prefect worker, a Dask scheduler with two workers and an S3 gateway run as processes
on loopback. Captures are put into the bucket `inbox`; the deployment of the nightly scan works through them; versions,
exports and surfaces are checked, as is that no secret is found in the bucket, the database, the logs or on the screen.
Needs Debian's postgresql, ceph-mon, ceph-osd, ceph-common, radosgw and curl; takes about three minutes.
"""

import json
import os
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import obstore

from glint.storage.locations.location import Location
from tests.acceptance.processes import Postgres, Services, answers, python
from tests.s3_gateway import Gateway, free_port
from tests.s3_gateway import missing as missing_of_gateway
from tests.scene import Scene, draw_scene

STORE, INBOX = "s3://glint/store", "s3://inbox"
LARGEST_ERROR = 4.0
"""Degrees; median over the object of the angle to the true normals."""


class Constellation:
    """All services, and the environment in which commands find them."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.services = folder, Services(folder)
        self.postgres, self.gateway = Postgres(folder / "postgres"), Gateway(folder / "s3", ("glint", "inbox"))
        self.secrets = {name: secrets.token_urlsafe(24) for name in ("database", "dashboard")}
        self.prefect, self.scheduler, self.dashboard = free_port(), free_port(), free_port()
        self.environment: dict[str, str] = {}
        self.said: list[str] = []

    def start(self) -> None:
        """Start everything, in the order in which it depends on each other."""
        database = self.postgres.start(self.services, self.secrets["database"])
        tell("Postgres")
        self.gateway.start()
        tell("S3 gateway")
        authentication = f"glint:{self.secrets['dashboard']}"
        url = f"http://127.0.0.1:{self.prefect}"
        common = {"DO_NOT_TRACK": "1", "PREFECT_HOME": str(self.folder / "prefect"), "GLINT_HOME": str(self.folder)}
        server = common | {
            "PREFECT_SERVER_DATABASE_CONNECTION_URL": database,
            "PREFECT_SERVER_API_AUTH_STRING": authentication,
            "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
            "PREFECT_SERVER_UI_STATIC_DIRECTORY": str(self.folder / "pages"),
            "GLINT_SERVER_ORIGINS": url,
        }
        guard = ["--factory", "glint.flows.runtime.server_app:create", "--log-level", "warning"]
        command = python("uvicorn", *guard, "--host", "127.0.0.1", "--port", str(self.prefect))
        self.services.start("prefect-server", command, server, lambda: answers(f"{url}/api/health"))
        tell("Prefect server on Postgres")
        self.environment = common | self.gateway.environment
        self.environment |= {"PREFECT_API_URL": f"{url}/api", "PREFECT_API_AUTH_STRING": authentication}
        self.environment |= {"GLINT_STORE": STORE, "OMP_NUM_THREADS": "1", "PREFECT_WORKER_QUERY_SECONDS": "2"}
        self._make_certificate()
        self._start_dask()
        tell("Dask scheduler with two workers")

    def _make_certificate(self) -> None:
        """Make Dask's certificate as `deploy/compose.yaml` does, and name it in the environment."""
        key, certificate = self.folder / "key.pem", self.folder / "certificate.pem"
        subject = ["-newkey", "rsa:3072", "-noenc", "-days", "2", "-subj", "/CN=glint-dask"]
        files = ["-keyout", str(key), "-out", str(certificate)]
        subprocess.run(["openssl", "req", "-x509", *subject, *files], check=True, capture_output=True)
        tls = "DASK_DISTRIBUTED__COMM__TLS__"
        self.environment |= {
            "DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION": "True",
            f"{tls}CA_FILE": str(certificate),
            **{f"{tls}{role}__CERT": str(certificate) for role in ("CLIENT", "SCHEDULER", "WORKER")},
            **{f"{tls}{role}__KEY": str(key) for role in ("CLIENT", "SCHEDULER", "WORKER")},
        }

    def _start_dask(self) -> None:
        place = ["--protocol", "tls", "--host", "127.0.0.1", "--port", str(self.scheduler)]
        dashboard = ["--dashboard-address", f"127.0.0.1:{self.dashboard}"]
        command = python("distributed.cli.dask_scheduler", *place, *dashboard)
        health = f"http://127.0.0.1:{self.dashboard}/health"
        self.services.start("dask-scheduler", command, self.environment, lambda: answers(health))
        for number in (1, 2):
            options = ["--nthreads", "1", "--nworkers", "1", "--memory-limit", "3GB", "--no-dashboard"]
            command = python("distributed.cli.dask_worker", f"tls://127.0.0.1:{self.scheduler}", *options)
            name = f"dask-worker-{number}"
            command += ["--local-directory", str(self.folder / name), "--death-timeout", "60"]
            self.services.start(name, command, self.environment, lambda: True)

    def start_worker(self) -> None:
        """Start the worker of Prefect that takes what is deployed."""
        command = python("prefect", "worker", "start", "--pool", "glint", "--type", "process")
        self.services.start("prefect-worker", command, self.environment, lambda: True)

    def stop(self) -> None:
        """End everything."""
        self.services.__exit__()
        self.gateway.stop()

    def glint(self, *arguments: str) -> str:
        """Run a command of Glint; what it says."""
        return self._said(["-c", "from glint.flows.cli.main import main; main()", *arguments])

    def deployment(self, name: str, **parameters: Any) -> dict[str, str]:
        """Run a deployment and wait for its end: the state's name and message."""
        code = (
            "import json, sys\nfrom prefect.deployments import run_deployment\n"
            "run = run_deployment(sys.argv[1], parameters=json.loads(sys.argv[2]), timeout=900, poll_interval=1)\n"
            "print(json.dumps({'id': str(run.id), 'state': run.state.name, 'message': run.state.message}))"
        )
        ended: dict[str, str] = json.loads(self._said(["-c", code, name, json.dumps(parameters)]).splitlines()[-1])
        return ended

    def _said(self, command: list[str]) -> str:
        environment = os.environ | self.environment
        done = subprocess.run(
            [sys.executable, *command], env=environment, cwd=self.folder, capture_output=True, text=True
        )
        self.said += [done.stdout, done.stderr]
        if done.returncode:
            raise RuntimeError(
                f"{command[-6:]} ended with {done.returncode}: {done.stderr[-2000:]}{done.stdout[-500:]}"
            )
        return done.stdout

    def every_secret(self) -> list[str]:
        """What must be found nowhere."""
        return [self.gateway.secret, *self.secrets.values()]


def tell(text: str) -> None:
    """A line of what has been done, with the seconds since the start."""
    print(f"{time.monotonic() - STARTED:7.1f} s  {text}", flush=True)


STARTED = time.monotonic()


def check(holds: bool, what: str) -> None:
    """Go on only if it holds.

    Raises:
        AssertionError: it does not.
    """
    if not holds:
        raise AssertionError(f"this does not hold: {what}")
    tell(f"checked: {what}")


def put(scene: Scene, name: str) -> None:
    """Put the capture of a scene into the inbox, under the usual names, with what a catalogue says beside it."""
    store = Location.parse(f"{INBOX}/{name}").obstore()
    folder = scene.catalogue.parent
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            data = path.read_bytes()
            if path == scene.catalogue:
                data = data.replace(b"id: ellipsoid", f"id: {name}".encode())
            obstore.put(store, path.relative_to(folder).as_posix(), data)


def error_of(folder: Path, scene: Scene) -> float:
    """Median angle in degrees between exported and true normals."""
    found = np.load(folder / "front" / "normals.npy")
    cosine = np.sum(found * scene.normals, axis=-1)[scene.mask]
    return float(np.degrees(np.nanmedian(np.arccos(np.clip(cosine, -1, 1)))))


def accept(everything: Constellation) -> None:
    """Deploy, work through an inbox, and check what came of it."""
    first = draw_scene(everything.folder / "first", frames=500, seed=1)
    second = draw_scene(everything.folder / "second", frames=500, seed=2)
    put(first, "vase")
    put(second, "bowl")
    options = ["--inbox", INBOX, "--scheduler", f"tls://127.0.0.1:{everything.scheduler}"]
    said = everything.glint("deploy", *options, "--timezone", "Europe/Berlin")
    check("inbox/nightly" in said, "the deployments are on the server")
    everything.start_worker()

    ended = everything.deployment("inbox/nightly", quiet_minutes=0)
    check(ended["state"] == "Completed" and "2 objects run" in ended["message"], f"the inbox was run: {ended}")
    for name, scene in (("vase", first), ("bowl", second)):
        out = everything.folder / "out" / name
        everything.glint("export", name, "--out", str(out))
        error = error_of(out, scene)
        check(error < LARGEST_ERROR, f"{name}: normals are right within {error:.2f} degrees")
        check((out / "front" / "surface.glb").stat().st_size > 1000, f"{name}: its surface is there")

    ended = everything.deployment("inbox/nightly", quiet_minutes=0)
    check("0 objects run, 2 up to date" in ended["message"], "a second scan finds nothing new")
    markup = b'[{"frame": 250, "x": 52.0, "y": 58.0, "kind": "true"}]'
    store = Location.parse(f"{INBOX}/vase").obstore()
    obstore.put(store, "markup.json", markup)
    text = bytes(obstore.get(store, "catalogue.yaml").bytes()).replace(b"mask: ", b"markup: markup.json\n    mask: ")
    obstore.put(store, "catalogue.yaml", text)
    ended = everything.deployment("inbox/nightly", quiet_minutes=0)
    check("1 objects run, 1 up to date" in ended["message"], f"a changed capture is run again: {ended['message']}")
    history = [json.loads(line) for line in everything.glint("history", "vase", "--json").splitlines()]
    check(len(history) == 2, "the changed object has two versions")

    everything.services.processes["dask-worker-1"].kill()
    catalogue = f"{INBOX}/bowl/catalogue.yaml"
    ended = everything.deployment("run-catalogue/on-demand", catalogue=catalogue, store="s3://glint/other", drift=None)
    check(ended["state"] == "Completed", f"with one Dask worker killed, objects run apart: {ended}")
    ended = everything.deployment("maintenance/weekly")
    check(ended["state"] == "Completed", f"maintenance: {ended['message']}")
    find_no_secrets(everything)


def find_no_secrets(everything: Constellation) -> None:
    """Look for the secrets wherever Glint writes."""
    hidden = [text.encode() for text in everything.every_secret()]
    places = {"the database": everything.postgres.dump(everything.secrets["database"])}
    places["what was said"] = "".join(everything.said).encode()
    for bucket in ("glint", "inbox"):
        store = Location.parse(f"s3://{bucket}").obstore()
        for meta in [each for part in obstore.list(store) for each in part]:
            places[f"s3://{bucket}/{meta['path']}"] = bytes(obstore.get(store, meta["path"]).bytes())
    for path in [*everything.folder.glob("*.log"), *(everything.folder / "out").rglob("*")]:
        if path.is_file():
            places[str(path)] = path.read_bytes()
    for name, data in places.items():
        if any(secret in data for secret in hidden):
            raise AssertionError(f"a secret is found in {name}")
    tell(f"checked: no secret in {len(places)} places")


def main() -> None:
    """Start, accept, end."""
    if missing := missing_of_gateway() + ["postgresql"] * Postgres(Path("none")).missing:
        sys.exit(f"not installed: {', '.join(missing)}")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended"))
    folder = Path(tempfile.mkdtemp(prefix="glint-"))
    folder.chmod(0o755)
    everything = Constellation(folder)
    try:
        everything.start()
        os.environ.update(everything.gateway.environment)
        accept(everything)
    except BaseException:
        print(f"logs are in {folder}", file=sys.stderr)
        raise
    finally:
        everything.stop()
    shutil.rmtree(folder, ignore_errors=True)
    tell("accepted")


if __name__ == "__main__":
    main()
