"""Accounts, teams and API tokens."""

import uuid
from typing import Any, ClassVar

from django.contrib.auth.base_user import AbstractBaseUser, BaseUserManager
from django.contrib.auth.models import PermissionsMixin
from django.core.exceptions import ValidationError
from django.db import models
from django.db.models import Case, F, Value, When
from django.db.models.functions import Concat, Lower, StrIndex, Substr
from django.db.models.lookups import GreaterThan, LessThan
from django.utils import timezone
from knox.models import AbstractAuthToken

from leaderboard.models.addresses import fault_of, spelled

# Where an address has a plus sign and where its @, from 1; 0: nowhere.
_PLUS, _AT = StrIndex("email", Value("+")), StrIndex("email", Value("@"))
MAILBOX = Lower(
    Case(
        When(
            GreaterThan(_PLUS, 1) & LessThan(_PLUS, _AT),
            then=Concat(Substr("email", 1, _PLUS - 1), Substr("email", _AT)),
        ),
        default=F("email"),
        output_field=models.CharField(),
    )
)
"""`addresses.mailbox_of` for the database, right for every address in its one spelling; see `OldAddress`."""


class UserManager(BaseUserManager["User"]):
    def create_user(self, email: str, password: str | None = None, **fields: Any) -> "User":
        """Make an account; without a password it can only be entered by resetting one."""
        user = self.model(email=spelled(email), **fields)
        user.set_password(password)
        user.save(using=self._db)
        return user

    def create_superuser(self, email: str, password: str | None = None, **fields: Any) -> "User":
        """Make an account of a maintainer. Raises `ValidationError`, as the command of Django expects."""
        fault = fault_of(spelled(email))
        if not fault and self.filter(email=spelled(email)).exists():
            fault = "Another account has this address; expected an address of its own."
        if fault:
            raise ValidationError(fault)
        return self.create_user(email, password, is_staff=True, is_superuser=True, **fields)


class User(AbstractBaseUser, PermissionsMixin):  # type: ignore[django-manager-missing]  # knox has no types
    """An account. Maintainers are those with `is_staff`."""

    email = models.EmailField("e-mail address", unique=True)
    mailbox = models.GeneratedField(
        expression=MAILBOX, output_field=models.CharField(max_length=254), db_persist=True, db_index=True
    )
    name = models.CharField("name", max_length=80, blank=True, help_text="Shown as the team's name.")
    is_staff = models.BooleanField("maintainer", default=False)
    is_active = models.BooleanField("active", default=True)
    date_joined = models.DateTimeField(default=timezone.now)
    muted_kinds = models.CharField(
        max_length=100,
        blank=True,
        help_text="Kinds of mail that the person does not want, in a row.",
    )

    objects: ClassVar[UserManager] = UserManager()

    EMAIL_FIELD = "email"
    USERNAME_FIELD = "email"

    def __str__(self) -> str:
        return self.email

    # Of a session or a token, not of the account: whether maintainers must give a code here and this one has
    # given none. A token never gives one.
    owes_a_code = False

    @property
    def is_maintainer(self) -> bool:
        return self.is_active and self.is_staff

    @property
    def acts_as_maintainer(self) -> bool:
        """Tell whether the person may act as a maintainer here (second factor)."""
        return self.is_maintainer and not self.owes_a_code


class Team(models.Model):
    id = models.UUIDField(primary_key=True, default=uuid.uuid4, editable=False)
    name = models.CharField(max_length=80)
    # What the name looks like once confusable characters are folded: no two teams that show it look the same.
    look = models.CharField(max_length=320, db_index=True)
    is_shown = models.BooleanField(
        default=False, help_text="Whether everybody has been shown its name, with a public method."
    )
    renamed_at = models.DateTimeField(null=True, blank=True)
    created_at = models.DateTimeField(default=timezone.now)
    members = models.ManyToManyField(User, through="Membership", related_name="teams")

    class Meta:
        constraints = [
            # A hidden team takes nobody's name: that it is there would be told by the refusal.
            models.UniqueConstraint(
                fields=["look"], condition=models.Q(is_shown=True), name="shown_teams_look_different"
            ),
        ]

    def __str__(self) -> str:
        return self.name


class Membership(models.Model):
    """A person's membership; at most one a person."""

    # What stands in addresses: the accounts' own numbers would tell how many there are.
    handle = models.UUIDField(default=uuid.uuid4, editable=False, unique=True)
    team = models.ForeignKey(Team, on_delete=models.CASCADE, related_name="memberships")
    user = models.OneToOneField(User, on_delete=models.CASCADE, related_name="membership")
    is_owner = models.BooleanField(default=False)
    joined_at = models.DateTimeField(default=timezone.now)

    def __str__(self) -> str:
        return f"{self.user} in {self.team}"


class Invitation(models.Model):
    """A link that lets one person into a team once. Kept as its hash; shown once."""

    id = models.UUIDField(primary_key=True, default=uuid.uuid4, editable=False)
    team = models.ForeignKey(Team, on_delete=models.CASCADE, related_name="invitations")
    secret_hash = models.CharField(max_length=64, unique=True)
    created_by = models.ForeignKey(User, on_delete=models.CASCADE, related_name="+")
    created_at = models.DateTimeField(default=timezone.now)
    expires_at = models.DateTimeField()
    accepted_by = models.ForeignKey(User, null=True, blank=True, on_delete=models.SET_NULL, related_name="+")
    accepted_at = models.DateTimeField(null=True, blank=True)
    revoked_at = models.DateTimeField(null=True, blank=True)

    class Meta:
        ordering = ["-created_at"]

    def __str__(self) -> str:
        return f"invitation into {self.team}"


class Scope(models.TextChoices):
    READ = "read", "read"
    SUBMIT = "submit", "submit"
    PUBLISH = "publish", "publish"


class ApiToken(AbstractAuthToken):
    """A key for programs: hashed at rest, shown once."""

    name = models.CharField(max_length=80)
    may_read = models.BooleanField(default=True)
    may_submit = models.BooleanField(default=True)
    may_publish = models.BooleanField(default=False)
    split = models.ForeignKey(
        "Split",
        null=True,
        blank=True,
        on_delete=models.CASCADE,
        related_name="+",
        help_text="The only split that it is good for; empty: all of them.",
    )
    last_used_at = models.DateTimeField(null=True, blank=True, help_text="To the minute.")
    revoked_at = models.DateTimeField(null=True, blank=True)

    class Meta:
        verbose_name = "API token"
        constraints = [
            models.CheckConstraint(
                condition=models.Q(may_read=True) | models.Q(may_submit=True) | models.Q(may_publish=True),
                name="token_is_good_for_something",
            ),
        ]

    def __str__(self) -> str:
        return f"{self.name} ({self.token_key}…)"

    @property
    def scopes(self) -> tuple[str, ...]:
        granted = {
            Scope.READ: self.may_read,
            Scope.SUBMIT: self.may_submit,
            Scope.PUBLISH: self.may_publish,
        }
        return tuple(scope.value for scope, is_granted in granted.items() if is_granted)


class AccountChange(models.Model):
    """A change of how a person signs in, kept so that its owner can undo it."""

    user = models.ForeignKey(User, on_delete=models.CASCADE, related_name="changes")
    at = models.DateTimeField(default=timezone.now)
    what = models.CharField(max_length=60, help_text="The name of the mail that told of it.")
    before = models.JSONField(help_text="The proved addresses before it, the primary one first.")
    undone_at = models.DateTimeField(null=True, blank=True)

    class Meta:
        indexes = [models.Index(fields=["user", "at"], name="changes_of_an_account")]

    def __str__(self) -> str:
        return f"{self.what} of {self.at:%Y-%m-%d}"
