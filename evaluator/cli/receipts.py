"""The subcommands about receipts: receipt fetches one, verify checks one."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import click
from click.core import ParameterSource

from evaluator.cli.connection import connect
from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure, echo_json, rejected
from evaluator.cli.layout import printable, score_table, units
from evaluator.cli.options import DEFAULT_URL, json_option, output_option, site_options, slug
from evaluator.cli.paths import server_of_login
from evaluator.cli.reading import bytes_of, write_bytes
from evaluator.problems import Rejected

if TYPE_CHECKING:
    from evaluator.receipts import Verified


@click.command(short_help="Get the signed receipt of a scored submission.")
@click.argument("submission_id", metavar="ID", callback=slug)
@output_option("it")
@site_options
def receipt(*, submission_id: str, output: Path | None, url: str) -> None:
    """Get the signed receipt of submission ID: what it scored, in which edition, by which file, and when.

    Put it into the supplementary material of your paper: anyone can check it offline.

    \b
    Example:
      tsttc receipt 1f0c6a2e-6d0b-4f3e-9c55-0d4f2b8f3a11 -o receipt.jwt
    """
    with connect(url, with_token=True) as client:
        data = client.receipt(submission_id)
    if output is None:
        click.echo(data, nl=not data.endswith(b"\n"))
        return
    write_bytes(output, data)
    click.echo(f"{output}: check it with tsttc verify {output}")


@click.command(short_help="Check the receipt of a score, or an archive of a leaderboard.")
@click.argument(
    "receipt_path",
    metavar="RECEIPT|FOLDER",
    type=click.Path(exists=True, allow_dash=True, path_type=Path),
)
@click.option(
    "--keys",
    "keys_path",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE",
    help="A saved copy of the site's keys (default: fetched from --server).",
)
@site_options
@json_option
def verify(*, receipt_path: Path, keys_path: Path | None, url: str, as_json: bool) -> None:
    """Check that the leaderboard signed RECEIPT, a file or - for standard input, and print what it says.

    The keys of the site are at /.well-known/tsttc-receipt-keys.json; with --keys the check works offline.
    Never use keys that came with the receipt.

    FOLDER is an archive that `manage.py archive` wrote: every file is held against its list, and every
    receipt against --keys, or else the keys in the archive. This needs no server.

    \b
    Examples:
      tsttc verify receipt.jwt --server https://leaderboard.example.org
      tsttc verify receipt.jwt --keys tsttc-receipt-keys.json
      tsttc verify archive/
    """
    if receipt_path.is_dir():
        _verify_archive(receipt_path, keys=bytes_of(keys_path) if keys_path else None, as_json=as_json)
        return
    from evaluator.receipts import NotVerified, claimed_site, read_keys  # noqa: PLC0415 -- needed here alone
    from evaluator.receipts import verify as verified_by  # noqa: PLC0415 -- as above

    data = bytes_of(receipt_path)
    if keys_path is not None:
        keys_data = bytes_of(keys_path)
    else:
        site = claimed_site(data)
        if _is_nobody_s(url) and site and _host(site) != _host(url):
            raise Failure(
                f"No site is named whose keys check this receipt. The receipt names {site}.",
                exit_code=Exit.USAGE,
                code="no-server",
                hint=_with_keys_of(site, receipt_path),
            )
        if not site:
            _require_receipt(data)
        with connect(url, with_token=False) as client:
            keys_data = client.receipt_keys()
    try:
        receipt = verified_by(data, read_keys(keys_data))
    except NotVerified as fault:
        site = claimed_site(data)
        is_of_another = fault.code == "receipt-key-unknown" and site and _host(site) != _host(url)
        hint = _with_keys_of(site, receipt_path) if is_of_another and keys_path is None else ""
        raise Failure(str(fault), exit_code=Exit.REJECTED, code=fault.code, hint=hint) from None
    is_elsewhere = keys_path is None and _host(receipt.site) != _host(url)
    if as_json:
        echo_json({name: getattr(receipt, name) for name in receipt.__dataclass_fields__})
    else:
        for line in _in_words(receipt):
            click.echo(line)
    if is_elsewhere:
        click.echo(
            f"Note: the receipt names {printable(receipt.site)}; the keys are those of {url}.", err=True
        )


def _require_receipt(data: bytes) -> None:
    """Raise `Failure` for what is no receipt by its form: no site needs to be asked about it."""
    from evaluator.receipts import NotVerified, verify  # noqa: PLC0415 -- as above

    try:
        verify(data, {})
    except NotVerified as fault:
        if fault.code == "receipt-malformed":
            raise Failure(str(fault), exit_code=Exit.REJECTED, code=fault.code) from None


def _is_nobody_s(url: str) -> bool:
    """Whether nobody named the server: no option, no environment, no login."""
    source = click.get_current_context().get_parameter_source("url")
    return source is ParameterSource.DEFAULT and server_of_login() is None and url == DEFAULT_URL


def _host(url: str) -> str:
    try:
        return urlsplit(url).netloc.lower()
    except ValueError:  # brackets that are none
        return ""


def _with_keys_of(site: str, path: Path) -> str:
    words = map(shlex.quote, (str(path), "--server", printable(site)))
    return f"If you trust that site: tsttc verify {' '.join(words)}"


def _verify_archive(folder: Path, *, keys: bytes | None, as_json: bool) -> None:
    from evaluator import archives  # noqa: PLC0415 -- needed here alone

    try:
        archive = archives.check(folder, keys=keys)
    except Rejected as fault:
        raise rejected(str(folder), fault) from None
    except OSError as error:
        raise click.BadParameter(f"{error.filename} cannot be read: {error.strerror}.") from None
    if archive.problems:
        raise rejected(str(folder), Rejected(archive.problems))
    facts = archive._asdict()
    if as_json:
        echo_json(facts)
        return
    click.echo("The archive is whole.\n")
    for name, fact in facts.items():
        if name != "problems":
            text = ", ".join(fact) if isinstance(fact, tuple) else fact
            click.echo(printable(f"{name.replace('_', ' '):<12} {text}"))
    if keys is None:
        click.echo("\nThe keys are those in the archive: compare them with the keys that the site published.")


def _in_words(receipt: Verified) -> Iterator[str]:
    facts = {
        "signed by": receipt.site,
        "scored": receipt.scored_at,
        "method": f"{receipt.method_id}, named {receipt.method} when signed",
        "submission": receipt.submission,
        "split": f"{receipt.split}, edition {receipt.edition}, {receipt.protocol}",
        "truth": receipt.ground_truth,
        "predictions": receipt.file,
        "key": receipt.key_id,
    }
    yield "The receipt is valid."
    yield ""
    for name, text in facts.items():
        yield printable(f"{name:<12} {text}")
    yield ""
    yield from score_table(receipt.scores, counts=receipt.counts, decimals=receipt.decimals)
    yield ""
    yield units(receipt.scores)
