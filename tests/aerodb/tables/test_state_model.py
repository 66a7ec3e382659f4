"""State models against closed forms, an independent integrator and JSBSim's own relay; stored,
predicted along a flight, exported."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from aerodb.coefficients.comparison import with_states
from aerodb.errors import InputError
from aerodb.exchange.arrays.comma_separated import export_csv, import_csv
from aerodb.exchange.daveml.export import export_daveml
from aerodb.exchange.daveml.reader import import_daveml
from aerodb.exchange.jsbsim.export import export_jsbsim
from aerodb.exchange.jsbsim.reader import import_jsbsim
from aerodb.exchange.jsbsim.states import states_for_jsbsim
from aerodb.exchange.native import database_content_sha256, from_document, read_native, to_document
from aerodb.exchange.state_terms import settled_states, without_states
from aerodb.flight import Flight
from aerodb.support.identity import canonical_json
from aerodb.tables.analysis.check_cases import failed_check_cases, make_check_cases
from aerodb.tables.analysis.evaluation import evaluate_database
from aerodb.tables.database import AeroDatabase, Term
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment, Interval
from aerodb.tables.program import evaluate
from aerodb.tables.reference import ReferenceGeometry
from aerodb.tables.state_model import GomanKhrabrov, Kirchhoff, Relay, StateModel
from tests.support.command import asked
from tests.support.small_glider import DATABASE, NAME, VEHICLE

CHORD = 3.159
ATTAS = Kirchhoff(sharpness=35.0, alpha_star=0.29, lag=21.0)
GOMAN = GomanKhrabrov((0.1, 0.2, 0.3), (1.0, 0.4, 0.0), lag=4.0, relaxation=12.0)
RELAY = Relay(0.09, 0.36)


def state(law, name="flow_attachment"):
    return StateModel(name, law)


def database(*states: StateModel, **changed) -> AeroDatabase:
    """Lift with a part that separates, as a term and as an increment; drag of separated flow."""
    lift = Term(
        "lift", "C_lift", parse("0.2 + 5*alpha + 4*alpha*(((1 + sqrt(flow_attachment))/2)^2 - 1)")
    )
    drag = Increment(
        "C_drag",
        (parse("1 - flow_attachment"),),
        np.array([0.05]),
        np.array([[1e-4]]),
        {"alpha": Interval(0, 0.3, 0.05)},
    )
    parts = {"terms": (lift,), "increments": (drag,), "states": states, **changed}
    return AeroDatabase("wing", ReferenceGeometry(64.0, CHORD, 21.5, (0.0, 0.0, 0.0)), **parts)


@cache
def sweep(n: int = 4001) -> dict[str, np.ndarray]:
    """Up to a stall and down again in 40 s, at falling and rising airspeed."""
    time = np.linspace(0.0, 40.0, n)
    alpha = 0.18 - 0.14 * np.cos(2 * np.pi * time / 40.0) + 0.01 * np.sin(3.0 * time)
    alphadot = 0.14 * 2 * np.pi / 40.0 * np.sin(2 * np.pi * time / 40.0) + 0.03 * np.cos(3.0 * time)
    return {
        "time": time,
        "alpha": alpha,
        "alphadot": alphadot,
        "V": 70.0 + 15.0 * np.cos(2 * np.pi * time / 40.0),
    }


def along(law, channels=None):
    channels = channels or sweep()
    return state(law).along(channels["time"], channels, CHORD)


# Closed forms


def test_steady_flow_is_what_everything_settles_at():
    time = np.linspace(0.0, 60.0, 601)
    for law in (ATTAS, GOMAN, replace(ATTAS, relaxation=15.0), RELAY):
        for angle in (0.05, 0.17, 0.29, 0.4):
            channels = {
                "alpha": np.full(601, angle),
                "alphadot": np.zeros(601),
                "V": np.full(601, 80.0),
            }
            held = state(law).along(time, channels, CHORD)
            settled = state(law).settled({"alpha": np.array([angle])}, CHORD)
            assert held == pytest.approx(np.full(601, settled[0]), abs=1e-12)


def test_relaxation_after_a_step_is_exponential():
    """Alpha jumps from attached to separated flow within one sample; tau1 = 12 chords at 80 m/s =
    .474 s."""
    time = np.linspace(0.0, 4.0, 4001)
    law, speed = replace(GOMAN, lag=0.0), 80.0
    alpha = np.where(time < 1.0, 0.05, 0.35)
    held = along(law, {"time": time, "alpha": alpha, "V": np.full(4001, speed)})
    after = np.exp(-(time[time >= 1.0] - 1.0) / (12.0 * CHORD / speed))
    assert held[time < 1.0] == pytest.approx(1.0, abs=1e-12)
    assert held[time >= 1.0] == pytest.approx(
        after, abs=1.2e-3
    )  # the jump itself takes one sample of 1 ms


def test_relaxation_to_a_ramp_trails_by_its_time_constant():
    time = np.linspace(
        0.0, 20.0, 41
    )  # exact for a steady value that is linear, however coarse the samples
    law = GomanKhrabrov((0.0, 1.0), (1.0, 0.0), relaxation=20.0)
    alpha, tau = 0.04 * time, 20.0 * CHORD / 60.0
    held = along(law, {"time": time, "alpha": alpha, "V": np.full(41, 60.0)})
    assert held == pytest.approx(1.0 - 0.04 * (time - tau * (1.0 - np.exp(-time / tau))), abs=1e-12)


def test_lag_is_the_angle_a_while_ago():
    channels = sweep()
    ago = channels["alpha"] - 21.0 * CHORD / channels["V"] * channels["alphadot"]
    assert along(ATTAS) == pytest.approx(0.5 * (1.0 - np.tanh(35.0 * (ago - 0.29))), abs=1e-14)
    assert np.ptp(along(ATTAS)) > 0.4


def test_rate_is_that_of_alpha_but_not_of_its_noise():
    """Of white noise of .2 deg on alpha, and with a lag of about a second, a plain rate would leave
    nothing of the stall."""
    channels, rng = dict(sweep(1001)), np.random.default_rng(5)
    given = along(ATTAS, channels)
    channels["alpha"] = channels["alpha"] + np.deg2rad(0.2) * rng.standard_normal(1001)
    plain = along(ATTAS, {**channels, "alphadot": np.gradient(channels["alpha"], channels["time"])})
    del channels["alphadot"]
    slow = along(ATTAS, channels)
    assert np.sqrt(np.mean((slow - given) ** 2)) < 0.06
    assert np.sqrt(np.mean((plain - given) ** 2)) > 0.2


@pytest.mark.parametrize("law", [GOMAN, replace(ATTAS, relaxation=15.0)])
def test_against_an_independent_integrator(law):
    fine = sweep(40001)

    def slope(t, x):
        alpha, alphadot, speed = (
            np.interp(t, fine["time"], fine[name]) for name in ("alpha", "alphadot", "V")
        )
        return (
            (law.steady(alpha - law.lag * CHORD / speed * alphadot) - x)
            * speed
            / (law.relaxation * CHORD)
        )

    kinks = {"max_step": 0.01}
    solved = solve_ivp(
        slope, (0.0, 40.0), [1.0], t_eval=sweep()["time"], rtol=1e-9, atol=1e-10, **kinks
    ).y[0]
    settled_start = along(law)
    assert settled_start == pytest.approx(solved, abs=3e-5)
    assert np.ptp(settled_start) > 0.5


def test_relay_remembers_between_its_limits():
    alpha = np.array([0.2, 0.35, 0.37, 0.2, 0.1, 0.08, 0.2, np.nan, 0.4, np.nan, 0.2])
    channels = {"time": np.arange(11.0), "alpha": alpha}
    expected = [1, 1, 0, 0, 0, 1, 1, np.nan, 0, np.nan, 0]
    assert np.array_equal(along(RELAY, channels), expected, equal_nan=True)
    assert np.array_equal(
        along(replace(RELAY, separated=1.0), channels), 1.0 - np.array(expected), equal_nan=True
    )


def test_a_gap_is_bridged_for_the_memory_and_stays_a_gap():
    whole, holed = sweep(), dict(sweep())
    gap = (whole["time"] > 18.0) & (whole["time"] < 18.2)
    holed["alpha"] = np.where(gap, np.nan, whole["alpha"])
    law = replace(ATTAS, relaxation=15.0)
    before, after = along(law), along(law, holed)
    assert np.array_equal(np.isnan(after), gap)
    assert np.max(np.abs((after - before)[~gap])) < 0.01


# Expressions, storage, evaluation


@pytest.mark.parametrize("law", [ATTAS, replace(ATTAS, lag=0.0), GOMAN])
def test_expression_is_the_settled_value(law):
    channels = sweep()
    model = StateModel("flow_attachment", law)
    values = evaluate(model.expression(), {**channels, "c_ref": CHORD})
    assert values == pytest.approx(model.settled(channels, CHORD), abs=1e-14)
    assert model.exact_steady == (law.relaxation == 0.0)


@pytest.mark.parametrize(
    "law", [ATTAS, GOMAN, replace(ATTAS, relaxation=3.0), RELAY, replace(RELAY, separated=1.0)]
)
def test_stored_and_read_back(law):
    made = database(replace(state(law), description="wing"))
    document = json.loads(canonical_json(to_document(made)))
    again = from_document(document)
    assert again.states == made.states
    assert database_content_sha256(again) == database_content_sha256(made)
    assert import_csv(export_csv(made, make_check_cases(made)), "wing").states == made.states
    other = database(
        state(replace(law, **({"low": 0.05} if isinstance(law, Relay) else {"lag": 5.0})))
    )
    assert database_content_sha256(other) != database_content_sha256(made)
    assert "states" not in to_document(database(free_inputs={}, terms=(), increments=()))


def test_written_by_people():
    text = """
name = "glider"
reference = {area = 1.0, chord = 0.2, span = 5.0, moment_reference = [0, 0, 0]}
[derivatives.C_lift]
"alpha*flow_attachment" = 5.0
[[states]]
name = "flow_attachment"
law = "kirchhoff"
parameters = {sharpness = 40, alpha_star = 0.25}
"""
    made = read_native(text)
    assert made.states == (StateModel("flow_attachment", Kirchhoff(40.0, 0.25)),)
    for wrong, named in (
        ("alpha_stra = 0.25", "alpha_star"),
        ("alpha_star = [0.1]", "numbers"),
        ("lag = 1.0", "lacks alpha_star"),
    ):
        with pytest.raises(InputError, match=named):
            read_native(text.replace("alpha_star = 0.25", wrong))


def test_prediction_is_stateless_and_settles_where_nobody_gives_the_state():
    made = database(state(GOMAN))
    alpha = np.linspace(0.0, 0.4, 9)
    free = made.predict({"alpha": alpha, "beta": 0.0}).coefficients
    given = made.predict(
        {"alpha": alpha, "beta": 0.0, "flow_attachment": GOMAN.steady(alpha)}
    ).coefficients
    attached = made.predict({"alpha": alpha, "beta": 0.0, "flow_attachment": 1.0}).coefficients
    assert all(np.array_equal(free[axis], given[axis]) for axis in free)
    assert np.max(np.abs(attached["CZ"] - free["CZ"])) > 0.5
    assert evaluate_database(made, {"alpha": 0.25, "beta": 0.0}).value["CZ"].shape == (1,)
    with pytest.raises(InputError, match="alpha"):
        made.predict({"beta": 0.0})


def test_a_flight_is_given_what_its_states_make_of_it():
    made, channels = database(state(GOMAN)), dict(sweep())
    time = channels.pop("time")
    flight = Flight("f", "v", time, {**channels, "beta": np.zeros(len(time))})
    assert made.flight_inputs == ("V", "alpha", "beta")
    filled = with_states(flight, made)
    expected = along(GOMAN, {"time": time, "alpha": channels["alpha"], "V": channels["V"]})
    assert np.array_equal(filled["flow_attachment"], expected)
    wild = flight.with_flag("alpha", "wild_point", (time > 10) & (time < 10.1))
    assert np.isnan(with_states(wild, made)["flow_attachment"]).sum() == np.sum(
        (time > 10) & (time < 10.1)
    )
    assert with_states(filled, made)["flow_attachment"] is filled["flow_attachment"]
    with pytest.raises(InputError, match="V"):
        made.states_along(time, {"alpha": channels["alpha"]})
    unused = database(state(GOMAN), terms=(), increments=())
    assert unused.flight_inputs == ()  # what nothing uses asks nothing of a flight
    assert not unused.states_along(time, {})


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: Kirchhoff(0.0, 0.3), "sharpness"),
        (lambda: Kirchhoff(30.0, float("nan")), "alpha_star"),
        (lambda: Kirchhoff(30.0, 0.3, lag=-1.0), "lag"),
        (lambda: GomanKhrabrov((0.2, 0.1), (1.0, 0.0)), "increase"),
        (lambda: GomanKhrabrov((0.1, 0.2), (1.0, -0.1)), "0 to 1"),
        (lambda: GomanKhrabrov((0.1, 0.2), (1.0,)), "as many"),
        (lambda: Relay(0.3, 0.1), "swap"),
        (lambda: Relay(0.1, 0.3, separated=0.5), "0 or 1"),
        (lambda: database(state(ATTAS), state(RELAY)), "twice"),
        (lambda: database(state(ATTAS, "alpha")), "computes no channel"),
        (lambda: state(RELAY).expression(), "no steady value"),
    ],
)
def test_what_cannot_be_is_refused(make, named):
    with pytest.raises(InputError, match=named):
        make()


# JSBSim's own relay, and export


def test_relay_against_jsbsim_in_a_stall_and_recovery():
    """c172p at full throttle, stick pulled back until it stalls and pushed until it flies again:
    JSBSim's own property."""
    simulator = pytest.importorskip("tests.support.jsbsim_flights").simulator
    made = import_jsbsim(
        pytest.importorskip("tests.support.jsbsim_flights").aircraft_file("c172p"), name="c172p"
    )
    executive = simulator("c172p")
    for name, value in {
        "ic/h-sl-ft": 6000,
        "ic/vc-kts": 70,
        "fcs/throttle-cmd-norm": 0.5,
        "fcs/mixture-cmd-norm": 1,
    }.items():
        executive[name] = value
    executive.run_ic()
    rows = []
    for _ in range(round(60 / executive.get_delta_t())):
        now = executive.get_sim_time()
        executive["fcs/elevator-cmd-norm"] = -1.0 if (now // 10) % 2 else 0.4
        executive["fcs/aileron-cmd-norm"] = (
            -2.0 * executive["attitude/phi-rad"] - executive["velocities/p-rad_sec"]
        )
        executive.run()
        rows.append([now, executive["aero/alpha-rad"], executive["aero/stall-hyst-norm"]])
    time, alpha, theirs = np.array(rows).T
    ours = made.states_along(time, {"alpha": alpha})["stall_hyst_norm"]
    assert np.sum(np.diff(theirs) != 0) >= 2, (
        f"alpha from {alpha.min():.2f} to {alpha.max():.2f} rad: no stall"
    )
    assert np.array_equal(ours, theirs)


@pytest.mark.parametrize("law", [ATTAS, GOMAN])
def test_exported_as_what_it_settles_at(law):
    made = database(state(law))
    flat = without_states(made)
    note = flat.variables["settled_flow_attachment"].description
    assert ("not in this file" in note) == (law.relaxation > 0.0)
    assert bool(settled_states(made, flat)) == (law.relaxation > 0.0)
    assert settled_states(made, made) == ()
    rng = np.random.default_rng(3)
    points = {
        "alpha": rng.uniform(0, 0.4, 50),
        "beta": rng.uniform(-0.1, 0.1, 50),
        "V": rng.uniform(50, 90, 50),
    }
    points["alphadot"] = rng.uniform(-0.1, 0.1, 50)
    expected = made.predict(points).coefficients
    for other in (
        flat,
        import_daveml(export_daveml(made), name="wing"),
        import_jsbsim(export_jsbsim(made, name="wing"), name="wing"),
    ):
        found = other.predict(points).coefficients
        for axis in ("CX", "CZ", "Cm"):
            assert found[axis] == pytest.approx(expected[axis], rel=1e-9, abs=1e-12), axis


def test_a_relay_goes_to_jsbsim_as_its_own_and_comes_back():
    made = database(state(RELAY))
    again = import_jsbsim(export_jsbsim(made, name="wing"), name="wing")
    assert again.states == (StateModel("stall_hyst_norm", replace(RELAY, separated=1.0)),)
    channels = {**sweep(), "alpha": 1.2 * sweep()["alpha"], "beta": np.zeros(4001)}
    time = channels.pop("time")
    ours, theirs = (
        d.predict({**channels, **d.states_along(time, channels)}).coefficients
        for d in (made, again)
    )
    assert theirs["CZ"] == pytest.approx(ours["CZ"], rel=1e-9)
    assert set(made.states_along(time, channels)["flow_attachment"]) == {0.0, 1.0}
    assert not states_for_jsbsim(made).states
    with pytest.raises(InputError, match="does not switch"):
        export_jsbsim(database(state(Relay(0.0, 0.3))), name="wing")
    assert "flow_attachment" in import_daveml(export_daveml(made), name="wing").inputs


@pytest.mark.parametrize("law", [ATTAS, GOMAN, RELAY])
def test_check_cases_hold_through_every_form(law):
    made = database(state(law))
    cases = make_check_cases(made)
    assert len(cases) == 25
    assert {0.0 < case.inputs["flow_attachment"] < 1.0 for case in cases} == {True}
    assert not failed_check_cases(from_document(to_document(made)), cases)
    assert failed_check_cases(
        database(), [replace(cases[0], coefficients={"CZ": cases[0].coefficients["CZ"] + 0.1})]
    )


def test_a_version_with_a_state_is_asked_and_exported_by_commands(tmp_path):
    """Evaluated at what it settles at unless the state is given; into every format, each checked by
    its own reader."""
    (tmp_path / "vehicle.toml").write_text(VEHICLE)
    stalls = """
[[terms]]
name = "stalled"
axis = "Cm"
expression = "-0.1*(1 - flow_attachment)"
[[states]]
name = "flow_attachment"
law = "goman_khrabrov"
parameters = {breakpoints = [0.2, 0.3], attached = [1, 0], lag = 5, relaxation = 10}
"""
    (tmp_path / "database.toml").write_text(DATABASE + stalls)
    asked(tmp_path / "w", "vehicle", "add", str(tmp_path / "vehicle.toml"))
    asked(tmp_path / "w", "database", "import", str(tmp_path / "database.toml"), "--vehicle", NAME)

    def pitching(at: str) -> float:
        answer = asked(
            tmp_path / "w", "version", "evaluate", "released", "--vehicle", NAME, "--at", at
        )
        assert "flow_attachment" not in answer["taken_as_zero"]
        return float(answer["coefficients"]["Cm"])

    attached = pitching("alpha=0.1")
    assert pitching("alpha=0.25") - pitching("alpha=0.25,flow_attachment=1") == pytest.approx(
        -0.05, abs=1e-12
    )
    assert pitching("alpha=0.1,flow_attachment=0") - attached == pytest.approx(-0.1, abs=1e-12)
    for form in ("jsbsim", "daveml", "csv", "mat", "netcdf"):
        output = str(tmp_path / f"out.{form}")
        answer = asked(
            tmp_path / "w",
            "version",
            "export",
            "released",
            "--vehicle",
            NAME,
            "--format",
            form,
            "--output",
            output,
        )
        assert answer["checked"].startswith("read back")
