"""Sending a file: checked here first, by the server's own code, then streamed with a bar on a terminal."""

from __future__ import annotations

import io
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, cast

import click

from evaluator.cli.failures import rejected
from evaluator.cli.paths import cache_folder
from evaluator.cli.reading import as_sent
from evaluator.cli.warnings_in_words import echo_warnings
from evaluator.predictions.parquet import N_MAGIC_BYTES, is_parquet
from evaluator.problems import Rejected

if TYPE_CHECKING:
    from evaluator.client.client import Client
    from evaluator.truth.truth import Manifest

# What is larger is no prediction file, and the server says so without its being read here.
LARGEST_CHECKED_BYTES = 64_000_000


@contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """The file to send. What can be read only once is kept first, so that sending can be repeated.

    In place of a Parquet table stands the JSON of the same predictions.
    """
    try:
        source = nullcontext(sys.stdin.buffer) if str(path) == "-" else path.open("rb")
        with source as file, tempfile.TemporaryFile() as kept:
            if not file.seekable():
                shutil.copyfileobj(file, kept)
            found = cast("BinaryIO", file if file.seekable() else kept)
            found.seek(0)
            if is_parquet(found.read(N_MAGIC_BYTES)):
                found.seek(0)
                found = io.BytesIO(as_sent(found.read(), path))
            found.seek(0)
            yield found
    except OSError as error:
        raise click.BadParameter(f"{path} cannot be read: {error.strerror}.") from None


def require_good(client: Client, file: BinaryIO, *, split: str, name: str) -> frozenset[str]:
    """Raise Failure, with every problem, for a file that the server would reject; warn of a doubtful one.

    Gives the codes of the warnings.

    A split without a manifest is left to the server, which says what is the matter with it.
    """
    from evaluator.client.answers import Refused  # noqa: PLC0415 -- loads msgspec
    from evaluator.predictions.plausibility import warnings_of  # noqa: PLC0415 -- loads numpy
    from evaluator.predictions.predictions import read_predictions  # noqa: PLC0415 -- loads numpy

    file.seek(0)
    data = file.read(LARGEST_CHECKED_BYTES + 1)
    if len(data) > LARGEST_CHECKED_BYTES:
        return frozenset()
    try:
        manifest = manifest_of(client, split)
    except Refused as refused:
        if refused.status != 404:
            raise
        return frozenset()
    if manifest is None:
        return frozenset()
    try:
        found = read_predictions(data, manifest=manifest)
    except Rejected as fault:
        name = "standard input" if name == "-" else name
        raise rejected(name, fault, hint="Nothing was submitted; your quota is not used.") from None
    warnings = warnings_of(found)
    echo_warnings(warnings)
    return frozenset(warning.code for warning in warnings)


def manifest_of(client: Client, split: str) -> Manifest | None:
    """The split's manifest: the kept copy if it is the present one, else fetched and kept.

    A copy goes by its digest, and what does not have that digest is no copy.
    """
    from evaluator.truth.truth import Manifest, read_manifest  # noqa: PLC0415 -- loads numpy

    digest = client.manifest_digest(split)
    if digest is None:
        return None
    kept = cache_folder() / "manifests" / f"{digest.removeprefix('sha256:')[:64]}.npz"
    try:
        manifest = Manifest.load(kept)
        if manifest.digest == digest:
            return manifest
    except (Rejected, OSError):  # none yet, or damaged
        pass
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder, "manifest.csv")
        table.write_bytes(client.manifest(split))
        try:
            manifest = read_manifest(table)
        except Rejected as fault:
            raise rejected(f"the server's manifest of {split}", fault) from None
    _keep(manifest, kept)
    return manifest


def _keep(manifest: Manifest, kept: Path) -> None:
    """Put a copy where the next run finds it; a machine where that cannot be does without."""
    part = kept.with_suffix(f".{os.getpid()}.part")
    try:
        kept.parent.mkdir(parents=True, exist_ok=True)
        manifest.save(part)
        part.replace(kept)
    except OSError:
        return


@contextmanager
def progress(file: BinaryIO, filename: str) -> Iterator[BinaryIO]:
    """The file, with a bar on a terminal that says how much of it is sent."""
    if not sys.stderr.isatty():
        yield file
        return
    from rich.console import Console  # noqa: PLC0415 -- only a terminal needs it
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TransferSpeedColumn  # noqa: PLC0415 -- as above

    from evaluator.cli.layout import printable  # noqa: PLC0415 -- as above

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        DownloadColumn(),
        TransferSpeedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        n_bytes = file.seek(0, os.SEEK_END)
        yield bar.wrap_file(file, total=n_bytes, description=printable(filename))
