"""Damaged files of aerodynamic codes and simulators: a database, or a refusal that says where, never an accident."""

from collections.abc import Callable

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange import KnownVehicle, code_of, import_code
from aerodb.tables import ReferenceGeometry, lacking_effects
from tests.aerodb.exchange.test_simulator_models import BOUND, JOINTS, POINT, gazebo_file, sitl_file
from tests.faults.test_fuzz_readers import Change, flip, scramble
from tests.support import vortex_lattice

OWN = KnownVehicle(ReferenceGeometry(0.6, 0.2, 3.0, (0.0, 0.0, 0.0)), True, {"elevator": 0.4})
FILES: dict[str, tuple[Callable[[], bytes], dict[str, str]]] = {
    "plane.st": (lambda: vortex_lattice.avl_text(3.0).encode(), {}),
    "plane.sb": (lambda: vortex_lattice.avl_text(3.0, kind="sb").encode(), {}),
    "plane.json": (sitl_file, {**BOUND, **POINT}),
    "model.sdf": (gazebo_file, JOINTS),
}


def cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: int(rng.integers(len(data)))]


@pytest.mark.parametrize("change", [flip, scramble, cut])
@pytest.mark.parametrize("name", FILES)
def test_a_damaged_file_is_read_or_refused(
    name: str, change: Change, trials: Callable[[int, int], int]
) -> None:
    rng = np.random.default_rng(11)
    write, bindings = FILES[name]
    whole = write()
    assert import_code([(name, whole)], "x", bindings=bindings, vehicle=OWN).terms
    read, refused = 0, list[InputError]()
    for _ in range(trials(60, 3000)):
        data = change(whole, rng)
        if not code_of(data):
            continue
        try:
            database = import_code([(name, data)], "x", bindings=bindings, vehicle=OWN)
        except InputError as refusal:
            refused.append(refusal)
        else:
            read += 1
            lacking_effects(database)
    print(f"{name}: {read} read, {len(refused)} refused")
    assert all(each.what for each in refused)
    assert read or refused
