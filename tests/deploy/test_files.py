"""What the files of deploy/ promise: small rights, limits, health checks, no secrets, no surprises."""

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from glint.flows.runtime.dask_cluster import SETTINGS

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy"
MANIFESTS = sorted((DEPLOY / "kubernetes").glob("*.yaml"))
COMPOSE: dict[str, Any] = YAML(typ="safe").load(DEPLOY / "compose.yaml")
ENDS = {"deployments"}
"""Services that do their work and end."""


def documents() -> list[dict[str, Any]]:
    return [each for path in MANIFESTS for each in YAML(typ="safe").load_all(path) if each]


def pods() -> dict[str, dict[str, Any]]:
    found = {
        each["metadata"]["name"]: each["spec"]["template"]["spec"] for each in documents() if "template" in str(each)
    }
    assert len(found) > 6
    return found


def in_environment(setting: str) -> str:
    """The name of one of Dask's settings, or of a variable that it passes on to workers, in the environment."""
    passed_on = setting.partition(".pre-spawn-environ.")[2]
    return passed_on or "DASK_" + setting.replace(".", "__").replace("-", "_").upper()


def test_dask_runs_with_the_settings_of_a_local_cluster() -> None:
    # A worker elsewhere that is gone is noticed by its silence alone; a local one by its end.
    expected = {in_environment(name): str(value) for name, value in SETTINGS.items() if "worker-ttl" not in name}
    (kubernetes,) = [
        each["data"] for each in documents() if each["kind"] == "ConfigMap" and "GLINT_STORE" in each["data"]
    ]
    for said in (COMPOSE["services"]["dask-worker"]["environment"], kubernetes):
        assert {name: said.get(name) for name in expected} == expected
        assert "DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL" in said


@pytest.mark.parametrize("name", sorted(COMPOSE["services"]))
def test_a_service_is_limited_watched_and_local(name: str) -> None:
    service = COMPOSE["services"][name]
    assert {"cpus", "memory"} <= set(service["deploy"]["resources"]["limits"])
    assert name in ENDS or "healthcheck" in service or name == "gateway"  # the gateway's image has its own
    assert all(str(port).startswith("127.0.0.1:") for port in service.get("ports", []))
    for value in service.get("environment", {}).values():
        assert not re.search(r"PASSWORD|SECRET|AUTH", str(value)) or ":?}" in value, "a secret has no default"


def test_every_variable_of_compose_is_explained() -> None:
    used = set(re.findall(r"\$\{([A-Z_]+)", (DEPLOY / "compose.yaml").read_text()))
    told = set(re.findall(r"^([A-Z_]+)=", (DEPLOY / ".env.example").read_text(), re.MULTILINE))
    assert used - told <= {"GLINT_IMAGE", "PREFECT_UI_API_URL"} and told <= used


def test_examples_hold_no_secret() -> None:
    for line in (DEPLOY / ".env.example").read_text().splitlines():
        if re.match(r"[A-Z_]*(PASSWORD|SECRET|KEY|AUTH)[A-Z_]*=", line):
            assert line.endswith("="), line
    (secret,) = (each for each in documents() if each["kind"] == "Secret")
    assert set(secret["stringData"].values()) == {""}


@pytest.mark.parametrize("name", sorted(pods()))
def test_a_pod_has_small_rights_and_limits(name: str) -> None:
    pod = pods()[name]
    assert pod["securityContext"]["runAsNonRoot"] and pod["securityContext"]["runAsUser"] > 0
    assert pod["automountServiceAccountToken"] is False and pod["enableServiceLinks"] is False
    for container in pod["containers"]:
        assert container["securityContext"]["allowPrivilegeEscalation"] is False
        assert container["securityContext"]["capabilities"]["drop"] == ["ALL"]
        assert {"cpu", "memory"} <= set(container["resources"]["limits"])
        assert name in ENDS or {"readinessProbe", "livenessProbe"} <= set(container)


def test_every_manifest_is_listed_and_every_name_is_there() -> None:
    listed = next(each for each in documents() if each["kind"] == "Kustomization")["resources"]
    files = {path.name for path in MANIFESTS} - {"kustomization.yaml", "secret.example.yaml"}
    assert set(listed) == files
    keys = {key for each in documents() if each["kind"] == "Secret" for key in each["stringData"]}
    asked = set(re.findall(r"secretKeyRef: \{name: glint, key: (\w+)\}", "".join(p.read_text() for p in MANIFESTS)))
    assert asked == keys


def test_images_name_no_registry_and_a_version() -> None:
    images = [service["image"] for service in COMPOSE["services"].values()]
    images += [container["image"] for pod in pods().values() for container in pod["containers"]]
    images += re.findall(r"^FROM (\S+)", "".join(p.read_text() for p in DEPLOY.rglob("Dockerfile")), re.MULTILINE)
    for image in images:
        assert "." not in image.partition("/")[0] or "/" not in image, image
        assert ":" in image or image in ("glint", "glint-gateway"), image


def test_the_image_installs_what_setup_does() -> None:
    wanted = set(re.findall(r":(lib[a-z0-9.-]+)", (ROOT / "setup.sh").read_text()))
    assert wanted and wanted <= set((DEPLOY / "Dockerfile").read_text().split())
    assert not re.search(r"^USER (root|0)", (DEPLOY / "Dockerfile").read_text(), re.MULTILINE)


def test_compose_accepts_the_file(tmp_path: Path) -> None:
    program = shutil.which("docker-compose")
    if program is None:
        pytest.skip("no docker-compose")
    values = re.sub(r"^([A-Z_]+)=$", r"\1=x", (DEPLOY / ".env.example").read_text(), flags=re.MULTILINE)
    (tmp_path / "env").write_text(values)
    # The oldest programs know no `name`.
    (tmp_path / "compose.yaml").write_text((DEPLOY / "compose.yaml").read_text().replace("name: glint\n", "", 1))
    command = [program, "-f", str(tmp_path / "compose.yaml"), "--project-directory", str(DEPLOY)]
    done = subprocess.run([*command, "--env-file", str(tmp_path / "env"), "config"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_scripts_are_sound() -> None:
    subprocess.run(["bash", "-n", str(DEPLOY / "gateway" / "start.sh")], check=True)
