"""The progress of a run: a bar with rate and time left on a terminal, elsewhere a line every few seconds."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

import click

EVERY_S: Final = 5.0
FIRST_S: Final = 1.0


@contextmanager
def shown_progress(title: str, *, total: int) -> Iterator[Callable[[int], None]]:
    """Yield a function to call at least every second with the number of finished sequences."""
    if not sys.stderr.isatty():
        yield _Lines(total).show
        return
    from rich.console import Console  # noqa: PLC0415 -- only a terminal needs it
    from rich.progress import (  # noqa: PLC0415 -- as above
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text  # noqa: PLC0415 -- as above

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(f"{task.finished_speed or task.speed or 0:,.0f}/s")

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        Rate(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=None)

        def show(n_done: int) -> None:
            if bar.tasks[0].total is None:  # the first call: what an earlier run has done is no speed
                bar.reset(task, total=total, completed=n_done)
            bar.update(task, completed=n_done)

        yield show


class _Lines:
    """Progress as lines on standard error, none in a short run."""

    def __init__(self, total: int) -> None:
        self._total = total
        self._began_s = self._shown_s = time.monotonic()
        self._n_first: int | None = None
        self._wait_s = FIRST_S

    def show(self, n_done: int) -> None:
        now_s = time.monotonic()
        if self._n_first is None:
            self._n_first, self._began_s = n_done, now_s
        if now_s - self._shown_s < self._wait_s:
            return
        self._shown_s, self._wait_s = now_s, EVERY_S
        per_s = (n_done - self._n_first) / max(now_s - self._began_s, 1e-9)
        rate = f", {per_s:,.1f}/s, {(self._total - n_done) / per_s:,.0f} s left" if per_s > 0 else ""
        click.echo(f"{n_done:,} of {self._total:,} sequences{rate}", err=True)
