"""The measured ATTAS stalls: a sensor explains the records as they are, hysteresis what is left
after correction.

Figures of the data's SOURCE.md for the lift in the stall window, low-passed at .8 Hz and predicted
on the other record: .041 and .046 without a stall term, .0328 and .0421 with the best static one,
.0251 and .0354 with Kirchhoff's flow. The window here runs from onset (alpha last rises through
nine tenths of its maximum) to reattachment (the minimum of alpha that follows). Two records are two
votes: what they say is suspected, cross-validated, not confirmed.
"""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients.comparison import band_limited
from aerodb.effects.flight_view import view_of
from aerodb.effects.library import hypotheses_for
from aerodb.effects.stall.stall_hysteresis import stall_hypotheses, with_stall
from aerodb.effects.stall.stall_shape import (
    FAMILIES,
    Shape,
    StallFlight,
    blocked,
    cross_fit_shapes,
    fit_shape,
)
from aerodb.effects.template import LibraryContext, LibrarySettings
from aerodb.flight import Flight
from aerodb.tables.database import AeroDatabase
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment
from aerodb.tracing.decision.verdicts import trace
from aerodb.tracing.evidence.flight_evidence import evidence_of
from aerodb.tracing.evidence.normal_equations import normal_equations_of
from aerodb.tracing.settings import TracingSettings
from tests.support.attas_stalls import (
    ATTACHED,
    BAND,
    as_recorded,
    attached_database,
    attas,
    compared,
    corrected,
    reconstructed,
    stall_flight,
    stall_window,
    window_rms,
    without_stall,
)
from tests.support.consistency_records import ATTAS_BIASES, BOOM

STATIC = ("static_separation", *(name for name, family in FAMILIES.items() if family.law is None))
#: What may explain the longitudinal residual beside the stall.
RIVALS = (
    *(
        "zero_offset",
        "alpha_slope",
        "alpha_slope_break",
        "pitch_rate_force",
        "pitch_damping",
        "alpha_dot",
    ),
    *("control_effectiveness", "control_nonlinearity", "control_alpha_coupling"),
    *("qbar_scale", "alpha_bias", "alpha_scale", "alpha_delay", "accelerometer_bias"),
)
#: From 01 to 02 and back: most that the lift in the window may be wrong by when the other record
#: chose the model.
GOAL = (0.027, 0.037)


@pytest.fixture(scope="module")
def recorded(measured) -> list[Flight]:
    return [as_recorded(measured(f"attas/fAttas_qst0{number}.asc")) for number in (1, 2)]


@pytest.fixture(scope="module")
def database(measured) -> AeroDatabase:
    return attached_database(measured("attas/fAttasElv1.mat"))


@pytest.fixture(scope="module")
def flights(recorded) -> list[Flight]:
    """Biases of accelerometers and gyros from kinematics, both records jointly; V, alpha, beta
    moved from the boom to the CG."""
    result = reconstructed(recorded, ("alpha_bias", "alpha_scale"), at_boom=True)
    return [
        corrected(flight, {name: result[name].value for name in ATTAS_BIASES})
        for flight in recorded
    ]


@pytest.fixture(scope="module")
def stalls(flights, database) -> list[StallFlight]:
    return [stall_flight(flight, database) for flight in flights]


def both_ways(stalls: list[StallFlight], family: str) -> list[tuple[Shape, StallFlight]]:
    """Shapes and the flights that they are predicted on: 01 to 02, 02 to 01."""
    shapes = cross_fit_shapes(stalls, family)
    return [(shapes[flight.flight], flight) for flight in reversed(stalls)]


def window_errors(stalls: list[StallFlight], family: str, axis: str) -> list[float]:
    if family == "none":
        pairs = ((stalls[0], stalls[1]), (stalls[1], stalls[0]))
        return [
            window_rms(without_stall(fitted, predicted)[axis], predicted)
            for fitted, predicted in pairs
        ]
    return [
        window_rms(shape.unexplained(flight)[axis], flight)
        for shape, flight in both_ways(stalls, family)
    ]


# The records as they are


def test_kinematics_put_alpha_at_the_boom(recorded):
    """Documented as moved to the CG. Both records jointly: 12.3 +- .9 m ahead of it, where the boom
    is 13.08 m ahead."""
    at_cg, free = (
        reconstructed(recorded, ("alpha_bias", "alpha_scale", *more), at_boom=False)
        for more in ((), ("air_data_x",))
    )
    arm = free["air_data_x"]
    assert abs(arm.value - BOOM[0]) < 2 * arm.standard_error
    assert arm.value > 8 * arm.standard_error
    assert free.noise["alpha"] < 0.7 * at_cg.noise["alpha"]
    assert free.noise["V"] < 0.96 * at_cg.noise["V"]


def test_a_position_explains_the_lift_better_than_any_stall_model(recorded, database):
    """Beside level, alpha and elevator, one parameter against four: a lever arm of alpha (q/V)
    beats Kirchhoff and relay, on the record that chose them by hundreds of log-likelihood and on
    the other in the window. A delay (alphadot) does not."""
    untouched = [
        stall_flight(corrected(flight, dict.fromkeys(ATTAS_BIASES, 0.0), moved=False), database)
        for flight in recorded
    ]
    plain = [_lift_only(flight, []) for flight in untouched]
    arm = [
        _lift_only(flight, [raw["q"] / flight.V])
        for flight, raw in zip(untouched, recorded, strict=True)
    ]
    late = [_lift_only(flight, [np.gradient(flight.alpha, flight.time)]) for flight in untouched]
    for fitted, predicted in ((0, 1), (1, 0)):
        models = [
            fit_shape([plain[fitted]], name, axes=("C_lift",)) for name in ("kirchhoff", "relay")
        ]
        stalled = min(model.cost for model in models)
        assert _cost(arm[fitted]) < stalled - 100
        assert _cost(late[fitted]) > stalled
        errors = [
            window_rms(model.unexplained(plain[predicted])["C_lift"], plain[predicted])
            for model in models
        ]
        assert window_rms(
            without_stall(arm[fitted], arm[predicted])["C_lift"], arm[predicted]
        ) < 0.9 * min(errors)


def _lift_only(flight: StallFlight, more: list[np.ndarray]) -> StallFlight:
    """Level, alpha and elevator may be corrected, pitch rate not: it is what a lever arm looks
    like."""
    nuisance = np.column_stack([flight.nuisance["C_lift"][:, [0, 1, 3]], *more])
    return replace(
        flight, residual={"C_lift": flight.residual["C_lift"]}, nuisance={"C_lift": nuisance}
    )


def _cost(flight: StallFlight) -> float:
    matrix, response = (
        blocked(flight, flight.nuisance["C_lift"]),
        blocked(flight, flight.residual["C_lift"]),
    )
    left = response - matrix @ np.linalg.lstsq(matrix, response, rcond=None)[0]
    return 0.5 * len(left) * float(np.log(np.mean(left**2)))


# With alpha corrected


def test_lift_of_the_stall_is_predicted_on_the_other_record(stalls):
    """Without a stall term .043 and .038; with Kirchhoff's flow .025 and .031."""
    without, errors = (
        window_errors(stalls, "none", "C_lift"),
        window_errors(stalls, "kirchhoff", "C_lift"),
    )
    assert without == pytest.approx([0.043, 0.038], abs=0.001)
    assert errors == pytest.approx([0.025, 0.031], abs=0.001)
    assert [error <= goal for error, goal in zip(errors, GOAL, strict=True)] == [True, True]


@pytest.mark.parametrize("family", STATIC)
def test_memory_is_named_before_every_static_template(stalls, family):
    """On the record that chose the shape, and in the window of the other; all axes together and
    lift."""
    static, errors = both_ways(stalls, family), window_errors(stalls, family, "C_lift")
    for (memory, _), (rival, _) in zip(both_ways(stalls, "kirchhoff"), static, strict=True):
        assert memory.cost < rival.cost - 100
    for better, worse in zip(window_errors(stalls, "kirchhoff", "C_lift"), errors, strict=True):
        assert better < 0.9 * worse


def test_both_records_agree_on_the_shape_when_all_axes_share_it(stalls):
    """alpha* .27 rad and a lag of 26 to 28 chords from either record, none at a bound; sharpness is
    hardly determined. From lift alone the first record takes the lag to its bound and the second
    leaves the flow half attached."""
    shapes = [shape for shape, _ in both_ways(stalls, "kirchhoff")]
    assert [shape.parameters["alpha_star"] for shape in shapes] == pytest.approx(
        [0.271, 0.271], abs=0.004
    )
    assert [shape.parameters["lag"] for shape in shapes] == pytest.approx([27.0, 27.0], abs=3.0)
    assert all(50.0 < shape.parameters["sharpness"] < 200.0 for shape in shapes)
    assert not any(shape.at_bound for shape in shapes)
    alone = [fit_shape([flight], "kirchhoff", axes=("C_lift",)) for flight in stalls]
    assert abs(alone[0].parameters["lag"] - alone[1].parameters["lag"]) > 8.0


def test_relaxation_adds_nothing(stalls):
    relaxed, plain = both_ways(stalls, "kirchhoff_relaxed"), both_ways(stalls, "kirchhoff")
    for (more, _), (less, _) in zip(relaxed, plain, strict=True):
        assert more.cost > less.cost - 10
    errors = window_errors(stalls, "kirchhoff_relaxed", "C_lift")
    assert all(
        error > 0.97 * less
        for error, less in zip(errors, window_errors(stalls, "kirchhoff", "C_lift"), strict=True)
    )


def test_what_drag_and_moment_gain_and_what_does_not_reproduce(stalls):
    """SOURCE.md: drag .0151 to .0103 and .0229 to .0145, moment better one way only. Here the joint
    reconstruction of the accelerometers leaves .011 and .0135 of drag before any stall term; it
    gains one way. The moment gains both ways, little in the first."""
    for axis, before, after in (
        ("C_drag", [0.0111, 0.0135], [0.0110, 0.0101]),
        ("Cm", [0.0231, 0.0299], [0.0200, 0.0163]),
    ):
        assert window_errors(stalls, "none", axis) == pytest.approx(before, abs=0.0006), axis
        assert window_errors(stalls, "kirchhoff", axis) == pytest.approx(after, abs=0.0012), axis


@pytest.mark.parametrize("onset", [0.8, 0.85, 0.95])
def test_the_gain_does_not_hang_on_the_window(stalls, onset):
    """Where the window begins is a choice; lift is better by a tenth or more with any."""
    for number, (shape, flight) in enumerate(both_ways(stalls, "kirchhoff")):
        base = without_stall(stalls[number], flight)["C_lift"]
        peak, stop = int(np.argmax(flight.alpha)), stall_window(flight).stop
        window = slice(
            int(np.flatnonzero(flight.alpha[:peak] < onset * flight.alpha[peak])[-1]), stop
        )
        before, after = (
            _rms(band_limited(left, flight.step, BAND)[window])
            for left in (base, shape.unexplained(flight)["C_lift"])
        )
        assert after < 0.9 * before


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_the_database_with_the_finding_predicts_what_the_study_says(stalls, flights, database):
    """From 01 to 02 through the product: attached corrections and stall as increments, the state
    integrated by `compare`."""
    (shape, predicted), flight = both_ways(stalls, "kirchhoff")[0], flights[1]
    attached = tuple(
        Increment(
            axis, tuple(map(parse, names)), shape.nuisance[axis], np.zeros((len(names), len(names)))
        )
        for axis, names in ATTACHED.items()
    )
    gains = {axis: (gain, 0.0) for axis, gain in shape.gains.items()}
    candidate = with_stall(database, shape.law, gains, {}, shape.flights)
    comparison = compared(flight, replace(candidate, increments=(*attached, *candidate.increments)))
    error = window_rms(comparison.residual("C_lift"), predicted)
    assert error == pytest.approx(
        window_rms(shape.unexplained(predicted)["C_lift"], predicted), rel=1e-6
    )
    assert error <= GOAL[0]


def test_tracing_suspects_the_stall_first_and_no_static_template(stalls, flights, database):
    """Beside the full linear set, estimated first, with shapes that each flight's column takes from
    the other flight. Two flights are too few to confirm; the lift alone is too little for a vote
    (its residual is coloured by buffet)."""
    pooled = {axis: _pooled(stalls, axis) for axis in ATTACHED}
    linear = tuple(
        Increment(axis, tuple(map(parse, names)), pooled[axis], np.zeros((len(names), len(names))))
        for axis, names in ATTACHED.items()
    )
    current, settings = replace(database, increments=linear), TracingSettings()
    laws = {flight: shape.law for flight, shape in cross_fit_shapes(stalls, "kirchhoff").items()}
    context = LibraryContext(current, attas(), frozenset(flights[0].channels))
    chosen = LibrarySettings(effects=RIVALS)
    library = [
        *hypotheses_for(current, attas(), flights[0].channels, settings=chosen),
        *stall_hypotheses(context, laws),
    ]
    library = [
        each for each in library if each.kind == "sensor" or not {"Cl", "Cn"} & set(each.axes)
    ]
    normal_equations = [
        normal_equations_of(
            evidence_of(view_of(f, compared(f, current), current, attas()), library), settings
        )
        for f in flights
    ]
    found = trace(normal_equations, library, settings).findings
    assert (found[0].effect, found[0].verdict) == ("stall_hysteresis", "suspected")
    assert {finding.effect for finding in found}.isdisjoint({"alpha_slope", "alpha_slope_break"})
    assert not any("alpha_slope" in rival for finding in found for rival in finding.explanation_set)


def _pooled(stalls: list[StallFlight], axis: str) -> np.ndarray:
    matrix = np.concatenate([blocked(flight, flight.nuisance[axis]) for flight in stalls])
    return np.linalg.lstsq(
        matrix,
        np.concatenate([blocked(flight, flight.residual[axis]) for flight in stalls]),
        rcond=None,
    )[0]
