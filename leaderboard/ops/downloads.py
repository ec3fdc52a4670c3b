"""Answers that are files: a few large ones at a time in each process.

An answer that nobody reads holds its thread. What fits into the buffers of a connection never does.
"""

import threading
from typing import IO, Any, Final

from django.http import FileResponse

MOST_AT_ONCE: Final = 2
SMALL_BYTES: Final = 1_000_000

_slots: Final = threading.BoundedSemaphore(MOST_AT_ONCE)


class TooManyDownloads(Exception):
    """This process sends as many large files as it may."""


class _LargeFile(FileResponse):
    is_sent = False

    def close(self) -> None:
        super().close()
        if not self.is_sent:
            self.is_sent = True
            _slots.release()


def file_response(file: IO[bytes], *, n_bytes: int, **options: Any) -> FileResponse:
    """Answer a file of that size. Raises `TooManyDownloads`."""
    if n_bytes <= SMALL_BYTES:
        return FileResponse(file, **options)
    if not _slots.acquire(blocking=False):
        file.close()
        raise TooManyDownloads
    return _LargeFile(file, **options)
