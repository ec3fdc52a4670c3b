"""Errors that doors tell programs: their one shape, RFC 9457 problem details, and every code there is.

A code is stable: programs may rely on it. Those of a prediction file's own faults are
`evaluator.problems.PROBLEM_CODES`. A test holds that every code in the source stands here and in docs/api.md.
"""

from http import HTTPStatus
from typing import Any, Final

from django.conf import settings

MEDIA_TYPE: Final = "application/problem+json"

API_CODES: Final[dict[str, str]] = {
    # the request itself
    "bad-request": "The request is malformed, or was broken off.",
    "parse-error": "The body is not what its Content-Type says.",
    "invalid": "A field of the request has a value that it cannot have.",
    "bad-idempotency-key": "The Idempotency-Key header is malformed or too long.",
    "idempotency-key-reused": "The Idempotency-Key came before, with another file or other fields.",
    "bad-wait": "`wait` is no whole number of seconds that a question may be held.",
    "bad-limit": "`limit` is no number of rows that a page may have.",
    "bad-cursor": "`after` names no row of this list.",
    "bad-edition": "`edition` is no edition's number.",
    "bad-moment": "`at` is no date or time.",
    "bad-visibility": "`as` is neither ANONYMOUS nor PUBLIC.",
    "bad-filter": "The board cannot be filtered like that.",
    "unknown-column": "The board cannot be sorted by that.",
    "not-found": "There is nothing at this address that you may see.",
    "method-not-allowed": "The address does not take this HTTP method; `Allow` says which it takes.",
    "not-acceptable": "`Accept` asks for a form that this address does not have.",
    "unsupported-media-type": "The body's Content-Type is not taken here.",
    # who asks
    "not-authenticated": "The address needs an account, and the request names none.",
    "authentication-failed": "The sign-in is not valid.",
    "token-malformed": "The bearer token is no token of this leaderboard.",
    "token-unknown": "No such token was ever made.",
    "token-expired": "The token's end has passed.",
    "token-revoked": "The token was revoked.",
    "account-closed": "The account that the token belongs to is closed.",
    "token-scope": "The token is not good for this.",
    "token-split": "The token is good for another split alone, or for one, and this would change all.",
    "permission-denied": "The account may not do this.",
    "not-maintainer": "Only maintainers may do this.",
    "not-yours": "Only the team that sent a submission may do this.",
    # how often, and how much
    "throttled": "Too many requests in a short time; `Retry-After` says when to come back.",
    "quota-exceeded": "The team has no submission, or too few bytes, left; `Retry-After` says for how long.",
    # submitting
    "no-file": "No prediction file was sent.",
    "too-large": "The file is larger than the limit.",
    "missing-field": "A field that is needed is empty.",
    "text-too-long": "A field has too many characters.",
    "bad-character": "A field has a character that cannot be shown.",
    "bad-address": "A field is no http or https address.",
    "unknown-split": "There is no such split.",
    "unknown-method": "There is no such method, or it is not yours to use.",
    "split-not-open": "The split takes no submissions yet.",
    "not-admitted": "The split takes files of admitted teams alone, and the team is not one of them.",
    "split-closed": "The split takes no submissions any more.",
    # comparing
    "bad-comparison": "The request names too few or too many methods to compare, or one twice.",
    "not-on-the-board": "The split has no board, or the method no scored submission on it.",
    # methods and teams
    "bad-value": "A field has a value that it cannot have.",
    "bad-name": "The name has nothing that a reader could tell it by.",
    "reserved-name": "The name reads as what methods and teams without a name are called.",
    "name-taken": "There is one already whose name looks like it.",
    "renamed-lately": "The name was changed lately; the sentence says when it can be changed again.",
    "public-name": "A public method keeps its name.",
    "shown-for-good": "A public method stays public.",
    "not-confirmed": "What cannot be taken back was not confirmed.",
    "in-a-team": "The person is in a team already.",
    "in-no-team": "The person is in no team.",
    "not-a-member": "That person is not in the team.",
    "not-the-owner": "Only the team's owner may do this.",
    "not-your-team": "The team is not the person's own any more.",
    "not-yourself": "The owner would do this to themselves.",
    "hand-over-first": "An owner hands the team over before leaving it.",
    "no-invitation": "There is no such invitation, or it is used, revoked or over.",
    "cannot-join": "The person's own team holds them back.",
    "too-many-invitations": "The team has as many unused invitations as it may.",
    "changed-meanwhile": "Somebody changed the team at the same moment; trying again may do.",
    # receipts
    "not-scored": "The submission has no score that could be signed.",
    "withdrawn": "The submission is withdrawn.",
    "edition-unknown": "The submission has no score in a published edition of that number.",
    # maintainers
    "edition-refused": "The edition cannot be opened, published, rolled back or given up like that.",
    # our side
    "database-unavailable": "The database does not answer at the moment.",
    "store-unavailable": "The file store does not answer at the moment.",
    "storage-full": "There is no room left to keep a file.",
    "server-error": "Something failed on our side; it is in our logs.",
}


def document(*, status: int, code: str, detail: str, where: str = "") -> dict[str, Any]:
    """One problem, as every error of the API tells it. `type` leads to what the page says of the code."""
    return {
        "type": f"{settings.SITE_URL}/docs/api/#problem-{code}",
        "title": HTTPStatus(status).phrase,
        "status": status,
        "code": code,
        "detail": detail,
        "problems": [{"code": code, "message": detail, "where": where}],
    }
