"""What the leaderboard remembers. Constraints live here; verbs live beside this package."""

from leaderboard.models.audit import AuditEvent
from leaderboard.models.benchmark import Edition, GroundTruth, PublishedResult, Split
from leaderboard.models.people import ApiToken, Membership, Team, User
from leaderboard.models.submissions import Evaluation, Method, Score, Status, Submission, Visibility

__all__ = [
    "ApiToken",
    "AuditEvent",
    "Edition",
    "Evaluation",
    "GroundTruth",
    "Membership",
    "Method",
    "PublishedResult",
    "Score",
    "Split",
    "Status",
    "Submission",
    "Team",
    "User",
    "Visibility",
]
