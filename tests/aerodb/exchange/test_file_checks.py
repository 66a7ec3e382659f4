"""Check cases of files at import: NASA's pass, one changed node is found where a case bears on it,
and files without cases, or with rounded ones, are judged for what they are."""

import re

import pytest

from aerodb.exchange import (
    check_file,
    export_daveml,
    export_jsbsim,
    import_daveml,
    import_jsbsim,
    jsbsim_check_cases,
)
from tests.support.daveml_samples import pitch, small
from tests.support.generated_databases import generated

SHOT = """<checkData><staticShot name="one"><checkInputs>
<signal><signalName>angleOfAttack</signalName><signalUnits>deg</signalUnits><signalValue>5</signalValue></signal>
<signal><signalName>mach</signalName><signalUnits>nd</signalUnits><signalValue>0.3</signalValue></signal>
</checkInputs><checkOutputs>
<signal><signalName>aeroBodyMomentCoefficient_Pitch</signalName><signalUnits>nd</signalUnits><signalValue>{}</signalValue></signal>
</checkOutputs></staticShot></checkData>"""
TABLE = f"""{pitch()}<breakpointDef bpID="A"><bpVals>0, 10, 20</bpVals></breakpointDef>
<griddedTableDef gtID="T"><breakpointRefs><bpRef bpID="A"/></breakpointRefs>
<confidenceBound value="0"/><dataTable>0.10001, 0.30004, 0.9</dataTable></griddedTableDef>
<function name="f"><independentVarRef varID="ALP"/><dependentVarRef varID="CM"/>
<functionDefn><griddedTableRef gtID="T"/></functionDefn></function>"""


def checked(xml):
    return check_file(xml, "small.dml", import_daveml(xml, name="small"))


def test_nasa_file_passes_and_a_changed_constant_is_found(measured):
    xml = measured("daveml/HL20_aero.dml").read_bytes()
    checks = checked(xml)
    assert (checks.cases, checks.failed) == (25, 0)
    assert 0 < checks.reached < checks.nodes
    wrong = checked(xml.replace(b"-0.22364E+00", b"-0.22365E+00"))
    assert not wrong.passed
    assert any("CMQ is" in text for text in wrong.failures)


@pytest.mark.parametrize(
    ("stated", "passed"),
    [
        ("0.200025", True),
        ("0.20003", True),  # rounded to five decimals, as all values of the shot are
        ("0.20004", False),
        ("0.2", False),  # fewer than four digits are the number itself
    ],
)
def test_tolerance_of_values_without_one_is_their_last_digit(stated, passed):
    assert checked(small(TABLE + SHOT.format(stated))).passed is passed


def test_only_nodes_beside_the_cases_are_seen():
    file = small(TABLE + SHOT.format("0.200025"))
    checks = checked(file)
    assert (checks.reached, checks.nodes) == (2, 3)
    assert not checked(file.replace(b"0.30004", b"0.30014")).passed
    assert checked(file.replace(b"0.9<", b"0.8<")).passed  # beyond the case, which the count says


def test_cases_that_cannot_be_read_are_a_failure_and_no_cases_are_said():
    unknown = SHOT.format("0.2").replace("angleOfAttack", "angleOfNothing")
    assert "angleOfNothing" in checked(small(TABLE + unknown)).failures[0]
    none = checked(small(TABLE))
    assert none.passed
    assert "no check cases" in str(none)


def test_exports_bring_cases_that_find_a_changed_number():
    database = generated(3)
    daveml = export_daveml(database)
    assert checked(daveml).passed
    xml = export_jsbsim(database, name="g", cases=jsbsim_check_cases(database))
    checks = check_file(xml, "g.xml", import_jsbsim(xml, name="g"))
    assert (checks.cases, checks.failed) == (20, 0)
    constant = re.search(rb"<value>(-?\d+\.\d+)</value>", xml)
    assert constant is not None
    changed = repr(float(constant[1]) * 1.01 + 1e-3).encode()
    other = xml[: constant.start(1)] + changed + xml[constant.end(1) :]
    assert not check_file(other, "g.xml", import_jsbsim(other, name="g")).passed
