"""`aerodb version export`: the vehicle's mass, aircraft files to merge into, and CSV by its name."""

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from lxml import etree

from aerodb.vehicle import parse_vehicle
from tests.support.command import aerodb, asked
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, VEHICLE, channels, write_csv


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Path:
    return shared.prepared(tmp_path_factory.mktemp("export") / "w").root


def export(workspace: Path, *arguments: str) -> str:
    done = aerodb(workspace, "version", "export", "released", *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_jsbsim_export_has_the_mass_of_the_vehicle_file(workspace: Path, tmp_path: Path) -> None:
    file = tmp_path / "glider.xml"
    said = export(workspace, "--format", "jsbsim", "--output", str(file))
    stated = parse_vehicle(VEHICLE).mass
    assert f"mass {stated.mass:g} kg, CG and inertia: vehicle file" in " ".join(said.split())
    balance = etree.parse(file).find("mass_balance")
    pounds = float(balance.findtext("emptywt"))
    assert pounds == pytest.approx(stated.mass / 0.45359237, rel=1e-6)
    for name in ("Ixx", "Iyy", "Izz"):
        value = float(balance.findtext(name.lower())) * 14.593902937206 * 0.3048**2
        assert value == pytest.approx(getattr(stated, name), rel=1e-9)
    x, y, z = (float(balance.findtext(f"location/{axis}")) * 0.0254 for axis in "xyz")
    assert (-x, y, -z) == pytest.approx(stated.cg)


MASS_SECTION = VEHICLE[VEHICLE.index("[mass]") : VEHICLE.index("[surfaces")]
FUEL = """[mass]
source = "fuel_table"
fuel_mass = [0, 2]
mass = [10.0, 12.0]
cg = [[-0.4, 0, 0], [-0.5, 0, 0.1]]
Ixx = [3.0, 3.2]
Iyy = [1.6, 1.6]
Izz = [4.4, 4.4]
Ixz = [0.1, 0.1]
"""


def mass_of_export(workspace: Path, section: str, tmp_path: Path) -> Any:
    """What an export says about the mass, with this section in the vehicle file."""
    file = tmp_path / "vehicle.toml"
    file.write_text(VEHICLE.replace(MASS_SECTION, section))
    assert aerodb(workspace, "vehicle", "add", str(file)).returncode == 0
    output = ("--output", str(tmp_path / "x.xml"))
    return asked(workspace, "version", "export", "released", "--format", "jsbsim", *output)["mass"]


def test_a_fuel_table_gives_its_middle_and_a_logged_mass_the_newest_flights(
    shared: SharedWorkspaces, tmp_path: Path
) -> None:
    workspace = shared.prepared(tmp_path / "w").root
    mass = mass_of_export(workspace, FUEL, tmp_path)
    assert (mass["mass"], mass["cg"], mass["inertia"][0]) == (11.0, [-0.45, 0.0, 0.05], 3.1)
    assert "1 kg of fuel" in mass["source"]
    assert mass_of_export(workspace, '[mass]\nsource = "channels"\n', tmp_path) is None
    assert b"Placeholder: the mass is not known" in (tmp_path / "x.xml").read_bytes()
    flown = channels(3)
    still = np.ones_like(flown["time"])
    logged = {"mass": 12 - 0.1 * still.cumsum() / still.size, "cg_x": -0.4 * still}
    logged |= {"cg_y": 0 * still, "cg_z": 0 * still}
    logged |= {"Ixx": 3 * still, "Iyy": 1.6 * still, "Izz": 4.4 * still, "Ixz": 0.1 * still}
    log = write_csv(tmp_path / "logged.csv", {**flown, **logged})
    given = ("--vehicle", NAME, "--mapping", "canonical", "--direct")
    done = aerodb(workspace, "flight", "ingest", str(log), *given)
    assert done.returncode == 0, done.stderr
    mass = mass_of_export(workspace, '[mass]\nsource = "channels"\n', tmp_path)
    assert mass["mass"] == pytest.approx(11.95, abs=1e-3)
    assert mass["inertia"] == [3.0, 1.6, 4.4, 0.1]
    assert "logged.csv" in mass["source"]


def test_an_export_is_merged_into_an_aircraft_file(workspace: Path, tmp_path: Path) -> None:
    plain = tmp_path / "plain.xml"
    export(workspace, "--format", "jsbsim", "--output", str(plain))
    own = etree.parse(plain).getroot()
    own.find("mass_balance/emptywt").text = "12.5"
    own.find("metrics/wingarea").text = "99"
    own.insert(0, etree.Comment(" mine "))
    own.append(etree.fromstring("<propulsion/>"))
    for function in own.find("aerodynamics").iter("function"):
        function.getparent().remove(function)
    aircraft = tmp_path / "mine.xml"
    aircraft.write_bytes(etree.tostring(own))
    before = aircraft.read_bytes()
    said = export(workspace, "--format", "jsbsim", "--into", str(aircraft))
    assert aircraft.read_bytes() == before
    assert "mine-v0001.xml" in said
    assert "mass and CG included" in said
    made = etree.parse(tmp_path / "mine-v0001.xml").getroot()
    assert made.findtext("mass_balance/emptywt") == "12.5"
    assert made.find("propulsion") is not None
    assert b"<!-- mine -->" in etree.tostring(made)
    written = etree.parse(plain).getroot()
    for tag in ("aerodynamics", "metrics"):
        own_part, part = (
            etree.tostring(each.find(tag), method="c14n", with_tail=False)
            for each in (made, written)
        )
        assert b"".join(own_part.split()) == b"".join(part.split())
    same = ("--output", str(aircraft))
    export(workspace, "--format", "jsbsim", "--into", str(aircraft), *same)
    assert etree.parse(aircraft).findtext("mass_balance/emptywt") == "12.5"


@pytest.mark.parametrize(
    "arguments",
    [
        ("--format", "jsbsim"),
        ("--format", "csv", "--into", "own.xml"),
        ("--format", "jsbsim", "--into", "absent.xml"),
    ],
)
def test_what_cannot_be_merged_is_refused(
    workspace: Path, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    (tmp_path / "own.xml").write_text("<fdm_config/>")
    refused = aerodb(workspace, "version", "export", "released", *arguments, folder=tmp_path)
    assert refused.returncode == 3
    assert [path.name for path in tmp_path.iterdir()] == ["own.xml"]


def test_csv_is_one_table_and_zip_the_files(workspace: Path, tmp_path: Path) -> None:
    one, many = tmp_path / "glider.csv", tmp_path / "glider.zip"
    export(workspace, "--format", "csv", "--output", str(one))
    export(workspace, "--format", "csv", "--output", str(many))
    frame = pd.read_csv(one)
    with zipfile.ZipFile(many) as archive:
        terms = pd.read_csv(io.BytesIO(archive.read("terms.csv")))
    assert frame[frame.kind == "term"]["expression"].tolist() == terms["expression"].tolist()
    assert np.isfinite(frame[frame.kind == "check output"]["value"]).all()
    for file in (one, many):
        added = aerodb(workspace, "database", "import", str(file), "--vehicle", "small-glider")
        assert added.returncode == 0, added.stderr
