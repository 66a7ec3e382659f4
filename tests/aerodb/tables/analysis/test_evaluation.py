"""Value, standard error and place, against Monte Carlo draws of estimates and uncertainties, and
against formulas worked by hand."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aerodb.errors import InputError
from aerodb.nomenclature import AXES
from aerodb.tables.analysis.evaluation import Place, evaluate_database
from aerodb.tables.database import AeroDatabase, Term, Variable
from aerodb.tables.expression import number, parse
from aerodb.tables.increment import Increment, Interval
from aerodb.tables.reference import ReferenceGeometry, body_to_wind, transfer_moments, wind_to_body
from aerodb.tables.scattered import ScatteredTable
from aerodb.tables.table import Table
from aerodb.tables.uncertainty import Uncertainty
from aerodb.units import convert

REFERENCE = ReferenceGeometry(10.0, 2.0, 8.0, (-1.0, 0.0, 0.5))
ALPHA = np.array([0.0, 0.1, 0.2, 0.3])
ENVELOPE = {"alpha": Interval(0.05, 0.15, 0.05), "beta": Interval(-0.1, 0.1, 0.1)}
IN_DATA = {"alpha": 0.12, "beta": 0.08}


def increment(
    axis: str, estimates: list[float], covariance: list[list[float]], *regressors: str
) -> Increment:
    return Increment(
        axis,
        tuple(map(parse, regressors)),
        np.array(estimates),
        np.array(covariance),
        ENVELOPE,
        ("f1",),
    )


LIFT = increment("C_lift", [0.1, 1.0], [[4e-4, -2e-3], [-2e-3, 0.04]], "1", "alpha")
DRAG = increment("C_drag", [0.01], [[1e-4]], "1")
SIDE = increment("C_side", [-0.5], [[9e-4]], "beta")


def lifting(
    *increments: Increment, uncertainty: Uncertainty | None = None, **variables: Variable
) -> AeroDatabase:
    table = Table(
        "CL", ("alpha",), (ALPHA,), np.array([0.1, 0.5, 0.9, 0.8]), uncertainty=uncertainty
    )
    terms = (Term("lift", "C_lift", parse("CL(alpha)")), Term("damping", "Cm", parse("-3*q_hat")))
    return AeroDatabase("lifting", REFERENCE, variables, {"CL": table}, terms, increments)


def at(database: AeroDatabase, **channels: float) -> Mapping[str, tuple[float, float, str]]:
    """Axis -> value, standard error, place in words at one point."""
    found = evaluate_database(database, {"V": 50.0, "q": 0.0, "beta": 0.0, **channels})
    return {
        axis: (
            float(found.value[axis][0]),
            float(found.standard_error[axis][0]),
            Place(int(found.place[axis][0])).label,
        )
        for axis in AXES
    }


def test_covariance_of_wind_axes_reaches_body_axes_as_drawn_estimates_do() -> None:
    """10,000 draws of lift, drag and side increments through `predict`; 3 % is 4 standard errors of
    a drawn deviation."""
    rng, n = np.random.default_rng(3), 10_000
    database = lifting(LIFT, DRAG, SIDE)
    found = at(database, **IN_DATA)
    drawn = {
        each.axis: rng.multivariate_normal(each.estimates, each.covariance, n) @ np.array(column)
        for each, column in ((LIFT, [1.0, 0.12]), (DRAG, [1.0]), (SIDE, [0.08]))
    }
    lift = 0.5 + 0.2 * 0.4 + drawn["C_lift"]
    parts = wind_to_body(drawn["C_drag"], drawn["C_side"], lift, 0.12, 0.08)
    for axis, part in zip(("CX", "CY", "CZ"), parts, strict=True):
        assert found[axis][0] == pytest.approx(np.mean(part), abs=4 * np.std(part) / 100)
        assert found[axis][1] == pytest.approx(np.std(part), rel=0.03)
    assert found["CX"][1] < found["CZ"][1]


def test_what_nobody_has_quantified_is_not_known() -> None:
    found = at(lifting(LIFT), **IN_DATA)
    assert np.isnan([found[axis][1] for axis in ("CY", "Cl", "Cm", "Cn")]).all()
    assert np.isfinite([found[axis][1] for axis in ("CX", "CZ")]).all()
    assert np.isnan([at(lifting(), **IN_DATA)[axis][1] for axis in AXES]).all()


def test_place_of_every_axis() -> None:
    database = lifting(LIFT)
    places = [
        at(database, alpha=alpha, beta=beta)["CZ"][2]
        for alpha, beta in ((0.1, 0.0), (0.1, 0.2), (0.2, 0.0), (0.31, 0.0))
    ]
    assert places == ["inside data", "inside tables", "inside tables", "outside"]
    assert at(database, alpha=0.1)["CY"][2] == "inside tables", (
        "no flight has spoken on the side force"
    )
    assert at(database, alpha=0.31)["Cm"][2] == "inside tables", "no table stands behind Cm"
    wide = replace(LIFT, envelope={"alpha": Interval(0.05, 0.5, 0.1)})
    assert at(lifting(wide), alpha=0.4)["CZ"][2] == "outside", (
        "flown or not, the table is asked beyond its breakpoints"
    )
    assert at(database, alpha=float("nan"))["CZ"][2] == "outside"
    through = lifting(LIFT, downwash=Variable(parse("0.5*CL(alpha)")))
    behind = replace(through, terms=(*through.terms, Term("tail", "Cn", parse("-downwash"))))
    assert at(behind, alpha=0.31)["Cn"][2] == "outside", "through a variable too"


def test_error_grows_from_the_flights_to_the_baselines_beyond_the_data() -> None:
    """Normal, 3 sigma at 0.3 on the lift table: 0.1. Flights give 0.02; beyond, what fades and the
    table's own come in."""
    one = increment("C_lift", [0.05], [[4e-4]], "1")
    database = lifting(one, uncertainty=Uncertainty("additive", "normal", (0.3,), sigmas=3.0))

    def error(alpha: float) -> float:
        value, at_alpha = at(database, alpha=alpha), wind_to_body(0.0, 0.0, 1.0, alpha, 0.0)
        return value["CZ"][1] / abs(float(at_alpha[2]))

    assert error(0.12) == pytest.approx(0.02, rel=1e-12)
    assert error(0.20) == pytest.approx(0.02, rel=1e-12), "held for one cell"
    assert error(0.225) == pytest.approx(np.sqrt(0.01**2 + 0.025**2 + 0.05**2), rel=1e-9), (
        "half faded"
    )
    assert error(0.25) == pytest.approx(np.hypot(0.1, 0.05), rel=1e-12), "all faded"
    grown = [error(alpha) for alpha in np.linspace(0.15, 0.29, 60)]
    assert np.all(np.diff(grown) >= -1e-3), "but for a dip of 2 % where two errors share the weight"
    assert min(grown) > 0.97 * 0.02


@pytest.mark.parametrize(
    ("uncertainty", "deviation"),
    [
        (Uncertainty("additive", "normal", (0.06,)), 0.06),
        (Uncertainty("additive", "normal", (0.06,), sigmas=2.0), 0.03),
        (Uncertainty("additive", "uniform", (0.06,)), 0.06 / np.sqrt(3)),
        (Uncertainty("additive", "uniform", (0.02, 0.06)), 0.08 / np.sqrt(12)),
        (Uncertainty("percentage", "normal", (30.0,), sigmas=3.0), 0.05),
        (Uncertainty("percentage", "uniform", (10.0, 20.0)), 0.15 / np.sqrt(12)),
        (Uncertainty("multiplicative", "uniform", (0.9, 1.3)), 0.2 / np.sqrt(12)),
        (Uncertainty("multiplicative", "normal", (1.2,)), 0.1),
        (Uncertainty("absolute", "uniform", (0.4, 0.7)), 0.3 / np.sqrt(12)),
        (Uncertainty("absolute", "normal", (0.62,), sigmas=2.0), 0.06),
        (Uncertainty("additive", "normal", ("spread",)), 0.07),
        (Uncertainty("additive", "normal", ((0.0, 0.06, 0.2, 0.3),)), 0.06),
    ],
)
def test_declared_uncertainty_of_a_table(uncertainty: Uncertainty, deviation: float) -> None:
    """At alpha = 0.1 the table holds 0.5; lift acts on CZ with cos(alpha) and on CX with
    sin(alpha)."""
    database = lifting(uncertainty=uncertainty, spread=Variable(number(0.07)))
    found = at(database, alpha=0.1)
    assert found["CZ"][1] == pytest.approx(deviation * np.cos(0.1), rel=1e-9)
    assert found["CX"][1] == pytest.approx(deviation * np.sin(0.1), rel=1e-9)
    assert np.isnan(found["Cm"][1])


def test_a_scattered_table_carries_uncertainty_too() -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    table = ScatteredTable(
        "S",
        ("alpha", "mach"),
        points,
        np.array([1.0, 2.0, 3.0, 4.0]),
        Uncertainty("percentage", "normal", (10.0,)),
    )
    database = AeroDatabase(
        "s", REFERENCE, terms=(Term("s", "Cm", parse("-2*S(alpha, mach)")),), scattered={"S": table}
    )
    assert at(database, alpha=0.5, mach=0.5)["Cm"][1] == pytest.approx(0.1 * 2 * 2.5, rel=1e-12)
    assert at(database, alpha=2.0, mach=0.5)["Cm"][2] == "outside"


def test_uncertainty_factors_of_a_build_up() -> None:
    """UF = 1 +- 0.2 (uniform) on a speed-brake table, UD = 0 +- 1 (normal, 2 sigma) on a slope
    (003, eq. 6); drawn beside it."""
    variables = {
        "UF": Variable(number(1.0), uncertainty=Uncertainty("additive", "uniform", (0.2,))),
        "UD": Variable(
            number(0.0), uncertainty=Uncertainty("additive", "normal", (1.0,), sigmas=2.0)
        ),
    }
    tables = {"SB": Table("SB", ("alpha",), (ALPHA,), np.array([-0.2, -0.3, -0.4, -0.4]))}
    terms = (
        Term("brake", "CZ", parse("UF*SB(alpha)")),
        Term("slope", "CZ", parse("UD*0.9*alpha")),
        Term("Cm", "Cm", parse("UF^2")),
    )
    database = AeroDatabase("factors", REFERENCE, variables, tables, terms)
    rng = np.random.default_rng(5)
    drawn = rng.uniform(0.8, 1.2, 200_000) * -0.25 + rng.normal(0.0, 0.5, 200_000) * 0.9 * 0.05
    found = at(database, alpha=0.05)
    assert found["CZ"][0] == -0.25
    assert found["CZ"][1] == pytest.approx(np.std(drawn), rel=0.01)
    step = 0.2 / np.sqrt(3)
    assert found["Cm"][1] == pytest.approx((1 + step) ** 2 - 1, rel=1e-12), (
        "moved by one deviation, not linearised"
    )


def test_increments_of_two_updates_add_in_squares_and_missing_channels_are_named() -> None:
    one = increment("Cm", [0.05], [[9e-4]], "1")
    database = lifting(one, replace(one, covariance=np.array([[16e-4]])))
    assert at(database, alpha=0.1)["Cm"][1] == pytest.approx(0.05, rel=1e-12)
    with pytest.raises(InputError, match="channels missing: V, alpha, q"):
        evaluate_database(database, {"beta": 0.0})


def test_evaluation_of_many_points_is_that_of_each() -> None:
    database = lifting(LIFT, DRAG, uncertainty=Uncertainty("percentage", "uniform", (20.0,)))
    rng = np.random.default_rng(9)
    channels = {
        "alpha": rng.uniform(-0.1, 0.4, 50),
        "beta": rng.uniform(-0.4, 0.4, 50),
        "V": np.full(50, 50.0),
        "q": np.zeros(50),
    }
    together = evaluate_database(database, channels)
    for k in range(50):
        alone = evaluate_database(database, {name: x[k : k + 1] for name, x in channels.items()})
        for axis in AXES:
            assert together.standard_error[axis][k] == pytest.approx(
                alone.standard_error[axis][0], rel=1e-12, nan_ok=True
            )
            assert together.place[axis][k] == alone.place[axis][0]


ANGLE = st.floats(-1.5, 1.5)
FORCE = st.floats(-1e3, 1e3)


@given(FORCE, FORCE, FORCE, st.floats(-3.1, 3.1), ANGLE)
def test_axis_conversion_there_and_back(
    x: float, y: float, z: float, alpha: float, beta: float
) -> None:
    """And against scipy's rotations: wind axes are body axes turned by -alpha about y, then by beta
    about z."""
    drag, side, lift = body_to_wind(x, y, z, alpha, beta)
    scale = 1e-13 * max(abs(x), abs(y), abs(z), 1e-3)
    assert wind_to_body(drag, side, lift, alpha, beta) == pytest.approx((x, y, z), abs=scale)
    turned = Rotation.from_euler("YZ", [-alpha, beta]).inv().apply([x, y, z])
    assert (-drag, side, -lift) == pytest.approx(tuple(turned), abs=scale)


POINT = st.tuples(*[st.floats(-50.0, 50.0)] * 3)


@given(st.tuples(*[st.floats(-5.0, 5.0)] * 6), POINT, POINT, POINT)
def test_moment_transfer_there_and_back_and_by_way_of_a_third_point(
    values: tuple[float, ...],
    one: tuple[float, ...],
    other: tuple[float, ...],
    third: tuple[float, ...],
) -> None:
    coefficients = {axis: np.array([value]) for axis, value in zip(AXES, values, strict=True)}
    there = transfer_moments(coefficients, one, other, REFERENCE)
    back = transfer_moments(there, other, one, REFERENCE)
    around = transfer_moments(
        transfer_moments(coefficients, one, third, REFERENCE), third, other, REFERENCE
    )
    for axis in AXES:
        assert back[axis] == pytest.approx(coefficients[axis], abs=1e-11)
        assert around[axis] == pytest.approx(there[axis], abs=1e-11)
    force, arm = np.array(values[:3]), np.subtract(one, other)
    moment = [there[a][0] - coefficients[a][0] for a in AXES[3:]] * np.array([8.0, 2.0, 8.0])
    assert moment == pytest.approx(np.cross(arm, force), abs=1e-9)


@given(
    st.floats(-1e9, 1e9),
    st.sampled_from(
        [("deg", "rad"), ("ft", "m"), ("psf", "Pa"), ("knot", "m/s"), ("degF", "K"), ("slug", "kg")]
    ),
)
def test_unit_changes_there_and_back(value: float, units: tuple[str, str]) -> None:
    there = float(convert(value, units[0], units[1]))
    assert float(convert(there, units[1], units[0])) == pytest.approx(value, rel=1e-12, abs=1e-9)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_nodes_are_met_exactly_whatever_the_grid(seed: int, dimensions: int) -> None:
    rng = np.random.default_rng(seed)
    axes = tuple(
        np.unique(rng.normal(size=int(rng.integers(1, 4))) * 10.0 ** rng.integers(-6, 6))
        for _ in range(dimensions)
    )
    table = Table(
        "T",
        tuple(f"x{k}" for k in range(dimensions)),
        axes,
        rng.normal(size=[axis.size for axis in axes]),
    )
    mesh = [x.ravel() for x in np.meshgrid(*axes, indexing="ij")]
    assert np.array_equal(table.evaluate(*mesh), table.values.ravel())
    assert not table.outside(*mesh).any()
