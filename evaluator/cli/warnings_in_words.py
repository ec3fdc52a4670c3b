"""Warnings about a file that is well-formed: as lines on standard error, and as part of a document."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from evaluator.cli.layout import printable
from evaluator.problems import FileWarning

if TYPE_CHECKING:
    from evaluator.predictions.loading import Predictions
    from evaluator.truth.numbering import Numbering


def echo_warnings(warnings: Iterable[FileWarning]) -> None:
    for warning in warnings:
        click.echo(f"Warning: {printable(warning.message)}", err=True)


def numbering_in_words(numbering: Numbering) -> str:
    """Say whether the toolkit on this machine numbers a folder's sequences as the manifest does."""
    if not numbering.n_renumbered:
        return "The toolkit numbers the folder like the manifest: the order of files is the same."
    n_sequences = numbering.manifest.n_sequences
    return (
        f"The toolkit numbers {numbering.n_renumbered:,} of the {n_sequences:,} sequences of the folder "
        "differently from the manifest: the order of files is another one."
    )


def numbering_warnings(
    numbering: Numbering, parsed: Predictions, *, predictions: Path, annotations: Path
) -> list[FileWarning]:
    """Warn of anno_ids that the toolkit has probably numbered otherwise than the manifest."""
    from evaluator.predictions.plausibility import MAX_ROUGHNESS, roughness  # noqa: PLC0415 -- loads numpy

    if parsed.keys != "anno_id" or not numbering.n_renumbered:
        return []
    as_manifest = roughness(numbering.manifest, parsed.ttc_s)
    as_toolkit = roughness(numbering.manifest, numbering.realigned(parsed.ttc_s))
    origin = "If the toolkit wrote the file"
    if as_manifest is not None and as_toolkit is not None:
        if as_manifest <= MAX_ROUGHNESS < as_toolkit:
            return []  # it is smooth as it stands, so its anno_ids are the manifest's
        if as_toolkit <= MAX_ROUGHNESS < as_manifest:
            origin = "The values are smooth in the toolkit's numbering only, so the toolkit wrote the file"
    words = ("tsttc", "convert", str(predictions), "--annotations", str(annotations), "-o", "natural.json")
    command = shlex.join(words)
    return [
        FileWarning(
            "other-numbering",
            f"{numbering_in_words(numbering)} {origin}: give it natural keys with {command}",
        )
    ]
