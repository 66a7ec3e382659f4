"""Six rotors that a mixer moves in four ways: their order is found, and a right one is not doubted.

The moments are the sums of the rotors' own, written here; the mixer is the least-squares inverse.
"""

from collections.abc import Sequence

import numpy as np
import pytest

from aerodb.exchange.native import read_native
from aerodb.flight import Flight
from aerodb.suspicions.rotor_order import order_suspicions

BEARINGS = np.deg2rad([90.0, -90.0, -30.0, 150.0, 30.0, -150.0])  # PX4's hexarotor x
TURNS = np.array([-1.0, 1.0, -1.0, 1.0, 1.0, -1.0])
ARM, RATIO = 0.3, 0.05
HEAD = """\
name = "hexa"
[reference]
area = 1.0
chord = 1.0
span = 1.0
pressure = "10 Pa"
moment_reference = [0.0, 0.0, 0.0]
"""
ROTOR = """
[parts.rotor_{k}]
kind = "rotor"
position = [{x}, {y}, 0.0]
turns = {turns}
diameter = 1.0
speed = "command_{k}"
thrust = 10.0
torque = 0.5
"""


def hexarotor() -> str:
    return HEAD + "".join(
        ROTOR.format(k=k, x=ARM * np.cos(b), y=ARM * np.sin(b), turns=int(t))
        for k, (b, t) in enumerate(zip(BEARINGS, TURNS, strict=True), 1)
    )


def said(order: Sequence[int], noise: float = 0.0) -> list[tuple[str, str]]:
    draw = np.random.default_rng(4)
    n = 4000
    shape = np.array([np.ones(6), -ARM * np.sin(BEARINGS), ARM * np.cos(BEARINGS), RATIO * TURNS])
    wanted = np.array([24.0 + draw.normal(0, 1.0, n), *draw.normal(0, 0.2, (3, n))])
    wanted[3] *= 0.2
    thrust = np.linalg.pinv(shape) @ wanted
    moments = (shape @ thrust)[1:] + noise * draw.standard_normal((3, n))
    commands = np.sqrt(thrust / (1.2 * 10.0))[list(order)]
    channels = {f"command_{k}": each for k, each in enumerate(commands, 1)}
    channels |= {name: np.zeros(n) for name in ("alpha", "beta", "p", "q", "r")}
    channels |= {"V": np.ones(n), "rho": np.full(n, 1.2)}
    flight = Flight("one", "hexa", np.arange(n) * 0.02, channels)
    measured = dict(zip(("Cl", "Cm", "Cn"), moments / 10.0, strict=True))
    good = np.ones(n, dtype=bool)
    found = order_suspicions(flight, read_native(hexarotor()), measured, good, lambda v: v)
    return [(each.channel, each.kind) for each in found]


def test_another_order_of_six_is_named() -> None:
    assert said((2, 1, 0, 3, 5, 4), 0.05) == [("command_1", "swapped")]


@pytest.mark.parametrize("noise", [0.0, 0.1, 1.0])
def test_the_right_order_is_not_doubted(noise: float) -> None:
    assert said(range(6), noise) == []


def test_nothing_is_said_of_an_order_that_the_motion_does_not_tell() -> None:
    assert said((2, 1, 0, 3, 5, 4), 3.0) == []
