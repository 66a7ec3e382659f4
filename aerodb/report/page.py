"""Pages: a result's context through its template into one HTML file that asks nothing of anybody,
and that file as PDF.

All text is escaped by the template engine; names from logs are shown as text that cannot rearrange
what stands beside it.
"""

import functools
import math
from datetime import datetime
from typing import Any, Final

import jinja2
from markupsafe import Markup

from aerodb.errors import InputError
from aerodb.report.style import DATABASE, FLIGHT, MEASURED, UPDATED, visible

_RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_COLOURS: Final = {"flight": FLIGHT, "database": DATABASE, "updated": UPDATED, "measured": MEASURED}


def render(template: str, **context: Any) -> str:
    """One self-contained HTML page of `template` (a file of this package's templates)."""
    return _engine().get_template(template).render(**context)


@functools.cache
def _engine() -> jinja2.Environment:
    engine = jinja2.Environment(
        loader=jinja2.PackageLoader("aerodb.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    engine.filters |= {
        "name": name,
        "number": number,
        "share": share,
        "words": words,
        "instant": instant,
        "visible": visible,
        "sentence": sentence,
    }
    engine.globals["colours"] = _COLOURS
    return engine


def name(text: object) -> Markup:
    """A name that somebody else chose: escaped, and set apart from the direction of the text around
    it.

    >>> name("<b>")
    Markup('<bdi>&lt;b&gt;</bdi>')
    """
    return Markup("<bdi>{}</bdi>").format(visible(str(text)))


def sentence(text: object) -> Markup:
    """What the product says, names within: the same, with the lines of a message as parts of a
    sentence.

    >>> sentence("flight f: no alpha\\nlog it")
    Markup('<bdi>flight f: no alpha; log it</bdi>')
    """
    return name(str(text).replace("\n", "; "))


def number(value: float | None, digits: int = 3, zeros: bool = False) -> str:
    """A number for people, with a true minus and powers of ten as such; a dash for none. zeros:
    also those at the end.

    >>> number(-0.00123456), number(None), number(1234.5), number(0.5, zeros=True), number(2.04e-5)
    ('−0.00123', '–', '1234', '0.500', '2.04×10⁻⁵')
    """
    if value is None or not math.isfinite(value):
        return "–"
    size = abs(value)
    if 10 ** (digits - 1) <= size < 1e6:
        return f"{value:.0f}".replace("-", "−")
    shown, _, power = f"{value:{'#' if zeros else ''}.{digits}g}".replace("-", "−").partition("e")
    return f"{shown}×10{str(int(power.replace('−', '-'))).translate(_RAISED)}" if power else shown


def share(value: float | None) -> str:
    """A share as a percentage; a dash for none."""
    return (
        "–"
        if value is None or not math.isfinite(value)
        else f"{100 * value:.0f} %".replace("-", "−")
    )


def words(text: str) -> str:
    """A name of the contract as words: ``not_excited`` reads ``not excited``."""
    return text.replace("_", " ")


def instant(when: datetime | None) -> str:
    """A time in UTC for people."""
    return "time unknown" if when is None else f"{when:%Y-%m-%d %H:%M} UTC"


def pdf(page: str) -> bytes:
    """A page as PDF. InputError where the optional dependency for it is not installed.

    WeasyPrint, not a browser: it is a library of a few megabytes that lays out the page's print
    style, needs no sandbox, and is told to fetch nothing.
    """
    try:
        from weasyprint import HTML
        from weasyprint.urls import URLFetcher
    except (ImportError, OSError) as error:  # OSError: its system libraries are missing
        remedy = (
            "install the extra: pip install 'aerodb[pdf]' (and Pango); or print the HTML page from"
            " a browser"
        )
        raise InputError("PDF needs WeasyPrint", "--pdf", remedy) from error
    made: bytes = HTML(string=page, url_fetcher=URLFetcher(allowed_protocols=["data"])).write_pdf()
    return made
