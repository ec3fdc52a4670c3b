"""The production set-up as far as it can be checked without a container engine, and its documentation."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml
from django.conf import settings

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


def test_compose_has_the_processes_of_production() -> None:
    assert {"web", "worker", "db", "redis"} <= set(SERVICES)
    assert set(OURS) == {"web", "worker", "mailer", "migrate", "maintainer", "restore"}


def test_only_the_worker_and_the_maintainer_see_the_ground_truth() -> None:
    seeing = {
        name
        for name, service in SERVICES.items()
        if any(target == GROUND_TRUTH or GROUND_TRUTH.startswith(f"{target}/") for target in mounts(service))
    }
    assert seeing == {"worker", "maintainer", "restore"}
    assert mounts(SERVICES["worker"])[GROUND_TRUTH].endswith(":ro")
    assert SERVICES["maintainer"]["profiles"] == SERVICES["restore"]["profiles"] == ["maintenance"]


@pytest.mark.parametrize("name", sorted(OURS))
def test_our_processes_are_those_of_production_and_write_to_volumes_only(name: str) -> None:
    service = OURS[name]
    assert service["read_only"] is True
    assert service["environment"]["TSTTC_PROFILE"] == "production"


@pytest.mark.parametrize("name", sorted(set(SERVICES) - {"proxy", "migrate", "maintainer", "restore"}))
def test_what_runs_for_ever_is_watched_and_restarted(name: str) -> None:
    assert SERVICES[name]["restart"] == "unless-stopped"
    # The mailer answers nobody; the figures say whether mails go out.
    assert name == "mailer" or SERVICES[name]["healthcheck"]["test"]


@pytest.mark.parametrize("name", sorted(SERVICES))
def test_every_service_is_without_privileges_and_has_limits(name: str) -> None:
    service = SERVICES[name]
    assert service["cap_drop"] == ["ALL"]
    assert service.get("cap_add", []) == (["NET_BIND_SERVICE"] if name == "proxy" else [])
    assert "no-new-privileges:true" in service["security_opt"]
    assert service["mem_limit"]
    assert service["pids_limit"]
    if name not in OURS:
        assert service["user"] not in {"root", "0"}


def test_networks_are_for_one_purpose_each_and_workers_have_no_way_out() -> None:
    found = {name: set(service["networks"]) for name, service in SERVICES.items()}
    assert found == {
        "proxy": {"pages"},
        "web": {"pages", "database", "broker"},
        "worker": {"database", "broker"},
        "mailer": {"pages", "database"},
        "migrate": {"database"},
        "maintainer": {"database", "broker"},
        "restore": {"database"},
        "db": {"database"},
        "redis": {"broker"},
    }
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
RECEIPT_KEYS = {"TSTTC_RECEIPT_KEY", "TSTTC_RECEIPT_OLD_KEYS"}
S3_KEYS = {"AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"}
HAVE: dict[str, set[str]] = {
    "web": KEYS | S3_KEYS | {"TSTTC_DATABASE_URL", "TSTTC_BROKER_URL"},
    "worker": S3_KEYS | {"TSTTC_DATABASE_URL", "TSTTC_BROKER_URL"},
    "maintainer": RECEIPT_KEYS | S3_KEYS | {"TSTTC_DATABASE_URL", "TSTTC_BROKER_URL"},
    "restore": RECEIPT_KEYS | S3_KEYS | {"TSTTC_DATABASE_URL"},
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
    given = {key: found[1] if found else "x" * 43 for key, found in defaults.items()} | {
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
    """What a program prints that has these variables and none of ours beside them."""
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


def test_the_password_of_the_broker_is_in_no_command_line_and_it_is_not_root() -> None:
    redis = SERVICES["redis"]
    script = redis["command"][-1]
    assert script.splitlines()[-1] == "exec redis-server /tmp/redis.conf"
    assert "/tmp" in redis["tmpfs"]
    # What a shell does by itself has no command line.
    naming = [line.split()[0] for line in script.splitlines() if "REDIS_PASSWORD" in line]
    assert naming == ["printf"]


def test_the_application_is_an_account_of_the_broker_without_programs_and_without_its_settings() -> None:
    assert COMPOSE["x-broker"]["TSTTC_BROKER_URL"].startswith("redis://tsttc:")
    assert mounts(SERVICES["redis"])["/etc/redis/users.acl"] == "./deploy/redis.acl:/etc/redis/users.acl:ro"
    default, ours = (REPOSITORY / "deploy/redis.acl").read_text().splitlines()
    assert default == "user default off"
    assert {"-@scripting", "-@dangerous", "-@admin"} <= set(ours.split())
    assert "+@all" not in ours


def test_the_log_of_the_database_has_no_statement_and_no_value() -> None:
    options = SERVICES["db"]["command"]
    assert {"log_min_error_statement=panic", "log_error_verbosity=terse"} <= set(options)
    assert {"log_parameter_max_length=0", "log_parameter_max_length_on_error=0"} <= set(options)


def test_secrets_on_disk_are_committed_nowhere_and_in_no_image() -> None:
    assert "/.env" in (REPOSITORY / ".gitignore").read_text().splitlines()
    ignored = (REPOSITORY / ".dockerignore").read_text().splitlines()
    assert ignored[0] == "*"
    assert not any(line.startswith("!.env") for line in ignored)


def test_the_image_has_every_package_of_the_project() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())
    packages = [name.rstrip("*") for name in project["tool"]["setuptools"]["packages"]["find"]["include"]]
    let_in = (REPOSITORY / ".dockerignore").read_text().splitlines()
    assert packages
    assert [name for name in [*packages, "leaderboard"] if f"!{name}" not in let_in] == []


def test_the_image_has_everything_that_the_pages_are_made_of() -> None:
    let_in = {line.removeprefix("!") for line in (REPOSITORY / ".dockerignore").read_text().splitlines()}
    folders = [entry[1] if isinstance(entry, tuple) else entry for entry in settings.STATICFILES_DIRS]
    read = [Path(path) for path in (*folders, REPOSITORY / "templates", *guides.files().values())]
    assert [path for path in read if path.relative_to(REPOSITORY).parts[0] not in let_in] == []
    assert "manage.py build_wheel" in (REPOSITORY / "Dockerfile").read_text()


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


def test_compose_passes_every_documented_variable() -> None:
    """But for those of tests and of the command line, and for places within the image."""
    page = (REPOSITORY / "docs/operations.md").read_text()
    documented = page.partition("## Every variable")[2].partition("### Tests and the command line")[0]
    names = set(re.findall(r"^\| `(TSTTC_\w+)`", documented, flags=re.MULTILINE))
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
