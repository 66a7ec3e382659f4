"""The databases that the owners of the recorded aircraft would have: published derivatives, and the
example's own."""

from collections.abc import Mapping
from functools import lru_cache

from aerodb.examples.phoenix import read_example
from aerodb.exchange.native import read_native
from aerodb.tables.database import AeroDatabase
from aerodb.vehicle import Vehicle
from tests.aerodb.increments.test_measured_update import twin_otter_database
from tests.support import effect_flights

_PITCH_ROLL_YAW = Mapping[str, Mapping[str, float]]
#: ATTAS, HFB-320: Jategaonkar, Flight Vehicle System Identification, 2015 (the numbers are those of
#: SOURCE.md beside the data; per full span, and per q c / 2V). Citation: the course model of TU
#: Delft (Mulder et al., Lecture notes AE3202: Flight dynamics, 2013, table C-2), beta held at zero:
#: the log has none; lift from the stationary points of four other flights.
PUBLISHED: Mapping[str, _PITCH_ROLL_YAW] = {
    "attas": {
        "C_lift": {"1": 0.235, "alpha": 5.226, "delta_elevator": 0.38},
        "C_drag": {"1": 0.03, "alpha": 0.25},
        "C_side": {"beta": -1.004, "delta_rudder": 0.2},
        "Cl": {"beta": -0.0513, "p_hat": -0.38, "r_hat": 0.119, "delta_aileron": -0.0963,
               "delta_rudder": 0.02},
        "Cm": {"alpha": -0.878, "q_hat": -11.66, "delta_elevator": -0.985},
        "Cn": {"beta": 0.127, "p_hat": -0.0222, "r_hat": -0.0672, "delta_aileron": -0.0065,
               "delta_rudder": -0.072},
    },
    "hfb320": {
        "C_lift": {"1": 0.0558, "alpha": 4.32785},
        "C_drag": {"1": 0.0582, "alpha": 0.320055},
        "Cm": {"1": 0.1158, "alpha": -0.967854, "q_hat": -34.7098, "delta_elevator": -1.52913},
    },
    "citation": {
        "CZ": {"1": -0.0728, "alpha": -4.518, "q_hat": -5.6629, "delta_elevator": -0.6961},
        "CX": {"1": -0.03, "alpha": 0.4797, "delta_elevator": -0.0373},
        "CY": {"p_hat": -0.0304, "r_hat": 0.8495, "delta_aileron": -0.04,
                   "delta_rudder": 0.23},
        "Cl": {"p_hat": -0.7109, "r_hat": 0.2376, "delta_aileron": -0.2309,
               "delta_rudder": 0.0344},
        "Cm": {"1": 0.0297, "alpha": -0.5626, "q_hat": -8.7942, "delta_elevator": -1.1642},
        "Cn": {"p_hat": -0.0602, "r_hat": -0.2061, "delta_aileron": -0.012,
               "delta_rudder": -0.0939},
    },
}  # fmt: skip


def published(vehicle: Vehicle) -> AeroDatabase:
    """The derivatives of one of `PUBLISHED` as a database about the vehicle's moment reference; an
    aileron that the vehicle has as two sides is half their difference."""
    size, about = vehicle.reference, vehicle.points.moment_reference
    text = f'name = "{vehicle.name}"\n[reference]\narea = {size.area}\nchord = {size.chord}\n'
    text += f"span = {size.span}\n"
    text += f"moment_reference = {[0.0, 0.0, 0.0] if about == 'cg' else list(about)}\n"
    for axis, derivatives in PUBLISHED[vehicle.name].items():
        text += f"[derivatives.{axis}]\n"
        for name, value in derivatives.items():
            if name == "delta_aileron" and "aileron_right" in vehicle.surfaces:
                text += f"delta_aileron_right = {value / 2}\ndelta_aileron_left = {-value / 2}\n"
            else:
                text += f'"{name}" = {value}\n'
    return read_native(text)


@lru_cache(maxsize=16)
def _own(name: str) -> AeroDatabase:
    if name == "twin-otter":
        return twin_otter_database()
    if name == effect_flights.vehicle().name:
        return effect_flights.database()
    return read_native(read_example("preflight.toml"))


def database_of(vehicle: Vehicle) -> AeroDatabase:
    """The database of a vehicle of the campaign."""
    return published(vehicle) if vehicle.name in PUBLISHED else _own(vehicle.name)
