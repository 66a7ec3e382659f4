"""Every aerodynamic template: its column against a formula written again, its size recovered,
nothing found where nothing is."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from importlib.resources import files

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from aerodb.coefficients.comparison import Comparison, compare
from aerodb.coefficients.total import total_coefficients
from aerodb.effects.adding import add_effects, envelopes_of
from aerodb.effects.aerodynamic import with_lagged
from aerodb.effects.flight_view import FlightView, view_of
from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.library import AERODYNAMIC, hypotheses_for
from aerodb.errors import InputError
from aerodb.exchange.native import read_native
from aerodb.flight import Flight
from aerodb.nomenclature import AXES
from aerodb.support.arrays import Array
from aerodb.tables.analysis.consolidation import consolidate
from aerodb.tables.analysis.evaluation import evaluate_database
from aerodb.tables.database import AeroDatabase, Term
from aerodb.tables.expression import parse
from aerodb.tables.reference import ReferenceGeometry
from aerodb.vehicle import Vehicle, add_combinations, parse_vehicle
from aerodb.vehicle.probe import air_data_at_cg
from tests.support import effect_flights
from tests.support.single_terms import of_term
from tests.support.synthetic import smooth_noise

NOISE = {"CX": 0.002, "CY": 0.002, "CZ": 0.006, "Cl": 0.0005, "Cm": 0.001, "Cn": 0.0005}
AREA, CHORD, SPAN = effect_flights.AREA, effect_flights.CHORD, effect_flights.SPAN


def _comparison(flight: Flight) -> Comparison:
    """One that says that every sample is usable: what a view needs of it."""
    n = len(flight.time)
    none, good = dict.fromkeys(AXES, np.zeros(n)), dict.fromkeys(AXES, np.ones(n, dtype=bool))
    return Comparison(
        flight.id, flight.time, none, none, none, good, np.zeros(n, dtype=bool), None, ()
    )


@cache
def _taxi(wind: bool) -> tuple[FlightView, tuple[Hypothesis, ...]]:
    database, vehicle = effect_flights.database(wind), effect_flights.vehicle()
    flight = effect_flights.flown(5, database)
    view = view_of(flight, _comparison(flight), database, vehicle)
    library = hypotheses_for(database, vehicle, flight.channels)
    return view, tuple(item for item in library if _without_memory(item))


def _phoenix_files() -> tuple[AeroDatabase, Vehicle]:
    root = files("aerodb.examples.phoenix")
    return read_native((root / "preflight.toml").read_text()), parse_vehicle(
        (root / "vehicle.toml").read_text()
    )


@cache
def _phoenix() -> tuple[FlightView, tuple[Hypothesis, ...]]:
    database, vehicle = _phoenix_files()
    rng, n = np.random.default_rng(8), 1500
    sizes = {
        "V": (4.0, 80.0),
        "alpha": (0.05, 0.1),
        "beta": (0.04, 0.0),
        "p": (0.2, 0.0),
        "q": (0.1, 0.0),
        "r": (0.1, 0.0),
    }
    sizes |= {
        "qbar": (300.0, 3800.0),
        "mach": (0.02, 0.24),
        "height_above_ground": (0.8, 4.0),
        "ax": (1, 0),
        "ay": (1, 0),
    }
    sizes |= {f"delta_{name}": (0.08, 0.0) for name in (*vehicle.surfaces, *vehicle.combinations)}
    channels = {
        name: mean + smooth_noise(rng, n, 0.6, size) for name, (size, mean) in sizes.items()
    }
    flight = Flight("phoenix", "phoenix", np.arange(n) / 25.0, {**channels, "az": channels["ax"]})
    view = view_of(flight, _comparison(flight), database, vehicle)
    library = hypotheses_for(database, vehicle, flight.channels)
    return view, tuple(item for item in library if _without_memory(item))


def _near_ground(c: Mapping[str, Array]) -> Array:
    return np.exp(-2.48 * (2 * np.clip(c["height_above_ground"], 0, None) / SPAN) ** 0.768)


def _dihedral_that_is_even(c: Mapping[str, Array]) -> Array:
    """The even part of the table Clb of `effect_flights`, worked out by hand: rows over |beta|,
    columns over alpha."""
    even = np.array([[0, 0], [0.5e-3, -0.5e-3], [-0.5e-3, 0.5e-3], [0, 2e-3]])
    share = np.clip(c["alpha"] / np.deg2rad(10), 0, 1)
    low, high = (
        np.interp(np.abs(c["beta"]), np.deg2rad([0, 5, 10, 20]), even[:, k]) for k in (0, 1)
    )
    return (1 - share) * low + share * high


def _behind(c: Mapping[str, Array], chords: float) -> Array:
    """How far the angle of attack of the lift is behind: its equation, solved numerically."""

    def rate(time: float, lagged: Array) -> Array:
        alpha, v = (np.interp(time, c["time"], c[name]) for name in ("alpha", "V"))
        return np.asarray((alpha - lagged) * v / (chords * CHORD))

    t, first = c["time"], c["alpha"][:1]
    solved = solve_ivp(rate, t[[0, -1]], first, t_eval=t, max_step=0.02, rtol=1e-8, atol=1e-10)
    return np.asarray(solved.y[0] - c["alpha"])


def _from_zero_lift(c: Mapping[str, Array], wind: bool) -> Array:
    """Alpha less the angle at which the table `lift` (and with it, on body axes, a little axial
    force) gives no lift."""
    return c["alpha"] - (np.deg2rad(-4) if wind else brentq(_lift_on_body_axes, -0.1, 0.0))


def _lift_table(alpha: Array | float) -> Array:
    points = np.deg2rad([-8, -4, 0, 4, 8, 12, 16])
    return np.asarray(np.interp(alpha, points, [-0.4, 0.0, 0.4, 0.78, 1.14, 1.47, 1.75]))


def _lift_on_body_axes(alpha: float) -> float:
    table = float(_lift_table(alpha))
    return table * np.cos(alpha) + (-0.03 + 0.2 * table * alpha) * np.sin(alpha)


#: effect -> its column on its own axis; channels, subject and axis are given.
FORMULAS: dict[str, Callable[[Mapping[str, Array], str, str], Array]] = {
    "zero_offset": lambda c, s, a: np.ones_like(c["alpha"]),
    "alpha_slope": lambda c, s, a: c["alpha"],
    "alpha_slope_break": lambda c, s, a: np.where(
        c["alpha"] > float(s), c["alpha"] - float(s), 0.0
    ),
    "lift_scale": lambda c, s, a: c["curve"],
    "beta_slope": lambda c, s, a: c["beta"],
    "beta_even": lambda c, s, a: np.abs(c["beta"]),
    "table_sign": lambda c, s, a: _dihedral_that_is_even(c),
    "sideslip_coupling": lambda c, s, a: (
        np.abs(c["beta"]) if a in ("CX", "CZ", "Cm") else c["alpha"] * c["beta"]
    ),
    "pitch_rate_force": lambda c, s, a: c["q"] * CHORD / (2 * c["V"]),
    "pitch_damping": lambda c, s, a: c["q"] * CHORD / (2 * c["V"]),
    "alpha_dot": lambda c, s, a: c["alphadot"] * CHORD / (2 * c["V"]),
    "lift_lag": lambda c, s, a: _behind(c, float(s.partition("_")[0])),
    "roll_damping": lambda c, s, a: c["p"] * SPAN / (2 * c["V"]),
    "yaw_damping": lambda c, s, a: c["r"] * SPAN / (2 * c["V"]),
    "cross_rate": lambda c, s, a: c[s] * SPAN / (2 * c["V"]),
    "control_effectiveness": lambda c, s, a: c[f"delta_{s}"],
    "control_nonlinearity": lambda c, s, a: c[f"delta_{s}"] ** 3,
    "control_one_sided": lambda c, s, a: (
        np.maximum(c[f"delta_{s.partition('_')[2]}"], 0.0)
        if s.startswith("positive")
        else np.minimum(c[f"delta_{s.partition('_')[2]}"], 0.0)
    ),
    "control_alpha_coupling": lambda c, s, a: c["alpha"] * c[f"delta_{s}"],
    "surface_asymmetry": lambda c, s, a: c[f"delta_{s}"],
    "speed_brake": lambda c, s, a: c["delta_speed_brake"],
    "body_flap": lambda c, s, a: c["delta_body_flap"],
    "flap": lambda c, s, a: c["delta_flap"],
    "landing_gear": lambda c, s, a: c["delta_landing_gear"],
    "landing_gear_beta": lambda c, s, a: (
        c["delta_landing_gear"] * (np.abs(c["beta"]) if a == "CZ" else c["beta"])
    ),
    "ground_effect": lambda c, s, a: _near_ground(c) * c["lifting"] ** (2 if a == "CX" else 1),
    "thrust_effect": lambda c, s, a: c["thrust"] / (c["qbar"] * AREA),
    "mach_effect": lambda c, s, a: c["lifting"] * c["mach"] ** 2,
    "dynamic_pressure_effect": lambda c, s, a: c["lifting"] * c["qbar"],
}
#: Effects on lift: their angle of zero lift is rounded to 1e-4 rad, their curve kept to .1 %, and
#: their lag is that of the mean airspeed of two samples.
OF_LIFT = ("lift_lag", "ground_effect", "lift_scale", "mach_effect", "dynamic_pressure_effect")
BODY_OF = {"C_drag": "CX", "C_side": "CY", "C_lift": "CZ"}


def _expected(hypothesis: Hypothesis, c: Mapping[str, Array]) -> dict[str, Array]:
    """The columns by the formulas above; unit vectors of drag, side force and lift in body axes."""
    ((axis, _),) = hypothesis.increment
    column = FORMULAS[hypothesis.effect](c, hypothesis.subject, BODY_OF.get(axis, axis))
    if axis not in BODY_OF:
        return {axis: column}
    ca, sa, cb, sb = np.cos(c["alpha"]), np.sin(c["alpha"]), np.cos(c["beta"]), np.sin(c["beta"])
    unit = {
        "C_drag": (-ca * cb, -sb, -sa * cb),
        "C_side": (-ca * sb, cb, -sa * sb),
        "C_lift": (sa, 0 * sa, -ca),
    }[axis]
    return {body: column * part for body, part in zip(("CX", "CY", "CZ"), unit, strict=True)}


def _cases() -> list[tuple[bool, str]]:
    names, vehicle = effect_flights.channel_names(), effect_flights.vehicle()
    libraries = {
        wind: hypotheses_for(effect_flights.database(wind), vehicle, names)
        for wind in (False, True)
    }
    return [
        (wind, item.id)
        for wind, library in libraries.items()
        for item in library
        if _without_memory(item)
    ]


def _without_memory(hypothesis: Hypothesis) -> bool:
    """Whether it is aerodynamic and no stall: that has tests of its own."""
    return hypothesis.kind == "aerodynamic" and hypothesis.effect != "stall_hysteresis"


def _case(wind: bool, name: str) -> tuple[FlightView, Hypothesis]:
    view, library = _taxi(wind)
    return view, next(item for item in library if item.id == name)


def _estimate(
    hypothesis: Hypothesis, view: FlightView, residual: Mapping[str, Array]
) -> tuple[float, float]:
    """Least squares of one hypothesis on all its axes, beside a constant per axis, and its standard
    error."""
    columns = hypothesis.columns(view)
    x, y = [], []
    for axis in hypothesis.axes:
        free = hypothesis.effect != "zero_offset"
        x.append((columns[axis] - free * columns[axis].mean()) / NOISE[axis])
        y.append((residual[axis] - free * residual[axis].mean()) / NOISE[axis])
    design, response = np.concatenate(x), np.concatenate(y)
    return float(design @ response / (design @ design)), float(1 / np.sqrt(design @ design))


@pytest.mark.parametrize(("wind", "name"), _cases())
def test_column_is_the_formula_and_its_size_is_recovered(wind: bool, name: str) -> None:
    view, hypothesis = _case(wind, name)
    lifting = _from_zero_lift(view.channels, wind)
    channels = {**view.channels, "time": view.time, "lifting": lifting}
    channels["curve"] = (1 if wind else -1) * (_lift_table(view.channels["alpha"]) - 0.4)
    columns, expected = hypothesis.columns(view), _expected(hypothesis, channels)
    assert (
        set(columns)
        == set(hypothesis.axes)
        >= {axis for axis, part in expected.items() if np.any(part)}
    )
    for axis in columns:
        close = 1e-3 if hypothesis.effect in OF_LIFT else 1e-9
        assert np.allclose(
            columns[axis],
            expected[axis],
            rtol=0,
            atol=close * np.max(np.abs(columns[axis])) + 1e-15,
        )
    rng = np.random.default_rng(sum(name.encode()))
    constant = (
        0.0 if hypothesis.effect == "zero_offset" else 1.0
    )  # a flight's own constant is what it cannot be told from
    noise = {
        a: NOISE[a] * (rng.standard_normal(len(view.time)) + constant * rng.standard_normal())
        for a in hypothesis.axes
    }
    nothing, error = _estimate(hypothesis, view, noise)
    assert abs(nothing) < 4.5 * error
    size = 60.0 * error  # twice the noise with 800 samples
    found, _ = _estimate(
        hypothesis, view, {axis: size * expected[axis] + noise[axis] for axis in hypothesis.axes}
    )
    assert found == pytest.approx(size, rel=0.1)


@pytest.mark.parametrize("aircraft", ["body", "wind", "phoenix"])
def test_what_is_added_is_the_column_times_the_value_inside_the_envelope(aircraft: str) -> None:
    view, library = _phoenix() if aircraft == "phoenix" else _taxi(aircraft == "wind")
    database = view.database
    before = {
        axis: values.copy()
        for axis, values in evaluate_database(database, view.channels).value.items()
    }
    for number, hypothesis in enumerate(library):
        value = np.array([(-1) ** number * 0.3 * hypothesis.plausible[1] or -1.0])
        covariance = np.array([[(0.01 * value[0]) ** 2]])
        envelopes = envelopes_of([hypothesis], [view], database)
        candidate = add_effects(database, [hypothesis], value, covariance, envelopes, [view.flight])
        channels = with_lagged(view, [hypothesis]).channels
        after, columns = evaluate_database(candidate, channels), hypothesis.columns(view)
        for axis in AXES:
            share = value[0] * columns[axis] if axis in columns else 0.0
            assert np.allclose(
                after.value[axis], before[axis] + share, rtol=0, atol=1e-12 + 1e-10 * abs(value[0])
            ), hypothesis.id
        assert candidate.increments[-1].flights == (view.flight,)


def test_several_effects_keep_their_joint_covariance_on_an_axis() -> None:
    view, library = _taxi(False)
    by_id = {item.id: item for item in library}
    names = ["alpha_slope@CZ", "pitch_damping@Cm", "pitch_rate_force@CZ"]
    accepted = [by_id[name] for name in names]
    root = np.array([[0.1, 0.0, 0.0], [0.2, 0.5, 0.0], [-0.3, 0.1, 0.4]])
    covariance, values = root @ root.T, np.array([0.2, -1.0, 3.0])
    envelopes = envelopes_of(accepted, [view], view.database)
    candidate = add_effects(view.database, accepted, values, covariance, envelopes, ["a", "b"])
    lift, pitch = candidate.increments
    assert (lift.axis, pitch.axis) == ("CZ", "Cm")
    assert np.array_equal(lift.covariance, covariance[np.ix_([0, 2], [0, 2])])
    assert np.array_equal(pitch.covariance, covariance[1:2, 1:2])
    at = {name: np.array([values[600]]) for name, values in view.channels.items()}
    column = np.array([at["alpha"][0], at["q_hat"][0]])
    assert evaluate_database(candidate, at).standard_error["CZ"][0] == pytest.approx(
        np.sqrt(column @ lift.covariance @ column)
    )


def test_a_table_of_the_wrong_symmetry_is_taken_out_on_its_own_nodes() -> None:
    """DHC6.xml in small: Cl over sideslip lost its sign. k = -1 leaves no even part; the increment
    is exact as a table."""
    view, library = _taxi(False)
    hypothesis = next(item for item in library if item.effect == "table_sign")
    envelopes = envelopes_of([hypothesis], [view], view.database)
    candidate = add_effects(
        view.database, [hypothesis], np.array([-1.0]), np.array([[1e-4]]), envelopes, ["f"]
    )
    increment = candidate.increments[0]
    mirrored = {**view.channels, "beta": -view["beta"]}
    low, high = increment.envelope["beta"].low, increment.envelope["beta"].high
    inside = (-view["beta"] > low) & (-view["beta"] < high)
    both = [
        of_term(candidate, "dihedral", c)["Cl"] + increment.value(c)
        for c in (view.channels, mirrored)
    ]
    assert np.max(np.abs(both[0] + both[1])[inside]) < 1e-12
    assert np.max(np.abs(both[0])) > 0.003
    folded = consolidate(candidate)
    assert not folded.increments[0].acts_as_layer
    one, other = (each.predict(view.channels).coefficients["Cl"] for each in (candidate, folded))
    assert np.allclose(other, one, atol=1e-14)


def test_a_table_of_the_right_symmetry_can_only_have_its_sign_wrong() -> None:
    database = effect_flights.database()
    table = database.tables["Clb"]
    odd = replace(table, values=0.5 * (table.values - table.values[::-1]))
    fixed = replace(database, tables={**database.tables, "Clb": odd})
    (found,) = (
        item
        for item in hypotheses_for(fixed, effect_flights.vehicle(), fixed.inputs)
        if item.effect == "table_sign"
    )
    assert found.plausible == (-2.5, -1.5)
    view, _ = _taxi(False)
    assert np.allclose(
        found.columns(view)["Cl"], odd.evaluate(view["beta"], view["alpha"]), atol=1e-15
    )


@pytest.mark.parametrize(
    ("name", "term"),
    [
        ("pitch_rate_force@CX", ("CX", "-4.0*q_hat", -4.0)),
        ("beta_even@Cl", ("Cl", "0.03*abs(beta)", 0.03)),
        ("control_effectiveness@Cm:elevator", ("Cm", "0.15*delta_elevator", 0.15)),
        ("roll_damping@Cl", ("Cl", "0.1*p*b_ref/(2*V)", 0.1)),
    ],
)
def test_an_effect_that_flew_comes_back_through_the_whole_chain(
    name: str, term: tuple[str, str, float]
) -> None:
    """Flown with a term that the database lacks, logged off the CG, processed like any flight."""
    database, vehicle = effect_flights.database(), effect_flights.vehicle()
    axis, expression, value = term
    truth = replace(database, terms=(*database.terms, Term("undeclared", axis, parse(expression))))
    log = effect_flights.logged(effect_flights.flown(6, truth), vehicle)
    flight = add_combinations(air_data_at_cg(log, vehicle), vehicle)
    geometry = ReferenceGeometry(AREA, CHORD, SPAN, (0.0, 0.0, 0.0))
    compared = compare(flight, total_coefficients(flight, vehicle), database, geometry)
    view = view_of(flight, compared, database, vehicle)
    hypothesis = next(
        item for item in hypotheses_for(database, vehicle, flight.channels) if item.id == name
    )
    found, _ = _estimate(hypothesis, view, {a: compared.residual(a) for a in AXES})
    assert found == pytest.approx(value, rel=0.02)


def test_every_template_has_a_formula_here() -> None:
    names = {template.effect for template in AERODYNAMIC}
    assert names == {
        *FORMULAS,
        "stall_hysteresis",
        "parameter",
    }  # tests/aerodb/loop/test_parameters.py
    assert {item.effect for wind in (False, True) for item in _taxi(wind)[1]} >= set(FORMULAS)
    assert sorted((wind, item.id) for wind in (False, True) for item in _taxi(wind)[1]) == sorted(
        _cases()
    )


def test_sensors_and_shapes_without_expression_are_not_added() -> None:
    view, library = _taxi(False)
    everything = {
        item.id: item for item in hypotheses_for(view.database, view.vehicle, view.channels)
    }
    sensor, stall = everything["qbar_scale@all"], everything["stall_hysteresis@Cm"]
    with pytest.raises(InputError, match="not added to a database"):
        add_effects(view.database, [sensor], np.zeros(1), np.eye(1), {}, [])
    with pytest.raises(
        InputError, match=r"no state model that makes flow_attachment\n.*with_stall"
    ):
        add_effects(view.database, [stall], np.zeros(1), np.eye(1), {"Cm": {}}, [])
    with pytest.raises(InputError, match="no expression"):
        envelopes_of([replace(library[0], increment=())], [view], view.database)
    with pytest.raises(InputError, match="1 effects with values"):
        add_effects(view.database, [library[0]], np.zeros(2), np.eye(2), {}, [])


def test_a_flight_without_a_channel_gives_no_column() -> None:
    view, library = _taxi(False)
    blind = replace(
        view, channels={name: x for name, x in view.channels.items() if name != "thrust"}
    )
    thrust = next(item for item in library if item.effect == "thrust_effect")
    assert thrust.columns(view)
    assert thrust.columns(blind) == {}
    assert thrust.columns(replace(view, poor=frozenset({"thrust"}))) == {}
    with pytest.raises(InputError, match="no channel thrust"):
        envelopes_of([thrust], [blind], view.database)
