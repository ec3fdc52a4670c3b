"""Who may do what: one line for each route, one status for each role.

To add a route, add a line to `LINES`: its name in the URLconf, and for each method that it takes the answers
to the seven roles, in the order of `ROLES`. The shapes above the table cover most of them. An answer is a
status, or `in` for "sign in first". Where a method needs a body, or a route another object than the usual
ones of `tests/security/people.py`, say so with `sends=` and `at=`.

Methods that a line does not name must be refused to everybody, whatever the refusal; the test tries them.
Whether a route of the API has a line for each of its operations in the OpenAPI schema is checked as well.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

ROLES = ("anonymous", "stranger", "teammate", "owner", "maintainer", "token without scope", "expired token")

# --- shapes: one answer for each role -----------------------------------------------------------------------
# On pages a token is nothing: who brings one is a visitor like any other.

OPEN = "200 200 200 200 200 200 200"
SIGNED_IN = "in  200 200 200 200 in  in"
OWN = "in  404 200 200 200 in  in"  # maintainers may look at everybody's
TEAM = "in  404 200 200 404 in  in"  # and act for nobody
KEEPERS = "in  404 404 404 200 in  in"
SENT_ON = "in  302 302 302 302 in  in"  # to the password, or to the page where one begins
NOT_THERE = "in  404 404 404 404 in  in"

API_OPEN = "200 200 200 200 200 403 401"
API_SIGNED_IN = "401 200 200 200 200 403 401"
API_OWN = "401 404 200 200 200 403 401"
API_TEAM = "401 404 200 200 404 403 401"
API_KEEPERS = "401 403 403 403 200 403 401"
API_BLIND = "200 200 200 200 200 200 200"  # looks at no token at all


@dataclass(frozen=True)
class Line:
    """What a route answers. `answers` maps a method to its seven answers."""

    answers: Mapping[str, tuple[str, ...]]
    at: Mapping[str, object] = field(default_factory=dict)
    sends: Mapping[str, object] = field(default_factory=dict)
    is_json: bool = False


def line(
    *,
    at: Mapping[str, object] | None = None,
    sends: Mapping[str, object] | None = None,
    is_json: bool = False,
    **answers: str,
) -> Line:
    """A line: `line(GET=OPEN)`, `line(GET=OWN, POST="in 404 302 302 404 in in", sends={"name": "x"})`."""
    split = {method: tuple(text.split()) for method, text in answers.items()}
    assert all(len(codes) == len(ROLES) for codes in split.values()), answers
    return Line(answers=split, at=at or {}, sends=sends or {}, is_json=is_json)


def all_of(status: str) -> str:
    return " ".join([status] * len(ROLES))


LINES: dict[str, Line] = {
    # --- pages that everybody may read ---
    "home": line(GET=OPEN),
    "main_board": line(GET=all_of("302")),
    "robots": line(GET=OPEN),
    "sitemap": line(GET=OPEN),
    "favicon": line(GET=all_of("302")),
    "board": line(GET=OPEN),
    "charts": line(GET=OPEN),
    "progress_options": line(GET=OPEN),
    "editions": line(GET=OPEN),
    "edition": line(GET=OPEN),
    "compare": line(GET=OPEN),
    "published": line(GET=OPEN),
    "published_table": line(GET=OPEN, at={"table_name": "main-results", "suffix": "csv"}),
    "export": line(GET=OPEN, at={"chosen": "csv"}),
    "edition_export": line(GET=OPEN, at={"chosen": "tex"}),
    "feed": line(GET=OPEN),
    "feed_of_all": line(GET=OPEN),
    # What stands in a README is what everybody sees, whoever looks: the owner's method is private.
    "badge": line(GET=all_of("404")),
    # No worker has drawn it: the picture of every page.
    "docs": line(GET=OPEN),
    "docs_search": line(GET=OPEN),
    "guide": line(GET=OPEN, at={"guide_name": "researchers"}),
    "site_page": line(GET=OPEN, at={"page_name": "privacy"}),
    # Nobody has built a wheel.
    "dist": line(GET=all_of("404")),
    "dist_file": line(GET=all_of("404"), at={"wheel_name": "tsttc-0-py3-none-any.whl"}),
    "api_reference": line(GET=OPEN),
    "api_operation": line(GET=OPEN, at={"operation_id": "submit"}),
    # The owner's method is private: its page is its team's, and maintainers'.
    "method": line(GET="404 404 200 200 200 404 404"),
    # --- one's own ---
    "submit": line(GET=SIGNED_IN, POST="in 422 422 422 422 in in"),
    "template": line(GET=OPEN),
    "submissions": line(GET=SIGNED_IN),
    "submission": line(GET=OWN),
    # 286: it is scored and has its intervals, do not ask again.
    "submission_state": line(GET="in 404 286 286 286 in in"),
    # Hidden splits have none, whoever asks.
    "analysis": line(GET="in 404 404 404 404 in in"),
    # Without its tick nothing is withdrawn.
    "withdraw": line(GET=TEAM, POST="in 404 422 422 404 in in"),
    # Without a method nothing is moved.
    "submission_move": line(GET=TEAM, POST="in 404 422 422 404 in in"),
    "receipt": line(GET=TEAM),
    "receipt_keys": line(GET=OPEN),
    # Sent without a field, an edit changes nothing; showing a method needs to be said.
    "method_edit": line(GET=TEAM, POST="in 404 302 302 404 in in"),
    # It has a score.
    "method_delete": line(GET=TEAM, POST="in 404 422 422 404 in in"),
    "method_visibility": line(GET=TEAM, POST="in 404 422 422 404 in in"),
    # --- one's own team; the maintainer is in none ---
    "team": line(GET=SIGNED_IN, POST="in 422 422 422 422 in in"),
    "invite": line(POST="in 302 422 302 404 in in"),
    "revoke_invitation": line(POST="in 404 422 302 404 in in"),
    # Whoever has the link may look; who is in the team already does not join it.
    "join_team": line(GET=OPEN, POST="in 302 422 422 302 in in"),
    # An owner who is not alone hands over first.
    "leave_team": line(POST="in 302 302 422 404 in in"),
    "hand_over_team": line(POST="in 404 422 302 404 in in"),
    "remove_member": line(POST="in 404 422 302 404 in in"),
    "account": line(GET=SIGNED_IN),
    "mails": line(GET=SIGNED_IN, POST="in 302 302 302 302 in in"),
    "tokens": line(GET=SIGNED_IN, POST="in 422 422 422 422 in in"),
    # Everybody has tokens of their own, the one of nobody that is named here is not there.
    "account_data": line(GET=SIGNED_IN, POST="in 422 422 422 422 in in"),
    "account_data_download": line(GET=SIGNED_IN),
    "revoke_token": line(POST="in 404 404 404 404 in in"),
    # --- maintainers' pages: to everybody else they are not there ---
    "maintain": line(GET=KEEPERS),
    "maintain_pages": line(GET=KEEPERS),
    # Without a text there is nothing to save.
    "maintain_page": line(GET=KEEPERS, POST="in 404 404 404 422 in in", at={"page_name": "rules"}),
    "maintain_mails": line(GET=KEEPERS),
    "maintain_audit": line(GET=KEEPERS),
    "maintain_audit_json": line(GET=KEEPERS),
    "maintain_queue": line(GET=KEEPERS),
    "maintain_queue_state": line(GET=KEEPERS),
    # Without anything chosen there is nothing to retry, without rules none to set.
    "maintain_retry": line(POST="in 404 404 404 422 in in"),
    "maintain_quotas": line(GET=KEEPERS),
    "maintain_team_quotas": line(GET=KEEPERS),
    "maintain_quota": line(GET=KEEPERS, POST="in 404 404 404 422 in in"),
    "maintain_quota_end": line(GET=KEEPERS, POST="in 404 404 404 422 in in"),
    "maintain_admit": line(GET=KEEPERS, POST="in 404 404 404 422 in in"),
    "maintain_admission_end": line(GET=KEEPERS, POST="in 404 404 404 422 in in"),
    "maintain_splits": line(GET=KEEPERS),
    "maintain_teams": line(GET=KEEPERS),
    "maintain_team": line(GET=KEEPERS),
    "maintain_action": line(GET=KEEPERS, POST="in 404 404 404 422 in in", at={"action_name": "rename-team"}),
    "maintain_published": line(GET=KEEPERS, POST="in 404 404 404 422 in in"),
    # An empty form takes the line away.
    "maintain_announcement": line(GET=KEEPERS, POST="in 404 404 404 302 in in"),
    "maintain_split_add": line(GET=KEEPERS, POST="in 404 404 404 422 in in"),
    "maintain_published_remove": line(GET=KEEPERS, POST="in 404 404 404 422 in in"),
    "maintain_mail": line(GET=KEEPERS, POST="in 404 404 404 422 in in"),
    "maintain_split": line(GET=KEEPERS, POST="in 404 404 404 422 in in"),
    "maintain_open": line(GET=KEEPERS, POST="in 404 404 404 422 in in"),
    "maintain_edition": line(GET=KEEPERS),
    "maintain_progress": line(GET="in 404 404 404 286 in in"),
    "maintain_preview_csv": line(GET=KEEPERS),
    "maintain_publish": line(GET=KEEPERS, POST="in 404 404 404 422 in in"),
    "maintain_roll_back": line(GET=KEEPERS, POST="in 404 404 404 422 in in"),
    "maintain_discard": line(GET=KEEPERS, POST="in 404 404 404 422 in in"),
    # --- the API ---
    "api-submissions": line(GET=API_SIGNED_IN, POST="401 422 422 422 422 403 401"),
    "api-submission": line(GET=API_OWN),
    "api-file": line(GET=API_TEAM),
    "api-receipt": line(GET=API_TEAM),
    # Without two methods there is nothing to compare; who may see which is the methods' own affair.
    "api-compare": line(GET="404 404 404 404 404 403 401"),
    # Maintainers see it, and are told that it is not theirs.
    "api-withdraw": line(POST="401 404 200 200 422 403 401"),
    # It takes JSON alone.
    "api-move": line(POST="401 404 415 415 415 403 401"),
    # The owner's method is private.
    "api-methods": line(GET=API_SIGNED_IN),
    "api-method": line(
        GET="404 404 200 200 200 403 401",
        PATCH="401 404 200 200 404 403 401",
        sends={"description": "x"},
        is_json=True,
    ),
    # Without `as` the team is told what it forgot, and nobody else that there is anything.
    "api-method-visibility": line(
        GET="401 404 400 400 404 403 401",
        POST="401 404 200 200 404 403 401",
        sends={"visibility": "ANONYMOUS", "confirm": True},
        is_json=True,
    ),
    # Who may only submit has to know when.
    "api-account": line(GET="401 200 200 200 200 200 401"),
    "api-quota": line(GET="401 200 200 200 200 200 401"),
    "api-revoke-token": line(POST=API_BLIND, sends={"token": "nonsense"}, is_json=True),
    "api-splits": line(GET=API_OPEN),
    "api-board": line(GET=API_OPEN),
    "api-editions": line(GET=API_OPEN),
    "api-edition-board": line(GET=API_OPEN),
    "api-changelog": line(GET=API_OPEN),
    "manifest": line(GET=API_OPEN),
    "api-croissant": line(GET=API_OPEN),
    "api-published-tables": line(GET=API_OPEN),
    "api-published-table": line(GET=API_OPEN, at={"name": "main-results"}),
    "api-edition-progress": line(GET=API_KEEPERS),
    "api-edition-preview": line(GET=API_KEEPERS),
    "api-schema": line(GET=API_OPEN),
    "api-docs": line(GET=all_of("302")),
    "api-root": line(GET=all_of("302")),
    # --- accounts (allauth): 302 sends those who are signed in on, and those who are not to the board ---
    "account_login": line(GET="200 302 302 302 302 200 200", POST="200 302 302 302 302 200 200"),
    "account_signup": line(GET="200 302 302 302 302 200 200", POST="200 302 302 302 302 200 200"),
    "account_logout": line(GET="302 200 200 200 200 302 302", POST=all_of("302")),
    "account_inactive": line(GET=OPEN),
    "account_reauthenticate": line(GET=SIGNED_IN, POST=SIGNED_IN),
    # All have a password, and are led to it.
    "account_reauthenticate_by_code": line(GET=SENT_ON, POST=SENT_ON),
    "account_email": line(GET=SIGNED_IN, POST="in 302 302 302 302 in in"),
    # To visitors only while they sign up.
    "account_email_verification_sent": line(GET="302 200 200 200 200 302 302"),
    # Whoever has the link of the mail takes the account back; this one is none.
    "account_undo": line(GET=all_of("410"), POST=all_of("410"), at={"secret": "nonsense"}),
    "account_change_password": line(GET=SIGNED_IN, POST=SIGNED_IN),
    "account_set_password": line(GET="in 302 302 302 302 in in", POST="in 302 302 302 302 in in"),
    "account_reset_password": line(GET=OPEN, POST=OPEN),
    "account_reset_password_done": line(GET=OPEN),
    "account_reset_password_from_key": line(GET=OPEN, POST=OPEN),
    "account_reset_password_from_key_done": line(GET=OPEN),
    "account_confirm_email": line(GET=OPEN, POST=all_of("404")),
    # Signing in by a mailed code is not offered: whoever comes here is sent away.
    "account_confirm_login_code": line(GET=all_of("302"), POST=all_of("302")),
    # --- the second factor, which nobody here has: its pages lead to the first step, or are not there ---
    "mfa_index": line(GET=SIGNED_IN),
    "mfa_authenticate": line(GET=all_of("302"), POST=all_of("302")),
    "mfa_reauthenticate": line(GET=SENT_ON, POST=SENT_ON),
    "mfa_activate_totp": line(GET=SENT_ON, POST=SENT_ON),
    "mfa_deactivate_totp": line(GET=NOT_THERE, POST=NOT_THERE),
    "mfa_view_recovery_codes": line(GET=NOT_THERE),
    "mfa_generate_recovery_codes": line(GET=SENT_ON, POST=SENT_ON),
    "mfa_download_recovery_codes": line(GET=NOT_THERE),
    # What is below /api/ and no address of it, told as a problem.
    "^api(/|$)": line(GET=all_of("404")),
    # --- monitoring: figures are for the operator's own network ---
    "healthz": line(GET=OPEN),
    "readyz": line(GET=all_of("200")),
    "healthy": line(GET=all_of("503")),  # nothing has swept this database
    "metrics": line(GET=all_of("403")),
}
