"""How to install the evaluator from this site, and the wheel itself."""

from django.http import FileResponse, Http404, HttpRequest, HttpResponse, HttpResponseBase
from django.shortcuts import render
from django.views.decorators.http import require_safe

from leaderboard.web.docs import guides, wheels


@require_safe
def dist(request: HttpRequest) -> HttpResponse:
    """The line that installs the evaluator, and the digest of what it installs."""
    wheel = wheels.current()
    context = {"navigation": guides.navigation(), "wheel": wheel}
    return render(request, "docs/install.html", context, status=200 if wheel else 404)


@require_safe
def dist_file(request: HttpRequest, wheel_name: str) -> HttpResponseBase:
    """A wheel, for pip."""
    wheel = wheels.named(wheel_name)
    if wheel is None:
        raise Http404(f"There is no wheel {wheel_name!r}.")
    return FileResponse(
        wheel.path.open("rb"), as_attachment=True, filename=wheel.name, content_type="application/zip"
    )
