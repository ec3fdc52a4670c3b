"""The example files in deploy/ name what there is: programs, addresses, figures."""

import configparser
import json
import re
from pathlib import Path

import pytest
import yaml

REPOSITORY = Path(__file__).resolve().parents[2]
DEPLOY = REPOSITORY / "deploy"
UNITS = sorted((DEPLOY / "systemd").glob("*.service"))


def figures() -> set[str]:
    """The names of all figures, as their source has them."""
    text = (REPOSITORY / "leaderboard/ops/prometheus.py").read_text()
    return set(re.findall(r"\"(tsttc_\w+)\"", text))


def named(text: str) -> set[str]:
    """The figures that an expression names, without what Prometheus adds."""
    return {re.sub(r"_(bucket|total)$", "", name) for name in re.findall(r"tsttc_\w+", text)}


def test_alarms_ask_for_figures_that_there_are_and_say_what_is_wrong() -> None:
    [group] = yaml.safe_load((DEPLOY / "prometheus/rules.yml").read_text())["groups"]
    rules = group["rules"]
    assert len({rule["alert"] for rule in rules}) == len(rules) > 8
    assert set().union(*(named(rule["expr"]) for rule in rules)) <= figures()
    assert all(rule["annotations"]["summary"].endswith(".") for rule in rules)
    scrape = yaml.safe_load((DEPLOY / "prometheus/scrape.yml").read_text())
    assert scrape["rule_files"] == ["rules.yml"]
    # Where the web process listens, with and without containers.
    text = (DEPLOY / "prometheus/scrape.yml").read_text()
    assert "127.0.0.1:8000" in text
    assert "web:8000" in text
    assert "reverse_proxy web:8000" in (DEPLOY / "Caddyfile").read_text()


def test_the_board_of_grafana_shows_figures_that_there_are() -> None:
    panels = json.loads((DEPLOY / "grafana.json").read_text())["panels"]
    shown = set().union(*(named(target["expr"]) for panel in panels for target in panel["targets"]))
    assert shown <= figures()
    assert len(shown) > 8
    assert len({panel["id"] for panel in panels}) == len(panels)


@pytest.mark.parametrize("path", UNITS, ids=lambda path: path.stem)
def test_units_start_programs_that_there_are_without_privileges(path: Path) -> None:
    unit = configparser.RawConfigParser(strict=False)
    unit.optionxform = str  # type: ignore[assignment]  # systemd's own letters
    unit.read(path)
    service = unit["Service"]
    program, *arguments = service["ExecStart"].split()
    assert program.startswith("/opt/tsttc/bin/")
    assert Path(program).name in {"gunicorn", "celery", "python"}
    if arguments[0] == "manage.py":
        assert (REPOSITORY / f"leaderboard/management/commands/{arguments[1]}.py").exists()
    if "--config" in arguments:
        assert (REPOSITORY / arguments[arguments.index("--config") + 1]).exists()
    assert (service["ProtectSystem"], service["ProtectProc"]) == ("strict", "invisible")
    assert (service["NoNewPrivileges"], service["CapabilityBoundingSet"]) == ("yes", "")
    assert service["SupplementaryGroups"] == "tsttc-files"
    assert ("EnvironmentFile=/etc/tsttc-web.env" in path.read_text()) == (path.stem == "tsttc-web")
    assert (service["User"] == service["Group"] == "tsttc-web") == (path.stem == "tsttc-web")


def test_a_backup_that_fails_sends_a_mail() -> None:
    unit = (DEPLOY / "systemd/tsttc-backup.service").read_text()
    assert "\nOnFailure=tsttc-failure@%n.service\n" in unit
    assert "report_failure %i" in (DEPLOY / "systemd/tsttc-failure@.service").read_text()


def test_only_the_worker_can_read_the_ground_truth() -> None:
    web = (DEPLOY / "systemd/tsttc-web.service").read_text()
    worker = (DEPLOY / "systemd/tsttc-worker.service").read_text()
    hidden = re.findall(r"^InaccessiblePaths=(.*)$", web, re.MULTILINE)
    # The sums per recording are as private as the values, and the backup has the values.
    assert hidden == ["-/var/lib/tsttc/ground-truth -/var/lib/tsttc/bags -/srv/tsttc-backup"]
    assert "InaccessiblePaths=-/srv/tsttc-backup" in worker
    assert "ReadOnlyPaths=/var/lib/tsttc/ground-truth" in worker


@pytest.mark.parametrize("name", ["nginx.conf", "Caddyfile", "Caddyfile.host"])
def test_proxies_take_uploads_and_hide_the_figures(name: str) -> None:
    text = (DEPLOY / name).read_text()
    assert text.count("{") == text.count("}")
    assert "/submit/" in text
    assert "/api/v1/submissions" in text
    assert re.search(r"/metrics \{\s+(return|respond) 404", text)


@pytest.mark.parametrize("name", ["Caddyfile", "Caddyfile.host"])
def test_caddy_keeps_every_request_back_until_it_is_whole(name: str) -> None:
    text = (DEPLOY / name).read_text()
    # What compose sets where nobody says otherwise.
    text = text.replace("{$TSTTC_MAX_REQUEST_SIZE}", "21MB")
    passed_on = re.findall(r"max_size (\S+)\s+\}\s+reverse_proxy \S+ \{\s+request_buffers (\S+)\s+\}", text)
    assert len(passed_on) == text.count("reverse_proxy") == 2
    assert [buffer for size, buffer in passed_on if n_bytes(buffer) <= n_bytes(size)] == []
    assert re.search(r"timeouts \{[^}]*read_body \dm", text)


def n_bytes(text: str) -> int:
    """What Caddy understands by a size: "21MB"."""
    number, unit = re.fullmatch(r"(\d+)([KMG])B", text).groups()  # type: ignore[union-attr]  # else it fails
    return int(number) * {"K": 10**3, "M": 10**6, "G": 10**9}[unit]


def test_nginx_keeps_every_request_back_until_it_is_whole() -> None:
    text = (DEPLOY / "nginx.conf").read_text()
    assert re.findall(r"proxy_request_buffering (\w+);", text) == ["on"]
    assert "proxy_set_header X-Forwarded-Proto https;" in text


def test_no_proxy_passes_on_what_would_move_the_site() -> None:
    assert "underscores_in_headers off;" in (DEPLOY / "nginx.conf").read_text()
    for name in ("Caddyfile", "Caddyfile.host"):
        before, _, _ = (DEPLOY / name).read_text().partition("reverse_proxy")
        assert "\trequest_header -*_*\n" in before, name
