"""API tokens: hashed at rest, shown once, limited in scope and time."""

import re
from collections.abc import Collection
from datetime import datetime, timedelta

from django.conf import settings
from django.db import transaction
from django.db.models import Q
from knox.crypto import hash_token
from knox.models import get_digest_token
from knox.settings import CONSTANTS

from evaluator.counting import counted
from leaderboard import audit
from leaderboard.errors.refusals import Refused, clean_text, require_maintainer, shown_split
from leaderboard.models import ApiToken, Scope, User
from leaderboard.people import accounts

DAYS = 90
MAX_DAYS = 365
MAX_ACTIVE = 50
# Not publish: it cannot be undone, and few programs need it.
USUAL_SCOPES = (Scope.READ, Scope.SUBMIT)
# What `create` makes; anything else is refused before the database is asked.
PATTERN = re.compile(r"tsttc_[0-9a-f]{64}")
USED_EVERY = timedelta(minutes=1)


class UnusableToken(Exception):
    """The token is not valid; `code` is stable."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code


def create(
    *,
    user: User,
    name: str,
    now: datetime,
    scopes: Collection[str] = USUAL_SCOPES,
    split_name: str = "",
    days: int = DAYS,
    actor: User | None = None,
) -> str:
    """Make a token, for every split without `split_name`. Returns its secret. Raises `Refused`."""
    name = clean_text("name", name, limit=80)
    _check(scopes=scopes, days=days)
    split = shown_split(split_name) if split_name else None
    with transaction.atomic():
        # Two at once would both find room for the last one.
        accounts.hold_open(user)
        n_active = ApiToken.objects.filter(user=user, revoked_at=None, expiry__gt=now).count()
        if n_active >= MAX_ACTIVE:
            raise Refused("too-many-tokens", f"There are {n_active} tokens in use, the maximum; revoke one.")
        digest, secret = get_digest_token()
        row = ApiToken(
            digest=digest,
            token_key=secret[: CONSTANTS.TOKEN_KEY_LENGTH],
            user=user,
            name=name,
            expiry=now + timedelta(days=days),
            may_read=Scope.READ in scopes,
            may_submit=Scope.SUBMIT in scopes,
            may_publish=Scope.PUBLISH in scopes,
            split=split,
        )
        row.save(force_insert=True)
        audit.record(
            verb="created",
            noun="ApiToken",
            noun_id=row.token_key,
            actor=actor or user,
            details={"scopes": list(row.scopes), "split": split_name or None, "days": days},
            names={"name": name},
        )
    return secret


def _check(*, scopes: Collection[str], days: int) -> None:
    unknown = [scope for scope in scopes if scope not in Scope.values]
    if unknown or not scopes:
        given = f"the scope {unknown[0][:40]!r}" if unknown else "no scope"
        raise Refused(
            "bad-scope", f"The token has {given}; expected read, submit or publish.", field="scopes"
        )
    if not 1 <= days <= MAX_DAYS:
        raise Refused(
            "bad-days",
            f"The token expires after {counted(days, 'day')}; expected 1 to {MAX_DAYS}.",
            field="days",
        )


# --- using one -------------------------------------------------------------------------------------------


def use(*, secret: str, now: datetime) -> ApiToken:
    """Return the token of this secret with its owner, and note the minute of use. Raises `UnusableToken`."""
    if not PATTERN.fullmatch(secret):
        raise UnusableToken(
            "token-malformed", "The bearer token is malformed; expected tsttc_ and 64 hexadecimal digits."
        )
    row = ApiToken.objects.select_related("user").filter(pk=hash_token(secret)).first()
    if row is None:
        raise UnusableToken(
            "token-unknown", "The bearer token is unknown; expected a token of this leaderboard."
        )
    _require_active(row, now=now)
    if row.last_used_at is None or now - row.last_used_at >= USED_EVERY:
        stale = Q(last_used_at=None) | Q(last_used_at__lte=now - USED_EVERY)
        ApiToken.objects.filter(stale, pk=row.pk).update(last_used_at=now)
    return row


def _require_active(row: ApiToken, *, now: datetime) -> None:
    another = f"create another one at {settings.SITE_URL}/tokens/"
    if row.revoked_at is not None:
        raise UnusableToken(
            "token-revoked", f"The token was revoked on {row.revoked_at:%Y-%m-%d %H:%M} UTC; {another}."
        )
    if row.expiry is not None and row.expiry <= now:
        raise UnusableToken(
            "token-expired", f"The token expired on {row.expiry:%Y-%m-%d %H:%M} UTC; {another}."
        )
    if not row.user.is_active:
        raise UnusableToken("account-closed", "The account that this token belongs to is closed.")


def is_active(row: ApiToken, *, now: datetime) -> bool:
    return row.revoked_at is None and (row.expiry is None or row.expiry > now)


def active(*, user: User, now: datetime) -> list[ApiToken]:
    """Return a person's tokens that work, by name."""
    rows = ApiToken.objects.filter(user=user, revoked_at=None).order_by("name", "created")
    return [row for row in rows if is_active(row, now=now)]


def state_of(row: ApiToken, *, now: datetime) -> str:
    """Return the state in one word: in use, expired or revoked."""
    if row.revoked_at is not None:
        return "revoked"
    return "in use" if is_active(row, now=now) else "expired"


def revoke(*, token: ApiToken, now: datetime, actor: User | None, how: str = "") -> bool:
    """Revoke a token. Returns False if it was revoked already."""
    with transaction.atomic():
        changed = ApiToken.objects.filter(pk=token.pk, revoked_at=None).update(revoked_at=now)
        if changed:
            audit.record(
                verb="revoked",
                noun="ApiToken",
                noun_id=token.token_key,
                actor=actor,
                details={"how": how} if how else {},
                names={"name": token.name},
            )
    return bool(changed)


def revoke_all(*, user: User, reason: str, actor: User | None, now: datetime) -> None:
    """Revoke all tokens of a person. Raises `NotMaintainer`."""
    require_maintainer(actor, to="revoke tokens of others")
    for token in ApiToken.objects.filter(user=user):
        revoke(token=token, now=now, actor=actor, how=f"by a maintainer: {reason}")


def revoke_leaked(*, secret: str, now: datetime) -> None:
    """Revoke the token of this secret, if any; the caller does not learn whether there was."""
    if PATTERN.fullmatch(secret):
        row = ApiToken.objects.filter(pk=hash_token(secret)).first()
        if row is not None:
            revoke(token=row, now=now, actor=None, how="reported as leaked")
