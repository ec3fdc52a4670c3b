"""Documents name what is there: links, headings, modules, packages; and none is left out of a list."""

import re
from urllib.parse import unquote

from leaderboard.web.docs import guides
from tests.services import REPOSITORY

DOCS = REPOSITORY / "docs"
LINK = re.compile(r"\]\((?!https?:|mailto:)([^)#\s]*)(?:#([^)\s]*))?\)")
PATH = re.compile(
    r"`((?:leaderboard|evaluator|tsttc_baselines|tests|benchmarks|examples|docs|deploy)/[\w./-]+\.(?:py|md|yml|html|csv))`"
)
CODE = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)


def test_every_link_of_a_document_leads_to_a_file_and_a_heading_in_it() -> None:
    names = {path: name for name, path in guides.files().items()}
    broken = []
    for source in (*REPOSITORY.glob("*.md"), *guides.files().values()):
        for address, anchor in LINK.findall(CODE.sub("", source.read_text(encoding="utf-8"))):
            target = (source.parent / unquote(address)).resolve() if address else source
            name = names.get(target)
            anchors = {part.heading.anchor for part in guides.guide(name).parts} if name else set()
            if not target.exists() or (anchor and anchor not in anchors):
                broken.append(f"{source.relative_to(REPOSITORY)}: {address}#{anchor}")
    assert broken == []


def test_no_command_checks_out_a_release_that_a_copy_may_not_have() -> None:
    """A newcomer runs it before the first release; the tag that a release makes is no such command."""
    sources = (*REPOSITORY.glob("*.md"), *DOCS.glob("*.md"), *(REPOSITORY / "deploy").glob("*.*"))
    named = [
        f"{source.relative_to(REPOSITORY)}: {line.strip()}"
        for source in sources
        for line in source.read_text(encoding="utf-8").splitlines()
        if re.search(r"(git (checkout|clone|switch)|--branch).*\bv\d", line)
    ]
    assert named == []


def test_every_document_is_in_the_navigation_and_every_decision_in_its_list() -> None:
    listed = {entry.name for _, links in guides.navigation() for entry in links}
    decisions = (DOCS / "adr" / "README.md").read_text(encoding="utf-8")
    names = {path: name for name, path in guides.files().items()}
    assert [path.name for path in DOCS.glob("*.md") if names[path] not in listed] == []
    assert [path.name for path in DOCS.glob("adr/0*.md") if f"({path.name})" not in decisions] == []


def test_files_that_documents_and_docstrings_name_are_there() -> None:
    sources = [*REPOSITORY.glob("*.md"), *REPOSITORY.glob("docs/**/*.md")]
    for folder in ("leaderboard", "evaluator", "tsttc_baselines", "tests"):
        sources += (REPOSITORY / folder).rglob("*.py")
    missing = [
        f"{source.relative_to(REPOSITORY)}: {name}"
        for source in sources
        if source.name not in {"CHANGELOG.md", "peers.md"}  # the past, and files of other projects
        for name in PATH.findall(source.read_text(encoding="utf-8"))
        if not (REPOSITORY / name).exists() and not (REPOSITORY / "tests" / name).exists()
    ]
    assert missing == []


def test_the_page_of_the_architecture_lists_every_package() -> None:
    page = (DOCS / "architecture.md").read_text(encoding="utf-8")
    packages = {path.parent.name for path in (REPOSITORY / "leaderboard").glob("*/__init__.py")}
    table = page.partition("## The packages")[2].partition("## ")[0]
    first_cells = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    assert set(re.findall(r"`(\w+)/`", " ".join(first_cells))) == packages
