"""What is deployed is what the services are: manifests by their schemas, limits everywhere, figures that exist."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import httpx
import kubernetes_validate
import pytest
import yaml

from contracts.fleet import FleetFile
from launcher.processes import STARTED_WITH
from scripts.configuration import OTHER_VEHICLES, SERVICES
from service_kit.addresses import PORTS, VEHICLE_PORTS
from tests.agreements.test_errors_described import SERVICES as APPS
from tests.agreements.test_errors_described import TOKEN

ROOT = Path(__file__).parent.parent
COMPOSE = yaml.safe_load((ROOT / "docker-compose.yml").read_text(encoding="utf-8"))
KUBERNETES = ROOT / "deploy" / "kubernetes"
OBSERVABILITY = ROOT / "deploy" / "observability"
OLDEST_KUBERNETES = "1.33"
MANIFESTS = sorted(path for path in KUBERNETES.rglob("*.yaml") if path.name != "kustomization.yaml")


def documents(path: Path) -> list[dict[str, Any]]:
    return list(yaml.safe_load_all(path.read_text(encoding="utf-8")))


def pods() -> list[dict[str, Any]]:
    found = [document for path in MANIFESTS for document in documents(path)]
    return [document["spec"]["template"]["spec"] for document in found if "template" in document.get("spec", {})]


@pytest.mark.parametrize("path", MANIFESTS, ids=lambda path: path.stem)
def test_manifests_are_what_kubernetes_takes(path: Path) -> None:
    for document in documents(path):
        kubernetes_validate.validate(document, OLDEST_KUBERNETES, strict=True)


@pytest.mark.parametrize("folder", [KUBERNETES, KUBERNETES / "bench", KUBERNETES / "carla"], ids=lambda f: f.name)
def test_a_kustomization_names_every_manifest_beside_it(folder: Path) -> None:
    (kustomization,) = documents(folder / "kustomization.yaml")
    assert sorted(kustomization["resources"]) == sorted(p.name for p in MANIFESTS if p.parent == folder)


def test_every_pod_is_bounded_unprivileged_and_knows_no_account() -> None:
    assert len(pods()) == len(SERVICES) + 3  # Redis, bench, carla-world
    for pod in pods():
        assert pod["automountServiceAccountToken"] is False
        assert pod["securityContext"]["runAsNonRoot"]
        for container in pod["containers"]:
            assert {"cpu", "memory"} <= set(container["resources"]["limits"])
            safe = container["securityContext"]
            assert (safe["readOnlyRootFilesystem"], safe["allowPrivilegeEscalation"]) == (True, False)
            assert safe["capabilities"] == {"drop": ["ALL"]}


@pytest.mark.parametrize("name", [*SERVICES, "carla_world"])
def test_kubernetes_runs_each_service_as_its_settings_say(name: str) -> None:
    found = [path for path in MANIFESTS if path.stem == name.replace("_", "-")]
    deployment, service = documents(found[0])
    settings, port = (SERVICES | OTHER_VEHICLES)[name], (PORTS | VEHICLE_PORTS)[name]
    pod = deployment["spec"]["template"]["spec"]
    (container,) = pod["containers"]
    of_the_c_library = STARTED_WITH.get(name, {})
    assert (
        of_the_c_library.items() <= {variable["name"]: variable.get("value") for variable in container["env"]}.items()
    )
    assert {variable["name"] for variable in container["env"]} - set(of_the_c_library) <= settings.names()
    assert container["ports"][0]["containerPort"] == service["spec"]["ports"][0]["port"] == port
    assert {"startupProbe", "readinessProbe", "livenessProbe"} <= set(container)
    mounted = {item["key"] for volume in pod["volumes"] for item in volume.get("secret", {}).get("items", ())}
    files = {v["name"].removesuffix("_FILE").lower() for v in container["env"] if v["name"].endswith("_FILE")}
    assert mounted == files
    assert container["image"] == COMPOSE["services"][name.replace("_", "-")]["image"]
    assert pod["terminationGracePeriodSeconds"] > settings().drain_timeout_s


def test_every_container_of_compose_is_bounded() -> None:
    for name, service in COMPOSE["services"].items():
        assert service["logging"]["options"]["max-size"], name
        if service["image"].startswith("ollama"):
            continue  # as large as its model
        assert {"memory", "cpus", "pids"} <= set(service["deploy"]["resources"]["limits"]), name


@pytest.mark.parametrize("name", OTHER_VEHICLES)
def test_compose_has_a_profile_for_each_other_vehicle_and_a_fleet_that_names_it(name: str) -> None:
    service, port = COMPOSE["services"][name.replace("_", "-")], VEHICLE_PORTS[name]
    (profile,) = service["profiles"]
    assert set(service["environment"]) <= OTHER_VEHICLES[name].names()
    assert f":{port}/healthz" in service["healthcheck"]["test"][-1]
    fleet = tomllib.loads((ROOT / "deploy" / profile / "fleet.toml").read_text(encoding="utf-8"))
    (member,) = FleetFile.model_validate(fleet).vehicle
    assert (member.kind, member.address) == ("simulator", f"http://{name.replace('_', '-')}:{port}")
    assert sum(profile in other.get("profiles", ()) for other in COMPOSE["services"].values()) == 2, "and what it flies"


def test_every_secret_of_compose_is_mounted_by_somebody_and_named_by_a_variable() -> None:
    mounted = {secret for service in COMPOSE["services"].values() for secret in service.get("secrets", ())}
    assert mounted == set(COMPOSE["secrets"])


def test_prometheus_asks_every_service_of_compose() -> None:
    configured = yaml.safe_load((OBSERVABILITY / "prometheus.yml").read_text(encoding="utf-8"))["scrape_configs"]
    targets = {job["job_name"]: job["static_configs"][0]["targets"][0] for job in configured}
    assert targets == {name: f"{name.replace('_', '-')}:{port}" for name, port in PORTS.items()}
    files = {Path(job["authorization"]["credentials_file"]).name for job in configured}
    assert files == set(COMPOSE["services"]["prometheus"]["secrets"])


async def test_the_dashboard_shows_figures_that_there_are(tmp_path: Path) -> None:
    dashboard = json.loads((OBSERVABILITY / "grafana/dashboards/logisticsvln.json").read_text(encoding="utf-8"))
    asked = " ".join(target["expr"] for panel in dashboard["panels"] for target in panel["targets"])
    named = {name for name in re.findall(r"[a-z_]+", asked) if name.startswith(("http_", "sim_", "vlm_", "llm_"))}
    there: set[str] = set()
    for build in APPS.values():
        transport = httpx.ASGITransport(app=build(tmp_path))
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            page = (await client.get("/metrics", headers={"Authorization": f"Bearer {TOKEN}"})).text
        there |= set(re.findall(r"^# TYPE (\S+)", page, re.MULTILINE))
    assert len(named) > 5
    assert {name.removesuffix("_bucket") for name in named} <= there
