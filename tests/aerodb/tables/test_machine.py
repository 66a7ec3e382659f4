"""A database as one machine gives what `predict` gives."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aerodb.examples.phoenix import read_example
from aerodb.exchange import import_jsbsim, read_native
from aerodb.nomenclature import AXES
from aerodb.tables import (
    AeroDatabase,
    Increment,
    Interval,
    Machine,
    execute,
    parse,
    total_coefficients,
)

jsbsim = pytest.importorskip("jsbsim")


def _aircraft(name: str) -> AeroDatabase:
    folder = Path(jsbsim.get_default_root_dir()) / "aircraft" / name
    return import_jsbsim(
        (folder / f"{name}.xml").read_bytes(),
        name=name.lower(),
        loader=lambda part: (folder / part).read_bytes(),
    )


def _channels(database: AeroDatabase, n: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    values = {name: rng.uniform(-0.3, 0.5, n) for name in total_coefficients(database).inputs}
    values |= {state.name: rng.uniform(0.0, 1.0, n) for state in database.states}
    for name, low, high in (("V", 40.0, 200.0), ("mach", 0.1, 0.9), ("altitude", 0.0, 9e3)):
        if name in values:
            values[name] = rng.uniform(low, high, n)
    return values


def _run(machine: Machine, values: dict[str, np.ndarray]) -> np.ndarray:
    """Evaluate at `values`, each (n,): (outputs, n)."""
    n = max(map(np.size, values.values()))
    slots = np.repeat(machine.slots[:, None], n, axis=1)
    for name, slot in machine.inputs.items():
        slots[slot] = values[name]
    cells = np.zeros((len(machine.instructions.modes), n), dtype=np.int64)
    outside = np.zeros((len(machine.tables), n), dtype=np.bool_)
    execute(machine.instructions, slots, cells, outside, n)
    return slots[list(machine.outputs)]


@pytest.mark.parametrize("name", ["f16", "737", "c172p", "DHC6", "T37", "phoenix"])
def test_the_machine_gives_the_predicted_coefficients(name: str) -> None:
    database = read_native(read_example("preflight.toml")) if name == "phoenix" else _aircraft(name)
    total, values = total_coefficients(database), _channels(database, 500)
    estimates = dict(zip(total.estimates, total.values, strict=True))
    known = {name: values[name] for name in total.machine.inputs if name in values}
    flown = _run(total.machine, {**known, **estimates})[:6]
    predicted = database.predict(values).coefficients
    for axis, row in zip(AXES, flown, strict=True):
        scale = np.abs(predicted[axis]).max() + 1e-12
        np.testing.assert_allclose(row, predicted[axis], rtol=1e-10, atol=1e-12 * scale)


@pytest.mark.parametrize("margins", [None, {"alpha": 0.07}])
def test_increments_act_in_their_envelopes_in_body_and_wind_axes(margins) -> None:
    """An increment of Cm on alpha and q with an envelope beyond which it fades, or continues, one of
    drag; and other estimates in their place."""
    base = _aircraft("T37")
    pitch = Increment(
        axis="Cm",
        regressors=(parse("alpha"), parse("q")),
        estimates=np.array([-0.3, 2.0]),
        covariance=np.eye(2),
        envelope={"alpha": Interval(0.0, 0.2, 0.05)},
        margins=margins,
    )
    drag = Increment(
        axis="C_drag",
        regressors=(parse("1"),),
        estimates=np.array([0.02]),
        covariance=np.eye(1),
        envelope={},
    )
    database = replace(base, increments=(pitch, drag))
    total, values = total_coefficients(database), _channels(database, 400)
    known = {name: values[name] for name in total.machine.inputs if name in values}
    for factor in (1.0, 0.5):
        estimates = dict(zip(total.estimates, factor * np.array(total.values), strict=True))
        rows = _run(total.machine, {**known, **estimates})[:6]
        scaled = tuple(
            replace(increment, estimates=factor * increment.estimates)
            for increment in database.increments
        )
        predicted = replace(base, increments=scaled).predict(values).coefficients
        for axis, row in zip(AXES, rows, strict=True):
            np.testing.assert_allclose(row, predicted[axis], rtol=1e-10, atol=1e-12)
    assert len(total.estimates) == 3
