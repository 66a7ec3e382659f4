"""Every aircraft of the installed JSBSim, imported and compared with JSBSim's own coefficients.

Inputs are set by their physical meaning. Inputs without a meaning (`free_inputs`) are set from the
property that they name, and so is the squared lift, for which JSBSim uses its previous time step.
"""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange.jsbsim.reader import import_jsbsim
from aerodb.storage.files.aircraft_files import files_beside
from aerodb.tables.database import AeroDatabase
from aerodb.tables.reference import ReferenceGeometry
from tests.support.jsbsim_flights import (
    FOOT,
    INCH,
    aircraft_file,
    centre_of_gravity,
    channels_of,
    compare,
    jsbsim,
    own_coefficients,
    random_condition,
    simulator,
)
from tests.support.single_terms import of_term

ROOT = Path(jsbsim.get_default_root_dir())
AIRCRAFT = sorted(
    path.name for path in (ROOT / "aircraft").iterdir() if (path / f"{path.name}.xml").exists()
)

#: Refused by name, and why.
REFUSED = {"blank": "0 elements <metrics>"}

#: Metric files: JSBSim converts with rounded numbers (39.3701 inches, 3.2808399 feet to the metre),
#: the import exactly.
METRIC = ("Short_S23", "Submarine_Scout", "ZLT-NT")

#: Airships and a balloon: gas and ballast are computed after the aerodynamics, which have them of
#: the run before.
RUNS = {"ZLT-NT": 2, "weather-balloon": 20}


def loader(aircraft: str) -> Any:
    """Files that an aircraft names, found as JSBSim finds them."""

    def load(name: str) -> bytes:
        for folder in (ROOT / "aircraft" / aircraft, ROOT / "systems"):
            for path in (folder / name, folder / f"{name}.xml"):
                if path.is_file():
                    return path.read_bytes()
        raise InputError(f"no {name}", aircraft)

    return load


def imported(aircraft: str) -> AeroDatabase:
    text = aircraft_file(aircraft)
    squared = {"aero/cl-squared": "aero_cl_squared"} if b"aero/cl-squared" in text else {}
    return import_jsbsim(text, name=aircraft, bindings=squared, loader=loader(aircraft))


def run_ic(executive: Any) -> None:
    """Some aircraft read properties of a flight simulator, which JSBSim alone does not have: they
    are made, as zero."""
    for _ in range(50):
        try:
            executive.run_ic()
            return
        except Exception as error:
            absent = re.search(r"property (\S+) does not exist", str(error))
            if absent is None:
                raise
            executive[absent[1]] = 0.0


def errors(
    aircraft: str, database: AeroDatabase, states: int, seed: int
) -> tuple[float, dict[str, np.ndarray]]:
    """Largest error over its tolerance at random states, and the inputs there."""
    executive, rng = simulator(aircraft), np.random.default_rng(seed)
    rows, cgs, theirs = [], [], []
    for _ in range(states):
        random_condition(executive, rng)
        for _ in range(RUNS.get(aircraft, 1)):
            run_ic(executive)
        rows.append(channels_of(executive, database))
        cgs.append(centre_of_gravity(executive))
        theirs.append(own_coefficients(executive))
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]} or {
        "alpha": np.zeros(states)
    }
    return max(compare(database, columns, np.array(cgs), np.array(theirs)).values()), columns


@pytest.mark.parametrize("aircraft", ["f16", "c172p", "737"])
def test_equal_to_jsbsim_at_a_thousand_random_states(aircraft: str) -> None:
    database = imported(aircraft)
    error, inputs = errors(aircraft, database, 1000, 31)
    assert error <= 1.0
    if aircraft == "c172p":
        assert set(inputs["stall_hyst_norm"]) == {0.0, 1.0}
        assert database.free_inputs["stall_hyst_norm"].endswith(
            "1 above 0.36 rad, 0 below 0.09 rad, in between as it was"
        )


@pytest.mark.parametrize("aircraft", AIRCRAFT)
def test_every_aircraft_agrees_or_is_refused_by_name(aircraft: str) -> None:
    if aircraft in REFUSED:
        with pytest.raises(InputError, match=REFUSED[aircraft]):
            imported(aircraft)
        return
    database = imported(aircraft)
    if aircraft in METRIC:
        database = replace(database, reference=as_jsbsim_rounds(aircraft, database.reference))
    error, _ = errors(aircraft, database, 10, 32)
    assert error <= 1.0


def as_jsbsim_rounds(aircraft: str, exact: ReferenceGeometry) -> ReferenceGeometry:
    executive = simulator(aircraft)
    x, y, z = (executive[f"metrics/aero-rp-{axis}-in"] * INCH for axis in "xyz")
    area, chord, span = (
        executive["metrics/Sw-sqft"],
        executive["metrics/cbarw-ft"],
        executive["metrics/bw-ft"],
    )
    rounded = ReferenceGeometry(area * FOOT**2, chord * FOOT, span * FOOT, (-x, y, -z))
    assert (rounded.area, rounded.chord, rounded.span) == pytest.approx(
        (exact.area, exact.chord, exact.span), rel=4e-9
    )
    assert rounded.moment_reference == pytest.approx(exact.moment_reference, rel=6e-7)
    return rounded


def test_a_shifting_reference_point() -> None:
    """Concorde's moves aft by 0.58 chords at Mach 0.9, by its own table: the normal force then
    pitches with that arm."""
    database = imported("Concorde")
    shift = [term for term in database.terms if term.name.startswith("reference_point_shift")]
    assert [term.axis for term in shift] == ["Cm", "Cn"]
    inputs = dict.fromkeys(database.inputs, 0.0) | {
        "V": 200.0,
        "mach": 0.9,
        "qbar": 1e4,
        "height_above_ground": 1e3,
        "alpha": 0.15,
    }
    share, whole = (
        of_term(database, "reference_point_shift_Cm", inputs),
        database.predict(inputs).coefficients,
    )
    assert share["Cm"] == pytest.approx(0.58 * whole["CZ"], rel=1e-12)


def test_parts_are_found_beside_the_aircraft_and_nowhere_else(tmp_path: Path) -> None:
    for file in (ROOT / "aircraft" / "F450").glob("*.xml"):
        (tmp_path / "F450").mkdir(exist_ok=True)
        (tmp_path / "F450" / file.name).write_bytes(file.read_bytes())
    aircraft = tmp_path / "F450" / "F450.xml"
    database = import_jsbsim(aircraft.read_bytes(), name="F450", loader=files_beside(aircraft))
    assert len(database.terms) == len(imported("F450").terms) > 0
    named_from_above = aircraft.read_bytes().replace(b'file="', b'file="F450/')
    assert named_from_above != aircraft.read_bytes()
    again = import_jsbsim(named_from_above, name="F450", loader=files_beside(aircraft))
    assert again.terms == database.terms
    (tmp_path / "secret.xml").write_text("<metrics/>")
    (tmp_path / "F450" / "link.xml").symlink_to(tmp_path / "secret.xml")
    for name, message in (
        ("link.xml", "is outside the folder of the aircraft"),
        ("../secret", "outside"),
        ("absent.xml", "file 'absent.xml' does not exist"),
    ):
        with pytest.raises(InputError, match=message):
            files_beside(aircraft)(name)


def test_aerodynamics_in_another_file_need_a_loader_and_stay_in_the_folder() -> None:
    text = aircraft_file("F450")
    with pytest.raises(InputError, match=r"metrics are in another file, 'Metrics.xml'"):
        import_jsbsim(text, name="F450")
    for name in (b"/etc/passwd", b"../../secrets.xml", b"..\\secrets.xml", b"C:\\secrets.xml"):
        with pytest.raises(InputError, match="in a file outside the aircraft's folder"):
            import_jsbsim(text.replace(b"Metrics.xml", name), name="F450", loader=loader("F450"))
    with pytest.raises(InputError, match="root element <aerodynamics>"):
        import_jsbsim(text.replace(b"Metrics.xml", b"Aero.xml"), name="F450", loader=loader("F450"))
