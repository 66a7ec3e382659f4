"""Import of JSBSim aircraft: agreement with JSBSim for one of them, signs, units, refused files."""

import re
from typing import Any

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange.jsbsim.reader import import_jsbsim
from aerodb.exchange.native import from_document, to_document
from aerodb.nomenclature import AXES, FORCE_AXES, MOMENT_AXES
from aerodb.tables.algebra import cancel
from aerodb.tables.database import AeroDatabase
from aerodb.tables.expression import Name, parse
from tests.support.jsbsim_flights import (
    FOOT,
    INCH,
    POUND,
    aircraft_file,
    centre_of_gravity,
    compare,
    own_coefficients,
    random_condition,
    simulator,
)
from tests.support.single_terms import of_term

FREE = {
    "fcs_flap_pos_norm": "fcs/flap-pos-norm",
    "fcs_speedbrake_pos_norm": "fcs/speedbrake-pos-norm",
    "systems_propulsion_thrust_coefficient": "systems/propulsion/thrust-coefficient",
}


def twin_otter_channels(executive: Any) -> dict[str, float]:
    """Our channels from JSBSim's properties, each by its physical meaning."""
    return {
        "V": executive["velocities/vt-fps"] * FOOT,
        "alpha": executive["aero/alpha-rad"],
        "beta": executive["aero/beta-rad"],
        "alphadot": executive["aero/alphadot-rad_sec"],
        "mach": executive["velocities/mach"],
        **{rate: executive[f"velocities/{rate}-aero-rad_sec"] for rate in "pqr"},
        "delta_elevator": executive["fcs/elevator-pos-rad"],
        "delta_aileron": -executive["fcs/left-aileron-pos-rad"],
        "delta_rudder": executive["fcs/rudder-pos-rad"],
        "delta_flap": np.deg2rad(executive["fcs/flap-pos-deg"]),
        **{ours: executive[theirs] for ours, theirs in FREE.items()},
    }


@pytest.fixture(scope="module")
def twin_otter() -> AeroDatabase:
    return import_jsbsim(aircraft_file("DHC6"), name="DHC6")


def test_twin_otter_equals_jsbsim_at_random_states_and_controls(twin_otter: AeroDatabase) -> None:
    executive, rng = simulator("DHC6"), np.random.default_rng(20)
    channels, cgs, theirs = [], [], []
    for _ in range(1000):
        random_condition(executive, rng)
        flap = rng.uniform(0, 40)
        executive["fcs/flap-cmd-norm"], executive["fcs/flap-pos-deg"] = (
            flap / 40,
            flap,
        )  # at rest: lift keeps its value
        executive["fcs/speedbrake-pos-norm"] = rng.uniform(0, 1)
        executive.run_ic()
        # aero/cl-squared holds the lift of the step before: this one has the same lift
        executive.run_ic()
        channels.append(twin_otter_channels(executive))
        cgs.append(centre_of_gravity(executive))
        theirs.append(own_coefficients(executive))
    columns = {name: np.array([row[name] for row in channels]) for name in channels[0]}
    assert min(np.ptp(values) for values in columns.values()) > 0.1  # every input was really moved
    errors = compare(twin_otter, columns, np.array(cgs), np.array(theirs))
    assert max(errors.values()) <= 1.0, errors


def test_twin_otter_in_flight_with_the_lift_of_the_step_before(twin_otter: AeroDatabase) -> None:
    """While lift changes, JSBSim squares the lift of its previous step: bound to a free input, that
    value can be fed."""
    database = import_jsbsim(
        aircraft_file("DHC6"), name="DHC6", bindings={"aero/cl-squared": "aero_cl_squared"}
    )
    executive, rng = simulator("DHC6"), np.random.default_rng(21)
    random_condition(executive, rng)
    executive.run_ic()
    rows, cgs, theirs = [], [], []
    for step in range(200):
        executive["fcs/elevator-cmd-norm"] = np.sin(step / 9)
        executive.run()
        rows.append(
            {**twin_otter_channels(executive), "aero_cl_squared": executive["aero/cl-squared"]}
        )
        cgs.append(centre_of_gravity(executive))
        theirs.append(own_coefficients(executive))
    columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    errors = compare(database, columns, np.array(cgs), np.array(theirs))
    assert max(errors.values()) <= 1.0, errors
    lift = of_term(twin_otter, "CDi", columns)["CX"] - of_term(database, "CDi", columns)["CX"]
    assert np.max(np.abs(lift)) > 1e-9  # the two meanings do differ here


def test_reference_geometry_in_metres_and_body_axes(twin_otter: AeroDatabase) -> None:
    reference = twin_otter.reference
    assert reference.area == pytest.approx(422.5 * FOOT**2, rel=1e-15)
    assert (reference.span, reference.chord) == pytest.approx((65 * FOOT, 6.5 * FOOT), rel=1e-15)
    assert reference.moment_reference == pytest.approx((-211.8 * INCH, 0.0, 0.0), rel=1e-15)


def test_signs_of_the_surfaces(twin_otter: AeroDatabase) -> None:
    """Trailing edge down lifts; right aileron down rolls left; rudder trailing edge left pushes
    right, nose left."""
    rest = dict.fromkeys(twin_otter.inputs, 0.0) | {"V": 70.0}

    def effect(surface: str) -> dict[str, float]:
        moved, still = (
            twin_otter.predict(rest | {surface: angle}).coefficients for angle in (0.1, 0.0)
        )
        return {axis: float((moved[axis] - still[axis])[0]) for axis in AXES}

    assert effect("delta_elevator")["CZ"] < 0 > effect("delta_elevator")["Cm"]
    assert effect("delta_aileron")["Cl"] < 0
    assert effect("delta_rudder")["CY"] > 0 > effect("delta_rudder")["Cn"]


def test_defects_of_the_file_are_kept_as_they_are(twin_otter: AeroDatabase) -> None:
    """Its Cl_beta table is even in beta (no dihedral effect): for flight to find, not for an
    importer to mend."""
    beta = np.array([-0.0873, 0.0873])
    assert twin_otter.tables["Clb"].evaluate(beta, 0.0) == pytest.approx([0.036, 0.036], abs=1e-15)


def test_what_has_no_meaning_here_is_a_named_free_input(twin_otter: AeroDatabase) -> None:
    assert set(twin_otter.free_inputs) == set(FREE)
    channels = dict.fromkeys(set(twin_otter.inputs) - set(FREE), 0.0) | {"V": 70.0}
    with pytest.raises(InputError, match="JSBSim property systems/propulsion/thrust-coefficient"):
        twin_otter.predict(channels)
    bindings = {
        "fcs/flap-pos-norm": "delta_flap/0.7",
        "fcs/speedbrake-pos-norm": "0",
        FREE[max(FREE)]: "0",
    }
    bound = import_jsbsim(aircraft_file("DHC6"), name="DHC6", bindings=bindings)
    assert not bound.free_inputs
    assert set(bound.predict(channels).coefficients) == set(AXES)


def test_stored_form_of_an_import_predicts_the_same(twin_otter: AeroDatabase) -> None:
    rng = np.random.default_rng(23)
    channels = {name: rng.uniform(0.1, 0.3, 20) for name in twin_otter.inputs}
    again = from_document(to_document(twin_otter)).predict(channels).coefficients
    assert {a: again[a].tolist() for a in AXES} == {
        a: c.tolist() for a, c in twin_otter.predict(channels).coefficients.items()
    }


METRICS = """<metrics><wingarea unit="M2">2</wingarea><wingspan unit="M">4</wingspan><chord unit="M">0.5</chord>
<location name="AERORP" unit="M"><x>1</x><y>0</y><z>2</z></location></metrics>"""


def small(aerodynamics: str) -> AeroDatabase:
    text = f"<fdm_config>{METRICS}<aerodynamics>{aerodynamics}</aerodynamics></fdm_config>"
    return import_jsbsim(text.encode(), name="small.xml")


def function(operation: str, axis: str = "PITCH") -> str:
    return f'<axis name="{axis}"><function name="f">{operation}</function></axis>'


def test_factors_that_do_not_stand_in_a_product_are_divided_out() -> None:
    """A drag of 3 lbf at a dynamic pressure of 100 Pa on 2 m2, and a moment that lacks its
    chord."""
    qbar = {"qbar": np.array([100.0]), "alpha": 0.0, "beta": 0.0}
    drag = small(function("<sum><v>1</v><v>2</v></sum>", "DRAG")).predict(qbar).coefficients["CX"]
    assert drag == pytest.approx(-3 * POUND / 200, rel=1e-13)
    moment = "<product><p>aero/qbar-psf</p><p>metrics/Sw-sqft</p><p>-metrics/bw-ft</p></product>"
    assert small(function(moment)).predict({}).coefficients["Cm"] == pytest.approx(-8.0, rel=1e-13)


def test_body_axes_and_axial_normal_axes() -> None:
    force = "<product><p>aero/qbar-area</p><v>{}</v></product>"
    for names, signs in ((("X", "Y", "Z"), (1, 1, 1)), (("AXIAL", "SIDE", "NORMAL"), (-1, 1, -1))):
        axes = "".join(
            f'<axis name="{name}"><function name="{name}">{force.format(k + 1)}</function></axis>'
            for k, name in enumerate(names)
        )
        coefficients = small(axes).predict({"qbar": 7.0, "alpha": 0.3, "beta": 0.2}).coefficients
        expected = [sign * (k + 1) for k, sign in enumerate(signs)]
        assert [coefficients[axis][0] for axis in FORCE_AXES] == pytest.approx(expected, rel=1e-13)
        assert [coefficients[axis][0] for axis in MOMENT_AXES] == [0, 0, 0]


def test_planes_of_a_table_on_different_breakpoints_are_joined_exactly() -> None:
    table = """<table><independentVar lookup="row">aero/alpha-rad</independentVar>
      <independentVar lookup="column">aero/beta-rad</independentVar>
      <independentVar lookup="table">velocities/mach</independentVar>
      <tableData breakPoint="0">  0 1 <!-- a remark -->
                                0 0 1
                                1 2 5 </tableData>
      <tableData breakPoint="2">    0.5 2
                                0.5 1   3
                                3   0   1 </tableData></table>"""
    qbar = "<p>aero/qbar-psf</p><p>metrics/Sw-sqft</p><p>metrics/cbarw-ft</p>"
    database = small(function(f"<product>{qbar}{table}</product>"))
    values = [
        database.predict({"alpha": a, "beta": b, "mach": m}).coefficients["Cm"][0]
        for a, b, m in ((0.5, 0.25, 0.0), (0.25, 0.25, 2.0), (1.75, 1.25, 2.0), (9.0, 9.0, 1.0))
    ]
    assert values == pytest.approx([1.5, 1.0, 1.25, 3.0], rel=1e-15)


@pytest.mark.parametrize(
    ("aerodynamics", "message"),
    [
        (
            function("<interpolate1d><v>1</v><v>2</v></interpolate1d>"),
            "<interpolate1d> with 2 operands",
        ),
        (function("<random/>"), "unsupported element <random>"),
        (
            function("<rotation_alpha_local><v>1</v></rotation_alpha_local>"),
            "unsupported element <rotation_alpha_local>",
        ),
        ("<aero_ref_pt_shift_x/>", "<aero_ref_pt_shift_x> must contain exactly one function"),
        ('<axis name="ROLL" frame="EARTH"/>', "unsupported attributes of axis ROLL"),
        ('<axis name="LIFT" frame="WIND"/>', "unsupported attributes of axis LIFT"),
        ('<axis name="ROLL" unit="NM"/>', "unit 'NM' of axis ROLL"),
        (function("<v>1</v>").replace("<function", '<function apply_at_cg="true"'), "apply_at_cg"),
        ('<axis name="LIFTT"/>', "did you mean 'LIFT'"),
        (
            function("<v>1</v>", "LIFT")
            + '<axis name="X"><function name="g"><v>1</v></function></axis>',
            "different systems",
        ),
        (function("<v>nan</v>"), "not finite"),
        (function("<pow><v>1</v></pow>"), "<pow> with 1 operands"),
        (function("<v>1</v><v>2</v>"), "2 operations"),
        (
            function(
                "<table><independentVar>aero/alpha-rad</independentVar><tableData>0 1\n0"
                " 2</tableData></table>"
            ),
            "do not increase",
        ),
        (
            function(
                "<table><independentVar>aero/alpha-rad</independentVar><tableData>0"
                " 1\n1</tableData></table>"
            ),
            "differ in length",
        ),
    ],
)
def test_what_cannot_be_read_is_refused_by_name(aerodynamics: str, message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        small(aerodynamics)


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"<fdm_config>",
        b"\x00\xff",
        b"<fdm_config/>",
        b'<!DOCTYPE a [<!ENTITY b "c">]><fdm_config>&b;</fdm_config>',
        b'<!DOCTYPE a SYSTEM "http://localhost/a.dtd"><fdm_config/>',
    ],
)
def test_hostile_or_empty_xml_is_refused(text: bytes) -> None:
    with pytest.raises(InputError):
        import_jsbsim(text, name="bad.xml")


def test_damaged_files_are_read_or_refused_never_a_crash() -> None:
    """Random truncation, flipped bytes and repeated pieces inside the aerodynamics of a real
    file."""
    text, rng = aircraft_file("DHC6"), np.random.default_rng(24)
    start, end = text.index(b"<aerodynamics>"), text.index(b"</fdm_config>")
    refused = 0
    for _ in range(300):
        part = bytearray(text[start:end])
        for position in rng.integers(len(part), size=rng.integers(1, 4)):
            part[position] = rng.integers(256)
        cut, length, target = rng.integers(len(part)), rng.integers(200), rng.integers(len(part))
        if rng.random() < 0.3:
            part[target:target] = part[cut : cut + length]
        elif rng.random() < 0.3:
            del part[cut:]
        try:
            import_jsbsim(text[:start] + bytes(part) + text[end:], name="damaged")
        except InputError:
            refused += 1
    assert 200 < refused < 300


def test_binding_of_a_property_that_is_not_there_offers_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean 'fcs/flap-pos-norm'"):
        import_jsbsim(aircraft_file("DHC6"), name="DHC6", bindings={"fcs/flaps-pos-norm": "0"})


def test_cancelling_takes_out_one_factor_from_every_summand_or_nothing() -> None:
    assert cancel(parse("a*q*(b + 1)*2"), Name("q")) == parse("a*(b + 1)*2")
    assert cancel(parse("q - a/b*q"), Name("q")) == parse("1 - a/b")
    assert cancel(parse("-(q*q)"), Name("q")) == parse("-q")
    assert cancel(parse("q + a"), Name("q")) is None
    assert cancel(parse("a/q"), Name("q")) is None
