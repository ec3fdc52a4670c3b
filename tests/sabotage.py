"""A test of the tests: `python -m tests.sabotage` breaks one line at a time; a named test must notice.

Each change is made in a copy of the tree. One line a change; the exit code says whether all were noticed. A
change whose line is gone, or a test that fails without it, is an error as well: the list is then out of date.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from queue import Queue

REPOSITORY = Path(__file__).resolve().parent.parent
AT_THE_TOP = shutil.ignore_patterns(
    ".git", ".venv*", "var", "staticfiles", "docs", "benchmarks", "build", "tmp"
)
EVERYWHERE = shutil.ignore_patterns(".*_cache", "__pycache__")
TESTS_FAILED = 1  # pytest's exit code; anything else above 0 is not a test that went red


def left_out(folder: str, names: list[str]) -> set[str]:
    """What a tree does not need. A room of the code may be called as a folder at the top is."""
    ignored = EVERYWHERE(folder, names)
    return ignored | AT_THE_TOP(folder, names) if Path(folder) == REPOSITORY else ignored


@dataclass(frozen=True)
class Sabotage:
    """One line made wrong, and the test that must fail for it."""

    what: str
    path: str
    line: str
    instead: str
    test: str

    def apply(self, tree: Path) -> str:
        """Make the change in the tree; returns the file as it was. Raises `OutOfDate`."""
        file = tree / self.path
        before = file.read_text()
        n_found = before.count(self.line)
        if n_found != 1:
            raise OutOfDate(f"{self.path} has {n_found} times {self.line!r}; expected it once")
        file.write_text(before.replace(self.line, self.instead))
        return before


class OutOfDate(Exception):
    """The list does not fit the code any more."""


LIFECYCLE = "leaderboard/scoring/lifecycle.py"
INITIAL = "leaderboard/migrations/0001_initial.py"
STEPS = "tests/leaderboard/scoring/test_lifecycle.py"
STRIKES = "tests/leaderboard/scoring/test_lifecycle_strikes.py"
QUEUE = "tests/leaderboard/workers/test_queue.py"
OUTAGES = "tests/leaderboard/errors/test_outages.py"
CHILD = "tests/leaderboard/scoring/test_sandbox.py"
TAKEN_OVER = "tests/leaderboard/scoring/test_readers_taken_over.py"
RUNS = "tests/leaderboard/scoring/test_sandbox_runs.py"

SABOTAGES = (
    Sabotage(
        "free text of an anonymous method is shown",
        "leaderboard/methods/details.py",
        "if not (is_masked and each.kind.is_free_text))",
        "if True)",
        "tests/leaderboard/methods/test_further_detail.py::test_a_detail_is_a_field_and_a_row_of_the_registry",
    ),
    Sabotage(
        "finalise without the attempt",
        LIFECYCLE,
        "{row[0]: row[3] for row in rows if row[:3] in valid}",
        "{row[0]: row[3] for row in rows if (row[0], row[2]) in {(v[0], v[2]) for v in valid}}",
        f"{STEPS}::test_result_of_a_stale_lease_is_discarded[attempt]",
    ),
    Sabotage(
        "finalise without the token",
        LIFECYCLE,
        "{row[0]: row[3] for row in rows if row[:3] in valid}",
        "{row[0]: row[3] for row in rows if row[:2] in {v[:2] for v in valid}}",
        f"{STEPS}::test_result_of_a_stale_lease_is_discarded[token]",
    ),
    Sabotage(
        "finalise whatever the status",
        "leaderboard/scoring/claimable.py",
        ".filter(pk__in=ids, status=Status.RUNNING)",
        ".filter(pk__in=ids)",
        f"{STEPS}::test_a_decided_evaluation_is_not_decided_otherwise",
    ),
    Sabotage(
        "heartbeat and strikes without attempt and token",
        LIFECYCLE,
        "pk=lease.evaluation_id, status=Status.RUNNING, attempt=lease.attempt, lease_token=lease.token",
        "pk=lease.evaluation_id, status=Status.RUNNING",
        f"{STEPS}::test_heartbeat_with_a_stale_lease_says_stop_and_renews_nothing",
    ),
    Sabotage(
        "heartbeat beyond the deadline",
        LIFECYCLE,
        'Least(after(lease_s), F("deadline_at"))',
        "after(lease_s)",
        f"{STEPS}::test_heartbeat_never_renews_beyond_the_deadline",
    ),
    Sabotage(
        "heartbeat after the deadline",
        LIFECYCLE,
        "        .filter(deadline_at__gt=Now())\n",
        "",
        f"{STEPS}::test_heartbeat_after_the_deadline_says_stop",
    ),
    Sabotage(
        "a lost answer to COMMIT is not recognised",
        LIFECYCLE,
        "finished_attempt=lease.attempt, lease_token=lease.token, status=outcome.status",
        "finished_attempt=None",
        f"{STEPS}::test_finalise_again_recognises_its_own_commit_and_writes_nothing",
    ),
    Sabotage(
        "claim what somebody else has",
        "leaderboard/models/submissions.py",
        "return self.filter(status=Status.QUEUED, due_at__lte=Now())",
        "return self.filter(status__in=[Status.QUEUED, Status.RUNNING], due_at__lte=Now())",
        f"{STEPS}::test_what_is_claimed_is_not_claimed_again",
    ),
    Sabotage(
        "the attempt does not grow",
        LIFECYCLE,
        'attempt=F("attempt") + 1',
        'attempt=F("attempt")',
        f"{STEPS}::test_claim_gives_attempt_token_lease_and_deadline",
    ),
    Sabotage(
        "strikes without end",
        LIFECYCLE,
        "exhausted = n_poison >= MAX_POISON_STRIKES or n_infrastructure >= MAX_INFRASTRUCTURE_STRIKES",
        "exhausted = False",
        f"{STRIKES}::test_exhausted_strikes_are_a_system_error_without_scores",
    ),
    Sabotage(
        "no backoff",
        LIFECYCLE,
        '"due_at": after(backoff_s * rng.uniform(0.5, 1.0))',
        '"due_at": Now()',
        f"{STRIKES}::test_given_back_evaluation_waits_out_a_growing_backoff",
    ),
    Sabotage(
        "a late sweep blames the file",
        LIFECYCLE,
        'Q(leased_until__gte=F("deadline_at"))',
        "Q(deadline_at__lte=Now())",
        f"{STRIKES}::test_a_sweep_that_comes_after_the_deadline_does_not_blame_the_file_for_a_dead_worker",
    ),
    Sabotage(
        "retry what is no system error",
        LIFECYCLE,
        "filter(pk=evaluation.pk, status=Status.SYSTEM_ERROR)",
        "filter(pk=evaluation.pk)",
        f"{STEPS}::test_only_a_system_error_can_be_retried",
    ),
    Sabotage(
        "the nudge goes out before the commit",
        LIFECYCLE,
        "        # Robust: the rows are committed by then, and nothing may turn that into a failure.\n"
        "        transaction.on_commit(lambda: _announce(evaluation), robust=True)",
        "        _announce(evaluation)",
        f"{STEPS}::test_nudge_is_sent_after_the_commit_and_its_failure_is_nobodys_problem",
    ),
    Sabotage(
        "no unique evaluation of a submission in an edition",
        INITIAL,
        "fields=('submission', 'edition'), name='one_evaluation_per",
        "fields=('submission', 'edition', 'id'), name='one_evaluation_per",
        f"{STEPS}::test_the_database_refuses_a_second_evaluation_of_a_submission_in_an_edition",
    ),
    Sabotage(
        "no sweep of expired leases",
        "leaderboard/workers/queue.py",
        "    lifecycle.release_expired(rng=rng)\n    visibility",
        "    visibility",
        f"{QUEUE}::test_sweep_takes_back_what_dead_workers_hold",
    ),
    Sabotage(
        "every worker sweeps",
        "leaderboard/workers/queue.py",
        "bool(SweepBeat.objects.filter(is_due).update(",
        "bool(SweepBeat.objects.update(",
        f"{QUEUE}::test_workers_that_ask_at_the_same_moment_sweep_once",
    ),
    Sabotage(
        "workers wait for messages",
        "leaderboard/workers/queue.py",
        "    while not stopping.is_set() and worker.run_next(rng=rng):",
        "    while False:",
        f"{QUEUE}::test_a_look_decides_everything_that_waits",
    ),
    Sabotage(
        "one thread for all looks",
        "leaderboard/workers/queue.py",
        "            once.start()\n            once.join()",
        "            once.run()",
        f"{QUEUE}::test_poller_looks_again_after_a_look_that_broke",
    ),
    Sabotage(
        "everybody waits for a broker that hangs",
        "leaderboard/ops/broker.py",
        "    if _rest or connections is None:",
        "    if connections is None:",
        "tests/leaderboard/ops/test_broker.py"
        "::test_a_broker_that_hangs_is_given_up_and_then_left_alone_for_a_while",
    ),
    Sabotage(
        "no flush before the rename",
        "leaderboard/storage/files.py",
        "                    os.fsync(out.fileno())\n",
        "                    pass\n",
        f"{OUTAGES}::test_file_is_flushed_before_it_is_renamed_and_its_directories_after",
    ),
    Sabotage(
        "no flush of the directories",
        "leaderboard/storage/files.py",
        "                os.fsync(descriptor)\n",
        "                pass\n",
        f"{OUTAGES}::test_file_is_flushed_before_it_is_renamed_and_its_directories_after",
    ),
    Sabotage(
        "a full disk is any error",
        "leaderboard/errors/outages.py",
        "isinstance(fault, OSError) and fault.errno in FULL",
        "False",
        f"{OUTAGES}::test_full_disk_is_a_507_problem_and_leaves_nothing",
    ),
    Sabotage(
        "an absent database is any error",
        "leaderboard/errors/outages.py",
        "isinstance(fault, OperationalError | InterfaceError)",
        "False",
        f"{OUTAGES}::test_absent_database_is_a_503_problem",
    ),
    Sabotage(
        "no size limit",
        "leaderboard/submissions/submissions.py",
        "    if upload.size > settings.MAX_PREDICTIONS_BYTES:",
        "    if False:",
        "tests/leaderboard/submissions/test_submit.py::test_file_over_the_limit_is_refused_with_both_sizes",
    ),
    Sabotage(
        "no memory limit for the child",
        "evaluator/limits.py",
        "    resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))\n",
        "",
        f"{RUNS}::test_file_that_kills_its_reader_is_tried_again_behind_the_next_and_given_up_after_three_runs",
    ),
    Sabotage(
        "no processor limit for the child",
        "evaluator/limits.py",
        "    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s + 1))\n",
        "",
        f"{CHILD}::test_processor_time_that_is_used_up_ends_the_child",
    ),
    Sabotage(
        "the child may open files and sockets",
        "evaluator/limits.py",
        "    resource.setrlimit(resource.RLIMIT_NOFILE, (0, 0))\n",
        "    resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))\n",
        f"{CHILD}::test_child_may_open_nothing_write_nothing_and_start_nothing",
    ),
    Sabotage(
        "the child may make any system call",
        "evaluator/limits.py",
        "        system_calls.allow_only_reading(own_limits=own_limits)",
        "        pass",
        f"{TAKEN_OVER}::test_reader_that_is_taken_over_reaches_nothing",
    ),
    Sabotage(
        "the child says whose values these are",
        "leaderboard/scoring/sandbox.py",
        '    if header.get("digest") != digest:',
        "    if False:",
        f"{TAKEN_OVER}::test_a_lie_is_refused_in_words[the digest of another team's file]",
    ),
    Sabotage(
        "the child outlives its worker",
        "evaluator/limits.py",
        "        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)",
        "        pass",
        f"{CHILD}::test_child_ends_with_a_parent_that_was_killed",
    ),
    Sabotage(
        "the child inherits the credentials",
        "leaderboard/scoring/fork_server.py",
        '        "PATH": os.defpath,',
        "        **os.environ,",
        f"{CHILD}::test_child_has_no_credentials_in_its_environment",
    ),
    Sabotage(
        "the fork server keeps what the worker has open",
        "evaluator/predictions/fork_server.py",
        "    os.closerange(N_DESCRIPTORS, resource.getrlimit(resource.RLIMIT_NOFILE)[0])\n    gc.freeze()",
        "    gc.freeze()",
        f"{CHILD}::test_server_has_no_descriptor_but_a_socket_and_no_credentials",
    ),
    Sabotage(
        "the end of the fork server blames the file",
        "leaderboard/scoring/sandbox.py",
        '    raise ChildNotReady("the process that starts reading processes ended")',
        '    raise ChildDied("the process that starts reading processes ended")',
        f"{CHILD}::test_server_that_ends_while_a_child_reads_takes_it_along_and_blames_no_file",
    ),
    Sabotage(
        "a child that cannot start blames the file",
        "leaderboard/scoring/worker.py",
        "OUR_FAULTS = (OSError, sandbox.ChildNotReady, TruthDamaged)",
        "OUR_FAULTS = (OSError, TruthDamaged)",
        f"{RUNS}::test_reader_that_cannot_start_is_not_held_against_the_file",
    ),
    Sabotage(
        "a claim whose answer was lost waits for its lease",
        "leaderboard/scoring/worker.py",
        "        return _retry_on_disconnect(lambda: _leases_of(token))",
        "        raise",
        f"{RUNS}::test_claim_whose_answer_was_lost_is_found_by_its_token",
    ),
    Sabotage(
        "a silent database ends the run",
        "leaderboard/scoring/worker.py",
        "            connection.close()\n            return True",
        "            connection.close()\n            return False",
        f"{RUNS}::test_database_that_is_away_ends_no_run",
    ),
)


def run(tests: list[str], *, tree: Path) -> "subprocess.CompletedProcess[str]":
    """These tests in that tree."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "--no-header", *tests]
    return subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False)


def verdict(sabotage: Sabotage, *, trees: "Queue[Path]") -> str:
    """Make the change in a tree that nobody else uses now, run its test, and undo it."""
    tree = trees.get()
    try:
        before = sabotage.apply(tree)
        done = run([sabotage.test], tree=tree)
        (tree / sabotage.path).write_text(before)
    except OutOfDate as fault:
        return f"OUT OF DATE ({fault})"
    finally:
        trees.put(tree)
    is_red = done.returncode == TESTS_FAILED and "\nFAILED " in done.stdout
    return "red" if is_red else "NOT NOTICED"


def main() -> int:
    """0 if every change turned its test red, and only the change did."""
    tell = sys.stdout.write
    n_at_once = os.cpu_count() or 1
    n_noticed = 0
    with (
        tempfile.TemporaryDirectory(prefix="tsttc-sabotage-") as folder,
        ThreadPoolExecutor(n_at_once) as threads,
    ):
        trees: Queue[Path] = Queue()
        for number in range(n_at_once):
            trees.put(Path(shutil.copytree(REPOSITORY, Path(folder) / str(number), ignore=left_out)))
        untouched = run(sorted({sabotage.test for sabotage in SABOTAGES}), tree=Path(folder) / "0")
        if untouched.returncode != 0:
            tell(f"sabotage: the tests fail without any change:\n{untouched.stdout[-4000:]}\n")
            return 1
        found = threads.map(partial(verdict, trees=trees), SABOTAGES)
        for sabotage, said in zip(SABOTAGES, found, strict=True):
            n_noticed += said == "red"
            tell(f"{said}  {sabotage.what}  ({sabotage.test.partition('::')[2]})\n")
            sys.stdout.flush()
    tell(f"sabotage: changes={len(SABOTAGES)} noticed={n_noticed}\n")
    return 0 if n_noticed == len(SABOTAGES) else 1


if __name__ == "__main__":
    sys.exit(main())
