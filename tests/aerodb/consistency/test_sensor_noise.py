"""Tests of the sentence that a sensor is noisier than its vehicle file declares."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.consistency.output_error.reconstruction import reconstruct
from aerodb.consistency.sensor_noise import noise_beyond_declaration
from aerodb.vehicle import Sensor
from tests.support.moving_air import FIRST, FREE, moving_air
from tests.support.simulated_path import NOISE
from tests.support.tracing_flights import coloured

STEP = 0.02
DECLARED = {name: Sensor(noise=NOISE[name]) for name in ("V", "alpha", "beta", "theta")}


def paths(times: float, lasting: float | None):
    """Four records in calm air whose alpha vane has `times` its declared noise, white or
    lasting."""
    found = []
    for seed in range(4):
        record, exact = moving_air(70 + seed, 0.0)
        rng, n = np.random.default_rng(seed), len(record.inputs)
        noise = rng.standard_normal(n) if lasting is None else coloured(rng, n, lasting, STEP)
        shown = exact["alpha"] + times * NOISE["alpha"] * noise
        record = replace(record, outputs={**record.outputs, "alpha": shown})
        found += reconstruct([record], FREE, initial=FIRST).paths
    return found


def test_size_and_duration_of_a_vanes_noise_are_said() -> None:
    (sentence,) = noise_beyond_declaration(paths(6.0, 0.5), DECLARED, moving_air=False)
    words = sentence.split()
    assert words[:2] == ["alpha", "is"]
    assert float(words[2]) == pytest.approx(6.0, rel=0.2)
    assert float(words[-2]) == pytest.approx(0.5, rel=0.4)


def test_white_noise_has_no_duration() -> None:
    (sentence,) = noise_beyond_declaration(paths(4.0, None), DECLARED, moving_air=False)
    assert sentence.startswith("alpha is 4 times noisier")
    assert "correlated" not in sentence


def test_sensors_as_declared_are_not_mentioned() -> None:
    assert noise_beyond_declaration(paths(1.0, None), DECLARED, moving_air=False) == ()


def test_gusts_are_no_noise_of_a_vane() -> None:
    assert noise_beyond_declaration(paths(6.0, 0.5), DECLARED, moving_air=True) == ()
