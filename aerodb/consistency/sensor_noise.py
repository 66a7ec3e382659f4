"""Compare the noise that sensors show with what the vehicle file declares.

In calm air a channel's residual about the reconstructed path is the noise of its sensor, whatever
its colour. In moving air the residuals of the air data are gusts.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from aerodb.consistency.pressures import residuals_as_angles
from aerodb.consistency.reconstructed import ReconstructedPath
from aerodb.consistency.sensors import AIR_DATA
from aerodb.support import Array
from aerodb.vehicle import Sensor

#: Noise beyond this many times the declared one is reported.
_NOISIER = 2.0
#: Fewest samples of a residual of which noise is estimated.
_FEWEST = 50


def noise_beyond_declaration(
    paths: Sequence[ReconstructedPath], sensors: Mapping[str, Sensor], moving_air: bool
) -> tuple[str, ...]:
    """Return one sentence for each sensor whose noise is more than twice what its file declares.

    paths : reconstructed records of a flight. sensors : of the vehicle file, by channel.
    moving_air : whether the residuals of the air data are gusts; these channels are then left out.

    Residuals (n,) and noise of one channel in SI units; those of five-hole probes as angles [rad].
    """
    shown = [residuals_as_angles(path).residuals for path in paths]
    sentences = []
    for name, sensor in sensors.items():
        residuals = [] if moving_air and name in AIR_DATA else _residuals(shown, name)
        if sensor.noise <= 0.0 or not residuals:
            continue
        size = float(np.sqrt(np.mean([np.var(values) for values in residuals])))
        if size > _NOISIER * sensor.noise:
            time = _correlation_time(residuals) * paths[0].record.step
            lasting = f", correlated over {time:.2g} s" if time else ""
            sentences.append(
                f"{name} is {size / sensor.noise:.2g} times noisier than the vehicle file declares"
                f" ({size:.2g} for {sensor.noise:.2g} in SI units{lasting})"
            )
    return tuple(sentences)


def _residuals(shown: Sequence[Mapping[str, Array]], name: str) -> list[Array]:
    found = [residuals.get(name) for residuals in shown]
    finite = [values[np.isfinite(values)] for values in found if values is not None]
    return [values for values in finite if len(values) >= _FEWEST]


def _correlation_time(residuals: Sequence[Array]) -> float:
    """Samples until the autocovariance, pooled over the records, falls below 1/e of that of
    neighbours; 0 for white noise: neighbours share less than a tenth of its variance."""
    lags = min(len(values) for values in residuals) // 2
    covariance = np.zeros(lags)
    for values in residuals:
        power = np.abs(np.fft.rfft(values - values.mean(), 2 * len(values))) ** 2
        covariance += np.fft.irfft(power)[:lags]
    if covariance[1] < 0.1 * covariance[0]:
        return 0.0
    below = np.flatnonzero(covariance[1:] < covariance[1] / np.e)
    return float(below[0] + 1 if len(below) else lags)
