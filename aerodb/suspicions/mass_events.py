"""A mass that leaves or comes aboard in flight: all forces change at once, and no cause is seen.

Aerodynamics are continuous: angle of attack, rates and surfaces tell them before and after. A mass
that jumps divides the same force by another number within one sample, and does so until the end. A
gust passes, flaps and gear take seconds, and the accelerometers of a surface that jerks return.

With the stated mass m, the change dm = k m and s = 0 before and 1 after, the normal force gives

    (1 + k s) C_Z = b x,

where x are 1, alpha, q_hat and the deflections: the time is that of the best fit (a change point:
Chow, Econometrica 28, 1960), k a least-squares estimate. Where the centre of gravity moves forward
by d, the normal force Z adds d Z to the pitching moment about the stated one. Only a database tells
that from the damping of the plunge that begins: alpha and q hardly change apart in a flight.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import BAND, SETTLED, Suspicion
from aerodb.estimation import Regression, least_squares, samples_per_independent
from aerodb.flight import Flight
from aerodb.nomenclature import is_surface
from aerodb.signals import low_passed
from aerodb.support import CLAIM, TWO_SIDED, Array, half_interval, standard_errors
from aerodb.suspicions.derivatives import whole_surface
from aerodb.suspicions.evidence import ERRORS, FEWEST, LIKELIER, SCATTER, SWING
from aerodb.suspicions.in_flight import flying, known_masses
from aerodb.suspicions.lift import STALL
from aerodb.suspicions.surfaces import role_of
from aerodb.vehicle import Vehicle, cg_positions

#: Kind of a suspicion of a mass that jumps.
JUMPED: Final = "jump"
#: Least change of the mass, as a share: fuel, speed and a wrong slope of the lift make less within
#: a stretch.
LEAST: Final = 0.03
#: Time to either side over which a jump must be there [s]: flaps and gear take seconds.
SHARP: Final = 0.2
#: Least change of an angle's channel from one sample to the next that is a jump [rad].
SLIPPED: Final = float(np.deg2rad(0.25))
#: Longest stretch that is fitted as one [s]: within it, fuel and configuration hardly change.
LONGEST: Final = 60.0
#: Loss of log-likelihood at the ends of an interval of 95 %: half of chi-squared of one degree of
#: freedom.
EXCLUDED: Final = 0.5 * TWO_SIDED**2


@dataclass(frozen=True, eq=False)
class _Stretch:
    """Consecutive samples in the air: time (n,), mass [kg], normal force coefficient (n,) by the
    stated mass, what explains it (n, k), and the samples of the flight."""

    time: Array
    mass: float
    normal: Array
    basis: Array
    samples: slice


@dataclass(frozen=True)
class _Jump:
    """Where a stretch changes (its own sample, and the first and last that are as likely), by which
    share of the mass, its standard error, and how much likelier that is."""

    at: int
    first: int
    last: int
    share: float
    error: float
    gain: float


def mass_event_suspicions(flight: Flight, vehicle: Vehicle) -> tuple[Suspicion, ...]:
    """Return the clearest jump of the mass in a flight: its time [s] and the mass [kg], with its
    standard error.

    Channels (n,) in SI units. Needs a normal acceleration, alpha and qbar. Accelerometers away from
    the CG are taken as if at it. Source: `docs/method/consistency.md`, section "Against the
    vehicle".
    """
    found = _clearest(flight, vehicle)
    if found is None:
        return ()
    stretch, jump = found
    since, first, last = (float(stretch.time[k]) for k in (jump.at, jump.first, jump.last))
    pitch = [name for name in flight.channels if is_surface(name) and role_of(name) == "pitch"]
    alike = ", ".join(dict.fromkeys(("az", *(whole_surface(name, flight) for name in pitch))))
    words = (
        f"all forces change at {since:.2f} s ({first:.2f} to {last:.2f} s, 95 %) as if"
        f" {_moved(stretch, jump)}, and nothing else is seen to change. A gain or zero of {alike}"
        " or alpha that changes looks alike. State it as [[mass.event]]"
        f' of the vehicle file, with flight = "{flight.id[:12]}"'
    )
    evidence = {
        "from": since, "earliest": first, "latest": last, "mass": jump.share * stretch.mass,
        "mass_error": jump.error * stretch.mass,
    }  # fmt: skip
    return (Suspicion("mass", JUMPED, words, evidence),)


def shift_beside(
    flight: Flight,
    vehicle: Vehicle,
    measured: Mapping[str, Array],
    predicted: Mapping[str, Array],
    usable: Mapping[str, NDArray[np.bool_]],
    bandwidth: float | None,
) -> list[Suspicion]:
    """Return how far the CG moves along x [m] where the mass jumps, by the pitching moment that the
    database leaves, and the mass [kg]: beside reconstructed angles it is surer than at ingest.

    The database may have another level of the pitching moment; its slopes are taken as right, which
    the motion after the jump hardly tests. measured, predicted : coefficient -> (n,). usable : the
    same, masks. bandwidth : of both [Hz]; None: not limited.
    """
    found = _clearest(flight, vehicle) if "Cm" in measured else None
    if found is None:
        return []
    stretch, jump = found
    piece, step = stretch.samples, flight.step
    after = np.arange(len(stretch.time)) >= jump.at
    lever = -stretch.normal * (1.0 + jump.share) * after / vehicle.reference.chord
    if bandwidth is not None:
        lever = low_passed(lever, step, min(bandwidth, 0.4 / step))
    there = predicted["Cm"][piece]
    good = usable["Cm"][piece] & np.isfinite(there) & np.isfinite(measured["Cm"][piece])
    if min(int((good & after).sum()), int((good & ~after).sum())) < FEWEST:
        return []
    columns = np.column_stack([np.ones_like(lever), lever])[good]
    try:
        fit = least_squares(columns, (measured["Cm"][piece] - there)[good], ("1", "shift"))
    except ValueError:
        return []
    shift, error = float(fit.estimates[-1]), float(fit.standard_errors[-1])
    if not abs(shift) > ERRORS * error:
        return []
    change = jump.share * stretch.mass
    place = cg_positions(flight, vehicle)[piece][jump.at, 0] + shift * (1.0 + stretch.mass / change)
    words = (
        f"the pitching moment changes at {stretch.time[jump.at]:.2f} s as if the CG moved by"
        f" {shift:.2g} +- {half_interval(error):.1g} m along x, where {_moved(stretch, jump)}:"
        f" from x = {place:.3g} m"
    )
    evidence = {
        "shift": shift, "shift_error": error, "position": float(place),
        "mass": change, "mass_error": jump.error * stretch.mass,
    }  # fmt: skip
    return [Suspicion("cg_x", JUMPED, words, evidence)]


def _moved(stretch: _Stretch, jump: _Jump) -> str:
    mass, error = jump.share * stretch.mass, jump.error * stretch.mass
    how = "leave the aircraft" if mass < 0.0 else "come aboard"
    return f"{abs(mass):.4g} +- {half_interval(error):.2g} kg {how}"


def _clearest(flight: Flight, vehicle: Vehicle) -> tuple[_Stretch, _Jump] | None:
    """The stretch of a flight whose mass jumps most clearly, and the jump; none where that is a
    channel's."""
    found = [
        (stretch, jump)
        for stretch in _stretches(flight, vehicle)
        if (jump := _jump(stretch)) is not None
    ]
    best = max(found, key=lambda each: each[1].gain, default=None)
    return None if best is None or _channel_jumps(flight, *best) else best


def _channel_jumps(flight: Flight, stretch: _Stretch, jump: _Jump) -> bool:
    """Whether the channel of a surface or of a flow angle jumps there as it does nowhere else: then
    the channel changed, and the lift that it seems to have lost is no mass. Nor is what flaps or
    gear lift on their way, which is in no proportion to it."""
    first, last = max(jump.at - 2, 0), jump.at + 2
    near = round(2.0 * SHARP / flight.step)
    under_way = slice(max(jump.at - near, 0), jump.at + near + 1)
    for name in flight.channels:
        if not is_surface(name) and name not in ("alpha", "beta"):
            continue
        values = flight[name][stretch.samples]
        if is_surface(name) and not role_of(name) and np.ptp(values[under_way]) > SWING:
            return True
        steps = np.abs(np.diff(values))
        here = steps[first:last]
        others = np.concatenate([steps[:first], steps[last:]])
        if here.size and others.size and here.max() > max(2.0 * float(others.max()), SLIPPED):
            return True
    return False


def _stretches(flight: Flight, vehicle: Vehicle) -> list[_Stretch]:
    """Stretches of a flight of at most `LONGEST`, each overlapping the next by half."""
    names = [name for name in ("az", "az_imu") if name in flight][:1]
    known = known_masses(flight, vehicle)
    if not names or not {"alpha", "qbar", "V"} <= set(flight.channels) or "mass" not in known:
        return []
    if vehicle.reference.pressure is not None:
        return []  # no wing carries it
    moving = [n for n in flight.channels if is_surface(n) and np.ptp(flight[n]) > 0.0]
    needed = [*names, "alpha", "qbar", "V", *(["q"] if "q" in flight else []), *moving]
    where = flying(flight, needed) & (flight["qbar"] > 0.0) & np.isfinite(known["mass"])
    where &= np.abs(flight["alpha"]) < STALL
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(int)))
    least, most = max(FEWEST, round(2.0 * SETTLED / flight.step)), round(LONGEST / flight.step)
    listed = []
    for start, stop in edges.reshape(-1, 2).tolist():
        for first in range(start, max(stop - most // 2, start + 1), max(most // 2, 1)):
            piece = slice(first, min(first + most, stop))
            if piece.stop - piece.start < least:
                continue
            mass = known["mass"][piece]
            force = flight["qbar"][piece] * vehicle.reference.area
            columns = {name: flight[name][piece] for name in ("alpha", *moving)}
            if "q" in flight:
                columns["q"] = flight["q"][piece] / flight["V"][piece]
            listed.append(
                _Stretch(
                    flight.time[piece],
                    float(np.median(mass)),
                    -mass * flight[names[0]][piece] / force,
                    _basis(columns),
                    piece,
                )
            )
    return listed


def _basis(columns: Mapping[str, Array]) -> Array:
    """Orthonormal columns (n, k) that span a constant and what is not constant of the columns."""
    n = len(next(iter(columns.values())))
    varying = [values - values.mean() for values in columns.values()]
    scaled = [values / size for values in varying if (size := float(np.linalg.norm(values))) > 0.0]
    whole = np.column_stack([np.full(n, n**-0.5), *scaled])
    squares, turned = np.linalg.eigh(whole.T @ whole)
    kept = squares > 1e-12 * squares[-1]
    return np.asarray(whole @ (turned[:, kept] / np.sqrt(squares[kept])))


def _later(values: Array) -> Array:
    """Sums from each sample on."""
    return np.cumsum(values[::-1], axis=0)[::-1]


def _jump(stretch: _Stretch) -> _Jump | None:
    """The jump that explains most of a stretch, if it is one."""
    y, basis = stretch.normal, stretch.basis
    rest = y - basis @ (basis.T @ y)
    size = _later(y * y) - (_later(basis * y[:, None]) ** 2).sum(axis=1)
    step = float(np.median(np.diff(stretch.time)))
    edge = round(SETTLED / step)
    gains = np.zeros(len(y))
    inside = slice(edge, len(y) - edge)
    gains[inside] = _later(rest * y)[inside] ** 2 / np.maximum(size[inside], 1e-12 * (y @ y))
    at, whole = int(np.argmax(gains)), float(rest @ rest)
    left = whole - float(gains[at])
    if not 0.0 < left < whole:
        return None
    jumps = -y * (np.arange(len(y)) >= at)
    alone = jumps - basis @ (basis.T @ jumps)
    exact = float(alone @ rest) / float(alone @ alone)
    residual = rest - exact * alone
    independent = len(y) / max(1.0, samples_per_independent(residual))
    gain = 0.5 * independent * np.log(whole / left)
    if gain < LIKELIER + np.log(len(y)):
        return None
    fit = _fit(stretch, jumps, step)
    if fit is None:
        return None
    share, error = float(fit.estimates[-1]), float(fit.standard_errors[-1])
    if not abs(share) > max(LEAST, ERRORS * error) or not _is_sharp(
        residual, exact * y, at, max(1, round(SHARP / step))
    ):
        return None
    lost = 0.5 * independent * np.log((whole - gains) / left)
    likely = np.flatnonzero((lost < EXCLUDED) & (gains > 0.0))
    return _Jump(at, int(likely[0]), int(likely[-1]), share, error, float(gain))


def _fit(stretch: _Stretch, jumps: Array, step: float) -> Regression | None:
    """The share, of a column (n,) of `jumps`, below the band's edge, where noise of the vanes
    hardly weakens the slopes."""
    band = min(BAND[1], 0.4 / step)
    columns = np.column_stack([stretch.basis, jumps])
    try:
        smooth_columns = np.column_stack([low_passed(each, step, band) for each in columns.T])
        names = tuple(f"{k}" for k in range(columns.shape[1]))
        return least_squares(smooth_columns, low_passed(stretch.normal, step, band), names)
    except ValueError:
        return None


def _is_sharp(residual: Array, jump: Array, at: int, width: int) -> bool:
    """Whether the jump is there within so many samples, in the size that it has until the end.

    residual : with the jump in the model. jump : what it is by sample, (n,).
    """
    sums = np.concatenate([[0.0], np.cumsum(residual)])
    k = np.arange(width, len(residual) - width)
    around = (sums[k + width] - 2.0 * sums[k] + sums[k - width]) / width
    scale = 1.4826 * float(np.median(np.abs(around)))
    there = abs(float(jump[at]))
    missed = abs(float(around[at - width]))
    return missed < SCATTER * there and there > standard_errors(CLAIM / len(residual)) * scale
