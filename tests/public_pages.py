"""Every public page that is answered from what is kept, now and as of a time."""

from django.utils import timezone

from leaderboard.models import Method

API = "/api/v1/splits/test/board"
PAGE = "/board/test/"
PUBLIC = (
    *("/", PAGE, "/board/test/?sort=-rte&columns=rte", "/board/test/?q=scale", "/board/test/?page=2"),
    *(
        "/board/test/editions/",
        "/board/test/editions/1/",
        "/methods/{method}/",
        "/compare/?m={method}&m={other}",
    ),
    *(API, f"{API}?sort=mid", f"{API}?nerf=no", "/api/v1/splits", "/api/v1/splits/test/editions"),
    *("/api/v1/splits/test/editions/1/board", "/api/v1/splits/test/changelog"),
    *(
        "/board/test/charts/",
        "/board/test/charts/progress.json",
        "/board/test.csv",
        "/board/test.tex?intervals=1",
        "/board/test.md?sort=rte",
    ),
    *("/board/test.bib", "/board/test/editions/1.csv", "/sitemap.xml", "/feed.atom", "/board/test/feed.atom"),
    *("/methods/{method}/badge.svg", "/methods/{method}/badge.svg?split=val", "/api/v1/methods/{method}"),
)
OF_THE_PAST = (
    *(
        "/board/test/?at={at}",
        "/board/test/?at={at}&sort=-rte&page=2",
        "/board/test/?at=2020-01-01",
    ),
    *(f"{API}?at={{at}}", f"{API}?at={{at}}&sort=mid&nerf=no", f"{API}?at=2020-01-01"),
    *("/board/test.csv?at={at}", "/board/test.tex?at={at}&intervals=1", "/board/test.md?at={at}&sort=rte"),
    "/board/test.bib?at={at}",
)


def addresses_of(methods: list[Method]) -> list[str]:
    """Every public page, also as of this moment."""
    known = {"method": methods[0].pk, "other": methods[1].pk, "at": f"{timezone.now():%Y-%m-%dT%H:%M:%S.%fZ}"}
    return [address.format(**known) for address in (*PUBLIC, *OF_THE_PAST)]
