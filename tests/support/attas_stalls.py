"""The two measured ATTAS stalls beside an attached-flow database: as they are, and with alpha
corrected by kinematics.

The accelerometers are taken where they are in the manoeuvre files: the cockpit's accelerometer is
6.7 and 7.1 m ahead of those recorded here, 7.2 m in fAttasElv1 and 6.2 m from the CG, where the
pack's text has them. The attached flow is that of fAttasElv1 (128 m/s): its slopes with alpha,
pitch rate and elevator; level and slopes are corrected on each stall record.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from aerodb.coefficients.comparison import Comparison, band_limited, compare
from aerodb.coefficients.total import total_coefficients
from aerodb.consistency.output_error.reconstruction import reconstruct
from aerodb.consistency.reconstructed import Reconstruction
from aerodb.consistency.records import records_from_flight
from aerodb.effects.aerodynamic.lift_like import zero_lift_alpha
from aerodb.effects.stall.stall_shape import StallFlight, blocked
from aerodb.flight import Flight
from aerodb.logs.mapping import choose_mapping, map_recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.tabular import read_tabular
from aerodb.support.arrays import Array
from aerodb.tables.database import AeroDatabase, Term
from aerodb.tables.expression import Operation, number, parse
from aerodb.tables.program import evaluate
from aerodb.tables.reference import ReferenceGeometry
from aerodb.vehicle import Vehicle, parse_vehicle
from tests.support.consistency_records import ATTAS_BIASES, BOOM

VEHICLE = """
name = "attas"
[reference]
area = 64.0
chord = 3.159
span = 21.5
[points]
moment_reference = [-0.02, -0.01, -0.12]
imu = [-1.010, 0.886, 0.103]
[mass]
source = "constant"
mass = 17631.0
cg = [0.0, 0.0, 0.0]
Ixx = 133367.0
Iyy = 252687.0
Izz = 359593.0
Ixz = 11442.0
[thrust]
source = "channel"
point = [-1.343, 0.0, -0.652]
"""
#: Biases of fAttasElv1 (SOURCE.md, free initial states).
PUBLISHED = dict(
    zip(
        ATTAS_BIASES,
        (0.00676242, -0.00150664, 0.0839892, 0.00102555, 0.00340891, 0.000996192),
        strict=True,
    )
)
#: Regressors of the attached flow per axis; on stall records they are what may be corrected of it.
ATTACHED = {
    "C_lift": ("1", "alpha", "q_hat", "delta_elevator"),
    "C_drag": ("1", "alpha", "alpha^2", "q_hat", "delta_elevator"),
    "Cm": ("1", "alpha", "q_hat", "delta_elevator"),
}
#: Band [Hz] in which the stall is looked at: above it is buffet.
BAND = 0.8


def attas() -> Vehicle:
    return parse_vehicle(VEHICLE)


def as_recorded(path: Path) -> Flight:
    """A record through its mapping, accelerations at the accelerometers, without the channels that
    are no good.

    Heading jumps by 180 deg in the stall files, and their altitude is in another unit than in the
    others. Flaps, spoilers and direct-lift flaps stand still within a tenth of a degree: what moves
    there is the pick-off.
    """
    recording = read_tabular(path)
    flight = map_recording(
        recording, choose_mapping(recording, builtin_mappings().values()), attas(), path.stem
    )
    no_good = ("psi", "altitude", "latitude", "longitude", "delta_flap")
    still = tuple(
        f"delta_{name}_{side}" for name in ("direct_lift", "spoiler") for side in ("left", "right")
    )
    kept = {
        name: values for name, values in flight.channels.items() if name not in (*no_good, *still)
    }
    kept |= {f"{name}_imu": kept.pop(name) for name in ("ax", "ay", "az") if name in kept}
    kept["qbar"] = 0.5 * kept["rho"] * kept["V"] ** 2
    for name in ("alphadot", "betadot"):
        kept.pop(name, None)
    return replace(flight, channels=kept)


def reconstructed(flights: list[Flight], free: tuple[str, ...], at_boom: bool) -> Reconstruction:
    """Both records jointly, half a minute a stretch: biases of accelerometers and gyros, and what
    is `free` beside."""
    records = []
    for flight in flights:
        keep = ("V", "alpha", "beta", "phi", "theta")
        for record in records_from_flight(flight, attas(), seconds=40.0):
            outputs = {name: record.outputs[name] for name in keep}
            records.append(
                replace(record, outputs=outputs, arm=BOOM if at_boom else (0.0, 0.0, 0.0))
            )
    return reconstruct(records, (*ATTAS_BIASES, *free), initial=("u", "v", "w", "phi", "theta"))


def corrected(flight: Flight, biases: dict[str, float], moved: bool = True) -> Flight:
    """The flight without these biases of accelerometers and gyros, and V, alpha, beta moved from
    the boom to the CG."""
    channels = {
        name: flight[name] - biases[f"{name[:2]}_bias"] for name in ("ax_imu", "ay_imu", "az_imu")
    }
    channels |= {name: flight[name] - biases[f"{name}_bias"] for name in "pqr"}
    if moved:
        rates = np.column_stack([channels[name] for name in "pqr"])
        speed, alpha, beta = (flight[name] for name in ("V", "alpha", "beta"))
        probe = speed * np.array(
            [np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)]
        )
        u, v, w = probe - np.cross(rates, BOOM).T
        speed = np.sqrt(u * u + v * v + w * w)
        channels |= {
            "V": speed,
            "alpha": np.arctan2(w, u),
            "beta": np.arcsin(v / speed),
            "qbar": 0.5 * flight["rho"] * speed**2,
        }
    return flight.with_channels(channels)


def empty_database() -> AeroDatabase:
    return AeroDatabase("attas", ReferenceGeometry(64.0, 3.159, 21.5, (-0.02, -0.01, -0.12)))


def compared(flight: Flight, database: AeroDatabase) -> Comparison:
    vehicle = attas()
    return compare(flight, total_coefficients(flight, vehicle), database, vehicle.reference)


def regressors(flight: Flight, names: tuple[str, ...]) -> Array:
    """(n, k) columns of `ATTACHED` along a flight."""
    channels = {**flight.channels, "q_hat": flight["q"] * 3.159 / (2.0 * flight["V"])}
    return np.column_stack(
        [np.broadcast_to(evaluate(parse(name), channels), flight.time.shape) for name in names]
    )


def attached_database(elevator: Path) -> AeroDatabase:
    """The attached-flow database: least squares on fAttasElv1, alpha corrected for the boom."""
    flight = corrected(as_recorded(elevator), PUBLISHED)
    comparison = compared(flight, empty_database())
    terms = []
    for axis, names in ATTACHED.items():
        values = np.linalg.lstsq(regressors(flight, names), comparison.measured[axis], rcond=None)[
            0
        ]
        for name, value in zip(names, values, strict=True):
            terms.append(
                Term(
                    f"{axis}_{len(terms)}", axis, Operation("*", number(float(value)), parse(name))
                )
            )
    return replace(empty_database(), terms=tuple(terms))


def stall_flight(flight: Flight, database: AeroDatabase) -> StallFlight:
    """A stall as shapes see it: residual beside the attached-flow database, whose linear terms may
    be corrected."""
    comparison = compared(flight, database)
    return StallFlight(
        flight=flight.id,
        time=flight.time,
        alpha=flight["alpha"],
        V=flight["V"],
        chord=database.reference.chord,
        residual={axis: comparison.residual(axis) for axis in ATTACHED},
        nuisance={axis: regressors(flight, names) for axis, names in ATTACHED.items()},
        usable=np.logical_and.reduce([comparison.usable[axis] for axis in ATTACHED]),
        alpha_0=zero_lift_alpha(database),
    )


def stall_window(flight: StallFlight) -> slice:
    """From onset to reattachment: where alpha last rises through nine tenths of its maximum, to the
    minimum that follows."""
    peak = int(np.argmax(flight.alpha))
    onset = int(np.flatnonzero(flight.alpha[:peak] < 0.9 * flight.alpha[peak])[-1]) + 1
    after = peak + int(np.argmin(flight.alpha[peak : peak + round(10.0 / flight.step)]))
    return slice(onset, after + 1)


def window_rms(left: Array, flight: StallFlight) -> float:
    """Rms of what is left in the stall window, low-passed at BAND."""
    return float(np.sqrt(np.mean(band_limited(left, flight.step, BAND)[stall_window(flight)] ** 2)))


def without_stall(fitted: StallFlight, predicted: StallFlight) -> dict[str, Array]:
    """The residual of one flight with the attached flow corrected on another, as shapes do it, and
    nothing else."""
    left = {}
    for axis, residual in fitted.residual.items():
        values = np.linalg.lstsq(
            blocked(fitted, fitted.nuisance[axis]), blocked(fitted, residual), rcond=None
        )[0]
        left[axis] = predicted.residual[axis] - predicted.nuisance[axis] @ values
    return left
