"""The upload handler: an upload goes to an unnamed file, which ends with its process."""

import tempfile
from contextlib import suppress
from typing import Any

from django.core.files.uploadedfile import UploadedFile
from django.core.files.uploadhandler import FileUploadHandler, TemporaryFileUploadHandler

from leaderboard.storage import files


class UnnamedFileUploadHandler(TemporaryFileUploadHandler):
    # Frees its room at once if the disk is full.
    def new_file(self, *args: Any, **kwargs: Any) -> None:
        FileUploadHandler.new_file(self, *args, **kwargs)
        # Python says that a folder for unfinished files is not found when none can be written to.
        with files.answering(may_lack=False):
            file = tempfile.TemporaryFile()  # noqa: SIM115 - the request closes it, or else this handler
        self.file = UploadedFile(  # type: ignore[assignment]  # Django's has a name
            file, self.file_name, self.content_type, 0, self.charset, self.content_type_extra
        )

    def receive_data_chunk(self, raw_data: bytes, start: int) -> None:
        try:
            self.file.write(raw_data)
        except OSError:
            self.upload_interrupted()
            raise

    def upload_interrupted(self) -> None:
        # Closing writes what is still in memory, for which there may be no room either.
        with suppress(OSError, AttributeError):
            self.file.close()

    # No handler hears of a request that could not be read to its end.
    __del__ = upload_interrupted
