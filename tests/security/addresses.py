"""Addresses to look at: every route, at things that are there and things that are not, asked in every way."""

from collections.abc import Iterator
from itertools import product
from typing import Any
from urllib.parse import urlencode

from leaderboard.boards.listing import SORTABLE
from tests.security.people import ABSENT
from tests.security.routes import Route, operations, routes
from tests.security.worlds import HIDDEN_METHODS, HIDDEN_SUBMISSIONS, HIDDEN_TEAM, Scene

FORMATS = ("csv", "json", "latex", "markdown", "md", "bibtex", "atom", "svg", "tex", "nonsense")
FORMS = ("csv", "json", "tex", "md", "bib", "nonsense")
TIMES = ("2026-03-01", "2026-03-03", "2026-03-05T12:00:00Z", "2026-03-11", "2099-01-01", "nonsense", "")
PAGES = ("1", "2", "0", "-1", "999999", "last", "x")
TEXTS = ("secret", "Secret Agency", "Owls", "Anonymous", "Very Secret Net", "%", "'", "")
# By the names of the filters: what each takes, what is there, what is hidden, and what it refuses.
FILTERS: dict[str, tuple[str, ...]] = {
    "frames": ("2", "6", "7"),
    "cameras": ("one", "several", "x"),
    "boxes": ("given", "detected", "none", "x"),
    **dict.fromkeys(("nerf", "extra", "code", "paper"), ("yes", "no", "maybe")),
    "pretraining": ("imagenet", "corpus", "Larks", "Hidden", "none", "x" * 81),
    "parameters": ("25M", "400k", "31000000", "0.5b", "many"),
    "latency": ("12.5", "1000", "nan"),
    "hardware": ("gpu", "Larks", "Hidden", "Secret", "x" * 81),
    "q": (*TEXTS, "x" * 81),
}
# What boards may be asked, on pages and in the API: name and values.
QUERIES: dict[str, tuple[str, ...]] = {
    "sort": (*(f"{sign}{name}" for name in SORTABLE for sign in ("", "-")), "nonsense"),
    "at": TIMES,
    "columns": ("mid", "rte", "both", "nonsense"),
    "page": PAGES,
    "intervals": ("1", "0", "nonsense"),
    "mine": ("1", "0"),
    "as": ("ANONYMOUS", "PUBLIC"),
    **FILTERS,
    "format": FORMATS,
    "team": TEXTS,
}
# Several things at once, as the links and forms of the pages ask for them.
TOGETHER = tuple(
    urlencode(asked)
    for asked in (
        {"sort": "-rte", "columns": "rte", "hardware": "gpu", "page": "1"},
        {"sort": "mid_crucial", "columns": "mid", "nerf": "no", "frames": "6"},
        {"at": "2026-03-05T12:00:00Z", "hardware": "Larks", "intervals": "1"},
        {"at": "2026-03-11", "columns": "rte", "sort": "-team", "pretraining": "corpus"},
        {"q": "anonymous", "code": "no", "paper": "no", "page": "2"},
        {"parameters": "50M", "latency": "1000", "intervals": "1", "sort": "date"},
        {"cameras": "one", "boxes": "given", "extra": "no", "q": "secret"},
    )
)


# They say how this machine is, which changes by the second, and nothing of what is entered.
OF_THE_MACHINE = {"readyz", "healthy", "metrics"}


def addresses(scene: Scene) -> list[str]:
    """Every address, without those of maintainers and of accounts beyond one each."""
    paths: dict[str, None] = {}
    described = {path: methods.get("GET", {}) for path, methods in operations().items()}
    for route in routes():
        if route.name in OF_THE_MACHINE:
            continue
        for path in _filled(route, scene):
            paths[path] = None
            if route.is_admin or path.startswith(("/maintain/", "/accounts/")):
                break
            for query in _queries(route, scene, described):
                paths[f"{path}?{query}"] = None
    return list(paths)


def _filled(route: Route, scene: Scene) -> Iterator[str]:
    """The route with everything that its parameters may stand for."""
    choices: dict[str, tuple[object, ...]] = {
        "split": ("test", "val", "nowhere"),
        "number": (1, 2),
        "method_id": (*scene.methods, *HIDDEN_METHODS, ABSENT),
        "submission_id": (*scene.submissions, *HIDDEN_SUBMISSIONS, ABSENT),
        "team_id": (*scene.teams, HIDDEN_TEAM, ABSENT),
        "key": ("nonsense",),
        "uidb36": ("1",),
        "slug": ("none",),
        "format": FORMATS,
        "secret": ("nonsense",),
        "handle": (ABSENT,),
        "invitation_id": (ABSENT,),
        "chosen": ("csv", "tex", "md", "bib"),
        "id": (1,),
        "object_id": ("1",),
        "content_type_id": ("1",),
        "guide_name": ("researchers", "api-guide", "adr/0001-the-evaluator-is-arithmetic", "nowhere"),
        "name": ("main-results", "nowhere"),
        "table_name": ("main-results", "nowhere"),
        "action_name": ("rename-team", "nowhere"),
        "suffix": ("csv", "tex", "md", "bib"),
        "operation_id": ("submit", "board", "nothing"),
        "page_name": ("rules", "contact", "privacy", "imprint", "licence"),
        "wheel_name": ("tsttc-0-py3-none-any.whl",),
        "app_label": ("leaderboard",),
        "url": ("nowhere",),
        "subject_id": (scene.teams[0],),
    }
    names = sorted(route.parameters)
    for values in product(*(choices[name] for name in names)):
        yield route.filled(dict(zip(names, values, strict=True)))


def _queries(route: Route, scene: Scene, described: dict[str, dict[str, Any]]) -> Iterator[str]:
    """What may stand behind the question mark."""
    if route.parameters & {"submission_id", "team_id"}:
        return
    if route.name in {"compare", "api-comparison", "api-compare"}:
        ids = [*scene.methods[:3], scene.methods[-1], *HIDDEN_METHODS[:2], ABSENT]
        for first, second in product(ids, ids):
            yield urlencode([("split", "test"), ("m", first), ("m", second)])
        return
    asked = dict(QUERIES)
    if route.is_api:
        operation = described.get(route.described_as, {})
        asked = {
            parameter["name"]: QUERIES.get(parameter["name"], ("1", "x", ""))
            for parameter in operation.get("parameters", [])
            if parameter["in"] == "query"
        }
    elif route.name not in BOARDS:
        asked = {name: asked[name][:2] for name in ("page", "format", "q")}
    for name, values in asked.items():
        for value in values:
            yield urlencode({name: value})
    if "sort" in asked:
        yield from TOGETHER


# Pages that have a board in them, and take its questions.
BOARDS = {"board", "edition", "charts", "export", "edition_export"}
