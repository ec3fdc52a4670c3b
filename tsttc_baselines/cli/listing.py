"""`tsttc baseline list`: the methods, their parameters and where they come from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import click

from evaluator.cli.failures import echo_json
from evaluator.cli.layout import printable
from evaluator.cli.options import json_option
from tsttc_baselines.methods import METHODS, Method, Parameter
from tsttc_baselines.own_methods import MethodMissing, find_method, is_own, points


@click.command("list", short_help="List the methods and their parameters.")
@json_option
def list_methods(*, as_json: bool) -> None:
    """List the methods that `tsttc baseline run` knows, with their parameters and defaults.

    "as published" names the parameters of a published row; an "unpublished" method appears in no paper.
    Installed packages may add methods, by entry points of `tsttc.methods`.

    \b
    Example:
      tsttc baseline list
    """
    if as_json:
        echo_json([_document(method) for method in _methods()])
        return
    for method in _methods():
        click.echo(f"{method.name}  {method.title}; {_provenance(method)}.")
        click.echo(f"  {method.summary}")
        for parameter in method.parameters:
            option = f"--set {parameter.name}=" if is_own(method) else f"{parameter.option} "
            click.echo(f"  {option}{parameter_in_words(parameter)}")


def _methods() -> Iterator[Method]:
    """All that there are; one that cannot be loaded is named on standard error."""
    yield from METHODS
    for point in points():
        try:
            yield find_method(point.name)
        except MethodMissing as missing:
            click.echo(printable(str(missing)), err=True)


def parameter_in_words(parameter: Parameter) -> str:
    values = "|".join(parameter.choices) or parameter.kind.__name__.upper()
    default = "" if parameter.default is None else f" (default {parameter.default_in_words})"
    return f"{values}{default}: {parameter.help}"


def _provenance(method: Method) -> str:
    if method.published is None:
        return "unpublished"
    options = {parameter.name: parameter.option for parameter in method.parameters}
    values = " ".join(f"{options[name]} {value}" for name, value in method.published.items())
    return f"as published with {values}" if values else "as published"


def _document(method: Method) -> dict[str, object]:
    parameters = [
        {
            **asdict(parameter),
            "default": parameter.default_in_words if parameter.kind is Path else parameter.default,
            "kind": parameter.kind.__name__.lower(),
            "choices": list(parameter.choices),
        }
        for parameter in method.parameters
    ]
    published = None if method.published is None else dict(method.published)
    return {
        "name": method.name,
        "title": method.title,
        "summary": method.summary,
        "published": published,
        "frames": method.frames,
        "boxes": method.boxes,
        "parameters": parameters,
    }
