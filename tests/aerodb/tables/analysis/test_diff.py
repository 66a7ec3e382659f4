"""Differences between databases: planted differences are found node by node, with standard error,
coverage and flights."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange.native import read_native
from aerodb.report import PHONE_WIDTH
from aerodb.report.diff_documents import diff_document
from aerodb.report.diff_figures import diff_figure
from aerodb.tables.analysis.consolidation import consolidate
from aerodb.tables.analysis.differences import diff
from aerodb.tables.analysis.nodes import table_axes, table_grids
from aerodb.tables.analysis.unstated_inputs import neutral_point
from aerodb.tables.database import AeroDatabase, Term, Variable
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment, Interval
from aerodb.tables.reference import ReferenceGeometry
from aerodb.tables.table import Table
from tests.support.small_glider import DATABASE

DEG = np.pi / 180.0


@pytest.fixture(scope="module")
def handbook() -> AeroDatabase:
    """CZ0 over -4, 0, 4, 8, 12 deg of alpha, and derivatives."""
    return read_native(DATABASE)


def lift_increment(
    axis: str = "CZ", flights: tuple[str, ...] = ("f1", "f2"), cell: float = 4.0
) -> Increment:
    """-0.02 - 0.5 alpha - 4 q_hat from flights between -1 and 5 deg, errors correlated."""
    covariance = np.array([[1e-6, -5e-6, 0.0], [-5e-6, 1e-4, 0.0], [0.0, 0.0, 0.01]])
    envelope = {
        "alpha": Interval(-1 * DEG, 5 * DEG, cell * DEG),
        "q_hat": Interval(-0.01, 0.01, 0.02),
    }
    regressors = (parse("1"), parse("alpha"), parse("q_hat"))
    return Increment(axis, regressors, np.array([-0.02, -0.5, -4.0]), covariance, envelope, flights)


def test_an_increment_at_the_nodes_of_a_table(handbook: AeroDatabase) -> None:
    increment = lift_increment()
    found = diff(handbook, replace(handbook, increments=(increment,)))
    (entry,) = found.nodes
    assert (entry.axis, entry.grid.table, entry.grid.channels) == ("CZ", "CZ0", ("alpha",))
    # By hand: inside it acts, one cell beyond it is held at the envelope's edge, then it fades over
    # one further cell.
    held = {-4: (-1, 1.0), 0: (0, 1.0), 4: (4, 1.0), 8: (5, 1.0), 12: (5, 0.25)}
    for k, (node, (at, weight)) in enumerate(held.items()):
        full = np.array([1.0, at * DEG])
        value = full @ increment.estimates[:2]
        assert entry.grid.values[0][k] == pytest.approx(node * DEG)
        assert entry.change[k] == pytest.approx(weight * value, rel=1e-9)
        error = np.sqrt(
            weight**2 * full @ increment.covariance[:2, :2] @ full + ((1 - weight) * value) ** 2
        )
        assert entry.sigma[k] == pytest.approx(error, rel=1e-9)
        assert entry.flights(k) == ("f1", "f2")
    assert entry.inside.tolist() == [False, True, True, False, False]
    regressors = [(term.name, term.change, term.sigma, term.flights) for term in found.terms]
    assert regressors == [
        ("1", -0.02, pytest.approx(0.001), ("f1", "f2")),
        ("alpha", -0.5, pytest.approx(0.01), ("f1", "f2")),
        ("q_hat", -4.0, pytest.approx(0.1), ("f1", "f2")),
    ]
    assert not found.tables
    assert not found.not_addressable


def test_there_and_back_is_the_opposite_and_the_same_is_nothing(handbook: AeroDatabase) -> None:
    after = replace(handbook, increments=(lift_increment(),))
    there, back = diff(handbook, after), diff(after, handbook)
    np.testing.assert_array_equal(there.nodes[0].change, -back.nodes[0].change)
    np.testing.assert_array_equal(there.nodes[0].sigma, back.nodes[0].sigma)
    assert [term.change for term in back.terms] == [0.02, 0.5, 4.0]
    assert diff(after, after).empty


def test_who_is_behind_a_node(handbook: AeroDatabase) -> None:
    early = replace(
        lift_increment(flights=("f1", "f2")),
        envelope={"alpha": Interval(-4 * DEG, -3 * DEG, 1 * DEG)},
    )
    late = replace(
        lift_increment(flights=("f2", "f3")),
        envelope={"alpha": Interval(5 * DEG, 9 * DEG, 4 * DEG)},
    )
    (entry,) = diff(handbook, replace(handbook, increments=(early, late))).nodes
    assert [entry.flights(k) for k in range(5)] == [
        ("f1", "f2"),
        ("f2", "f3"),
        ("f2", "f3"),
        ("f2", "f3"),
        ("f2", "f3"),
    ]
    document = diff_document(diff(handbook, replace(handbook, increments=(early, late))))
    (table,) = document["nodes"]
    assert table["sources"] == [["f1", "f2"], ["f2", "f3"]]
    assert [node["sources"] for node in table["nodes"]] == [[0], [1], [1], [1], [1]]
    assert table["largest"]["index"] == [4]


def test_layered_and_consolidated_give_the_same_coefficients(handbook: AeroDatabase) -> None:
    layered = replace(handbook, increments=(lift_increment(),))
    folded = consolidate(layered)
    assert any(folded.increments[0].folded)
    found = diff(layered, folded)
    assert found.nodes == ()
    assert found.terms == ()
    # What the update did to the baseline is the same in either form, also where the table has grown
    # breakpoints.
    (entry,) = diff(handbook, folded).nodes
    at = entry.grid.values[0]
    layer = layered.predict({**neutral_point(layered), "alpha": at}).coefficients["CZ"]
    base = handbook.predict({**neutral_point(handbook), "alpha": at}).coefficients["CZ"]
    np.testing.assert_allclose(entry.change, layer - base, rtol=0, atol=1e-12)


def test_a_table_value_a_term_a_variable_and_the_reference(handbook: AeroDatabase) -> None:
    table = handbook.tables["CZ0"]
    values = table.values.copy()
    values[2] -= 0.01
    terms = tuple(
        replace(t, expression=parse("-13*q_hat")) if t.name == "Cm_q_hat" else t
        for t in handbook.terms[:-1]
    )
    after = replace(
        handbook,
        tables={"CZ0": replace(table, values=values)},
        terms=(*terms, Term("extra", "CY", parse("k*beta"))),
        variables={"k": Variable(parse("0.1"))},
        reference=replace(handbook.reference, chord=0.26),
    )
    found = diff(handbook, after)
    (entry,) = found.nodes
    np.testing.assert_allclose(entry.change, [0, 0, -0.01, 0, 0], atol=1e-15)
    assert entry.sigma.tolist() == [0.0] * 5
    assert not entry.inside.any()
    assert {(t.kind, t.name, t.before, t.after) for t in found.terms} == {
        ("reference", "chord", "0.25", "0.26"),
        ("term", "Cm_q_hat", "-12*q_hat", "-13*q_hat"),
        ("term", handbook.terms[-1].name, str(handbook.terms[-1].expression), ""),
        ("term", "extra", "", "k*beta"),
        ("variable", "k", "", "0.1"),
    }


def test_drag_and_lift_increments_show_on_the_body_axes(handbook: AeroDatabase) -> None:
    drag = Increment(
        "C_drag",
        (parse("1"),),
        np.array([0.01]),
        np.array([[1e-6]]),
        {"alpha": Interval(-0.1, 0.3, 0.1)},
        ("f1",),
    )
    (entry,) = diff(handbook, replace(handbook, increments=(drag,))).nodes
    alpha = entry.grid.values[0]
    np.testing.assert_allclose(entry.change, -0.01 * np.sin(alpha), atol=1e-15)
    np.testing.assert_allclose(entry.sigma, 0.001 * np.abs(np.sin(alpha)), atol=1e-15)


def test_nodes_over_scaled_channels_and_tables_that_have_none() -> None:
    reference = ReferenceGeometry(1.0, 1.0, 1.0, (0.0, 0.0, 0.0))
    degrees = Table(
        "T",
        ("alpha_deg", "flap"),
        (np.array([-5.0, 0.0, 10.0]), np.array([0.0, 1.0])),
        np.zeros((3, 2)),
    )
    slip = Table("S", ("abs_beta",), (np.array([0.0, 0.2]),), np.array([0.0, 1.0]))
    sum_table = Table("M", ("sum",), (np.array([0.0, 1.0]),), np.array([0.0, 1.0]))
    database = AeroDatabase(
        "d",
        reference,
        variables={
            "alpha_deg": Variable(parse("alpha*57.29577951308232")),
            "x": Variable(parse("S(abs(beta))")),
        },
        tables={"T": degrees, "S": slip, "M": sum_table},
        terms=(
            Term("lift", "C_lift", parse("T(alpha_deg, delta_flap*2 - 1)")),
            Term("side", "CY", parse("x + M(alpha + beta)")),
        ),
    )
    grids = table_grids(database)
    assert set(grids) == {"T", "S"}
    assert grids["T"].channels == ("alpha", "delta_flap")
    np.testing.assert_allclose(grids["T"].values[0], np.array([-5, 0, 10]) * DEG, rtol=1e-12)
    np.testing.assert_allclose(grids["T"].values[1], [0.5, 1.0])
    assert grids["T"].node((2, 0)) == {
        "alpha": pytest.approx(10 * DEG),
        "delta_flap": pytest.approx(0.5),
    }
    assert table_axes(database) == {"T": {"C_lift"}, "S": {"CY"}, "M": {"CY"}}
    other = replace(sum_table, values=np.array([0.0, 1.5]))
    changed = replace(
        database,
        tables={**database.tables, "M": other, "T": replace(degrees, values=np.ones((3, 2)))},
    )
    found = diff(database, changed)
    assert found.not_addressable == {"M": 0.5}
    # T itself, turned by alpha into the body axes; and M, which alpha moves, on the axis of S.
    assert {(entry.axis, entry.grid.table) for entry in found.nodes if entry.axis != "CY"} == {
        ("CX", "T"),
        ("CZ", "T"),
    }
    with pytest.raises(InputError, match=r"indices go from 0: \[0\.\.2, 0\.\.1\]"):
        grids["T"].node((3, 0))


def test_new_gone_and_reshaped_tables_are_named(handbook: AeroDatabase) -> None:
    wide = Table("CZ0", ("alpha",), (np.array([-1.0, 0.0, 1.0]),), np.array([5.0, 0.0, -5.0]))
    extra = Table("Y", ("beta",), (np.array([-0.1, 0.1]),), np.array([0.03, -0.03]))
    terms = (*(t for t in handbook.terms if t.axis != "CY"), Term("y", "CY", parse("Y(beta)")))
    after = replace(handbook, tables={"CZ0": wide, "Y": extra}, terms=terms)
    assert diff(handbook, after).tables == {"CZ0": "[5] nodes before, [3] after", "Y": "new"}
    assert diff(after, handbook).tables["Y"] == "gone"


def test_the_picture_shows_both_databases_band_and_envelope(handbook: AeroDatabase) -> None:
    after = replace(handbook, increments=(lift_increment(),))
    figure = diff_figure(handbook, after, ("v0001", "v0002"), "glider: v0001 and v0002")
    panel = next(axes for axes in figure.axes if axes.get_xlabel() == "alpha [deg]")
    assert panel.get_ylabel() == "CZ [-]"
    named = {line.get_label(): line for line in panel.get_lines()}
    old, new, (band,) = named["v0001"], named["v0002"], panel.collections
    point = neutral_point(after, after.increments)
    for line, database in ((old, handbook), (new, after)):
        at = np.deg2rad(np.asarray(line.get_xdata()))
        wanted = database.predict({**point, "alpha": at}).coefficients["CZ"]
        np.testing.assert_allclose(np.asarray(line.get_ydata()), wanted, atol=1e-12)
    bounds = band.get_datalim(panel.transData)
    assert bounds.y0 < np.min(np.asarray(new.get_ydata()))
    narrow = diff_figure(handbook, after, ("v0001", "v0002"), "", width=PHONE_WIDTH)
    assert narrow.get_figwidth() == PHONE_WIDTH
    places = [axes.get_position() for axes in narrow.axes]
    assert {round(place.x0, 6) for place in places} == {round(places[0].x0, 6)}  # one column
    same = diff_figure(handbook, handbook, ("a", "b"), "nothing")
    assert "give the same coefficients" in same.axes[0].texts[0].get_text()
