"""The first page of an account: what it has, each with the page where one changes it."""

from typing import Any, cast

from allauth.account.models import EmailAddress
from allauth.socialaccount.models import SocialAccount
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.utils import timezone

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
    return {
        "needs_proof": addresses.are_proved() and not is_proved,
        "n_addresses": EmailAddress.objects.filter(user=user).count(),
        "has_second_factor": second_factor.is_set_up(user),
        "n_connected": SocialAccount.objects.filter(user=user).count(),
        "n_tokens": sum(tokens.state_of(token, now=now) == "in use" for token in own_tokens),
        "n_kinds": len(kinds),
        "n_wanted": len(kinds - notices.muted_by(user)),
        "team": team,
        "n_members": team.memberships.count() if team else 0,
    }
