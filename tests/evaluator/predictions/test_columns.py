"""The columnar reading and the strict reading are the same function; and no bytes break either."""

import json
import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from evaluator import Manifest, Rejected, read_predictions
from evaluator.metrics.scale import Floats
from evaluator.predictions.alignment import read_slowly
from evaluator.predictions.columns import read_column
from tests.evaluator.faulty_files import CASES, FURTHER, MANIFEST
from tests.evaluator.worlds import envelope, flat, make_truth

SMALL = make_truth([4.0, -10.0, 1.0]).manifest
WIDE = make_truth([4.0] * 7, anno_ids=[5, 42, 999, 1_000, 65_536, 999_999, 100_000]).manifest
HUGE = make_truth([4.0] * 3, anno_ids=[0, 1_000_000, 2**63 - 1]).manifest
MANIFESTS = [SMALL, WIDE, HUGE]


def reading(data: bytes, manifest: Manifest) -> object:
    """Read a file strictly: its values and envelope, or the codes of its problems."""
    try:
        predictions = read_slowly(data, manifest)
    except Rejected as rejected:
        return sorted({problem.code for problem in rejected.problems})
    return (
        predictions.ttc_s.tolist(),
        predictions.keys,
        predictions.document.unit,
        predictions.document.meta,
        predictions.document.enveloped,
    )


def values_or_rejection(data: bytes, manifest: Manifest) -> Floats | Rejected:
    try:
        return read_predictions(data, manifest=manifest).ttc_s
    except Rejected as rejected:
        return rejected


def assert_equivalent(data: bytes, manifest: Manifest, *, by_columns: bool = False) -> None:
    """By columns a file gives what the strict reading gives, or nothing unless it must be read so."""
    quick = read_column(data, manifest)
    assert quick is not None or not by_columns
    if quick is not None:
        document = quick.document
        assert reading(data, manifest) == (
            quick.ttc_s.tolist(),
            quick.keys,
            document.unit,
            document.meta,
            document.enveloped,
        )


# --- files as machines write them ------------------------------------------------------------------------

spellings = st.sampled_from(
    [
        "1",
        "-12.9",
        "0.1",
        "1e0",
        "-1.5E-3",
        "5.0e-324",
        "1.7976931348623157e308",
        "9007199254740993",
        "123456789012345678901234567890",
        "0.30000000000000004",
        "18446744073709551616",
        "1e22",
        "1e23",
        "8.988465674311580e307",
        "100000000000000000000000",
    ]
) | st.floats(allow_nan=False, allow_infinity=False).filter(bool).map(repr)
oddities = st.sampled_from(
    [
        "0",
        "0.0",
        "1e400",
        "1e-400",
        "NaN",
        "Infinity",
        "null",
        "true",
        '"5"',
        "[5]",
        "{}",
        '{"0":1}',
        "05",
        "+5",
        ".5",
        "5e",
        "-",
        "0x10",
        "1_000",
        "5,5",
        "tru",
        "1e5.5",
        "٣",
        "1.5.5",
        '"',
        "",
    ]
)
blanks = st.text(" \t\r\n", max_size=3)


@st.composite
def files(draw: st.DrawFn, *, values: st.SearchStrategy[str]) -> tuple[bytes, Manifest]:
    """A file with the manifest's keys in any order and layout, flat or in an envelope."""
    manifest = draw(st.sampled_from(MANIFESTS))
    natural = draw(st.booleans())
    keys = list(manifest.natural_keys if natural else manifest.anno_id_keys)
    if draw(st.booleans()):
        keys = draw(st.permutations(keys))
    colon, comma = draw(blanks) + ":" + draw(blanks), draw(blanks) + "," + draw(blanks)
    members = comma.join(f'"{key}"{colon}{draw(values)}' for key in keys)
    text = "{" + draw(blanks) + members + draw(blanks) + "}"
    head, tail = draw(
        st.sampled_from(
            [
                ("", ""),
                ('{"unit":"ttc","predictions":', "}"),
                ('{"unit": "scale_ratio", "fps": 2, "predictions" : ', "}"),
                ('{"predictions": ', ', "frame_gap": 3, "unit": "scale_ratio", "meta": {"a": [1, "}"]}}'),
                ('{"meta": {"predictions": {"0": 1}}, "unit": "ttc", "predictions": ', "}"),
                ('{"unit": "ttc", "predictions": {}, "predictions": ', "}"),
                ('{"unit": "ttc", "predictions": ', ', "predictions": {}}'),
                ('{"unit": "ttc", "predictions": ', ', "unit": "ttc"}'),
                ('{"unit": "ttc", "meta": "\\"predictions\\": {", "predictions": ', "}"),
            ]
        )
    )
    return (draw(blanks) + head + text + tail + draw(blanks)).encode(), manifest


@pytest.mark.slow
@given(file=files(values=spellings))
def test_good_files_read_the_same_both_ways(file: tuple[bytes, Manifest]) -> None:
    assert_equivalent(*file)


@pytest.mark.slow
@settings(max_examples=300)
@given(file=files(values=spellings | oddities))
def test_odd_values_read_the_same_both_ways(file: tuple[bytes, Manifest]) -> None:
    assert_equivalent(*file)


LONG = make_truth([4.0] * 40).manifest


@pytest.mark.parametrize("name", ['a"b', "a\\b", "a\nb", "ü"])
def test_names_that_json_writes_in_another_way_are_read_too(name: str) -> None:
    manifest = make_truth([4.0, 2.0, 3.0], bags=[name, "b", "c"]).manifest
    for is_ascii in (True, False):
        data = json.dumps(dict.fromkeys(manifest.natural_keys, 2.5), ensure_ascii=is_ascii).encode()
        assert_equivalent(data, manifest, by_columns=True)
    raw = "{" + ",".join(f'"{key}":2.5' for key in manifest.natural_keys) + "}"
    assert_equivalent(raw.encode(), manifest)


TOKENS = ['"0"', '"1"', '"2"', '"5"', '"42"', ":", ",", "{", "}", "[", "]", " ", "\n", "5.3", "1", "e", "-"]
TOKENS += ["null", "true", "NaN", '"', "\\", "\\u0030", '"unit"', '"ttc"', '"predictions"', '"fps"', "0"]
TOKENS += ["\x00", "é"]


@pytest.mark.slow
@settings(max_examples=500)
@given(
    start=st.sampled_from(
        [flat([1.5, 2.5, 3.5]), b'{"0":1,"1":2,"2":3}', envelope({"0": 1, "1": 2, "2": 3}, unit="ttc")]
    ),
    edits=st.lists(st.tuples(st.integers(0, 80), st.integers(0, 4), st.sampled_from(TOKENS)), max_size=3),
)
@example(start=b'{"0"5.3:,"1":2,"2":3}', edits=[])
@example(start=b'{"0":5.25,"1":6.25,"2":7.25},{}', edits=[])
@example(start=b'{"0":5,"1":6,"2":7}', edits=[])
@example(start=b'{"0": 1.5, "1": 2.5, "2": 3.5, "2": 3.5}', edits=[])
@example(start=b'{"0": 1.5, "1": 2.5, "1": 3.5}', edits=[])
@example(start=b'{"0": 1.5, "1": 2.5}', edits=[])
@example(start=b'{"0": 1.5, "1": 2.5, "3": 3.5}', edits=[])
def test_mangled_files_read_the_same_both_ways(start: bytes, edits: Sequence[tuple[int, int, str]]) -> None:
    data = start
    for at, n_removed, token in edits:
        data = data[:at] + token.encode() + data[at + n_removed :]
    assert_equivalent(data, SMALL)


documents = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(["0", "1", "2", "unit", "fps", "meta", "predictions", "x"]), inner, max_size=5
        )
    ),
    max_leaves=20,
).map(json.dumps)


@pytest.mark.slow
@settings(max_examples=500)
@given(data=st.binary(max_size=200) | (st.text(max_size=100) | documents).map(str.encode))
@example(data=b'{"\xe4":1,"1":2,"2":3}')
@example(data=b'{"0":1,"1":2,"2":\xff}')
@example(data=b'{"unit":"ttc","predictions":{"0":1,"1":2,"2":3},"meta":{"\xff":1}}')
@example(data=b'{"\\ud800":1,"1":2,"2":3}')
@example(data=b"\x00")
@example(data=b"\xef\xbb\xbf")
@example(data=b"\xff\xfe{\x00}\x00")
@example(data=b'"' * 1000)
@example(data=b'{"0":' * 100)
@example(data=b"[" * 10_000)
@example(data=b'"\\')
@example(data=b"1" * 5000)
@example(data=b'{"unit":"scale_ratio","frame_gap":' + b"9" * 5000 + b',"predictions":{"0":1,"1":1,"2":1}}')
@example(data=b'{"unit":"scale_ratio","frame_gap":1e400,"predictions":{"0":1,"1":1,"2":1}}')
@example(data=b'{"unit":"scale_ratio","fps":1e-320,"predictions":{"0":1e308,"1":1e-308,"2":1}}')
def test_no_bytes_raise_anything_but_a_rejection(data: bytes) -> None:
    assert_equivalent(data, SMALL)
    outcome = values_or_rejection(data, SMALL)
    if isinstance(outcome, Rejected):
        assert 1 <= len(outcome.problems) <= outcome.n_problems + 1
        assert json.loads(outcome.to_json()) == outcome.as_dict()
        assert all(line.isprintable() for line in str(outcome).splitlines())
    else:
        assert np.abs(outcome).min() > 0


@pytest.mark.parametrize("name", [*CASES, *FURTHER])
def test_the_known_files_read_the_same_both_ways(name: str) -> None:
    assert_equivalent(FURTHER[name] if name in FURTHER else CASES[name][0], MANIFEST)


# --- which way is taken ----------------------------------------------------------------------------------


@pytest.mark.parametrize("manifest", MANIFESTS)
@pytest.mark.parametrize("separators", [(",", ":"), (", ", ": "), (",\n  ", ": ")])
@pytest.mark.parametrize("natural", [False, True])
def test_files_of_common_layouts_are_read_by_columns(
    manifest: Manifest, separators: tuple[str, str], natural: bool
) -> None:
    keys = manifest.natural_keys if natural else manifest.anno_id_keys
    values = [(-1) ** row * (1.5 + row / 7) for row in range(manifest.n_sequences)]
    for order in (slice(None), slice(None, None, -1)):
        members = dict(zip(keys[order], values[order], strict=True))
        data = json.dumps(members, separators=separators).encode()
        assert_equivalent(data, manifest, by_columns=True)
        assert_equivalent(b'{"unit": "ttc", "predictions": ' + data + b"}", manifest, by_columns=True)


@pytest.mark.parametrize("manifest", [LONG, WIDE])
@pytest.mark.parametrize("separators", [(",", ":"), (", ", ": "), (",\n    ", ": ")])
def test_a_doubled_key_is_seen_in_any_order(manifest: Manifest, separators: tuple[str, str]) -> None:
    n = manifest.n_sequences
    last_two_swapped = [*range(n - 2), n - 1, n - 2]
    for order in (range(n), last_two_swapped, [*range(n)[::-1]]):
        members = {manifest.anno_id_keys[row]: row + 0.25 for row in order}
        data = json.dumps(members, separators=separators)
        assert_equivalent(data.encode(), manifest, by_columns=True)
        assert_equivalent(data.replace(".25,", ".25 ,").encode(), manifest)
        for key in manifest.anno_id_keys[-3:]:
            doubled = data.replace(f'"{key}"', f'"{manifest.anno_id_keys[0]}"')
            assert_equivalent(doubled.encode(), manifest)
            assert read_column(doubled.encode(), manifest) is None


def test_rates_and_ratios_are_converted_the_same_both_ways() -> None:
    for fields in (
        {"fps": 2},
        {"frame_gap": 3},
        {"fps": {"0": 2, "1": 5, "2": 10}},
        {"frame_gap": {"0": 2, "1": 5, "2": 1}},
    ):
        data = envelope({"0": 0.9, "1": 1.2, "2": 1.0}, unit="scale_ratio", **fields)
        assert_equivalent(data, SMALL, by_columns=True)
        assert read_predictions(data, manifest=SMALL).ttc_s[2] == math.inf
