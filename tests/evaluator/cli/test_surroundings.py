"""Proxies and certificates that the environment names: used where possible, else named in a sentence."""

from __future__ import annotations

import datetime
import select
import socket
import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

from evaluator.client.answers import Unreachable
from evaluator.client.api import Client
from evaluator.client.surroundings import proxy_for
from tests.evaluator.cli.recorded_site import RecordedSite, Reply
from tests.evaluator.fake_time import FakeTime
from tests.evaluator.worlds import Tsttc

SITE = "http://leaderboard.example"
BOARD = "GET /api/v1/splits/val/board"
EMPTY = Reply({"split": "val", "entries": []})


@contextmanager
def socks_proxy(port: int) -> Iterator[tuple[str, list[str]]]:
    """A SOCKS5 proxy (RFC 1928) for one connection, which leads to this port; with the hosts asked for."""
    asked: list[str] = []
    listener = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        near, _ = listener.accept()
        with near, socket.create_connection(("127.0.0.1", port)) as far:
            near.recv(3)
            near.sendall(b"\x05\x00")
            head = near.recv(5)
            host = near.recv(head[4])
            near.recv(2)
            asked.append(host.decode())
            near.sendall(b"\x05\x00\x00\x01\x7f\x00\x00\x01\x00\x00")
            while True:
                readable, _, _ = select.select([near, far], [], [])
                data = readable[0].recv(65_536)
                if not data:
                    return
                (far if readable[0] is near else near).sendall(data)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield f"127.0.0.1:{listener.getsockname()[1]}", asked
    finally:
        thread.join()
        listener.close()


@pytest.mark.parametrize("scheme", ["socks5", "socks5h", "socks", "SOCKS5"])
def test_socks_proxy_is_used_and_resolves_the_name(
    tsttc: Tsttc, site: RecordedSite, monkeypatch: pytest.MonkeyPatch, scheme: str
) -> None:
    site.put(BOARD, EMPTY)
    with socks_proxy(int(site.url.rpartition(":")[2])) as (address, asked):
        monkeypatch.setenv("all_proxy", f"{scheme}://{address}")
        result = tsttc("board", "val", "--server", SITE)
    assert result.exit_code == 0, result.stderr
    assert asked == ["leaderboard.example"]


@pytest.mark.parametrize("variable", ["ALL_PROXY", "http_proxy"])
@pytest.mark.parametrize(
    "proxy",
    ["ftp://me:secret@127.0.0.1:21", "socks4://127.0.0.1:1080", "http://[::1", "::::", "http://:80", "a b"],
)
def test_proxy_that_nobody_can_use_is_a_sentence_without_its_password(
    tsttc: Tsttc, monkeypatch: pytest.MonkeyPatch, variable: str, proxy: str
) -> None:
    monkeypatch.setenv(variable, proxy)
    result = tsttc("board", "val", "--server", SITE, "--timeout", "0.1")
    assert result.exit_code == 3
    assert result.stderr.startswith("Error: The environment names the proxy ")
    assert "NO_PROXY" in result.stderr
    assert "secret" not in result.stderr


@pytest.mark.parametrize(
    "no_proxy", ["leaderboard.example", ".example", "*", "10.0.0.0/8,leaderboard.example"]
)
@pytest.mark.parametrize("proxy", ["ftp://127.0.0.1:21", "http://[::1", "socks5://127.0.0.1:9"])
def test_host_that_no_proxy_names_needs_none(
    monkeypatch: pytest.MonkeyPatch, no_proxy: str, proxy: str
) -> None:
    monkeypatch.setenv("ALL_PROXY", proxy)
    monkeypatch.setenv("NO_PROXY", no_proxy)
    assert proxy_for("https://leaderboard.example") is None


def test_network_that_no_proxy_names_needs_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ALL_PROXY", "socks5://127.0.0.1:9")
    monkeypatch.setenv("NO_PROXY", "10.0.0.0/8, 2001:db8::/32")
    assert proxy_for("https://10.1.2.3:8000") is None
    assert proxy_for("https://[2001:db8::5]") is None
    assert proxy_for("https://11.1.2.3") is not None


def certified(folder: Path) -> Path:
    """A file with a certificate for 127.0.0.1 by its own authority, and its key."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "localhost")])
    begins = datetime.datetime(2020, 1, 1, tzinfo=datetime.UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(1)
        .not_valid_before(begins)
        .not_valid_after(begins.replace(year=2100))
        .add_extension(x509.SubjectAlternativeName([x509.DNSName("localhost")]), critical=False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), critical=True)
        .sign(key, hashes.SHA256())
    )
    path = folder / "both.pem"
    private = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    path.write_bytes(certificate.public_bytes(serialization.Encoding.PEM) + private)
    return path


@contextmanager
def tls_site(pem: Path) -> Iterator[str]:
    with RecordedSite() as running:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(pem)
        running.wrap(context)
        running.put(BOARD, EMPTY)
        yield running.url.replace("http://127.0.0.1", "https://localhost")


def test_untrusted_certificate_is_named_and_can_be_trusted(
    tsttc: Tsttc, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pem = certified(tmp_path)
    with tls_site(pem) as url:
        result = tsttc("board", "val", "--server", url)
        assert result.exit_code == 3
        assert f"does not trust the certificate of {url} (self-signed certificate)." in result.stderr
        assert "export SSL_CERT_FILE=" in result.stderr
        monkeypatch.setenv("SSL_CERT_FILE", str(pem))
        assert tsttc("board", "val", "--server", url).exit_code == 0


@pytest.mark.parametrize("text", [None, "", "-----BEGIN"])
def test_certificates_that_cannot_be_read_are_named(
    tsttc: Tsttc, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str | None
) -> None:
    path = tmp_path / "ca.pem"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    monkeypatch.setenv("SSL_CERT_FILE", str(path))
    result = tsttc("board", "val", "--server", "https://leaderboard.example")
    assert result.exit_code == 3
    assert result.stderr.startswith(
        f"Error: SSL_CERT_FILE names {path}, from which no certificate can be read"
    )


def test_server_without_tls_is_named_as_one(tsttc: Tsttc, site: RecordedSite) -> None:
    result = tsttc("board", "val", "--server", site.url.replace("http:", "https:"))
    assert result.exit_code == 3
    assert " answers, but not over TLS (" in result.stderr
    assert "http://" in result.stderr


def test_name_that_no_name_server_knows_is_not_asked_for_again(clock: FakeTime) -> None:
    with (
        Client(url="http://leaderboard.invalid", sleep=clock.sleep) as client,
        pytest.raises(Unreachable) as caught,
    ):
        client.splits()
    # Without any name server the question may be worth asking again.
    assert caught.value.is_lasting == (clock.slept_s == [])
