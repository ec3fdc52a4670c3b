"""The production set-up as far as it can be checked without a container engine, and its documentation."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

REPOSITORY = Path(__file__).resolve().parents[2]
COMPOSE: dict[str, Any] = yaml.safe_load((REPOSITORY / "docker-compose.yml").read_text())
SERVICES: dict[str, dict[str, Any]] = COMPOSE["services"]
OURS = {name: service for name, service in SERVICES.items() if "build" in service}
GROUND_TRUTH = "/var/lib/tsttc/ground-truth"


def names_in(*paths: str) -> set[str]:
    """The project's environment variables that these files name."""
    return {
        name
        for path in paths
        for name in re.findall(r"TSTTC_[A-Z0-9_]*[A-Z0-9]", (REPOSITORY / path).read_text())
    }


def mounts(service: dict[str, Any]) -> dict[str, str]:
    """Target and whole entry of each volume."""
    return {entry.split(":")[1]: entry for entry in service.get("volumes", ())}


READ = names_in(
    "leaderboard/settings.py",
    "leaderboard/environment.py",
    "deploy/gunicorn.conf.py",
    "deploy/Caddyfile",
    "deploy/healthcheck.py",
)


def test_compose_has_the_processes_of_production() -> None:
    assert {"web", "worker", "beat", "db", "redis"} <= set(SERVICES)
    assert set(OURS) == {"web", "worker", "beat", "migrate", "maintainer"}


def test_only_the_worker_and_the_maintainer_see_the_ground_truth() -> None:
    seeing = {
        name
        for name, service in SERVICES.items()
        if any(target == GROUND_TRUTH or GROUND_TRUTH.startswith(f"{target}/") for target in mounts(service))
    }
    assert seeing == {"worker", "maintainer"}
    assert mounts(SERVICES["worker"])[GROUND_TRUTH].endswith(":ro")
    assert SERVICES["maintainer"]["profiles"] == ["maintenance"]


@pytest.mark.parametrize("name", sorted(OURS))
def test_our_processes_have_no_privileges_and_write_to_volumes_only(name: str) -> None:
    service = OURS[name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert "no-new-privileges:true" in service["security_opt"]
    assert service["environment"]["TSTTC_PROFILE"] == "production"


@pytest.mark.parametrize("name", sorted(set(SERVICES) - {"proxy", "migrate", "maintainer"}))
def test_what_runs_for_ever_is_watched_and_restarted(name: str) -> None:
    assert SERVICES[name]["restart"] == "unless-stopped"
    assert SERVICES[name]["healthcheck"]["test"]


def test_nothing_but_the_proxy_is_reachable_from_outside() -> None:
    assert [name for name, service in SERVICES.items() if "ports" in service] == ["proxy"]


def test_images_are_pinned() -> None:
    images = [service["image"] for name, service in SERVICES.items() if name not in OURS]
    images += re.findall(r"^FROM (\S+)", (REPOSITORY / "Dockerfile").read_text(), flags=re.MULTILINE)
    assert images
    assert [image for image in images if not re.search(r":\d+\.\d+", image)] == []


def test_the_image_runs_as_nobody_in_particular() -> None:
    users = re.findall(r"^USER (\S+)", (REPOSITORY / "Dockerfile").read_text(), flags=re.MULTILINE)
    assert users[-1] not in {"root", "0"}


def test_every_variable_of_the_deployment_is_read_by_something() -> None:
    assert names_in("docker-compose.yml", "Dockerfile", "deploy/env.example") - READ == set()


def test_no_secret_has_a_default() -> None:
    text = (REPOSITORY / "docker-compose.yml").read_text()
    for name in ("TSTTC_SECRET_KEY", "TSTTC_RECEIPT_KEY", "POSTGRES_PASSWORD", "REDIS_PASSWORD"):
        assert f"${{{name}:?" in text
        assert f"${{{name}:-" not in text
    example = (REPOSITORY / "deploy/env.example").read_text()
    for name in ("TSTTC_SECRET_KEY", "TSTTC_RECEIPT_KEY", "POSTGRES_PASSWORD", "REDIS_PASSWORD"):
        assert f"\n{name}=\n" in example


def test_every_variable_is_documented_and_every_documented_variable_is_read() -> None:
    documented = names_in("docs/operations.md")
    read = READ | names_in("tests/services.py", "evaluator/cli/options.py")
    assert READ - documented == set()
    assert documented - read == set()


def test_every_link_between_the_documents_leads_somewhere() -> None:
    broken = [
        f"{page.relative_to(REPOSITORY)}: {target}"
        for page in [
            *REPOSITORY.glob("*.md"),
            *REPOSITORY.glob("docs/**/*.md"),
            *REPOSITORY.glob("examples/*.md"),
        ]
        for target in re.findall(r"\]\(([^)#\s]+)", page.read_text())
        if "://" not in target and not (page.parent / target).exists()
    ]
    assert broken == []
