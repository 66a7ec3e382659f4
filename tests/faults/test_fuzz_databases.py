"""Damaged files of aerodynamic codes and simulators: a database, or a refusal that says where, never an accident."""

from collections.abc import Callable

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange import KnownVehicle, code_of, import_code, import_daveml
from aerodb.tables import ReferenceGeometry, lacking_effects
from tests.aerodb.exchange.test_simulator_models import BOUND, JOINTS, POINT, gazebo_file, sitl_file
from tests.aerodb.exchange.test_sweeps import CFD, mat, rows, text, workbook
from tests.faults.test_fuzz_readers import Change, flip, scramble
from tests.support import code_files, vortex_lattice

ANGLES = (-2.0, 0.0, 4.0)
STABILITY = {
    **{"alpha_trim": "0.05", "C_lift": "0.3", "C_drag": "0.01", "reference": "vehicle"},
    "elevator": "delta_elevator",
}
SWEEP = {**CFD, "reference": "vehicle"}


def _transposed() -> tuple[list[str], np.ndarray]:
    names, values = rows("cfd")
    return names, np.array(values).T


OWN = KnownVehicle(ReferenceGeometry(0.6, 0.2, 3.0, (0.0, 0.0, 0.0)), True, {"elevator": 0.4})
FILES: dict[str, tuple[Callable[[], bytes], dict[str, str]]] = {
    "plane.st": (lambda: vortex_lattice.avl_text(3.0).encode(), {}),
    "plane.sb": (lambda: vortex_lattice.avl_text(3.0, kind="sb").encode(), {}),
    "plane.json": (sitl_file, {**BOUND, **POINT}),
    "model.sdf": (gazebo_file, JOINTS),
    "plane.stab": (lambda: code_files.stab(3.0).encode(), {"ailerons": "delta_aileron"}),
    "plane.polar": (lambda: code_files.polar(ANGLES, (0.0,)).encode(), {"reference": "vehicle"}),
    "xflr5.txt": (lambda: code_files.xflr5(ANGLES).encode(), {"reference": "vehicle"}),
    "log.txt": (lambda: code_files.xflr5_stability(3.0).encode(), STABILITY),
    "for006.dat": (lambda: code_files.datcom(ANGLES).encode(), {"lateral_axes": "body"}),
    "sweep.csv": (lambda: text("cfd"), SWEEP),
    "sweep.mat": (lambda: mat(**dict(zip(*_transposed(), strict=True))), SWEEP),
    "sweep.xlsx": (lambda: workbook(True), SWEEP),
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
        if code_of(data) != code_of(whole):
            continue  # it is refused before a reader sees it, or read as what it then is
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


def test_an_element_with_very_many_attributes_is_refused_at_once() -> None:
    """Looking at all of them takes time as their number squared: 200,000 took over 200 s."""
    many = b" ".join(b'a%d="1"' % k for k in range(200_000))
    with pytest.raises(InputError, match="200000 attributes of <function>"):
        import_daveml(b"<DAVEfunc><function " + many + b"/></DAVEfunc>")
