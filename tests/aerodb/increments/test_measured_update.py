"""The database update on measured flight: DHC6.xml of the jsbsim wheel against the Twin Otter
records.

The figures to reach are those of a first comparison with the same regressors (alpha-dot, thrust
moment, CD of sideslip and of elevator left out, increments identified on the same record): C_lift
.0253 to .0013, C_drag .0015 to .0007, Cm to .0023 (moments transferred here, which they were not
there), CY .0127 to .0030, Cl .0165 to .0121, Cn .0165 to .0006.
"""

from pathlib import Path

import jsbsim
import pytest

from aerodb.coefficients.comparison import compare
from aerodb.coefficients.total import total_coefficients
from aerodb.exchange.jsbsim.reader import import_jsbsim
from aerodb.increments.estimate import estimate_increments
from aerodb.increments.model_file import parse_model_file
from aerodb.increments.validation import HoldOut, validate_on_held_out
from aerodb.report.document import update_document
from aerodb.signals.error_measures import rms
from tests.aerodb.coefficients.test_coefficients import record, twin_otter, with_nasas_constants  # noqa: F401
from tests.support.paths import VEHICLES

MODEL = VEHICLES / "twin_otter_increments.toml"
LEFT_OUT = {
    "aero/alphadot-rad_sec": "0",
    "aero/mag-beta-rad": "0",
    "fcs/flap-pos-norm": "0",
    "fcs/mag-elevator-pos-rad": "0",
    "fcs/speedbrake-pos-norm": "0",
    "systems/propulsion/thrust-coefficient": "0",
}


def twin_otter_database(**kept):
    path = Path(jsbsim.get_default_root_dir()) / "aircraft" / "DHC6" / "DHC6.xml"
    bindings = {name: value for name, value in LEFT_OUT.items() if name not in kept.get("kept", ())}
    return import_jsbsim(path.read_bytes(), bindings=bindings, name="DHC6")


@pytest.fixture(scope="module")
def updated(record, twin_otter):  # noqa: F811
    """Before, after, update and document of one record, with NASA's accelerometer and rate
    constants removed."""

    def run(name, axes, database):
        flight, column = record(name)
        flight, _ = with_nasas_constants(flight, column)
        model = parse_model_file(MODEL.read_text())
        model = model.model_copy(
            update={"increment": tuple(entry for entry in model.increment if entry.axis in axes)}
        )
        coefficients = total_coefficients(flight, twin_otter)
        before = compare(flight, coefficients, database, twin_otter.reference)
        update = estimate_increments([flight], [before], model, database)
        after = compare(flight, coefficients, update.candidate, twin_otter.reference)
        split = HoldOut((flight.id,), (), "not validated")
        proof = validate_on_held_out({flight.id: before}, {flight.id: after}, split)
        document = update_document(
            vehicle="twin-otter",
            baseline="b",
            hold_out=split,
            excluded=[],
            looks={},
            update=update,
            proof=proof,
        )
        return {
            axis: (rms(before.residual(axis)), rms(after.residual(axis))) for axis in axes
        }, document

    return run


def test_longitudinal_record_at_least_as_good_as_the_first_comparison(updated):
    errors, document = updated(
        "totter_demo_data.mat", ("C_lift", "C_drag", "Cm"), twin_otter_database()
    )
    assert errors["C_lift"] == (pytest.approx(0.0253, abs=1e-4), pytest.approx(0.00125, abs=5e-5))
    assert errors["C_drag"][1] <= 0.0007
    assert errors["Cm"][1] <= 0.0023
    outcome = {axis: document["axes"][axis]["outcome"] for axis in errors}
    assert outcome == {"C_lift": "improved", "C_drag": "improved", "Cm": "improved"}


def test_elevator_drag_of_the_database_makes_drag_worse(updated):
    with_elevator_drag = twin_otter_database(kept=("fcs/mag-elevator-pos-rad",))
    errors, _ = updated("totter_demo_data.mat", ("C_drag",), with_elevator_drag)
    assert errors["C_drag"] == (pytest.approx(0.0016, abs=5e-5), pytest.approx(0.0008, abs=5e-5))


def test_lateral_record_repaired_in_cy_and_cn_and_reported_as_not_repaired_in_cl(updated):
    errors, document = updated("totter_f1_017_data.mat", ("CY", "Cl", "Cn"), twin_otter_database())
    assert errors["CY"][1] == pytest.approx(0.0030, abs=5e-5)
    assert errors["Cn"][1] <= 0.0006
    assert errors["Cl"] == (pytest.approx(0.0165, abs=6e-4), pytest.approx(0.0121, abs=1e-4))
    assert document["axes"]["Cl"]["outcome"] == "not repaired"
    assert document["axes"]["CY"]["outcome"] == document["axes"]["Cn"]["outcome"] == "improved"
    assert any(
        sentence.startswith("Cl is not repaired by the declared structure")
        for sentence in document["remarks"]
    )
    # What the flight says of Cn_beta: .50 in the table, .085 in the air.
    increment = next(entry for entry in document["increments"] if entry["axis"] == "Cn")
    beta = next(term for term in increment["terms"] if term["term"] == "beta")
    assert -0.46 < beta["value"] < -0.40
