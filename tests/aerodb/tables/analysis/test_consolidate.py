"""Consolidation: increments folded into tables give the same results as layers, and every node can
be traced back to its flights."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodb.errors import InputError, UnknownNameError
from aerodb.exchange.native import from_document, to_document
from aerodb.nomenclature import AXES
from aerodb.support.identity import canonical_json
from aerodb.tables.analysis.consolidation import (
    consolidate,
    node_lineage,
    plan_consolidation,
    point_lineage,
)
from aerodb.tables.analysis.evaluation import evaluate_database
from aerodb.tables.analysis.multilinear import NotMultilinearError, breaks, merged
from aerodb.tables.database import AeroDatabase, Term, Variable
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment, Interval
from aerodb.tables.reference import ReferenceGeometry
from aerodb.tables.table import Table
from aerodb.tables.uncertainty import Uncertainty
from tests.support.generated_databases import equal, generated, points

REFERENCE = ReferenceGeometry(10.0, 2.0, 8.0, (0.0, 0.0, 0.0))
ALPHA = np.array([0.0, 0.1, 0.2, 0.3])
SLOPE = Increment(
    "CZ",
    (parse("alpha"),),
    np.array([2.0]),
    np.array([[0.25]]),
    {"alpha": Interval(0.05, 0.15, 0.1)},
    ("f1", "f2"),
)


def one_table(
    term: str = "CZ0(alpha)", increment: Increment = SLOPE, **variables: str
) -> AeroDatabase:
    return AeroDatabase(
        "one table",
        REFERENCE,
        {name: Variable(parse(text)) for name, text in variables.items()},
        {"CZ0": Table("CZ0", ("alpha",), (ALPHA,), np.array([1.0, 2.0, 4.0, 3.0]))},
        (Term("base", "CZ", parse(term)),),
        (increment,),
    )


def test_a_slope_folded_into_a_table_by_hand() -> None:
    """2 alpha between 0.05 and 0.15: held for a cell of 0.1, gone after another; the table is held
    beyond its own nodes."""
    folded = consolidate(one_table())
    table = folded.tables["CZ0"]
    assert table.breakpoints[0] == pytest.approx(
        [-0.15, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35], abs=1e-15
    )
    source = [1.0, 1.0, 1.0, 1.5, 2.0, 3.0, 4.0, 3.5, 3.0, 3.0]
    added = [0.0, 0.1, 0.1, 0.1, 0.2, 0.3, 0.3, 0.3, 0.15, 0.0]
    assert table.values == pytest.approx(np.add(source, added), abs=1e-14)
    assert table.extent == ((0.0, 0.3),)
    assert folded.increments[0].folded == ("CZ0",)
    alpha = np.array([-1.0, -0.1, 0.12, 0.32, 9.0])
    one, other = one_table().predict({"alpha": alpha}), folded.predict({"alpha": alpha})
    assert other.coefficients["CZ"] == pytest.approx(one.coefficients["CZ"], abs=1e-14)
    assert other.outside.tolist() == one.outside.tolist() == [True, True, False, True, True]
    assert equal(consolidate(folded), folded), "nothing is left to fold"


@settings(deadline=None, max_examples=120)
@given(st.integers(0, 2**32 - 1), st.integers(0, 3))
def test_layered_and_consolidated_give_the_same(seed: int, increments: int) -> None:
    """Values, standard errors, places, and which points are outside of which tables; through the
    stored document too."""
    layered = generated(seed, increments)
    folded = consolidate(layered)
    stored = from_document(json.loads(canonical_json(to_document(folded))))
    assert equal(stored, folded)
    assert equal(consolidate(folded), folded), "nothing is left to fold"
    channels = points(layered, seed)
    one, other = evaluate_database(layered, channels), evaluate_database(folded, channels)
    scale = 1.0 + sum(float(np.abs(i.estimates).sum()) for i in layered.increments)
    for axis in AXES:
        assert other.value[axis] == pytest.approx(one.value[axis], abs=1e-12 * scale)
        assert other.standard_error[axis] == pytest.approx(
            one.standard_error[axis], abs=1e-11 * scale, nan_ok=True
        )
        assert np.array_equal(other.place[axis], one.place[axis])
    assert np.array_equal(other.prediction.outside, one.prediction.outside)
    assert other.prediction.outside_tables.keys() == one.prediction.outside_tables.keys()


def test_generated_databases_fold_something_and_keep_something() -> None:
    """The property above is tested on databases where something is folded."""
    folds = [fold for seed in range(40) for fold in plan_consolidation(generated(seed))]
    folded = sum(bool(fold.table) for fold in folds)
    assert 0.1 < folded / len(folds) < 0.9
    assert all(bool(fold.table) != bool(fold.reason) for fold in folds)


def test_factors_and_signs_in_front_of_the_table() -> None:
    """CZ = -2 k CZ0(a): a share of the coefficient is divided by -2; with a factor, only what has
    that factor goes in."""
    minus = one_table("0.5 - 2*CZ0(a)", a="alpha")
    assert consolidate(minus).tables["CZ0"].values[4] == pytest.approx(2.0 - 0.1, abs=1e-14)
    geared = replace(SLOPE, regressors=(parse("alpha*delta_landing_gear"),))
    database = one_table("CZ0(alpha)*gear*3", geared, gear="delta_landing_gear")
    folded = consolidate(database)
    assert folded.increments[0].folded == ("CZ0",)
    assert folded.tables["CZ0"].values[4] == pytest.approx(2.0 + 0.2 / 3, abs=1e-14)
    channels = {"alpha": np.linspace(-0.3, 0.6, 91), "delta_landing_gear": 0.7}
    difference = (
        folded.predict(channels).coefficients["CZ"] - database.predict(channels).coefficients["CZ"]
    )
    assert np.max(np.abs(difference)) < 1e-14


def test_arguments_in_the_unit_of_the_source() -> None:
    """CZ0 over 0.3 - alpha, by way of a variable: the share's breakpoints and nodes are
    translated."""
    database = one_table("CZ0(shifted/1000)", shifted="-(1000*alpha - 300)")
    folded = consolidate(database)
    assert folded.increments[0].folded == ("CZ0",)
    channels = {"alpha": np.linspace(-0.5, 0.6, 221)}
    one, other = database.predict(channels), folded.predict(channels)
    assert other.coefficients["CZ"] == pytest.approx(one.coefficients["CZ"], abs=1e-13)
    node = int(np.argmin(np.abs(folded.tables["CZ0"].breakpoints[0] - 0.2)))
    (share,) = node_lineage(folded, "CZ0", (node,))
    assert share.value == pytest.approx(2.0 * 0.1), "argument 0.2 is alpha 0.1"


def test_a_fade_in_another_variable_becomes_an_axis() -> None:
    wide = replace(SLOPE, envelope={**SLOPE.envelope, "beta": Interval(-0.1, 0.1, 0.05)})
    folded = consolidate(one_table(increment=wide))
    assert folded.tables["CZ0"].arguments == ("alpha", "beta")
    assert folded.tables["CZ0"].breakpoints[1] == pytest.approx([-0.2, -0.15, 0.15, 0.2])
    assert str(folded.terms[0].expression) == "CZ0(alpha, beta)"
    assert not folded.predict({"alpha": 0.1, "beta": 3.0}).outside.any(), (
        "the source's table knows nothing of beta"
    )


@pytest.mark.parametrize(
    ("term", "change", "reason"),
    [
        ("CZ0(alpha)^2", {}, "no table on CZ over its variables enters linearly"),
        ("CZ0(alpha) + beta*CZ0(alpha + 1)", {}, "no table on CZ"),
        ("CZ0(2*alpha - alpha^2)", {}, "no table on CZ"),
        ("CZ0(max(alpha, 0))", {}, "no table on CZ"),
        ("CZ0(alpha*beta)", {}, "no table on CZ"),
        ("factor*CZ0(alpha)", {}, "no table on CZ"),
        ("CZ0(alpha)", {"axis": "CX"}, "no table on CX"),
        ("CZ0(alpha)", {"regressors": (parse("q_hat"),)}, "no table on CZ"),
        ("CZ0(alpha)", {"regressors": (parse("alpha^2"),)}, r"'alpha\^2' is not piecewise linear"),
        ("CZ0(alpha)", {"regressors": (parse("alpha*max(alpha, 0)"),)}, "is not linear in alpha"),
        ("CZ0(alpha)", {"regressors": (parse("step(alpha - 0.1)"),)}, "is not piecewise linear"),
        ("CZ0(alpha)", {"envelope": {}}, "has no flown range"),
        ("CZ0(alpha)", {"envelope": {"alpha": Interval(0.0, 0.1, 0.0)}}, "ends in a step"),
        (
            "CZ0(alpha)*beta",
            {
                "regressors": (parse("alpha*beta"),),
                "envelope": {**SLOPE.envelope, "beta": Interval(0.0, 1.0, 1.0)},
            },
            "the flown range over beta acts on a factor outside the table",
        ),
    ],
)
def test_what_cannot_be_folded_stays_a_layer_and_says_why(
    term: str, change: dict[str, object], reason: str
) -> None:
    database = one_table(term, replace(SLOPE, **change), factor="1.0")
    (fold,) = plan_consolidation(database)
    assert fold.table == ""
    assert re.search(reason, fold.reason), fold.reason
    folded = consolidate(database)
    assert folded.increments[0].folded == ("",)
    assert equal(folded.tables["CZ0"], database.tables["CZ0"])


@pytest.mark.parametrize(
    "change",
    [
        {"interpolation": ("floor",)},
        {"extrapolation": ("both",)},
        {"uncertainty": Uncertainty("percentage", "normal", (10.0,))},
    ],
)
def test_tables_that_are_no_plain_sum_of_hats_are_left_alone(change: dict[str, object]) -> None:
    database = one_table()
    table = replace(database.tables["CZ0"], **change)
    assert plan_consolidation(replace(database, tables={"CZ0": table}))[0].table == ""


def test_variables_on_the_way_to_a_table() -> None:
    """Followed where they pass the table on; not where they declare an uncertainty in proportion;
    never twice."""
    assert plan_consolidation(one_table("1 - lift/2", lift="CZ0(alpha) + 3"))[0].table == "CZ0"
    database = one_table("lift", lift="CZ0(alpha)")
    relative = Variable(
        parse("CZ0(alpha)"), uncertainty=Uncertainty("percentage", "normal", (10.0,))
    )
    assert plan_consolidation(replace(database, variables={"lift": relative}))[0].table == ""
    doubled = {f"x{k}": f"x{k - 1} + x{k - 1}" for k in range(1, 60)}
    for x0 in ("CZ0(alpha)", "alpha"):
        term = "x59" if "CZ0" in x0 else "CZ0(x59)"
        expected = "" if "CZ0" in x0 else "CZ0"
        assert plan_consolidation(one_table(term, x0=x0, **doubled))[0].table == expected


def test_added_uncertainty_per_node_follows_the_new_nodes() -> None:
    database = one_table()
    spread = Uncertainty("additive", "normal", ((0.1, 0.2, 0.4, 0.3),))
    layered = replace(database, tables={"CZ0": replace(database.tables["CZ0"], uncertainty=spread)})
    folded = consolidate(layered)
    assert folded.increments[0].folded == ("CZ0",)
    alpha = {"alpha": np.linspace(-0.5, 0.8, 131)}
    expected = evaluate_database(layered, alpha).standard_error["CZ"]
    assert evaluate_database(folded, alpha).standard_error["CZ"] == pytest.approx(
        expected, abs=1e-13
    )
    assert expected[0] == pytest.approx(np.hypot(0.1, 2.0 * 0.05), rel=1e-12), (
        "far away: the source's, and what has faded"
    )


def test_behind_a_node_stand_the_flights_that_changed_it() -> None:
    other = replace(
        SLOPE,
        estimates=np.array([-1.0]),
        envelope={"alpha": Interval(0.25, 0.3, 0.02)},
        flights=("f3",),
    )
    layered = replace(one_table(), increments=(SLOPE, other))
    folded = consolidate(layered)
    axis = folded.tables["CZ0"].breakpoints[0]

    def at(alpha: float) -> tuple[int]:
        return (int(np.argmin(np.abs(axis - alpha))),)

    (share,) = node_lineage(folded, "CZ0", at(0.1))
    assert (share.increment, share.axis, share.regressors, share.flights) == (
        0,
        "CZ",
        ("alpha",),
        ("f1", "f2"),
    )
    assert (share.value, share.standard_error) == pytest.approx((0.2, 0.05))
    one, two = node_lineage(folded, "CZ0", at(0.3))
    assert (one.value, one.standard_error, one.flights) == (
        pytest.approx(0.15),
        pytest.approx(0.0375),
        ("f1", "f2"),
    )
    assert (two.value, two.standard_error, two.flights) == (
        pytest.approx(-0.3),
        pytest.approx(0.15),
        ("f3",),
    )
    for k, alpha in enumerate(ALPHA):  # the layered database says the same of its own nodes
        mine, theirs = node_lineage(layered, "CZ0", (k,)), node_lineage(folded, "CZ0", at(alpha))
        assert [share.increment for share in mine] == [share.increment for share in theirs]
        for own, folded_share in zip(mine, theirs, strict=True):
            assert folded_share.value == pytest.approx(own.value, abs=1e-15)
            assert folded_share.standard_error == pytest.approx(own.standard_error, abs=1e-15)
    assert node_lineage(folded, "CZ0", at(-0.15)) == (), "there it has faded"
    assert [share.flights for share in point_lineage(layered, {"alpha": 0.1})] == [("f1", "f2")]


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_what_a_node_gained_is_the_sum_of_its_lineage(seed: int) -> None:
    layered = generated(seed, 2)
    folded = consolidate(layered)
    rng = np.random.default_rng(seed)
    for name, table in folded.tables.items():
        index = tuple(int(rng.integers(0, size)) for size in table.values.shape)
        at = [axis[k] for axis, k in zip(table.breakpoints, index, strict=True)]
        source = layered.tables[name].evaluate(
            *[float(x) for x in at[: layered.tables[name].values.ndim]]
        )[0]
        gained = sum(share.value for share in node_lineage(folded, name, index))
        assert table.values[index] - source == pytest.approx(gained, abs=1e-12)


def test_nodes_that_do_not_exist_are_refused() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'CZ0'"):
        node_lineage(one_table(), "CZO", (0,))
    for node in ((4,), (-1,), (0, 0)):
        with pytest.raises(InputError, match="table CZ0"):
            node_lineage(one_table(), "CZ0", node)


def test_breakpoints_of_expressions() -> None:
    ranges = {"alpha": (-1.0, 1.0), "beta": (-1.0, 1.0)}
    assert breaks(parse("clip(2*alpha - 0.5, 0, 1)*(beta - 1)"), ranges) == {
        "alpha": {0.25, 0.75},
        "beta": set(),
    }
    assert breaks(parse("max(abs(alpha), 0.5)"), ranges) == {"alpha": {-0.5, 0.0, 0.5}}
    assert breaks(parse("min(alpha, 3)"), ranges) == {"alpha": set()}
    for text in (
        "alpha/beta",
        "max(alpha, beta)",
        "sin(alpha)",
        "floor(alpha)",
        "alpha < 0.1",
        "2^alpha",
    ):
        with pytest.raises(NotMultilinearError):
            breaks(parse(text), ranges)
    assert merged(np.array([0.0, 0.1, 0.3]), {0.1 + 1e-17, 0.30000000000000004, 0.2}).tolist() == [
        0.0,
        0.1,
        0.2,
        0.3,
    ]
