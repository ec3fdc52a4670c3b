"""The API's schema as it is recorded: `python -m tests.openapi` records it as it is now.

A field once here stays, so a change of the schema is looked at before it is recorded.
"""

import json
import os
from pathlib import Path
from typing import Any

GOLDEN = Path(__file__).parent / "golden" / "openapi.json"


def schema() -> dict[str, Any]:
    """The schema that the code has now."""
    from drf_spectacular.generators import SchemaGenerator  # noqa: PLC0415 - needs Django's settings

    made: dict[str, Any] = SchemaGenerator().get_schema(request=None, public=True)
    return made


def text_of(schema: dict[str, Any]) -> str:
    """A schema as the file has it: one key a line, so that a change is one line as well."""
    return json.dumps(schema, indent=1, ensure_ascii=False, default=str) + "\n"


def main() -> None:
    """Record it."""
    os.environ.setdefault("DJANGO_SETTINGS_MODULE", "leaderboard.settings")
    import django  # noqa: PLC0415 - the settings have to be named first

    django.setup()
    GOLDEN.write_text(text_of(schema()), encoding="utf-8")


if __name__ == "__main__":
    main()
