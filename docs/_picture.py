"""Let the figures of `tsttc baseline show` follow the colours of the page: `python -m docs._picture`."""

from dataclasses import astuple
from pathlib import Path

from tsttc_baselines.drawing import THEMES

FIGURES = Path(__file__).resolve().parent / "figures"


def with_both_schemes(drawn: str) -> str:
    """Let a figure in the light colours follow the reader's scheme."""
    light, dark = (astuple(THEMES[name]) for name in ("light", "dark"))
    rules = "".join(
        f'[fill="{old}"]{{fill:{new}}}[stroke="{old}"]{{stroke:{new}}}'
        for old, new in zip(light, dark, strict=True)
    )
    style = f"<style>@media (prefers-color-scheme:dark){{{rules}}}</style>"
    return drawn if style in drawn else drawn.replace("</title>", f"</title>\n{style}", 1)


if __name__ == "__main__":
    for path in FIGURES.glob("*.svg"):
        path.write_text(with_both_schemes(path.read_text(encoding="utf-8")), encoding="utf-8")
