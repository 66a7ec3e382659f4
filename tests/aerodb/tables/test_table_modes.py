"""Tables with other interpolation and extrapolation, scattered points, and tables interpolated
together."""

import numpy as np
import pytest
from scipy.interpolate import LinearNDInterpolator

from aerodb.errors import InputError
from aerodb.tables.database import BLOCK, AeroDatabase, Term, Variable
from aerodb.tables.expression import parse
from aerodb.tables.program import compile_program
from aerodb.tables.reference import ReferenceGeometry
from aerodb.tables.scattered import ScatteredTable
from aerodb.tables.table import Table
from aerodb.tables.uncertainty import Uncertainty

REFERENCE = ReferenceGeometry(area=10.3, chord=6.0, span=3.48, moment_reference=(-1.0, 0.0, 0.5))
X, Y = np.array([0.0, 1.0, 3.0]), np.array([2.0, 4.0, -1.0])


@pytest.mark.parametrize(
    ("interpolation", "extrapolation", "expected"),
    [
        ("linear", "neither", [2, 2, 3, 4, 1.5, -1, -1]),
        ("linear", "min", [0, 2, 3, 4, 1.5, -1, -1]),
        ("linear", "both", [0, 2, 3, 4, 1.5, -1, -3.5]),
        ("discrete", "neither", [2, 2, 4, 4, -1, -1, -1]),
        ("floor", "neither", [2, 2, 2, 4, 4, -1, -1]),
        ("ceiling", "neither", [2, 2, 4, 4, -1, -1, -1]),
    ],
)
def test_one_axis_by_hand(interpolation: str, extrapolation: str, expected: list[float]) -> None:
    """Values worked by hand at -1, 0, 0.5, 1, 2, 3, 4; the hat basis says the same."""
    table = Table("T", ("x",), (X,), Y, (interpolation,), (extrapolation,))
    at = np.array([-1, 0, 0.5, 1, 2, 3, 4])
    assert table.evaluate(at) == pytest.approx(expected)
    assert table.basis(at) @ table.values == pytest.approx(expected)
    assert table.outside(at).tolist() == [True, False, False, False, False, False, True]
    assert np.isnan(table.evaluate(np.array([np.nan]))).all()


def test_axes_differ_in_one_table() -> None:
    rng = np.random.default_rng(1)
    table = Table(
        "T", ("x", "y"), (X, X), rng.normal(size=(3, 3)), ("linear", "floor"), ("max", "neither")
    )
    x, y = rng.uniform(-1, 5, 200), rng.uniform(-1, 5, 200)
    rows = table.values[:, np.clip(np.searchsorted(X, y, side="right") - 1, 0, 2)]
    left = np.where(x < 1, 0, 1)
    weight = (np.maximum(x, 0) - X[left]) / (X[left + 1] - X[left])
    k = np.arange(200)
    assert table.evaluate(x, y) == pytest.approx(
        (1 - weight) * rows[left, k] + weight * rows[left + 1, k], abs=1e-12
    )
    assert table.basis(x, y) @ table.values.ravel() == pytest.approx(
        table.evaluate(x, y), abs=1e-12
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"interpolation": ("cubic",)}, "'cubic'"),
        ({"extrapolation": ("min", "max")}, "2 words"),
        (
            {"interpolation": ("floor",), "extrapolation": ("both",)},
            "extrapolation of an axis that is floor",
        ),
        (
            {"uncertainty": Uncertainty("additive", "normal", ((0.1, 0.2),))},
            "2 uncertainty bounds for 3 nodes",
        ),
    ],
)
def test_modes_that_are_not_are_refused(words: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Table("T", ("x",), (X,), Y, **words)  # type: ignore[arg-type]


@pytest.mark.parametrize("dimensions", [2, 3, 4])
def test_scattered_points_equal_scipy_inside_and_are_held_outside(dimensions: int) -> None:
    """Outside, the value is the one where the line from the mean of the points leaves their hull;
    nodes are met."""
    rng = np.random.default_rng(dimensions)
    points, values = (
        rng.uniform(0, 10.0 ** np.arange(dimensions), (40, dimensions)),
        rng.normal(size=40),
    )
    table = ScatteredTable("P", tuple("abcd"[:dimensions]), points, values)
    at = rng.uniform(-0.2, 1.2, (400, dimensions)) * 10.0 ** np.arange(dimensions)
    interpolator = LinearNDInterpolator(points, values, rescale=True)
    expected = interpolator(at)
    found = table.lookup(*at.T)
    inside = np.isfinite(expected)
    assert 5 < inside.sum() < 395
    assert found.values[inside] == pytest.approx(expected[inside], rel=1e-8, abs=1e-8)
    assert np.array_equal(found.outside, ~inside)
    assert table.evaluate(*points.T) == pytest.approx(values, abs=1e-9)
    centre = points.mean(axis=0)
    for point, value in zip(at[~inside][:20], found.values[~inside][:20], strict=True):
        inner, outer = 0.0, 1.0
        for _ in range(50):  # where the line leaves the hull, by bisection
            middle = (inner + outer) / 2
            inside_here = np.isfinite(interpolator(centre + middle * (point - centre))[0])
            inner, outer = (middle, outer) if inside_here else (inner, middle)
        assert value == pytest.approx(
            float(interpolator(centre + inner * (point - centre))[0]), abs=1e-6
        )
    assert np.isnan(table.evaluate(np.nan, *at[0, 1:]))[0]


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[0, 0], [1, 1], [2, 2], [3, 3]], "no volume"),
        ([[0, 0], [1, 0], [0, 1], [0, 0]], "a point is listed twice"),
        ([[0, 0], [1, 0], [0, np.inf], [1, 1]], "not finite"),
    ],
)
def test_scattered_points_that_are_no_table_are_refused(
    points: list[list[float]], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        ScatteredTable("P", ("a", "b"), np.array(points), np.zeros(4))


def test_tables_on_the_same_breakpoints_are_looked_up_together() -> None:
    """Bit for bit what each gives alone; another mode or another argument stays apart."""
    rng = np.random.default_rng(2)
    tables = {
        f"T{k}": Table(f"T{k}", ("x", "y"), (X, X), rng.normal(size=(3, 3))) for k in range(5)
    }
    tables["D"] = Table("D", ("x", "y"), (X, X), rng.normal(size=(3, 3)), ("floor", "linear"))
    calls = [f"{name}(a, b)" for name in tables] + ["T0(b, a)"]
    program = compile_program([parse(call) for call in calls], tables)
    assert sum(bool(step.tables) for step in program.steps) == 3
    a, b = rng.uniform(-1, 4, 100), rng.uniform(-1, 4, 100)
    run = program.run({"a": a, "b": b})
    for name, value in zip(tables, run.values, strict=False):
        assert np.array_equal(value, tables[name].evaluate(a, b))
        assert np.array_equal(
            run.outside[name],
            tables[name].outside(a, b) | (tables[name].outside(b, a) if name == "T0" else False),
        )
    assert np.array_equal(run.values[-1], tables["T0"].evaluate(b, a))


def test_blocks_of_points_are_the_same_points() -> None:
    """A prediction of many points is joined from blocks: values, and where which table is
    left."""
    table = Table("T", ("alpha",), (X / 10,), Y)
    database = AeroDatabase(
        "b",
        REFERENCE,
        tables={"T": table},
        terms=(Term("t", "CX", parse("T(alpha)*mach + q_hat")),),
    )
    n = 2 * BLOCK + 7
    alpha = np.linspace(-0.1, 0.3, n)
    whole = database.predict(
        {"alpha": alpha, "mach": 2.0, "q": np.full(n, 0.1), "V": np.array([50.0])}
    )
    assert whole.coefficients["CX"] == pytest.approx(
        table.evaluate(alpha) * 2 + 0.1 * 6 / 100, rel=1e-13
    )
    assert np.array_equal(whole.outside_tables["T"], table.outside(alpha))
    assert np.array_equal(whole.outside, table.outside(alpha))


def test_variables_are_evaluated_by_name() -> None:
    variables = {"x": Variable(parse("2*alpha")), "y": Variable(parse("x + p_hat"))}
    database = AeroDatabase(
        "v", REFERENCE, variables, terms=(Term("t", "CX", parse("x")), Term("s", "CY", parse("y")))
    )
    found = database.predict({"alpha": np.array([0.1, 0.2]), "p": 1.0, "V": 10.0}).coefficients
    assert found["CX"] == pytest.approx([0.2, 0.4])
    assert found["CY"] == pytest.approx([0.2 + 0.174, 0.4 + 0.174])
    with pytest.raises(InputError, match="channels missing: V, p"):
        database.predict({"alpha": 0.1})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("additive", "gaussian", (1.0,)), "'gaussian'"),
        (("relative", "normal", (1.0,)), "'relative'"),
        (("additive", "normal", (1.0, 2.0)), "with 2 bounds"),
        (("additive", "uniform", (1.0,), 1.0, ("x",)), "uniform uncertainty with correlations"),
        (("additive", "normal", (np.nan,)), "not finite"),
        (("additive", "normal", (1.0,), 1.0, (), (("x", 1.5),)), "beyond -1 to 1"),
    ],
)
def test_uncertainty_that_is_none_is_refused(arguments: tuple[object, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Uncertainty(*arguments)  # type: ignore[arg-type]


def test_a_bound_needs_its_variable() -> None:
    doubt = Uncertainty("additive", "normal", ("nobody",))
    with pytest.raises(InputError, match="no variable 'nobody'"):
        AeroDatabase(
            "v",
            REFERENCE,
            {"x": Variable(parse("1"), uncertainty=doubt)},
            terms=(Term("t", "CX", parse("x")),),
        )
