"""Files of derivatives: the command's answer against the conversion, there and back, and what is wrong
in a file."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.identification import converted, parse_derivative_file
from aerodb.identification.conversion import LinearisedFlight, coefficient_derivatives, exact
from tests.aerodb.identification.test_conversion import AILERON_RUDDER, LATERAL, YF22, dict_of
from tests.support.command import asked

FLIGHT = """
[flight]
mass = "20.64 kg"
Ixx = 1.6073
Iyy = 7.5085
Izz = 7.1865
Ixz = -0.56144
area = 1.37
chord = "0.76 m"
span = "196 cm"
pressure = 1049.58
V = "42 m/s"
thrust = 54.62
"""
LINEAR = f"""{FLIGHT}
[linear_model]
states = ["beta", "p", "r", "phi"]
inputs = ["delta_aileron", "delta_rudder"]
A = {LATERAL.tolist()}
B = {AILERON_RUDDER.tolist()}
"""
DIMENSIONAL = f"""{FLIGHT}
[derivatives]
Lp = [-5.4624, 0.3]
Np = -1.6375
"""


def test_the_matrices_of_the_yf22():
    found = dict_of(converted(parse_derivative_file(LINEAR, "f")))
    assert found["CY_beta"] == pytest.approx(YF22.mass * YF22.V / YF22.force * LATERAL[0, 0])
    named = {"Lp": -5.4624, "Np": -1.6375}
    direct = coefficient_derivatives(exact(named), LinearisedFlight(**vars(YF22)))
    assert found["Cl_p_hat"] == pytest.approx(direct["Cl_p_hat"])


def test_there_and_back_with_errors(tmp_path):
    first = parse_derivative_file(DIMENSIONAL + "[errors]\nIxx = 0.05\n", "f")
    found = converted(first)
    lines = "\n".join(
        f"{n} = {v!r}" for n, v in zip(found.names, found.values.tolist(), strict=True)
    )
    back = dict_of(converted(parse_derivative_file(f"{FLIGHT}[derivatives]\n{lines}", "f")))
    assert back == pytest.approx({"Lp": -5.4624, "Np": -1.6375}, rel=1e-12)
    errors = dict(zip(found.names, found.standard_errors, strict=True))
    scale = YF22.span**2 * YF22.force / (2 * YF22.V)
    expected = np.hypot(0.3 * YF22.Ixx, 0.05 * 5.4624) / scale
    assert errors["Cl_p_hat"] == pytest.approx(expected, rel=1e-6)
    (tmp_path / "linear.toml").write_text(DIMENSIONAL)
    told = asked(tmp_path / "w", "derivatives", str(tmp_path / "linear.toml"))
    assert [row["name"] for row in told["derivatives"]] == list(found.names)
    assert told["derivatives"][0]["value"] == pytest.approx(found.values[0])


@pytest.mark.parametrize(
    ("was", "now", "what"),
    [
        ('V = "42 m/s"', "", "lacks V"),
        ('V = "42 m/s"', 'V = "42 kg"', "cannot be converted"),
        ("Ixz =", "Jxz =", "'Jxz' is no quantity"),
        ("Lp =", "Cl_p_hat =", "beside dimensional"),
        ("Np =", "Nq =", "no dimensional derivative"),
        ("[-5.4624, 0.3]", "[-5.4624, -0.3]", "negative"),
        ("[derivatives]", "[derivative]", "unknown key"),
        ("Np = -1.6375", "", "do not determine"),
        ("Lp = [-5.4624, 0.3]\nNp", "C_p_hat", "no derivative of a coefficient"),
    ],
)
def test_a_wrong_file_is_said(was, now, what):
    with pytest.raises(InputError, match=what):
        converted(parse_derivative_file(DIMENSIONAL.replace(was, now), "f"))


def test_matrices_of_another_size():
    for was, now, what in (
        ('"phi"]', '"phi", "theta"]', "A is not 5 by 5"),
        ('"delta_rudder"]', '"delta_rudder", "delta_flap"]', "B is not 4 by 3"),
    ):
        with pytest.raises(InputError, match=what):
            parse_derivative_file(LINEAR.replace(was, now), "f")
    with pytest.raises(InputError, match=r"needs \[derivatives\] or"):
        parse_derivative_file(FLIGHT, "f")
