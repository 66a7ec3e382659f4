"""Where data end: in words, in figures, and where nothing fades."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.report.diff_documents import diff_document, edits_of
from aerodb.report.diff_figures import diff_figure
from aerodb.report.reach import beyond_data, beyond_words, reach_of
from aerodb.report.terms import increment_terms
from aerodb.tables import Increment, Interval, diff, parse
from tests.support import synthetic

DEG = np.pi / 180.0


def increment(
    axis: str = "CZ", high: float = 17.0, margins: dict[str, float] | None = None
) -> Increment:
    """A slope with alpha, flown from -2 deg to `high` deg, over tables with cells of 2 deg."""
    envelope = {"alpha": Interval(-2.0 * DEG, high * DEG, 2.0 * DEG)}
    gram = 1e-4 * np.eye(1)
    return Increment(
        axis, (parse("alpha"),), np.array([-0.2]), gram, envelope, ("f",), margins=margins
    )


def test_a_fade_is_told_with_where_data_end() -> None:
    """The weight itself says where: one inside, and nothing at the last place told."""
    added = increment()
    (sentence,) = beyond_words([added])
    assert sentence == (
        "CZ: beyond the flown range (alpha < -2 or > 17 deg) the change fades to nothing at -6 and"
        " 21 deg."
    )
    reach = reach_of([added], "alpha")
    assert reach is not None
    assert reach.gone is not None
    at = {"alpha": DEG * np.array([reach.low, reach.high, reach.gone[0], reach.gone[1]])}
    assert added.weight(at) == pytest.approx([1.0, 1.0, 0.0, 0.0], abs=1e-9)
    assert added.weight({"alpha": DEG * np.array([reach.gone[1] - 0.1])})[0] > 0.0


def test_axes_that_share_a_reach_share_its_sentence() -> None:
    shared = beyond_words([increment("CX"), increment("CZ"), increment("Cm", 12.0)])
    assert [sentence.partition(":")[0] for sentence in shared] == ["CX and CZ", "Cm"]
    assert "> 12 deg" in shared[1]


def test_what_is_held_does_not_fade() -> None:
    (sentence,) = beyond_words([increment(margins={"alpha": 0.0})])
    assert sentence.endswith("the change is held at its value there.")


def test_without_increments_nothing_is_said() -> None:
    database = synthetic.database()
    assert beyond_words([]) == []
    assert beyond_data(database, database) == []
    assert reach_of([increment()], "beta") is None


def test_a_figure_marks_where_data_end() -> None:
    before = synthetic.database()
    figure = diff_figure(before, replace(before, increments=(increment(),)), ("v1", "v2"), "")
    panel = next(each for each in figure.axes if each.get_xlabel() == "alpha [deg]")
    dotted = sorted(line.get_xdata()[0] for line in panel.lines if line.get_linestyle() == ":")
    assert dotted == pytest.approx([-2.0, 17.0])
    assert "flown −2 to 17, faded out at −6 and 21 deg" in [t.get_text() for t in panel.texts]


def test_a_constant_that_is_counted_along_z_is_said_as_the_lift_that_it_is() -> None:
    """A constant of CZ written on the lift has the regressor -1; the database is the judge of its
    sign. What carries only an error is no constant."""
    before = synthetic.database()
    covariance = np.diag([0.0, 4e-4, 1e-6])
    added = replace(
        increment("C_lift"),
        regressors=(parse("alpha"), parse("-1"), parse("1")),
        estimates=np.array([0.1, 0.02, 0.0]),
        covariance=covariance,
        folded=(),
    )
    after = replace(before, increments=(added,))
    names, units, values, errors = zip(*increment_terms(added), strict=True)
    assert names == ("alpha", "constant", "model error")
    assert units == ("1/rad", "-", "-")
    at = {name: np.zeros(1) for name in added.names}
    assert values[1] == pytest.approx(float(added.evaluate(at).value[0]))
    assert values[1] == pytest.approx(-0.02)
    assert errors == pytest.approx((0.0, 0.02, 1e-3))
    edits = edits_of(diff_document(diff(before, after)))
    assert {edit["what"]: edit["change"] for edit in edits} == pytest.approx(
        {"alpha": 0.1, "constant": -0.02}
    )
