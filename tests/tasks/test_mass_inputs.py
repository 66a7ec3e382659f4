"""A database that depends on the centre of gravity, beside flights whose vehicle file states it."""

from pathlib import Path

import pytest

from aerodb.tasks.steps.compare import compare_with_database
from aerodb.tasks.workspace_access import access_workspace
from tests.support.command import asked
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import AREA, CHORD, NAME

#: Pitching moment that grows with the CG's station and with the weight.
AIRCRAFT = f"""<?xml version="1.0"?>
<fdm_config name="by-station"><metrics>
<wingarea unit="M2">{AREA}</wingarea><wingspan unit="M">3.6</wingspan><chord unit="M">{CHORD}</chord>
<location name="AERORP" unit="M"><x>0.4</x><y>0</y><z>0</z></location></metrics>
<aerodynamics><axis name="PITCH"><function name="aero/by-station"><product>
<property>aero/qbar-psf</property><property>metrics/Sw-sqft</property>
<property>metrics/cbarw-ft</property>
<property>inertia/cg-x-in</property><property>inertia/weight-lbs</property><value>0.001</value>
</product></function></axis></aerodynamics></fdm_config>"""


def test_the_cg_and_the_mass_of_the_vehicle_file_are_inputs_of_an_imported_database(
    shared: SharedWorkspaces, tmp_path: Path
) -> None:
    workspace, _ = shared.updated(tmp_path / "w")
    file = tmp_path / "aircraft.xml"
    file.write_text(AIRCRAFT, encoding="utf-8")
    version = asked(workspace.root, "database", "import", str(file), "--vehicle", NAME)["version"]
    access = access_workspace(str(workspace.root))
    flight = next(iter(access.catalogue.flights(NAME))).id
    comparison = compare_with_database(
        access, flight, access.database(version), "read back"
    ).comparison
    inches, pounds = 0.4 / 0.0254, 12.0 * 9.80665 / 4.4482216152605  # of the vehicle file
    assert comparison.predicted["Cm"] == pytest.approx(0.001 * inches * pounds, rel=1e-4)
