"""The seven roles, each with its way to ask, and the things that they ask for."""

from dataclasses import dataclass, field
from datetime import timedelta
from typing import Any
from uuid import UUID

from allauth.account.models import EmailAddress
from django.conf import settings
from django.contrib.sessions.backends.db import SessionStore
from django.http import HttpResponseBase
from django.test import Client
from django.test.client import ClientHandler
from django.utils import timezone
from knox.settings import CONSTANTS

from leaderboard.models import ApiToken, Edition, Invitation, Membership, Method, Submission, User, Visibility
from leaderboard.people import invitations, teams
from leaderboard.quotas import admissions
from tests import builders
from tests.security.matrix import ROLES

ABSENT = UUID("00000000-0000-4000-8000-000000000000")
# Somewhere on the Internet, so that what loopback alone may do does not pass for what everybody may.
ADDRESS = "203.0.113.9"


@dataclass
class World:
    """People, their tokens and what belongs to the owner: a private method with a scored submission."""

    edition: Edition
    users: dict[str, User]
    submission: Submission
    tokens: dict[str, str]
    invitation: Invitation
    secret: str
    sessions: dict[str, str]
    # All clients have one: each of their own would make every middleware anew for every request.
    handler: ClientHandler = field(default_factory=lambda: ClientHandler(enforce_csrf_checks=False))

    @property
    def method(self) -> Method:
        """The owner's, which no other user may see."""
        return self.submission.method

    def parameters(self) -> dict[str, object]:
        """What a route's parameters stand for unless its line says otherwise."""
        return {
            "split": "test",
            "number": self.edition.number,
            "submission_id": self.submission.pk,
            "method_id": self.method.pk,
            "team_id": self.method.team_id,
            "subject_id": self.method.team_id,
            "handle": self.users["teammate"].membership.handle,
            "invitation_id": self.invitation.pk,
            "secret": self.secret,
            "key": "nonsense",
            "uidb36": "1",
            "slug": self.edition.split.published_results.values_list("slug", flat=True).first() or "none",
        }

    def client(self, role: str, *, method: str, as_program: bool = False) -> Client:
        """A new client of that role; people have a session, or as programs a token that may do everything."""
        client = Client(raise_request_exception=False, REMOTE_ADDR=ADDRESS)
        client.handler = self.handler
        token = self.tokens.get(f"{role} {method}") or self.tokens.get(role)
        if token and (as_program or role not in self.users):
            client.defaults["HTTP_AUTHORIZATION"] = f"Bearer {token}"
        elif role in self.users:
            client.cookies[settings.SESSION_COOKIE_NAME] = self.sessions[role]
        return client


def _session(user: User) -> str:
    session = SessionStore()
    session["_auth_user_id"] = str(user.pk)
    session["_auth_user_backend"] = "django.contrib.auth.backends.ModelBackend"
    session["_auth_user_hash"] = user.get_session_auth_hash()
    session.create()
    return session.session_key or ""


def populate(edition: Edition) -> World:
    """The seven roles around one private method of the owner's team."""
    users = {
        role: User.objects.create_user(f"{role}@example.org", "correct horse", name=role.capitalize())
        for role in ("stranger", "owner", "teammate")
    }
    users["maintainer"] = User.objects.create_superuser("maintainer@example.org", "correct horse")
    Membership.objects.create(team=teams.team_of(user=users["owner"]), user=users["teammate"])
    teams.team_of(user=users["stranger"])
    submission = builders.submit(users["owner"], builders.predictions(edition), method="Hidden")
    builders.score_all()
    Method.objects.update(visibility=Visibility.PRIVATE)
    _fill_the_administration(users["maintainer"], submission)
    tokens = {role: builders.token(user) for role, user in users.items()}
    # A token without the scope that a method needs: the other one.
    reading, writing = (builders.token(users["owner"], scopes=[scope]) for scope in ("read", "submit"))
    for method in ("GET", "HEAD", "OPTIONS"):
        tokens[f"token without scope {method}"] = writing
    tokens["token without scope"] = reading
    tokens["expired token"] = builders.token(users["owner"])
    ended = ApiToken.objects.filter(token_key=tokens["expired token"][: CONSTANTS.TOKEN_KEY_LENGTH])
    assert ended.update(expiry=timezone.now() - timedelta(days=1)) == 1
    assert set(ROLES) - {"anonymous"} <= {*users, "token without scope", "expired token"}
    submission.refresh_from_db()
    invitation, secret = invitations.make(
        team=submission.method.team, actor=users["owner"], now=timezone.now()
    )
    builders.infer_all()  # which draws the boards as well, once for all that look at them
    return World(
        edition=edition,
        users=users,
        submission=submission,
        tokens=tokens,
        invitation=invitation,
        secret=secret,
        sessions={role: _session(user) for role, user in users.items()},
    )


def _fill_the_administration(maintainer: User, submission: Submission) -> None:
    """A row of every model that the administration shows and that nothing above has made."""
    EmailAddress.objects.create(user=maintainer, email=maintainer.email, primary=True, verified=True)
    team, split, now = submission.method.team, submission.split, timezone.now()
    admissions.admit(team=team, split=split, reason="a test", actor=maintainer, now=now)
    builders.override(team, limit=50, actor=maintainer)


def browser_of(user: User) -> Client:
    """Their browser, which is shown failures as everybody's is."""
    client = Client(raise_request_exception=False)
    client.force_login(user)
    return client


def program_of(user: User) -> Client:
    """A program of theirs, with a token that may do everything."""
    authorization = {"Authorization": f"Bearer {builders.token(user)}"}
    return Client(raise_request_exception=False, headers=authorization)


def ask(
    client: Client, method: str, path: str, *, sends: Any = None, is_json: bool = False
) -> HttpResponseBase:
    """One request. A form is sent as browsers send it, JSON where it is asked for."""
    if method in {"GET", "HEAD", "OPTIONS"} or sends is None:
        return client.generic(method, path)
    if is_json:
        return client.generic(method, path, sends, content_type="application/json")
    return getattr(client, method.lower())(path, sends)
