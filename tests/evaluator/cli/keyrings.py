"""Keyrings for tests: one that remembers, and what a machine without a desktop has."""

from __future__ import annotations

from keyring.backend import KeyringBackend
from keyring.backends.fail import Keyring as NoKeyring
from keyring.errors import PasswordDeleteError, PasswordSetError

__all__ = ["LockedKeyring", "NoKeyring", "RememberingKeyring"]


class RememberingKeyring(KeyringBackend):
    """Keep tokens for as long as the test runs."""

    priority = 1  # type: ignore[assignment]  # a property of the class in keyring, a plain number in its backends

    def __init__(self) -> None:
        super().__init__()
        self.kept: dict[tuple[str, str], str] = {}

    @property
    def name(self) -> str:
        return "A keyring of the tests"

    def get_password(self, service: str, username: str) -> str | None:
        return self.kept.get((service, username))

    def set_password(self, service: str, username: str, password: str) -> None:
        self.kept[service, username] = password

    def delete_password(self, service: str, username: str) -> None:
        if self.kept.pop((service, username), None) is None:
            raise PasswordDeleteError("not found")


class LockedKeyring(RememberingKeyring):
    """Refuse every token, as a keyring that its owner does not unlock."""

    def set_password(self, service: str, username: str, password: str) -> None:
        raise PasswordSetError("the collection is locked")
