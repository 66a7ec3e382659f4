"""Check every navigation solution of a flight: against the reconstructed motion, against the other
solutions, and its position against its own velocity.

An on-board filter, an inertial platform and a satellite receiver may be logged side by side. The
motion integrated from accelerations and rates is a solution of its own, and tells which of two that
disagree is wrong ("Data Analysis of Phoenix Reusable Launch Vehicle Demonstrator Flight Test",
section III).
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations
from typing import Any, Final

import numpy as np
from scipy.ndimage import uniform_filter1d

from aerodb.conditioning import SETTLED
from aerodb.consistency.kinematics import INPUTS
from aerodb.consistency.reconstructed import ReconstructedPath, Reconstruction
from aerodb.consistency.records import IGNORED_FLAGS, inertial_inputs
from aerodb.consistency.sensors import MAX_DELAY, predict_outputs
from aerodb.consistency.verdict import navigation_limits
from aerodb.flight import Flight
from aerodb.nomenclature import NAVIGATION
from aerodb.remarks import SOLUTION, Remark
from aerodb.signals import integrated
from aerodb.support import Array
from aerodb.vehicle import Vehicle

#: What else a channel is compared with: the reconstructed motion, or the solution's own velocity.
MOTION: Final = "motion"
OWN: Final = "its velocity"

#: Name of the solution that the mapping takes, which the reconstruction uses.
MAPPED: Final = "mapped"


_AXES: Final = (
    ("north", "velocity_north"),
    ("east", "velocity_east"),
    ("altitude", "velocity_down"),
)


@dataclass(frozen=True)
class NavigationCheck:
    """One channel of a navigation solution, SI.

    source : its name in the vehicle file, or `MAPPED`. channel : without the source's name.
    against : ``motion`` (reconstructed), another source, or ``its velocity``.
    mean, rms : of the difference; of positions, the rms about the mean, as origins differ.
    delay : by which the solution lags the motion [s], removed before; nan where not estimated.
    limit : of the rms. good : whether it is within its limit.
    """

    source: str
    channel: str
    against: str
    mean: float
    rms: float
    delay: float
    limit: float
    good: bool

    def document(self) -> dict[str, Any]:
        """Return it as JSON: rms and limit in SI units, delay [s] or null where it is not known."""
        return {**asdict(self), "delay": None if np.isnan(self.delay) else self.delay}

    @property
    def remark(self) -> Remark:
        """What is wrong, as data (rms and limit, scalars in SI units) and in words."""
        values = {"rms": (self.rms, self._unit), "limit": (self.limit, self._unit)}
        subjects = (self.source, self.channel, self.against)
        return Remark(SOLUTION, subjects, values, self.sentence)

    @property
    def _unit(self) -> str:
        return "m/s" if self.channel.startswith("velocity") or self.against == OWN else "m"

    @property
    def sentence(self) -> str:
        """What is wrong (rms and limit, SI units), where, and what to look at, for `remark`."""
        what = f"navigation: {self.channel} of {_named(self.source)}"
        unit = self._unit
        figure = f"{self.rms:.2g} {unit} rms; limit {self.limit:g} {unit}"
        if self.against == OWN:
            return f"{what} is not the integral of its velocity ({figure}): look at the filter"
        other = "the motion of accelerations and rates"
        other = other if self.against == MOTION else _named(self.against)
        return f"{what} differs from {other} ({figure})"


def _named(source: str) -> str:
    return "the mapped solution" if source == MAPPED else source


def check_navigation(
    flight: Flight, vehicle: Vehicle, result: Reconstruction
) -> tuple[NavigationCheck, ...]:
    """Check all navigation solutions of one flight.

    A solution's delay is estimated against the motion and removed; a negative one is not. A channel
    is compared with the motion where the mapped solution has it too: the motion alone drifts.

    Parameters
    ----------
    flight : mapped flight, with channels such as ``velocity_north_dgps`` of [navigation.dgps].
    vehicle : points of the solutions and limits.
    result : reconstruction of the flight.
    """
    cg = inertial_inputs(flight, vehicle).cg if vehicle.navigation else np.zeros(3)
    limits = navigation_limits(vehicle.accuracy)
    checks: list[NavigationCheck] = []
    left: dict[str, dict[str, Array]] = {}
    for source in (MAPPED, *vehicle.navigation):
        end = "" if source == MAPPED else f"_{source}"
        names = {base: f"{base}{end}" for base in NAVIGATION if f"{base}{end}" in flight}
        point = vehicle.points.gps if source == MAPPED else vehicle.navigation[source].point
        arm = None if point is None else np.asarray(point) - cg
        if not names:
            continue
        pieces = [_piece(flight, path, names) for path in result.paths]
        checks += _own(source, pieces, limits)
        if not vehicle.navigation:  # the mapped solution alone is judged with the flight's channels
            break
        pieces = [
            _with_motion(piece, path, arm, result)
            for piece, path in zip(pieces, result.paths, strict=True)
        ]
        left[source] = {}
        for base in names:
            check, error = _against_motion(source, base, pieces, limits[base])
            left[source][base] = error
            if source != MAPPED and _motion_known(base, result.paths):
                checks.append(check)
    for one, other in combinations(left, 2):
        for base in (base for base in left[one] if base in left[other]):
            apart = left[one][base] - left[other][base]
            if np.isfinite(apart).any():
                checks.append(_judged(one, base, other, apart, float("nan"), limits[base]))
    return tuple(checks)


@dataclass(frozen=True)
class _Piece:
    """A solution along one record: `step` [s], what it `showed` and what the motion `gives` at its
    point, channel -> (n,), SI; nan where it has no sample."""

    step: float
    showed: Mapping[str, Array]
    gives: Mapping[str, Array]


def _piece(flight: Flight, path: ReconstructedPath, names: Mapping[str, str]) -> _Piece:
    """Return what a solution showed along a record."""
    record = path.record
    n = len(record.inputs)
    index = record.first + round(record.step / flight.step) * np.arange(n)
    index = np.minimum(index, len(flight.time) - 1)
    showed = {}
    for base, name in names.items():
        good = flight.usable((name,), despite=IGNORED_FLAGS)[index]
        showed[base] = np.where(good, flight[name][index], np.nan)
    return _Piece(record.step, showed, {})


def _with_motion(
    piece: _Piece, path: ReconstructedPath, arm: Array | None, result: Reconstruction
) -> _Piece:
    """With what the motion gives at the solution's point, `arm` (3,) from the CG [m]."""
    record, n = path.record, len(path.record.inputs)
    at = (0.0, 0.0, 0.0) if arm is None else (float(arm[0]), float(arm[1]), float(arm[2]))
    seen = replace(
        record,
        outputs={base: np.zeros(n) for base in piece.showed},
        installation=replace(record.installation, gps=at),
    )
    values = {
        entry.parameter.name: entry.value
        for entry in result.estimates
        if entry.parameter.kind == "bias" and entry.parameter.subject in INPUTS
    }
    gives = predict_outputs(seen, values, path.states[:, 0], (), slopes=False).outputs
    return replace(piece, gives=gives)


def _against_motion(
    source: str, base: str, pieces: Sequence[_Piece], limit: float
) -> tuple[NavigationCheck, Array]:
    """The check of a channel against the motion, and its difference without its delay."""
    error = np.concatenate([piece.showed[base] - piece.gives[base] for piece in pieces])
    rate = np.concatenate([np.gradient(piece.gives[base], piece.step) for piece in pieces])
    good = np.isfinite(error)
    delay = float("nan")
    if good.any():
        moves = rate[good] - rate[good].mean()
        size = float(moves @ moves)
        slope = -float(moves @ error[good]) / size if size > 0 else 0.0
        delay = min(max(slope, 0.0), MAX_DELAY)
        error = error + delay * rate
    return _judged(source, base, MOTION, error, delay, limit), error


def _judged(
    source: str, base: str, against: str, error: Array, delay: float, limit: float
) -> NavigationCheck:
    mean = float(np.nanmean(error)) if np.isfinite(error).any() else float("nan")
    level = 0.0 if base.startswith("velocity") else mean
    rms = float(np.sqrt(np.nanmean((error - level) ** 2))) if np.isfinite(mean) else mean
    return NavigationCheck(source, base, against, mean, rms, delay, limit, not rms > limit)


def _motion_known(base: str, paths: Sequence[ReconstructedPath]) -> bool:
    """Return whether the reconstruction holds a channel by another solution: its own, or of a
    velocity its position."""
    place = {velocity: position for position, velocity in _AXES}.get(base, base)
    return all({base, place} & path.record.outputs.keys() for path in paths)


def _own(
    source: str, pieces: Sequence[_Piece], limits: Mapping[str, float]
) -> list[NavigationCheck]:
    """Checks of a solution's positions against its own velocities, where it has both."""
    checks = []
    for position, velocity in _AXES:
        slow = [
            rate
            for piece in pieces
            if position in piece.showed and velocity in piece.showed
            for rate in (_slow_rate(piece, position, velocity),)
            if len(rate)
        ]
        if slow:
            rates = np.concatenate(slow)
            check = _judged(source, velocity, OWN, rates, float("nan"), limits[velocity])
            checks.append(replace(check, channel=position))
    return checks


def _slow_rate(piece: _Piece, position: str, velocity: str) -> Array:
    """Rate [m/s] by which a position leaves the integral of its velocity over `SETTLED` seconds."""
    along, speed = piece.showed[position], piece.showed[velocity]
    sign = -1.0 if position == "altitude" else 1.0
    good = np.isfinite(along) & np.isfinite(speed)
    many = round(SETTLED / piece.step)
    if good.sum() < 3 or len(along) <= many:
        return np.array([])
    index = np.arange(len(along))
    along, speed = (np.interp(index, index[good], each[good]) for each in (along, speed))
    apart = along - sign * integrated(speed, piece.step)
    apart = uniform_filter1d(apart, max(1, round(1.0 / piece.step)))
    rate = (apart[many:] - apart[:-many]) / (many * piece.step)
    return np.asarray(rate[good[many:] & good[:-many]])
