"""The one spelling of an email address, and the mailbox that it leads to.

One mailbox has any number of addresses: with quotes, with other letters that mean the same, with a suffix
after a plus sign. Whoever counts people counts mailboxes.
"""

import re
import unicodedata
from typing import Final

import idna

MAX_LENGTH: Final = 254
# What may stand before the @ without quotes. Mail servers take "%" and "!" for a route to another mailbox.
_PLAIN: Final = re.compile(r"[a-z0-9#$&'*+/=?^_`{|}~-]+(\.[a-z0-9#$&'*+/=?^_`{|}~-]+)*", re.ASCII)
_ATOMS: Final = re.compile(r"[!-~]+", re.ASCII)
_MUST_BE_QUOTED: Final = frozenset('"(),:;<>@[\\]')


def spelled(address: str) -> str:
    """Return the one spelling of an address: small letters, the domain in ASCII, no quotes without need.

    What is no address comes back in small letters. Whether a new account may have it says `fault_of`.

    >>> spelled(' "A\\\\da"@B\u00dccher.example. ')
    'ada@xn--bcher-kva.example'
    """
    text = unicodedata.normalize("NFKC", address).strip().lower()
    local, at, domain = text.rpartition("@")
    if not at:
        return text
    return f"{_unquoted(local)}@{_in_ascii(domain)}"


def fault_of(address: str) -> str:
    """Return why no new account may have this address, in its one spelling; empty if it may."""
    local, _, domain = address.rpartition("@")
    if len(address) > MAX_LENGTH:
        return f"The address has {len(address)} characters; expected at most {MAX_LENGTH}."
    if domain.startswith("["):
        return "The address has a number in brackets after the @; expected the name of a domain."
    if not domain.isascii():
        return "The domain of the address has characters that no domain has; expected its name."
    if local.startswith('"'):
        return "The part before the @ is in quotes; expected an address without quotes."
    if not _PLAIN.fullmatch(local):
        return (
            "The part before the @ has a character that this site does not accept there; expected letters "
            "without accents, digits, dots, and signs such as - _ +."
        )
    return ""


def mailbox_of(address: str) -> str:
    """Return the mailbox of an address: its one spelling, without what follows a plus sign before the @.

    So it is with nearly every provider. Dots stay: with most providers another dot is another mailbox.
    """
    local, at, domain = spelled(address).rpartition("@")
    is_quoted = local.startswith('"')
    content = _content(local) if is_quoted else local
    before = content.partition("+")[0] or content
    return f"{_quoted(before) if is_quoted else before}{at}{domain}"


def _unquoted(local: str) -> str:
    is_quoted = len(local) > 1 and local[0] == local[-1] == '"'
    return _quoted(_content(local)) if is_quoted else local


def _content(local: str) -> str:
    return re.sub(r"\\(.)", r"\1", local[1:-1], flags=re.DOTALL)


def _quoted(content: str) -> str:
    """Put the content of a quoted part into quotes again, where it needs them."""
    is_plain = _ATOMS.fullmatch(content) and not _MUST_BE_QUOTED & set(content)
    if is_plain and "" not in content.split("."):
        return content
    escaped = content.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _in_ascii(domain: str) -> str:
    # Mail servers look up the ASCII form, in which the letters of a domain are small.
    domain = domain.removesuffix(".")
    if domain.isascii():
        return domain
    try:
        return idna.encode(domain, uts46=True).decode("ascii")
    except idna.IDNAError:
        return domain
