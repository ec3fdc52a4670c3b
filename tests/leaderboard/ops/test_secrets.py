"""Which parts of a log line are secrets."""

import pytest

from leaderboard.ops.logs import without_secrets


@pytest.mark.parametrize(
    ("line", "clean"),
    [
        ("token tsttc_0123abcd0123abcd ended", "token tsttc_[hidden] ended"),
        ("Authorization: Bearer abc.def-1~/+==", "Authorization: Bearer [hidden]"),
        ("authorization: basic dXNlcjpwYXNz", "authorization: basic [hidden]"),
        ("redis://:swordfish@cache:6379/0 refused", "redis://[hidden]@cache:6379/0 refused"),
        ("postgres://web:sword%2Ffish@db/site", "postgres://[hidden]@db/site"),
        (
            "GET /accounts/password/reset/key/4-abc-def/ by ada@example.org",
            "GET /accounts/password/reset/key/[hidden] by [address hidden]",
        ),
        ("GET /accounts/confirm-email/OTU0bQ:x_y/?next=/", "GET /accounts/confirm-email/[hidden]?next=/"),
        (
            "Forbidden (CSRF token missing.): /team/join/OTU0bQ-x_y/",
            "Forbidden (CSRF token missing.): /team/join/[hidden]",
        ),
        ("next=%2Fteam%2Fjoin%2FOTU0bQ&x=1", "next=%2Fteam%2Fjoin%2F[hidden]&x=1"),
        ("mail to ada.l+x@uni.example.ac.uk failed", "mail to [address hidden] failed"),
        ("GET https://example.org/team/join-us/ 200", "GET https://example.org/team/join-us/ 200"),
        ("claimed by worker@1, 3 files", "claimed by worker@1, 3 files"),
    ],
)
def test_a_secret_and_an_address_are_taken_out_and_nothing_else(line: str, clean: str) -> None:
    assert without_secrets(line) == clean
