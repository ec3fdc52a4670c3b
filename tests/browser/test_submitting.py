"""From signing up to the board, in a real browser with a real worker."""

import gzip
import json
import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

import evaluator
from evaluator.counting import file_size
from evaluator.predictions.documents import too_large
from tests.browser.chromium import tab_to
from tests.browser.conftest import MAX_PREDICTIONS_BYTES, PASSWORD, NewPage, sign_up, submit
from tests.browser.site import predictions, worker
from tests.journeys.production import Site, await_that, get

pytestmark = pytest.mark.browser


def await_step(page: Page, label: str) -> None:
    """Return once the current station of the line of state is this one."""
    expect(page.locator("[aria-current=step] .label")).to_have_text(label)


RIVAL = """
from leaderboard.models import Edition, User
from tests import builders
user = User.objects.create_user("somebody-else@example.org", name="Somebody else")
edition = Edition.objects.get(split="test", number=1)
builders.submit(user, builders.predictions(edition, factor=1.6), method="By somebody else")
"""


def test_by_keyboard_alone_from_signing_up_to_comparing_and_taking_along(
    page: Page, site: Site, truth: evaluator.GroundTruth, tmp_path: Path
) -> None:
    path = tmp_path / "predictions.json"
    path.write_bytes(predictions(truth, factor=1.01))
    press, write = page.keyboard.press, page.keyboard.type
    page.goto("/")
    tab_to(page, "Submit")
    press("Enter")
    page.wait_for_url("**/accounts/login/?next=/submit/")
    tab_to(page, "Sign up")
    press("Enter")
    page.wait_for_url("**/accounts/signup/?next=*")
    for label, text in (
        ("Email", "keys@example.org"),
        ("Name on the board (optional)", "Keyboard team"),
        ("Password", PASSWORD),
        ("Password (again)", PASSWORD),
    ):
        tab_to(page, label)
        write(text)
    press("Enter")
    page.wait_for_url("**/submit/")
    # Chosen already where it is the only one that is open; which splits are is for other tests to say.
    tab_to(page, "Test Hidden test set: the results that papers report.")
    press("Space")
    tab_to(page, "Method")
    write("By keyboard")
    tab_to(page, "Prediction file")
    # The dialogue that Enter opens here is the browser's own, and headless it does not always come.
    page.set_input_files("input[type=file]:focus", path)
    expect(page.locator("#chosen")).to_have_text(file_size(path.stat().st_size))
    tab_to(page, "Submit")
    press("Enter")
    page.wait_for_url("**/submissions/*/")
    await_step(page, "Queued")
    site.manage("shell", "-v0", "-c", RIVAL)
    with worker(site):
        await_step(page, "Scored")
        # Afterwards the page stands still, and the other method is on the board as well.
        expect(page.locator("[aria-current=step] .note")).to_have_count(0)
        await_that(lambda: "By somebody else" in get(f"{site.url}/board/test/").text, what="all is scored")
    tab_to(page, "Publish…")
    press("Enter")
    page.wait_for_url("**/visibility/")
    tab_to(page, "Anonymously")
    press("ArrowDown")
    tab_to(page, "Preview")
    press("Enter")
    page.wait_for_url("**/visibility/?*visibility=PUBLIC*")
    tab_to(page, "I understand that this cannot be undone.")
    press("Space")
    tab_to(page, "Publish")
    press("Enter")
    page.wait_for_url("**/methods/*/")
    tab_to(page, "Board")
    press("Enter")
    row = page.locator("tr.mine")
    expect(row).to_contain_text("By keyboard")
    expect(row).to_contain_text("Keyboard team")
    expect(row.locator(".rank")).to_contain_text("1")
    tab_to(page, "Method")
    press("Enter")
    page.wait_for_url("**/board/test/?sort=method")
    expect(row).to_contain_text("By keyboard")
    for method in ("By keyboard", "By somebody else"):
        tab_to(page, f"Compare {method}")
        press("Space")
    # The tray at the end of the page has what is ticked.
    tab_to(page, "Compare")
    press("Enter")
    page.wait_for_url("**/compare/?*")
    expect(page.locator(".verdict")).to_contain_text("being computed")
    with worker(site):
        expect(page.locator(".verdict")).to_contain_text("The MiD of By keyboard is ")
    expect(page.locator(".verdict")).to_contain_text("lower than that of By somebody else (95% confidence")
    tab_to(page, "Test", backwards=True)
    press("Enter")
    page.wait_for_url("**/board/test/")
    tab_to(page, "Export", backwards=True)
    press("Enter")
    tab_to(page, "Download CSV")
    with page.expect_download() as taken:
        press("Enter")
    assert "By keyboard" in taken.value.path().read_text()


DROP = """([selector, type]) => {
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File(["{}"], "mine.json"));
  const target = document.querySelector(selector);
  return target.dispatchEvent(new DragEvent(type, {bubbles: true, cancelable: true, dataTransfer}));
}"""


def test_a_file_dropped_on_the_form_is_chosen_and_beside_it_is_not_opened(
    page: Page, site: Site, truth: evaluator.GroundTruth
) -> None:
    sign_up(page, email="drops@example.org", name="Drops")
    page.goto("/submit/")
    is_left_to_the_browser = page.evaluate(DROP, ["header", "drop"])
    assert not is_left_to_the_browser
    expect(page.locator("#chosen")).to_have_text("")
    # Chosen already where it is the only split that is open.
    page.locator("input[name=split][value=test]").check()
    page.evaluate(DROP, ["legend", "dragover"])
    expect(page.locator("form.dropping")).to_be_visible()
    page.evaluate(DROP, ["legend", "drop"])
    expect(page.locator("#chosen")).to_have_text("2 bytes")
    assert page.evaluate("document.querySelector('input[type=file]').files[0].name") == "mine.json"
    expect(page.locator("form.dropping")).to_have_count(0)
    expect(page.locator("#checked")).to_contain_text("The file has 0 predictions; Test expects 1,200")


def test_a_file_is_checked_before_it_is_sent_and_what_was_filled_in_stays(
    browser: Browser, site: Site, truth: evaluator.GroundTruth
) -> None:
    # A context of its own: the browser complains of the answer 422, which is wanted here.
    with browser.new_context(base_url=site.url) as context:
        check_and_correct(context.new_page(), truth)


def check_and_correct(page: Page, truth: evaluator.GroundTruth) -> None:
    sign_up(page, email="checks@example.org", name="Checks")
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.method))
    field = page.get_by_label("Prediction file")
    page.locator("input[name=split][value=test]").check()
    page.get_by_label("Method", exact=True).fill("Checked")
    with page.expect_download() as taken:
        page.get_by_role("link", name="template (JSON) of Test").click()
    field.set_input_files(taken.value.path())
    expect(page.locator("#checked .bad")).to_have_text(
        "This is the empty template: all 1,200 values are null; expected a number for every sequence. "
        "The server would reject the file."
    )
    expect(page.get_by_role("button", name="Submit anyway")).to_be_visible()
    good = {"name": "p.json", "mimeType": "application/json", "buffer": predictions(truth, factor=1.7)}
    field.set_input_files(good)
    expect(page.locator("#checked")).to_have_text(
        "1,200 predictions, one for each sequence. The server checks them once the file is sent."
    )
    page.get_by_label("Parameters").fill("25 apples")
    assert "POST" not in sent
    page.get_by_role("button", name="Submit").click()
    expect(page.locator("#id_n_parameters_error")).to_have_text(
        "Enter a whole number, e.g. 25,000,000 or 25M."
    )
    expect(page.get_by_label("Parameters")).to_be_focused()
    page.get_by_label("Parameters").fill("25M")
    page.get_by_role("button", name="Submit").click()
    page.wait_for_url("**/submissions/*/")


LEFT_TO_THE_SERVER = "The server checks {} once it is sent."
REJECTED = "The server would reject the file."
ANOTHER_NUMBER = "Test expects 1,200, one for each sequence. The server would reject the file."
ONE_LESS = json.dumps({str(row): 2.5 for row in range(1_199)}).encode()
SENTENCES: dict[str, tuple[bytes, str]] = {
    "nothing": (b" ", f"The file is empty; expected JSON text with a number for every sequence. {REJECTED}"),
    "a cut text": (b'{"0": 1,\n"1": ', f"The text is not JSON. {REJECTED}"),
    "a text with a fault in it": (b'{"0": 1,\n"1" 2}', f"The text is not JSON: line 2, column 5. {REJECTED}"),
    "a picture": (b"\x89PNG\r\n\x1a\n", f"The text is not JSON. {REJECTED}"),
    "a list": (
        b"[1, 2]",
        f"The file has 0 predictions; {ANOTHER_NUMBER}",
    ),
    "an envelope": (
        b'{"unit": "ttc", "predictions": {"0": 1}}',
        f"The file has 1 prediction; {ANOTHER_NUMBER}",
    ),
    "one too few": (
        ONE_LESS,
        f"The file has 1,199 predictions; {ANOTHER_NUMBER}",
    ),
    "not a number": (ONE_LESS.replace(b"2.5", b"NaN"), LEFT_TO_THE_SERVER.format("this file")),
    "a table": (b"anno_id,ttc\n0,2.5\n", LEFT_TO_THE_SERVER.format("a CSV file")),
    "an archive": (gzip.compress(ONE_LESS), LEFT_TO_THE_SERVER.format("a gzip file")),
}


def test_a_file_that_cannot_be_good_is_named_before_it_is_sent(
    page: Page, site: Site, truth: evaluator.GroundTruth
) -> None:
    sign_up(page, email="sentences@example.org", name="Sentences")
    page.locator("input[name=split][value=test]").check()
    for data, sentence in SENTENCES.values():
        chosen = {"name": "p.json", "mimeType": "application/json", "buffer": data}
        page.get_by_label("Prediction file").set_input_files(chosen)
        expect(page.locator("#checked")).to_have_text(sentence)
        label = "Submit anyway" if sentence.endswith(REJECTED) else "Submit"
        expect(page.locator(".actions button")).to_have_text(label)


SLOW_READING = """() => {
  const read = Blob.prototype.text;
  const allowed = new Promise((resolve) => (window.readOn = resolve));
  Blob.prototype.text = async function () { await allowed; return read.call(this); };
}"""


def test_a_warning_that_comes_after_submit_was_pressed_gets_the_focus(
    page: Page, site: Site, truth: evaluator.GroundTruth
) -> None:
    sign_up(page, email="focus@example.org", name="Focus")
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.method))
    page.locator("input[name=split][value=test]").check()
    page.get_by_label("Method", exact=True).fill("Pressed early")
    page.evaluate(SLOW_READING)
    chosen = {"name": "p.json", "mimeType": "application/json", "buffer": ONE_LESS}
    page.get_by_label("Prediction file").set_input_files(chosen)
    page.get_by_role("button", name="Submit").click()
    expect(page.locator("#checked")).to_have_text("Checking the file…")
    page.evaluate("window.readOn()")
    expect(page.locator("#checked")).to_be_focused()
    expect(page.locator("#checked .bad")).to_contain_text("1,199 predictions")
    assert "POST" not in sent
    page.get_by_role("button", name="Submit anyway").click()
    page.wait_for_url("**/submissions/*/")


def test_state_moves_without_a_reload(page: Page, site: Site, truth: evaluator.GroundTruth) -> None:
    sign_up(page, email="moves@example.org", name="Moves")
    submit(page, predictions(truth, factor=1.1), method="Moving")
    await_step(page, "Queued")
    page.evaluate("window.isTheSamePage = true")
    with worker(site):
        await_step(page, "Scored")
        expect(page.locator(".result table")).to_have_count(1)
        expect(page.locator("#outcome")).to_contain_text("truncated")
        expect(page.locator(".result td.span").first).to_contain_text("–")
    expect(page.locator("[aria-current=step]")).not_to_have_class(re.compile("moving"))
    assert page.evaluate("window.isTheSamePage") is True


def test_file_over_the_limit_is_stopped_before_it_is_sent(page: Page, truth: evaluator.GroundTruth) -> None:
    sign_up(page, email="large@example.org", name="Large")
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.method))
    field = page.get_by_label("Prediction file")
    page.get_by_label("Method", exact=True).fill("Large")
    field.set_input_files({"name": "p.json", "mimeType": "application/json", "buffer": b"1" * 250_000})
    sentence = too_large(n_bytes=250_000, max_bytes=MAX_PREDICTIONS_BYTES)
    expect(page.locator("#checked .bad")).to_have_text(sentence)
    page.get_by_role("button", name="Submit").click()
    assert field.evaluate("e => e.validationMessage") == sentence
    expect(page.locator("#checked .bad")).to_be_visible()
    assert "POST" not in sent


def test_form_outlives_a_session_that_has_ended(page: Page, site: Site, truth: evaluator.GroundTruth) -> None:
    sign_up(page, email="late@example.org", name="Late")
    page.locator("input[name=split][value=test]").check()
    page.get_by_label("Method", exact=True).fill("Late net")
    page.get_by_label("Prediction file").set_input_files(
        {"name": "p.json", "mimeType": "application/json", "buffer": predictions(truth, factor=1.07)}
    )
    expect(page.locator("#checked .good")).to_be_visible()
    page.context.clear_cookies(name="sessionid")
    page.get_by_role("button", name="Submit").click()
    alert = page.get_by_role("alert")
    expect(alert).to_contain_text("Your session has ended, and the file was not sent. Sign in (new tab)")
    assert page.get_by_label("Method", exact=True).input_value() == "Late net"
    with page.expect_popup() as opened:
        alert.get_by_role("link").click()
    tab = opened.value
    tab.get_by_label("Email").fill("late@example.org")
    tab.get_by_label("Password", exact=True).fill(PASSWORD)
    tab.get_by_role("button", name="Sign in").click()
    tab.wait_for_url("**/submit/")
    page.get_by_role("button", name="Submit").click()
    page.wait_for_url("**/submissions/*/")
    expect(page.get_by_role("heading", level=1)).to_contain_text("Late net")


def test_everything_works_without_script(new_page: NewPage, site: Site, truth: evaluator.GroundTruth) -> None:
    page = new_page(java_script_enabled=False)
    sign_up(page, email="plain@example.org", name="Plain")
    submit(page, predictions(truth, factor=1.4), method="Plain")
    await_step(page, "Queued")
    with worker(site):
        link = page.get_by_role("link", name="reload the page")
        while link.count():
            with page.expect_navigation():
                link.click()
    await_step(page, "Scored")
    page.get_by_role("link", name="test board").click()
    page.get_by_role("link", name="RTE, overall, %").click()
    expect(page.locator("th[aria-sort=ascending]")).to_contain_text("RTE")
    page.get_by_role("button", name="Sign out").click()
    expect(page.get_by_role("link", name="Sign in")).to_be_visible()


@pytest.mark.parametrize("has_script", [True, False])
def test_a_question_keeps_the_chosen_file_and_sends_it_once_it_is_confirmed(
    browser: Browser, site: Site, truth: evaluator.GroundTruth, has_script: bool
) -> None:
    # A context of its own, as above.
    with browser.new_context(base_url=site.url, java_script_enabled=has_script) as context:
        answer_the_question(context.new_page(), truth, has_script=has_script)


def answer_the_question(page: Page, truth: evaluator.GroundTruth, *, has_script: bool) -> None:
    name = "Slips" if has_script else "Plain slips"
    sign_up(page, email=f"{name.replace(' ', '-').lower()}@example.org", name=name)
    submit(page, predictions(truth, factor=1.31), method="TTC-Former")
    page.wait_for_url("**/submissions/*/")
    page.goto("/submit/")
    page.locator("input[name=split][value=test]").check()
    page.get_by_label("Method", exact=True).fill("TTC-Fromer")
    data = predictions(truth, factor=1.32)
    page.get_by_label("Prediction file").set_input_files(
        {"name": "p.json", "mimeType": "application/json", "buffer": data}
    )
    page.get_by_role("button", name="Submit").click()
    expect(page.locator(".question")).to_contain_text("your team has “TTC-Former”")
    confirmed = page.get_by_label("Submit the file all the same.")
    if has_script:
        expect(confirmed).to_be_focused()
    confirmed.check()
    page.get_by_role("button", name="Submit").click()
    page.wait_for_url("**/submissions/*/")
    expect(page.locator("h1")).to_contain_text("TTC-Fromer")
