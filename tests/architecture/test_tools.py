"""What `check --deploy` says, and that scripts and targets are there; `make lint` holds the style."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.services import environment_of_its_own

REPOSITORY = Path(__file__).resolve().parents[2]
DEPLOYMENT_CHECK = ("manage.py", "check", "--deploy", "--fail-level", "WARNING")


def says(*command: str, environment: dict[str, str] | None = None) -> str:
    """What a command that fails printed; nothing if it succeeded."""
    done = subprocess.run(
        command,
        cwd=REPOSITORY,
        env=environment_of_its_own() | (environment or {}),
        capture_output=True,
        text=True,
        check=False,
    )
    return "" if done.returncode == 0 else f"exit code {done.returncode}\n{done.stdout}{done.stderr}"


@pytest.mark.slow
def test_the_production_profile_passes_the_deployment_checks(production: dict[str, str]) -> None:
    output = says(sys.executable, *DEPLOYMENT_CHECK, environment=production)
    # Its services are nowhere, and that is all.
    assert sorted(re.findall(r"\(leaderboard\.(\w+)\) (.*)", output)) == [
        ("E003", "The broker of TSTTC_BROKER_URL does not answer."),
        ("E003", "The database of TSTTC_DATABASE_URL does not answer, or does not know the account."),
        (
            "E003",
            "The mail server of TSTTC_EMAIL_URL does not let the site in (Connection refused). "
            "Without it, no code for signing in arrives.",
        ),
        ("I001", "The pages give the sender of mails, leaderboard@localhost, as the contact."),
        (
            "I002",
            "TSTTC_RECEIPT_PUBLIC_KEY is not set; for backups, set it to "
            "O2onvM62pC1io6jQKm8Nc2UyFXcd4kOmOsBIoYtZ2ik",
        ),
        (
            "W004",
            "TSTTC_FROM_EMAIL is not set: mails come from leaderboard@localhost, which mail servers refuse.",
        ),
    ]


@pytest.mark.slow
def test_all_that_is_wrong_with_a_deployment_is_reported_at_once(production: dict[str, str]) -> None:
    wrong = {
        "TSTTC_SECRET_KEY": "",
        "TSTTC_MAX_PREDICTIONS_BYTES": "20MB",
        "TSTTC_DATABASE_URL": "swordfish",
        "TSTTC_METRICS_NETWORKS": "home",
        "TSTTC_EMAIL_URL": "smtp+tls:/swordfish",
        "TSTTC_SECRETKEY": "swordfish",
    }
    output = says(sys.executable, *DEPLOYMENT_CHECK, environment=production | wrong)
    assert [name for name in wrong if name not in output] == []
    assert "Traceback" not in output
    assert "swordfish" not in output
    assert "TSTTC_SECRETKEY is read by nothing; did you mean TSTTC_SECRET_KEY?" in output
    wrong = {"TSTTC_SITE_URL": "foo", "TSTTC_BROKER_URL": "bar", "TSTTC_EMAIL_URL": "", "TSTTC_QUOTA": "1"}
    wrong |= {"TSTTC_FILES_DIR": str(REPOSITORY / "manage.py" / "files")}
    output = says(sys.executable, *DEPLOYMENT_CHECK, environment=production | wrong)
    assert [name for name in wrong if name not in output] == []
    assert "TSTTC_QUOTA is read by nothing; did you mean TSTTC_QUOTAS?" in output
    assert "Traceback" not in output
    output = says(
        sys.executable,
        *DEPLOYMENT_CHECK,
        environment=production | {"TSTTC_SITE_URL": "http://board.example.org"},
    )
    assert "expected https" in output


@pytest.mark.slow
def test_production_does_not_start_without_a_variable_that_it_needs(production: dict[str, str]) -> None:
    services = ("TSTTC_SITE_URL", "TSTTC_DATABASE_URL", "TSTTC_BROKER_URL")
    needed = ("TSTTC_SECRET_KEY", "TSTTC_RECEIPT_KEY", "TSTTC_ALLOWED_HOSTS", *services)
    complaint = says(sys.executable, "manage.py", "check", environment=production | dict.fromkeys(needed, ""))
    assert [name for name in needed if f"{name} is not set" not in complaint] == []
