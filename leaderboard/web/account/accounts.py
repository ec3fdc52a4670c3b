"""Accounts where allauth reveals too much or locks out the wrong person.

Wrong passwords are counted by address, by account and address, and slowly by account alone; the last does not
hold where the account has signed in before, so nobody locks out the owner. Sign-up takes the same time for a
known address.
"""

import hashlib
from typing import Any
from urllib.parse import urlsplit, urlunsplit

from allauth.account import forms
from allauth.account.adapter import DefaultAccountAdapter, get_adapter
from allauth.account.models import EmailAddress, Login
from allauth.core import context as allauth_context
from allauth.core.exceptions import ReauthenticationRequired
from allauth.core.internal import ratelimit
from allauth.mfa.adapter import DefaultMFAAdapter
from allauth.mfa.models import Authenticator
from django.conf import settings
from django.contrib.auth.base_user import AbstractBaseUser
from django.contrib.auth.hashers import make_password
from django.contrib.auth.models import AnonymousUser
from django.contrib.sites.requests import RequestSite
from django.core.cache import cache
from django.core.exceptions import ValidationError
from django.core.mail import EmailMessage
from django.db import transaction
from django.http import HttpRequest
from django.urls import reverse
from django.utils import timezone

from leaderboard.errors.refusals import Refused
from leaderboard.mails import outbox
from leaderboard.models import MailKind, User
from leaderboard.models.addresses import mailbox_of
from leaderboard.moderation import takeovers
from leaderboard.people import addresses, second_factor
from leaderboard.quotas import mailboxes
from leaderboard.web.account import identity
from leaderboard.web.account.password_forms import VALIDATORS_HELP

KNOWN_ADDRESS_S = 90 * 24 * 3600
# What a request keeps of the addresses that the account had when it began.
PROVED_BEFORE = "proved_before"


class ConfiguredSite(RequestSite):
    """The site of the settings, whatever `Host` a request names."""

    def __init__(self) -> None:
        self.name = settings.BENCHMARK.site_name
        self.domain = urlsplit(settings.SITE_URL).netloc
        self.url = settings.SITE_URL


class AccountAdapter(DefaultAccountAdapter):
    error_messages = {
        **DefaultAccountAdapter.error_messages,
        "incorrect_code": "The code is wrong; expected the code of the last mail that we sent for this.",
        # As long as ACCOUNT_RATE_LIMITS says.
        "too_many_login_attempts": "Too many failed sign-ins. Try again in 5 minutes, or reset the password.",
        "too_many_logins": "Too many sign-ins. Try again in 5 minutes.",
        "too_many_codes": "Too many wrong codes. Try again in 5 minutes.",
        "too_many_codes_today": "Too many wrong codes. Try again tomorrow.",
        "too_many_logins_anywhere": "Too many failed sign-ins. Try again in an hour, or reset the password.",
        "too_many_mails": "We sent several mails to this mailbox within a minute. Try again in a minute.",
    }

    def clean_email(self, email: str) -> str:
        """Return the one spelling of an address for a new account, or one more of an account."""
        try:
            return addresses.accepted(email)
        except Refused as refused:
            raise ValidationError(str(refused), code="invalid") from refused

    def send_mail(self, template_prefix: str, email: str, context: dict[str, Any]) -> None:
        """Send a mail with links to the configured site, now or later."""
        outbox.send_or_keep(message=self._mail(template_prefix, email, context), now=timezone.now())

    def _mail(self, template_prefix: str, email: str, context: dict[str, Any]) -> EmailMessage:
        links = {name: _on_our_site(value) for name, value in context.items() if _is_address(value)}
        given = {"request": allauth_context.request, "email": email, **context}
        rendered: EmailMessage = self.render_mail(
            template_prefix, email, {**given, "current_site": ConfiguredSite(), **links}
        )
        return rendered

    def get_login_redirect_url(self, request: HttpRequest) -> str:
        user = request.user
        if isinstance(user, User) and user.is_maintainer:
            return reverse("maintain")
        return str(super().get_login_redirect_url(request))

    def pre_authenticate(self, request: HttpRequest, **credentials: Any) -> None:
        """Count one try. Raises allauth's validation error after too many, and after fewer wrong ones."""
        # Other spellings of an address give no further tries.
        credentials = _spelled(credentials)
        self._count_wrong(request, **credentials)
        key = self._get_login_attempts_cache_key(request, **credentials)
        # A right password costs as much of the processor as a wrong one.
        if not ratelimit.consume(request, app="allauth.account", action="login_tried", key=key):
            self._rollback_login_failed_rl_usage()
            raise self.validation_error("too_many_logins")

    def _count_wrong(self, request: HttpRequest, **credentials: Any) -> None:
        super().pre_authenticate(request, **credentials)
        login = _login_of(credentials)
        if cache.get(known_address_key(login, ratelimit.get_ip(request))):
            return
        usage = ratelimit.consume(request, app="allauth.account", action="login_failed_anywhere", key=login)
        if not usage:
            self._rollback_login_failed_rl_usage()
            raise self.validation_error("too_many_logins_anywhere")
        # A password that turns out to be right takes back all that was counted for it.
        self._login_failed_rl_usage.usage.extend(usage.usage)

    def authenticate(self, request: HttpRequest, **credentials: Any) -> Any:
        credentials = _spelled(credentials)
        user = super().authenticate(request, **credentials)
        if user and addresses.is_unconfirmed(user):
            # Whoever made it needs to show that the address is theirs, and is told what a wrong password is
            # told: else anybody could sign up with an address, sign in, and learn whether it was free.
            self._count_wrong(request, **credentials)
            _remind(user)
            return None
        if user:
            address = ratelimit.get_ip(request)
            cache.set(known_address_key(_login_of(credentials), address), value=True, timeout=KNOWN_ADDRESS_S)
        return user

    def is_login_by_code_required(self, login: Login) -> bool:
        # A maintainer's password alone must not set up a new app.
        user = login.user
        if not isinstance(user, User) or not second_factor.is_required(user):
            return False
        return not second_factor.is_set_up(user)

    def confirm_email(self, request: HttpRequest, email_address: EmailAddress) -> bool:
        # An unconfirmed account may have given way meanwhile.
        with transaction.atomic():
            user = User.objects.select_for_update(no_key=True).filter(pk=email_address.user_id).first()
            before = takeovers.proved(user) if user else []
            is_confirmed = user is not None and bool(super().confirm_email(request, email_address))
            if user and is_confirmed:
                mailboxes.keep(user=user, now=timezone.now())
        if user and is_confirmed and before:
            self._tell("account/email/email_added", user, before, {"added_email": email_address.email})
        return is_confirmed

    def send_notification_mail(
        self,
        template_prefix: str,
        user: AbstractBaseUser,
        context: dict[str, Any] | None = None,
        email: str | None = None,
    ) -> None:
        """Tell every address that the account had within a week, each with a link to take it back."""
        if not isinstance(user, User):
            return
        before = getattr(allauth_context.request, PROVED_BEFORE, None) or takeovers.proved(user)
        if before:
            self._tell(template_prefix, user, before, context or {})
        else:
            super().send_notification_mail(template_prefix, user, context, email)

    def _tell(self, template_prefix: str, user: User, before: list[str], context: dict[str, Any]) -> None:
        now = timezone.now()
        what = template_prefix.rpartition("/")[2]
        links = takeovers.note(user=user, what=what, before=before, now=now)
        messages = [
            self._mail(template_prefix, address, {"timestamp": now, **context, "undo_url": link})
            for address, link in links.items()
        ]
        outbox.send_or_keep_all(messages=messages, now=now)

    def get_reauthentication_methods(self, user: User | AnonymousUser) -> list[dict[str, Any]]:
        # By code alone where there is one: a known password shows no recovery codes.
        methods: list[dict[str, Any]] = super().get_reauthentication_methods(user)
        if not methods and user.is_authenticated and addresses.are_proved():
            url = reverse(identity.URL_NAME)
            return [{"id": "mailed_code", "description": "Use a code that we email to you", "url": url}]
        return [each for each in methods if each["id"] == "mfa_reauthenticate"] or methods

    def is_reauthentication_required(self, *, app: str, **kwargs: Any) -> bool:
        required = bool(super().is_reauthentication_required(app=app, **kwargs))
        request = allauth_context.request
        methods = self.get_reauthentication_methods(request.user) if required else []
        # allauth asks nothing of accounts that have no way of its own.
        if [each["id"] for each in methods] == ["mailed_code"] and not identity.was_confirmed(request):
            raise ReauthenticationRequired
        return required

    def _get_login_attempts_cache_key(self, request: HttpRequest, **credentials: Any) -> str:
        return f"{_login_of(credentials)}:{ratelimit.get_ip(request)}"

    def _delete_login_attempts_cached_email(self, request: HttpRequest, **credentials: Any) -> None:
        # A reset password opens the account again, from everywhere.
        super()._delete_login_attempts_cached_email(request, **credentials)
        ratelimit.clear(
            request, app="allauth.account", action="login_failed_anywhere", key=_login_of(credentials)
        )


class OwnersAddress(forms.BaseSignupForm):
    """A sign-up form that accepts an address that another account has not proved."""

    def validate_unique_email(self, value: str) -> str:
        if addresses.accounts_of(value).exists():
            return str(super().validate_unique_email(value))
        return value

    def clean(self) -> dict[str, Any]:
        cleaned: dict[str, Any] = super().clean()
        if not self.errors:
            _count_mail(cleaned["email"])
        return cleaned

    def save(self, request: HttpRequest) -> User:
        with transaction.atomic():
            addresses.release(address=self.cleaned_data["email"])
            user: User = super().save(request)
        return user


class SignupForm(OwnersAddress, forms.SignupForm):
    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        confirmed = "We will send a code to it. " if settings.SENDS_MAIL else ""
        self.fields["password1"].help_text = VALIDATORS_HELP
        self.fields["email"].help_text = f"{confirmed}Your team and the maintainers see it."

    def clean(self) -> dict[str, Any]:
        # A bad password and two different ones are reported at once.
        cleaned: dict[str, Any] = super().clean()
        typed = [self.data.get(name) for name in ("password1", "password2")]
        if all(typed) and typed[0] != typed[1] and "password2" not in self.errors:
            self.add_error("password2", "You must type the same password each time.")
        if "password1" in self.errors:
            # The field as it is drawn has been made by now, with its text.
            self["password1"].help_text = ""
        return cleaned

    def try_save(self, request: HttpRequest) -> Any:
        if self.account_already_exists:
            make_password(self.cleaned_data["password1"])
        return super().try_save(request)


class ConfirmAddressForm(forms.ConfirmEmailVerificationCodeForm):
    def clean_code(self) -> Any:
        # The right code releases the address from accounts that have not proved it.
        forms.BaseConfirmCodeForm.clean_code(self)
        if self.user is None:  # the account gave way, or there is none
            raise get_adapter().validation_error("incorrect_code")
        addresses.release(address=self.email, to=self.user)
        return super().clean_code()


class ResetPasswordForm(forms.ResetPasswordForm):
    def clean_email(self) -> str:
        # An unconfirmed account gets no mail: its maker may have another way in.
        address = addresses.stored(self.cleaned_data["email"])
        _count_mail(address)
        self.users = list(addresses.owners_of(address))
        return address


def _remind(user: User) -> None:
    """Mail how to confirm the address, at most once an hour."""
    now = timezone.now()
    name = settings.BENCHMARK.site_name
    text = (
        f"Someone entered the right password of your {name} account, which is not confirmed and cannot be "
        "used. Enter the code of our first mail in the browser in which you signed up, or sign up "
        f"again:\n\n{settings.SITE_URL}{reverse('account_signup')}\n\n"
        "If this wasn't you, do nothing: the account is deleted within a day.\n\n"
        f"--\n{name}\n{settings.SITE_URL}\n"
    )
    subject = f"[{name}] Your account is not confirmed yet"
    # By the outbox, so that the answer takes as long as that to a wrong password.
    key = f"unconfirmed:{user.pk}:{now:%Y%m%d%H}"
    mail = outbox.notice(kind=MailKind.ACCOUNT, user=user, key=key, subject=subject, text=text, now=now)
    outbox.queue([mail])


class AddAddressForm(forms.AddEmailForm):
    def clean_email(self) -> Any:
        address = super().clean_email()
        _count_mail(address)
        return address


class SignInForm(forms.LoginForm):
    def clean_login(self) -> str:
        return addresses.stored(super().clean_login())


def _count_mail(address: str) -> None:
    """Count a mail that anybody can have sent to this mailbox. Raises `ValidationError` after too many."""
    key = mailbox_of(address)
    if not ratelimit.consume(allauth_context.request, app="allauth.account", action="mail", key=key):
        raise get_adapter().validation_error("too_many_mails")


def _spelled(credentials: dict[str, Any]) -> dict[str, Any]:
    given = {
        name: addresses.stored(value) for name in ("email", "username") if (value := credentials.get(name))
    }
    return {**credentials, **given}


def _login_of(credentials: dict[str, Any]) -> str:
    return str(credentials.get("email") or credentials.get("username") or "").lower()


def known_address_key(login: str, address: str) -> str:
    """Return the cache key of the mark that this address has signed in here."""
    # A hash: who signs in from where is nobody's business in a table of the database.
    return "known-address:" + hashlib.sha256(f"{login}\n{address}".encode()).hexdigest()


def _is_address(value: object) -> bool:
    return isinstance(value, str) and urlsplit(value).scheme in {"http", "https"}


def _on_our_site(address: str) -> str:
    parts = urlsplit(address)
    return settings.SITE_URL + urlunsplit(("", "", parts.path, parts.query, parts.fragment))


class SecondFactorAdapter(DefaultMFAAdapter):
    error_messages = {
        **DefaultMFAAdapter.error_messages,
        "cannot_delete_authenticator": "Maintainers of this site need two-factor authentication.",
        "cannot_generate_recovery_codes": "Recovery codes need two-factor authentication; set up an app "
        "first.",
        "incorrect_code": "The code is wrong, expired or already used; expected the code "
        "that the app shows now.",
        "unverified_email": "Verify all email addresses of the account before you set up two-factor "
        "authentication.",
    }

    def get_totp_issuer(self) -> str:
        return settings.BENCHMARK.site_name

    def can_delete_authenticator(self, authenticator: Authenticator) -> bool:
        return not (settings.REQUIRE_SECOND_FACTOR and authenticator.user.is_maintainer)
