"""States with a rate expression: closed solutions everywhere that a database is used."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from aerodb.errors import InputError
from aerodb.exchange.daveml.export import export_daveml
from aerodb.exchange.native import from_document, read_native, to_document
from aerodb.simulation import Condition, flight_model, linear_model, simulate, trim
from aerodb.tables import AeroDatabase, slopes_along

HEAD = """\
name = "lagged"
[reference]
area = 12.0
chord = 1.3
span = 9.0
moment_reference = [0, 0, 0]
[free_inputs]
throttle = "0 to 1"
delta_elevator = "rad"
[parameters]
tau = { value = 0.4, unit = "s", bounds = [0.01, 5.0] }
"""
LAG = """
[states.power]
unit = "N"
initial = 10.0
rate = "(900*throttle - power)/tau"
description = "thrust after its lag"
[[terms]]
name = "thrust"
axis = "FX"
expression = "power"
[[terms]]
name = "drag"
axis = "CX"
expression = "-0.03"
[[terms]]
name = "lift"
axis = "CZ"
expression = "-0.3 - 4.5*alpha"
[[terms]]
name = "pitch"
axis = "Cm"
expression = "-0.6*alpha - 8*q_hat - 0.8*delta_elevator"
"""
MASSES = {"mass": 500.0, "Ixx": 700.0, "Iyy": 900.0, "Izz": 1400.0}


def lagged() -> AeroDatabase:
    return read_native(HEAD + LAG)


def test_a_state_is_stored_as_it_is_written() -> None:
    own = lagged()
    again = from_document(to_document(own))
    assert again.states == own.states
    assert to_document(again) == to_document(own)
    law = own.rates["power"]
    assert (str(law.rate), law.initial, law.unit) == ("(900*throttle - power)/tau", 10.0, "N")


def test_without_a_given_value_it_has_its_steady_one() -> None:
    own = lagged()
    x = {"V": 40.0, "alpha": 0.1, "q": 0.0, "qbar": 900.0, "delta_elevator": 0.0}
    throttle = np.array([0.2, 0.5, 0.9])
    found = own.predict({**x, "throttle": throttle}).coefficients["CX"]
    np.testing.assert_allclose(found, -0.03 + 900 * throttle / (900 * 12), rtol=1e-12)
    given = own.predict({**x, "throttle": throttle, "power": 55.0}).coefficients["CX"]
    np.testing.assert_allclose(given, -0.03 + 55 / (900 * 12), rtol=1e-12)
    assert set(own.flight_inputs) == {"V", "alpha", "q", "qbar", "delta_elevator", "throttle"}
    with pytest.raises(InputError, match="throttle"):
        own.predict(x)


def test_it_is_integrated_in_flight_and_along_a_flight() -> None:
    """A step of throttle: 900 u (1 - exp(-t/tau)), from either side."""
    own = lagged()
    time = np.arange(0.0, 4.001, 0.02)
    throttle = np.where(time > 1.0, 0.8, 0.3)
    # Linear between samples, so that the step is a ramp from 1.00 to 1.02 s.
    solved = solve_ivp(
        lambda t, y: (900 * np.interp(t, time, throttle) - y) / 0.4,
        (0.0, 4.0), [900 * 0.3], t_eval=time, rtol=1e-11, atol=1e-9, max_step=0.02,
    ).y[0]  # fmt: skip
    along = own.states_along(time, {"throttle": throttle})["power"]
    np.testing.assert_allclose(along, solved, rtol=2e-8)
    model = flight_model(own)
    start = {"V": 45.0, "altitude": 500.0, "alpha": 0.05, "power": 270.0}
    series = {**MASSES, "throttle": throttle, "delta_elevator": 0.0}
    run = simulate(model, time, start, series, parts=2)
    np.testing.assert_allclose(run.channels["power"][:, 0], solved, rtol=2e-8)
    begun = {name: value for name, value in start.items() if name != "power"}
    fresh = simulate(model, time, begun, series)
    assert fresh.channels["power"][0, 0] == 10.0
    slow = simulate(model, time, start, series, parameters={"tau": 0.8})
    assert slow.channels["power"][60, 0] < run.channels["power"][60, 0]


def test_a_trim_makes_the_rate_zero_and_the_linear_model_has_it() -> None:
    model = flight_model(lagged())
    found = trim(model, Condition(45.0, 500.0), MASSES, thrust="throttle")
    assert found.start["power"] == pytest.approx(900 * found.series["throttle"], rel=1e-9)
    linear = linear_model(found)
    row = linear.states.index("power")
    assert linear.A[row, row] == pytest.approx(-1 / 0.4, rel=1e-6)
    assert linear.B[row, linear.inputs.index("throttle")] == pytest.approx(900 / 0.4, rel=1e-6)
    u = linear.states.index("u")
    assert linear.A[u, row] == pytest.approx(1 / 500.0, rel=1e-6)


COUPLED = """
[states.inflow]
unit = "m/s"
initial = 5.0
rate = "3*(throttle*10 - inflow^2/(inflow + swirl))"
[states.swirl]
rate = "(0.2*inflow - swirl)/0.5"
[[terms]]
name = "a"
axis = "FX"
expression = "inflow + swirl"
"""


def test_coupled_states_settle_together() -> None:
    """inflow^2/(1.2 inflow) = 10 u: inflow = 12 u, swirl = 2.4 u."""
    own = read_native(HEAD + COUPLED)
    throttle = np.array([0.1, 0.4, 1.0])
    found = own.predict({"throttle": throttle, "qbar": 1.0}).coefficients["CX"] * 12.0
    np.testing.assert_allclose(found, 14.4 * throttle, rtol=1e-9)


def test_a_rate_without_a_zero_has_no_steady_value() -> None:
    own = read_native(HEAD + COUPLED.replace('"(0.2*inflow - swirl)/0.5"', '"1 + swirl^2"'))
    assert np.isnan(own.predict({"throttle": 0.5, "qbar": 1.0}).coefficients["CX"]).all()


def test_an_export_holds_the_steady_value_and_says_so() -> None:
    text = export_daveml(lagged())
    text = text.decode() if isinstance(text, bytes) else str(text)
    assert "its course is not in this file" in text
    with pytest.raises(InputError, match=r"states\.inflow rate"):
        export_daveml(read_native(HEAD + COUPLED))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "(900*throttle - power)/tau",
            "(900*trottle - power)/tau",
            "states.power rate: unknown name 'trottle'",
        ),
        ("(900*throttle - power)/tau", "(900*throttle - ", "states.power rate"),
        ("initial = 10.0", "initial = nan", "initial is nan"),
        ("[states.power]", "[states.alpha]", "name of a channel"),
        ('rate = "(900*throttle - power)/tau"', "", "a law or a rate"),
        ('unit = "N"', 'unt = "N"', "unt"),
    ],
)
def test_a_wrong_state_is_refused_with_its_place(old: str, new: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        read_native(HEAD + LAG.replace(old, new))


def test_slopes_along_a_flight_hold_what_a_state_makes_of_a_parameter() -> None:
    """A lag of one second of the gain k: after a ramp u = t, x = k (t - 1 + exp(-t))."""
    own = read_native(
        'name = "lag"\n[reference]\narea = 1.0\nchord = 1.0\nspan = 1.0\n'
        'moment_reference = [0.0, 0.0, 0.0]\n[free_inputs]\ncontrol = "1"\n'
        "[parameters]\ngain = { value = 2.0 }\n"
        '[states.lagged]\nrate = "gain*control - lagged"\n'
        '[[terms]]\nname = "pull"\naxis = "FX"\nexpression = "lagged"\n'
    )
    time = np.arange(500) * 0.01
    channels = {"control": time, "qbar": np.ones(500), "V": np.ones(500)}
    stale = {**channels, "lagged": np.zeros(500)}
    found = slopes_along(own, "gain", time, stale)["CX"]
    np.testing.assert_allclose(found, time - 1.0 + np.exp(-time), atol=1e-6)
