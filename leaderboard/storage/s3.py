"""The file store in an S3-compatible service.

Configured by one URL, `s3://bucket/folder?endpoint=https://…&region=…`; keys come from the environment or the
machine's role, never from the URL.
"""

import errno
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from typing import Any
from urllib.parse import parse_qsl, urlsplit

from botocore.config import Config
from botocore.exceptions import BotoCoreError, ClientError
from django.core.exceptions import ImproperlyConfigured
from django.core.files.base import File
from storages.backends.s3 import S3Storage
from storages.utils import clean_name

from leaderboard.storage.files import StoreUnavailable

CONNECT_TIMEOUT_S = 3
READ_TIMEOUT_S = 15
_FULL = frozenset({"InsufficientStorage", "QuotaExceeded", "XMinioStorageFull", "507"})


def parsed(url: str) -> dict[str, str | None]:
    """Parse `s3://bucket/folder?endpoint=…&region=…`. Raises `ImproperlyConfigured`."""
    parts = urlsplit(url)
    if "@" in parts.netloc:
        raise ImproperlyConfigured(
            "TSTTC_FILES_URL has a key in it; expected s3://bucket/folder, and the key in AWS_ACCESS_KEY_ID "
            "and AWS_SECRET_ACCESS_KEY."
        )
    options = dict(parse_qsl(parts.query))
    unknown = options.keys() - {"endpoint", "region"}
    if parts.scheme != "s3" or not parts.netloc or unknown:
        raise ImproperlyConfigured(
            f"TSTTC_FILES_URL is {url!r}; expected s3://bucket/folder?endpoint=https://…&region=…, of which "
            "folder, endpoint and region may be left out."
        )
    return {
        "bucket_name": parts.netloc,
        "location": parts.path.strip("/"),
        "endpoint_url": options.get("endpoint"),
        "region_name": options.get("region", "us-east-1"),
    }


@contextmanager
def _as_os_errors() -> Iterator[None]:
    """Turn the client's many exceptions into `OSError`s, as a disk would raise."""
    try:
        yield
    except ClientError as fault:
        code = str(fault.response.get("Error", {}).get("Code", ""))
        if code in {"404", "NoSuchKey", "NotFound"}:
            raise FileNotFoundError(errno.ENOENT, "the file store does not have the file") from fault
        if code in _FULL:
            raise OSError(errno.ENOSPC, "the file store is full") from fault
        raise StoreUnavailable(errno.EIO, f"the file store refused ({code})") from fault
    except BotoCoreError as fault:
        raise StoreUnavailable(
            errno.EIO, f"the file store does not answer ({type(fault).__name__})"
        ) from fault


class S3FileStore(S3Storage):
    """A bucket whose objects are whole or absent; every failure is an `OSError`."""

    def __init__(self, *, url: str) -> None:
        address = parsed(url)
        super().__init__(
            **address,
            default_acl=None,
            file_overwrite=True,  # equal names hold equal bytes here
            client_config=Config(
                signature_version="s3v4",
                # Servers of one's own seldom have a host name for each bucket.
                s3={
                    "addressing_style": "path" if address["endpoint_url"] else "auto",
                    # The server compares the body with its digest, whether or not TLS is there.
                    "payload_signing_enabled": True,
                },
                # The newer checksum headers are refused by many compatible servers.
                request_checksum_calculation="when_required",
                response_checksum_validation="when_required",
                connect_timeout=CONNECT_TIMEOUT_S,
                read_timeout=READ_TIMEOUT_S,
                retries={"mode": "standard", "total_max_attempts": 2},
            ),
        )

    @property
    def _client(self) -> Any:
        # One client for each thread.
        return self.connection.meta.client

    def _target(self, name: str) -> dict[str, str]:
        return {"Bucket": self.bucket_name, "Key": self._normalize_name(clean_name(name))}

    def _save(self, name: str, content: "File[bytes]") -> str:
        content.seek(0)
        with _as_os_errors():
            self._client.put_object(
                **self._target(name), Body=content, ContentType="application/octet-stream"
            )
        return name

    def _open(self, name: str, mode: str = "rb") -> "File[bytes]":
        # A local file with a real file descriptor, whole before anybody reads it.
        if mode != "rb":
            raise ValueError(f"files of the store are opened with mode 'rb', not {mode!r}")
        local = tempfile.TemporaryFile()  # noqa: SIM115 - the caller closes it
        try:
            with _as_os_errors():
                shutil.copyfileobj(self._client.get_object(**self._target(name))["Body"], local)
        except BaseException:
            local.close()
            raise
        local.seek(0)
        return File(local, name)

    def exists(self, name: str) -> bool:
        with _as_os_errors():
            return bool(super().exists(name))

    def delete(self, name: str) -> None:
        with _as_os_errors():
            super().delete(name)

    def delete_if_older(self, name: str, than: datetime) -> bool:
        """Remove a file unless it was written after `than`. Returns whether it was removed.

        S3 has no rename, so a file written between check and removal is removed too; its writer looks again
        before a row names it (`leaderboard/storage/orphans.py`).
        """
        if self.get_modified_time(name) >= than:
            return False
        self.delete(name)
        return True

    def listdir(self, name: str) -> tuple[list[str], list[str]]:
        with _as_os_errors():
            folders, names = super().listdir(name)
        return folders, names

    def size(self, name: str) -> int:
        with _as_os_errors():
            return int(self._client.head_object(**self._target(name))["ContentLength"])

    def get_modified_time(self, name: str) -> datetime:
        with _as_os_errors():
            modified: datetime = self._client.head_object(**self._target(name))["LastModified"]
        return modified
