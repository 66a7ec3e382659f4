"""The effect library: what is in it for which vehicle, that it is frozen by its hash, and what
users add to it."""

from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from aerodb.coefficients.comparison import compare
from aerodb.coefficients.total import total_coefficients
from aerodb.effects.flight_view import FlightView, view_of
from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.library import TEMPLATES, hypotheses_for, library_sha256
from aerodb.effects.stall import stall_hysteresis
from aerodb.effects.surfaces import role_of, surfaces_at_rest, surfaces_of
from aerodb.effects.template import LibrarySettings, Template
from aerodb.effects.user_effects import parse_effects, registered_templates
from aerodb.errors import AeroError, InputError, UnknownNameError
from aerodb.exchange.native import read_native
from aerodb.tables.database import AeroDatabase
from aerodb.tables.state_model import Kirchhoff
from aerodb.vehicle import Sensor, Vehicle, parse_vehicle
from tests.support import effect_flights

#: The names of the contract.
AERODYNAMIC = [
    "zero_offset",
    "alpha_slope",
    "alpha_slope_break",
    "lift_scale",
    "beta_slope",
    "beta_even",
    "table_sign",
    "sideslip_coupling",
    "pitch_rate_force",
    "pitch_damping",
    "alpha_dot",
    "lift_lag",
    "roll_damping",
    "yaw_damping",
    "cross_rate",
    "control_effectiveness",
    "control_nonlinearity",
    "control_one_sided",
    "control_alpha_coupling",
    "surface_asymmetry",
    "speed_brake",
    "body_flap",
    "flap",
    "landing_gear",
    "landing_gear_beta",
    "ground_effect",
    "thrust_effect",
    "mach_effect",
    "dynamic_pressure_effect",
    "stall_hysteresis",
]
SENSORS = [
    "qbar_scale",
    "qbar_offset",
    "alpha_bias",
    "alpha_scale",
    "alpha_delay",
    "beta_bias",
    "beta_scale",
    "accelerometer_bias",
    "gyro_bias",
    "gyro_scale",
    "mass_error",
    "cg_offset",
    "inertia_error",
    "thrust_scale",
    "thrust_line_offset",
    "surface_scale",
    "surface_bias",
    "surface_delay",
    "surface_backlash",
    "surface_wide_backlash",
    "surface_dead_zone",
]


def phoenix() -> tuple[AeroDatabase, Vehicle, tuple[str, ...]]:
    """Database, vehicle and what its logs hold."""
    root = files("aerodb.examples.phoenix")
    database, vehicle = (
        read_native((root / "preflight.toml").read_text()),
        parse_vehicle((root / "vehicle.toml").read_text()),
    )
    surfaces = tuple(f"delta_{name}" for name in (*vehicle.surfaces, *vehicle.combinations))
    return (
        database,
        vehicle,
        (*database.inputs, "qbar", "mach", "ax_imu", "ay_imu", "az_imu", *surfaces),
    )


def taxi(**changes: object) -> tuple[Hypothesis, ...]:
    return hypotheses_for(
        effect_flights.database(),
        effect_flights.vehicle(),
        effect_flights.channel_names(),
        **changes,
    )


def test_all_names_of_the_contract_are_there_under_their_kind() -> None:
    by_kind = {
        kind: {t.effect for t in TEMPLATES if t.kind == kind} for kind in ("aerodynamic", "sensor")
    }
    assert set(AERODYNAMIC) <= by_kind["aerodynamic"]
    assert set(SENSORS) <= by_kind["sensor"]
    assert all(t.formula and t.source for t in TEMPLATES)


def test_phoenix_gets_more_than_35_hypotheses_with_their_rivals() -> None:
    found = hypotheses_for(*phoenix())
    names = {item.id for item in found}
    assert len(names) == len(found) >= 35
    assert {
        "pitch_rate_force@CX",
        "control_effectiveness@Cm:elevator_inboard",
        "speed_brake@CX",
        "qbar_scale@all",
    } <= names
    assert {
        "surface_scale@all:elevon_inboard",
        "cg_offset@all:x",
        "surface_asymmetry@Cl:elevator_outboard",
    } <= names
    for item in found:
        assert item.plausible[0] < item.plausible[1], item.id
        assert item.because, item.id
        assert "_" not in item.because.replace("Ixx", ""), item.id
        assert (item.prior_sigma is None) == (item.kind == "aerodynamic"), item.id
        assert item.prior_sigma is None or 0 < item.prior_sigma <= item.plausible[1], item.id


def test_a_surface_that_moves_less_than_its_stated_noise_is_at_rest() -> None:
    """.05 deg rms of a travel of 40 deg: a pick-off whose noise is not stated is believed, but not
    that it shows a third of that."""
    values = {"delta_elevator": np.deg2rad(0.05) * np.random.default_rng(1).standard_normal(2000)}
    moved = {"delta_elevator": 3.0 * values["delta_elevator"]}
    vehicle = effect_flights.vehicle()
    noisy = vehicle.model_copy(
        update={"sensors": {"delta_elevator": Sensor(noise=float(np.deg2rad(0.05)))}}
    )
    assert surfaces_at_rest(vehicle, values) == set()
    drifting = {"delta_elevator": values["delta_elevator"] / 3.0}
    assert surfaces_at_rest(vehicle, drifting) == {"delta_elevator"}
    assert surfaces_at_rest(noisy, values) == {"delta_elevator"}
    assert surfaces_at_rest(noisy, moved) == set()


def test_only_what_makes_sense_is_expanded() -> None:
    database, vehicle, channels = phoenix()
    names = {item.id for item in hypotheses_for(database, vehicle, channels)}
    assert not any(
        name.startswith(("flap", "thrust", "table_sign")) for name in names
    )  # it has none
    blind = {
        item.effect
        for item in hypotheses_for(
            database, vehicle, set(channels) - {"beta", "height_above_ground"}
        )
    }
    assert not blind & {
        "beta_slope",
        "beta_even",
        "sideslip_coupling",
        "ground_effect",
        "beta_bias",
        "landing_gear_beta",
    }
    fixed = vehicle.model_copy(update={"configuration": {"delta_body_flap": 0.0}})
    assert not any("body_flap" in item.id for item in hypotheses_for(database, fixed, channels))


def test_priors_come_from_the_vehicle_file_or_from_reconstruction() -> None:
    database, vehicle, channels = phoenix()

    def sigma(parameter: str, **priors: float) -> float | None:
        found = hypotheses_for(database, vehicle, channels, priors=priors)
        return next(item.prior_sigma for item in found if item.parameter == parameter)

    assert sigma("alpha_bias") == vehicle.sensors["alpha"].bias_prior
    assert sigma("az_bias") == vehicle.sensors["az_imu"].bias_prior
    assert sigma("qbar_scale") == vehicle.accuracy.qbar_fraction
    assert sigma("alpha_bias", alpha_bias=2e-4) == 2e-4
    with pytest.raises(UnknownNameError, match=r"'alpha_bais'[^\n]*\n.*did you mean 'alpha_bias'"):
        sigma("alpha_bias", alpha_bais=1.0)
    with pytest.raises(InputError, match="prior of 'alpha_bias' is -1"):
        sigma("alpha_bias", alpha_bias=-1.0)


def test_the_hash_covers_whatever_decides_what_can_be_found() -> None:
    found = taxi()
    key = library_sha256(found)
    assert key == library_sha256(reversed(found)) == library_sha256(taxi())
    one, *rest = found
    changed = [
        found[1:],
        (replace(one, plausible=(-1.0, 1.0)), *rest),
        (replace(one, version=one.version + 1), *rest),
        (replace(one, formula="something else"), *rest),
        taxi(priors={"alpha_bias": 1e-4}),
        taxi(instead=[replace(TEMPLATES[0], version=TEMPLATES[0].version + 1)]),
        taxi(settings=LibrarySettings(alpha_breaks=(0.2,))),
    ]
    assert len({key, *map(library_sha256, changed)}) == 1 + len(changed)
    assert library_sha256(found, LibrarySettings(alpha_breaks=(0.175, 0.3))) != key
    assert library_sha256((replace(one, because="in other words"), *rest)) == key


def test_a_chosen_set_of_effects_is_expanded_alone_and_a_wrong_name_refused() -> None:
    found = taxi(settings=LibrarySettings(effects=("alpha_slope", "qbar_scale")))
    assert {item.effect for item in found} == {"alpha_slope", "qbar_scale"}
    with pytest.raises(UnknownNameError, match="did you mean 'alpha_slope'"):
        taxi(settings=LibrarySettings(effects=("alpha_slop",)))


def test_a_template_with_fitted_shapes_takes_the_place_of_the_librarys() -> None:
    fitted = stall_hysteresis.template([Kirchhoff(sharpness=20.0, alpha_star=0.25, lag=10.0)])
    found, usual = taxi(instead=[fitted]), taxi()
    assert {item.id for item in found} == {item.id for item in usual}
    assert library_sha256(found) != library_sha256(usual)
    with pytest.raises(InputError, match="stands twice"):
        taxi(user=[fitted])


def test_surfaces_are_known_by_what_they_are_for() -> None:
    _, vehicle, channels = phoenix()
    roles = {surface.name: surface.role for surface in surfaces_of(vehicle, channels)}
    assert roles == {
        "aileron_inboard": "roll",
        "aileron_outboard": "roll",
        "body_flap": "body_flap",
        "elevator_inboard": "pitch",
        "elevator_outboard": "pitch",
        "landing_gear": "landing_gear",
        "rudder": "yaw",
        "speed_brake": "speed_brake",
    }
    names = ("speedbrake", "spoiler", "stabilator", "flaperon_left", "ruddervator_left", "fin")
    assert [role_of(name) for name in names] == [
        "speed_brake",
        "speed_brake",
        "pitch",
        "roll",
        "pitch",
        "yaw",
    ]
    strake = [item.id for item in taxi() if "strake" in item.id and item.kind == "aerodynamic"]
    assert strake == [
        f"control_effectiveness@{axis}:strake" for axis in ("CX", "CY", "CZ", "Cl", "Cm", "Cn")
    ]


def test_forces_are_looked_for_on_the_axes_on_which_the_database_writes_them() -> None:
    on_wind = hypotheses_for(
        effect_flights.database(wind=True), effect_flights.vehicle(), effect_flights.channel_names()
    )
    found = {item.id: item for item in on_wind}
    assert "speed_brake@C_drag" in found
    assert found["speed_brake@C_drag"].axes == ("CX", "CY", "CZ")
    assert found["speed_brake@C_drag"].because == "drag that grows with speed brake deflection"
    assert found["speed_brake@Cm"].axes == ("Cm",)
    # but for constants, which every flight has on its body axes
    assert [name for name in found if "@CX" in name] == ["zero_offset@CX"]


USER = """\
[[effect]]
name = "wing_rock"
axes = ["Cl", "Cn"]
expression = "alpha*p_hat*abs(beta)"
plausible = [-50.0, 50.0]
because = "rolling moment that grows with roll rate, angle of attack and sideslip"
source = "J. Aircraft 26(8)"
[[effect]]
name = "ground_effect"
subject = "exponential"
axes = ["CZ"]
expression = "alpha*exp(-height_above_ground/3)"
plausible = [-2.0, 2.0]
because = "force along z that fades within three metres of the ground"
"""


def test_templates_from_a_file_join_the_library_and_its_hash() -> None:
    found = {item.id: item for item in taxi(user=parse_effects(USER))}
    assert set(found) - {item.id for item in taxi()} == {
        "wing_rock@Cl",
        "wing_rock@Cn",
        "ground_effect@CZ:exponential",
    }
    assert library_sha256(found.values()) != library_sha256(taxi())
    assert found["wing_rock@Cl"].needs == ("V", "alpha", "beta", "p")
    assert found["wing_rock@Cl"].drivers == ("alpha", "beta", "p_hat")
    channels = {"alpha": np.array([0.1]), "beta": np.array([-0.2]), "p_hat": np.array([0.03])}
    flight = effect_flights.flown(1, effect_flights.database())
    view = _view(flight, effect_flights.database(), effect_flights.vehicle())
    first = {name: values[:1] for name, values in flight.channels.items()}
    view = replace(
        view,
        recorded=replace(flight, time=np.zeros(1), channels=first),
        channels={**{n: x[:1] for n, x in view.channels.items()}, **channels},
    )
    assert found["wing_rock@Cl"].columns(view)["Cl"] == pytest.approx(0.1 * 0.03 * 0.2)


def _view(flight, database: AeroDatabase, vehicle: Vehicle) -> FlightView:
    coefficients = total_coefficients(flight, vehicle)
    return view_of(
        flight, compare(flight, coefficients, database, vehicle.reference), database, vehicle
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("wing_rock", "Wing Rock"), "name 'Wing Rock' is not lower case"),
        (('"Cl", "Cn"', '"Cl", "CN"'), "unknown axis 'CN'; did you mean 'Cn'"),
        (('"Cl", "Cn"', '"Cl", "Cl"'), "an axis stands twice"),
        (("alpha*p_hat", "alhpa*p_hat"), r"unknown channel 'alhpa'\n.*did you mean 'alpha'"),
        (("alpha*p_hat", "alpha*+*p_hat"), "position"),
        (("alpha*p_hat", "WING(alpha)*p_hat"), "no function 'WING'"),
        (("abs(beta)", "__import__('os')"), "position"),
        (("[-50.0, 50.0]", "[50.0, -50.0]"), "plausible must be"),
        (("because =", "becuase ="), "2 mistakes\nunknown key .*becuase'; did you mean 'because'"),
        (("[[effect]]", "[[effect]"), "not valid TOML"),
        (("axes =", "axis ="), "unknown key"),
    ],
)
def test_a_faulty_file_is_refused_with_the_place_and_the_remedy(
    change: tuple[str, str], message: str
) -> None:
    with pytest.raises(InputError, match=f"(?s){message}") as error:
        parse_effects(USER.replace(*change), "effects.toml")
    assert str(error.value).startswith("effects.toml")


def test_an_effect_that_the_library_has_needs_a_subject_of_its_own() -> None:
    double = USER.replace('subject = "exponential"\n', "")
    with pytest.raises(InputError, match=r"'ground_effect@CZ' stands twice"):
        taxi(user=parse_effects(double))


def _package(root: Path, name: str, code: str, target: str) -> None:
    (root / f"{name}.py").write_text(code)
    info = root / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[aerodb.effects]\n{name} = {name}:{target}\n")


def test_installed_packages_register_templates(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = "from aerodb.effects.template import per_axis\n"
    code += (
        "RIPPLE = per_axis('ripple', 'sin(40*alpha)', {'CZ': 0.1}, unit='1', grows='that ripples',"
        " name='ripple', source='x')\n"
    )
    _package(
        tmp_path, "ripple_effects", code + "def templates():\n    return [RIPPLE]\n", "templates"
    )
    _package(tmp_path, "single_effect", code.replace("ripple", "swell"), "RIPPLE")
    monkeypatch.syspath_prepend(str(tmp_path))
    found = registered_templates()
    assert [template.effect for template in found] == ["ripple", "swell"]
    assert all(isinstance(template, Template) for template in found)
    assert {"ripple@CZ", "swell@CZ"} <= {item.id for item in taxi(user=found)}


@pytest.mark.parametrize(
    ("code", "target", "message"),
    [
        ("templates = 3\n", "templates", "gives a int, not a Template"),
        ("def templates():\n    return [1]\n", "templates", "gives a int, not a Template"),
        ("def templates():\n    return 1/0\n", "templates", "ZeroDivisionError"),
        ("x = 1\n", "templates", "AttributeError"),
    ],
)
def test_a_broken_package_is_named(
    code: str, target: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"broken_{abs(hash((code, target)))}"
    _package(tmp_path, name, code, target)
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(InputError, match=message) as error:
        registered_templates()
    assert f"aerodb.effects: {name} = {name}:{target}" in str(error.value)
    assert "uninstall" in str(error.value)


def test_a_log_without_airspeed_and_rates_still_gives_what_it_can() -> None:
    """No hat rates, no probe to move: accelerations, alpha and qbar are enough for forces and their
    rivals."""
    vehicle = effect_flights.vehicle()
    simple = read_native(
        effect_flights.HEADER_ONLY + '[derivatives.CZ]\nalpha = -4.5\n"1" = -0.2\n'
    )
    flight = effect_flights.flown(2, effect_flights.database())
    kept = {name: flight[name] for name in ("alpha", "qbar", "ax", "ay", "az", "delta_elevator")}
    flight = replace(flight, channels=kept)
    view = _view(flight, simple, vehicle)
    library = {item.id: item for item in hypotheses_for(simple, vehicle, kept)}
    assert {
        "alpha_slope@CZ",
        "qbar_scale@all",
        "alpha_bias@all",
        "alpha_delay@all",
        "mass_error@all",
    } <= set(library)
    assert not {"pitch_rate_force@CZ", "gyro_bias@all:p", "air_data_position@all:x"} & set(library)
    for item in library.values():
        columns = item.columns(view)
        assert set(columns) <= {"CX", "CY", "CZ"}, item.id
        assert all(np.isfinite(values).all() for values in columns.values()), item.id
    assert np.allclose(library["alpha_bias@all"].columns(view)["CZ"], 4.5)
    assert np.allclose(
        library["alpha_delay@all"].columns(view)["CZ"][20:-20],
        -4.5 * view["alphadot"][20:-20],
        atol=1e-6,
    )


def test_pauses_of_the_log_take_nothing_from_what_is_looked_for() -> None:
    """A tenth of all samples is missing: what is left is as good as ever. A channel that alone is
    bad is not."""
    database, vehicle = effect_flights.database(), effect_flights.vehicle()
    flight = effect_flights.flown(2, database)
    pause = np.zeros(len(flight.time), dtype=np.bool_)
    pause[100 : 100 + len(pause) // 10] = True
    paused = flight
    for name in flight.channels:
        paused = paused.with_flag(name, "gap", pause)
    library = hypotheses_for(database, vehicle, flight.channels)
    view = _view(paused, database, vehicle)
    assert not view.poor
    assert all(item.columns(view) for item in library)
    doubtful = flight.with_flag("delta_strake", "gap", pause)
    assert _view(doubtful, database, vehicle).poor == {"delta_strake"}


def test_errors_of_the_library_are_errors_of_the_product() -> None:
    with pytest.raises(AeroError):
        taxi(settings=LibrarySettings(effects=("none",)))


@pytest.mark.parametrize(("factor", "even"), [("1", False), ("delta_aileron", True)])
def test_a_table_times_a_lateral_control_has_the_other_symmetry(factor: str, even: bool) -> None:
    """The mirror image reverses the aileron: its effect on roll is alike for sideslip to either
    side, and only a lost sign makes it wrong."""
    for values, alike in (([0.3, 0.2, 0.3], True), ([-0.3, 0.0, 0.3], False)):
        text = effect_flights.HEADER_ONLY + (
            "[tables.T]\narguments = ['beta']\nbreakpoints = [[-0.2, 0.0, 0.2]]\n"
            f"values = {values}\n[[terms]]\nname = 'roll'\naxis = 'Cl'\n"
            f"expression = '{factor}*T(beta)'\n"
        )
        names = (*effect_flights.channel_names(), "delta_aileron")
        library = hypotheses_for(read_native(text), effect_flights.vehicle(), names)
        (found,) = (h for h in library if h.effect == "table_sign")
        right = alike == even
        assert found.plausible == ((-2.5, -1.5) if right or even else (-2.5, 0.5)), values


def test_an_effect_knows_its_other_shapes() -> None:
    """A surface's cubic term and its change with alpha are shapes of its effectiveness; another
    surface, axis or variable is another effect, and a shape has no simpler shape."""
    found = {item.id: item for item in taxi()}
    rudder = found["control_effectiveness@Cn:rudder"]
    assert {
        name for name, other in found.items() if other != rudder and rudder.has_shape(other)
    } == {
        "control_nonlinearity@Cn:rudder",
        "control_one_sided@Cn:positive_rudder",
        "control_one_sided@Cn:negative_rudder",
        "control_alpha_coupling@Cn:rudder",
    }
    assert not found["control_nonlinearity@Cn:rudder"].has_shape(rudder)
    assert not found["zero_offset@Cm"].has_shape(found["alpha_slope@Cm"])
    assert found["alpha_slope@Cm"].has_shape(found["mach_effect@Cm"])
    assert found["alpha_slope@Cm"].has_shape(found["dynamic_pressure_effect@Cm"])
    assert not found["alpha_slope@Cm"].has_shape(found["pitch_damping@Cm"])
    assert not found["alpha_scale@all"].has_shape(found["alpha_slope@Cm"])
