"""A light aircraft whose derivatives are increments, and simulated flights of it."""

import numpy as np

from aerodb.physics.turbulence import DrydenGusts
from aerodb.simulation import FlightModel, FlightStretch, flight_model, simulate
from aerodb.tables import AeroDatabase, Increment, ReferenceGeometry, Term, parse

BODY = {"mass": 1043.0, "Ixx": 1285.0, "Iyy": 1825.0, "Izz": 2667.0}
TERMS = {
    "CX": "-0.032 + 0.35*alpha", "CY": "0", "CZ": "-0.31", "Cl": "0.1*r_hat", "Cm": "0.02",
    "Cn": "-0.03*p_hat",
}  # fmt: skip
#: Axis -> regressor -> derivative.
TRUTH = {
    "CZ": {"alpha": -4.7, "delta_elevator": -0.4},
    "Cm": {"alpha": -0.9, "q_hat": -12.4, "delta_elevator": -1.2},
    "CY": {"beta": -0.31, "delta_rudder": 0.18},
    "Cl": {"beta": -0.09, "p_hat": -0.47, "delta_aileron": -0.17},
    "Cn": {"beta": 0.065, "r_hat": -0.1, "delta_rudder": -0.07},
}
NOISE = {
    "V": 0.1, "alpha": 1e-3, "beta": 1e-3, "p": 2e-3, "q": 1e-3, "r": 1e-3, "phi": 2e-3,
    "theta": 1e-3, "ax": 0.03, "ay": 0.03, "az": 0.05,
}  # fmt: skip
SPEED, ALTITUDE, THRUST = 60.0, 1500.0, 900.0


def light_aircraft(
    derivatives=TRUTH, factors: dict[str, str] | None = None, **terms: str
) -> FlightModel:
    """The model, its increments' estimates the derivatives."""
    increments = [
        Increment(
            axis,
            tuple(parse(name) for name in own),
            np.array(list(own.values())),
            np.zeros((len(own), len(own))),
        )
        for axis, own in derivatives.items()
    ]
    database = AeroDatabase(
        name="light aircraft",
        reference=ReferenceGeometry(16.2, 1.49, 10.9, (0.0, 0.0, 0.0)),
        terms=tuple(Term(axis, axis, parse(text)) for axis, text in (TERMS | terms).items()),
        increments=tuple(increments),
    )
    return flight_model(database, factors=factors)


def steps(time, since, widths, size):
    """A 3-2-1-1 or any other series of steps of alternating sign, widths in seconds."""
    edges = since + np.concatenate([[0.0], np.cumsum(widths)])
    signs = [0.0, *(size * (-1.0) ** k for k in range(len(widths))), 0.0]
    return np.interp(
        time, np.repeat(edges, 2) + np.tile([-0.02, 0.02], len(edges)), np.repeat(signs, 2)[1:-1]
    )


def manoeuvre(number: int, seconds: float, step: float):
    """Time and the three surfaces."""
    time = np.arange(0.0, seconds, step)
    rng = np.random.default_rng(number)
    shift = rng.uniform(0.0, 1.0, 3)
    surfaces = {
        "delta_elevator": steps(time, 1.0 + shift[0], [0.9, 0.6, 0.3, 0.3], 0.04),
        "delta_aileron": steps(time, 5.0 + shift[1], [0.8, 0.8], 0.05),
        "delta_rudder": steps(time, 9.0 + shift[2], [0.9, 0.9], 0.06),
    }
    return time, surfaces


def stretches(
    rng: np.random.Generator,
    count: int = 2,
    seconds: float = 16.0,
    step: float = 0.04,
    model: FlightModel | None = None,
    noise: dict[str, float] = NOISE,
    wind_at_6m: float = 0.0,
) -> dict[str, FlightStretch]:
    """Simulated flights with white noise, as `stretch_of` would give them; in Dryden's turbulence of
    a wind [m/s], which the stretch does not tell."""
    model, made = model or light_aircraft(), {}
    for number in range(count):
        time, surfaces = manoeuvre(number, seconds, step)
        series = {**BODY, **surfaces, "force_x": THRUST}
        alpha = (BODY["mass"] * 9.80665 / (0.5 * 1.058 * SPEED**2 * 16.2) - 0.31) / 4.7
        start = {"V": SPEED, "alpha": alpha, "theta": alpha, "altitude": ALTITUDE}
        run = simulate(model, time, start, series | _gusts(time, wind_at_6m, rng))
        flown = {
            name: run.channels[name][:, 0] + sigma * rng.standard_normal(len(time))
            for name, sigma in noise.items()
        }
        flown["altitude"] = run.channels["altitude"][:, 0]
        first = {name: float(flown[name][0]) for name in NOISE if name[0] != "a" or name == "alpha"}
        whole = {name: np.broadcast_to(value, time.shape) for name, value in series.items()}
        first |= {"psi": 0.0, "altitude": ALTITUDE}
        made[f"flight {number}"] = FlightStretch(time, first, whole, flown, (), {})
    return made


def _gusts(time, wind_at_6m: float, rng: np.random.Generator):
    if not wind_at_6m:
        return {}
    gusts = DrydenGusts(np.array([wind_at_6m]), rng)
    at = np.array([SPEED]), np.array([ALTITUDE])
    moved = [gusts.advance(float(time[1] - time[0]), *at)[:, 0] for _ in time]
    moved = np.array(moved) - moved[0]  # from trim
    return dict(zip(("gust_u", "gust_v", "gust_w"), moved.T, strict=True))
