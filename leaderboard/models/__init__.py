"""The tables. Constraints live here; the functions that change rows live in the rooms."""

from leaderboard.models.audit import AuditEvent, AuditText
from leaderboard.models.backups import BackupRun, LostFile
from leaderboard.models.benchmark import (
    Edition,
    GroundTruth,
    Publication,
    PublishedResult,
    Split,
    TruthComparison,
)
from leaderboard.models.boards import BoardVersion
from leaderboard.models.cache_table import CachedValue
from leaderboard.models.faults import Fault
from leaderboard.models.inference import Analysis, Comparison, EditionRanges
from leaderboard.models.installation import Installation
from leaderboard.models.mails import Mail, MailKind
from leaderboard.models.methods import BoxSource, Cameras, Method, Visibility
from leaderboard.models.pages import PageVersion
from leaderboard.models.people import AccountChange, ApiToken, Invitation, Membership, Scope, Team, User
from leaderboard.models.quotas import Admission, OldAddress, QuotaOverride, SpentMailbox
from leaderboard.models.submissions import (
    Evaluation,
    Score,
    SentFile,
    Status,
    Submission,
)
from leaderboard.models.sweep import SweepBeat
