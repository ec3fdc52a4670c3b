"""The upload handler: an upload goes to a file without a name, which vanishes with its process.

Django's own temporary files have names: those of a process that is killed stay, and those that a full disk
interrupts go on filling it until the garbage collector comes by.
"""

import tempfile
from contextlib import suppress
from typing import Any

from django.core.files.uploadedfile import UploadedFile
from django.core.files.uploadhandler import FileUploadHandler


class UnnamedFileUploadHandler(FileUploadHandler):
    """Streams an upload to the disk. Gives back its room at once if the disk is full."""

    file: UploadedFile
    is_open = False

    def new_file(self, *args: Any, **kwargs: Any) -> None:
        """Begin a file."""
        super().new_file(*args, **kwargs)
        self.file = UploadedFile(
            tempfile.TemporaryFile(),  # noqa: SIM115 - the request closes it, or else this handler
            self.file_name,
            self.content_type,
            0,
            self.charset,
            self.content_type_extra,
        )
        self.is_open = True

    def receive_data_chunk(self, raw_data: bytes, start: int) -> None:
        """Write a part of it. Raises `OSError` if there is no room."""
        try:
            self.file.write(raw_data)
        except OSError:
            self.upload_interrupted()
            raise

    def file_complete(self, file_size: int) -> UploadedFile:
        """The whole file, from its beginning. Raises `OSError` if there is no room."""
        try:
            self.file.seek(0)
        except OSError:
            self.upload_interrupted()
            raise
        self.file.size = file_size
        self.is_open = False  # the request closes it
        return self.file

    def upload_interrupted(self) -> None:
        """Forget what has come so far."""
        # Closing writes what is still in memory, for which there may be no room either.
        with suppress(OSError):
            self.file.close()
        self.is_open = False

    def __del__(self) -> None:
        """Close what nobody else does: of a request that could not be read on, no handler is told."""
        if self.is_open:
            self.upload_interrupted()
