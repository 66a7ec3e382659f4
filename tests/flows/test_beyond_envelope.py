"""ATTAS from an empty baseline, trained on some manoeuvres, each other one predicted: by command,
with increments held at the edge of their envelope and with their slopes extrapolated."""

import pytest

from tests.support.command import aerodb, asked
from tests.support.paths import VEHICLES

EMPTY = """
name = "attas-empty"
[reference]
area = 64.0
chord = 3.159
span = 21.5
moment_reference = [-0.02, -0.01, -0.12]
[derivatives.CZ]
"1" = 0.0
"""
MODEL = """
[[increment]]
axis = "C_lift"
terms = ["1", "alpha", "q_hat", "delta_elevator"]
"""
MANOEUVRES = ("Elv1", "Ail1", "Rud1")


@pytest.fixture(scope="module")
def attas(measured, tmp_path_factory):
    """The manoeuvres in a workspace, with the vane where the product says that it is: at the tip of
    the boom."""
    folder = tmp_path_factory.mktemp("attas")
    root, vehicle = folder / "w", (VEHICLES / "attas.toml").read_text(encoding="utf-8")
    boom = vehicle.replace("imu = ", "air_data = [13.080, -0.010, -0.027]\nimu = ")
    for name, text in (("vehicle", boom), ("empty", EMPTY), ("model", MODEL)):
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    asked(root, "vehicle", "add", str(folder / "vehicle.toml"))
    asked(root, "database", "import", str(folder / "empty.toml"), "--vehicle", "attas")
    for name in MANOEUVRES:
        path = str(measured(f"attas/fAttas{name}.mat"))
        asked(root, "flight", "ingest", path, "--vehicle", "attas", "--name", name, "--direct")
    return root, ("update", "--vehicle", "attas", "--model", str(folder / "model.toml"), "--direct")


@pytest.mark.campaign
def test_each_manoeuvre_is_predicted_by_the_others_both_ways(attas):
    root, update = attas
    document = asked(root, *update)
    names = {entry["flight"]: entry["name"] for entry in asked(root, "flight", "list")}
    (elevator,) = [entry for entry in document["beyond"] if names[entry["flight"]] == "Elv1"]
    assert elevator["used"] == "held"
    assert elevator["held_outside"] > 0.2
    assert elevator["extrapolated_outside"] < 0.03
    assert elevator["extrapolated"] < 0.1 * elevator["held"]
    assert {each["variable"] for each in elevator["excursions"]} >= {"alpha", "delta_elevator"}
    assert 0.2 < elevator["share"] < 0.5
    assert sum(remark.startswith("Elv1 leaves the flown") for remark in document["remarks"]) == 1
    page = (root / "reports" / document["page"]).read_text(encoding="utf-8")
    assert "slopes extrapolated" in page


@pytest.mark.campaign
def test_a_point_outside_is_given_both_ways(attas):
    root, update = attas
    label = asked(root, *update, "--hold-out", "Elv1")["label"]
    inside = asked(
        root, "version", "evaluate", label, "--at", "alpha=2deg,V=130,delta_elevator=2deg"
    )
    assert (inside["outside_envelope"], inside["extrapolated"]) == ([], None)
    at = ("version", "evaluate", label, "--at", "alpha=5deg,V=130,delta_elevator=2deg")
    beyond = asked(root, *at)
    assert beyond["outside_envelope"] == ["alpha"]
    assert beyond["coefficients"]["CZ"] != pytest.approx(beyond["extrapolated"]["CZ"], abs=0.05)
    printed = aerodb(root, *at)
    assert "slopes extrapolated" in printed.stdout + printed.stderr
