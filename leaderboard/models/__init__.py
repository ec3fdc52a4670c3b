"""What the leaderboard remembers. Constraints live here; verbs live beside this package."""

from leaderboard.models.audit import AuditEvent
from leaderboard.models.benchmark import Edition, GroundTruth, Publication, PublishedResult, Split
from leaderboard.models.people import ApiToken, Membership, Scope, Team, User
from leaderboard.models.quotas import QuotaOverride
from leaderboard.models.submissions import Evaluation, Method, Score, Status, Submission, Visibility
from leaderboard.models.sweep import SweepBeat

__all__ = [
    "ApiToken",
    "AuditEvent",
    "Edition",
    "Evaluation",
    "GroundTruth",
    "Membership",
    "Method",
    "Publication",
    "PublishedResult",
    "QuotaOverride",
    "Scope",
    "Score",
    "Split",
    "Status",
    "Submission",
    "SweepBeat",
    "Team",
    "User",
    "Visibility",
]
