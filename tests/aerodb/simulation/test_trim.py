"""Trim against closed formulas, planted truth, and flights that cannot be steady."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.physics import GRAVITY, standard_atmosphere
from aerodb.simulation import (
    Actuator,
    Condition,
    FlightModel,
    NoTrimError,
    Propulsion,
    flight_model,
    linear_model,
    modes,
    simulate,
    sweep,
    trim,
)
from aerodb.tables import AeroDatabase, Increment, ReferenceGeometry, StateModel, Term, parse
from aerodb.tables.state_model import GomanKhrabrov

AREA, CHORD, SPAN = 16.0, 1.5, 11.0
MASS = {"mass": 1100.0, "Ixx": 1300.0, "Iyy": 1900.0, "Izz": 2900.0, "Ixz": 60.0}
TERMS = {
    "C_lift": "0.25 + 4.8*alpha + 3.9*q_hat + 0.4*delta_elevator",
    "C_drag": "0.03 + 0.05*(0.25 + 4.8*alpha)*(0.25 + 4.8*alpha)",
    "C_side": "-0.35*beta + 0.15*delta_rudder",
    "Cm": "0.02 - 0.9*alpha - 14*q_hat - 1.2*delta_elevator",
    "Cl": "-0.09*beta - 0.48*p_hat + 0.1*r_hat - 0.18*delta_aileron + 0.01*delta_rudder",
    "Cn": "0.065*beta - 0.03*p_hat - 0.1*r_hat + 0.005*delta_aileron - 0.07*delta_rudder",
}
CRUISE = Condition(V=60.0, altitude=1000.0)
LIMITS = dict.fromkeys(("delta_elevator", "delta_aileron", "delta_rudder"), (-0.4, 0.4))


def database(increments: tuple[Increment, ...] = (), **terms: str) -> AeroDatabase:
    return AeroDatabase(
        name="light",
        reference=ReferenceGeometry(AREA, CHORD, SPAN, (0.0, 0.0, 0.0)),
        terms=tuple(Term(f"{axis}_all", axis, parse(t)) for axis, t in {**TERMS, **terms}.items()),
        increments=increments,
    )


@pytest.fixture(scope="module")
def model() -> FlightModel:
    return flight_model(database())


def test_level_flight_is_what_the_formulas_give(model: FlightModel) -> None:
    """Lift and thrust carry the weight, Cm = 0: alpha by Newton on the closed formulas."""
    found = trim(model, CRUISE, MASS)
    pressure = 0.5 * standard_atmosphere(np.array([1000.0])).density[0] * 60.0**2
    alpha = 0.0
    for _ in range(50):
        elevator = (0.02 - 0.9 * alpha) / 1.2
        lift = 0.25 + 4.8 * alpha + 0.4 * elevator
        drag = 0.03 + 0.05 * (0.25 + 4.8 * alpha) ** 2
        thrust = pressure * AREA * drag / np.cos(alpha)
        needed = (MASS["mass"] * GRAVITY - thrust * np.sin(alpha)) / (pressure * AREA)
        alpha += (needed - lift) / (4.8 - 0.4 * 0.9 / 1.2)
    assert found.channels["alpha"] == pytest.approx(alpha, abs=1e-9)
    assert found.channels["theta"] == pytest.approx(alpha, abs=1e-9)
    assert found.deflections["delta_elevator"] == pytest.approx(elevator, abs=1e-9)
    assert found.deflections["force_x"] == pytest.approx(thrust, rel=1e-8)
    assert found.channels["nz"] == pytest.approx(np.cos(alpha), rel=1e-6)
    assert found.standard_errors == {}


@pytest.mark.parametrize(
    "condition",
    [
        CRUISE,
        replace(CRUISE, climb=0.05),
        replace(CRUISE, climb=None),
        replace(CRUISE, bank=np.deg2rad(45.0)),
        replace(CRUISE, load_factor=1.5),
        replace(CRUISE, turn_rate=-0.1, climb=-0.05),
        replace(CRUISE, beta=0.1),
        replace(CRUISE, bank=0.1, turn_rate=0.0),
        replace(CRUISE, bank=0.3, beta=0.05),
    ],
    ids=("level", "climb", "glide", "bank", "load", "rate", "sideslip", "slip by bank", "skid"),
)
def test_a_trimmed_flight_stays_as_it_is(model: FlightModel, condition: Condition) -> None:
    found = trim(model, condition, MASS, limits=LIMITS)
    # A climb soon changes the density.
    seconds = 3.0 if condition.climb == 0.0 else 0.1
    time = np.arange(0.0, seconds + 1e-9, 0.01)
    flown = simulate(model, time, found.start, found.series)
    for name in ("V", "alpha", "beta", "p", "q", "r", "phi", "theta"):
        assert np.ptp(flown.channels[name]) < 1e-4, name
    path = np.arcsin(-flown.channels["velocity_down"][:, 0] / condition.V)
    assert path == pytest.approx(np.full(len(time), found.channels["climb"]), abs=1e-5)
    heading = np.unwrap(flown.channels["psi"][:, 0])
    assert (heading[-1] - heading[0]) / seconds == pytest.approx(
        found.channels["turn_rate"], abs=1e-5
    )
    if condition.load_factor is not None:
        assert found.channels["load_factor"] == pytest.approx(condition.load_factor, abs=1e-6)


def test_a_turn_is_as_banked_as_its_load_factor_says(model: FlightModel) -> None:
    """Without sideslip the side force is nearly none: tan phi = V Omega / g."""
    found = trim(model, replace(CRUISE, bank=np.deg2rad(45.0)), MASS)
    rate = GRAVITY * np.tan(np.deg2rad(45.0)) / 60.0
    assert found.channels["turn_rate"] == pytest.approx(rate, rel=0.02)
    assert found.channels["load_factor"] == pytest.approx(np.sqrt(2.0), rel=0.02)


def test_a_pull_up_curves_the_path_as_its_load_factor_says(model: FlightModel) -> None:
    found = trim(model, replace(CRUISE, load_factor=1.4, pull_up=True), MASS)
    assert found.channels["q"] == pytest.approx(0.4 * GRAVITY / 60.0, rel=1e-9)
    # With thrust along x, part of the load is the thrust's.
    assert found.channels["load_factor"] == pytest.approx(1.4, abs=1e-6)


def test_an_engine_trims_with_its_line_or_its_throttle() -> None:
    """Thrust 0.2 m above the CG and 3 deg up: moment and lift that the elevator answers; a throttle
    gives the same flight."""
    line = ((0.5, 0.0, -0.2), (np.cos(0.05), 0.0, -np.sin(0.05)))
    by_thrust = flight_model(database(), engines=[Propulsion(parse("thrust"), *line)])
    found = trim(by_thrust, CRUISE, MASS, thrust="thrust")
    by_throttle = flight_model(
        database(), engines=[Propulsion(parse("2500*throttle - 3*V"), *line)]
    )
    same = trim(by_throttle, CRUISE, MASS, thrust="throttle", limits={"throttle": (0.0, 1.0)})
    thrust = found.deflections["thrust"]
    assert 2500.0 * same.deflections["throttle"] - 180.0 == pytest.approx(thrust, rel=1e-6)
    for name in ("alpha", "theta"):
        assert same.channels[name] == pytest.approx(found.channels[name], abs=1e-8)
    bare = trim(flight_model(database()), CRUISE, MASS)
    moment = thrust * (-0.2 * np.cos(0.05) + 0.5 * np.sin(0.05))
    pressure = bare.channels["qbar"] * AREA * CHORD
    for each, arm in ((bare, 0.0), (found, moment)):
        total = 0.02 - 0.9 * each.channels["alpha"] - 1.2 * each.deflections["delta_elevator"]
        assert total * pressure + arm == pytest.approx(0.0, abs=1e-3)
    drag = linear_model(same).A[0, 0] - linear_model(found).A[0, 0]
    assert drag == pytest.approx(-3.0 * np.cos(0.05) / MASS["mass"], rel=1e-2)
    with pytest.raises(NoTrimError, match="throttle is at its upper limit, 1"):
        trim(by_throttle, replace(CRUISE, climb=0.3), MASS, thrust="throttle",
             limits={"throttle": (0.0, 1.0)})  # fmt: skip


def test_elevons_and_a_rudder_are_found_and_moved_together() -> None:
    terms = {
        axis: text.replace("delta_elevator", "(0.5*delta_right + 0.5*delta_left)").replace(
            "delta_aileron", "(0.5*delta_right - 0.5*delta_left)"
        )
        for axis, text in TERMS.items()
    }
    found = trim(flight_model(database(**terms)), replace(CRUISE, beta=0.1), MASS)
    single = trim(flight_model(database()), replace(CRUISE, beta=0.1), MASS)
    left, right = (found.deflections[f"delta_{side}"] for side in ("left", "right"))
    assert 0.5 * (right + left) == pytest.approx(single.deflections["delta_elevator"], abs=1e-8)
    assert 0.5 * (right - left) == pytest.approx(single.deflections["delta_aileron"], abs=1e-8)
    assert sorted(found.problem.controls) == [
        "delta_left + delta_right", "delta_left - delta_right", "delta_rudder"
    ]  # fmt: skip


def test_rudders_that_move_outwards_only_are_each_a_control() -> None:
    """Together they could not move; in straight flight both are at a limit, which is no reason."""
    both = "(0.5*delta_rudder_right + 0.5*delta_rudder_left)"
    terms = {axis: text.replace("delta_rudder", both) for axis, text in TERMS.items()}
    twin, limits = flight_model(database(**terms)), {
        "delta_rudder_right": (0.0, 0.5), "delta_rudder_left": (-0.5, 0.0)
    }  # fmt: skip
    level = trim(twin, replace(CRUISE, beta=0.0), MASS, limits=limits)
    assert max(abs(level.deflections[name]) for name in limits) < 1e-9
    single = trim(flight_model(database()), replace(CRUISE, beta=0.05), MASS)
    needed = 2.0 * single.deflections["delta_rudder"]
    (side,) = [n for n, (low, high) in limits.items() if low <= needed <= high]
    found = trim(twin, replace(CRUISE, beta=0.05), MASS, controls={"yaw": side}, limits=limits)
    assert found.deflections[side] == pytest.approx(needed, abs=1e-8)
    with pytest.raises(InputError, match="delta_rudder_left leave no common movement"):
        trim(twin, CRUISE, MASS, controls={"yaw": dict.fromkeys(limits, 1.0)}, limits=limits)


def test_a_surface_that_is_given_stays_and_is_no_control(model: FlightModel) -> None:
    flapped = flight_model(
        database(C_lift=TERMS["C_lift"] + " + 0.9*delta_flap", Cm=TERMS["Cm"] + " - 1.5*delta_flap")
    )
    found = trim(flapped, CRUISE, {**MASS, "delta_flap": 0.1})
    assert found.deflections["delta_flap"] == 0.1
    assert "delta_elevator" in found.problem.controls
    with pytest.raises(NoTrimError, match="too few controls: delta_aileron, delta_elevator"):
        trim(model, CRUISE, {**MASS, "delta_rudder": 0.1})


def test_named_controls_are_used(model: FlightModel) -> None:
    flapped = flight_model(database(Cm=TERMS["Cm"] + " - 1.5*delta_stabiliser"))
    for name in ("delta_elevator", "delta_stabiliser"):
        found = trim(flapped, CRUISE, MASS, controls={"pitch": name})
        assert found.deflections[name] != 0.0
        assert sum(value != 0.0 for value in found.deflections.values()) <= 4
    with pytest.raises(InputError, match="no input 'delta_elevtor'"):
        trim(model, CRUISE, MASS, controls={"pitch": "delta_elevtor"})


def test_where_no_flight_is_steady_the_surface_at_its_limit_is_named(model: FlightModel) -> None:
    with pytest.raises(
        NoTrimError, match=r"delta_rudder is at its upper limit, 2\.865 deg"
    ) as error:
        trim(model, replace(CRUISE, beta=0.2), MASS, limits={"delta_rudder": (-0.05, 0.05)})
    assert "deg/s2 in yaw" in error.value.what
    assert "V 60 m/s" in error.value.where
    with pytest.raises(NoTrimError, match="alpha is at its upper limit"):
        trim(model, replace(CRUISE, V=11.0), MASS)
    with pytest.raises(NoTrimError, match="force_x is at its lower limit, 0 N"):
        trim(model, replace(CRUISE, climb=-0.4), MASS)


def test_a_database_without_lateral_terms_trims_in_the_plane_of_symmetry() -> None:
    terms = tuple(t for t in database().terms if t.axis in ("C_lift", "C_drag", "Cm"))
    found = trim(flight_model(replace(database(), terms=terms)), CRUISE, MASS)
    assert found.channels["phi"] == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(NoTrimError, match="m/s2 along z"):
        trim(flight_model(replace(database(), terms=())), CRUISE, MASS)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"V": 0.0}, "no airspeed"),
        ({"altitude": np.nan}, "altitude is not finite"),
        ({"bank": 0.1, "beta": 0.1, "turn_rate": 0.1}, "bank, beta and turn_rate together"),
        ({"load_factor": 2.0, "bank": 0.1}, "the load factor and bank together"),
        ({"pull_up": True}, "without load factor"),
    ],
)
def test_contradictory_conditions_are_refused(wrong: dict[str, float], said: str) -> None:
    with pytest.raises(InputError, match=said):
        replace(CRUISE, **wrong)


def identified() -> AeroDatabase:
    """Increments with correlated estimates, a percent to ten of the derivatives."""

    def of(axis: str, regressors: str, estimates: list[float], errors: list[float]) -> Increment:
        k = len(estimates)
        shape = np.full((k, k), 0.3) + 0.7 * np.eye(k)
        covariance = np.outer(errors, errors) * shape
        return Increment(
            axis, tuple(parse(r) for r in regressors.split(";")), np.array(estimates), covariance
        )

    return database(
        (
            of("C_lift", "1;alpha", [0.01, 0.1], [0.004, 0.05]),
            of(
                "Cm",
                "1;alpha;q_hat;delta_elevator",
                [0.002, 0.05, -1, 0.05],
                [0.002, 0.02, 0.5, 0.03],
            ),
            of("Cl", "beta;p_hat", [0.005, 0.02], [0.003, 0.015]),
            of("Cn", "beta;r_hat", [0.002, -0.01], [0.002, 0.006]),
        )
    )


@pytest.mark.campaign
def test_standard_errors_are_the_scatter_over_parameter_sets() -> None:
    """Monte Carlo: each draw is a database of its own, trimmed and linearised anew."""
    condition = replace(CRUISE, bank=0.3)
    nominal = identified()
    found = trim(flight_model(nominal), condition, MASS)
    linear = linear_model(found)
    named = {mode.name: mode for mode in modes(linear)}
    rng = np.random.default_rng(5)
    draws: dict[str, list[float]] = {}
    for _ in range(400):
        drawn = replace(
            nominal,
            increments=tuple(
                replace(i, estimates=rng.multivariate_normal(i.estimates, i.covariance))
                for i in nominal.increments
            ),
        )
        one = trim(flight_model(drawn), condition, MASS, begin=found)
        for name in ("alpha", "turn_rate", "nz", "Cl"):
            draws.setdefault(name, []).append(one.channels[name])
        for name, value in one.deflections.items():
            draws.setdefault(name, []).append(value)
        about = linear_model(one)
        draws.setdefault("A", []).append(about.A[5, 4])
        for mode in modes(about):
            for name, value in mode.figures.items():
                draws.setdefault(f"{mode.name} {name}", []).append(value)
    errors = {**found.standard_errors, "A": linear.standard_errors()[0][5, 4]}
    for mode in named.values():
        errors |= {f"{mode.name} {name}": e for name, e in mode.standard_errors.items()}
    compared = 0
    for name, values in draws.items():
        scatter = float(np.std(values))
        if scatter < 1e-8 or name.startswith("spiral"):
            continue  # the spiral's time constant is far from linear
        compared += 1
        assert errors[name] == pytest.approx(scatter, rel=0.15), name
    assert compared > 15


def test_a_sweep_says_where_the_flight_ends(model: FlightModel) -> None:
    points = sweep(model, CRUISE, MASS, "V", np.linspace(10.0, 60.0, 6), limits=LIMITS)
    assert points[0].trim is None
    assert "alpha is at its upper limit" in points[0].reason
    alphas = [point.trim.channels["alpha"] for point in points[2:] if point.trim]
    assert len(alphas) == 4
    assert np.all(np.diff(alphas) < 0)
    assert {"short period", "phugoid", "Dutch roll", "roll", "spiral"} == {
        mode.name for mode in points[-1].modes
    }
    with pytest.raises(InputError, match="did you mean"):
        sweep(model, CRUISE, MASS, "mas", [1.0])


def test_moving_the_cg_back_takes_the_short_period_apart(model: FlightModel) -> None:
    """Static margin (0.9/4.8 chords) gone: the oscillation becomes real roots, and is called so."""
    behind = {**MASS, "cg_x": -0.5}
    names = {m.name: m for m in modes(linear_model(trim(model, CRUISE, behind)))}
    assert "short period" not in names
    assert any("real root" in name for name in names)


def test_the_linear_model_predicts_the_flight(model: FlightModel) -> None:
    """A small step of elevator and aileron, integrated exactly, against the engine; both forms."""
    from scipy.linalg import expm

    found = trim(model, replace(CRUISE, beta=0.05), MASS)
    time = np.arange(0.0, 2.001, 0.005)
    small = 1e-4
    series = dict(found.series)
    for name in ("delta_elevator", "delta_aileron"):
        series[name] += small
    flown = simulate(model, time, found.start, series)
    for form in ("velocities", "angles"):
        linear = linear_model(found, form)  # type: ignore[arg-type]
        n, m = linear.B.shape
        whole = np.zeros((n + m, n + m))
        whole[:n, :n], whole[:n, n:] = linear.A, linear.B
        u = np.array([small * (x in ("delta_elevator", "delta_aileron")) for x in linear.inputs])
        state = expm(2.0 * whole)[:n, n:] @ u
        outputs = linear.C @ state + linear.D @ u
        for name, value in zip(linear.outputs, outputs, strict=True):
            if name not in flown.channels:
                continue
            change = flown.channels[name][-1, 0] - flown.channels[name][0, 0]
            if name in ("ax", "ay", "az", "qbar", "mach"):
                continue  # loads step with the surface; the model's altitude is constant
            scale = np.ptp(flown.channels[name])
            assert value == pytest.approx(change, abs=5e-3 * scale + 1e-9), (form, name)


def test_states_of_actuators_and_of_the_stall_have_modes_of_their_own() -> None:
    """An actuator of .1 s, and a flow that follows with 12 chords: eigenvalues -10 and -V/(12 c)
    where neither is fed back."""
    stalling = database(CX="0.2*(1 - flow_attachment)")
    stalling = replace(
        stalling,
        states=(
            StateModel(
                "flow_attachment", GomanKhrabrov((0.1, 0.3), (1.0, 0.0), lag=0.0, relaxation=12.0)
            ),
        ),
    )
    lagged = {"delta_elevator": Actuator(lag=0.1), "delta_rudder": Actuator((-0.3, 0.3))}
    linear = linear_model(trim(flight_model(stalling, actuators=lagged), CRUISE, MASS))
    assert linear.states[8:] == ("flow_attachment", "delta_elevator")
    named = {mode.name: mode.eigenvalue for mode in modes(linear)}
    assert named["state delta_elevator"] == pytest.approx(-10.0, rel=1e-6)
    assert named["state flow_attachment"] == pytest.approx(-60.0 / (12.0 * CHORD), rel=0.02)
    assert named["short period"].imag > 0


def test_feedback_is_part_of_the_linear_model(model: FlightModel) -> None:
    damped = flight_model(database(), feedback={("delta_elevator", "q"): -0.3})
    bare, closed = (linear_model(trim(m, CRUISE, MASS)) for m in (model, damped))
    q, elevator = bare.states.index("q"), bare.inputs.index("delta_elevator")
    assert closed.A[q, q] - bare.A[q, q] == pytest.approx(0.3 * bare.B[q, elevator], rel=1e-6)
    assert pytest.approx(bare.B, abs=1e-6) == closed.B


def test_estimates_folded_into_tables_are_said_to_be_exact() -> None:
    nominal = identified()
    folded = replace(nominal, increments=(replace(nominal.increments[0], folded=("a", "")),))
    found = trim(flight_model(folded), CRUISE, MASS)
    assert found.notes == ("estimates that are folded into tables are taken as exact",)
    assert found.standard_errors["alpha"] > 0
