"""Properties that a JSBSim file, or the motion, defines are no questions: values as JSBSim's own
formulas give them, computed here independently."""

from collections.abc import Callable

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange import import_jsbsim

METRICS = """<metrics><wingarea unit="M2">11</wingarea><wingspan unit="M">15</wingspan>
<chord unit="M">0.8</chord>{metrics}<location name="AERORP" unit="IN"><x>12</x><y>3</y><z>-7</z>
</location></metrics>"""
FLOWN = {
    "alpha": np.array([0.05, 0.1, -0.02]),
    "beta": np.array([0.02, -0.03, 0.0]),
    "V": np.array([40.0, 55.0, 30.0]),
    "theta": np.array([0.1, 0.2, -0.3]),
    "phi": np.array([0.3, -0.2, 0.0]),
    "rho": np.array([1.1, 1.2, 0.9]),
    "temperature": np.array([288.15, 270.0, 300.0]),
    "static_pressure": np.array([1e5, 9e4, 8e4]),
    "mach": np.array([0.12, 0.16, 0.09]),
    "delta_elevator": np.array([-0.2, 0.15, 0.0]),
    "delta_flap": np.array([0.0, 0.2, 0.3]),
    "delta_landing_gear": np.array([0.0, 0.5, 1.0]),
}


def force(
    used: str,
    control: str = "",
    metrics: str = "",
    more: str = "",
    loader: Callable[[str], bytes] | None = None,
) -> np.ndarray:
    """CX of an aircraft in which it is one property; no free input may be left."""
    text = f"""<fdm_config name="g">{METRICS.format(metrics=metrics)}
    <flight_control name="f"><channel name="c">{control}</channel></flight_control>{more}<aerodynamics>
    <axis name="X"><function name="aero/CL"><product><property>aero/qbar-psf</property>
    <property>metrics/Sw-sqft</property><property>{used}</property></product></function></axis>
    </aerodynamics></fdm_config>"""
    database = import_jsbsim(text.encode(), name="g", loader=loader)
    assert not database.free_inputs
    flown = {name: FLOWN[name] for name in database.inputs}
    return np.broadcast_to(database.predict(flown).coefficients["CX"], (3,))


def scale(of: str, made: str, more: str, domain: str = "<min>-0.4</min><max>0.3</max>") -> str:
    return f"""<aerosurface_scale name="s"><input>{of}</input><domain>{domain}</domain>{more}
    <output>{made}</output></aerosurface_scale>"""


def test_a_position_that_the_file_scales() -> None:
    """FGGain: centred at zero, each side of the domain maps to that of the range."""
    control = scale(
        "fcs/elevator-pos-rad", "fcs/elevator-pos-norm", "<range><min>-1</min><max>1</max></range>"
    )
    np.testing.assert_allclose(force("fcs/elevator-pos-norm", control), [-0.5, 0.5, 0.0])


def test_gain_sign_and_a_scale_that_is_not_centred() -> None:
    more = (
        "<range><min>-1</min><max>1</max></range><gain>2</gain><zero_centered>false</zero_centered>"
    )
    control = scale("-fcs/elevator-pos-rad", "fcs/elevator-pos-norm", more)
    expected = 2.0 * (-1.0 + (-FLOWN["delta_elevator"] + 0.4) / 0.7 * 2.0)
    np.testing.assert_allclose(force("fcs/elevator-pos-norm", control), expected)


def test_a_flap_of_which_the_domain_begins_at_zero_and_a_gain_upon_it() -> None:
    control = scale(
        "fcs/flap-pos-deg",
        "fcs/flap-pos-norm",
        "<range><min>0</min><max>1</max></range>",
        "<min>0</min><max>40</max>",
    )
    control += """<pure_gain name="g"><input>fcs/flap-pos-norm</input><gain>3</gain>
    <output>fcs/flap-effect</output></pure_gain>"""
    expected = 3.0 * np.rad2deg(FLOWN["delta_flap"]) / 40.0
    np.testing.assert_allclose(force("fcs/flap-effect", control), expected, atol=1e-15)


RANGE = "<range><min>{}</min><max>{}</max></range>"
ONE = "<min>-1</min><max>1</max>"


def test_a_position_beside_another_that_is_scaled_from_the_same_command() -> None:
    """The command is the position over its travel, on either side: -20 deg and 15 deg."""
    travel = f"{RANGE.format(-20, 15)}<gain>0.01745</gain>"
    control = scale("fcs/pitch-sum", "fcs/elevator-pos-rad", travel, ONE)
    control += scale("fcs/pitch-sum", "fcs/elevator-pos-norm", RANGE.format(-1, 1), ONE)
    deflection = FLOWN["delta_elevator"] / 0.01745
    expected = np.where(deflection > 0, deflection / 15, deflection / 20)
    np.testing.assert_allclose(force("fcs/elevator-pos-norm", control), expected)


def test_a_command_that_a_scale_reverses_or_shifts_is_found_from_what_it_makes() -> None:
    reversed_ = scale("fcs/roll-sum", "fcs/elevator-pos-rad", RANGE.format(0.5, -0.25), ONE)
    x = FLOWN["delta_elevator"]
    expected = np.where(x > 0, -x / 0.5, -x / 0.25)
    np.testing.assert_allclose(force("fcs/roll-sum", reversed_), expected)
    shifted = f"{RANGE.format(0, 0.7)}<zero_centered>false</zero_centered>"
    control = scale("fcs/flap-lever", "fcs/flap-pos-rad", shifted, "<min>1</min><max>4</max>")
    expected = 1 + 3 * FLOWN["delta_flap"] / 0.7
    np.testing.assert_allclose(force("fcs/flap-lever", control), expected)


def test_a_component_is_a_property_by_its_own_name() -> None:
    control = scale("fcs/elevator-pos-rad", "fcs/unused", RANGE.format(-3, 3), ONE)
    named = control.replace('name="s"', 'name="Elevator Copy"')
    expected = 3.0 * FLOWN["delta_elevator"]
    np.testing.assert_allclose(force("fcs/elevator-copy", named), expected)
    with_path = control.replace('name="s"', 'name="systems/copy"')
    np.testing.assert_allclose(force("systems/copy", with_path), expected)


def test_systems_in_files_of_their_own_define_positions() -> None:
    made = scale("fcs/flap-pos-rad", "fcs/flap-pos-norm", RANGE.format(0, 1), "<max>0.5</max>")
    files = {"Systems/flaps": f"<system name='flaps'><channel name='f'>{made}</channel></system>"}
    asked: list[str] = []

    def load(name: str) -> bytes:
        asked.append(name)
        if name not in files:
            raise InputError(f"no {name}", "folder")
        return files[name].encode()

    more = "<system file='flaps.xml'/><system file='absent'/><system file='../outside'/>"
    found = force("fcs/flap-pos-norm", more=more, loader=load)
    np.testing.assert_allclose(found, 2 * FLOWN["delta_flap"])
    assert "absent" in asked
    assert not any(".." in name for name in asked)


def computed(made: str, operation: str) -> str:
    return f"""<fcs_function name="f"><function>{operation}</function><output>{made}</output>
    </fcs_function>"""


def test_what_the_files_own_functions_compute_of_known_properties() -> None:
    half = "<product><value>0.5</value><property>metrics/cbarw-ft</property></product>"
    speed = "<property>velocities/vt-fps</property>"
    control = computed("aero/half", f"<quotient>{half}{speed}</quotient>")
    both = "<property>aero/half</property><property>velocities/vt-fps</property>"
    control += computed("aero/twice", f"<product>{both}<value>4</value></product>")
    np.testing.assert_allclose(force("aero/twice", control), 2 * 0.8 / 0.3048)


@pytest.mark.parametrize(
    "operation",
    [
        "<property>fcs/pitch-cmd-norm</property>",
        "<property>aero/made</property>",
        "<random/>",
        "<property>velocities/vt-fps</property><value>1</value>",
    ],
)
def test_functions_of_what_nobody_knows_stay_a_question(operation: str) -> None:
    with pytest.raises(AssertionError):
        force("aero/made", computed("aero/made", operation))


def test_many_scales_of_one_another_end() -> None:
    """A file from outside: every property is made of the next, and none is known."""
    control = "".join(
        scale(f"fcs/a{k}", f"fcs/a{k + 1}", RANGE.format(-1, 2), ONE) for k in range(300)
    )
    with pytest.raises(AssertionError):
        force("fcs/a150", control)


@pytest.mark.parametrize(
    "control",
    [
        "",
        scale(
            "fcs/pitch-cmd-norm",
            "fcs/elevator-pos-norm",
            "<range><min>-1</min><max>1</max></range>",
        ),
        scale(
            "fcs/elevator-pos-rad",
            "fcs/elevator-pos-norm",
            "<clipto><min>0</min><max>1</max></clipto>",
        ),
        scale(
            "fcs/elevator-pos-norm",
            "fcs/elevator-pos-norm",
            "<range><min>0</min><max>1</max></range>",
        ),
        scale(
            "fcs/elevator-pos-rad",
            "fcs/elevator-pos-norm",
            "<range><min>a/b</min><max>1</max></range>",
        ),
    ],
)
def test_what_the_file_does_not_define_in_known_terms_stays_a_question(control: str) -> None:
    with pytest.raises(AssertionError):
        force("fcs/elevator-pos-norm", control)


def body_velocity() -> np.ndarray:
    speed, alpha, beta = FLOWN["V"], FLOWN["alpha"], FLOWN["beta"]
    return speed * np.array(
        [np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)]
    )


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_body_velocity_is_that_of_the_air_without_wind(axis: int) -> None:
    expected = body_velocity()[axis] / 0.3048
    np.testing.assert_allclose(force(f"velocities/{'uvw'[axis]}-fps"), expected)


def test_climb_angle_from_the_velocity_turned_to_the_earth() -> None:
    phi, theta = FLOWN["phi"], FLOWN["theta"]
    u, v, w = body_velocity()
    up = u * np.sin(theta) - v * np.sin(phi) * np.cos(theta) - w * np.cos(phi) * np.cos(theta)
    np.testing.assert_allclose(force("flight-path/gamma-rad"), np.arcsin(up / FLOWN["V"]))
    np.testing.assert_allclose(
        force("flight-path/gamma-deg"), np.rad2deg(np.arcsin(up / FLOWN["V"]))
    )


def test_reynolds_number_in_the_units_of_jsbsim() -> None:
    rankine, slugs = FLOWN["temperature"] * 1.8, FLOWN["rho"] / 515.3788184
    viscosity = 2.269690e-8 * rankine**1.5 / (198.72 + rankine)
    expected = FLOWN["V"] / 0.3048 * (0.8 / 0.3048) * slugs / viscosity
    np.testing.assert_allclose(force("aero/Re"), expected, rtol=1e-6)
    # US Standard Atmosphere 1976: 1.7894e-5 Pa s at 288.15 K
    assert 1.1 * 40.0 * 0.8 / expected[0] == pytest.approx(1.7894e-5, rel=2e-3)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("atmosphere/P-psf", FLOWN["static_pressure"] / 47.88025898),
        ("atmosphere/T-R", FLOWN["temperature"] * 1.8),
        ("atmosphere/a-fps", FLOWN["V"] / FLOWN["mach"] / 0.3048),
        ("metrics/aero-rp-x-in", 12.0),
        ("metrics/aero-rp-y-in", 3.0),
        ("metrics/aero-rp-z-in", -7.0),
        ("gear/gear[0]/position-norm", FLOWN["delta_landing_gear"]),
        ("/gear/gear[1]/position-norm", FLOWN["delta_landing_gear"]),
        ("gear/unit[2]/pos-norm", FLOWN["delta_landing_gear"]),
    ],
)
def test_other_properties_that_flights_or_the_file_have(name: str, expected: np.ndarray) -> None:
    np.testing.assert_allclose(force(name), np.broadcast_to(expected, (3,)), rtol=1e-8)


def test_an_empty_unit_is_no_unit() -> None:
    """JSBSim converts a number without a unit as one in its own: the incidence in degrees here is
    that of the same file with none."""
    given = [
        force("aero/alpha-wing-rad", metrics=f"<wing_incidence{unit}>2</wing_incidence>")
        for unit in ("", ' unit=""')
    ]
    np.testing.assert_array_equal(*given)


def test_what_flightgear_has_of_the_motion_comes_from_the_flight() -> None:
    """From the root of its tree, beside which JSBSim's own part is ``/fdm/jsbsim``."""
    speed, alpha, beta = FLOWN["V"], FLOWN["alpha"], FLOWN["beta"]
    expected = {
        "/orientation/roll-deg": np.rad2deg(FLOWN["phi"]),
        "/orientation/pitch-deg": np.rad2deg(FLOWN["theta"]),
        "/orientation/alpha-deg": np.rad2deg(alpha),
        "/orientation/side-slip-deg": np.rad2deg(beta),
        "/velocities/uBody-fps": speed * np.cos(alpha) * np.cos(beta) / 0.3048,
        "/velocities/vBody-fps": speed * np.sin(beta) / 0.3048,
        "/velocities/mach": FLOWN["mach"],
        "/environment/density-slugft3": FLOWN["rho"] / 515.378818,
        "/environment/temperature-degc": FLOWN["temperature"] - 273.15,
        "/fdm/jsbsim/fcs/flap-pos-deg": np.rad2deg(FLOWN["delta_flap"]),
        "-/fdm/jsbsim/aero/alpha-rad": -alpha,
    }
    for name, values in expected.items():
        np.testing.assert_allclose(force(name), values, rtol=1e-8, atol=1e-12, err_msg=name)
    control = scale(
        "/fdm/jsbsim/fcs/elevator-pos-rad", "/fdm/jsbsim/fcs/share", RANGE.format(-2, 2), ONE
    )
    np.testing.assert_allclose(force("fcs/share", control), 2 * FLOWN["delta_elevator"])
