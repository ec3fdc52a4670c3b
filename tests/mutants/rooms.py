"""The rooms of the product, with the tests that are to notice a fault there."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Room:
    """Files or folders of the repository."""

    sources: tuple[str, ...]
    tests: tuple[str, ...]


_SITE = "leaderboard"
_PAGES = "tests/leaderboard/web"


def _of_site(name: str, *tests: str) -> Room:
    return Room((f"{_SITE}/{name}",), (f"tests/leaderboard/{name}", *tests))


ROOMS = {
    "api": _of_site("api", "tests/security/test_permissions.py", "tests/security/test_malformed_tokens.py"),
    "baselines": Room(("tsttc_baselines",), ("tests/tsttc_baselines",)),
    "boards": _of_site(
        "boards", "tests/leaderboard/api/test_board.py", "tests/leaderboard/statistics/test_confidence.py",
        f"{_PAGES}/boards", f"{_PAGES}/methods", "tests/leaderboard/methods",
    ),
    "charts": Room(
        (f"{_SITE}/web/charts", f"{_SITE}/web/compare"),
        (f"{_PAGES}/charts", f"{_PAGES}/compare", f"{_PAGES}/boards",
         "tests/leaderboard/api/test_compare.py"),
    ),
    "editions": _of_site("editions", f"{_PAGES}/maintain"),
    "evaluator-cli": Room(
        ("evaluator/cli", "evaluator/client"),
        ("tests/evaluator/cli", "tests/evaluator/client"),
    ),
    "metrics": Room(("evaluator/metrics",), ("tests/evaluator/metrics", "tests/evaluator/test_golden.py")),
    "models": Room(
        (f"{_SITE}/models", f"{_SITE}/audit.py", f"{_SITE}/board_versions.py"),
        ("tests/leaderboard/models", "tests/leaderboard/test_audit.py", "tests/leaderboard/submissions",
         "tests/leaderboard/boards", "tests/leaderboard/methods", "tests/leaderboard/people"),
    ),
    "moderation": _of_site(
        "moderation", "tests/leaderboard/people/test_accounts.py", "tests/leaderboard/people/test_teams.py",
        f"{_PAGES}/maintain", f"{_PAGES}/account",
    ),
    "people": _of_site("people", "tests/security/test_malformed_tokens.py", f"{_PAGES}/account"),
    "predictions": Room(("evaluator/predictions",), ("tests/evaluator/predictions", "tests/evaluator/cli")),
    "queue": _of_site("queue", "tests/leaderboard/sandbox", "tests/leaderboard/submissions"),
    "quotas": _of_site("quotas", "tests/leaderboard/submissions", "tests/leaderboard/api/test_quota.py"),
    "scoring": Room(("evaluator/scoring",), ("tests/evaluator/scoring", "tests/evaluator/test_golden.py")),
    "statistics": _of_site("statistics", "tests/leaderboard/editions/test_quoted_rows.py"),
    "storage": _of_site("storage", "tests/leaderboard/submissions", "tests/leaderboard/exports"),
    "submissions": _of_site(
        "submissions", "tests/leaderboard/api", f"{_PAGES}/submissions", "tests/leaderboard/quotas",
    ),
    "truth": Room(("evaluator/truth",), ("tests/evaluator/truth", "tests/evaluator/test_golden.py")),
}  # fmt: skip
