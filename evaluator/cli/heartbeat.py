"""Signs of life in a pipe: a line on standard error wherever nothing was heard of for five seconds.

A terminal has bars and spinners; the log of a job has nothing but lines, and silence looks like a hang.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Final

import click

EVERY_S: Final = 5.0


@contextmanager
def signs_of_life(waiting_for: str, *, every_s: float = EVERY_S) -> Iterator[None]:
    """While this lasts, say every `every_s` seconds what the command waits for; not on a terminal."""
    if sys.stderr.isatty():
        yield
        return
    is_over = threading.Event()
    stream: IO[str] = sys.stderr

    def tell() -> None:
        n_told = 0
        while not is_over.wait(every_s):
            n_told += 1
            click.echo(f"Waiting for {waiting_for} ({n_told * every_s:.0f} s) …", file=stream)

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        is_over.set()
        teller.join()
