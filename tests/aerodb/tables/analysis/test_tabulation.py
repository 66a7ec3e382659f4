"""Tables of a database: the errors of multilinear interpolation as they are known, and what stays."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.nomenclature import AXES
from aerodb.tables import AeroDatabase, ReferenceGeometry, Term, parse, tabulate
from tests.support.parts import aircraft


def database(**terms: str) -> AeroDatabase:
    return AeroDatabase(
        "made",
        ReferenceGeometry(10.0, 1.0, 8.0, (0.0, 0.0, 0.0)),
        terms=tuple(Term(f"term {axis}", axis, parse(text)) for axis, text in terms.items()),
    )


def test_the_error_of_a_parabola_is_that_of_linear_interpolation() -> None:
    """c h^2/4 at most, in the middle of a cell, for c x^2 between nodes h apart."""
    made = tabulate(database(Cm="3*alpha^2"), {"alpha": np.linspace(-0.2, 0.2, 9)}, {})
    assert made.errors["Cm"].largest == pytest.approx(3 * 0.05**2 / 4, rel=1e-6)
    finer = tabulate(database(Cm="3*alpha^2"), {"alpha": np.linspace(-0.2, 0.2, 17)}, {})
    assert finer.errors["Cm"].largest == pytest.approx(made.errors["Cm"].largest / 4, rel=1e-6)


def test_what_is_multilinear_has_no_error() -> None:
    own = database(
        CZ="-0.3 - 5*alpha - 4*q_hat + 2*alpha*delta_elevator", Cl="-0.4*p_hat*(1 + alpha)"
    )
    over = {"alpha": np.linspace(-0.2, 0.3, 4), "delta_elevator": np.linspace(-0.3, 0.3, 2)}
    made = tabulate(own, over, {"V": 40.0})
    assert made.rates == ("p_hat", "q_hat")
    assert max(error.largest for error in made.errors.values()) < 1e-12
    rng = np.random.default_rng(3)
    x = {n: rng.uniform(-0.2, 0.2, 30) for n in ("alpha", "delta_elevator", "p", "q")} | {"V": 25.0}
    one, other = (each.predict(x).coefficients for each in (own, made.database))
    for axis in AXES:
        np.testing.assert_allclose(one[axis], other[axis], rtol=1e-9, atol=1e-12)


def test_an_aircraft_of_parts_becomes_tables_and_keeps_its_thrust() -> None:
    over = {"alpha": np.linspace(-0.1, 0.2, 13), "delta_elevator": np.linspace(-0.2, 0.2, 5)}
    made = tabulate(aircraft(), over, {"V": 55.0, "throttle": 0.6})
    assert made.kept == ("propeller_FX", "propeller_MY")
    assert made.held["V"] == 55.0
    assert made.held["delta_rudder"] == 0.0
    assert not made.database.parts
    rng = np.random.default_rng(5)
    x = {name: rng.uniform(-0.1, 0.2, 200) for name in over} | dict.fromkeys(("p", "q", "r"), 0.0)
    x |= {name: made.held[name] for name in ("V", "rho", "qbar", "throttle")}
    x |= dict.fromkeys(("beta", "delta_rudder", "delta_aileron"), 0.0)
    one, other = (each.predict(x).coefficients for each in (aircraft(), made.database))
    for axis in AXES:
        assert np.max(np.abs(one[axis] - other[axis])) <= made.errors[axis].largest + 1e-12, axis
        assert made.errors[axis].rms <= made.errors[axis].largest
    faster = made.database.predict({**x, "V": 70.0, "qbar": 2800.0}).coefficients["CX"]
    assert np.max(np.abs(faster - other["CX"])) > 0.01  # the thrust follows speed and throttle


@pytest.mark.parametrize(
    ("over", "at", "says"),
    [
        ({"alfa": np.array([0.0, 0.1])}, {"V": 50.0}, r"(?s)'alfa' is not an input.*alpha"),
        ({"alpha": np.array([0.0, 0.1])}, {}, "the airspeed is not stated"),
        ({"alpha": np.linspace(0, 1, 1001), "beta": np.linspace(0, 1, 1001)}, {"V": 50.0}, "1002001 nodes"),
        ({"alpha": np.array([0.0, 0.1]), "V": np.array([0.0, 20.0])}, {"throttle": 0.5}, "not finite at a node"),
    ],
)  # fmt: skip
def test_what_cannot_be_tabulated_is_said(
    over: dict[str, np.ndarray], at: dict[str, float], says: str
) -> None:
    with pytest.raises(InputError, match=says):
        tabulate(aircraft(), over, at)
