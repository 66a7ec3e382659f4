"""Design of manoeuvres: which input, within limits, determines parameters best."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.simulation.engine import FlightModel, simulate, with_feedback
from aerodb.simulation.inputs import Event
from aerodb.simulation.manoeuvre import Manoeuvre, Wave
from aerodb.simulation.replay import FlightStretch
from aerodb.simulation.stabilisation import stabilising_feedback
from aerodb.simulation.trim import Trim
from aerodb.simulation.trim_problem import control_inputs
from aerodb.support import Array
from aerodb.vehicle import Vehicle

#: Sampling of the outputs [s], whose noise is white at this rate.
STEP: Final = 0.02
#: Noise of an output whose sensor the vehicle file does not state (one sigma, SI): small UAV.
NOISE: Final[Mapping[str, float]] = {
    "V": 0.3, "alpha": 0.0035, "beta": 0.0035, "p": 0.0035, "q": 0.0035, "r": 0.0035,
    "phi": 0.005, "theta": 0.005, "ax": 0.1, "ay": 0.1, "az": 0.1,
}  # fmt: skip
#: Unit pulse widths that are tried [s].
_WIDTHS: Final = (0.15, 0.3, 0.6, 1.2)
#: Bands of multisines that are tried, in cycles over the manoeuvre.
_BANDS: Final = ((2, 12), (3, 24), (4, 40))
#: Amplitudes that are tried, as shares of the deflection that is left from trim.
_SHARES: Final = np.array([0.9, 0.6, 0.4, 0.27, 0.18, 0.12, 0.08, 0.05])
#: Time before the first input [s].
_BEFORE: Final = 1.0
#: Time after the last input [s].
_AFTER: Final = 2.0
#: Perturbation of a start [SI] by state, and of a parameter as a share of one of its size.
_STARTS: Final = {
    "V": 0.1, "alpha": 1e-3, "beta": 1e-3, "p": 1e-3, "q": 1e-3, "r": 1e-3, "phi": 1e-3,
    "theta": 1e-3,
}  # fmt: skip
_PARAMETER_STEP: Final = 1e-3


@dataclass(frozen=True, eq=False)
class DesignedManoeuvre:
    """The manoeuvre of those tried that determines the parameters best.

    Parameters
    ----------
    manoeuvre : from trim.
    names : of the p parameters.
    before, after : (p, p) covariance expected without and with it; inf on the diagonal of `before`
        where nothing is known.
    reached : channel -> least and greatest value.
    tried, within : number of manoeuvres that were tried, and that stay within the limits.
    feedback : gains of the artificial stabilisation that it was flown with, if any.
    """

    manoeuvre: Manoeuvre
    names: tuple[str, ...]
    before: Array
    after: Array
    reached: Mapping[str, tuple[float, float]]
    tried: int
    within: int
    feedback: Mapping[tuple[str, str], float]


def design_manoeuvre(
    trimmed: Trim,
    unknown: Mapping[str, str],
    deflections: Mapping[str, tuple[float, float]],
    limits: Mapping[str, tuple[float, float]],
    *,
    duration: float,
    moved: Collection[str] = ("roll", "pitch", "yaw"),
    noise: Mapping[str, float] = NOISE,
    known: Array | None = None,
) -> DesignedManoeuvre:
    """Return the doublet, 3-2-1-1 or multisine on one or several controls that determines
    parameters best: the one with the smallest determinant of their expected covariance.

    Parameters
    ----------
    trimmed : the steady flight that it starts from; its controls in roll, pitch and yaw are moved,
        one after the other or by multisines in adjacent bands.
    unknown : p parameters of the trim's flight model -> their names in answers.
    deflections : input -> its limits [rad]; an input without limits is not moved.
    limits : channel of the simulation -> least and greatest value [SI] that may be reached.
    duration : [s]. moved : names of the controls that may be moved.
    noise : output -> standard deviation of its white noise [SI], sampled every `STEP`.
    known : (p, p) information on the parameters from earlier flights; None: nothing.

    The expected covariance is the Cramer-Rao bound of output error, with the initial states
    unknown: residuals of measured flights are coloured, and standard errors larger.

    Raises InputError where no control can be moved or every manoeuvre leaves the limits.

    References
    ----------
    Morelli & Klein, Aircraft System Identification, 2016, chapter 9. Mulder et al., Progress in
    Aerospace Sciences 30, 1994: input design by the information matrix.
    """
    inputs = dict(trimmed.series)
    found = control_inputs(
        trimmed.problem.model, trimmed.problem.condition, inputs, [*deflections], deflections
    )
    controls = {name: control for name, control in found.items() if name in moved}
    if not controls:
        raise InputError(
            "no control with limits can be moved", "design", "state surfaces in the vehicle file"
        )
    time: Array = np.arange(round(duration / STEP) + 1, dtype=np.float64) * STEP
    candidates = list(_candidates(trimmed, controls, duration))
    model, gains = _stabilised(trimmed, candidates, time)
    best: tuple[float, Any] | None = None
    within = 0
    for candidate in candidates:
        size = _largest(model, trimmed, gains, candidate, time, deflections, limits)
        if size is None:
            continue
        within += 1
        scaled = tuple(_times(each, size) for each in candidate)
        information = _information(model, trimmed, gains, scaled, time, unknown, noise)
        total = information if known is None else information + known
        sign, volume = np.linalg.slogdet(total / np.sqrt(np.outer(np.diag(total), np.diag(total))))
        score = float(volume + np.log(np.diag(total)).sum()) if sign > 0 else -np.inf
        if best is None or score > best[0]:
            best = score, (scaled, total)
    if best is None:
        raise InputError(
            f"all {len(candidates)} manoeuvres leave the limits", "design", "widen the limits"
        )
    chosen, total = best[1]
    run = _flown(model, trimmed, gains, [chosen], time)
    manoeuvre = Manoeuvre(
        "designed", trimmed.problem.condition, trimmed.problem.condition.climb is None, duration,
        {}, chosen,
    )  # fmt: skip
    return DesignedManoeuvre(
        manoeuvre,
        tuple(unknown.values()),
        _covariance(np.zeros((len(unknown),) * 2) if known is None else known),
        _covariance(total),
        {
            name: (float(np.nanmin(run[name])), float(np.nanmax(run[name])))
            for name in dict.fromkeys([*limits, *(each.target for each in chosen)])
        },
        len(candidates),
        within,
        gains,
    )


Inputs = tuple[Event | Wave, ...]


def _candidates(
    trimmed: Trim, controls: Mapping[str, Mapping[str, float]], duration: float
) -> Iterator[Inputs]:
    """Inputs of unit size: every shape on every combination of the controls."""
    active = duration - _BEFORE - _AFTER
    for count in range(1, len(controls) + 1):
        for chosen in combinations(controls.values(), count):
            slot = active / count
            for shape, units in (("doublet", 2), ("3211", 7)):
                for width in _WIDTHS:
                    if units * width <= slot:
                        yield tuple(
                            Event(surface, _BEFORE + k * slot, width, gain, shape)
                            for k, control in enumerate(chosen)
                            for surface, gain in control.items()
                        )
            for low, high in _BANDS:
                edges = np.linspace(low, high, count + 1) / active
                if edges[-1] < 0.1 / STEP:
                    yield tuple(
                        Wave(
                            surface, _BEFORE, active, gain, float(edges[k]), float(edges[k + 1]),
                            "multisine",
                        )
                        for k, control in enumerate(chosen)
                        for surface, gain in control.items()
                    )  # fmt: skip


def _times(each: Event | Wave, size: float) -> Event | Wave:
    return replace(each, amplitude=each.amplitude * size)


def _stabilised(
    trimmed: Trim, candidates: Sequence[Inputs], time: Array
) -> tuple[FlightModel, dict[tuple[str, str], float]]:
    """The model with the least feedback that keeps it near trim, and its gains."""
    model = trimmed.problem.model
    series = {name: np.full(len(time), value) for name, value in trimmed.series.items()}
    for each in {e.target: e for inputs in candidates for e in inputs}.values():
        series[each.target] = series[each.target] + 1e-3 * np.sin(time)
    gains = stabilising_feedback(model, FlightStretch(time, trimmed.start, series, {}, (), {}))
    return with_feedback(model, gains), gains


def _flown(
    model: FlightModel,
    trimmed: Trim,
    gains: Mapping[tuple[str, str], float],
    runs: Sequence[Inputs],
    time: Array,
    start: Mapping[str, Any] | None = None,
    parameters: Mapping[str, Array] | None = None,
) -> Mapping[str, Array]:
    """Channels (n, k) of runs side by side; one run may stand for all."""
    series: dict[str, Any] = {
        name: np.full((len(time), len(runs)), value) for name, value in trimmed.series.items()
    }
    for lane, inputs in enumerate(runs):
        for each in inputs:
            series[each.target][:, lane] += each(time)
    if len(runs) == 1:
        series = {name: values[:, 0] for name, values in series.items()}
    for _, channel in gains:
        series[f"reference_{channel}"] = np.full(len(time), trimmed.channels[channel])
    run = simulate(model, time, start or trimmed.start, series, parameters=parameters)
    return run.channels


def _largest(
    model: FlightModel,
    trimmed: Trim,
    gains: Mapping[tuple[str, str], float],
    inputs: Inputs,
    time: Array,
    deflections: Mapping[str, tuple[float, float]],
    limits: Mapping[str, tuple[float, float]],
) -> float | None:
    """Largest size of the inputs with which all limits hold; None where there is none."""
    room = min(
        min(high - trimmed.series[each.target], trimmed.series[each.target] - low)
        / (abs(each.amplitude) * _peak(each))
        for each in inputs
        for low, high in (deflections[each.target],)
    )
    if not room > 0.0:
        return None
    sizes = _SHARES * room
    runs = [tuple(_times(each, size) for each in inputs) for size in sizes]
    channels = _flown(model, trimmed, gains, runs, time)
    bounds = {**limits, **{each.target: deflections[each.target] for each in inputs}}
    good = np.ones(len(sizes), dtype=bool)
    for name, (low, high) in bounds.items():
        values = channels[name]
        good &= np.all((values >= low) & (values <= high), axis=0)  # NaN is never within
    return float(sizes[np.argmax(good)]) if good.any() else None


def _peak(each: Event | Wave) -> float:
    """Largest value of an input per amplitude; phases of multisines are known to 2 rms."""
    return 2.0 if isinstance(each, Wave) else 1.0


def _information(
    model: FlightModel,
    trimmed: Trim,
    gains: Mapping[tuple[str, str], float],
    inputs: Inputs,
    time: Array,
    unknown: Mapping[str, str],
    noise: Mapping[str, float],
) -> Array:
    """Information (p, p) of a flight on the parameters, with initial states unknown."""
    p, q = len(unknown), len(_STARTS)
    steps = np.array(
        [_PARAMETER_STEP * max(1.0, abs(model.parameters[name])) for name in unknown]
        + list(_STARTS.values())
    )
    change = np.concatenate([np.diag(steps), -np.diag(steps)], axis=1)
    parameters = {name: model.parameters[name] + change[k] for k, name in enumerate(unknown)}
    start: dict[str, Any] = {
        name: value + change[p + list(_STARTS).index(name)] if name in _STARTS else value
        for name, value in {**dict.fromkeys(_STARTS, 0.0), **trimmed.start}.items()
    }
    channels = _flown(model, trimmed, gains, [inputs], time, start, parameters)
    slopes = [
        (channels[name][:, : p + q] - channels[name][:, p + q :]) / (2.0 * steps) / sigma
        for name, sigma in noise.items()
    ]
    stacked = np.nan_to_num(np.concatenate(slopes))
    whole = stacked.T @ stacked
    own, shared, starts = whole[:p, :p], whole[:p, p:], whole[p:, p:]
    return np.asarray(own - shared @ np.linalg.pinv(starts, hermitian=True) @ shared.T)


def _covariance(information: Array) -> Array:
    """Inverse of an information (p, p); inf on the diagonal where there is none."""
    p = len(information)
    told = np.diag(information) > 0.0
    covariance = np.zeros((p, p))
    covariance[~told, ~told] = np.inf
    if told.any():
        scale = np.sqrt(np.diag(information)[told])
        inner = information[np.ix_(told, told)] / np.outer(scale, scale)
        values, vectors = np.linalg.eigh(inner)
        values = np.maximum(values, 1e-12)  # what is not determined gets a very large variance
        inverse = (vectors / values) @ vectors.T / np.outer(scale, scale)
        covariance[np.ix_(told, told)] = inverse
    return covariance


def manoeuvre_text(manoeuvre: Manoeuvre) -> str:
    """Return the manoeuvre as the TOML file that `parse_manoeuvre` reads: SI units, amplitudes in
    [deg]."""
    condition = manoeuvre.condition
    lines = [f'name = "{manoeuvre.name}"', f"duration = {manoeuvre.duration:g}", "", "[trim]"]
    lines += [f"V = {condition.V!r}", f"altitude = {condition.altitude!r}"]
    if manoeuvre.glides:
        lines.append("glide = true")
    elif condition.climb:
        lines.append(f"climb = {condition.climb!r}")
    for name in ("bank", "beta", "turn_rate", "load_factor"):
        value = getattr(condition, name)
        if value is not None:
            lines.append(f"{name} = {value!r}")
    if condition.pull_up:
        lines.append("pull_up = true")
    if manoeuvre.given:
        lines += ["", "[set]", *(f'{name} = "{value}"' for name, value in manoeuvre.given.items())]
    for each in manoeuvre.inputs:
        lines += ["", "[[input]]", f'target = "{each.target}"', f'shape = "{each.shape}"']
        lines += [
            f"start = {each.start:.4g}",
            f'amplitude = "{np.rad2deg(each.amplitude):.4g} deg"',
        ]
        if isinstance(each, Wave):
            lines += [f"duration = {each.duration:.6g}", f"band = [{each.low!r}, {each.high!r}]"]
        else:
            lines.append(f"width = {each.width:.4g}")
    return "\n".join(lines) + "\n"


def expected_noise(vehicle: Vehicle) -> tuple[dict[str, float], tuple[str, ...]]:
    """Noise of each output of `NOISE` [SI] as the vehicle file states it, and the outputs of which
    it states none."""
    stated = {name: sensor.noise for name, sensor in vehicle.sensors.items() if sensor.noise > 0.0}
    return (
        {name: stated.get(name, size) for name, size in NOISE.items()},
        tuple(name for name in NOISE if name not in stated),
    )
