"""HTML from plain values: what is not markup already is escaped, so no text of a file or a person can become any."""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import escape
from typing import TypeAlias

__all__ = ["Child", "Html", "joined", "table", "tag", "text"]

FORBIDDEN = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""what no document may hold"""


class Html(str):
    """Text that is markup."""

    __slots__ = ()


Child: TypeAlias = "str | Html | Iterable[Child] | None"


def text(words: object) -> Html:
    """Any value as text.

    >>> text("<b>")
    '&lt;b&gt;'
    """
    if isinstance(words, Html):
        return words
    return Html(escape(FORBIDDEN.sub("\N{REPLACEMENT CHARACTER}", str(words)), quote=True))


def joined(*children: Child) -> Html:
    """Children one after the other; None is nothing."""
    return Html("".join(_parts(children)))


def _parts(children: Iterable[Child]) -> Iterable[str]:
    for child in children:
        if isinstance(child, str):
            yield text(child)
        elif child is not None:
            yield from _parts(child)


def tag(name: str, *children: Child, **attributes: object) -> Html:
    """An element; a trailing underscore of an attribute's name is dropped, others become hyphens.

    >>> tag("td", "<3", class_="number")
    '<td class="number">&lt;3</td>'
    """
    told = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{text(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    return Html(f"<{name}{told}>{joined(*children)}</{name}>")


def table(caption: str, head: Iterable[str], rows: Iterable[Iterable[Child]], class_: str = "") -> Html:
    """A table with a caption; the first cell of a row is its head."""
    top = tag("tr", [tag("th", word, scope="col") for word in head])
    body = [tag("tr", tag("th", first, scope="row"), [tag("td", cell) for cell in rest]) for first, *rest in rows]
    inside = tag("table", tag("caption", caption), tag("thead", top), tag("tbody", body), class_=class_ or None)
    return tag("div", inside, class_="wide", tabindex="0", role="region", aria_label=caption)
