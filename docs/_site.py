"""What the site needs in addition to the pages: the examples, to which pages link as files of the repository,
the changelog, and the API reference, from the same templates as the leaderboard's own page.
"""

import os
import re
from pathlib import Path

import django
from django.template.loader import render_to_string
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from mkdocs.structure.toc import AnchorLink

REPOSITORY = Path(__file__).resolve().parent.parent
API_REFERENCE = "api-reference.md"
CHANGELOG = "changelog.md"
INTRODUCTION = """# API reference

Every operation, parameter and field, from the schema that a leaderboard serves at `/api/v1/schema`.
[The API](api.md) explains how to use them, and lists the problem codes.
"""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add every example under its own path, and the API reference."""
    for path in sorted((REPOSITORY / "examples").rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            name = path.relative_to(REPOSITORY).as_posix()
            files.append(File.generated(config, name, abs_src_path=str(path)))
    files.append(File.generated(config, API_REFERENCE, content=INTRODUCTION))
    files.append(File.generated(config, CHANGELOG, abs_src_path=str(REPOSITORY / "CHANGELOG.md")))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Point to the examples where the site has them: beside the pages instead of beside their folder."""
    if page.file.src_uri == CHANGELOG:
        return markdown.replace("](docs/", "](").replace("](../examples/", "](examples/")
    if page.file.src_uri.startswith("examples/"):
        return markdown.replace("](../docs/", "](../")
    return markdown.replace("](../examples/", "](examples/")


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Draw the API reference below its introduction, and list its operations in the table of contents."""
    if page.file.src_uri != API_REFERENCE:
        return html
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "leaderboard.settings")
    django.setup()
    from leaderboard.web.docs.api_reference import reference  # noqa: PLC0415 - needs the settings

    api = reference()
    page.toc.items[0].children = [AnchorLink(each["name"], each["id"], 2) for each in api["operations"]]
    body = render_to_string("docs/api_operations.html", {"api": api})
    return html + re.sub(' class="[^"]*"', "", body)  # the theme draws tables that have no class
