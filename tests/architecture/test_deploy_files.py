"""The example files in deploy/ name what there is: programs, addresses, figures."""

import configparser
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml
from django.conf import settings

from leaderboard.celery import app
from leaderboard.errors import problem_codes

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
    assert "set $tsttc_web web:8000;" in (DEPLOY / "nginx.compose.conf").read_text()


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


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd is not installed")
def test_systemd_understands_every_line_of_the_units(tmp_path: Path) -> None:
    for path in (DEPLOY / "systemd").iterdir():
        # Without what only a server has: the program, the project, the environment files.
        text = re.sub(r"(?m)^(EnvironmentFile|WorkingDirectory)=.*\n", "", path.read_text())
        text = re.sub(r"/opt/tsttc/bin/\w+", "/bin/true", text)
        (tmp_path / path.name.replace("@.", "@x.")).write_text(text)
        (tmp_path / path.name).write_text(text)
    named = sorted(str(path) for path in tmp_path.iterdir() if "@." not in path.name)
    assert len(named) == 5
    command = ["systemd-analyze", "verify", "--man=no", "--recursive-errors=no"]
    done = subprocess.run([*command, *named], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    # It does find what it does not know.
    for unit_path in named[:2]:
        Path(unit_path).write_text(f"[Unit]\nDescripton=x\n{Path(unit_path).read_text()}")
    done = subprocess.run([*command, *named], capture_output=True, text=True, check=False)
    assert done.stderr.count("Descripton") >= 2


@pytest.mark.parametrize("name", ["tsttc-web", "tsttc-worker"])
def test_processes_that_serve_come_back_and_have_time_to_end(name: str) -> None:
    service = service_of(name)
    assert service["Restart"] == "always"
    grace_s = app.conf.worker_soft_shutdown_timeout
    longest_s = {"tsttc-web": graceful_timeout_s(), "tsttc-worker": grace_s}[name]
    assert int(service["TimeoutStopSec"]) > longest_s
    assert "\nWantedBy=multi-user.target" in (DEPLOY / f"systemd/{name}.service").read_text()


def service_of(name: str) -> configparser.SectionProxy:
    unit = configparser.RawConfigParser(strict=False)
    unit.optionxform = str  # type: ignore[assignment]  # systemd's own letters
    unit.read(DEPLOY / f"systemd/{name}.service")
    return unit["Service"]


def graceful_timeout_s() -> int:
    found = re.search(r"^graceful_timeout = (\d+)$", (DEPLOY / "gunicorn.conf.py").read_text(), re.MULTILINE)
    assert found
    return int(found[1])


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


NGINX = ("nginx.conf", "nginx.compose.conf")
RULES = (DEPLOY / "nginx-rules.conf").read_text()


@pytest.mark.parametrize("name", ["nginx-rules.conf", *NGINX, "Caddyfile"])
def test_files_of_proxies_close_what_they_open(name: str) -> None:
    text = re.sub(r"#.*|'[^']*'|\"[^\"]*\"", "", (DEPLOY / name).read_text())
    assert text.count("{") == text.count("}") > 0


def test_nginx_keeps_whole_requests_and_answers_and_counts_them_for_each_visitor() -> None:
    assert re.findall(r"proxy_(?:request_)?buffering (\w+);", RULES) == ["on", "on"]
    for address in ("/submit/", "/api/v1/submissions"):
        [rules] = re.findall(rf"location = {address} \{{(.*?)\}}", RULES, re.DOTALL)
        assert "client_max_body_size 21m;" in rules
        # Named here, each: a `limit_conn` of a location takes the place of those around it.
        assert re.findall(r"limit_conn (\w+) \d+;", rules) == ["tsttc_requests", "tsttc_uploads"]
    assert re.search(r"location = /metrics \{\s+return 404", RULES)
    for name in NGINX:
        text = (DEPLOY / name).read_text()
        assert text.count("nginx-rules.conf;") == 1
        assert set(re.findall(r"zone=(\w+):", text)) == {"tsttc_requests", "tsttc_uploads"}


def test_caddy_keeps_no_request_and_passes_everything_to_nginx() -> None:
    text = (DEPLOY / "Caddyfile").read_text()
    assert "request_buffers" not in text
    assert set(re.findall(r"reverse_proxy (\S+)", text)) == {"buffer:8080"}
    assert "listen 8080;" in (DEPLOY / "nginx.compose.conf").read_text()


@pytest.mark.parametrize("name", ["nginx-rules.conf", "nginx.conf"])
def test_what_nginx_answers_itself_are_problem_documents_below_api_and_pages_elsewhere(name: str) -> None:
    text = (DEPLOY / name).read_text()
    answers = re.findall(r"default_type (\S+);[^{}]*return (\d+) '(.*)\\n';", text)
    assert len(answers) == text.count("default_type") > 0
    for media_type, status, body in answers:
        if media_type == "text/html":
            assert re.search(r"<h1>.*</h1><p>.*[.]", body)
            continue
        assert media_type == problem_codes.MEDIA_TYPE
        document = json.loads(body.replace("https://$host", settings.SITE_URL))
        assert int(status) in problem_codes.STATUSES[document["code"]]
        assert document == problem_codes.document(
            status=int(status),
            code=document["code"],
            detail=document["detail"],
            where=document["problems"][0]["where"],
        )


def test_what_is_too_large_is_answered_with_the_limit_and_with_gzip() -> None:
    large = re.findall(r"return 413 '(.*)'", RULES)
    assert len(large) == 2
    limit = f"{settings.MAX_PREDICTIONS_BYTES // 10**6} MB"
    assert [text for text in large if limit not in text or "gzip" not in text] == []


def test_http_is_not_redirected_below_api() -> None:
    caddy = (DEPLOY / "Caddyfile").read_text().partition("http://{$TSTTC_SITE_HOST} {")[2]
    assert re.match(r".*handle /api/\* \{\s+reverse_proxy.*handle \{\s+redir", caddy, re.DOTALL)
    http = (DEPLOY / "nginx.conf").read_text().partition("listen 443")[0]
    assert re.search(r"location /api/ \{[^{}]*return 403 .*https-required", http)
    # nginx looks at the size before anything else.
    assert "client_max_body_size 0;" in http


@pytest.mark.skipif(shutil.which("nginx") is None, reason="nginx is not installed")
@pytest.mark.parametrize("name", NGINX)
def test_nginx_understands_its_files(name: str, tmp_path: Path) -> None:
    text = (DEPLOY / name).read_text()
    # Without what only a server has: a certificate, ports, names of containers.
    text = re.sub(r"ssl_certificate\S* .*;|listen \[::\].*;", "", text).replace(
        "listen 443 ssl;", "listen 8443;"
    )
    text = text.replace("listen 80;", "listen 8088;")
    text = re.sub(r"include \S+/nginx-rules.conf;", f"include {DEPLOY / 'nginx-rules.conf'};", text)
    text = re.sub(r"(/tmp|/var/lib/tsttc/buffers)/(?=[a-z])", f"{tmp_path}/", text)
    if "http {" not in text:
        folders = "".join(
            f"{kind}_temp_path {tmp_path}/{kind};"
            for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
        )
        text = f"pid {tmp_path}/pid; events {{}} http {{ {folders} access_log off; {text} }}"
    path = tmp_path / "whole.conf"
    path.write_text(text)
    command = ["nginx", "-t", "-e", str(tmp_path / "early"), "-c", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_no_proxy_passes_on_what_would_move_the_site() -> None:
    assert "underscores_in_headers off;" in RULES
    assert "proxy_set_header X-Forwarded-Proto $tsttc_scheme;" in RULES
    assert "set $tsttc_scheme https;" in (DEPLOY / "nginx.conf").read_text()
    _, _, https = (DEPLOY / "Caddyfile").read_text().partition("https://{$TSTTC_SITE_HOST} {")
    assert "\trequest_header -*_*\n" in https.partition("reverse_proxy")[0]
