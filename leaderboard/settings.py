"""All settings, read from the environment and described in `docs/settings.md`.

Two profiles: `embedded` (the default: SQLite, no broker, everything below `var/`) and `production`, in which
a missing variable is an error.
"""

import logging
import sys
from datetime import timedelta
from pathlib import Path
from secrets import token_urlsafe
from typing import Any

from django.core.management.utils import get_random_secret_key

from leaderboard import benchmark
from leaderboard.api import settings
from leaderboard.ops import environment, logs
from leaderboard.ops.environment import key_of_checkout, required
from leaderboard.web.account import allauth_settings
from leaderboard.web.middleware import middleware_order

BASE_DIR = Path(__file__).resolve().parent.parent
env = environment.env

PRODUCTION = environment.PRODUCTION
TESTING = "pytest" in sys.modules

# --- where things are kept -------------------------------------------------------------------------------

DATA_DIR = Path(env.str("TSTTC_DATA_DIR", default=str(BASE_DIR / "var")))
# The hidden values. Only workers and the maintainers' commands read it; the web process needs no access.
GROUND_TRUTH_DIR = Path(env.str("TSTTC_GROUND_TRUTH_DIR", default=str(DATA_DIR / "ground-truth")))
# Where workers keep sums per recording, as private as the values; "": in the directory above.
BAGS_DIR = env.str("TSTTC_BAGS_DIR", default="")
FILES_DIR = Path(env.str("TSTTC_FILES_DIR", default=str(DATA_DIR / "files")))
STATIC_ROOT = Path(env.str("TSTTC_STATIC_ROOT", default=str(BASE_DIR / "staticfiles")))
# The wheel of the evaluator that visitors install, as `build_wheel` makes it.
DIST_DIR = Path(env.str("TSTTC_DIST_DIR", default=str(STATIC_ROOT.with_name("dist"))))
if not PRODUCTION:
    # Sessions, password hashes, mailed links in logs: other accounts of this machine read none of it.
    environment.make_private(DATA_DIR)

# --- the frame -------------------------------------------------------------------------------------------

SECRET_KEY = required("TSTTC_SECRET_KEY", embedded="", by={"web"}) or key_of_checkout(
    DATA_DIR / "secret-key", get_random_secret_key
)
# Signs score receipts (see leaderboard/submissions/receipts.py); what former keys signed still verifies.
RECEIPT_KEY = required("TSTTC_RECEIPT_KEY", embedded="", by={"web"}) or key_of_checkout(
    DATA_DIR / "receipt-key", token_urlsafe
)
# Only the web process has the key in production; what others have in its place is random.
HAS_RECEIPT_KEY = not PRODUCTION or bool(env.str("TSTTC_RECEIPT_KEY", default=""))
# What a backup writes of it, which therefore needs no key.
RECEIPT_PUBLIC_KEY = env.str("TSTTC_RECEIPT_PUBLIC_KEY", default="")
RECEIPT_OLD_KEYS = env.list("TSTTC_RECEIPT_OLD_KEYS", default=[])
DEBUG = env.bool("TSTTC_DEBUG", default=False)
ALLOWED_HOSTS = required("TSTTC_ALLOWED_HOSTS", embedded="*").split(",")
CSRF_TRUSTED_ORIGINS = env.list("TSTTC_CSRF_TRUSTED_ORIGINS", default=[])
# The address that people quote; also what absolute links in messages are made of.
SITE_URL = required("TSTTC_SITE_URL", embedded="http://127.0.0.1:8000").rstrip("/")
# What pages, exports, API and mails say of the benchmark.
BENCHMARK = benchmark.read(
    Path(env.str("TSTTC_BENCHMARK", default=str(benchmark.DEFAULT_PATH))),
    site_name=env.str("TSTTC_SITE_NAME", default=""),
)

INSTALLED_APPS = [
    "leaderboard",
    "django.contrib.admin",
    "django.contrib.auth",
    "django.contrib.contenttypes",
    "django.contrib.sessions",
    "django.contrib.messages",
    "whitenoise.runserver_nostatic",
    "django.contrib.staticfiles",
    "allauth",
    "allauth.account",
    "allauth.mfa",
    "allauth.socialaccount",
    "allauth.socialaccount.providers.github",
    "allauth.socialaccount.providers.orcid",
    "csp",
    "django_htmx",
    "django_structlog",
    "drf_spectacular",
    "knox",
    "rest_framework",
]
MIDDLEWARE = middleware_order.MIDDLEWARE
ROOT_URLCONF = "leaderboard.urls"
# The site is at the root of its name. What a request says of another place would be in every link, and in the
# pages that others are shown from memory.
FORCE_SCRIPT_NAME = ""
WSGI_APPLICATION = "leaderboard.wsgi.application"
TEMPLATES = [
    {
        "BACKEND": "django.template.backends.django.DjangoTemplates",
        "DIRS": [BASE_DIR / "templates"],
        "APP_DIRS": True,
        "OPTIONS": {
            "context_processors": [
                "django.template.context_processors.request",
                "django.contrib.auth.context_processors.auth",
                "django.contrib.messages.context_processors.messages",
                "leaderboard.web.context_processors.site",
            ],
        },
    }
]
LANGUAGE_CODE = "en-gb"
TIME_ZONE = "UTC"
USE_I18N = False
DEFAULT_AUTO_FIELD = "django.db.models.BigAutoField"

# --- database, cache, files ------------------------------------------------------------------------------

DATABASES = {
    "default": environment.database(
        required(
            "TSTTC_DATABASE_URL",
            embedded=f"sqlite:///{DATA_DIR / 'leaderboard.sqlite3'}",
            by=environment.PROCESSES,
            elsewhere="sqlite://:memory:",
        )
    )
}
if "sqlite" in DATABASES["default"].get("ENGINE", ""):
    DATABASES["default"]["OPTIONS"] = {
        # A deferred transaction that turns into a writer fails at once with "database is locked".
        "transaction_mode": "IMMEDIATE",
        "timeout": 20,
        "init_command": "PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA busy_timeout=20000;",
    }
else:
    DATABASES["default"]["CONN_MAX_AGE"] = env.int("TSTTC_DATABASE_CONN_MAX_AGE", default=60)
    DATABASES["default"]["CONN_HEALTH_CHECKS"] = True
    DATABASES["default"].setdefault("OPTIONS", {})["connect_timeout"] = 5

# The role of web, workers and maintainers on PostgreSQL, which owns nothing (see the command `grant`).
APPLICATION_ROLE = env.str("TSTTC_APPLICATION_ROLE", default="")
APPLICATION_PASSWORD = env.str("TSTTC_APPLICATION_PASSWORD", default="")

# Prediction files, aligned arrays and public manifests, all named by their digest: in a local directory, or
# in an S3-compatible service that web and workers on several machines share (see leaderboard/storage/s3.py).
FILES_URL = env.str("TSTTC_FILES_URL", default="")
if FILES_URL and not FILES_URL.startswith("s3://"):
    environment.FAULTS.append("TSTTC_FILES_URL is not understood; expected s3://bucket/folder, or nothing.")

CACHES: dict[str, dict[str, Any]] = {
    "default": {"BACKEND": "django.core.cache.backends.locmem.LocMemCache"},
    # What is the same for all readers, by the boards' numbers: each process has its own, so that whoever
    # restores a database of before has only to start the processes anew.
    "boards": {
        "BACKEND": "django.core.cache.backends.locmem.LocMemCache",
        "LOCATION": "boards",
        "TIMEOUT": 300,
        "OPTIONS": {"MAX_ENTRIES": 1000},
    },
    # Answers to addresses with a query, of which anybody can make up any number: they push out nothing else.
    "views": {
        "BACKEND": "django.core.cache.backends.locmem.LocMemCache",
        "LOCATION": "views",
        "TIMEOUT": 300,
        "OPTIONS": {"MAX_ENTRIES": 300},
    },
}
# Signing in is limited by what is counted here (allauth), so that all web processes count together.
if PRODUCTION:
    CACHES["default"] = {
        "BACKEND": "django.core.cache.backends.db.DatabaseCache",
        "LOCATION": "leaderboard_cache",
        "OPTIONS": {"MAX_ENTRIES": 100_000},
    }

STORAGES: dict[str, dict[str, Any]] = {
    "files": {"BACKEND": "leaderboard.storage.s3.S3FileStore", "OPTIONS": {"url": FILES_URL}}
    if FILES_URL
    else {
        "BACKEND": "leaderboard.storage.files.DurableFileSystemStorage",
        "OPTIONS": {"location": str(FILES_DIR)},
    },
    "default": {
        "BACKEND": "django.core.files.storage.FileSystemStorage",
        "OPTIONS": {"location": str(FILES_DIR)},
    },
    "staticfiles": {
        "BACKEND": "django.contrib.staticfiles.storage.StaticFilesStorage"
        if TESTING or DEBUG
        else "whitenoise.storage.CompressedManifestStaticFilesStorage"
    },
}
STATIC_URL = "/static/"
# Tests and debugging serve the sources themselves; everything else serves what collectstatic gathered.
WHITENOISE_AUTOREFRESH = WHITENOISE_USE_FINDERS = TESTING or DEBUG
STATICFILES_DIRS = [
    BASE_DIR / "static",
    ("examples", BASE_DIR / "examples"),
    ("docs", BASE_DIR / "docs" / "figures"),
]

# --- uploads ---------------------------------------------------------------------------------------------

MAX_PREDICTIONS_BYTES = env.int("TSTTC_MAX_PREDICTIONS_BYTES", default=20_000_000)
DATA_UPLOAD_MAX_MEMORY_SIZE = 1_000_000  # form fields; the file itself is streamed to disk
DATA_UPLOAD_MAX_NUMBER_FIELDS = 100
FILE_UPLOAD_HANDLERS = ["leaderboard.web.middleware.upload_handlers.UnnamedFileUploadHandler"]

# How long after a renaming a team or a method can be renamed again; 0: at once.
RENAME_AFTER = timedelta(hours=env.float("TSTTC_RENAME_AFTER_H", default=24.0))
# Whether teams have quotas (see leaderboard/quotas/usage.py).
QUOTAS = env.bool("TSTTC_QUOTAS", default=True)
# Bytes that a team may send in 24 hours, to all splits together, rejected files included; 0: any number.
MAX_TEAM_BYTES_PER_DAY = env.int("TSTTC_MAX_TEAM_BYTES_PER_DAY", default=2_000_000_000)

# --- the life of an evaluation (seconds; see leaderboard/queue/lifecycle.py) ------------------------------

LEASE_S = env.float("TSTTC_LEASE_S", default=60.0)
HEARTBEAT_S = env.float("TSTTC_HEARTBEAT_S", default=LEASE_S / 4)
WALL_S = env.float("TSTTC_WALL_S", default=300.0)
if not 0 < HEARTBEAT_S < LEASE_S < WALL_S:
    # A lease as long as the run itself could not tell a worker that vanished from a file that takes too long.
    environment.FAULTS.append(
        f"TSTTC_HEARTBEAT_S is {HEARTBEAT_S:g}, TSTTC_LEASE_S {LEASE_S:g}, TSTTC_WALL_S {WALL_S:g}; "
        "expected each to be shorter than the next."
    )
SWEEP_S = env.float("TSTTC_SWEEP_S", default=15.0)
# Two nights without a good backup; 0: nobody is told.
MAX_BACKUP_AGE_H = env.float("TSTTC_MAX_BACKUP_AGE_H", default=50.0)
# Without a broker nobody tells the workers, and somebody waits.
POLL_S = env.float("TSTTC_POLL_S", default=5.0 if PRODUCTION else 0.5)
# How often stored files that no submission names are removed (see leaderboard/upkeep/pollers.py).
CLEAN_S = env.float("TSTTC_CLEAN_S", default=6 * 3600.0)
# After a restore none is removed for so many days: a newer database may name it (see storage/ownership.py).
KEEP_AFTER_RESTORE_D = env.float("TSTTC_KEEP_AFTER_RESTORE_D", default=56.0)
BACKOFF_S = env.float("TSTTC_BACKOFF_S", default=2.0)
# Limits of the child process that parses untrusted bytes.
CHILD_MEMORY_BYTES = env.int("TSTTC_CHILD_MEMORY_BYTES", default=1_500_000_000)
# Seconds; and one more for every 25,000 sequences of the manifest.
CHILD_CPU_S = env.int("TSTTC_CHILD_CPU_S", default=4)

# --- Celery: a broker message is only a nudge, the database is the queue ------------------------------------

CELERY_BROKER_URL = required(
    "TSTTC_BROKER_URL",
    embedded="memory://",
    by={"web", "worker", "maintainer"},
    elsewhere="memory://",
)
CELERY_BROKER_TRANSPORT_OPTIONS: dict[str, Any] = {
    # A message that a dying worker held is worth nothing, since workers look by themselves. To restore it,
    # kombu would run a program in Redis, which deploy/redis.acl does not allow.
    "ack_emulation": False,
    "socket_timeout": 5,
    "socket_connect_timeout": 2,
    "socket_keepalive": True,
    "retry_on_timeout": True,
    # Publishing happens inside a web request: fail fast, workers look by themselves.
    "max_retries": 1,
    "interval_start": 0,
    "interval_step": 0.1,
    "interval_max": 0.2,
}
# Queues of questions to workers end with their connection; to let them expire as well takes a program too.
CELERY_CONTROL_QUEUE_EXPIRES = None
CELERY_BROKER_CONNECTION_RETRY_ON_STARTUP = True
CELERY_BROKER_CONNECTION_MAX_RETRIES = None
CELERY_TASK_PUBLISH_RETRY = False
CELERY_TASK_IGNORE_RESULT = True
CELERY_ACCEPT_CONTENT = ["json"]
CELERY_TASK_ACKS_LATE = True
CELERY_TASK_REJECT_ON_WORKER_LOST = True
CELERY_TASK_SOFT_TIME_LIMIT = int(WALL_S) + 30
CELERY_TASK_TIME_LIMIT = int(WALL_S) + 60
CELERY_WORKER_PREFETCH_MULTIPLIER = 1
CELERY_WORKER_MAX_MEMORY_PER_CHILD = env.int("TSTTC_WORKER_MAX_MEMORY_KB", default=1_000_000)
CELERY_WORKER_SOFT_SHUTDOWN_TIMEOUT = 20
# Celery closes the connection to the database around every task, unless told to wait for so many. A new
# one costs PostgreSQL more than a submission, and has none of the statements that were kept.
# `leaderboard/tasks.py` closes those that are lost or older than CONN_MAX_AGE.
CELERY_DB_REUSE_MAX = 1_000_000
CELERY_WORKER_HIJACK_ROOT_LOGGER = False

# --- accounts --------------------------------------------------------------------------------------------

AUTH_USER_MODEL = "leaderboard.User"
AUTHENTICATION_BACKENDS = [
    "django.contrib.auth.backends.ModelBackend",
    "allauth.account.auth_backends.AuthenticationBackend",
]
AUTH_PASSWORD_VALIDATORS = [
    {"NAME": f"django.contrib.auth.password_validation.{name}Validator"}
    for name in ("UserAttributeSimilarity", "MinimumLength", "CommonPassword", "NumericPassword")
]
LOGIN_URL = "account_login"
LOGIN_REDIRECT_URL = "/submissions/"
LOGOUT_REDIRECT_URL = "/"
ACCOUNT_EMAIL_SUBJECT_PREFIX = f"[{BENCHMARK.site_name}] "
vars().update(allauth_settings.SETTINGS)
# Without a mail server, as in the demo, each mail is a file.
NO_MAIL_SERVER = "consolemail://" if PRODUCTION else f"filemail:///{DATA_DIR / 'mail'}"
EMAIL_CONFIG = environment.mail_server(env.str("TSTTC_EMAIL_URL", default=NO_MAIL_SERVER))
vars().update(EMAIL_CONFIG)
# Somebody waits on a page meanwhile; what is not sent within it is sent later.
EMAIL_TIMEOUT = env.float("TSTTC_EMAIL_TIMEOUT_S", default=5.0)
# Whether workers send what waits in the outbox: where they know the mail server.
SENDS_MAIL = bool(env.str("TSTTC_EMAIL_URL", default=""))
DEFAULT_FROM_EMAIL = env.str("TSTTC_FROM_EMAIL", default="leaderboard@localhost")
# Who the pages say answers questions; the pages are edited at /maintain/pages/.
CONTACT_EMAIL = env.str("TSTTC_CONTACT_EMAIL", default="") or DEFAULT_FROM_EMAIL
# Without a mail server nobody would get the code; with one, an address counts once it is proved.
ACCOUNT_EMAIL_VERIFICATION = "mandatory" if SENDS_MAIL else "none"
# With a code, which counts only where it was asked for: nobody proves an address for the account of somebody
# else by following a link, and none is kept before it is proved (see leaderboard/people/addresses.py).
ACCOUNT_EMAIL_VERIFICATION_BY_CODE_ENABLED = SENDS_MAIL
# Proxies of ours in front: of X-Forwarded-For, what the last so many wrote is believed, and nothing else.
TRUSTED_PROXIES = env.int("TSTTC_TRUSTED_PROXIES", default=0)
ALLAUTH_TRUSTED_PROXY_COUNT = TRUSTED_PROXIES
# Whether maintainers need two-factor authentication for their pages (see web/account/accounts.py).
REQUIRE_SECOND_FACTOR = env.bool("TSTTC_REQUIRE_SECOND_FACTOR", default=False)
# Without a mail server nobody could verify an address.
MFA_ALLOW_UNVERIFIED_EMAIL = not SENDS_MAIL
# Accounts elsewhere that people may sign in with (see web/account/providers.py); without a client, none.
SOCIALACCOUNT_PROVIDERS = environment.providers(
    orcid=("ORCID", "TSTTC_ORCID_CLIENT_ID", "TSTTC_ORCID_CLIENT_SECRET"),
    github=("GitHub", "TSTTC_GITHUB_CLIENT_ID", "TSTTC_GITHUB_CLIENT_SECRET"),
)

# --- API -------------------------------------------------------------------------------------------------

KNOX_TOKEN_MODEL = "leaderboard.ApiToken"
# Its migrations make a table of its own model, which stands empty beside ours and hinders every flush.
MIGRATION_MODULES = {"knox": None}
REST_KNOX = {
    "AUTH_HEADER_PREFIX": "Bearer",
    "TOKEN_PREFIX": "tsttc_",
    "TOKEN_TTL": timedelta(days=90),
    "TOKEN_MODEL": KNOX_TOKEN_MODEL,
}
REST_FRAMEWORK = {**settings.REST_FRAMEWORK, "NUM_PROXIES": TRUSTED_PROXIES}
# How often one account or one address may ask (leaderboard/ops/rate_limits.py).
API_RATES: dict[str, str | None] = {
    "signed_in": "600/min",
    "visitor": "240/min",
    "submit": "60/min",
    "as_of": "30/min",
    "revoke": "10/min",
    "refused": "60/min",
}
# What somebody sends on pages, pages that a process draws anew for one address, as of a time and searches
# apart, and comparisons (up to ten pairs each) that nobody has asked for before, on pages or in the API.
PAGE_RATES: dict[str, str | None] = {
    "send": "60/min",
    "draw": "300/min",
    "as_of": "30/min",
    "search": "30/min",
    "compare": "12/min",
}
if TESTING or not env.bool("TSTTC_THROTTLES", default=True):
    API_RATES, PAGE_RATES = dict.fromkeys(API_RATES), dict.fromkeys(PAGE_RATES)
SPECTACULAR_SETTINGS = {**settings.SPECTACULAR_SETTINGS, "TITLE": f"{BENCHMARK.site_name} API"}

# --- what is written down, and who may look --------------------------------------------------------------

LOG_LEVEL = env.str("TSTTC_LOG_LEVEL", default="INFO").upper()
# Who is told of faults of ours by mail, each once an hour.
ERROR_EMAILS = env.list("TSTTC_ERROR_EMAILS", default=[])
LOGGING = logs.logging_settings(
    as_json=env.str("TSTTC_LOG_FORMAT", default="json" if PRODUCTION else "text") == "json",
    level=LOG_LEVEL,
    has_reports=bool(ERROR_EMAILS),
)
logs.configure()
DJANGO_STRUCTLOG_CELERY_ENABLED = True
DJANGO_STRUCTLOG_IP_LOGGING_ENABLED = False
DJANGO_STRUCTLOG_STATUS_START_LOG_LEVEL = logging.DEBUG
# A nudge is worth no line; what came of the evaluation is.
DJANGO_STRUCTLOG_CELERY_TASK_START_LOG_LEVEL = logging.DEBUG
DJANGO_STRUCTLOG_CELERY_TASK_SUCCESS_LOG_LEVEL = logging.DEBUG
# Who may read /metrics; see leaderboard/web/monitoring.py.
METRICS_TOKEN = env.str("TSTTC_METRICS_TOKEN", default="")
METRICS_NETWORKS = environment.networks("TSTTC_METRICS_NETWORKS", default=["127.0.0.0/8", "::1/128"])

# --- security --------------------------------------------------------------------------------------------

CONTENT_SECURITY_POLICY = middleware_order.content_security_policy(SOCIALACCOUNT_PROVIDERS)
SESSION_ENGINE = "leaderboard.web.middleware.sessions"
CSRF_COOKIE_HTTPONLY = True
CSRF_FAILURE_VIEW = "leaderboard.web.error_pages.form_refused"
# Below /api/ http is refused: a client would take a redirect for success, or follow it without the file.
SECURE_REDIRECT_EXEMPT = [r"^healthz$", r"^readyz$", r"^healthy$", r"^metrics$", r"^api/"]
if PRODUCTION and env.bool("TSTTC_HTTPS", default=True):
    SECURE_SSL_REDIRECT = True
    SECURE_PROXY_SSL_HEADER = ("HTTP_X_FORWARDED_PROTO", "https")
    SECURE_HSTS_SECONDS = 365 * 24 * 3600
    SECURE_HSTS_INCLUDE_SUBDOMAINS = True
    SECURE_HSTS_PRELOAD = True
    SESSION_COOKIE_SECURE = True
    CSRF_COOKIE_SECURE = True

environment.require_sound()
