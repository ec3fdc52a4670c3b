"""How the suite is spread over processes: files stay together, those that take long come first.

Otherwise a file of one test that takes a minute is begun last, and the other processes wait for it.
"""

from collections import Counter

import pytest

# xdist's own order puts files with few tests last.
OPTIONS = ("--dist", "loadfile", "--no-loadscope-reorder")
# The longest first.
LONG = (
    "tests/chaos/",
    "tests/journeys/test_rescoring_under_load.py",
    "tests/journeys/",
    "tests/browser/",
    "tests/security/",
    "tests/leaderboard/db/",
    "tests/leaderboard/queue/",
    "tests/leaderboard/sandbox/",
)


def sort(items: list[pytest.Item]) -> None:
    """Long files first, the others by their number of tests; within a file nothing changes."""
    n_tests = Counter(_file_of(item) for item in items)

    def sort_key(item: pytest.Item) -> tuple[int, int, str]:
        name = _file_of(item)
        matches = [i for i, long in enumerate(LONG) if name.startswith(long)]
        return (matches[0] if matches else len(LONG), -n_tests[name], name)

    items.sort(key=sort_key)


def asks_database(item: pytest.Item) -> bool:
    """Whether the test may ask a database."""
    names = {"db", "transactional_db", "live_server"} & set(getattr(item, "fixturenames", ()))
    return bool(names) or item.get_closest_marker("django_db") is not None


def _file_of(item: pytest.Item) -> str:
    return item.nodeid.partition("::")[0]
