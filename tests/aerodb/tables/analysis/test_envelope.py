"""Beyond the envelope of an increment where the database has nothing else: slopes continue by a
stated margin, and are then held."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange.native import database_content_sha256, from_document, read_native, to_document
from aerodb.tables.analysis.consolidation import consolidate
from aerodb.tables.analysis.envelope import continued
from aerodb.tables.database import AeroDatabase
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment, Interval

REFERENCE = """
name = "base"
[reference]
area = 10.0
chord = 2.0
span = 8.0
moment_reference = [0.0, 0.0, 0.0]
"""
#: Constants alone, and a database that lacks the normal force.
EMPTY = REFERENCE + '[derivatives.CZ]\n"1" = -0.2\n'
PARTIAL = REFERENCE + "[derivatives.Cn]\nbeta = 0.08\n"
DEG = np.pi / 180.0


def lift(terms: tuple[str, ...] = ("1", "alpha"), axis: str = "CZ") -> Increment:
    """Values -.4, -6, ... , flown from 1 to 3 deg, with a cell of 2 deg."""
    k = len(terms)
    return Increment(
        axis,
        tuple(parse(term) for term in terms),
        np.array([-0.4, -6.0, 20.0, 5.0][:k]),
        np.diag([1e-4, 1e-2, 1e-2, 1e-2][:k]),
        {"alpha": Interval(1 * DEG, 3 * DEG, 2 * DEG), "beta": Interval(0.1, 0.2, 0.1)},
        ("f",),
    )


def added(text: str, increment: Increment) -> AeroDatabase:
    database = read_native(text)
    return replace(database, increments=(continued(increment, database),))


def at(alpha: float, beta: float = 0.15) -> dict[str, np.ndarray]:
    return {"alpha": np.array([alpha]), "beta": np.array([beta])}


@pytest.mark.parametrize("text", [EMPTY, PARTIAL])
def test_where_a_database_has_nothing_slopes_continue_and_are_then_held(text: str) -> None:
    """By hand: two cells beyond 3 deg are 7 deg. The uncertainty is that of the estimates and, as
    one standard error, what straight continuation adds to the value at the envelope's edge."""
    database = added(text, lift())
    (increment,) = database.increments
    assert dict(increment.margins or {}) == {"alpha": pytest.approx(4 * DEG)}
    for alpha, acting in ((2.0, 2.0), (6.0, 6.0), (7.0, 7.0), (12.0, 7.0), (-20.0, -3.0)):
        result = increment.evaluate(at(alpha * DEG))
        assert result.value[0] == pytest.approx(-0.4 - 6.0 * acting * DEG)
        edge = min(max(alpha, 1.0), 3.0)
        variance = 1e-4 + 1e-2 * (acting * DEG) ** 2 + (6.0 * (alpha - edge) * DEG) ** 2
        assert result.standard_error[0] == pytest.approx(np.sqrt(variance))
        assert result.inside[0] == (1.0 <= alpha <= 3.0)
    # sideslip beyond its envelope takes nothing from a force that does not depend on it
    assert increment.evaluate(at(2 * DEG, 1.5)).value[0] == pytest.approx(-0.4 - 12.0 * DEG)


def test_a_margin_in_a_flow_angle_is_at_most_five_degrees() -> None:
    wide = replace(lift(), envelope={"alpha": Interval(0.0, 0.2, 0.2)})
    margins = continued(wide, read_native(EMPTY)).margins
    assert margins == {"alpha": pytest.approx(5 * DEG, rel=1e-3)}


@pytest.mark.parametrize(
    ("terms", "margin"),
    [
        (("1", "alpha", "alpha*alpha"), 0.0),
        (("1", "alpha", "max(alpha - 0.04, 0)"), 4.0),  # bends among the data: 2.3 deg
        (("1", "alpha", "max(alpha - 0.08, 0)"), 0.0),  # bends beyond them: 4.6 deg
        (("1", "alpha", "alpha*beta"), 4.0),
        (("1", "alpha", "sin(alpha)"), 0.0),
    ],
)
def test_what_is_not_linear_beyond_the_data_is_held_at_their_edge(terms, margin) -> None:
    increment = continued(lift(terms), read_native(EMPTY))
    assert increment.margins is not None
    assert increment.margins["alpha"] == pytest.approx(margin * DEG)
    edge = increment.evaluate(at((3.0 + margin) * DEG)).value
    assert increment.evaluate(at(60 * DEG)).value == pytest.approx(edge)


@pytest.mark.parametrize(
    "text",
    [
        REFERENCE + "[derivatives.CZ]\nalpha = -4.0\n",
        REFERENCE + "[derivatives.CZ]\nq_hat = -4.0\n",
        REFERENCE + '[derivatives.C_lift]\n"1" = 0.3\n',  # turns with alpha in body axes
    ],
)
def test_beside_anything_else_on_the_axis_an_increment_fades_as_before(text: str) -> None:
    increment = lift()
    assert continued(increment, read_native(text)) is increment
    assert increment.evaluate(at(20 * DEG)).value[0] == 0.0
    # a second increment is beside the first
    assert continued(increment, added(EMPTY, increment)).margins is None


def test_margins_are_stored_protected_and_never_folded_into_a_table() -> None:
    database = added(EMPTY, lift())
    again = from_document(to_document(database))
    assert again.increments[0].margins == database.increments[0].margins
    other = replace(database.increments[0], margins={"alpha": 0.01})
    changed = replace(database, increments=(other,))
    assert database_content_sha256(changed) != database_content_sha256(database)
    assert consolidate(database).increments[0].folded == ("", "")
    assert (
        "margins"
        not in to_document(replace(database, increments=(replace(other, margins=None),)))[
            "increments"
        ][0]
    )
    with pytest.raises(InputError, match="margin of -1 beyond the flown range of alpha"):
        replace(other, margins={"alpha": -1.0})
