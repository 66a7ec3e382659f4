"""What an import asks: all at once, each question with bindings to copy; units of bindings count."""

import numpy as np
import pytest

from aerodb.errors import InputError, OpenQuestionsError
from aerodb.exchange import import_daveml, import_jsbsim
from tests.support.daveml_samples import small, variable

SUM = "<apply><plus/><ci>ALP</ci><ci>BETA</ci><ci>PB</ci><ci>p</ci></apply>"
FILE = small(
    variable("BETA", "<isInput/>", name="angleOfSideslip", units="deg", sign="nl")
    + variable("PB", "<isInput/>", name="bodyAngularRate_Roll", units="furlong")
    + variable("p", "<isInput/>", units="deg_s"),
    SUM,
)
AIRCRAFT = b"""<fdm_config name="g"><metrics><wingarea unit="M2">1</wingarea>
<wingspan unit="M">3</wingspan><chord unit="M">1</chord>
<location name="AERORP" unit="M"><x>0</x><y>0</y><z>0</z></location></metrics><aerodynamics>
<axis name="LIFT"><function name="aero/lift"><product><property>aero/qbar-psf</property>
<property>metrics/Sw-sqft</property><property>fcs/slat-pos-deg</property><value>0.1</value>
</product></function></axis></aerodynamics></fdm_config>"""


def asked(file, bindings):
    with pytest.raises(OpenQuestionsError) as caught:
        import_daveml(file, bindings=bindings, name="f")
    return caught.value


def test_sign_and_unit_are_asked_in_one_message():
    error = asked(FILE, {})
    said = str(error)
    assert "'nl' is none that is known" in said
    assert "anl wfr" in said
    assert "--bind BETA=beta*57.29577951308232" in said
    assert "--bind BETA=-(beta*57.29577951308232)" in said
    assert "in 'furlong' cannot be p" in said


def test_proposed_binding_gives_the_files_own_value():
    file = small(
        variable("BETA", "<isInput/>", name="angleOfSideslip", units="deg", sign="nl"),
        "<ci>BETA</ci>",
    )
    (question,) = asked(file, {}).questions
    expression, case = question.proposals[1]
    assert "positive against beta" in case
    database = import_daveml(file, bindings={question.name: expression}, name="f")
    value = database.predict({"beta": np.array([0.1])}).coefficients["Cm"]
    assert value[0] == pytest.approx(-np.rad2deg(0.1))


def test_binding_in_another_unit_is_refused_with_the_right_one():
    error = asked(FILE, {"BETA": "beta", "PB": "q/2", "p": "p"})
    said = str(error)
    assert "--bind BETA=beta*57.29577951308232" in said
    assert "q/2 is in rad/s, the input in furlong" in said
    assert "--bind p=p*57.29577951308232" in said


def test_a_channel_binds_the_input_of_its_name():
    file = small(variable("p", "<isInput/>", units="rad_s"), "<ci>p</ci>")
    database = import_daveml(file, bindings={"p": "p"}, name="f")
    assert database.inputs == ("p",)
    assert not database.free_inputs


def test_jsbsim_binds_by_path_or_identifier_and_checks_the_unit():
    for name in ("fcs/slat-pos-deg", "fcs_slat_pos_deg"):
        with pytest.raises(InputError, match="delta_slat is in rad, the input in deg"):
            import_jsbsim(AIRCRAFT, bindings={name: "delta_slat"}, name="g")
        database = import_jsbsim(AIRCRAFT, bindings={name: "delta_slat*57.3"}, name="g")
        assert database.inputs == ("alpha", "beta", "delta_slat")


OPEN = b"""<DAVEfunc xmlns="http://daveml.org/2010/DAVEML"><fileHeader name="x"><author name="x" org="y"/>
<creationDate date="2024-01-01"/></fileHeader>
<variableDef name="angleOfSideslip" varID="beta" units="deg" sign="wind in right ear"/>
<variableDef name="%s" varID="%s" units="nd"><calculation>
<math xmlns="http://www.w3.org/1998/Math/MathML"><apply><times/><cn>-0.006</cn><ci>beta</ci></apply>
</math></calculation><isOutput/></variableDef></DAVEfunc>"""
NAMELESS = "no output has the standard name of a coefficient"
GEOMETRY = {"S_ref": "11", "c_ref": "0.8", "b_ref": "15"}


def test_geometry_sign_and_outputs_are_asked_in_one_round():
    error = asked(OPEN % (b"cy", b"cy"), {})
    assert [question.name for question in error.questions] == ["CY", *GEOMETRY, "beta"]
    said = str(error)
    assert "no output has the standard name of a coefficient" in said.splitlines()[0]
    assert "--bind CY=cy" in said
    assert "--bind S_ref=NUMBER   in m2" in said
    beta = error.questions[-1].proposals[0][0]
    database = import_daveml(
        OPEN % (b"cy", b"cy"), bindings={**GEOMETRY, "CY": "cy", "beta": beta}, name="f"
    )
    assert database.reference.area == 11.0
    value = database.predict({"beta": np.array([0.1])}).coefficients["CY"]
    assert abs(value[0]) == pytest.approx(0.006 * np.rad2deg(0.1))


@pytest.mark.parametrize(
    ("name", "identity", "axis", "what"),
    [
        (b"sideForceCoefficient", b"cy", "CY", NAMELESS),
        (b"coefficientOfLift", b"CLtot", "CX", NAMELESS),
        (b"thrustBodyForce_X", b"cy", "CX", "the file is not one of aerodynamics"),
        (b"thrustBodyForce_X", b"FEX", "CX", "the file is not one of aerodynamics"),
        (b"lift", b"CLtot", "CX", "no output is a known coefficient"),
        (b"cl", b"cl", "CX", "no output is a known coefficient"),
    ],
)
def test_all_that_is_open_is_asked_whatever_the_output_is(name, identity, axis, what):
    """An output that is called like an axis is proposed for it, but not a thrust, nor cl, which is
    lift or roll."""
    error = asked(OPEN % (name, identity), {})
    assert error.what.startswith(what)
    assert [question.name for question in error.questions] == [axis, *GEOMETRY, "beta"]


@pytest.mark.parametrize("name", [b"totalCoefficientOfSideForce", b"TotalCoefficientOfSideforce"])
def test_a_standard_name_counts_in_letters_of_either_case(name):
    error = asked(OPEN % (name, b"cy"), {})
    assert [question.name for question in error.questions] == [*GEOMETRY, "beta"]
    assert "aerodynamics" not in str(error)


def test_what_is_answered_is_asked_no_more():
    error = asked(OPEN % (b"cy", b"cy"), {"S_ref": "11", "CY": "cy"})
    assert [question.name for question in error.questions] == ["c_ref", "b_ref", "beta"]
