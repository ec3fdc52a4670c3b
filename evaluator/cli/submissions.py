"""The subcommands about a submission: submit sends one, status asks after one."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final
from urllib.parse import urljoin

import click

from evaluator.cli import consent, gates
from evaluator.cli.connection import connect
from evaluator.cli.exits import Exit
from evaluator.cli.failures import Failure, rejected
from evaluator.cli.layout import printable, result_in_words
from evaluator.cli.options import (
    is_utf8,
    json_option,
    predictions_argument,
    sendable,
    slug,
    timeout_option,
    url_option,
)
from evaluator.cli.reading import name_of, predictions_of
from evaluator.cli.summaries import summarised
from evaluator.cli.values import in_short, state_in_words
from evaluator.cli.warnings_in_words import echo_warnings
from evaluator.problems import FileWarning, Rejected, n_problems_in_words
from evaluator.spelling import similar_name

if TYPE_CHECKING:
    from evaluator.client.answers import BoardEntry, Submission
    from evaluator.client.api import Client

_NOT_COUNTED: Final = "This file was not scored and did not count against your quota."


@click.command(short_help="Submit a prediction file to the leaderboard.")
@predictions_argument
@click.option(
    "--split",
    required=True,
    callback=slug,
    help="The split: val, test, …",
)
@click.option(
    "--method",
    callback=sendable,
    required=True,
    help="Name or id of the method; a new name creates a new method.",
)
@click.option("--description", callback=sendable, help="One sentence about the method.")
@click.option("--paper-url", callback=sendable, metavar="URL", help="Address of the paper.")
@click.option("--code-url", callback=sendable, metavar="URL", help="Address of the code.")
@click.option("--note", callback=sendable, help="A note for your team.")
@click.option("--commit", callback=sendable, help="The commit that produced the file.")
@click.option("--wait", is_flag=True, help="Wait for the scores.")
@timeout_option("Stop waiting after this time; the evaluation continues.", default=900.0)
@gates.fail_if_option
@click.option(
    "--fail-if-worse-than",
    "worse_than",
    metavar="METHOD",
    help="Exit with code 6 if the score that ranks is worse than that of this method on the board.",
)
@click.option(
    "--yes",
    is_flag=True,
    help="Do not ask: submit despite warnings or a name like another one, and let results go public.",
)
@click.option("--no-check", is_flag=True, help="Submit without checking the file first.")
@click.option(
    "--summary",
    "summary_path",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Append the result or the failure to this file as Markdown, such as $GITHUB_STEP_SUMMARY.",
)
@url_option
@json_option
def submit(
    *,
    predictions: Path,
    split: str,
    method: str,
    wait: bool,
    timeout_s: float,
    fail_if: list[gates.Condition],
    worse_than: str | None,
    yes: bool,
    no_check: bool,
    url: str,
    as_json: bool,
    summary_path: Path | None,
    **details: str | None,
) -> None:
    """Submit PREDICTIONS, a prediction file or - for standard input, to the leaderboard.

    The command first checks the file with the code of the server. Submitting the same file again is safe:
    the server answers with the first submission. If the check gives a warning, or if the method is new and
    its name is like that of another method of your team, the command asks on a terminal; in a job it submits
    nothing without --yes and exits with code 10. If the method is public or anonymous, the command says so
    before it submits, and asks on a terminal. A gate (--fail-if…) waits for the scores like --wait.

    \b
    Examples:
      tsttc submit predictions.json --split val --method "Foo++" --wait
      tsttc submit predictions.json --split test --method "Foo++" --wait --json > scores.json
      tsttc submit predictions.json --split val --method "Foo++" --fail-if "mid > 15.0 or rte > 13"
      tsttc submit predictions.json --split val --method "Foo++" --fail-if-worse-than published:deep-scale
    """
    with (
        summarised(summary_path, named=f"{method} on {split}") as summary,
        connect(url, with_token=True, timeout_s=timeout_s) as client,
    ):
        data = predictions_of(predictions)
        warnings = [] if no_check else _require_good(client, data, split=split, path=predictions)
        rival = None
        if worse_than:
            rival = gates.rival(client, split=split, method=worse_than, own=method)
        notice, similar = _about_method(client, method)
        _warn(notice, err=as_json)
        consent.require(consent.Doubts(warnings=warnings, similar_method=similar), notice=notice, yes=yes)
        submission = client.submit(
            data,
            filename=_name_to_send(predictions),
            split=split,
            method=method,
            details={field: value for field, value in details.items() if value},
        )
        summary.submission, summary.address = submission, urljoin(url, submission.url or "")
        is_waiting = wait or bool(fail_if) or bool(worse_than)
        if is_waiting or not as_json:
            _announce(submission, site=url, err=as_json)
        if submission.notice != notice:  # a token that may only submit learns it now
            _warn(submission.notice, err=as_json)
        if is_waiting and not submission.is_final:
            submission = summary.submission = _followed(client, submission.id, timeout_s=timeout_s)
        summary.verdicts = _verdicts(submission, fail_if, rival)
        warned = frozenset(warning.code for warning in warnings)
        conclude(submission, as_json=as_json, verdicts=summary.verdicts, warned=warned)
        if submission.is_new and submission.visibility == "PRIVATE" and not as_json:
            name = printable(submission.method)
            click.echo(
                f"\n{name} is private: only your team and the maintainers see its results. "
                f'Publish it with: tsttc publish "{name}"'
            )


def _verdicts(
    submission: Submission, conditions: Sequence[gates.Condition], rival: BoardEntry | None
) -> list[gates.Verdict]:
    """What every gate says of a submission; nothing of one that has no scores yet or never will."""
    scores, decimals = submission.scores, submission.decimals
    verdicts = gates.verdicts_of(conditions, scores, decimals=decimals)
    if rival is not None:
        verdicts.append(gates.verdict_against(rival, scores=scores, decimals=decimals))
    return verdicts


@click.command(short_help="Show the state, the scores or the problems of a submission.")
@click.argument("submission_id", metavar="[ID]", callback=slug, required=False)
@click.option("--watch", is_flag=True, help="Wait until the state is final.")
@timeout_option("Stop waiting after this time; the evaluation continues.", default=900.0)
@gates.fail_if_option
@url_option
@json_option
def status(
    *,
    submission_id: str | None,
    watch: bool,
    timeout_s: float,
    fail_if: list[gates.Condition],
    url: str,
    as_json: bool,
) -> None:
    """Show the state of submission ID: its place in the queue, its scores, or what is wrong in the file.

    Without ID, that of your team's latest submission.

    \b
    Examples:
      tsttc status
      tsttc status 1f0c6a2e-6d0b-4f3e-9c55-0d4f2b8f3a11
      tsttc status 1f0c6a2e-6d0b-4f3e-9c55-0d4f2b8f3a11 --watch --fail-if "mid > 15.0"
    """
    with connect(url, with_token=True, timeout_s=timeout_s) as client:
        submission_id = submission_id or _latest(client)
        submission = (
            _followed(client, submission_id, timeout_s=timeout_s)
            if watch
            else client.submission(submission_id)
        )
    conclude(
        submission,
        as_json=as_json,
        verdicts=_verdicts(submission, fail_if, None),
    )


def _latest(client: Client) -> str:
    submission = next(client.submissions(), None)
    if submission is None:
        raise Failure(
            "Your team has no submission yet; expected the ID of one.", exit_code=Exit.USAGE, code="not-found"
        )
    return submission.id


def _require_good(client: Client, data: bytes, *, split: str, path: Path) -> list[FileWarning]:
    """Print the warnings of a file and return them; raises Failure for a faulty file."""
    # The server explains why a split has no manifest.
    from evaluator import read_manifest, read_predictions  # noqa: PLC0415 -- loads numpy
    from evaluator.client.answers import Refused  # noqa: PLC0415 -- loads msgspec
    from evaluator.predictions.plausibility import warnings_of  # noqa: PLC0415 -- loads numpy

    try:
        table = client.manifest(split)
    except Refused as refused:
        if refused.status != 404:
            raise
        return []
    try:
        manifest = read_manifest(table)
    except Rejected as fault:
        raise rejected(f"the server's manifest of {split}", fault) from None
    try:
        predictions = read_predictions(data, manifest=manifest)
    except Rejected as fault:
        hint = "This file was not submitted and did not count against your quota."
        worded = _explained(client, data, fault, split=split, current=manifest.digest)
        raise rejected(name_of(path), worded, hint=hint) from None
    warnings = warnings_of(predictions)
    echo_warnings(warnings)
    return warnings


def _explained(client: Client, data: bytes, fault: Rejected, *, split: str, current: str) -> Rejected:
    """Say of a file with other keys which earlier edition it fits, as the server does."""
    from evaluator import read_manifest, read_predictions  # noqa: PLC0415 -- loads numpy
    from evaluator.client.answers import ClientError  # noqa: PLC0415 -- loads msgspec
    from evaluator.predictions import former  # noqa: PLC0415 -- loads numpy

    if not former.is_of_keys(fault):
        return fault
    try:
        numbers = {digest: number for number, digest in sorted(client.editions(split)) if digest != current}
        for number in sorted(numbers.values(), reverse=True)[: former.MAX_MANIFESTS]:
            manifest = read_manifest(client.manifest(split, edition=number))
            try:
                keys = read_predictions(data, manifest=manifest).keys
            except Rejected:
                continue
            return former.explained(fault, split=split, edition=number, keys=keys)
        for other in [name for name in client.splits() if name != split][: former.MAX_MANIFESTS]:
            if _fits(client, data, split=other):
                return former.of_another_split(fault, split=split, other=other)
    except (ClientError, Rejected):
        return fault  # the problem is known without the editions
    return fault


def _fits(client: Client, data: bytes, *, split: str) -> bool:
    from evaluator import read_manifest, read_predictions  # noqa: PLC0415 -- loads numpy
    from evaluator.client.answers import Refused  # noqa: PLC0415 -- loads msgspec

    try:
        read_predictions(data, manifest=read_manifest(client.manifest(split)))
    except (Refused, Rejected):  # a split without ground truth has no manifest
        return False
    return True


def _followed(client: Client, submission_id: str, *, timeout_s: float) -> Submission:
    last_state = ""
    for submission in client.watch(submission_id, timeout_s=timeout_s):
        if submission.state != last_state and not submission.is_final:
            click.echo(state_in_words(submission), err=True)
            last_state = submission.state
    return submission


def _about_method(client: Client, method: str) -> tuple[str, str | None]:
    """Say who will see the scores, and of a new method which own method has a similar name.

    Empty and None if only the team sees them and the name is like no other, or if the token may not ask.
    """
    from evaluator.client.answers import Refused  # noqa: PLC0415 -- loads msgspec

    try:
        own_methods = list(client.methods())
    except Refused:  # a token that may only submit; the answer to the file says it
        return "", None
    known = next((row for row in own_methods if method in {row.id, row.name}), None)
    if known is not None:
        return known.notice, None
    similar = similar_name(method, (row.name for row in own_methods))
    if similar is not None:
        click.echo(
            printable(f'Warning: "{method}" would be a new method; your team has "{similar}".'), err=True
        )
    return "", similar


def _warn(notice: str, *, err: bool) -> None:
    if notice:
        click.echo(printable(notice), err=err)


def _name_to_send(path: Path) -> str:
    if path.suffix.lower() == ".parquet":  # JSON is sent in its place
        path = path.with_suffix(".json")
    return path.name if str(path) != "-" and is_utf8(path.name) else "predictions.json"


def _announce(submission: Submission, *, site: str, err: bool) -> None:
    # Before the wait: after an interruption the user can ask for this submission.
    address = f"  {urljoin(site, submission.url)}" if submission.url else ""
    click.echo(printable(f"Submission {submission.id}{address}"), err=err)
    if not submission.is_new:
        click.echo("You already submitted this file; this is its first submission.", err=err)
    for note in submission.notes:
        click.echo(printable(f"Note: {note}"), err=True)


def conclude(
    submission: Submission,
    *,
    as_json: bool,
    verdicts: Sequence[gates.Verdict],
    warned: frozenset[str] = frozenset(),
) -> None:
    """Print a submission; raises Failure if it ended without scores or a gate fails."""
    # Warnings with these codes are on the screen already.
    named = (
        f"{submission.method} on {submission.split}" if submission.method else f"submission {submission.id}"
    )
    match submission.state:
        case "REJECTED":
            n_problems = submission.n_problems or len(submission.problems)
            count_text = n_problems_in_words(n_problems, n_lines=len(submission.problems))
            message, exit_code = f"The file is rejected: {count_text}.", Exit.REJECTED
            hint = f"{_NOT_COUNTED} Check a corrected file with: tsttc check"
        case "SYSTEM_ERROR":
            message, exit_code = (
                f"The server failed to score {named}. The fault is not the file's.",
                Exit.SYSTEM,
            )
            hint = _NOT_COUNTED
        case "CANCELLED":
            message, exit_code, hint = f"{named} was cancelled, so it has no scores.", Exit.REFUSED, ""
        case _:
            gates.show_and_judge(
                submission.document,
                show=partial(_show, submission, named, warned),
                judge=lambda: gates.judge(verdicts),
                as_json=as_json,
            )
            return
    raise Failure(
        message,
        exit_code=exit_code,
        code=submission.state.lower().replace("_", "-"),
        problems=submission.problems,
        hint=hint,
        document=submission.document,
    )


def _show(submission: Submission, named: str, warned: frozenset[str]) -> None:
    click.echo(f"{state_in_words(submission)}: {printable(named)}")
    if submission.scores is not None:
        for line in in_short(submission):
            click.echo(line)
        click.echo("")
        for line in result_in_words(
            submission.scores,
            counts=submission.counts or {},
            n_out_of_range=submission.n_out_of_range or 0,
            truncated=submission.truncated or {},
            decimals=submission.decimals,
        ):
            click.echo(line)
        echo_warnings(warning for warning in submission.warnings if warning.code not in warned)
