"""Two people become one team, each in a browser of their own."""

import pytest
from playwright.sync_api import expect

from tests.browser.chromium import timers_at_rest
from tests.browser.conftest import PASSWORD, NewPage, sign_up

pytestmark = pytest.mark.browser


def test_link_lets_a_second_person_in(new_page: NewPage) -> None:
    owner, guest = new_page(), new_page()
    sign_up(owner, email="first-of-two@example.org", name="Two of them")
    owner.goto("/team/")
    owner.get_by_label("Name").fill("Two of them")
    owner.get_by_role("button", name="Create team").click()
    owner.get_by_role("button", name="Invite a member").click()
    link = owner.locator(".secret").inner_text()
    copy = owner.get_by_role("button", name="Copy the link")
    with timers_at_rest(owner):
        copy.click()
        expect(owner.get_by_role("button", name="Copied the link")).to_be_visible()
    owner.reload()
    expect(owner.locator(".secret")).to_have_count(0)
    expect(owner.get_by_role("cell", name="open")).to_have_count(1)
    guest.goto(link)
    expect(guest.get_by_role("heading", level=1)).to_have_text("Two of them invites you")
    sign_up(guest, email="second-of-two@example.org", name="The second")
    guest.goto(link)
    # A browser names the origin of the form only where the page does not forbid it to.
    guest.get_by_role("button", name="Join Two of them").click()
    guest.wait_for_url("**/team/")
    expect(guest.get_by_role("heading", level=1)).to_have_text("Two of them")
    expect(guest.get_by_role("cell", name="first-of-two@example.org")).to_be_visible()
    owner.reload()
    handing_over = owner.get_by_role("group").filter(has_text="Make owner")
    handing_over.locator("summary").click()
    make_owner = owner.get_by_role("button", name="Make second-of-two@example.org the owner")
    make_owner.click()  # without a tick: the browser asks for it, and sends nothing
    guest.reload()
    expect(guest.get_by_text("Make owner")).to_have_count(0)
    handing_over.get_by_role("checkbox").check()
    make_owner.click()
    # An open session is not enough.
    owner.get_by_role("textbox", name="Password").fill(PASSWORD)
    owner.get_by_role("button", name="Continue").click()
    expect(owner.get_by_text("second-of-two@example.org owns the team now.")).to_be_visible()
