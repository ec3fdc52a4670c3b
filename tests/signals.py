"""Signals for the children of tests: an ignored one stays ignored in every program that is started."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

ASKS_TO_END = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


@contextmanager
def default_signals() -> Iterator[None]:
    """Start children inside, from the main thread: they obey the signals that ask a program to end.

    A script's background job ignores SIGINT and SIGQUIT, `nohup` SIGHUP, and so would all that they start.
    """
    ignored = [number for number in ASKS_TO_END if signal.getsignal(number) is signal.SIG_IGN]
    for number in ignored:
        signal.signal(number, signal.SIG_DFL)
    try:
        yield
    finally:
        for number in ignored:
            signal.signal(number, signal.SIG_IGN)
