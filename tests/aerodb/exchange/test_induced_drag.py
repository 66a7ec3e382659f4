"""Drag that JSBSim files give as k CL^2: increments on the lift must reach it."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from aerodb.coefficients.comparison import Comparison, compare
from aerodb.coefficients.total import total_coefficients
from aerodb.effects.flight_view import view_of
from aerodb.effects.library import hypotheses_for
from aerodb.exchange.increment_terms import with_increments_as_terms
from aerodb.exchange.jsbsim.export import export_jsbsim
from aerodb.exchange.jsbsim.reader import import_jsbsim
from aerodb.exchange.native import from_document, to_document
from aerodb.flight import Flight
from aerodb.increments.estimate import estimate_increments
from aerodb.increments.model_file import DeclaredIncrement, ModelFile
from aerodb.nomenclature import AXES
from aerodb.support import Array
from aerodb.tables.analysis.sensitivity import slopes_by
from aerodb.tables.database import AeroDatabase
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment
from aerodb.tables.reference import body_to_wind
from tests.support.jsbsim_campaign import function_of, vehicle_of
from tests.support.jsbsim_cases import B737
from tests.support.jsbsim_flights import aircraft_file

MORE_LIFT = "0.4*alpha + 0.05*beta*delta_elevator"
RNG = np.random.default_rng(3)


def _database(lift: str = "") -> AeroDatabase:
    """The 737's, `lift` being part of the lift function of its own file."""
    root = ElementTree.fromstring(aircraft_file("737"))
    _, function = function_of(root, "aero/coefficient/CLde")
    if lift:
        product = function.find("product")
        assert product is not None
        for child in list(function):
            function.remove(child)
        total = ElementTree.SubElement(function, "sum")
        total.append(product)
        total.append(ElementTree.fromstring(lift))
    return import_jsbsim(ElementTree.tostring(root), bindings=B737.bindings, name="737")


#: MORE_LIFT as JSBSim writes it.
IN_THE_FILE = """<product><property>aero/qbar-psf</property><property>metrics/Sw-sqft</property><sum>
<product><value>0.4</value><property>aero/alpha-rad</property></product>
<product><value>0.05</value><property>aero/beta-rad</property><property>fcs/elevator-pos-rad</property></product>
</sum></product>"""


def _increment() -> Increment:
    return Increment("C_lift", (parse(MORE_LIFT),), np.array([1.0]), np.zeros((1, 1)))


def _corrected() -> AeroDatabase:
    baseline = _database()
    return replace(baseline, increments=(_increment(),))


def _channels(n: int = 200) -> dict[str, Array]:
    database = _database()
    channels = {name: RNG.uniform(-0.1, 0.1, n) for name in database.inputs}
    channels |= {"V": RNG.uniform(80.0, 150.0, n), "alpha": RNG.uniform(-0.05, 0.2, n)}
    channels |= {"mach": RNG.uniform(0.2, 0.5, n), "height_above_ground": np.full(n, 2000.0)}
    return channels


def test_a_corrected_lift_gives_the_drag_of_the_aircraft_that_has_this_lift() -> None:
    """The aircraft whose file holds the additional lift is the truth, on every axis."""
    channels = _channels()
    true, baseline = (
        each.predict(channels).coefficients for each in (_database(IN_THE_FILE), _database())
    )
    found = _corrected().predict(channels).coefficients
    for axis in AXES:
        assert np.allclose(found[axis], true[axis], atol=1e-12), axis
    drag = [
        body_to_wind(c["CX"], c["CY"], c["CZ"], channels["alpha"], channels["beta"])[0]
        for c in (true, baseline)
    ]
    assert np.abs(drag[0] - drag[1]).max() > 1e-3  # there is a drag to be induced


def test_without_increments_nothing_changes() -> None:
    channels = _channels()
    assert "C_lift_increments" not in _database().inputs
    fixed = replace(_corrected(), increments=())
    for axis, values in _database().predict(channels).coefficients.items():
        assert np.array_equal(fixed.predict(channels).coefficients[axis], values)


@pytest.mark.parametrize("variable", ["alpha", "beta", "delta_elevator"])
def test_slopes_of_the_corrected_database_are_those_of_the_true_one(variable: str) -> None:
    channels = _channels(50)
    found = slopes_by(_corrected(), variable, channels)
    expected = slopes_by(_database(IN_THE_FILE), variable, channels)
    for axis, values in expected.items():
        assert np.allclose(found[axis], values, atol=1e-9), axis


def test_documents_and_files_keep_the_drag() -> None:
    channels = _channels()
    expected = _corrected().predict(channels).coefficients
    read = from_document(to_document(_corrected()), "737")
    alone = replace(_increment(), induces_drag=False)
    document = to_document(replace(_corrected(), increments=(alone,)))
    assert from_document(document, "737").increments[0].induces_drag is False
    assert "induces_drag" not in to_document(_corrected())["increments"][0]
    written = import_jsbsim(export_jsbsim(_corrected(), name="b"), name="b")
    plain = with_increments_as_terms(_corrected())
    assert plain.increments == ()
    assert not plain.depends_on_lift_increments
    for database in (read, plain, written):
        found = database.predict(
            {**dict.fromkeys(database.inputs, np.zeros(200)), **channels}
        ).coefficients
        for axis in AXES:
            assert np.allclose(found[axis], expected[axis], atol=1e-9), axis
    bare = with_increments_as_terms(_database())
    assert not bare.depends_on_lift_increments


def _flight() -> tuple[Flight, Comparison]:
    """A flight of the true aircraft beside the baseline, forces without noise."""
    n = 400
    channels = _channels(n)
    channels |= {"qbar": 0.5 * 1.1 * channels["V"] ** 2, "rho": np.full(n, 1.1)}
    channels |= {name: np.zeros(n) for name in ("p", "q", "r", "thrust")}
    channels |= {"mass": np.full(n, 5e4), "Ixx": np.full(n, 1e6), "Iyy": np.full(n, 2e6)}
    channels |= {"Izz": np.full(n, 3e6), "Ixz": np.zeros(n)}
    channels |= dict(zip(("cg_x", "cg_y", "cg_z"), np.zeros((3, n)), strict=True))
    channels |= {f"a{axis}_imu": np.zeros(n) for axis in "xyz"}
    flight = Flight("f", "737", 0.04 * np.arange(n), channels)
    baseline = _database()
    vehicle = vehicle_of(B737, baseline)
    comparison = compare(flight, total_coefficients(flight, vehicle), baseline, vehicle.reference)
    truth = _database(IN_THE_FILE).predict(channels).coefficients
    measured = {axis: truth[axis] for axis in comparison.measured if axis in AXES}
    wind = body_to_wind(truth["CX"], truth["CY"], truth["CZ"], channels["alpha"], channels["beta"])
    measured |= dict(zip(("C_drag", "C_side", "C_lift"), wind, strict=True))
    return flight, replace(comparison, measured=measured)


def test_the_column_of_a_lift_effect_holds_the_drag_that_it_induces() -> None:
    """Against the change of the prediction by a small increment."""
    flight, comparison = _flight()
    database, vehicle = _corrected(), vehicle_of(B737, _database())
    view = view_of(flight, comparison, database, vehicle)
    (slope,) = (
        each
        for each in hypotheses_for(database, vehicle, flight.channels)
        if each.id == "alpha_slope@C_lift"
    )
    ((_, regressor),) = slope.increment
    small = Increment("C_lift", (regressor,), np.array([1e-4]), np.zeros((1, 1)))
    moved = replace(database, increments=(*database.increments, small))
    column = slope.columns(view)
    for axis in ("CX", "CZ"):
        change = moved.predict(view.channels).coefficients[axis] - view.predicted[axis]
        assert np.allclose(column[axis], change / 1e-4, atol=1e-4), axis


def test_declared_increments_do_not_count_the_induced_drag_twice() -> None:
    """A declared drag holds it; without one it comes with the lift, exactly."""
    flight, comparison = _flight()
    drag = DeclaredIncrement(axis="C_drag", terms=("1", "alpha", "alpha^2"))
    lift = DeclaredIncrement(axis="C_lift", terms=("alpha", "beta*delta_elevator"))
    found = {}
    for declared in ((lift,), (drag, lift)):
        update = estimate_increments(
            [flight], [comparison], ModelFile(increment=declared), _database()
        )
        assert update.axes[-1].estimates == pytest.approx([0.4, 0.05], abs=1e-6)
        after = update.candidate.predict(flight.channels).coefficients
        wind = body_to_wind(after["CX"], after["CY"], after["CZ"], flight["alpha"], flight["beta"])
        found[len(declared)] = float(np.std(comparison.measured["C_drag"] - wind[0]))
    before = float(np.std(comparison.residual("C_drag")))
    assert found[1] < 1e-6
    # What is left is what a parabola of alpha cannot represent.
    fit = np.polynomial.Polynomial.fit(flight["alpha"], comparison.residual("C_drag"), 2)
    left = float(np.std(comparison.residual("C_drag") - fit(flight["alpha"])))
    assert found[2] == pytest.approx(left, rel=1e-6)
    assert left < before
