"""The broker made of files, for `make demo` and the tests: kombu's, but that nothing is seen half written.

kombu opens a file and then writes it. A worker that looks in between finds no message in it, and ends.
"""

import fcntl
import os
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from kombu.exceptions import ChannelError
from kombu.transport import filesystem
from kombu.utils.json import dumps


class Channel(filesystem.Channel):
    """Messages and tables of queues that are there whole, or not at all."""

    def _put(self, queue: str, message: Any, **_: Any) -> None:  # type: ignore[override]  # as kombu's own
        """Put a message into a queue."""
        name = f"{round(time.monotonic() * 1000)}_{uuid.uuid4()}.{queue}.msg"
        try:
            _appear(Path(self.data_folder_out, name), dumps(message))
        except OSError as fault:
            raise ChannelError(f"Cannot add {name} to the folder of messages") from fault

    def _queue_bind(self, exchange: str, routing_key: str, pattern: str | None, queue: str) -> None:
        """Write down that a queue belongs to an exchange, in a table that is there before it is locked."""
        table: Path = self._exchange_file(exchange)  # type: ignore[attr-defined]  # not in its types yet
        try:
            with _alone_in(self.control_folder):
                if not table.exists():
                    _appear(table, "[]")
        except OSError as fault:
            raise ChannelError(f"Cannot make {table.name}") from fault
        super()._queue_bind(exchange, routing_key, pattern, queue)


class Transport(filesystem.Transport):
    """What a URL `filesystem://` stands for here."""

    Channel = Channel


def _appear(path: Path, text: str) -> None:
    """Make a file with its whole content."""
    # Under no name that a worker takes for a message's.
    unseen = path.with_name(f".{path.name}.part")
    unseen.write_text(text)
    unseen.replace(path)


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Nobody else who asks for the same is there meanwhile."""
    folder.mkdir(exist_ok=True)
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
