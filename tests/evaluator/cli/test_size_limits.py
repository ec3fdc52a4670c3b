"""What the server refuses for its size, `check` refuses in the same words."""

import gzip
from pathlib import Path

import pytest

from evaluator.cli.connection import in_words
from evaluator.client.answers import Refused
from evaluator.predictions.documents import MAX_FILE_BYTES, too_large
from leaderboard import settings
from tests.evaluator.worlds import EXAMPLES, Tsttc

MANIFEST = EXAMPLES / "manifest.csv"


def test_the_library_knows_the_limit_of_the_server() -> None:
    assert settings.MAX_PREDICTIONS_BYTES == MAX_FILE_BYTES


@pytest.mark.slow
@pytest.mark.parametrize("name", ["predictions.json", "predictions.csv"])
def test_check_refuses_what_the_server_refuses_for_its_size(tsttc: Tsttc, tmp_path: Path, name: str) -> None:
    data = (EXAMPLES / "predictions.json").read_bytes()
    large = data.rstrip() + b" " * (MAX_FILE_BYTES - len(data) + 2)
    path = tmp_path / name
    path.write_bytes(large)
    refused = tsttc("check", path, "--manifest", MANIFEST)
    assert refused.exit_code == 1
    assert too_large(n_bytes=len(large), max_bytes=MAX_FILE_BYTES) in refused.stderr
    assert "20 MB" in refused.stderr
    assert "gzip" in refused.stderr
    packed = tmp_path / "predictions.json.gz"
    packed.write_bytes(gzip.compress(large))
    assert tsttc("check", packed, "--manifest", MANIFEST).exit_code == 0


def test_a_refusal_by_size_shows_the_words_of_the_server_and_else_names_gzip() -> None:
    refusal = {"url": "https://a.example", "status": 413, "title": "Too Large", "code": "", "problems": ()}
    sentence = too_large(n_bytes=60_000_000, max_bytes=MAX_FILE_BYTES)
    assert in_words(_refused(**refusal, detail=sentence), url="https://a.example").message == sentence
    assert "gzip" in in_words(_refused(**refusal, detail=""), url="https://a.example").message


def test_a_failure_of_the_server_says_once_that_it_is_not_your_fault() -> None:
    refusal = {"url": "https://a.example", "status": 502, "title": "Bad Gateway", "code": "", "problems": ()}
    failure = in_words(_refused(**refusal, detail=""), url="https://a.example")
    assert f"{failure.message} {failure.hint}".count("This is not your fault.") == 1


@pytest.mark.parametrize("path", ["/api/v1", "/board/demo/", "/api/v1/"])
def test_an_address_with_a_path_is_answered_with_that_of_the_site(path: str) -> None:
    site = "https://a.example"
    refusal = {"url": site, "status": 404, "title": "Not Found", "code": "not-found", "problems": ()}
    failure = in_words(_refused(**refusal, detail="Nothing."), url=f"{site}{path}")
    assert failure.hint.endswith(f"The address is that of the site, such as {site}.")
    assert "such as" not in in_words(_refused(**refusal, detail="Nothing."), url=site).hint
    unknown = refusal | {"status": 401, "code": "not-authenticated"}
    assert f"{site}/tokens/," in in_words(_refused(**unknown, detail="No."), url=f"{site}{path}").hint


@pytest.mark.parametrize("path", ["/api/v1", "/board/demo/"])
def test_without_a_token_the_page_of_tokens_is_named_whatever_the_path(tsttc: Tsttc, path: str) -> None:
    result = tsttc("quota", "--server", f"https://a.example{path}")
    assert (result.exit_code, "https://a.example/tokens/," in result.stderr) == (4, True)


def _refused(**fields: object) -> Refused:
    return Refused(**{"retry_after_s": None, "document": None, **fields})  # type: ignore[arg-type]
