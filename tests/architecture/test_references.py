"""Documents and docstrings name modules that are there."""

import re

from tests.services import REPOSITORY

PATH = re.compile(
    r"`((?:leaderboard|evaluator|baselines|tests|benchmarks|examples|docs|deploy)/[\w./-]+\.(?:py|md|yml|html|csv))`"
)


def test_files_that_documents_and_docstrings_name_are_there() -> None:
    sources = [*REPOSITORY.glob("*.md"), *REPOSITORY.glob("docs/**/*.md")]
    sources += [
        path
        for folder in ("leaderboard", "evaluator", "baselines", "tests")
        for path in (REPOSITORY / folder).rglob("*.py")
    ]
    missing = [
        f"{source.relative_to(REPOSITORY)}: {name}"
        for source in sources
        if source.name not in {"CHANGELOG.md", "peers.md"}  # the past, and files of other projects
        for name in PATH.findall(source.read_text(encoding="utf-8"))
        if not (REPOSITORY / name).exists() and not (REPOSITORY / "tests" / name).exists()
    ]
    assert missing == []
