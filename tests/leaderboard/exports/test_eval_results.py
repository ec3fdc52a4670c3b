"""Results for the Hugging Face Hub are read by its own library, and name what everybody may know."""

import re

import msgspec
import pytest
import yaml
from django.test import Client
from huggingface_hub import EvalResultEntry, eval_result_entries_to_yaml, parse_eval_result_entries
from pytest_django.fixtures import Settings

from leaderboard.models import Edition, Method, User, Visibility
from tests import board_rows, builders
from tests.leaderboard.exports.test_exports import csv_rows, text_of


def name_dataset(settings: Settings, **changed: str | None) -> None:
    """Give the benchmark's dataset other names on the Hub."""
    dataset = msgspec.structs.replace(settings.BENCHMARK.dataset, **changed)
    settings.BENCHMARK = msgspec.structs.replace(settings.BENCHMARK, dataset=dataset)


def entries_of(text: str) -> list[EvalResultEntry]:
    """What the library reads, which writes the same again."""
    document = yaml.safe_load(text)
    entries = parse_eval_result_entries(document)
    assert eval_result_entries_to_yaml(entries) == document
    return entries


def test_each_public_method_has_an_entry_that_the_library_of_the_hub_reads(
    edition: Edition, owner: User, client: Client, settings: Settings
) -> None:
    name_dataset(settings, hugging_face_id="example/tsttc", hugging_face_task="ttc-{split}")
    methods = board_rows.fill(edition, n=4, user=owner)
    Method.objects.filter(pk=methods[0].pk).update(name="Owl: #1 \u2028- value: 0 “τ” 🦉")
    Method.objects.filter(pk=methods[1].pk).update(visibility=Visibility.ANONYMOUS)
    Method.objects.filter(pk=methods[2].pk).update(visibility=Visibility.PRIVATE)
    builders.board_changed("test")
    shown = {str(methods[0].pk), str(methods[3].pk)}
    rows = [row for row in csv_rows(client) if row["method_id"] in shown]
    entries = entries_of(text_of(client, "yaml"))
    assert [(entry.value, entry.date) for entry in entries] == [(float(r["mid"]), r["date"]) for r in rows]
    pages = [entry.source_url.removeprefix(settings.SITE_URL) for entry in entries]
    assert pages == [f"/methods/{row['method_id']}/" for row in rows]
    assert {client.get(page).status_code for page in pages} == {200}
    for entry in entries:
        assert (entry.dataset_id, entry.task_id) == ("example/tsttc", "ttc-test")
        assert entry.notes == "test, edition 1, protocol tsttc-1: MiD ×10⁻⁴, lower is better"
    for row, entry in zip(rows, entries, strict=True):
        page = client.get(f"/methods/{row['method_id']}/").text
        (code,) = re.findall(r'<code id="eval-result">(.*?)</code>', page, re.DOTALL)
        assert entries_of(code.replace("&quot;", '"')) == [entry]
    assert "eval-result" not in client.get(f"/methods/{methods[1].pk}/").text


@pytest.mark.parametrize("has_dataset", [True, False])
def test_a_site_without_a_dataset_of_the_hub_offers_no_such_export(
    edition: Edition, owner: User, client: Client, settings: Settings, has_dataset: bool
) -> None:
    name_dataset(settings, hugging_face_id="example/tsttc" if has_dataset else None)
    (method,) = board_rows.fill(edition, n=1, user=owner)
    assert ("/board/test.yaml" in client.get("/board/test/").text) == has_dataset
    assert ("eval-result" in client.get(f"/methods/{method.pk}/").text) == has_dataset
    text = text_of(client, "yaml")
    assert len(entries_of(text)) == has_dataset
    assert ("hugging_face_id" in text) == (not has_dataset)
