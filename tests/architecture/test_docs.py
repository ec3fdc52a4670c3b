"""Links between documents lead somewhere, here as at GitHub, and no document is left out of a list."""

import re
from urllib.parse import unquote

from leaderboard.web.docs import guides
from tests.services import REPOSITORY

DOCS = REPOSITORY / "docs"
LINK = re.compile(r"\]\((?!https?:|mailto:)([^)#\s]*)(?:#([^)\s]*))?\)")
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


def test_every_document_is_in_the_navigation_and_every_decision_in_its_list() -> None:
    listed = {entry.name for _, links in guides.navigation() for entry in links}
    decisions = (DOCS / "adr" / "README.md").read_text(encoding="utf-8")
    names = {path: name for name, path in guides.files().items()}
    assert [path.name for path in DOCS.glob("*.md") if names[path] not in listed] == []
    assert [path.name for path in DOCS.glob("adr/0*.md") if f"({path.name})" not in decisions] == []
