"""Parts of pages that are written from data, each between two marks with its name."""

from __future__ import annotations

from pathlib import Path


def with_part(text: str, name: str, content: str, page: Path) -> str:
    """The text with what stands between `<!-- name: begin -->` and `<!-- name: end -->` replaced.

    Args:
        text: of the page.
        name: of the part.
        content: whole lines.
        page: for the message.

    Raises:
        SystemExit: the page has no such part.
    """
    begin, end = f"<!-- {name}: begin -->\n", f"<!-- {name}: end -->"
    before, _, rest = text.partition(begin)
    _, found, after = rest.partition(end)
    if not found:
        raise SystemExit(f"{page.name}: no part {name}")
    return f"{before}{begin}{content}{end}{after}"
