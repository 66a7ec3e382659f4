"""Verdict on a flight: how far its channels are from agreement, before and after, and what that forbids.

Limits are the vehicle's (`vehicle.Accuracy`). Rejected: accelerations, rates or qbar fail, so nothing may be identified from
it. Limited: a channel fails that only some uses need; which, is said.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from aerodb.consistency.expected import Fault
from aerodb.consistency.kinematics import INPUTS
from aerodb.consistency.navigation import FlowCheck, VelocityCheck
from aerodb.consistency.reconstruction import Path, Reconstruction
from aerodb.consistency.whiteness import ProcessNoise, process_noise
from aerodb.vehicle import Accuracy

Word = Literal["good", "limited", "rejected"]
_RANK: tuple[Word, ...] = ("good", "limited", "rejected")

#: Velocity over the earth, or two attitude angles, that miss their limits by this factor take accelerations or rates with them.
GROSS = 3.0


@dataclass(frozen=True)
class ChannelCheck:
    """One channel: rms mismatch before and after the reconstruction, its limit (SI; nan: none), and the verdict."""

    channel: str
    before: float
    after: float
    limit: float
    verdict: Word


@dataclass(frozen=True)
class Verdict:
    """The word for a flight, with reasons (empty when good), the table per channel, and what is known of gusts."""

    word: Word
    reasons: tuple[str, ...]
    channels: tuple[ChannelCheck, ...]
    process_noise: ProcessNoise | None = None


def judge(result: Reconstruction, flight: str, accuracy: Accuracy, found: Sequence[Fault] = ()) -> Verdict:
    """The verdict on one flight of a joint reconstruction; `found` are the blunt faults of `expected.faults`."""
    paths = [path for path in result.paths if path.record.flight == flight]
    speed = float(np.mean(np.concatenate([path.V for path in paths])))
    checks, words, reasons = [], [], []
    for name in dict.fromkeys(name for path in paths for name in path.residuals):
        before, after = _rms(path.before.get(name) for path in paths), _rms(path.residuals.get(name) for path in paths)
        check = _channel(name, before, after, accuracy, speed, _mean_pressure(paths))
        checks.append(check)
        if check.verdict != "good":
            words.append(check.verdict)
            reasons.append(_reason(check))
    gross = [check.channel for check in checks if check.channel in ("phi", "theta", "psi") and check.after > GROSS * check.limit]
    if len(gross) > 1:  # one angle alone is its own sensor: a compass, a vertical gyro
        words.append("rejected")
        reasons.append(f"the rates do not belong to the attitude: {' and '.join(gross)} disagree with them together")
    for estimate in result.estimates:
        item = estimate.parameter
        sensor = item.kind in ("bias", "scale", "delay") and item.scope in ("", flight)
        if sensor and abs(estimate.value) - 2 * estimate.standard_error > item.size:
            words.append("rejected" if item.subject in (*INPUTS, "qbar") and item.kind == "bias" else "limited")
            reasons.append(f"{item.label} of {estimate.value:.3g} is beyond any serviceable sensor ({item.size:g})")
    for fault in found:
        words.append("rejected")
        reasons.append(fault.sentence)
    if not result.converged:
        words.append("rejected")
        reasons.append("the reconstruction did not converge: the channels do not belong to one motion")
    noise = max((process_noise(path.residuals, speed, path.record.step) for path in paths), key=lambda entry: entry.matters)
    if noise.matters:
        words.append("limited")
        reasons.append(noise.because)
    return Verdict(_worst(words), tuple(reasons), tuple(checks), noise)


def judge_navigation(velocity: VelocityCheck | None, flow: FlowCheck | None, accuracy: Accuracy) -> Verdict:
    """The verdict where no accelerations are logged and only the navigation solution can be checked against itself."""
    words: list[Word] = []
    reasons, checks = [], []
    if velocity is not None:
        worst = max(velocity.rms.values())
        word: Word = "good" if worst <= accuracy.horizontal_velocity else "rejected"
        checks.append(ChannelCheck("position", worst, worst, accuracy.horizontal_velocity, word))
        if word != "good":
            words.append(word)
            figures = ", ".join(f"{size:.1f}" for size in velocity.rms.values())
            reasons.append(
                f"position is not the integral of velocity: off by {figures} m/s rms (north, east, down),"
                f" jumps to {velocity.jump:.0f} m/s; limit {accuracy.horizontal_velocity:g} m/s"
            )
    if flow is not None:
        word = "good" if flow.rms <= accuracy.flow_angle else "rejected" if flow.rms > GROSS * accuracy.flow_angle else "limited"
        checks.append(ChannelCheck("alpha", flow.rms, flow.rms, accuracy.flow_angle, word))
        if word != "good":
            words.append(word)
            mean, deviation, limit = np.rad2deg([flow.mean, flow.deviation, accuracy.flow_angle])
            reasons.append(
                f"alpha of velocity less wind differs from the probe by {mean:.1f} deg mean, {deviation:.1f} deg std;"
                f" limit {limit:.1f} deg"
            )
    return Verdict(_worst(words), tuple(reasons), tuple(checks))


def _worst(words: Iterable[Word]) -> Word:
    return max(words, key=_RANK.index, default="good")


def _rms(pieces: Iterable[np.ndarray | None]) -> float:
    values = np.concatenate([piece for piece in pieces if piece is not None])
    return float(np.sqrt(np.nanmean(values**2))) if np.isfinite(values).any() else float("nan")


def _mean_pressure(paths: Sequence[Path]) -> float:
    values = [path.record.outputs["qbar"] for path in paths if "qbar" in path.record.outputs]
    return float(np.nanmean(np.concatenate(values))) if values else float("nan")


def _channel(name: str, before: float, after: float, accuracy: Accuracy, speed: float, pressure: float) -> ChannelCheck:
    limits = {
        **dict.fromkeys(("phi", "theta", "psi"), accuracy.attitude),
        **dict.fromkeys(("alpha", "beta"), accuracy.flow_angle),
        **dict.fromkeys(("velocity_north", "velocity_east"), accuracy.horizontal_velocity),
        **dict.fromkeys(("north", "east"), accuracy.lateral_position),
        "V": 0.5 * accuracy.qbar_fraction * speed,  # qbar goes with the square of the speed
        "qbar": accuracy.qbar_fraction * pressure,
    }
    limit = limits.get(name, float("nan"))
    if not after > limit:
        return ChannelCheck(name, before, after, limit, "good")
    failed = name in ("V", "qbar") or (name.startswith("velocity_") and after > GROSS * limit)
    return ChannelCheck(name, before, after, limit, "rejected" if failed else "limited")


def _reason(check: ChannelCheck) -> str:
    angle = check.channel in ("phi", "theta", "psi", "alpha", "beta")
    after, limit = (np.rad2deg(check.after), np.rad2deg(check.limit)) if angle else (check.after, check.limit)
    unit = "deg" if angle else {"qbar": "Pa", "north": "m", "east": "m"}.get(check.channel, "m/s")
    return f"{check.channel} remains {after:.2g} {unit} from the reconstructed motion; limit {limit:.2g} {unit}"
