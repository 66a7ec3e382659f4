"""Render templates to self-contained HTML pages, and pages to PDF.

A page loads nothing from elsewhere. The template engine escapes all text; names from logs cannot
change the direction or layout of the text around them.
"""

import functools
import math
from collections.abc import Callable, Iterator
from datetime import datetime
from typing import Any, Final

import jinja2
from markupsafe import Markup

from aerodb.errors import InputError
from aerodb.report.error_table import excluded_sizes
from aerodb.report.glossary import (
    advice_words,
    capital,
    channel_words,
    hypothesis_words,
    in_words,
    parameter_name,
    rejected,
    with_true_signs,
)
from aerodb.report.head import Head
from aerodb.report.labels import visible
from aerodb.report.numbers import number
from aerodb.report.style import DATABASE, FLIGHT, MEASURED, UPDATED
from aerodb.report.terms import term_name, term_unit
from aerodb.support import counted, half_interval
from aerodb.units import shown_units

#: Colours of curves on pages, by what they show.
COLOURS: Final = {"flight": FLIGHT, "database": DATABASE, "updated": UPDATED, "measured": MEASURED}


def render(template: str, head: Head | None = None, **context: Any) -> str:
    """Render `template`, a file in this package's templates, to one self-contained HTML page;
    raises UndefinedError of Jinja for a variable that the context lacks."""
    return "".join(pieces(template, head, **context))


def pieces(template: str, head: Head | None = None, **context: Any) -> Iterator[str]:
    """Return the pieces of the page that `render` makes, in order, each when it is asked for: what
    stands before a figure of a lazy context is there before the figure is drawn."""
    return _engine().get_template(template).generate(head=head, **context)


def _filters() -> dict[str, Callable[..., Any]]:
    """What templates apply to values: names, numbers, words, units (`term_unit`)."""
    return {
        "name": name,
        "number": number,
        "half_interval": half_interval,
        "quantity": quantity,
        "counted": counted,
        "share": share,
        "words": words,
        "scaled": scaled,
        "instant": instant,
        "visible": visible,
        "sentence": sentence,
        "in_words": in_words,
        "rejected": rejected,
        "with_true_signs": with_true_signs,
        "advice_words": advice_words,
        "channel_words": channel_words,
        "hypothesis_words": hypothesis_words,
        "capital": capital,
        "full_stop": full_stop,
        "excluded_sizes": excluded_sizes,
        "term_unit": term_unit,
        "term_name": term_name,
        "parameter_name": parameter_name,
    }


@functools.cache
def _engine() -> jinja2.Environment:
    return engine_of("aerodb.report")


def engine_of(*packages: str) -> jinja2.Environment:
    """Return the engine of the templates of packages, the first that has one, with the words and
    colours of all pages."""
    engine = jinja2.Environment(
        loader=jinja2.ChoiceLoader([jinja2.PackageLoader(package) for package in packages]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        bytecode_cache=jinja2.FileSystemBytecodeCache(),  # in a folder of this user alone
    )
    engine.filters |= _filters()
    engine.globals.update(colours=COLOURS, shown_units=shown_units)
    return engine


def name(text: object) -> Markup:
    """A user-chosen name: escaped, and isolated from the text direction around it.

    >>> name("<b>")
    Markup('<bdi>&lt;b&gt;</bdi>')
    """
    return Markup("<bdi>{}</bdi>").format(visible(str(text)))


def sentence(text: object) -> Markup:
    """A message that may contain names, on one line: as `name`, line breaks as semicolons.

    >>> sentence("flight f: no alpha\\nlog it")
    Markup('<bdi>flight f: no alpha; log it</bdi>')
    """
    return name(str(text).replace("\n", "; "))


def share(value: float | None) -> str:
    """Format a dimensionless share (a scalar, 1 for all) as a percentage; a dash for none."""
    return (
        "–"
        if value is None or not math.isfinite(value)
        else f"{100 * value:.0f} %".replace("-", "−")
    )


def scaled(value: float | None, factor: float) -> float | None:
    """Return a scalar in another unit, as `for_people` gives the factor; None remains None."""
    return None if value is None else factor * value


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """Return a value of an SI unit in the units that are shown (`shown_units`), with its unit."""
    return shown_units().shown(value, unit, digits)


def words(text: str) -> str:
    """An identifier as words: ``not_excited`` becomes ``not excited``."""
    return text.replace("_", " ")


def full_stop(text: str) -> str:
    """A sentence with its full stop.

    >>> full_stop("so"), full_stop("so.")
    ('so.', 'so.')
    """
    return text if text.endswith((".", "!", "?")) else f"{text}."


def instant(when: datetime | None) -> str:
    """Format a time in UTC."""
    return "time unknown" if when is None else f"{when:%Y-%m-%d %H:%M} UTC"


def pdf(page: str) -> bytes:
    """Convert a page to PDF. Raises InputError where the optional dependency is not installed.

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
    content: bytes = HTML(
        string=page, url_fetcher=URLFetcher(allowed_protocols=["data"])
    ).write_pdf()
    return content
