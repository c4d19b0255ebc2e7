"""Kill what runs, again and again, and see that nothing is lost.

    python -m tests.chaos.chaos --kills 50 --seed 0 [--folder DIR] [--s3]

A catalogue of twelve small captures is run with `glint run`, while processes are killed (-9) at random moments: the
command itself, a Dask worker, the Prefect server, all of them at once (as when the machine stops), and with `--s3` the
gateway of the store. After each kill the run goes on by itself, or is started again. When all captures are done another
round begins, with other parameters or in a new store, until there have been enough kills. At the end

- every result of every round equals, bit for bit, that of a run that nobody disturbed;
- every version that was ever announced is there, whole;
- the server knows of no run that would still be running, and no process is left.

Prints one JSON object a line: each kill, each round, and the verdict; exit status 0 if all of it holds.
"""

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from glint.storage.catalogue.loading import Catalogue, load, write
from glint.storage.errors import StoreError
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository, object_ids
from tests.prefect_api import ask
from tests.s3_gateway import Gateway
from tests.scene import draw_scene

ROOT = Path(__file__).parents[2]
GLINT = [sys.executable, "-c", "from glint.flows.cli.main import main; main()", "run"]
ROUNDS: tuple[dict[str, Any], ...] = (
    {},
    {"clusters": {"share": 0.7}},
    {"labels": {"method": "winner"}, "depth": {"method": "least-squares"}},
)
"""Parameters of a round; every third one begins in a new store."""
BUCKET = "chaos"
RUN_SECONDS = 900
ORPHAN_SECONDS = 30
AT_THE_START, STARTING, WORKING = 0.2, 8.0, 9.0
"""Share of kills while a run starts, and the seconds from its start, or from its first stage, to the kill."""
TARGETS = {"command": 2, "worker": 4, "server": 2, "machine": 1, "gateway": 3}
"""How often each is chosen where it is there."""


class Failure(AssertionError):
    """Something that must hold did not."""


@dataclass
class Chaos:
    """One game: its folder, its dice, and what happened so far."""

    folder: Path
    dice: random.Random
    objects: int = 4
    captures: int = 3
    frames: int = 150
    gateway: Gateway | None = None
    kills: list[str] = field(default_factory=list)
    announced: dict[str, set[str]] = field(default_factory=dict)
    runs: int = 0

    def play(self, kills: int) -> dict[str, Any]:
        """Kill so many times, then see; what happened.

        Raises:
            Failure: something was lost.
        """
        begun = time.monotonic()
        catalogues = self._catalogues()
        undisturbed: dict[int, dict[str, str]] = {}
        number = 0
        while len(self.kills) < kills:
            store, which = self._store(number // len(ROUNDS)), number % len(ROUNDS)
            self._round(number, catalogues[which], store, kills)
            if which not in undisturbed:
                undisturbed[which] = self._undisturbed(which, catalogues[which])
            self._compare(store, undisturbed[which])
            say(kind="round", number=number, store=store, kills=len(self.kills))
            number += 1
        self._check_versions()
        left = self._open_runs()
        if left:
            raise Failure(f"the server still shows {left} as running")
        return {
            "kills": {name: self.kills.count(name) for name in sorted(set(self.kills))},
            "rounds": number,
            "runs": self.runs,
            "versions": sum(len(names) for names in self.announced.values()),
            "seconds": round(time.monotonic() - begun),
        }

    def _catalogues(self) -> list[Path]:
        """The same captures with the parameters of each round."""
        videos = self.folder / "videos"
        objects = []
        for number in range(self.objects):
            captures = []
            for view in range(self.captures):
                place = videos / f"{number}-{view}"
                if not (place / "catalogue.yaml").exists():
                    draw_scene(place, frames=self.frames, seed=number * self.captures + view)
                drawn = load(place / "catalogue.yaml").objects[0]
                captures.append(drawn.captures[0].model_copy(update={"id": f"view-{view}"}))
            objects.append(drawn.model_copy(update={"id": f"object-{number}", "captures": tuple(captures)}))
        paths = []
        for number, parameters in enumerate(ROUNDS):
            made = Catalogue.model_validate(
                {"schema": 1, "name": "chaos", "objects": objects, "parameters": parameters}
            )
            paths.append(self.folder / f"round-{number}.yaml")
            write(made, paths[-1])
        return paths

    def _undisturbed(self, number: int, catalogue: Path) -> dict[str, str]:
        """Digests of all results of a round's parameters, by a run that nobody disturbs."""
        store, started = str(self.folder / "undisturbed" / str(number)), time.monotonic()
        self._finish(self._start(catalogue, store), must=True)
        say(kind="undisturbed", number=number, seconds=round(time.monotonic() - started, 1))
        return results(store)

    def _store(self, number: int) -> str:
        return str(self.folder / "stores" / str(number)) if self.gateway is None else f"s3://{BUCKET}/{number}"

    def _round(self, number: int, catalogue: Path, store: str, kills: int) -> None:
        """Run a catalogue to its end, however often it is killed."""
        for _ in range(kills + 20):
            process = self._start(catalogue, store)
            while len(self.kills) < kills and self._wait(process):
                self._kill(process, number)
            if self._finish(process):
                return
        raise Failure(f"round {number} does not come to its end")

    def _start(self, catalogue: Path, store: str) -> "subprocess.Popen[str]":
        self.runs += 1
        environment = {name: value for name, value in os.environ.items() if not name.startswith(("PREFECT", "GLINT"))}
        environment |= {"GLINT_HOME": str(self.folder / "home"), "PYTHONPATH": str(ROOT)}
        self._log = (self.folder / "run.log").open("a")
        self._output = self.folder / "run.jsonl"
        with self._output.open("w") as output:
            return subprocess.Popen(
                [*GLINT, str(catalogue), "--store", store, "--json"],
                cwd=self.folder, env=environment, stdout=output, stderr=self._log, text=True, start_new_session=True,
            )  # fmt: skip

    def _wait(self, process: "subprocess.Popen[str]") -> bool:
        """Whether the process still runs at the next moment for a kill: while it starts, or while stages are done."""
        if self.dice.random() < AT_THE_START:
            return not _ended(process, self.dice.uniform(0.2, STARTING))
        while '"stage"' not in self._output.read_text():
            if _ended(process, 0.1):
                return False
        return not _ended(process, self.dice.uniform(0.1, WORKING))

    def _kill(self, process: "subprocess.Popen[str]", number: int) -> None:
        """Kill something that there is."""
        workers = [each for each in children(process.pid) if "spawn_main" in " ".join(command(each))]
        server = self._server()
        targets = {"command": [psutil.Process(process.pid)], "machine": [*workers, psutil.Process(process.pid)]}
        if workers:
            targets["worker"] = [self.dice.choice(sorted(workers, key=lambda each: each.pid))]
        if server is not None:
            targets["server"] = [server]
            targets["machine"].append(server)
        if self.gateway is not None:
            targets["gateway"] = []
        names = sorted(targets)
        (name,) = self.dice.choices(names, [TARGETS[each] for each in names])
        for target in targets[name]:
            if target.is_running():
                target.kill()
        if name == "gateway" and self.gateway is not None:
            self.gateway.kill()
            self.gateway.start()
        self.kills.append(name)
        say(kind="kill", number=len(self.kills), what=name, round=number)

    def _finish(self, process: "subprocess.Popen[str]", must: bool = False) -> bool:
        """Wait for the command's end; whether all captures are done. What it announced must be there ever after."""
        family = [psutil.Process(process.pid), *children(process.pid)] if process.poll() is None else []
        try:
            status = process.wait(RUN_SECONDS)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGABRT)
            raise Failure(f"a run hangs; see {self.folder / 'run.log'}") from None
        self._log.close()
        _, left = psutil.wait_procs([each for each in family if each.is_running()], ORPHAN_SECONDS)
        if left:
            raise Failure(f"processes are left: {[command(each) for each in left]}")
        summary = next(
            (e for e in map(parsed, self._output.read_text().splitlines()) if e.get("kind") == "summary"), {}
        )
        failed = [f"{row['capture']}: {row['error']}" for row in summary.get("captures", []) if row["error"]]
        if must and (status != 0 or failed):
            raise Failure(f"an undisturbed run ended with {status}: {failed}")
        if failed:
            say(kind="failed", captures=failed)
        return status == 0

    def _server(self) -> psutil.Process | None:
        for path in (self.folder / "home" / "server").glob("*/server.json"):
            pid = parsed(path.read_text()).get("process", [0])[0]
            if psutil.pid_exists(pid):
                return psutil.Process(pid)
        return None

    def _compare(self, store: str, reference: dict[str, Any]) -> None:
        """All results must be those of the undisturbed run; every version is remembered from now on."""
        found = results(store)
        if found.keys() != reference.keys():
            raise Failure(f"{store} lacks {sorted(reference.keys() - found.keys())}")
        wrong = [name for name, value in reference.items() if found[name] != value]
        if wrong:
            raise Failure(f"{store} differs in {wrong}")
        for object_id in object_ids(Location.parse(store)):
            names = ObjectRepository.open(Location.parse(store), object_id, create=False).version_names()
            known = self.announced.setdefault(f"{store} {object_id}", set())
            if not known <= set(names):
                raise Failure(f"{object_id} has lost {sorted(known - set(names))}")
            known |= set(names)

    def _check_versions(self) -> None:
        """Every array and every file of every version can be read."""
        for place, names in self.announced.items():
            store, _, object_id = place.rpartition(" ")
            repository = ObjectRepository.open(Location.parse(store), object_id, create=False)
            if set(repository.version_names()) != names:
                raise Failure(f"{object_id} has versions {repository.version_names()}, not {sorted(names)}")
            for name in names:
                for _ in digests(repository, name):
                    pass

    def _open_runs(self) -> list[str]:
        """Names of the runs that the server shows as not ended, after a last run that changes nothing."""
        self._finish(self._start(self.folder / "round-0.yaml", str(self.folder / "undisturbed" / "0")), must=True)
        (state,) = (self.folder / "home" / "server").glob("*/server.json")
        server = parsed(state.read_text())
        api = server["api_url"]
        still_open = {"state": {"type": {"any_": ["RUNNING", "PENDING", "SCHEDULED", "CANCELLING"]}}}
        for _ in range(20):
            found = [
                f"{kind} {each['name']}"
                for kind in ("flow_runs", "task_runs")
                for each in asked(f"{api}/{kind}/filter", {kind: still_open}, server["authentication"])
            ]
            if not found:
                break
            time.sleep(1.0)
        return found

    def end(self) -> None:
        """Stop the server of this game."""
        server = self._server()
        if server is not None:
            server.kill()


def results(store: str) -> dict[str, str]:
    """Digests of everything in the newest versions of a store's objects, by object, capture, stage and name."""
    location, found = Location.parse(store), dict[str, str]()
    for object_id in object_ids(location):
        repository = ObjectRepository.open(location, object_id, create=False)
        found |= {f"{object_id}/{name}": digest for name, digest in digests(repository, "main")}
    return found


def digests(repository: ObjectRepository, ref: str) -> Iterator[tuple[str, str]]:
    """Name and digest of every array and file of a version, and every stage's key."""
    for capture, stages in repository.contents(ref).items():
        for stage, key in stages.items():
            result = repository.load(capture, stage, ref)
            yield f"{capture}/{stage}", key
            for name in result.arrays:
                values = np.ascontiguousarray(result.read(name))
                yield f"{capture}/{stage}/{name}", f"{values.shape} {values.dtype} {hash(values.tobytes())}"
            for name, info in result.files.items():
                result.read_file(name)
                yield f"{capture}/{stage}/{name}", info.sha256


def _ended(process: "subprocess.Popen[str]", seconds: float) -> bool:
    """Whether the process ends within so many seconds."""
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        return False
    return True


def children(pid: int) -> list[psutil.Process]:
    """All processes below one."""
    try:
        return psutil.Process(pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return []


def command(process: psutil.Process) -> list[str]:
    """Its command line, empty if it is no more."""
    try:
        return process.cmdline()
    except psutil.Error:
        return []


def parsed(text: str) -> dict[str, Any]:
    """A JSON object, empty if it was cut off."""
    try:
        value = json.loads(text)
    except ValueError:
        return {}
    return value if isinstance(value, dict) else {}


def asked(url: str, body: dict[str, Any], authentication: str) -> list[dict[str, Any]]:
    """What the server answers to its user:password."""
    for _ in range(30):
        try:
            found: list[dict[str, Any]] = ask(url, body, authentication, seconds=10)
            return found
        except (OSError, urllib.error.URLError):
            time.sleep(1.0)
    raise Failure(f"{url} does not answer")


def say(**facts: Any) -> None:
    """One JSON object a line."""
    print(json.dumps({"time": round(time.time(), 1), **facts}), flush=True)


def main() -> int:
    """Run the game of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, help="kept afterwards; by default a temporary one, kept on failure")
    parser.add_argument("--s3", action="store_true", help="store in an S3 gateway, which is killed too")
    chosen = parser.parse_args()
    folder = (chosen.folder or Path(tempfile.mkdtemp(prefix="glint-chaos-"))).absolute()
    folder.mkdir(parents=True, exist_ok=True)
    # Its sockets need a short path; what reads the results here takes the same keys as the runs.
    gateway = Gateway(Path(tempfile.mkdtemp(prefix="rgw-")), [BUCKET]) if chosen.s3 else None
    if gateway is not None:
        os.environ |= gateway.environment
        gateway.start()
    chaos = Chaos(folder, random.Random(chosen.seed), gateway=gateway)
    try:
        say(kind="verdict", good=True, **chaos.play(chosen.kills))
    except (Failure, StoreError) as failure:
        say(kind="verdict", good=False, why=str(failure), kills=len(chaos.kills), folder=str(folder))
        return 1
    finally:
        chaos.end()
        if gateway is not None:
            gateway.kill()
            shutil.rmtree(gateway.folder)
    if chosen.folder is None:
        shutil.rmtree(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
