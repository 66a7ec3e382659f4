"""Mappings drafted for tables that mix names, units, clocks and layouts of tools by a seed: every
channel is right or asked; none is wrong in silence, and few are left unnamed."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aerodb.logs import draft_mapping
from aerodb.storage.readers.tabular import read_tabular
from tests.support.command import asked
from tests.support.log_tables import Meaning, T, Tool, judged, motion, stamp, write

#: Channel -> names in English, of test centres, in German and in French; a dash in front of a name:
#: it counts against the channel.
NAMES: dict[str, tuple[str, str, str, str]] = {
    "V": (
        "true_airspeed TAS TrueAirspeed",
        "VT VTAS TAS",
        "wahre_Fluggeschwindigkeit TAS",
        "Vv TAS",
    ),
    "calibrated_airspeed": ("IAS CAS indicatedAirspeed", "CAS VC KCAS", "IAS VCAS", "Vi VC"),
    "alpha": ("alpha AoA angle_of_attack", "ALPHA AOA ALPHA_TRUE", "Anstellwinkel", "incidence"),
    "beta": ("beta sideslip AoS", "BETA AOSS SIDESLIP", "Schiebewinkel", "dérapage derapage"),
    "phi": ("roll roll_angle bank", "PHI ROLL PHI_INS", "Rollwinkel Hängewinkel", "roulis gite"),
    "theta": ("pitch pitch_angle", "THETA PITCH", "Nickwinkel Längsneigung", "tangage assiette"),
    "psi": ("yaw true_heading", "PSI HDG_TRUE", "Gierwinkel", "lacet cap_vrai"),
    "p": (
        "p rollRate gyro_x",
        "P PB P_RATE ROLL_RATE",
        "Rollrate Rollgeschwindigkeit",
        "vitesse_roulis p",
    ),
    "q": ("q pitchRate gyro_y", "Q QB Q_RATE", "Nickrate", "vitesse_tangage q"),
    "r": ("r yawRate gyro_z", "R RB R_RATE", "Gierrate Giergeschwindigkeit", "vitesse_lacet r"),
    "ax_imu": ("ax accel_x", "NX AX", "Längsbeschleunigung nx", "Nx facteur_charge_x"),
    "ay_imu": ("ay accel_y", "NY AY", "Querbeschleunigung ny", "Ny facteur_charge_y"),
    "az_imu": (
        "-nz accel_z -g_load",
        "-NZ -NZ_CG AZ",
        "-Lastvielfaches -nz",
        "-Nz -facteur_charge",
    ),
    "altitude": ("altitude_msl alt_msl", "ALT_MSL H_MSL", "Höhe_MSL", "altitude_msl"),
    "height_above_ground": (
        "agl height_above_ground",
        "AGL H_AGL",
        "Höhe_über_Grund",
        "hauteur_sol",
    ),
    "velocity_down": (
        "-vspeed -climb_rate vel_d sink_rate",
        "-ROC -VVI",
        "-Steiggeschwindigkeit Sinkgeschwindigkeit",
        "-vitesse_verticale -vario",
    ),
    "velocity_north": ("vel_n v_north", "VNORTH VN", "v_Nord", "vitesse_nord"),
    "velocity_east": ("vel_e v_east", "VEAST VE", "v_Ost", "vitesse_est"),
    "latitude": ("latitude lat", "LATITUDE LAT", "Breite Breitengrad", "latitude"),
    "longitude": ("longitude lon lng", "LONGITUDE LON", "Länge Längengrad", "longitude"),
    "temperature": (
        "oat outside_air_temperature",
        "OAT SAT",
        "Außentemperatur",
        "température_extérieure",
    ),
    "static_pressure": (
        "static_pressure p_static",
        "PS PSTATIC",
        "statischer_Druck",
        "pression_statique",
    ),
    "qbar": ("qbar dynamic_pressure", "QDYN QBAR", "Staudruck", "pression_dynamique"),
    "rho": ("rho air_density", "RHO", "Luftdichte", "masse_volumique"),
    "mach": ("mach mach_number", "MACH", "Machzahl", "mach nombre_de_mach"),
    "delta_elevator": (
        "elevator delta_e de",
        "DE DELE ELEV",
        "Höhenruder",
        "profondeur gouverne_profondeur",
    ),
    "delta_aileron": ("aileron delta_a da", "DA DAIL", "Querruder", "aileron ailerons"),
    "delta_rudder": (
        "rudder delta_r dr",
        "DR DRUD",
        "Seitenruder",
        "gouverne_direction gouverne_de_direction",
    ),
}
#: The same in Spanish and in Italian, with underscores for blanks.
ROMANCE: dict[str, tuple[str, str]] = {
    "V": ("velocidad_verdadera TAS", "velocità_vera TAS"),
    "calibrated_airspeed": ("velocidad_indicada IAS", "velocità_indicata IAS"),
    "alpha": ("ángulo_de_ataque", "angolo_di_attacco incidenza"),
    "beta": ("resbalamiento derrape", "angolo_di_derapata derapata"),
    "phi": ("alabeo ángulo_de_balanceo", "rollio angolo_di_rollio"),
    "theta": ("cabeceo ángulo_de_cabeceo", "beccheggio assetto"),
    "psi": ("guiñada", "imbardata angolo_di_imbardata"),
    "p": ("velocidad_de_alabeo tasa_de_balanceo", "velocità_di_rollio rateo_di_rollio"),
    "q": ("velocidad_angular_de_cabeceo", "velocità_di_beccheggio"),
    "r": ("velocidad_de_guiñada", "velocità_di_imbardata rateo_di_imbardata"),
    "ax_imu": ("aceleración_longitudinal", "accelerazione_longitudinale"),
    "ay_imu": ("aceleración_lateral", "accelerazione_laterale"),
    "az_imu": ("-factor_de_carga", "-fattore_di_carico -accelerazione_normale"),
    "altitude": ("altitud", "quota altitudine"),
    "height_above_ground": ("altura_sobre_el_suelo", "altezza_sul_suolo"),
    "velocity_down": ("-velocidad_vertical -variómetro", "-velocità_verticale -rateo_di_salita"),
    "velocity_north": ("velocidad_norte", "velocità_nord"),
    "velocity_east": ("velocidad_este", "velocità_est"),
    "latitude": ("latitud", "latitudine"),
    "longitude": ("longitud", "longitudine"),
    "temperature": ("temperatura_exterior", "temperatura_esterna"),
    "static_pressure": ("presión_estática", "pressione_statica"),
    "qbar": ("presión_dinámica", "pressione_dinamica"),
    "rho": ("densidad_del_aire", "densità_aria"),
    "mach": ("número_de_mach mach", "numero_di_mach mach"),
    "delta_elevator": ("timón_de_profundidad elevador", "equilibratore"),
    "delta_aileron": ("alerones alerón", "alettoni alettone"),
    "delta_rudder": ("timón_de_dirección", "timone timone_di_direzione"),
}
#: Languages of the names.
LANGUAGES = 6
#: SI unit of channels -> the unit and how tools write it.
ANGLES = "deg:deg rad:rad deg:° deg:Grad deg:degrees"
RATES = "deg/s:deg/s rad/s:rad/s deg/s:dps deg/s:°/s deg/s:deg/sec"
SPEEDS = "m/s:m/s knot:kt knot:kts ft/s:ft/s km/h:km/h m/s:mps"
UNITS: dict[str, str] = {
    **dict.fromkeys(("alpha", "beta", "phi", "theta", "psi"), ANGLES + " cdeg:cdeg mrad:mrad"),
    **dict.fromkeys(("delta_elevator", "delta_aileron", "delta_rudder"), ANGLES),
    **dict.fromkeys(("latitude", "longitude"), "deg:deg deg:° rad:rad"),
    **dict.fromkeys(("p", "q", "r"), RATES + " mrad/s:mrad/s cdeg/s:cdeg/s"),
    **dict.fromkeys(("V", "calibrated_airspeed", "velocity_north", "velocity_east"), SPEEDS),
    "velocity_down": "m/s:m/s ft/min:fpm ft/min:ft/min cm/s:cm/s",
    **dict.fromkeys(("ax_imu", "ay_imu", "az_imu"), "m/s^2:m/s² g:g g:G m/s^2:m/s^2 ft/s^2:ft/s2"),
    **dict.fromkeys(("altitude", "height_above_ground"), "m:m ft:ft ft:feet mm:mm cm:cm"),
    "temperature": "degC:°C K:K degF:°F degC:degC",
    "static_pressure": "Pa:Pa hPa:hPa mbar:mbar inHg:inHg psf:psf psi:psi",
    "qbar": "Pa:Pa hPa:hPa psf:psf psf:lbf/ft2 kPa:kPa",
    "rho": "kg/m^3:kg/m3 slug/ft^3:slug/ft3",
    "mach": "1:-",
}
#: Columns that are no channel beside which a wrong guess is near.
OTHERS = [
    "target_roll",
    "DesPitch",
    "cmd_elevator",
    "roll_cmd",
    "home_alt",
    "HOME.latitude",
    "GIMBAL.pitch",
    "RC.aileron",
    "Bat_V",
    "oil_temperature",
    "fuel_p",
    "wind_speed",
    "WndDir",
    "nav_pitch",
    "pid_r",
    "engine_temp",
    "cabin_alt",
    "GndSpd",
    "ground_speed",
    "course",
    "track_angle",
    "mag_x",
    "magnetometer_y",
    "cpu_temp",
    "rpm",
    "rssi",
    "roll_trim",
    "elevator_trim",
    "stick_pitch",
    "alpha_limit",
    "airspeed_error",
    "airspeed_sp",
    "theta_ref",
    "altitude_setpoint",
    "PHI_CMD",
    "Q_TARGET",
    "Soll_Rollwinkel",
    "Rollwinkel_soll",
    "Nickwinkel_Sollwert",
    "consigne_roulis",
    "Windgeschwindigkeit",
    "vitesse_vent",
    "vitesse_sol",
    "Geschwindigkeit_über_Grund",
    "Motortemperatur",
    "Öltemperatur",
    "température_huile",
    "roll_rate_setpoint",
    "yaw_sp",
    "battery_temperature",
    "prop_pitch",
    "mission_item",
    "gps_hdop",
    "vibe_x",
    "servo1",
    "baro_temp",
    "roll_std",
    "phi_sigma",
    "alpha_dot",
    "pdot",
    "q_dot",
    "TAT",
    "Tt2",
    "/autopilot/settings/pitch-deg",
    "/controls/flight/rudder-trim",
    "vehicle_attitude_setpoint.roll",
    "QFE",
    "QNH",
    "pitch_mode",
    "heading_bug",
    "v_ground",
    "vz_cmd",
    "alt_home",
    "alpha_max",
    "stall_speed",
    "V_NE",
    "accel_bias_z",
    "/engines/engine[0]/oil-temperature-degf",
    "Attitude_target.pitch",
    "tailwind",
    "velocidad_del_viento",
    "velocidad_respecto_al_suelo",
    "alabeo_deseado",
    "temperatura_aceite",
    "velocità_al_suolo",
    "rollio_comandato",
    "temperatura_motore",
    "APPGPS.latitude",
    "WEATHER.windSpeed",
    "voltage",
    "current",
]
SEPARATORS = (",", ";", "\t", " | ", ", ")
STYLES = ("bracket", "parenthesis", "ending", "row", "none", "comma", "slash", "braces")


def clocks(rng: np.random.Generator) -> tuple[str, Callable[[float, int], str]]:
    """A clock as a tool writes it: the name of its column, and seconds to its text."""
    start = float(rng.uniform(0.0, 900.0))
    kinds: list[tuple[str, Callable[[float, int], str]]] = [
        ("time", lambda t, k: f"{t:.4f}"),
        ("Time [s]", lambda t, k: f"{start + t:.4f}"),
        ("Zeit [s]", lambda t, k: f"{t:.4f}"),
        ("temps (s)", lambda t, k: f"{t:.4f}"),
        ("TIME_SEC", lambda t, k: f"{start + t:.4f}"),
        ("timestamp", lambda t, k: f"{1e6 * (start + t):.0f}"),
        ("time_boot_ms", lambda t, k: f"{1e3 * (start + t):.0f}"),
        ("time(millisecond)", lambda t, k: f"{1e3 * t:.0f}"),
        ("epoch_ms", lambda t, k: f"{1.7102533e12 + 1e3 * t:.0f}"),
        ("unix_time", lambda t, k: f"{1.7102533e9 + t:.4f}"),
        ("UTC", lambda t, k: f"2024-03-12T{stamp(t)}Z"),
        ("Datum", lambda t, k: f"12.03.2024 {stamp(t)}"),
        ("Tiempo [s]", lambda t, k: f"{t:.4f}"),
        ("Hora", lambda t, k: stamp(t)),
        ("data_ora", lambda t, k: f"2024-03-12 {stamp(t)}"),
        ("Uhrzeit", lambda t, k: stamp(t)),
        ("Lcl Time", lambda t, k: stamp(t)),
        ("Date_Time", lambda t, k: f"{45363.5 + t / 86400.0:.10f}"),
        ("X_Value", lambda t, k: f"{t:.6f}"),
        ("Clock:offsetTime", lambda t, k: f"{t - 4.0:.4f}"),
        ("OSD.flyTime [s]", lambda t, k: f"{t:.3f}"),
        ("IRIG_TIME", lambda t, k: f"072:{stamp(t)}"),
        ("elapsed (s)", lambda t, k: f"{t:.3f}"),
    ]
    return kinds[int(rng.integers(len(kinds)))]


def header(name: str, written: str, style: str) -> str:
    if style == "ending":
        short = {"°": "deg", "°/s": "degs", "m/s²": "mps2", "m/s^2": "mps2", "°C": "degC"}
        short |= {"deg/s": "dps", "rad/s": "rads", "m/s": "mps", "km/h": "kmh", "ft/s": "fps"}
        return f"{name}_{short.get(written, written).replace('/', '_')}" if written != "-" else name
    forms = {"bracket": "{} [{}]", "parenthesis": "{} ({})", "comma": "{},_{}", "slash": "{} / {}"}
    forms["braces"] = "{} {{{}}}"
    return forms.get(style, "{}").format(name, written)


def table(seed: int) -> Tool:
    """The table of a seed."""
    rng = np.random.default_rng(1000 + seed)
    language = seed % LANGUAGES
    style = STYLES[int(rng.integers(len(STYLES)))]
    sep = SEPARATORS[int(rng.integers(len(SEPARATORS)))]
    if style == "comma" and "," in sep:
        sep = ";"
    columns: list[tuple[str, Meaning]] = []
    row = []
    for known in rng.permutation(list(NAMES))[: int(rng.integers(8, 22))]:
        name = str(rng.choice((NAMES[known] + ROMANCE[known])[language].split()))
        sign = -1.0 if name.startswith("-") else 1.0
        stated = UNITS[known].split()[: 2 if style == "none" else None]
        unit, written = str(rng.choice(stated)).split(":")
        columns.append((header(name.strip("-"), written, style), (str(known), unit, sign)))
        row.append(written)
    for name in rng.choice(OTHERS, int(rng.integers(4, 10)), replace=False):
        place = int(rng.integers(len(columns) + 1))
        columns.insert(place, (str(name), None))
        row.insert(place, "-")
    clock, written_as = clocks(rng)
    place = 0 if rng.random() < 0.7 else int(rng.integers(len(columns) + 1))
    columns.insert(place, (clock, T))
    row.insert(place, "-")
    below = sep.join(row) + "\n" if style == "row" else ""
    comma = sep == ";" and bool(rng.random() < 0.5)
    first = "sep=;\n" if comma else ""

    def head(names: list[str]) -> str:
        return first + sep.join(names) + "\n" + below

    return Tool(tuple(columns), head, written_as, sep, comma=comma)


@pytest.mark.parametrize("number", range(100))
def test_channels_of_mixed_tables_are_right_or_asked(tmp_path: Path, number: int) -> None:
    seed, tool = number, table(number)
    truth = motion(seed, float(np.random.default_rng(seed).choice([10.0, 20.0, 25.0, 50.0])))
    path = tmp_path / ("table.txt" if seed % 3 == 0 else "table.csv")
    write(path, tool, truth, seed)
    found = judged(path, tool, truth)
    assert found["right"] > 0.5 * found.total(), found
    assert found["listed as not mapped"] <= 2, found


def test_a_mixed_table_by_command(tmp_path: Path) -> None:
    tool = table(1)
    write(tmp_path / "a.csv", tool, motion(1, 20.0), 1)
    document = asked(
        tmp_path / "w",
        "mapping",
        "init",
        str(tmp_path / "a.csv"),
        "--output",
        str(tmp_path / "m.toml"),
    )
    drafted = draft_mapping(read_tabular(tmp_path / "a.csv"), "own").guesses
    said = {(guess["channel"], guess["field"], guess["unit"]) for guess in document["guesses"]}
    assert said == {(guess.channel, guess.field, guess.unit) for guess in drafted}


def drafted(path: Path, **columns: list[str]) -> dict[str, tuple[str, str]]:
    """Channel -> field and confidence."""
    rows = zip(*columns.values(), strict=True)
    path.write_text("\n".join(map(",".join, [tuple(columns), *rows])) + "\n", encoding="utf-8")
    guesses = draft_mapping(read_tabular(path), "own").guesses
    return {guess.channel: (guess.field, guess.confidence) for guess in guesses}


def test_a_gauge_named_after_the_angle_of_attack_is_asked(tmp_path: Path) -> None:
    gauge = [f"{50.0 + 9.0 * np.sin(0.1 * k):.1f}" for k in range(60)]  # per cent of the stall
    assert drafted(tmp_path / "a.csv", time=TIME, AOA=gauge) == {"alpha": ("AOA", "asked")}


@pytest.mark.parametrize("name", ["altitude [ft]", "temperature [degF]"])
def test_a_name_of_ours_does_not_say_which_height_or_air_is_meant(
    tmp_path: Path, name: str
) -> None:
    table = {"time": TIME, name: [f"{each:.1f}" for each in np.linspace(60.0, 90.0, 60)]}
    ((field, confidence),) = drafted(tmp_path / "a.csv", **table).values()
    assert (field, confidence) == (name.split()[0], "asked")


TIME = [f"{0.05 * k:.2f}" for k in range(60)]
SWING = [f"{9.0 * np.sin(0.1 * k):.4f}" for k in range(60)]


@pytest.mark.parametrize("path", ["HOME", "GIMBAL", "vehicle_attitude_setpoint", "Target"])
def test_a_name_on_the_path_of_another_thing_is_asked(tmp_path: Path, path: str) -> None:
    columns = {"time": TIME, f"{path}.roll [deg]": SWING}
    assert drafted(tmp_path / "a.csv", **columns)["phi"] == (f"{path}.roll", "asked")
    measured = {**columns, "OSD.roll [deg]": SWING[::-1]}
    assert drafted(tmp_path / "b.csv", **measured)["phi"] == ("OSD.roll", "sure")


@pytest.mark.parametrize("name", ["roll", "theta", "yawRate"])
def test_degrees_that_no_flight_has_are_asked(tmp_path: Path, name: str) -> None:
    many = [f"{100.0 * float(each):.1f}" for each in SWING]  # hundredths of a degree
    (found,) = drafted(tmp_path / "a.csv", time=TIME, **{name: many}).values()
    assert found == (name, "asked")


def test_a_unit_that_makes_a_clock_too_fast_is_asked(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    days = [f"{45363.5 + 0.05 * k / 86400.0:.9f}" for k in range(60)]
    drafted(path, **{"time [s]": days, "roll [deg]": SWING})
    clock = draft_mapping(read_tabular(path), "own").clock
    assert clock is not None
    assert clock.open.startswith("is time in s? Its steps would be")


def test_a_row_of_units_with_dashes_is_no_sample(tmp_path: Path) -> None:
    others = {name: ["-", *SWING] for name in ("a1", "b1", "c1", "d1")}
    path = tmp_path / "a.csv"
    found = drafted(path, time=["s", *TIME], roll=["deg", *SWING], **others)
    assert found == {"phi": ("roll", "sure")}
    assert read_tabular(path).topics["table"].time.size == len(TIME)


def test_specific_force_of_a_stranger_is_that_of_its_accelerometer(tmp_path: Path) -> None:
    load = [f"{1.0 + 0.01 * float(each):.4f}" for each in SWING]
    path = tmp_path / "a.csv"
    drafted(path, time=TIME, **{"az [g]": load})
    (guess,) = draft_mapping(read_tabular(path), "own").guesses
    assert (guess.channel, guess.scale) == ("az_imu", -1.0)  # positive upwards by its values


def test_greek_letters_are_channels_and_a_dot_is_a_derivative(tmp_path: Path) -> None:
    columns = {"time": TIME, "α [°]": SWING, "φ/deg": SWING[::-1], "δe [°]": SWING, "ṗ": SWING}
    found = drafted(tmp_path / "a.csv", **columns)
    sure = {channel: (field, "sure") for channel, field in (("alpha", "α"), ("phi", "φ"))}
    assert found == {**sure, "delta_elevator": ("δe", "sure")}


@pytest.mark.parametrize("name", ["RTC", "Datenaufzeichnung", "TOW [s]"])
def test_a_column_of_times_under_another_name_is_the_clock_and_asked(
    tmp_path: Path, name: str
) -> None:
    times = TIME if "[s]" in name else [f"12.03.2024 14:22:{10 + float(t):06.3f}" for t in TIME]
    drafted(tmp_path / "a.csv", **{name: times, "n": list(map(str, range(60))), "roll": SWING})
    clock = draft_mapping(read_tabular(tmp_path / "a.csv"), "own").clock
    assert clock is not None
    assert (clock.field, clock.unit, clock.confidence) == (name.split()[0], "s", "asked")


def test_a_clock_of_whole_seconds_is_said_to_repeat(tmp_path: Path) -> None:
    drafted(tmp_path / "a.csv", time=[f"14:22:{10 + k // 20}" for k in range(60)], roll=SWING)
    draft = draft_mapping(read_tabular(tmp_path / "a.csv"), "own")
    assert draft.clock is None
    assert draft.questions[0].startswith("time repeats")
