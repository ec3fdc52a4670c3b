"""What the environment says about the way to a server: its proxy and the certificates to trust."""

from __future__ import annotations

import ipaddress
import os
import ssl
from typing import Final
from urllib.parse import urlsplit
from urllib.request import getproxies, proxy_bypass

import httpx2

from evaluator.client.answers import BadSurroundings

LOOPBACK_HOSTS: Final = frozenset({"127.0.0.1", "::1", "localhost"})
CERTIFICATES: Final = ("SSL_CERT_FILE", "SSL_CERT_DIR")
_PROXY_SCHEMES: Final = ("http", "https", "socks5", "socks5h")


def proxy_for(url: str) -> httpx2.Proxy | None:
    """Return the proxy that the environment names for this address; raises BadSurroundings.

    A proxy from the environment never leads to this very machine.
    """
    address = _address_of_proxy(url)
    if not address:
        return None
    scheme, separator, rest = address.partition("://")
    if not separator:
        scheme, rest = "http", address
    # Desktops and curl write so; what listens there speaks version 5.
    scheme = "socks5h" if scheme.lower() == "socks" else scheme.lower()
    expected = "http://, https:// or socks5://, a host and a port"
    if scheme not in _PROXY_SCHEMES:
        raise _bad_proxy(address, url=url, expected=expected)
    try:
        proxy = httpx2.Proxy(f"{scheme}://{rest}")
    except (httpx2.InvalidURL, ValueError):
        raise _bad_proxy(address, url=url, expected=expected) from None
    if not proxy.url.host or any(character.isspace() for character in rest):
        raise _bad_proxy(address, url=url, expected=expected)
    return proxy


def certificates_for(url: str) -> ssl.SSLContext:
    """Return the certificates to trust: the system's, or those that the environment names.

    Raises BadSurroundings if those cannot be read.
    """
    if urlsplit(url).scheme == "http":
        return ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # reading all of them takes 40 ms
    try:
        return httpx2.create_ssl_context()
    except (OSError, ValueError) as error:
        named = next((name for name in CERTIFICATES if os.environ.get(name)), "")
        reason = getattr(error, "strerror", None) or str(error)
        raise BadSurroundings(
            url=url,
            reason=f"{named or 'The system'} names {os.environ.get(named, 'certificates')}, from which no "
            f"certificate can be read: {reason}",
            hint=f"Correct {named}, or remove it to trust the certificates of the system.",
        ) from None


def without_password(address: str) -> str:
    """Host and port of a proxy."""
    return address.rpartition("//")[2].rpartition("@")[2].rstrip("/")


def _address_of_proxy(url: str) -> str:
    site = urlsplit(url)
    host = site.hostname or ""
    if host in LOOPBACK_HOSTS or proxy_bypass(site.netloc.rpartition("@")[2]) or _is_in_a_network(host):
        return ""
    proxies = getproxies()
    return (proxies.get(site.scheme) or proxies.get("all") or "").strip()


def _is_in_a_network(host: str) -> bool:
    # Python's own rule knows names alone, curl's also networks such as 10.0.0.0/8.
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return False
    for entry in getproxies().get("no", "").split(","):
        try:
            if address in ipaddress.ip_network(entry.strip(), strict=False):
                return True
        except ValueError:
            continue
    return False


def _bad_proxy(address: str, *, url: str, expected: str) -> BadSurroundings:
    scheme, separator, _ = address.rpartition("//")
    shown = f"{scheme}{separator}{without_password(address)}"
    return BadSurroundings(
        url=url,
        reason=f"The environment names the proxy {shown!r} for {url}; expected {expected}",
        hint="Correct HTTPS_PROXY, HTTP_PROXY or ALL_PROXY, or name the host of the site in NO_PROXY.",
    )
