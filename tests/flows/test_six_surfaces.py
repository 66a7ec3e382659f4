"""Six separate surfaces by command: logs of legs as tables, a locked surface that the loop names, a
healthy aircraft that it leaves alone, and its product of inertia by nonlinear refinement."""

import re
from pathlib import Path
from typing import Any

import pytest

from tests.aerodb.identification.test_nonlinear_refinement import IXZ, NEW
from tests.support import six_surfaces
from tests.support.command import aerodb, asked
from tests.support.small_glider import write_csv

CHANNELS = (
    "V", "qbar", "rho", "alpha", "beta", "p", "q", "r", "phi", "theta", "ax", "ay", "az",
    "altitude", "thrust", *(f"delta_{name}" for name in six_surfaces.SURFACES),
)  # fmt: skip
VEHICLE = ("--vehicle", "yf22")


def ingested(
    root: Path,
    count: int,
    locked: dict[str, float] | None,
    product: float = IXZ,
    new: bool = True,
    first: int = 0,
) -> Path:
    """A workspace with legs of the aircraft as its sensors logged them, and its database."""
    files = []
    for seed in range(first, first + count):
        leg = six_surfaces.leg(seed, six_surfaces.database(), locked)
        table = {"time": leg.time} | {name: leg[name] for name in CHANNELS}
        files.append(str(write_csv(root / f"leg{seed}.csv", table)))
    vehicle, database = root / "vehicle.toml", root / "database.toml"
    vehicle.write_text(six_surfaces.VEHICLE.replace(f"Ixz = {IXZ}", f"Ixz = {product}"))
    database.write_text(six_surfaces.text(new))
    asked(root / "w", "vehicle", "add", str(vehicle))
    asked(root / "w", "database", "import", str(database))
    asked(root / "w", "flight", "ingest", *files, *VEHICLE)
    return root / "w"


def closed(workspace: Path) -> dict[str, Any]:
    found: dict[str, Any] = asked(
        workspace, "close-loop", *VEHICLE, "--baseline", "v0001", "--direct"
    )
    return found


def test_a_locked_surface_is_named_by_command(tmp_path: Path) -> None:
    workspace = ingested(tmp_path, 6, {"stabilator_left": 0.0})
    (finding,) = closed(workspace)["findings"]
    assert finding["hypothesis"] == "surface_asymmetry@all:stabilator_left"
    assert finding["verdict"] == "sensor"
    assert finding["value"] == pytest.approx(1.0, abs=0.15)
    told = aerodb(workspace, "close-loop", *VEHICLE, "--baseline", "v0001", "--direct").stdout
    assert "stabilator left that moves less than logged, or is stuck" in told


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize(
    ("surface", "angle"),
    [
        ("stabilator_left", 0.0),
        ("stabilator_left", 0.02),
        ("aileron_right", 0.0),
        ("rudder_left", 0.0),
    ],
)
def test_ten_legs_name_any_locked_surface_by_command(
    tmp_path: Path, surface: str, angle: float, seed: int
) -> None:
    """Where the surface stands off zero, constants beside it may be errors of a sensor as well."""
    loop = closed(ingested(tmp_path, 10, {surface: angle}, first=10 * seed))
    finding, *others = loop["findings"]
    assert finding["hypothesis"] == f"surface_asymmetry@all:{surface}"
    assert finding["verdict"] == "sensor"
    assert finding["ci95"][0] < 1.0 < finding["ci95"][1]
    told = {(each["effect"], each["verdict"]) for each in others}
    assert told <= ({("zero_offset", "ambiguous_sensor")} if angle else set())


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(10))
def test_a_healthy_aircraft_is_at_its_noise_floor_by_command(tmp_path: Path, seed: int) -> None:
    loop = closed(ingested(tmp_path, 10, None, first=10 * seed))
    assert loop["findings"] == []
    assert {axis["outcome"] for axis in loop["axes"].values()} == {"at noise floor"}


@pytest.mark.campaign
def test_new_terms_and_the_product_of_inertia_by_command(tmp_path: Path) -> None:
    """The vehicle file's product of inertia is 38 % too small, and the database lacks the new terms.
    Noise of the deflections is in no standard error: terms that are zero come out up to 4.1 of them
    away here."""
    workspace = ingested(tmp_path, 4, None, product=-0.35, new=False)
    model = tmp_path / "model.toml"
    model.write_text('inertias = ["Ixz"]\n' + NEW)
    given = ("estimate", *VEHICLE, "--baseline", "v0001", "--model", str(model))
    (answer,) = asked(workspace, *given, "--method", "nonlinear-refinement")["methods"]
    found = {each["name"]: each for each in answer["estimates"]}
    assert found["Ixz"]["value"] == pytest.approx(IXZ, rel=0.1)
    for axis, terms in six_surfaces.added().items():
        for name, value in terms.items():
            each = found[f"{axis}_delta_{name}"]
            assert abs(each["value"] - value) < 0.05 * abs(value) + 6.0 * each["standard_error"]
    refused = aerodb(workspace, *given, "--method", "regression")
    assert "estimates no Ixz" in refused.stdout
    refused = aerodb(workspace, "update", *VEHICLE, "--baseline", "v0001", "--model", str(model))
    assert refused.returncode == 3
    assert "an update changes a database, not Ixz" in refused.stderr


def test_new_terms_alone_or_with_all_free_by_command(tmp_path: Path) -> None:
    """The database is right but for the new terms: freeing the rest gains nothing on two held-out legs."""
    workspace = ingested(tmp_path, 6, None, new=False)
    model = tmp_path / "model.toml"
    model.write_text(NEW)
    given = (*VEHICLE, "--baseline", "v0001", "--model", str(model), "--all-free", "--direct")
    told = aerodb(workspace, "update", *given).stdout
    assert "(6 flights)" in told.splitlines()[0]
    assert "on 2 flights not used" in told
    assert "Keep the terms of the database. All terms free predict " in told
    errors, variants = told.split("with the terms of the database held and free:")
    for axis in ("CY", "Cl", "Cn"):
        (outcome,) = re.findall(rf"^{axis} +(\S+) +(\S+)", errors, re.MULTILINE)
        (found,) = re.findall(rf"^{axis} +(\S+) +(\S+) +(\S+)", variants, re.MULTILINE)
        assert found[:2] == outcome, axis
        assert float(found[1]) < float(found[0]), axis
    (file,) = (workspace / "reports").glob("yf22-v0002-*.html")
    made = tmp_path / "again.html"
    aerodb(workspace, "report", "update", "v0002", *VEHICLE, "--output", str(made))
    for page in (file.read_text(encoding="utf-8"), made.read_text(encoding="utf-8")):
        errors, variants = page.split("Terms of the database held, or all free")
        assert "Keep the terms of the database. All terms free predict" in variants
        for axis in ("CY", "Cl", "Cn"):
            row = rf'<tr><th scope="row">{axis}</th><td class="n">([^<]+)</td><td class="n">(?:<strong>)?([^<]+)'
            (outcome, *_), (found, *_) = re.findall(row, errors), re.findall(row, variants)
            assert found == outcome, axis
