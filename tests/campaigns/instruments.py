"""Instruments with known and unknown faults: what a log shows of a flight."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from aerodb.nomenclature import is_surface
from tests.campaigns.fleet import NOISE, SATELLITES
from tests.support.jsbsim_campaign import DEFLECTION_NOISE

STEP = 0.04
#: Channels of one sensor.
GROUPS: Mapping[str, tuple[str, ...]] = {
    "alpha": ("alpha",), "beta": ("beta",), "air data": ("V", "qbar"), "rates": ("p", "q", "r"),
    "accelerometers": ("ax_imu", "ay_imu", "az_imu"), "attitude": ("phi", "theta", "psi"),
}  # fmt: skip
MEMORY = 0.5  # s, of coloured noise
#: One sigma of the biases that the product takes for likely where the vehicle file says nothing.
BIASES: Mapping[str, float] = {
    "alpha": 0.0035, "beta": 0.0035, "p": 0.001, "q": 0.001, "r": 0.001, "qbar": 20.0,
    "ax_imu": 0.05, "ay_imu": 0.05, "az_imu": 0.05,
    "delta_elevator": 0.0044, "delta_aileron": 0.0044, "delta_rudder": 0.0044,
}  # fmt: skip


@dataclass(frozen=True)
class Cell:
    """Faults that no vehicle file declares, and the air.

    coloured : group -> coloured noise in declared sigmas. biases : in sigmas of BIASES, drawn once
    per campaign. delays : channel -> s. step : s between samples. fed : whether the pilot sees what
    the instruments show. satellites : whether the velocity over the ground is logged.
    more : of the vehicle file.
    """

    coloured: Mapping[str, float] = field(default_factory=dict)
    biases: float = 0.0
    delays: Mapping[str, float] = field(default_factory=dict)
    air: str = "calm"
    step: float = STEP
    fed: bool = False
    satellites: bool = False
    more: str = ""

    def wrong(self) -> frozenset[str]:
        """Effects of sensors that truly are off."""
        found = set()
        if self.biases:
            found |= {"alpha_bias", "beta_bias", "gyro_bias", "accelerometer_bias", "qbar_offset"}
            found |= {"surface_bias"}
        found |= {f"{channel}_delay" for channel in self.delays}
        return frozenset(found)


#: Limits of a user who wants flights in turbulence to count; with the default ones they are
#: rejected.
_GUSTS_ACCEPTED = """
[accuracy]
flow_angle = "6 deg"
horizontal_velocity = 20.0
qbar_fraction = 0.3
"""

CELLS: Mapping[str, Cell] = {
    "declared": Cell(),
    **{
        f"{group} {factor:g}x": Cell(coloured={group: factor})
        for factor in (2.0, 5.0)
        for group in GROUPS
    },
    "biases 1x": Cell(biases=1.0),
    "biases 3x": Cell(biases=3.0),
    "vanes 50 ms late": Cell(delays={"alpha": 0.05, "beta": 0.05}),
    "moderate turbulence": Cell(air="moderate", more=_GUSTS_ACCEPTED),
    "severe turbulence": Cell(air="severe", satellites=True, more=_GUSTS_ACCEPTED),
    "alpha 5x, satellites": Cell(coloured={"alpha": 5.0}, satellites=True),
    "10 Hz": Cell(step=0.1),
    "fed by sensors": Cell(fed=True),
}


def noise_of(
    cell: Cell, channels: tuple[str, ...], n: int, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """Channel -> what its instrument adds, (n,), biases apart."""
    of = {channel: group for group, members in GROUPS.items() for channel in members}
    drawn = {}
    for channel in sorted(channels):
        sigma = NOISE.get(channel, DEFLECTION_NOISE if is_surface(channel) else 0.0)
        values = sigma * rng.standard_normal(n)
        factor = cell.coloured.get(of.get(channel, ""), 0.0)
        drawn[channel] = values + factor * sigma * _coloured(n, cell.step, rng)
    return drawn


def biases_of(cell: Cell, rng: np.random.Generator) -> dict[str, float]:
    """Channel -> constant error, the same in every flight of a campaign."""
    return {name: cell.biases * sigma * rng.standard_normal() for name, sigma in BIASES.items()}


def shown(
    channels: Mapping[str, np.ndarray],
    noise: Mapping[str, np.ndarray],
    biases: Mapping[str, float],
    cell: Cell,
) -> dict[str, np.ndarray]:
    """The log of a flight whose channels are (n,) each, cell.step apart."""
    n = len(channels["V"])
    time = cell.step * np.arange(n)
    late = {
        name: np.interp(time - cell.delays[name], time, values) if name in cell.delays else values
        for name, values in channels.items()
    }
    return {
        name: values + noise.get(name, np.zeros(n))[:n] + biases.get(name, 0.0)
        for name, values in late.items()
        if cell.satellites or name not in SATELLITES
    }


def _coloured(n: int, step: float, rng: np.random.Generator) -> np.ndarray:
    """First-order noise of unit size with a memory of MEMORY."""
    keep = np.exp(-step / MEMORY)
    values, _ = lfilter(
        [np.sqrt(1 - keep**2)], [1.0, -keep], rng.standard_normal(n),
        zi=[keep * rng.standard_normal()],
    )  # fmt: skip
    return np.asarray(values)
