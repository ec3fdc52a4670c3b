"""What the site needs beside the pages: the examples, to which pages link as files of the repository, and the
API's reference, written from the schema as it is recorded.
"""

import html
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from leaderboard.web.api_reference import Field, Kind, Operation, Reference, read

REPOSITORY = Path(__file__).resolve().parent.parent
SCHEMA = REPOSITORY / "tests" / "golden" / "openapi.json"
API_REFERENCE = "api-reference.md"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add every example under its own path, and the API's reference."""
    for path in sorted((REPOSITORY / "examples").rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            name = path.relative_to(REPOSITORY).as_posix()
            files.append(File.generated(config, name, abs_src_path=str(path)))
    schema = json.loads(SCHEMA.read_text(encoding="utf-8"))
    files.append(File.generated(config, API_REFERENCE, content="\n".join(_lines(read(schema)))))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Point to the examples where the site has them: beside the pages instead of beside their folder."""
    if page.file.src_uri.startswith("examples/"):
        return markdown.replace("](../docs/", "](../")
    return markdown.replace("](../examples/", "](examples/")


# --- the API's reference -----------------------------------------------------------------------------------


def _lines(reference: Reference) -> Iterator[str]:
    """The page: operations with their parameters and answers, then every shape with its fields."""
    yield "# API reference\n"
    yield (
        "Every operation, parameter and field, from the schema that a leaderboard has at `/api/v1/schema`. "
        "[The API](api.md) says how they hang together, and lists the codes of errors.\n"
    )
    yield "## Operations\n"
    for operation in reference.operations:
        yield from _operation(operation)
    yield "## Shapes\n"
    for shape in reference.shapes:
        yield f"### {shape.name}\n"
        yield f"{_text(shape.about)}\n"
        yield from _table("field", shape.fields)


def _operation(operation: Operation) -> Iterator[str]:
    yield f"### {operation.method} {operation.path}\n"
    needs = " Needs an account." if operation.needs_account else ""
    yield f"`{operation.name}`: {_text(operation.about)}{needs}\n"
    yield from _table("parameter", operation.parameters)
    yield from _table("field of the body", operation.body)
    yield "| answer | holds | |\n|---|---|---|"
    for answer in operation.answers:
        yield f"| {answer.status} {answer.phrase} | {_kind(answer.kind)} | {_text(answer.about)} |"
    yield ""


def _table(title: str, fields: Sequence[Field]) -> Iterator[str]:
    if fields:
        yield f"| {title} | is | means |\n|---|---|---|"
        for field in fields:
            must = " (required)" if field.is_required and title != "field" else ""
            yield f"| `{field.name}`{must} | {_kind(field.kind)} | {_text(field.about)} |"
        yield ""


def _kind(kind: Kind) -> str:
    """What a value is, with a link to its shape."""
    text = _text(kind.text)
    return f"[{text}](#{kind.shape.lower()})" if kind.shape else text


def _text(text: str) -> str:
    """A text of the schema in a cell of a table: on one line, and no markup but its own backticks."""
    return html.escape(" ".join(text.split()), quote=False).replace("|", "&#124;").replace("*", "&#42;")
