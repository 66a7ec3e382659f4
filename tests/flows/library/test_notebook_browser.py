"""What a scientist does in a notebook, on a PX4 log of the guide: each result is shown as a notebook
shows it, and looked at in Chromium in both colour schemes."""

from pathlib import Path
from typing import Any

import pytest

import aerodb
from tests.support.browser import look_everywhere, watched
from tests.support.shared_workspace import SharedWorkspaces

MODEL = """\
[[increment]]
axis = "CZ"
terms = ["1", "alpha", "q_hat"]
"""

#: A notebook's output cells: JupyterLab gives them its own font and the colours of its theme.
PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>notebook</title>
<meta name="viewport" content="width=device-width"><style>:root {{ color-scheme: light dark }}
body {{ font: 13px/1.4 sans-serif }}</style></head>
<body><main><h1>notebook</h1>{cells}</main></body></html>"""


@pytest.fixture(scope="module")
def results(shared: SharedWorkspaces) -> dict[str, Any]:
    """Every step's result by name, as the cells of a notebook give them."""
    log = aerodb.load(shared.guide / "flight-1.ulg", shared.guide / "my-glider.toml")
    flight = aerodb.reconstruct(log)
    measured = aerodb.total_coefficients(flight)
    database = aerodb.load_database(shared.guide / "handbook.toml")
    compared = aerodb.compare(measured, database)
    points = aerodb.evaluate(database, alpha=[0.0, 4.0], V=20.0, units={"alpha": "deg"})
    fitted = aerodb.fit([compared], MODEL)
    return {
        "log": log,
        "flight": flight,
        "measured": measured,
        "compared": compared,
        "points": points,
        "fitted": fitted,
    }


@pytest.fixture
def shown(browser: Any, results: dict[str, Any], tmp_path: Path) -> Any:
    cells = "".join(
        f"<section id='{name}'>{result._repr_html_()}</section>" for name, result in results.items()
    )
    page = tmp_path / "notebook.html"
    page.write_text(PAGE.format(cells=cells), encoding="utf-8")
    with watched(browser, page.as_uri()) as opened:
        opened.goto(page.as_uri())
        yield opened


def columns(page: Any, name: str) -> dict[str, list[str]]:
    """Heading of each column of a result's table -> its cells."""
    heads = page.locator(f"#{name} thead th").all_inner_texts()
    rows = [row.split("\t") for row in page.locator(f"#{name} tbody tr").all_inner_texts()]
    values = [[row[k] for row in rows if len(row) == len(heads)] for k in range(len(heads))]
    return dict(zip(heads, values, strict=True))


#: Cells of results that are broken within a word.
BROKEN = """() => [...document.querySelectorAll('thead th, thead + tbody td')].flatMap((cell) =>
  [...cell.textContent.matchAll(/[^\\s-]\\S*/g)].filter((word) => {
    const range = document.createRange();
    range.setStart(cell.firstChild, word.index);
    range.setEnd(cell.firstChild, word.index + word[0].length);
    return range.getClientRects().length > 1;
  }).map((word) => word[0]))"""


def test_every_result_is_readable_in_both_colour_schemes(shown: Any) -> None:
    look_everywhere(shown, "notebook")
    assert shown.viewport_size["width"] == 400
    assert shown.evaluate(BROKEN) == []


def test_every_column_says_its_unit(shown: Any) -> None:
    log = columns(shown, "log")
    units = dict(zip(log["channel"], log["unit"], strict=True))
    assert (units["V"], units["ax_imu"], units["q"]) == ("m/s", "m/s²", "rad/s")
    errors = columns(shown, "flight")
    units = dict(zip(errors["sensor error"], errors["unit"], strict=True))
    assert units["ax_bias"] == "m/s²"
    assert "SI" not in units.values()
    for name in ("measured", "compared", "points"):
        numbers = [
            head for head in columns(shown, name) if head not in ("axis", "samples", "place")
        ]
        assert numbers
        assert all(head.endswith(" [-]") for head in numbers), name
    fitted = columns(shown, "fitted")
    units = dict(zip(fitted["parameter"], fitted["unit"], strict=True))
    assert units == {"CZ_0": "-", "CZ_alpha": "1/rad", "CZ_q_hat": "-"}


def test_what_is_shown_is_what_is_computed(shown: Any, results: dict[str, Any]) -> None:
    compared = columns(shown, "compared")
    rms = dict(zip(compared["axis"], compared["rms residual [-]"], strict=True))
    expected = results["compared"].comparison.summary("CZ")["rms_residual"]
    assert float(rms["CZ"]) == pytest.approx(expected, rel=1e-3)
    fitted = columns(shown, "fitted")
    values = dict(zip(fitted["parameter"], fitted["value"], strict=True))
    found = results["fitted"]["CZ_alpha"].value
    assert float(values["CZ_alpha"]) == pytest.approx(found, rel=1e-3)


def test_a_database_and_a_vehicle_are_named_in_one_line(results: dict[str, Any]) -> None:
    """Cells that end with them do not fill the screen with their arrays."""
    for each in (results["compared"].database, results["log"].vehicle):
        assert each.name in repr(each)
        assert len(repr(each)) < 200
