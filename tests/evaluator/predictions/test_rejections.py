"""Every fault of a prediction file: its code, its pointer, its words. Wording is part of the interface."""

import tracemalloc

import pytest

from evaluator import PROBLEM_CODES, Manifest, Problem, Rejected, read_predictions
from evaluator.predictions.documents import parse, too_large
from evaluator.predictions.loading import read_sent
from evaluator.predictions.writing import template
from tests.evaluator.faulty_files import CASES, GOOD, MANIFEST
from tests.evaluator.worlds import flat, make_truth


def rejection(data: bytes, *, manifest: Manifest = MANIFEST, max_bytes: int | None = None) -> Rejected:
    with pytest.raises(Rejected) as rejected:
        read_predictions(data, manifest=manifest, max_bytes=max_bytes)
    return rejected.value


@pytest.mark.parametrize("name", CASES)
def test_a_faulty_file_is_rejected_in_these_words(name: str) -> None:
    data, *expected = CASES[name]
    with pytest.raises(Rejected) as rejected:
        read_sent(data, manifest=MANIFEST)
    assert rejected.value.problems[0] == Problem(*expected)
    assert all(problem.code in PROBLEM_CODES for problem in rejected.value.problems)


def test_a_file_over_the_limit_is_not_looked_at() -> None:
    problem = rejection(b"\xff" * 101, max_bytes=100).problems[0]
    assert problem == Problem("too-large", too_large(n_bytes=101, max_bytes=100))
    assert problem.message.startswith("The file is 101 bytes; expected at most 100 bytes. gzip makes")


def test_the_empty_template_is_one_problem_not_one_for_each_sequence() -> None:
    rejected = rejection(template(MANIFEST))
    message = "This is the empty template: all 4 values are null; expected a number for every sequence."
    assert (rejected.problems, rejected.n_problems) == ((Problem("not-a-number", message),), 1)


def test_all_faults_are_reported_at_once() -> None:
    rejected = rejection(b'{"0": NaN, "1": 0, "2": "x", "7": null, "1": 2}')
    assert [(problem.code, problem.where) for problem in rejected.problems] == [
        ("unknown-keys", "/7"),
        ("duplicate-keys", "/1"),
        ("missing-keys", "/3"),
        ("nan", "/0"),
        ("zero", "/1"),
        ("not-a-number", "/2"),
        ("not-a-number", "/7"),
    ]
    assert rejected.n_problems == 7


def test_many_missing_and_unknown_keys_are_counted_and_twenty_are_named() -> None:
    manifest = make_truth([4.0] * 100).manifest
    unknown, missing = rejection(flat({f"x{row}": 1.0 for row in range(30)}), manifest=manifest).problems
    assert "x19" in unknown.message
    assert "x20" not in unknown.message
    assert unknown.message.startswith("30 keys are not in the manifest: ")
    assert missing.message.startswith("100 sequences have no value: 0, 1, 2, ")
    assert "18, 19, … (the first 20); expected" in missing.message


@pytest.mark.parametrize(
    "meta",
    [
        b'{"a": NaN}',
        b'{"a": [1e999]}',
        b'{"a": "\\u0000"}',
        b'{"\\u0000": 1}',
        b'{"a": "\\ud800"}',
        b'{"a": "' + b"x" * 70_000 + b'"}',
        b'{"a": 1, "a": 2}',
        b"[]",
        b"true",
    ],
)
def test_meta_that_no_database_would_keep_is_refused(meta: bytes) -> None:
    data = b'{"unit": "ttc", "meta": ' + meta + b', "predictions": ' + flat(GOOD) + b"}"
    assert [problem.code for problem in rejection(data).problems] == ["bad-meta"]


@pytest.mark.parametrize("key", ["00", " 0", "0 ", "+0", "-0", "0.0", "0e0", "٠", "0x0", "", "None"])
def test_only_the_plain_decimal_spelling_is_an_anno_id(key: str) -> None:
    members: dict[str, float] = {key: 5.31, "1": -12.9, "2": 0.4, "3": 100.0}
    assert {problem.code for problem in rejection(flat(members)).problems} == {"unknown-keys", "missing-keys"}


def test_a_key_that_spells_its_number_otherwise_is_unknown_even_at_equal_length() -> None:
    manifest = make_truth([4.0, 5.0], anno_ids=[100, 7]).manifest
    assert rejection(b'{"1e2": 5.0, "7": 1.0}', manifest=manifest).problems[0].code == "unknown-keys"


def test_every_code_of_prediction_files_has_a_case_here() -> None:
    here = {code for _, code, *_ in CASES.values()} | {"too-large"}
    codes = list(PROBLEM_CODES)
    of_predictions = set(codes[: codes.index("undefined-error")])
    assert of_predictions == here


HOSTILE_STRINGS = b"\xef\xbb\xbf" + '["\U0001f600",'.encode() + b'""[' * 100_000


@pytest.mark.slow
def test_a_file_of_strings_and_brackets_takes_a_few_times_its_size() -> None:
    tracemalloc.start()
    try:
        with pytest.raises(Rejected) as rejected:
            parse(HOSTILE_STRINGS)
        _, peak_bytes = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert [problem.code for problem in rejected.value.problems] == ["too-deep"]
    assert peak_bytes < 10 * len(HOSTILE_STRINGS)


def test_a_file_with_more_quotation_marks_than_its_members_can_have_is_refused_before_it_is_read() -> None:
    data = b'["a"' + b'""' * 200_100 + b"]"
    problem = rejection(data).problems[0]
    assert problem == Problem(
        "too-many-members",
        "The file has 400,202 quotation marks; expected at most 400,032, four for each member.",
    )
