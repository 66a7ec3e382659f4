"""Figures show their inputs, colour-blind readers can tell their colours apart, and boxes of a
lineage graph do not overlap."""

import base64
import re
from contextlib import nullcontext
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from aerodb.conditioning.segmentation import Segment
from aerodb.flight import Flight
from aerodb.nomenclature import AXES
from aerodb.report.diff_figures import diff_figure
from aerodb.report.flight_figures import (
    channel_figure,
    coefficient_figure,
    segment_figure,
    shown_channels,
)
from aerodb.report.labels import in_figure, visible
from aerodb.report.lineage_figure import HEIGHT, WIDTH, Relative, lineage_graph
from aerodb.report.style import (
    DATABASE,
    FLIGHT,
    MEASURED,
    PAGE_WIDTH,
    PHONE_WIDTH,
    UPDATED,
    Picture,
)
from aerodb.report.update_figures import (
    error_figure,
    forest_figure,
    moving_variables,
    residual_figure,
)
from aerodb.tables.analysis.slices import MOST_SLICES
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment, Interval
from tests.support import synthetic

# Machado, Oliveira & Fernandes, IEEE Trans. Visualization and Computer Graphics 15(6), 2009, table
# 1, severity 1.0.
BLIND = {
    "protan": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deutan": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritan": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
HOSTILE = (
    "<script>alert(1)</script>",
    r"$\frac{1}{$",
    "‮gpj.live",
    "\x1b[2J",
    "名前",
    "x" * 5000,
    "\ud800",
)


def lab(rgb: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of linear sRGB, D65 (CIE 15:2004)."""
    xyz = (
        np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
        @ rgb
    )
    x, y, z = np.cbrt(np.clip(xyz, 0, None) / [0.9505, 1.0, 1.089])
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("kind", ["all", *BLIND])
def test_colours_are_told_apart(kind: str) -> None:
    """A difference of 20 in CIE 1976 is plain to see for lines; that of a just noticeable one is
    about 2.3."""
    matrix = np.array(BLIND[kind]) if kind in BLIND else np.eye(3)
    linear = [
        np.where(c > 0.04045, ((c + 0.055) / 1.055) ** 2.4, c / 12.92)
        for c in map(np.array, map(to_rgb, COLOURS))
    ]
    shown = [lab(np.clip(matrix @ colour, 0, 1)) for colour in linear]
    assert min(float(np.linalg.norm(a - b)) for a, b in combinations(shown, 2)) > 20.0


COLOURS = (FLIGHT, DATABASE, UPDATED, MEASURED)


@pytest.fixture(scope="module")
def flown() -> Flight:
    return synthetic.flight(np.random.default_rng(1), seconds=60.0)


def test_every_axis_of_a_figure_has_its_unit(flown: Flight) -> None:
    names = shown_channels(flown)
    figure = channel_figure(names, flown, flown)
    titles = [panel.get_title(loc="left") for panel in figure.axes if panel.get_title(loc="left")]
    assert titles == [
        {"V": "V [m/s]"}.get(n, f"{n} [deg/s]" if n in "pqr" else f"{n} [deg]") for n in names
    ]
    comparison = synthetic.comparison(
        flown, {"CZ": np.zeros(len(flown.time)), "Cl": np.zeros(len(flown.time))}
    )
    labels = {panel.get_xlabel() for panel in coefficient_figure(comparison, flown).axes} - {""}
    assert labels == {"time [s]", "alpha [deg]", "beta [deg]"}


def test_the_figures_of_a_flight_have_one_time_axis(flown: Flight) -> None:
    """From its first to its last sample, also where the usable samples end earlier."""
    whole = (flown.time[0], flown.time[-1])
    late = flown.with_flag("alpha", "gap", flown.time > 40.0)
    comparison = synthetic.comparison(late, {"CZ": np.zeros(len(late.time))})
    comparison.usable["CZ"][late.time > 40.0] = False
    segments = [Segment("pull_up", 10.0, 12.0, "load factor")]
    panels = [
        *channel_figure(shown_channels(late), late, late).axes,
        *coefficient_figure(comparison, late).axes[:2],
        *segment_figure(segments, late).axes,
    ]
    shown = [panel.get_xlim() for panel in panels if panel.axison]
    assert len(shown) > 5
    assert shown == [pytest.approx(whole)] * len(shown)


def test_a_correction_is_drawn_and_its_size_said(flown: Flight) -> None:
    moved = flown.with_channels({"alpha": flown["alpha"] + np.deg2rad(0.5)})
    panel = channel_figure(["alpha"], flown, moved).axes[0]
    measured, reconstructed = (line.get_ydata() for line in panel.lines)
    assert np.allclose(np.mean(reconstructed) - np.mean(measured), 0.5, atol=0.2)
    assert panel.get_title(loc="right") == "corrected by 0.5 deg rms"
    assert len(channel_figure(["alpha"], flown, flown).axes[0].lines) == 1, (
        "what did not move is drawn once"
    )


def test_flagged_samples_are_shaded(flown: Flight) -> None:
    where = (flown.time > 10) & (flown.time < 12)
    panel = channel_figure(["alpha"], flown, flown.with_flag("alpha", "gap", where)).axes[0]
    (span,) = panel.patches
    assert span.get_x() == pytest.approx(flown.time[where][0])
    assert span.get_width() == pytest.approx(2.0, abs=3 * flown.step)


def finding(**other: Any) -> dict[str, Any]:
    votes = [{"flight": f"f{k}", "value": 0.01 * k, "se": 0.005} for k in range(3)]
    known = {
        "parameter": "alpha_bias",
        "unit": "rad",
        "value": 0.01,
        "ci95": [0.005, 0.015],
        "votes": votes,
    }
    return {**known, **other}


def test_a_forest_plot_shows_votes_and_what_they_say_together() -> None:
    panel = forest_figure(finding(), {"f0": "first"}).axes[0]
    shown = sorted(float(container[0].get_xdata()[0]) for container in panel.containers)
    assert shown == pytest.approx(np.rad2deg([0.0, 0.01, 0.02]))
    assert [text.get_text() for text in panel.get_yticklabels()] == [
        "first",
        "f1",
        "f2",
        "combined",
    ]
    diamond = panel.patches[0].get_xy()[:, 0]
    assert (diamond.min(), diamond.max()) == pytest.approx(tuple(np.rad2deg([0.005, 0.015])))
    assert panel.get_xlabel() == "alpha_bias [deg]"
    assert panel.get_xlim()[0] < 0 < panel.get_xlim()[1], "zero is always in view"


def test_residuals_over_a_variable_show_the_planted_slope(flown: Flight) -> None:
    """A residual of -0.5 alpha before, and noise after."""
    rng = np.random.default_rng(2)
    before = synthetic.comparison(flown, {"CZ": -0.5 * flown["alpha"]})
    after = synthetic.comparison(flown, {"CZ": 1e-3 * rng.standard_normal(len(flown.time))})
    channels = {"f": dict(flown.channels)}
    panel = residual_figure(
        ["CZ"], ["alpha"], {"f": before}, {"f": after}, channels, {"CZ": 2e-4}
    ).axes[0]
    assert (panel.patches[0].get_y(), panel.patches[0].get_height()) == (-2e-4, 4e-4), (
        "the noise floor to both sides"
    )
    first, second = panel.lines[:2]
    slope = np.polyfit(np.deg2rad(first.get_xdata()), first.get_ydata(), 1)[0]
    assert slope == pytest.approx(-0.5, rel=0.01)
    assert np.abs(second.get_ydata()).max() < 5e-4
    brief = synthetic.flight(rng, seconds=4.0)
    steep = synthetic.comparison(brief, {"CZ": 2.0 * brief["alpha"]})
    drawn = (
        residual_figure(["CZ"], ["alpha"], {"f": steep}, {}, {"f": dict(brief.channels)}, {})
        .axes[0]
        .lines[0]
    )
    assert len(drawn.get_xdata()) == 6, "a hundred samples make six points"
    assert np.allclose(drawn.get_ydata(), 2.0 * np.deg2rad(drawn.get_xdata()))
    few = {"f": {"alpha": flown["alpha"][:5]}}
    short = synthetic.comparison(synthetic.flight(rng, seconds=0.2), {"CZ": np.zeros(5)})
    too_few = residual_figure(["CZ"], ["alpha"], {"f": short}, {"f": short}, few, {})
    assert not any(panel.lines for panel in too_few.axes)


def test_residuals_are_drawn_over_what_they_depend_on_most(flown: Flight) -> None:
    """Of four variables, the three on which this residual depends, before or after."""
    rng = np.random.default_rng(3)
    n = len(flown.time)
    channels = {"f": {name: rng.standard_normal(n) for name in ("alpha", "beta", "p", "q")}}
    x = channels["f"]
    before = synthetic.comparison(flown, {"CZ": 3.0 * x["p"] ** 2 + x["beta"]})
    after = synthetic.comparison(flown, {"CZ": 2.0 * x["q"]})
    figure = residual_figure(["CZ"], [*x], {"f": before}, {"f": after}, channels, {})
    labels = [panel.get_xlabel().split()[0] for panel in figure.axes if panel.get_visible()]
    assert labels == ["p", "q", "beta"]


def test_only_variables_that_move_are_drawn(flown: Flight) -> None:
    still = np.full(len(flown.time), 0.3)
    channels = {
        "f": {"alpha": flown["alpha"], "delta_flap": still, "beta": np.full(len(still), np.nan)}
    }
    assert moving_variables(channels, ["beta", "alpha", "delta_flap", "delta_none"]) == ["alpha"]


def test_errors_are_drawn_where_they_are_known() -> None:
    rows = [
        {"axis": "CX", "before": 0.02, "after": 0.01, "floor": 0.005},
        {"axis": "CZ", "before": None, "after": None, "floor": 0.0},
    ]
    panel = error_figure(rows).axes[0]
    marked = {
        line.get_label(): line.get_xdata()[0]
        for line in panel.lines
        if not line.get_label().startswith("_")
    }
    assert marked == {"noise floor": 0.005, "database": 0.02, "updated database": 0.01}
    assert [text.get_text() for text in panel.get_yticklabels()] == ["CX", "CZ"]
    assert error_figure([]).axes


def test_slices_show_every_axis_that_changes_and_look_closely() -> None:
    """Six increments: each axis has panels, none wider than its change; the distribution of the
    flights stands below."""
    before = synthetic.database()
    envelope = {
        "alpha": Interval(0.0, 0.1, 0.02),
        "beta": Interval(-0.05, 0.05, 0.02),
        "p_hat": Interval(-0.01, 0.01, 0.01),
    }
    regressors = (parse("alpha"), parse("beta"), parse("p_hat"))
    added = [
        Increment(axis, regressors, np.array([0.5, 0.3, 0.2]), 1e-4 * np.eye(3), envelope, ("f",))
        for axis in AXES
    ]
    after = replace(before, increments=tuple(added))
    figure = diff_figure(
        before, after, ("v0001", "v0002"), "", {"alpha": np.linspace(0.0, 0.1, 500)}
    )
    shown = [panel for panel in figure.axes if panel.get_xlabel()]
    assert {panel.get_ylabel() for panel in shown} == {f"{axis} [-]" for axis in AXES}
    assert len(shown) <= MOST_SLICES
    alpha = next(panel for panel in shown if panel.get_xlabel() == "alpha [deg]")
    said = re.fullmatch(
        r"largest change: \+([\d.]+) ± ([\d.e−]+) at ([\d.]+) deg", alpha.get_title(loc="right")
    )
    drawn = alpha.lines[1].get_ydata() - alpha.lines[0].get_ydata()
    assert said
    assert float(said[1]) == pytest.approx(np.max(np.abs(drawn)), rel=0.05)
    assert float(said[3]) == pytest.approx(
        alpha.lines[0].get_xdata()[np.argmax(np.abs(drawn))], rel=0.01
    )
    low, high = np.deg2rad(alpha.get_xlim())
    assert -0.12 < low < -0.04
    assert 0.14 < high < 0.22
    bars = [
        patch
        for patch in alpha.patches
        if isinstance(patch, Rectangle) and 0 < patch.get_height() <= 0.15
    ]
    assert np.deg2rad(bars[0].get_x()) < 0.1
    for width in (PAGE_WIDTH, PHONE_WIDTH):
        titled = diff_figure(before, after, ("v0001", "v0002"), "both versions", width=width)
        titled.canvas.draw()
        above = titled.bbox.y1 - titled._suptitle.get_window_extent().y1
        assert 0.0 < above / titled.dpi < 0.3, "the title stands above what stands above a panel"


def test_a_share_is_sliced_from_none_to_all() -> None:
    before = synthetic.database()
    envelope = {"flow_attachment": Interval(0.0, 1.0, 0.5)}
    terms = (parse("1 - flow_attachment"),)
    added = Increment("CZ", terms, np.array([0.3]), 1e-4 * np.eye(1), envelope, ("f",))
    figure = diff_figure(before, replace(before, increments=(added,)), ("v0001", "v0002"), "")
    (panel,) = [each for each in figure.axes if each.get_xlabel() == "flow_attachment [-]"]
    at = panel.lines[0].get_xdata()
    assert (at[0], at[-1]) == (0.0, 1.0)


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_a_hostile_name_is_text_in_a_figure(text: str) -> None:
    figure = forest_figure(finding(), {"f0": text})
    shown = Picture(lambda: figure, "votes").svg
    tree = etree.fromstring(shown.encode())
    texts = [element.text for element in tree.iter("{*}text")]
    assert in_figure(text).replace(r"\$", "$") in texts
    assert not list(tree.iter("{*}script"))
    assert all(len(entry) < 60 for entry in texts if entry)
    assert "\u202e" not in shown
    assert visible(text).isprintable() or text == "名前"


def test_a_layout_without_the_first_drawing_gives_the_same_bytes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    once = Picture(lambda: forest_figure(finding(), {}), "votes").svg
    monkeypatch.setattr("aerodb.report.style._drawn_once", lambda _figure: nullcontext())
    assert Picture(lambda: forest_figure(finding(), {}), "votes").svg == once


def test_the_same_figure_gives_the_same_bytes() -> None:
    one, other = (Picture(lambda: forest_figure(finding(), {}), "votes") for _ in range(2))
    assert one.svg == other.svg
    assert base64.b64decode(one.source.partition(",")[2]).decode() == one.svg
    assert "http" not in one.svg.replace("http://www.w3.org/", ""), "names of XML name spaces only"


def test_a_long_record_stays_light() -> None:
    """Half an hour at 100 Hz in nine panels: under a megabyte."""
    n = 180_000
    rng = np.random.default_rng(3)
    names = ("V", "alpha", "beta", "p", "q", "r", "phi", "theta", "psi")
    long = Flight("f", "v", np.arange(n) / 100.0, {name: rng.standard_normal(n) for name in names})
    figure = channel_figure(names, long, long)
    assert isinstance(figure, Figure)
    assert len(Picture(lambda: figure, "channels").source) < 1e6


def relative(k: int, parent: int | None) -> Relative:
    return Relative(str(k), f"v{k:04d}", None if parent is None else str(parent), "", (), {})


@given(st.lists(st.integers(0, 1000), max_size=30))
def test_a_graph_of_versions_does_not_overlap(draws: list[int]) -> None:
    parents = [None, *(draw % (k + 1) for k, draw in enumerate(draws))]
    graph = lineage_graph([relative(k, parent) for k, parent in enumerate(parents)], "0")
    for a, b in combinations(graph.boxes, 2):
        assert abs(a.x - b.x) > WIDTH or abs(a.y - b.y) > HEIGHT
    at = {box.relative.id: box for box in graph.boxes}
    assert all(
        at[box.relative.parent].x < box.x for box in graph.boxes if box.relative.parent is not None
    )
    assert len(graph.lines) == len(draws)
    assert all(
        box.x + WIDTH <= graph.width and box.y + HEIGHT <= graph.height for box in graph.boxes
    )
    assert [box.relative.id for box in graph.boxes if box.current] == ["0"]
