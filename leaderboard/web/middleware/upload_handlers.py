"""The upload handler: an upload goes to a file without a name, which vanishes with its process.

Django's own temporary files have names: those of a process that is killed stay, and those that a full disk
interrupts go on filling it until the garbage collector comes by.
"""

import tempfile
from contextlib import suppress
from typing import Any

from django.core.files.uploadedfile import UploadedFile
from django.core.files.uploadhandler import FileUploadHandler, TemporaryFileUploadHandler


class UnnamedFileUploadHandler(TemporaryFileUploadHandler):
    """Streams an upload to the disk. Gives back its room at once if the disk is full."""

    def new_file(self, *args: Any, **kwargs: Any) -> None:
        """Begin a file."""
        FileUploadHandler.new_file(self, *args, **kwargs)
        file = tempfile.TemporaryFile()  # noqa: SIM115 - the request closes it, or else this handler
        self.file = UploadedFile(  # type: ignore[assignment]  # Django's has a name
            file, self.file_name, self.content_type, 0, self.charset, self.content_type_extra
        )

    def receive_data_chunk(self, raw_data: bytes, start: int) -> None:
        """Write a part of it. Raises `OSError` if there is no room."""
        try:
            self.file.write(raw_data)
        except OSError:
            self.upload_interrupted()
            raise

    def upload_interrupted(self) -> None:
        """Forget what has come so far."""
        # Closing writes what is still in memory, for which there may be no room either.
        with suppress(OSError, AttributeError):
            self.file.close()

    # No handler hears of a request that could not be read to its end.
    __del__ = upload_interrupted
