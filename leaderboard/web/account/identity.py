"""Confirming who acts, before anything that takes an account over: a mailed code where there is no password.

allauth asks for the password or a code of the app, and asks nothing of an account that has neither: one that
signs in with ORCID or GitHub alone. Such an account gets a code at its primary address.
"""

import secrets
import time
from typing import Any, Final

from allauth.account.adapter import get_adapter
from allauth.account.authentication import get_authentication_records
from allauth.account.decorators import reauthentication_required
from allauth.account.forms import BaseConfirmCodeForm
from allauth.account.internal.flows.login import record_authentication
from allauth.account.models import EmailAddress
from allauth.account.views import BaseReauthenticateView, password_set
from allauth.core.ratelimit import consume
from django.conf import settings
from django.contrib import messages
from django.contrib.auth.decorators import login_required
from django.http import HttpRequest, HttpResponse, HttpResponseBase
from django.utils.decorators import method_decorator
from django.views.decorators.cache import never_cache

from leaderboard.models import User

URL_NAME: Final = "account_reauthenticate_by_code"
MAX_WRONG: Final = 3
VALID_S: Final = 900
_KEY: Final = "account_mailed_code"


def was_confirmed(request: HttpRequest) -> bool:
    """Tell whether this session has confirmed who acts within the last minutes."""
    records = get_authentication_records(request, request.user if request.user.is_authenticated else None)
    since_s = time.time() - getattr(settings, "ACCOUNT_REAUTHENTICATION_TIMEOUT", 300)
    return any(record.get("reauthenticated") and record["at"] >= since_s for record in records)


class MailedCodeForm(BaseConfirmCodeForm):
    pass


@method_decorator([never_cache, login_required], name="dispatch")
class MailedCodeView(BaseReauthenticateView):
    """Mails a code and asks for it. Each code is good for three tries and fifteen minutes."""

    form_class = MailedCodeForm
    template_name = "account/reauthenticate_by_code.html"

    def get(self, request: HttpRequest, *args: Any, **kwargs: Any) -> HttpResponseBase:
        if not _pending(request) and not _mail_code(request):
            messages.error(request, "Too many codes were sent. Try again in a minute.")
        return super().get(request, *args, **kwargs)

    def post(self, request: HttpRequest, *args: Any, **kwargs: Any) -> HttpResponseBase:
        if request.POST.get("action") == "resend":
            request.session.pop(_KEY, None)
            return self.get(request, *args, **kwargs)
        return super().post(request, *args, **kwargs)

    def get_form_kwargs(self) -> dict[str, Any]:
        return {**super().get_form_kwargs(), "code": _pending(self.request).get("code", secrets.token_hex())}

    def form_valid(self, form: BaseConfirmCodeForm) -> HttpResponse:
        self.request.session.pop(_KEY, None)
        record_authentication(self.request, self.request.user, method="mailed_code", reauthenticated=True)
        return super().form_valid(form)

    def form_invalid(self, form: BaseConfirmCodeForm) -> HttpResponse:
        pending = _pending(self.request)
        if pending:
            pending["n_wrong"] += 1
            self.request.session[_KEY] = pending
        if not _pending(self.request):
            messages.error(self.request, "This code is no longer valid. Press “Send another code”.")
        return super().form_invalid(form)

    def get_context_data(self, **kwargs: Any) -> dict[str, Any]:
        return {**super().get_context_data(**kwargs), "email": _address(self.request)}


def _address(request: HttpRequest) -> str:
    return str(EmailAddress.objects.get_primary_email(request.user) or "")


def _pending(request: HttpRequest) -> dict[str, Any]:
    pending: dict[str, Any] = request.session.get(_KEY) or {}
    is_usable = pending and pending["n_wrong"] < MAX_WRONG and time.time() - pending["at"] < VALID_S
    return pending if is_usable and pending["email"] == _address(request) else {}


def _mail_code(request: HttpRequest) -> bool:
    adapter, email = get_adapter(), _address(request)
    if not consume(request, action="reauthenticate", key=email, user=request.user):
        return False
    code = adapter.generate_login_code()
    request.session[_KEY] = {"code": code, "at": time.time(), "n_wrong": 0, "email": email}
    adapter.send_mail("account/email/reauthentication_code", email, {"code": code})
    return True


def _has_no_password(request: HttpRequest) -> bool:
    user = request.user
    return isinstance(user, User) and not user.has_usable_password()


# Whoever finds an open session must not choose the first password of the account.
set_password = login_required(reauthentication_required(enabled=_has_no_password)(password_set))
