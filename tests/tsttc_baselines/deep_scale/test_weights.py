"""Weights are read without torch; nothing in them is run, and every fault is a problem in words."""

import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evaluator.problems import Rejected
from tests.tsttc_baselines.deep_scale.made_weights import (
    Tensors,
    checkpoint,
    model,
    random_tensors,
    tensor,
    text,
    written,
)
from tsttc_baselines.deep_scale.checkpoint import MAX_BYTES
from tsttc_baselines.deep_scale.weights import CARD, Use, Weights, read_weights, write_weights

TENSORS = random_tensors()
LINEAR = "head.scale_preds.bias"


def rejection(path: Path) -> str:
    with pytest.raises(Rejected) as caught:
        read_weights(path)
    assert all(problem.code in {"bad-weights", "forbidden-pickle"} for problem in caught.value.problems)
    return str(caught.value)


def same(one: Weights, tensors: Tensors) -> bool:
    return all(np.array_equal(one.tensors[name], values) for name, values in tensors.items())


def test_a_checkpoint_is_read_without_torch(tmp_path: Path) -> None:
    weights = read_weights(written(tmp_path / "c.pth", checkpoint(TENSORS)))
    assert same(weights, TENSORS)
    assert weights.use == Use()


def test_the_own_file_says_how_to_use_it_and_comes_back_the_same(tmp_path: Path) -> None:
    path = tmp_path / "own.npz"
    weights = Weights(TENSORS, Use("cosine", 25, 40.0, 8.0), {"seed": 7})
    write_weights(path, weights)
    read_back = read_weights(path)
    assert same(read_back, TENSORS)
    assert (read_back.use, read_back.card) == (weights.use, {"seed": 7})
    again = tmp_path / "again.npz"
    write_weights(again, read_back)
    assert again.read_bytes() == path.read_bytes()
    with np.load(path, allow_pickle=False) as opened:
        assert opened[LINEAR].tolist() == TENSORS[LINEAR].tolist()


def without(name: str) -> Tensors:
    return {key: values for key, values in TENSORS.items() if key != name}


def changed(**values: object) -> Tensors:
    return TENSORS | {LINEAR: np.asarray(values["to"], dtype=np.float32)}


def replaced(body: bytes) -> bytes:
    """The pickle with another last tensor."""
    whole = model(TENSORS)
    start = whole.index(text(LINEAR)) + len(text(LINEAR))
    return whole[:start] + body + whole[whole.index(text("backbone.stem.bn.num_batches_tracked")) :]


LAST = len(TENSORS) - 1

FAULTY: dict[str, tuple[Callable[[], bytes], str]] = {
    "a tensor is missing": (lambda: checkpoint(without(LINEAR)), f"has no tensor {LINEAR}; expected one of"),
    "a tensor of another network": (
        lambda: checkpoint(TENSORS | {"head.more": TENSORS[LINEAR]}),
        'The network has no tensor "head.more"',
    ),
    "another shape": (
        lambda: checkpoint(changed(to=np.zeros(25))),
        f"The tensor {LINEAR} has the shape (25,); expected (20,)",
    ),
    "NaN": (lambda: checkpoint(changed(to=[np.nan] * 20)), f"The tensor {LINEAR} has NaN or infinity"),
    "a fifth global": (
        lambda: checkpoint(TENSORS, pickled=b"\x80\x02cposix\nsystem\n(" + text("false") + b"tR."),
        'The checkpoint names "posix.system"; expected only collections.OrderedDict',
    ),
    "a state for a global": (
        lambda: checkpoint(TENSORS, pickled=b"\x80\x02ctorch\nFloatStorage\n}(" + text("a") + b"I1\nub."),
        "not an intact pickle of tensors",
    ),
    "whole numbers": (
        lambda: checkpoint(TENSORS, pickled=replaced(tensor(LAST, (20,), n_items=20, kind="LongStorage"))),
        f"The tensor {LINEAR} does not hold numbers of float32",
    ),
    "beyond its storage": (
        lambda: checkpoint(TENSORS, pickled=replaced(tensor(LAST, (20,), n_items=20, offset=8))),
        f"The tensor {LINEAR} begins at 8 of 20 numbers",
    ),
    "a cut zip": (lambda: checkpoint(TENSORS)[:-40], "The file is not a complete zip"),
    "a zip bomb": (lambda: zipped({"c/data.pkl": bytes(MAX_BYTES + 1)}), "The file unpacks to 1 entries"),
}


def zipped(entries: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in entries.items():
            archive.writestr(name, data)
    return buffer.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTY)
def test_a_faulty_checkpoint_is_a_problem_in_words(tmp_path: Path, fault: str) -> None:
    make, words = FAULTY[fault]
    assert words in rejection(written(tmp_path / "c.pth", make()))


def test_an_entry_that_lies_about_its_size_is_not_unpacked(tmp_path: Path) -> None:
    honest = zipped({"c/data.pkl": bytes(60_000)})
    lying = honest.replace((60_000).to_bytes(4, "little"), (60).to_bytes(4, "little"))
    assert 'The entry "c/data.pkl"' in rejection(written(tmp_path / "c.pth", lying))


@pytest.fixture(scope="module")
def own_entries(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    path = tmp_path_factory.mktemp("own") / "own.npz"
    write_weights(path, Weights(TENSORS))
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        (f"{LINEAR}.npy", None, f"The file has no tensor {LINEAR}"),
        (f"{LINEAR}.npy", b"short", f"The tensor {LINEAR} has 5 bytes; expected 208"),
        (f"{LINEAR}.npy", bytes(208), f"The tensor {LINEAR} is not an array (20,) of float32"),
        (CARD, b"{", "card.json is not a JSON object"),
        (CARD, b'{"use": {"similarity": "dot"}}', '"use" in card.json says nothing that this version can do'),
    ],
)
def test_a_faulty_own_file_is_a_problem_in_words(
    own_entries: dict[str, bytes], tmp_path: Path, name: str, data: bytes | None, words: str
) -> None:
    entries = {key: content for key, content in own_entries.items() if key != name}
    if data is not None:
        entries[name] = data
    assert words in rejection(written(tmp_path / "own.npz", zipped(entries)))
