"""The production set-up as far as it can be checked without a container engine, and its documentation."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from django.conf import settings

from leaderboard.management.commands import build_wheel
from leaderboard.web.docs import guides

pytestmark = pytest.mark.slow

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
    "leaderboard/ops/environment.py",
    "deploy/gunicorn.conf.py",
    "deploy/Caddyfile",
    "deploy/healthcheck.py",
)


def test_only_the_worker_and_the_maintainers_commands_see_the_ground_truth() -> None:
    seeing = {
        name
        for name, service in SERVICES.items()
        if any(target == GROUND_TRUTH or GROUND_TRUTH.startswith(f"{target}/") for target in mounts(service))
    }
    assert seeing == {"worker", "maintainer", "backup", "restore"}
    for name in ("worker", "backup"):
        assert mounts(SERVICES[name])[GROUND_TRUTH].endswith(":ro")
    assert SERVICES["maintainer"]["profiles"] == SERVICES["restore"]["profiles"] == ["maintenance"]


@pytest.mark.parametrize("name", sorted(SERVICES))
def test_every_service_is_without_privileges_and_has_limits(name: str) -> None:
    service = SERVICES[name]
    assert service["cap_drop"] == ["ALL"]
    assert service.get("cap_add", []) == (["NET_BIND_SERVICE"] if name == "proxy" else [])
    assert "no-new-privileges:true" in service["security_opt"]
    assert service["mem_limit"]
    # Docker keeps every line of a log otherwise.
    assert set(service["logging"]["options"]) == {"max-size", "max-file"}
    assert service["pids_limit"]
    if name not in OURS:
        assert service["user"] not in {"root", "0"}


def test_logs_of_a_container_have_the_size_that_the_documentation_says() -> None:
    page = (REPOSITORY / "docs/operations.md").read_text()
    for service in SERVICES.values():
        options = service["logging"]["options"]
        n_mb = int(options["max-size"].removesuffix("m")) * int(options["max-file"])
        assert service["logging"]["driver"] == "json-file"
        assert f"Docker keeps {n_mb} MB for each container" in page


@pytest.mark.parametrize("name", sorted(SERVICES))
def test_a_service_mounts_uses_and_awaits_what_compose_has(name: str) -> None:
    service = SERVICES[name]
    sources = [entry.split(":")[0] for entry in service.get("volumes", ())]
    assert {each for each in sources if not each.startswith(".")} <= set(COMPOSE["volumes"])
    # ./backup is made by hand, for the user of the containers.
    files = [each for each in sources if each.startswith(".") and each != "./backup"]
    assert [each for each in files if not (REPOSITORY / each).exists()] == []
    assert set(service.get("depends_on", ())) <= set(SERVICES)
    for other, how in service.get("depends_on", {}).items():
        is_healthy = how["condition"] == "service_healthy"
        assert not is_healthy or "healthcheck" in SERVICES[other], other


def test_a_fault_that_needs_a_person_takes_no_container_down() -> None:
    """`/healthy` is for alarms: a health check that asked it would restart a site whose backup is old."""
    asked = [str(service["healthcheck"]["test"]) for service in SERVICES.values() if "healthcheck" in service]
    script = (REPOSITORY / "deploy/healthcheck.py").read_text()
    assert len(asked) >= 4
    assert "/healthz" in script
    assert [text for text in [*asked, script] if re.search(r"/healthy\b|/readyz", text)] == []


def test_a_worker_has_memory_for_its_processes_and_their_readers() -> None:
    limit = SERVICES["worker"]["mem_limit"]
    command = " ".join(SERVICES["worker"]["command"])
    n_processes = int(_DEFAULT.search(command.partition("--concurrency=")[2].partition(" ")[0])[1])  # type: ignore[index]
    n_gb = int(_DEFAULT.search(limit)[1].removesuffix("g"))  # type: ignore[index]
    assert n_gb * 2**30 >= n_processes * settings.CHILD_MEMORY_BYTES


def test_networks_are_for_one_purpose_each_and_workers_have_no_way_out() -> None:
    networks = {name: set(service["networks"]) for name, service in SERVICES.items()}
    assert networks == {
        "proxy": {"pages"},
        "buffer": {"pages"},
        "web": {"pages", "database", "broker"},
        "worker": {"database", "broker"},
        "mailer": {"pages", "database"},
        "migrate": {"database"},
        "maintainer": {"database", "broker"},
        "backup": {"database"},
        "restore": {"database"},
        "db": {"database"},
        "redis": {"broker"},
    }
    assert [name for name, service in SERVICES.items() if "ports" in service] == ["proxy"]
    assert COMPOSE["networks"] == {
        "pages": None,
        "database": {"internal": True},
        "broker": {"internal": True},
    }


KEYS = {
    "TSTTC_SECRET_KEY",
    "TSTTC_RECEIPT_KEY",
    "TSTTC_RECEIPT_OLD_KEYS",
    "TSTTC_EMAIL_URL",
    "TSTTC_METRICS_TOKEN",
    "TSTTC_ORCID_CLIENT_SECRET",
    "TSTTC_GITHUB_CLIENT_SECRET",
}
PUBLIC_KEYS = {"TSTTC_RECEIPT_OLD_KEYS"}
S3_KEYS = {"AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"}
HAVE: dict[str, set[str]] = {
    "web": KEYS | S3_KEYS | {"TSTTC_DATABASE_URL", "TSTTC_BROKER_URL"},
    "worker": S3_KEYS | {"TSTTC_DATABASE_URL", "TSTTC_BROKER_URL"},
    "maintainer": S3_KEYS | {"TSTTC_DATABASE_URL", "TSTTC_BROKER_URL"},
    "backup": PUBLIC_KEYS | S3_KEYS | {"TSTTC_DATABASE_URL"},
    "restore": PUBLIC_KEYS | S3_KEYS | {"TSTTC_DATABASE_URL"},
    "mailer": {"TSTTC_EMAIL_URL", "TSTTC_DATABASE_URL"},
    "migrate": {"TSTTC_DATABASE_URL", "TSTTC_APPLICATION_PASSWORD"},
}


@pytest.mark.parametrize("name", sorted(OURS))
def test_each_service_has_the_secrets_that_it_uses_and_no_others(name: str) -> None:
    secret = {*KEYS, *S3_KEYS, "TSTTC_DATABASE_URL", "TSTTC_BROKER_URL", "TSTTC_APPLICATION_PASSWORD"}
    environment = OURS[name]["environment"]
    assert set(environment) & secret == HAVE[name]
    assert environment["TSTTC_PROCESS"] == ("migrate" if name == "restore" else name)
    # Only what makes the tables, or fills empty ones, signs in as their owner.
    is_owner = "//tsttc:${POSTGRES_PASSWORD" in environment.get("TSTTC_DATABASE_URL", "")
    assert is_owner == (name in {"migrate", "restore"})


_DEFAULT = re.compile(r"\$\{\w+:-([^}]*)\}$")


@pytest.mark.parametrize("name", sorted(OURS))
def test_each_process_starts_with_the_variables_that_compose_gives_it(name: str) -> None:
    defaults = {key: _DEFAULT.search(str(text)) for key, text in OURS[name]["environment"].items()}
    given = {key: match[1] if match else "x" * 43 for key, match in defaults.items()} | {
        "TSTTC_PROFILE": "production",
        "TSTTC_PROCESS": OURS[name]["environment"]["TSTTC_PROCESS"],
        "TSTTC_DATABASE_URL": "postgres://u:p@db/tsttc",
        "TSTTC_BROKER_URL": "redis://redis/0",
        "TSTTC_EMAIL_URL": "smtp://mail",
        "TSTTC_FILES_URL": "",
        "TSTTC_TRUSTED_PROXIES": "1",
        "TSTTC_MAX_PREDICTIONS_BYTES": "1",
    }
    environment = {key: text for key, text in given.items() if key in OURS[name]["environment"]}
    statement = "from leaderboard import settings; print(len(settings.SECRET_KEY) > 40)"
    assert python(statement, environment) == "True\n"
    page = python("import leaderboard.wsgi", environment)
    assert ("expected 'web', which alone has the keys" in page) == (name != "web")


def python(statement: str, environment: dict[str, str]) -> str:
    """Run a statement with these variables and none of ours; return what it prints."""
    usual = {name: text for name, text in os.environ.items() if name in {"PATH", "HOME"}}
    done = subprocess.run(
        [sys.executable, "-c", statement],
        cwd=REPOSITORY,
        env=usual | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout + done.stderr


def test_the_image_has_everything_that_the_pages_are_made_of() -> None:
    let_in = {line.removeprefix("!") for line in (REPOSITORY / ".dockerignore").read_text().splitlines()}
    folders = [entry[1] if isinstance(entry, tuple) else entry for entry in settings.STATICFILES_DIRS]
    read = [Path(path) for path in (*folders, REPOSITORY / "templates", *guides.files().values())]
    assert [path for path in read if path.relative_to(REPOSITORY).parts[0] not in let_in] == []
    assert {*build_wheel.PACKAGES, *build_wheel.FILES} <= let_in
    assert "manage.py build_wheel" in (REPOSITORY / "Dockerfile").read_text()


def test_every_variable_of_the_deployment_is_read_by_something() -> None:
    assert names_in("docker-compose.yml", "Dockerfile", "deploy/env.example") - READ == set()


def test_compose_passes_every_documented_variable() -> None:
    """But for places within the image."""
    page = (REPOSITORY / "docs/settings.md").read_text()
    names = set(re.findall(r"^- \*\*`(TSTTC_\w+)`", page, flags=re.MULTILINE))
    within = {"TSTTC_DATA_DIR", "TSTTC_FILES_DIR", "TSTTC_GROUND_TRUTH_DIR", "TSTTC_STATIC_ROOT"}
    within |= {"TSTTC_DIST_DIR", "TSTTC_WEB_BIND", "TSTTC_HTTPS", "TSTTC_DEBUG"}
    assert len(names) > 40
    assert names - names_in("docker-compose.yml") == within


def test_no_secret_has_a_default() -> None:
    text = (REPOSITORY / "docker-compose.yml").read_text()
    example = (REPOSITORY / "deploy/env.example").read_text()
    for name in (
        "TSTTC_SECRET_KEY",
        "TSTTC_RECEIPT_KEY",
        "POSTGRES_PASSWORD",
        "APPLICATION_PASSWORD",
        "REDIS_PASSWORD",
    ):
        assert f"${{{name}:?" in text
        assert f"${{{name}:-" not in text
        assert f"\n{name}=\n" in example


def test_every_variable_is_documented_and_every_documented_variable_is_read() -> None:
    documented = names_in("docs/settings.md")
    assert documented == READ
