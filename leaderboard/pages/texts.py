"""Pages whose text maintainers edit; each has a default, and every version is kept."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from django.conf import settings
from django.core.checks import CheckMessage, Info
from django.db import IntegrityError, transaction
from django.template.loader import render_to_string

from leaderboard import audit
from leaderboard.errors.refusals import Refused, clean_text, require_maintainer
from leaderboard.models import PageVersion, User

MAX_TEXT: Final = 20_000
IMPRINT: Final = "imprint"


@dataclass(frozen=True)
class SitePage:
    """A page: name in addresses, title, and what belongs on it."""

    name: str
    title: str
    about: str


PAGES: Final[Mapping[str, SitePage]] = {
    page.name: page
    for page in (
        SitePage("rules", "Rules", "Who may submit what, and what a published result has to state."),
        SitePage("contact", "Contact", "Who answers questions, and where."),
        SitePage("privacy", "Privacy", "Which personal data the site keeps, why, and for how long."),
        SitePage(
            IMPRINT,
            "Imprint",
            "Who operates this site: name and postal address, where the law asks for them.",
        ),
        SitePage("licence", "Licence", "What others may do with the software, the data and the results."),
    )
}


def current(name: str) -> PageVersion | None:
    """Return the text of maintainers that is shown, if any."""
    return PageVersion.objects.filter(page=name).select_related("written_by").order_by("-number").first()


def versions(name: str) -> list[PageVersion]:
    """Return every version of the page, newest first."""
    return list(PageVersion.objects.filter(page=name).select_related("written_by").order_by("-number"))


def default_text(name: str) -> str:
    """Render the default text with this site's names and limits."""
    facts = {
        "benchmark": settings.BENCHMARK,
        "site_url": settings.SITE_URL,
        "contact": settings.CONTACT_EMAIL,
        "session_days": settings.SESSION_COOKIE_AGE // 86_400,
        "providers": settings.SOCIALACCOUNT_PROVIDERS,
    }
    return render_to_string(f"pages/{PAGES[name].name}.md", facts).strip() + "\n"


def edit(*, name: str, text: str, replaces: int, actor: User | None, now: datetime) -> PageVersion:
    """Save a new version of a page. `replaces` is the number of the edited version; 0 is the default.

    Raises `NotMaintainer`, and `Refused` for a bad text or one edited by somebody else meanwhile.
    """
    require_maintainer(actor, to="edit pages")
    text = clean_text("text", text.replace("\r\n", "\n"), limit=MAX_TEXT) + "\n"
    shown = current(name)
    if (shown.number if shown else 0) != replaces:
        raise _changed_meanwhile()
    if text == (shown.text if shown else default_text(name)):
        raise Refused("bad-value", "The text is the one that the page has; expected another.", field="text")
    try:
        with transaction.atomic():
            version = PageVersion.objects.create(
                page=name, number=replaces + 1, text=text, written_by=actor, written_at=now
            )
            details = {"version": version.number, "sha256": hashlib.sha256(text.encode()).hexdigest()}
            audit.record(verb="edited", noun="Page", noun_id=name, actor=actor, details=details)
    except IntegrityError:
        raise _changed_meanwhile() from None
    return version


def _changed_meanwhile() -> Refused:
    return Refused(
        "changed-meanwhile",
        "Somebody changed this page after you opened the form. Copy your text and open the form again.",
        field="text",
    )


def check_contact(app_configs: object = None, **kwargs: object) -> list[CheckMessage]:
    """Warn that the pages name the sender of mails as the contact, whose mailbox may not be read."""
    if settings.PRODUCTION and settings.CONTACT_EMAIL == settings.DEFAULT_FROM_EMAIL:
        hint = "Set TSTTC_CONTACT_EMAIL, and write the imprint at /maintain/pages/imprint/."
        message = f"The pages give the sender of mails, {settings.CONTACT_EMAIL}, as the contact."
        return [Info(message, hint=hint, id="leaderboard.I001")]
    return []
