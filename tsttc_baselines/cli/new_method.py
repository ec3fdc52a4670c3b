"""`tsttc new-method`: a package to begin one's own method with, that trains and passes its test as it is."""

from __future__ import annotations

import keyword
import re
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import click

from evaluator.cli.failures import echo_json
from evaluator.cli.options import json_option
from tsttc_baselines.methods import METHODS

TEMPLATES: Final = Path(__file__).parent.parent / "new_method"

FILES: Final = {
    "README.md.txt": "README.md",
    "pyproject.toml.txt": "pyproject.toml",
    "gitignore.txt": ".gitignore",
    "init.py.txt": "my_method/__init__.py",
    "dataset.py.txt": "my_method/dataset.py",
    "network.py.txt": "my_method/network.py",
    "train.py.txt": "my_method/train.py",
    "method.py.txt": "my_method/method.py",
    "test_method.py.txt": "tests/test_method.py",
    "predict.sh.txt": "predict.sh",
    "workflow.yml.txt": ".github/workflows/tsttc.yml",
}
"""The files of the package, each with its template; both have "my-method" and "my_method" for the name."""


@click.command("new-method", short_help="Create a starter package for your own method.")
@click.argument("name", metavar="NAME")
@json_option
def new_method(*, name: str, as_json: bool) -> None:
    """Write the folder NAME with a method of your own: network, dataset, training, test and a CI recipe.

    It trains on rendered frames in a minute, and `tsttc baseline run` runs it. It needs torch.

    \b
    Example:
      tsttc new-method my-method
    """
    package = name.replace("-", "_")
    folder = Path(name)
    _require_free(name, package, folder)
    try:
        for template, path in FILES.items():
            file = folder / path.replace("my_method", package)
            file.parent.mkdir(parents=True, exist_ok=True)
            text = (TEMPLATES / template).read_text(encoding="utf-8")
            text = text.replace("my_method", package).replace("my-method", name)
            file.write_text(text, encoding="utf-8", newline="\n")
            if file.suffix == ".sh":
                file.chmod(0o755)
    except OSError as error:
        message = f"{error.filename or folder} cannot be written: {error.strerror}."
        raise click.BadParameter(message, param_hint="NAME") from None
    if as_json:
        echo_json({"output": str(folder), "package": package})
        return
    click.echo(f"{folder}: {len(FILES)} files; {folder / 'README.md'} says how to train, run and score it.")


def _require_free(name: str, package: str, folder: Path) -> None:
    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", name) or keyword.iskeyword(package):
        message = f"{name}; expected small letters and digits, words joined by hyphens."
        raise click.BadParameter(message, param_hint="NAME")
    if name in {method.name for method in METHODS} or find_spec(package) is not None:
        message = f"{name} is the name of a method or of an installed module; expected another name."
        raise click.BadParameter(message, param_hint="NAME")
    if folder.exists():
        raise click.BadParameter(f"{folder} is there already; expected a new name.", param_hint="NAME")
