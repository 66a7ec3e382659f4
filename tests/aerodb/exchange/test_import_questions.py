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
