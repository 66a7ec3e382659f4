"""Judge a flight by the residuals of its channels before and after reconstruction.

Limits are the vehicle's (`vehicle.Accuracy`), with the declared noise of the sensor beside them.
Rejected: accelerations, rates or qbar fail, so that nothing may be identified from the flight.
Limited: a channel fails that only some uses need; the reasons name it. Limits and words:
docs/reference/conventions.md, "Consistency verdicts".
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from aerodb.consistency.kinematics import INPUTS
from aerodb.consistency.pressures import residuals_as_angles
from aerodb.consistency.reconstructed import ReconstructedPath, Reconstruction
from aerodb.consistency.records import flight_of
from aerodb.consistency.sensors import (
    AIR_DATA,
    CALM_GUST_SPEED,
    FlowCheck,
    ProcessNoise,
    SensorFault,
    VelocityCheck,
    process_noise,
    residual_noise,
)
from aerodb.remarks import (
    DEPARTURE,
    FAULT,
    FLOW_AGAINST_VELOCITY,
    KNOWN_SENSOR_ERROR,
    MOVING_AIR,
    NOT_CHECKED,
    NOT_CONVERGED,
    POSITION_AGAINST_VELOCITY,
    RATES_AGAINST_ATTITUDE,
    RESIDUAL,
    SENSOR_ERROR,
    WIDE_LIMITS,
    Remark,
    sentences,
)
from aerodb.support import QUARTER
from aerodb.vehicle import Accuracy

VerdictWord = Literal["good", "limited", "rejected"]
_RANK: tuple[VerdictWord, ...] = ("good", "limited", "rejected")

#: Factor of the limit from which a residual of velocity over the earth, or of two attitude angles,
#: is an error of accelerations or rates.
GROSS = 3.0
#: Ratio of a limit of `[accuracy]` to the product's from which it is said with every verdict.
WIDE = 10.0

#: Smallest fraction of a flight's records with moving air that limits the whole flight.
LEAST_MOVING = QUARTER


@dataclass(frozen=True)
class ChannelCheck:
    """One channel: rms residual before and after the reconstruction and its limit (SI; nan: none),
    and the verdict."""

    channel: str
    before: float
    after: float
    limit: float
    verdict: VerdictWord


@dataclass(frozen=True)
class Verdict:
    """The verdict on a flight: `word`, the remarks that are its reasons (none when good), one check
    per channel, and the gusts found."""

    word: VerdictWord
    remarks: tuple[Remark, ...]
    channels: tuple[ChannelCheck, ...]
    process_noise: ProcessNoise | None = None

    @property
    def reasons(self) -> tuple[str, ...]:
        """The reasons in words."""
        return tuple(sentences(self.remarks))

    def with_first(self, word: VerdictWord, remark: Remark) -> "Verdict":
        """Return the verdict with one more reason, before the others; the worse word counts
        (docs/method/consistency.md, section "Verdict")."""
        return replace(self, word=_worst([self.word, word]), remarks=(remark, *self.remarks))

    def with_last(self, word: VerdictWord, remark: Remark) -> "Verdict":
        """Return the verdict with one more reason, after the others; the worse word counts
        (docs/method/consistency.md, section "Verdict")."""
        return replace(self, word=_worst([self.word, word]), remarks=(*self.remarks, remark))


def with_limits_said(verdict: Verdict, accuracy: Accuracy) -> Verdict:
    """Return the verdict with a remark on limits that are `WIDE` times the product's or more,
    dimensionless ratios; it judges nothing. Source: `docs/method/consistency.md`, section
    "Verdict"."""
    usual = Accuracy().model_dump()
    ratios = {name: value / usual[name] for name, value in accuracy.model_dump().items()}
    wide = {name: (ratio, "1") for name, ratio in ratios.items() if ratio >= WIDE}
    return verdict.with_last("good", Remark(WIDE_LIMITS, tuple(wide), wide)) if wide else verdict


def judge(
    result: Reconstruction,
    flight: str,
    accuracy: Accuracy,
    faults: Sequence[SensorFault] = (),
    left_out: Mapping[str, float] | None = None,
    calibrated: Collection[str] = (),
    noise: Mapping[str, float] | None = None,
) -> Verdict:
    """The verdict on one flight of a joint reconstruction.

    In moving air only the mean and trend of the air data's residuals are judged: the rest is gusts,
    not sensor errors.

    Parameters
    ----------
    result : reconstruction of one or several flights.
    flight : id of the flight to judge.
    accuracy : limits of the vehicle.
    faults : gross faults (`expected.detect_faults`); each rejects the flight.
    left_out : channel that has left the estimate -> its rms disagreement before, SI. Each limits
        the flight; nothing else is judged by it.
    calibrated : parameters that a calibration names: known and removed, whatever their size, they
        limit a flight but do not reject it.
    noise : channel -> standard deviation of its white noise as declared, SI: the limits are of
        errors, and noise adds to them (root sum of squares).
    """
    left_out = left_out or {}
    paths = [residuals_as_angles(path) for path in result.paths if flight_of(path.record) == flight]
    speed = float(np.mean(np.concatenate([path.V for path in paths])))
    moving = moving_air(paths, left_out)
    checks, remarks = [], list[Remark]()
    words: list[VerdictWord] = []
    for name in dict.fromkeys(name for path in paths for name in path.residuals):
        before, after = (
            _rms(path.before.get(name) for path in paths),
            _rms(path.residuals.get(name) for path in paths),
        )
        limit = _limit(name, accuracy, speed, _mean_pressure(paths), noise)
        if name in left_out:
            checks.append(ChannelCheck(name, before, left_out[name], limit, "limited"))
            words.append("limited")
            remarks.append(_remark(DEPARTURE, checks[-1]))
            continue
        rest = [_judged_rms(path, name, moving.matters) for path in _with(name, paths)]
        check = ChannelCheck(name, before, after, limit, _word(name, rest, limit))
        checks.append(check)
        if check.verdict != "good":
            words.append(check.verdict)
            remarks.append(_remark(RESIDUAL, check))
    gross = [
        check.channel
        for check in checks
        if check.channel in ("phi", "theta", "psi") and check.after > GROSS * check.limit
    ]
    if len(gross) > 1:  # one angle alone is an error of its own sensor: a compass, a vertical gyro
        words.append("rejected")
        remarks.append(Remark(RATES_AGAINST_ATTITUDE, tuple(gross)))
    bound = [estimate.parameter.name for estimate in result.estimates if estimate.at_bound]
    for estimate in result.estimates:
        item = estimate.parameter
        if (
            item.kind in ("bias", "scale", "delay", "port")
            and not (
                item.scope or estimate.at_bound
            )  # a value at its bound is not an estimate, and its error is unknown
            and abs(estimate.value) - 2 * estimate.standard_error > item.size
        ):
            gross_bias = (
                item.kind == "bias"
                and item.subject in (*INPUTS, "qbar")
                and abs(estimate.value) > GROSS * item.size
                and item.name not in calibrated
            )
            # another parameter at its bound distorts this one: that does not prove a broken sensor
            words.append("rejected" if gross_bias and not bound else "limited")
            sizes = {"value": float(estimate.value), "serviceable": item.size}
            values = {name: (size, "SI") for name, size in sizes.items()}
            kind = KNOWN_SENSOR_ERROR if item.name in calibrated else SENSOR_ERROR
            remarks.append(Remark(kind, (item.label, *bound), values))
    for fault in faults:
        words.append("rejected")
        remarks.append(Remark(FAULT, fault.channels, text=fault.sentence))
    if not result.converged:
        words.append("limited")
        remarks.append(Remark(NOT_CONVERGED))
    if moving.matters:
        words.append("limited")
        gusts = {name: (float(size), "m/s") for name, size in moving.gusts.items()}
        remarks.append(Remark(MOVING_AIR, tuple(moving.gusts), gusts, moving.because))
    return Verdict(_worst(words), tuple(remarks), tuple(checks), moving)


def moving_air(paths: Sequence[ReconstructedPath], left_out: Collection[str] = ()) -> ProcessNoise:
    """Return whether the air moved in at least a quarter of these records; the figures are those of
    the worst one. `left_out`: channels that have left the estimate and prove nothing.

    A record counts by its residuals (n,) of the air data, gusts [m/s]. Source:
    `docs/method/consistency.md`, section "Verdict".
    """
    judged = [_moving(_without(residuals_as_angles(path), left_out)) for path in paths]
    worst = max(judged, key=lambda entry: (entry.matters, max(entry.gusts.values(), default=0.0)))
    share = float(np.mean([entry.matters for entry in judged]))
    return worst if share >= LEAST_MOVING else replace(worst, matters=False)


def disagreements(
    paths: Sequence[ReconstructedPath],
    accuracy: Accuracy,
    noise: Mapping[str, float] | None = None,
) -> dict[str, tuple[float, float]]:
    """Channel with a limit -> rms of its residual, judged as in `judge`, and the limit, SI."""
    shown = [residuals_as_angles(path) for path in paths]
    speed = float(np.mean(np.concatenate([path.V for path in shown])))
    moving, found = moving_air(paths).matters, {}
    for name in dict.fromkeys(name for path in shown for name in path.residuals):
        limit = _limit(name, accuracy, speed, _mean_pressure(shown), noise)
        rest = [_judged_rms(path, name, moving) for path in _with(name, shown)]
        if rest and np.isfinite(limit):
            found[name] = (float(np.sqrt(np.mean(np.square(rest)))), limit)
    return found


def _without(path: ReconstructedPath, names: Collection[str]) -> ReconstructedPath:
    kept = {name: values for name, values in path.residuals.items() if name not in names}
    return replace(path, residuals=kept)


def _moving(path: ReconstructedPath) -> ProcessNoise:
    """Return whether the air moved during one record; if the airspeed is the only air data, it is
    compared with the velocity over the earth."""
    noise = process_noise(path.residuals, float(np.mean(path.V)), path.record.step)
    felt = noise.gusts.get("V", 0.0)
    if noise.matters or set(noise.gusts) != {"V"} or felt <= CALM_GUST_SPEED:
        return noise
    over_earth = [name for name in ("velocity_north", "velocity_east") if name in path.residuals]
    wobble = [
        residual_noise(path.residuals[name], path.record.step).gusts
        for name in over_earth
        if _with(name, [path])
    ]
    if not wobble or felt <= 2.0 * max(wobble):
        return noise
    because = (
        f"the airspeed holds gusts ({felt:.2f} m/s rms) that the velocity over the earth does not"
        " share"
    )
    return replace(noise, matters=True, because=because)


def unchecked(because: str) -> Verdict:
    """Return the verdict on a flight whose kinematics cannot be checked: its channels stay as
    measured."""
    return Verdict("limited", (Remark(NOT_CHECKED, text=because),), ())


def as_document(verdict: Verdict) -> dict[str, Any]:
    """Return it as JSON, in SI units (docs/reference/conventions.md, section "Consistency
    verdicts"): verdict, reasons (words), verdict_remarks (data), channels, process_noise."""
    noise = None if verdict.process_noise is None else asdict(verdict.process_noise)
    channels = [asdict(check) for check in verdict.channels]
    return {
        "verdict": verdict.word,
        "reasons": list(verdict.reasons),
        "verdict_remarks": [remark.document() for remark in verdict.remarks],
        "channels": channels,
        "process_noise": noise,
    }


def judge_navigation(
    velocity: VelocityCheck | None, flow: FlowCheck | None, accuracy: Accuracy
) -> Verdict:
    """Return the verdict without logged accelerations, from checks of the navigation solution
    alone.

    Velocities [m/s], angles [rad]. Source: `docs/method/consistency.md`, section "Navigation
    solutions".
    """
    words: list[VerdictWord] = []
    remarks, checks = list[Remark](), []
    if velocity is not None:
        worst = max(velocity.rms.values())
        word: VerdictWord = "good" if worst <= accuracy.horizontal_velocity else "rejected"
        checks.append(ChannelCheck("position", worst, worst, accuracy.horizontal_velocity, word))
        if word != "good":
            words.append(word)
            sizes = {**velocity.rms, "jump": velocity.jump, "limit": accuracy.horizontal_velocity}
            values = {name: (size, "m/s") for name, size in sizes.items()}
            remarks.append(Remark(POSITION_AGAINST_VELOCITY, tuple(velocity.rms), values))
    if flow is not None:
        word = (
            "good"
            if flow.rms <= accuracy.flow_angle
            else "rejected"
            if flow.rms > GROSS * accuracy.flow_angle
            else "limited"
        )
        checks.append(ChannelCheck("alpha", flow.rms, flow.rms, accuracy.flow_angle, word))
        if word != "good":
            words.append(word)
            sizes = {"mean": flow.mean, "deviation": flow.deviation, "limit": accuracy.flow_angle}
            values = {name: (float(size), "rad") for name, size in sizes.items()}
            remarks.append(Remark(FLOW_AGAINST_VELOCITY, ("alpha",), values))
    return Verdict(_worst(words), tuple(remarks), tuple(checks))


def _worst(words: Iterable[VerdictWord]) -> VerdictWord:
    return max(words, key=_RANK.index, default="good")


def _rms(pieces: Iterable[np.ndarray | None]) -> float:
    """Root mean square of the finite values; nan where there are none."""
    values = np.concatenate([np.zeros(0), *(piece for piece in pieces if piece is not None)])
    return float(np.sqrt(np.nanmean(values**2))) if np.isfinite(values).any() else float("nan")


def _mean_pressure(paths: Sequence[ReconstructedPath]) -> float:
    values = [path.record.outputs["qbar"] for path in paths if "qbar" in path.record.outputs]
    return float(np.nanmean(np.concatenate(values))) if values else float("nan")


def _judged_rms(path: ReconstructedPath, name: str, moving: bool) -> float:
    """Rms of a channel's residual over one record; of air data in moving air, only the mean and
    trend: the rest is gusts."""
    residual = path.residuals[name]
    if not (moving and name in AIR_DATA):
        return float(np.sqrt(np.nanmean(residual**2)))
    index = np.flatnonzero(np.isfinite(residual))
    slow = np.polynomial.Polynomial.fit(index, residual[index], 1)(index)
    return float(np.sqrt(np.mean(slow**2)))


def _with(name: str, paths: Sequence[ReconstructedPath]) -> list[ReconstructedPath]:
    return [
        path for path in paths if name in path.residuals and np.isfinite(path.residuals[name]).any()
    ]


def navigation_limits(accuracy: Accuracy) -> dict[str, float]:
    """Return channel of a navigation solution -> limit of its rms difference, a scalar in [m/s] or
    [m], from `Accuracy`."""
    return {
        **dict.fromkeys(("velocity_north", "velocity_east"), accuracy.horizontal_velocity),
        "velocity_down": accuracy.climb_rate,
        **dict.fromkeys(("north", "east"), accuracy.lateral_position),
        "altitude": accuracy.altitude,
    }


def _limit(
    name: str,
    accuracy: Accuracy,
    speed: float,
    pressure: float,
    noise: Mapping[str, float] | None,
) -> float:
    """Limit of a channel's rms residual, SI; nan: none. Its declared noise is no error."""
    limits = {
        **navigation_limits(accuracy),
        **dict.fromkeys(("phi", "theta", "psi"), accuracy.attitude),
        **dict.fromkeys(("alpha", "beta"), accuracy.flow_angle),
        "V": 0.5 * accuracy.qbar_fraction * speed,  # qbar goes with the square of the speed
        "qbar": accuracy.qbar_fraction * pressure,
    }
    return float(np.hypot(limits.get(name, float("nan")), (noise or {}).get(name, 0.0)))


def _word(name: str, rest: Sequence[float], limit: float) -> VerdictWord:
    """The verdict on a channel from its rms residual in each record; failing in most of them can
    reject the flight."""
    if not rest or not np.sqrt(np.mean(np.square(rest))) > limit:
        return "good"
    worst = GROSS * limit if name.startswith("velocity_") else limit
    failed = name in ("V", "qbar") or name.startswith("velocity_")
    return "rejected" if failed and float(np.median(rest)) > worst else "limited"


def _remark(kind: str, check: ChannelCheck) -> Remark:
    """Return what is left of a channel's residual, and its limit."""
    angle = check.channel in ("phi", "theta", "psi", "alpha", "beta")
    metres = dict.fromkeys(("north", "east", "altitude"), "m")
    unit = "rad" if angle else {"qbar": "Pa", **metres}.get(check.channel, "m/s")
    values = {"rms": (float(check.after), unit), "limit": (float(check.limit), unit)}
    return Remark(kind, (check.channel,), values)
