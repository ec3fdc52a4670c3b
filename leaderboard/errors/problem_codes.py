"""Problem documents (RFC 9457) and every stable problem code of the API, but those of prediction files."""

from collections.abc import Mapping
from http import HTTPStatus
from typing import Any, Final

from django.conf import settings
from django.http import JsonResponse

MEDIA_TYPE: Final = "application/problem+json"

API_GROUPS: Final[dict[str, dict[str, str]]] = {
    "The request itself": {
        "bad-request": "The request is malformed or incomplete.",
        "parse-error": "The body is not what its Content-Type says.",
        "doubled-field": "The request has a field more than once.",
        "invalid": "A field of the request has an invalid value.",
        "bad-limit": "`limit` is not a number of rows that a page may have.",
        "bad-cursor": "`after` names no row of this list.",
        "bad-edition": "`edition` is not the number of an edition.",
        "bad-moment": "`at` is not a date or time.",
        "bad-visibility": "`as` is neither ANONYMOUS nor PUBLIC.",
        "bad-filter": "A filter of the board has an invalid value.",
        "unknown-column": "The board has no such column to sort by.",
        "not-found": "There is nothing at this address that you may see.",
        "no-ground-truth": "The split has no ground truth yet, so it has no manifest.",
        "method-not-allowed": "The path does not support this HTTP method; `Allow` lists those it does.",
        "not-acceptable": "`Accept` asks for a format that this path does not offer.",
        "unsupported-media-type": "The Content-Type of the body is not accepted here.",
    },
    "Authentication and permission": {
        "not-authenticated": "The path needs an account, and the request has no credentials.",
        "authentication-failed": "The credentials are invalid.",
        "token-malformed": "The bearer token is not a token of this leaderboard.",
        "token-unknown": "There is no such token.",
        "token-expired": "The token has expired.",
        "token-revoked": "The token was revoked.",
        "account-closed": "The account that the token belongs to is closed.",
        "token-scope": "The token does not have the scope for this.",
        "token-split": "The token is valid for one split only, and the request affects another or all.",
        "https-required": "The request came over http. Its token can have been read by others: revoke it.",
        "permission-denied": "The account may not do this.",
        "not-maintainer": "Only maintainers may do this.",
        "not-yours": "Only the team that sent a submission may do this.",
    },
    "Rates and quotas": {
        "throttled": "Too many requests in a short time; repeat after `Retry-After` seconds.",
        "quota-exceeded": (
            "The team's quota of submissions or bytes is used up; `Retry-After` says for how long."
        ),
    },
    "Submitting": {
        "no-file": "No prediction file was sent.",
        "too-large": "The file is larger than the limit, or a JSON document is larger than 100 kB.",
        "missing-field": "A required field is empty.",
        "text-too-long": "A field has too many characters.",
        "bad-character": "A field has a character that cannot be displayed.",
        "bad-address": "A field is not an http or https URL.",
        "unknown-split": "There is no such split.",
        "unknown-method": "There is no such method, or it belongs to another team.",
        "split-not-open": "The split is not open for submissions yet.",
        "not-admitted": "Only admitted teams may submit to the split, and the team is not one of them.",
        "split-closed": "The split is closed for submissions.",
        "not-movable": "The submission cannot be moved: it is withdrawn, or a method is not private.",
        "same-file": "The method has a submission of the same file already.",
    },
    "Comparing": {
        "bad-comparison": "The request names too few or too many methods to compare, or one of them twice.",
        "not-on-the-board": "The split has no board, or the method has no scored submission on it.",
    },
    "Methods and teams": {
        "bad-value": "A field has an invalid value.",
        "bad-name": "The name has an invisible character, or no letter or digit.",
        "reserved-name": "The name looks like those given to anonymous methods and teams.",
        "name-taken": "Another name looks the same.",
        "renamed-lately": "The name was changed recently; the message says when it can be changed again.",
        "public-name": "The name of a public method cannot be changed.",
        "shown-for-good": "A public method cannot be made anonymous or private.",
        "not-confirmed": "An action that cannot be undone was not confirmed.",
        "not-empty": "Only a private method without a scored or waiting submission can be deleted.",
        "in-a-team": "The person is already in a team.",
        "in-no-team": "The person is in no team.",
        "not-a-member": "The person is not in the team.",
        "not-the-owner": "Only the team's owner may do this.",
        "not-your-team": "The team is no longer the person's own.",
        "not-yourself": "Owners cannot do this to themselves.",
        "hand-over-first": "An owner must hand the team over before leaving it.",
        "no-invitation": "There is no such invitation, or it was used or revoked or has expired.",
        "cannot-join": "The person's own team prevents joining.",
        "too-many-invitations": "The team has reached its limit of unused invitations.",
        "changed-meanwhile": "Somebody changed the team at the same moment; try again.",
    },
    "Receipts": {
        "not-scored": "The submission has no score to sign.",
        "withdrawn": "The submission is withdrawn.",
        "edition-unknown": "The submission has no score in a published edition of that number.",
    },
    "Maintainers": {
        "edition-refused": "The edition cannot be opened, published, rolled back or discarded now.",
    },
    "Server errors": {
        "database-unavailable": "The database does not answer at the moment.",
        "store-unavailable": "The file store does not answer at the moment.",
        "storage-full": "There is no space left to store a file.",
        "site-busy": "The site restarts, or sends too much already; repeat after `Retry-After` seconds.",
        "server-error": "Something failed on our side; it is in our logs.",
    },
}
"""By the titles of the reference: codes and what they mean."""
API_CODES: Final = {code: about for group in API_GROUPS.values() for code, about in group.items()}
_CODES_BY_STATUS: Final[dict[int, str]] = {
    400: "bad-request parse-error invalid bad-limit bad-cursor bad-edition bad-moment bad-visibility "
    "bad-filter unknown-column bad-comparison",
    401: "not-authenticated authentication-failed token-malformed token-unknown token-expired token-revoked "
    "account-closed",
    403: "https-required token-scope token-split not-admitted permission-denied not-maintainer",
    404: "not-found no-ground-truth not-on-the-board edition-unknown",
    405: "method-not-allowed",
    406: "not-acceptable",
    409: "not-movable same-file split-not-open split-closed not-scored withdrawn edition-refused",
    413: "too-large",
    415: "unsupported-media-type",
    429: "throttled quota-exceeded",
    500: "server-error",
    503: "database-unavailable store-unavailable site-busy",
    507: "storage-full",
}
_BY_CODE: Final = {code: status for status, codes in _CODES_BY_STATUS.items() for code in codes.split()}
STATUSES: Final[dict[str, tuple[int, ...]]] = {
    **{code: (_BY_CODE.get(code, 422),) for code in API_CODES},
    # Of a submission it is a field, of a comparison the thing that was asked for.
    "unknown-method": (422, 404),
}
"""The HTTP statuses of each code of the API; the first is that of a refusal."""


def document(*, status: int, code: str, detail: str, where: str = "") -> dict[str, Any]:
    """Make the problem document of one problem; `type` is the URL of its code in the API reference."""
    return {
        "type": f"{settings.SITE_URL}/docs/api/#problem-{code}",
        "title": HTTPStatus(status).phrase,
        "status": status,
        "code": code,
        "detail": detail,
        "problems": [{"code": code, "message": detail, "where": where}],
    }


def response(
    *, status: int, code: str, detail: str, where: str = "", headers: Mapping[str, str] | None = None
) -> JsonResponse:
    """Make the same as an answer, for code outside the API's views."""
    return JsonResponse(
        document(status=status, code=code, detail=detail, where=where),
        status=status,
        headers=headers,
        content_type=MEDIA_TYPE,
    )
