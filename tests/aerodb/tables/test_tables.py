"""Tables, increments and databases against scipy, against formulas worked by hand, and by their own
algebra."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator
from scipy.spatial.transform import Rotation

from aerodb.errors import InputError, UnknownNameError
from aerodb.nomenclature import AXES
from aerodb.tables.analysis.check_cases import CheckCase, failed_check_cases, make_check_cases
from aerodb.tables.database import AeroDatabase, Term, Variable
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment, Interval
from aerodb.tables.reference import ReferenceGeometry, transfer_moments, wind_to_body
from aerodb.tables.table import Table

REFERENCE = ReferenceGeometry(area=10.3, chord=6.0, span=3.48, moment_reference=(-1.0, 0.0, 0.5))


def random_table(
    rng: np.random.Generator, dimensions: int, sizes: tuple[int, int] = (2, 6)
) -> Table:
    shape = rng.integers(*sizes, endpoint=True, size=dimensions)
    axes = tuple(np.cumsum(rng.uniform(0.05, 1.0, size)) - 1.5 for size in shape)
    return Table("T", tuple(f"x{k}" for k in range(dimensions)), axes, rng.normal(size=shape))


def points_around(table: Table, rng: np.random.Generator, n: int) -> list[np.ndarray]:
    """Points inside, outside and exactly on breakpoints."""
    columns = []
    for axis in table.breakpoints:
        x = rng.uniform(axis[0] - 0.5, axis[-1] + 0.5, n)
        on = rng.random(n) < 0.2
        x[on] = rng.choice(axis, on.sum())
        columns.append(x)
    return columns


@pytest.mark.parametrize("dimensions", [1, 2, 3, 4])
def test_interpolation_equals_scipy_and_is_held_outside(dimensions: int) -> None:
    rng = np.random.default_rng(dimensions)
    table = random_table(rng, dimensions, (2, 7))
    x = points_around(table, rng, 4000)
    held = np.column_stack(
        [
            np.clip(column, axis[0], axis[-1])
            for column, axis in zip(x, table.breakpoints, strict=True)
        ]
    )
    expected = RegularGridInterpolator(table.breakpoints, table.values)(held)
    assert np.max(np.abs(table.evaluate(*x) - expected)) <= 1e-13
    assert np.array_equal(table.outside(*x), np.any(held != np.column_stack(x), axis=1))


@pytest.mark.parametrize("dimensions", [1, 2, 3, 4])
def test_nodes_are_met_exactly(dimensions: int) -> None:
    table = random_table(np.random.default_rng(10 + dimensions), dimensions)
    mesh = [axis.ravel() for axis in np.meshgrid(*table.breakpoints, indexing="ij")]
    assert np.array_equal(table.evaluate(*mesh), table.values.ravel())
    assert not table.outside(*mesh).any()


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_hat_basis_is_the_table(seed: int, dimensions: int) -> None:
    """``A @ values`` equals evaluation; rows are partitions of one."""
    rng = np.random.default_rng(seed)
    table = random_table(rng, dimensions, (1, 4))
    x = points_around(table, rng, 30)
    basis = table.basis(*x)
    assert basis.shape == (30, table.values.size)
    assert basis @ table.values.ravel() == pytest.approx(table.evaluate(*x), rel=1e-12, abs=1e-12)
    assert basis.sum(axis=1) == pytest.approx(np.ones(30), rel=1e-12)
    assert basis.data.min() > 0


def test_slope_of_a_bilinear_form_is_exact() -> None:
    """On f = 2 + 3x - y + 4xy the slopes are 3 + 4y and -1 + 4x, whatever the grid; zero where the
    table is held."""
    x, y = np.array([-1.0, 0.0, 2.0, 2.5]), np.array([0.0, 1.0, 4.0])
    table = Table("T", ("x", "y"), (x, y), 2 + 3 * x[:, None] - y + 4 * x[:, None] * y)
    at_x, at_y = np.array([-0.5, 0.0, 2.4, 9.0]), np.array([0.5, 3.0, 1.0, 2.0])
    assert table.slope("x", at_x, at_y) == pytest.approx([5.0, 15.0, 7.0, 0.0], rel=1e-13)
    assert table.slope("y", at_x, at_y) == pytest.approx([-3.0, -1.0, 8.6, 9.0], rel=1e-13)
    with pytest.raises(UnknownNameError, match="no argument 'z'"):
        table.slope("z", at_x, at_y)


def test_numbers_and_arrays_mix_and_not_a_number_stays_visible() -> None:
    table = random_table(np.random.default_rng(5), 3)
    x = np.linspace(-1, 1, 8)
    assert np.array_equal(
        table.evaluate(x, 0.1, 0.2), table.evaluate(x, np.full(8, 0.1), np.full(8, 0.2))
    )
    assert table.evaluate(0.1, 0.2, 0.3).shape == (1,)
    lookup = table.lookup(np.array([np.nan, 0.0]), -0.9, -0.9)
    assert np.isnan(lookup.values).tolist() == [True, False]
    assert lookup.outside[0]
    with pytest.raises(InputError, match="not finite"):
        table.basis(np.array([np.nan]), 0.0, 0.0)


@pytest.mark.parametrize(
    ("axes", "shape", "message"),
    [
        (([0.0, 1.0, 1.0],), (3,), "breakpoints of x0 do not increase: 1 is followed by 1"),
        (([0.0, 2.0, 1.0],), (3,), "do not increase: 2 is followed by 1"),
        (([0.0, 1.0],), (3,), r"values have shape \(3,\), the breakpoints \(2,\)"),
        (([0.0, np.nan],), (2,), "not a list of finite numbers"),
        (([],), (0,), "not a list of finite numbers"),
        ((), (), "0 arguments for 0 breakpoint lists"),
    ],
)
def test_tables_that_are_not_are_refused(
    axes: tuple[list[float], ...], shape: tuple[int, ...], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        Table(
            "T",
            tuple(f"x{k}" for k in range(len(axes))),
            tuple(map(np.array, axes)),
            np.zeros(shape),
        )


def test_a_table_cannot_be_changed_in_place() -> None:
    values = np.array([1.0, 2.0])
    table = Table("T", ("x",), (np.array([0.0, 1.0]),), values)
    values[0] = 9.0
    assert table.evaluate(0.0)[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        table.values[0] = 9.0


def test_moment_transfer_of_a_force_worked_by_hand() -> None:
    """1 of -Z force (lift) 0.6 m ahead of the new point pitches up by 0.6/c; side force there yaws
    right by 0.6/b."""
    rest = {axis: np.zeros(1) for axis in AXES}
    moved = transfer_moments(
        {**rest, "CZ": np.array([-1.0]), "CY": np.array([2.0])}, (0.6, 0, 0), (0, 0, 0), REFERENCE
    )
    assert moved["Cm"] == pytest.approx(0.6 / 6.0)
    assert moved["Cn"] == pytest.approx(2 * 0.6 / 3.48)
    assert moved["Cl"] == 0.0


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_moments_moved_there_and_back_are_the_same(seed: int) -> None:
    rng = np.random.default_rng(seed)
    coefficients = {axis: rng.normal(size=7) for axis in AXES}
    here, there = rng.normal(size=3), rng.normal(size=(7, 3))
    away = transfer_moments(coefficients, here, there, REFERENCE)
    back = transfer_moments(away, there, here, REFERENCE)
    assert all(back[axis] == pytest.approx(coefficients[axis], abs=1e-12) for axis in AXES)
    arm = np.cross(here - there, np.column_stack([coefficients[axis] for axis in AXES[:3]]))
    lengths = np.array([REFERENCE.span, REFERENCE.chord, REFERENCE.span])
    expected = np.column_stack([coefficients[axis] for axis in AXES[3:]]) + arm / lengths
    assert np.column_stack([away[axis] for axis in AXES[3:]]) == pytest.approx(expected, abs=1e-12)


def test_wind_axes_are_body_axes_turned_by_alpha_and_beta() -> None:
    """Body = R_y(-alpha) R_z(beta) wind, by scipy's rotations, which know nothing of aircraft."""
    rng = np.random.default_rng(7)
    alpha, beta = rng.uniform(-1, 1, (2, 50))
    drag, side, lift = rng.normal(size=(3, 50))
    turn = Rotation.from_euler("YZ", np.column_stack([-alpha, beta]))
    expected = turn.apply(np.column_stack([-drag, side, -lift]))
    assert np.column_stack(wind_to_body(drag, side, lift, alpha, beta)) == pytest.approx(
        expected, abs=1e-13
    )


def phoenix_like() -> AeroDatabase:
    """A lift in the form of 003 eq. 6: base table, body flap with scale, landing gear times |beta|,
    rate term."""
    alpha, flap = np.array([-0.1, 0.0, 0.2, 0.4]), np.array([-0.3, 0.0, 0.3])
    tables = {
        "CZ0": Table("CZ0", ("alpha",), (alpha,), -3.0 * alpha),
        "dCZbf": Table(
            "dCZbf", ("alpha", "delta_body_flap"), (alpha, flap), -0.4 * flap + 0.0 * alpha[:, None]
        ),
    }
    terms = (
        Term("base", "CZ", parse("CZ0(alpha)")),
        Term("body_flap", "CZ", parse("UF*dCZbf(alpha, delta_body_flap)")),
        Term("gear", "CZ", parse("-0.1*delta_landing_gear*abs(beta)")),
        Term("rate", "CZ", parse("-2*pitch")),
        Term("damping", "Cm", parse("-1.5*q_hat")),
        Term("drag", "C_drag", parse("0.05")),
    )
    variables = {"UF": Variable(parse("1.25")), "pitch": Variable(parse("q*c_ref/V"))}
    return AeroDatabase("phoenix-like", REFERENCE, variables, tables, terms)


CHANNELS = {
    "alpha": np.array([0.1, 0.3, 0.5]),
    "beta": np.array([0.0, -0.1, 0.2]),
    "delta_body_flap": np.array([0.1, -0.2, 0.0]),
    "delta_landing_gear": np.array([0.0, 1.0, 1.0]),
    "q": np.array([0.0, 0.1, -0.1]),
    "V": np.array([60.0, 70.0, 80.0]),
}


def test_build_up_equals_the_formula() -> None:
    database = phoenix_like()
    assert database.inputs == tuple(sorted(CHANNELS))
    c, prediction = CHANNELS, database.predict(CHANNELS)
    base = -3.0 * np.minimum(c["alpha"], 0.4)
    flap = -0.5 * c["delta_body_flap"]
    gear = -0.1 * c["delta_landing_gear"] * np.abs(c["beta"])
    rate = -2 * c["q"] * 6.0 / c["V"]
    drag_z = -0.05 * np.sin(c["alpha"]) * np.cos(c["beta"])
    assert prediction.coefficients["CZ"] == pytest.approx(
        base + flap + gear + rate + drag_z, abs=1e-14
    )
    assert prediction.coefficients["Cm"] == pytest.approx(
        -1.5 * c["q"] * 6.0 / (2 * c["V"]), abs=1e-14
    )
    assert prediction.coefficients["CX"] == pytest.approx(
        -0.05 * np.cos(c["alpha"]) * np.cos(c["beta"]), abs=1e-14
    )
    assert prediction.outside.tolist() == [False, False, True]
    assert {name: where.tolist() for name, where in prediction.outside_tables.items()} == {
        "CZ0": [False, False, True],
        "dCZbf": [False, False, True],
    }
    assert database.predict({**c, "q_hat": 0.02}).coefficients["Cm"] == pytest.approx(
        np.full(3, -0.03)
    )


def test_a_database_survives_pickling() -> None:
    database = phoenix_like()
    database.predict(CHANNELS)
    again = pickle.loads(pickle.dumps(database))
    assert np.array_equal(
        again.predict(CHANNELS).coefficients["CZ"], database.predict(CHANNELS).coefficients["CZ"]
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"terms": (Term("a", "CZ", parse("alhpa")),)}, "did you mean 'alpha'"),
        ({"terms": (Term("a", "CZZ", parse("1")),)}, "did you mean 'CZ'"),
        ({"terms": (Term("a", "CZ", parse("CZO(alpha)")),)}, "did you mean 'CZ0'"),
        (
            {"terms": (Term("a", "CZ", parse("CZ0(alpha, beta)")),)},
            "called with 2 arguments, it has 1",
        ),
        (
            {"terms": (Term("a", "CZ", parse("1")), Term("a", "Cm", parse("1")))},
            "term 'a' is defined twice",
        ),
        (
            {
                "variables": {
                    "a": Variable(parse("b")),
                    "b": Variable(parse("2*a")),
                    **phoenix_like().variables,
                }
            },
            "b -> a -> b",
        ),
        (
            {"variables": {"alpha": Variable(parse("1")), **phoenix_like().variables}},
            "has the name of a channel",
        ),
        ({"free_inputs": {"S_ref": "x"}}, "has the name of a constant"),
        ({"free_inputs": {"UF": "x"}}, "has the name of a variable"),
    ],
)
def test_databases_that_contradict_themselves_are_refused(
    change: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        replace(phoenix_like(), **change)


def test_missing_channels_are_named() -> None:
    with pytest.raises(InputError, match="channels missing: V, beta"):
        phoenix_like().predict(
            {name: x for name, x in CHANNELS.items() if name not in ("beta", "V")}
        )


def test_long_chains_of_variables_are_refused_not_crashed() -> None:
    chain = {f"v{k}": Variable(parse(f"v{k + 1} + 1")) for k in range(5000)} | {
        "v5000": Variable(parse("1"))
    }
    with pytest.raises(InputError, match="too many levels"):
        AeroDatabase("chain", REFERENCE, chain, {}, (Term("a", "CZ", parse("v0")),))


def increment() -> Increment:
    return Increment(
        axis="CZ",
        regressors=(parse("1"), parse("alpha"), parse("q_hat")),
        estimates=np.array([-0.02, -0.5, -3.0]),
        covariance=np.diag([1e-6, 4e-4, 0.25]),
        envelope={"alpha": Interval(0.0, 0.2, 0.05), "q_hat": Interval(-0.01, 0.01, 0.01)},
        flights=("f1", "f2"),
    )


def test_increment_inside_its_envelope_is_the_regression() -> None:
    value, error, inside = increment().evaluate(
        {"alpha": np.array([0.0, 0.1, 0.2]), "q_hat": np.array([0.0, 0.01, -0.01])}
    )
    assert inside.all()
    assert value == pytest.approx([-0.02, -0.02 - 0.05 - 0.03, -0.02 - 0.1 + 0.03])
    assert error == pytest.approx(np.sqrt([1e-6, 1e-6 + 4e-6 + 2.5e-5, 1e-6 + 1.6e-5 + 2.5e-5]))


def test_increment_is_held_for_one_cell_then_fades_over_the_next() -> None:
    """Above alpha 0.2 with a cell of 0.05: held to 0.25, half at 0.275, nothing from 0.3; the error
    grows meanwhile."""
    alpha = np.array([0.2, 0.22, 0.25, 0.275, 0.3, 0.9])
    value, error, inside = increment().evaluate({"alpha": alpha, "q_hat": 0.0})
    edge = -0.02 - 0.5 * 0.2
    assert value == pytest.approx([edge, edge, edge, edge / 2, 0.0, 0.0], abs=1e-14)
    assert inside.tolist() == [True, False, False, False, False, False]
    assert np.all(np.diff(error[2:5]) > 0)
    assert error[-1] == pytest.approx(abs(edge))
    assert increment().value({"alpha": alpha, "q_hat": 0.0}) == pytest.approx(value, abs=1e-15)


def test_a_regressor_fades_by_its_own_variables_and_the_base_variables_only() -> None:
    """Far outside in q_hat only the q_hat regressor is gone; far outside in alpha, everything
    is."""
    value = increment().value({"alpha": np.array([0.1, 0.9]), "q_hat": np.array([0.5, 0.005])})
    assert value == pytest.approx([-0.02 - 0.05, 0.0], abs=1e-14)


@given(st.floats(-0.5, 0.8), st.floats(-0.1, 0.1))
def test_increment_never_exceeds_its_values_at_the_envelope(alpha: float, q_hat: float) -> None:
    value = increment().value({"alpha": alpha, "q_hat": q_hat})[0]
    assert abs(value) <= 0.02 + 0.1 + 0.03 + 1e-12


def test_increments_add_at_the_outputs_with_the_database_s_own_hat_rates() -> None:
    database = phoenix_like()
    candidate = replace(database, increments=(increment(),))
    before, after = (d.predict(CHANNELS).coefficients for d in (database, candidate))
    q_hat = CHANNELS["q"] * 6.0 / (2 * CHANNELS["V"])
    expected = increment().value({"alpha": CHANNELS["alpha"], "q_hat": q_hat})
    assert after["CZ"] - before["CZ"] == pytest.approx(expected, abs=1e-15)
    assert np.any(expected != 0)
    assert all(np.array_equal(before[axis], after[axis]) for axis in AXES if axis != "CZ")


def test_increments_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InputError, match="covariance"):
        Increment("CZ", (parse("alpha"),), np.array([1.0]), np.eye(2))
    with pytest.raises(InputError, match="flown range from 1 to 0"):
        Interval(1.0, 0.0, 0.1)
    with pytest.raises(InputError, match="no value for q_hat"):
        increment().evaluate({"alpha": 0.1})
    with pytest.raises(InputError, match="unknown name 'alfa'"):
        replace(
            phoenix_like(), increments=(Increment("CZ", (parse("alfa"),), np.ones(1), np.eye(1)),)
        )


@pytest.mark.parametrize(
    "change",
    [{"area": 0.0}, {"chord": -1.0}, {"span": float("nan")}, {"moment_reference": (0.0, 0.0)}],
)
def test_reference_geometry_must_be_positive(change: dict[str, object]) -> None:
    with pytest.raises(InputError):
        replace(REFERENCE, **change)


def test_a_check_case_with_other_inputs_fails_and_says_so():
    """As in a file whose name of one input was changed."""
    cases = [CheckCase({"alpha": 0.1}, {}), CheckCase({"clpha": 0.1}, {})]
    (said,) = failed_check_cases(AeroDatabase("x", REFERENCE), cases)
    assert said == "check case 2: its inputs are not those of the first"


def test_check_cases_of_a_database_without_inputs():
    """The empty baseline from which everything is to be identified."""
    empty = AeroDatabase("empty", ReferenceGeometry(1.0, 1.0, 1.0, (0.0, 0.0, 0.0)))
    cases = make_check_cases(empty)
    assert len(cases) == 25
    assert failed_check_cases(empty, cases) == ()
    offset = replace(empty, terms=(Term("offset", "CX", parse("0.1")),))
    assert len(failed_check_cases(offset, cases)) == 25
