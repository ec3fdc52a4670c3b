"""The first page of an account: what it has, each with the page where one changes it."""

from typing import Any, cast

from allauth.account.models import EmailAddress
from allauth.socialaccount.models import SocialAccount
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone

from evaluator.counting import counted
from leaderboard.mails import notices
from leaderboard.models import ApiToken, MailKind, User
from leaderboard.people import addresses, second_factor, teams, tokens
from leaderboard.web.decorators import own_page


@own_page
def overview(request: HttpRequest) -> HttpResponse:
    return render(request, "account/overview.html", _facts(cast("User", request.user)))


def _facts(user: User) -> dict[str, Any]:
    now, team = timezone.now(), teams.current_team_of(user=user)
    own_tokens = ApiToken.objects.filter(user=user)
    kinds = set(MailKind.values) - {MailKind.ACCOUNT.value}
    is_proved = EmailAddress.objects.filter(user=user, email__iexact=user.email, verified=True).exists()
    needs_proof = addresses.are_proved() and not is_proved
    n_addresses = EmailAddress.objects.filter(user=user).count()
    return {
        "needs_proof": needs_proof,
        "email_words": email_words(user.email, needs_proof=needs_proof, n_addresses=n_addresses),
        "has_second_factor": second_factor.is_set_up(user),
        "n_connected": SocialAccount.objects.filter(user=user).count(),
        "n_tokens": sum(tokens.state_of(token, now=now) == "in use" for token in own_tokens),
        "n_kinds": len(kinds),
        "n_wanted": len(kinds - notices.muted_by(user)),
        "team": team,
        "n_members": team.memberships.count() if team else 0,
    }


def email_words(email: str, *, needs_proof: bool, n_addresses: int) -> str:
    """Word the primary address: what it lacks, or how many more there are.

    >>> email_words("a@owls.example", needs_proof=True, n_addresses=2)
    'a@owls.example, not verified: no notifications are sent to it'
    >>> email_words("a@owls.example", needs_proof=False, n_addresses=3)
    'a@owls.example and 2 other addresses'
    >>> email_words("a@owls.example", needs_proof=False, n_addresses=1)
    'a@owls.example'
    """
    if needs_proof:
        return f"{email}, not verified: no notifications are sent to it"
    if n_addresses > 1:
        return f"{email} and {counted(n_addresses - 1, 'other address', 'other addresses')}"
    return email
