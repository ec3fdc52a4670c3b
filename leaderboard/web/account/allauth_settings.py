"""The settings of allauth that are the same everywhere; `leaderboard/settings.py` has the others."""

from typing import Any, Final

_HERE: Final = "leaderboard.web.account"

SETTINGS: Final[dict[str, Any]] = {
    "ACCOUNT_USER_MODEL_USERNAME_FIELD": None,
    "ACCOUNT_LOGIN_METHODS": {"email"},
    "ACCOUNT_SIGNUP_FIELDS": ["email*", "password1*", "password2*"],
    "ACCOUNT_SIGNUP_FORM_CLASS": f"{_HERE}.team_views.SignupNameForm",
    "ACCOUNT_SESSION_REMEMBER": True,
    # A found open session must not be enough to take the account over: changed addresses, and all else that
    # `identity.py` names, need the password, a code of the app, or a mailed code.
    "ACCOUNT_REAUTHENTICATION_REQUIRED": True,
    # Who is new has no submissions to come back to.
    "ACCOUNT_SIGNUP_REDIRECT_URL": "/submit/",
    "ACCOUNT_ADAPTER": f"{_HERE}.accounts.AccountAdapter",
    "ACCOUNT_FORMS": {
        "login": f"{_HERE}.accounts.SignInForm",
        "signup": f"{_HERE}.accounts.SignupForm",
        "add_email": f"{_HERE}.accounts.AddAddressForm",
        "confirm_email_verification_code": f"{_HERE}.accounts.ConfirmAddressForm",
        "reset_password": f"{_HERE}.accounts.ResetPasswordForm",
        "reset_password_from_key": f"{_HERE}.password_forms.ResetPasswordKeyForm",
        "change_password": f"{_HERE}.password_forms.ChangePasswordForm",
        "set_password": f"{_HERE}.password_forms.SetPasswordForm",
    },
    # Sign-ins, wrong passwords and wrong codes; the keys are an account at an address, and an account (see
    # accounts.py and codes.py).
    "ACCOUNT_RATE_LIMITS": {
        "login": "20/m/ip",
        "login_tried": "20/5m/key,100/d/key",
        "login_failed": "10/m/ip,5/5m/key",
        "login_failed_anywhere": "30/h/key",
        "code_failed": "10/m/ip,5/5m/key,50/d/key",
        "code_failed_anywhere": "50/d/key",
        # Mails that anybody can ask for; the key is the mailbox.
        "mail": "5/m/key",
    },
    # A mail may take its time. Of codes that it names there are 2.6e10; each is good for three tries.
    "ACCOUNT_EMAIL_VERIFICATION_BY_CODE_TIMEOUT": 3600,
    "ACCOUNT_LOGIN_BY_CODE_TIMEOUT": 3600,
    "ACCOUNT_LOGIN_TIMEOUT": 3600,
    "ACCOUNT_EMAIL_VERIFICATION_SUPPORTS_RESEND": True,
    "ACCOUNT_LOGIN_BY_CODE_SUPPORTS_RESEND": True,
    "ACCOUNT_EMAIL_CONFIRMATION_AUTHENTICATED_REDIRECT_URL": "/accounts/email/",
    # A change of how one signs in is mailed to the owner of the account.
    "ACCOUNT_EMAIL_NOTIFICATIONS": True,
    "MFA_ADAPTER": f"{_HERE}.accounts.SecondFactorAdapter",
    "MFA_FORMS": {
        "authenticate": f"{_HERE}.codes.AuthenticateForm",
        "reauthenticate": f"{_HERE}.codes.ReauthenticateForm",
        "activate_totp": f"{_HERE}.codes.ActivateForm",
    },
    "SOCIALACCOUNT_ADAPTER": f"{_HERE}.providers.ProviderAdapter",
    "SOCIALACCOUNT_FORMS": {
        "signup": f"{_HERE}.providers.ProviderSignupForm",
        "disconnect": f"{_HERE}.providers.ConnectedForm",
    },
    # Who signs up reads of the rules first, and chooses a name.
    "SOCIALACCOUNT_AUTO_SIGNUP": False,
    "SOCIALACCOUNT_REAUTHENTICATION_REQUIRED": True,
    "SOCIALACCOUNT_REQUESTS_TIMEOUT": 5,
}
