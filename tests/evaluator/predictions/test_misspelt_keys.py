"""Keys that are almost right: the manifest's spelling is shown, and what differs."""

import json
from collections.abc import Callable, Iterable

import pytest

from evaluator import Manifest, Problem, Rejected, read_predictions
from evaluator.predictions.misspelt import SPREADSHEET
from evaluator.problems import plain_pointer
from tests.evaluator.worlds import make_truth

MANIFEST = make_truth([4.0] * 20, bags=[f"00{number // 4:02}" for number in range(20)]).manifest
KEYS = MANIFEST.natural_keys


def problems_of(keys: Iterable[str], *, manifest: Manifest = MANIFEST) -> dict[str, Problem]:
    with pytest.raises(Rejected) as rejected:
        read_predictions(json.dumps(dict.fromkeys(keys, 5.0)).encode(), manifest=manifest)
    return {problem.code: problem for problem in rejected.value.problems}


def part(number: int, change: Callable[[str], str]) -> Callable[[str], str]:
    def changed(key: str) -> str:
        parts = key.split("/")
        parts[number] = change(parts[number])
        return "/".join(parts)

    return changed


SLIPS: dict[str, tuple[Callable[[str], str], str]] = {
    "zeros lost": (part(0, lambda text: str(int(text))), "leading zeros are missing"),
    "zeros added": (part(1, lambda text: f"0{text}"), "leading zeros are too many"),
    "float ts": (part(2, lambda text: f"{text}.0"), "a whole number is written as a float"),
    "scientific ts": (part(2, lambda text: f"{float(text):e}"), "a whole number is written as a float"),
    "float track": (part(3, lambda text: f"{text}.0"), "a whole number is written as a float"),
    "cam": (part(1, lambda text: f"cam{text}"), "a part has letters before its number"),
    "camera": (part(1, lambda text: f"Camera_{text}"), "a part has letters before its number"),
    "backslashes": (lambda key: key.replace("/", "\\"), "parts are separated by / , not by \\"),
    "commas": (lambda key: key.replace("/", ","), "parts are separated by /"),
    "a tuple": (lambda key: str(tuple(key.split("/"))), "parts are separated by /"),
    "seconds": (part(2, lambda text: str(int(text) / 1e9)), "ts is in nanoseconds, not in seconds"),
    "milliseconds": (part(2, lambda text: str(int(text) // 10**6)), "not in milliseconds"),
    "microseconds": (part(2, lambda text: str(int(text) // 10**3)), "not in microseconds"),
}


@pytest.mark.parametrize("name", SLIPS)
def test_misspelt_natural_keys_show_the_spelling_of_the_manifest_and_the_difference(name: str) -> None:
    change, words = SLIPS[name]
    problems = problems_of(map(change, KEYS))
    unknown, missing = problems["unknown-keys"].message, problems["missing-keys"].message
    assert f'means "{KEYS[0]}": ' in unknown
    assert words in unknown
    assert KEYS[0] in missing
    assert "by natural key" in missing


def test_several_differences_are_all_named() -> None:
    keys = [part(1, "cam{}".format)(part(2, "{}.0".format)(key)).lstrip("0") for key in KEYS]
    message = problems_of(keys)["unknown-keys"].message
    for words in ("leading zeros", "letters before", "as a float"):
        assert words in message


@pytest.mark.parametrize("change", ["{}.0", "0{}", " {} ", "id_{}", "{}e0"])
def test_misspelt_anno_ids_show_the_spelling_of_the_manifest(change: str) -> None:
    problems = problems_of(change.format(number) for number in range(20))
    assert f'Probably "{change.format(0)}" means "0"' in problems["unknown-keys"].message
    assert "by anno_id" in problems["missing-keys"].message


@pytest.mark.parametrize("keys", [[f"9999/1/{n}/7" for n in range(20)], [f"frame-{n}-x" for n in range(20)]])
def test_keys_that_are_not_almost_right_get_no_advice(keys: list[str]) -> None:
    assert "Probably" not in problems_of(keys)["unknown-keys"].message


@pytest.mark.parametrize("rounded", ["1.67765E+18", "2e+09", "1.7E+12"])
def test_times_that_a_spreadsheet_has_rounded_are_named(rounded: str) -> None:
    keys = [part(2, lambda _: rounded)(key) + f"{number}" for number, key in enumerate(KEYS)]
    assert SPREADSHEET in problems_of(keys)["unknown-keys"].message


def test_two_keys_that_differ_by_zeros_alone_are_not_guessed() -> None:
    bags = ["7"] * 4 + ["07"] * 4
    manifest = make_truth([4.0] * 8, bags=bags).manifest
    same = {key.split("/", 1)[1] for key in manifest.natural_keys}
    message = problems_of([f"007/{key}" for key in same], manifest=manifest)["unknown-keys"].message
    assert ("Probably" in message) == (len(same) == 8)


def test_a_whole_recording_that_is_missing_is_one_item() -> None:
    for keys in (KEYS, MANIFEST.anno_id_keys):
        message = problems_of([*keys[:4], *keys[12:17]])["missing-keys"].message
        shown = f"all 4 sequences of 0001, all 4 sequences of 0002, {', '.join(keys[17:])}; expected"
        assert f"11 sequences have no value: {shown}" in message


def test_a_hostile_key_is_answered_without_guessing() -> None:
    keys = ["a" * 100_000 + "/1/1/1", "/".join("1" * 50_000), "0/0/1e999999999/0", "1e9999", "sNaN", "-0", ""]
    assert "Probably" not in problems_of(keys)["unknown-keys"].message


def test_a_pointer_is_a_plain_key_for_people() -> None:
    text = json.dumps(dict.fromkeys(KEYS, 5.0) | {KEYS[0]: 0, KEYS[1]: 0})
    with pytest.raises(Rejected) as rejected:
        read_predictions(text.encode(), manifest=MANIFEST)
    [problem] = rejected.value.problems
    assert problem.where == "/" + KEYS[0].replace("/", "~1")
    assert str(problem).startswith(f'"{KEYS[0]}": The value is 0')
    assert str(problem).endswith(f'1 more place has this problem: "{KEYS[1]}".')
    assert "~1" not in str(rejected.value)
    assert "~1" in json.dumps(rejected.value.as_dict())


@pytest.mark.parametrize(
    ("where", "plain"),
    [
        ("", ""),
        ("line 3, column 1", "line 3, column 1"),
        ("byte 0", "byte 0"),
        ("/0", '"0"'),
        ("/predictions", '"predictions"'),
        ("/predictions/a~1b", '"a/b"'),
        ("/frame_gap/a~1b~0c", '"a/b~c" in "frame_gap"'),
        ("/~01", '"~1"'),
    ],
)
def test_the_plain_pointer_a_pointer(where: str, plain: str) -> None:
    assert plain_pointer(where) == plain
