"""Mappings drafted for tables in the layouts of tools: every channel is right, or asked; none is
wrong in silence. Names and units are those of the tools' own documents; the tables are our own."""

from collections import Counter
from pathlib import Path

import pytest

from aerodb.logs import draft_mapping
from aerodb.storage.readers.tabular import read_tabular
from tests.support.log_tables import (
    T,
    Tool,
    c,
    judged,
    motion,
    number,
    plain,
    stamp,
    units_below,
    write,
)

TOOLS: dict[str, Tool] = {
    "Garmin G1000": Tool(
        (
            *(("Lcl Time", T), ("Latitude", c("latitude", "deg")), ("AltInd", None)),
            *(("AltMSL", c("altitude", "ft")), ("OAT", c("temperature", "degC"))),
            *(("IAS", c("calibrated_airspeed", "knot")), ("GndSpd", None)),
            *(("VSpd", c("velocity_down", "ft/min", -1.0)), ("Pitch", c("theta", "deg"))),
            *(("Roll", c("phi", "deg")), ("LatAc", c("ay_imu", "g"))),
            *(("NormAc", c("az_imu", "g", -1.0)), ("volt1", None), ("E1 OilP", None)),
            *(("TAS", c("V", "knot")), ("HDG", c("psi", "deg"))),
        ),
        lambda names: (
            '#airframe_info, log_version="1.00", airframe_name="Example"\n'
            "#hh:mm:ss, degrees, ft Baro, ft msl, deg C, kt, kt, fpm, deg, deg, G, G, volts, psi,"
            " kt, deg\n" + plain(names, ", ")
        ),
        lambda t, k: stamp(t),
        ", ",
    ),
    "X-Plane Data.txt": Tool(
        (
            *(("_totl,_time", T), ("Vind,_kias", c("calibrated_airspeed", "knot"))),
            *(("Vtrue,_ktas", c("V", "knot")), ("VVI,__fpm", c("velocity_down", "ft/min", -1.0))),
            *(("Gload,norml", c("az_imu", "g", -1.0)), ("Q,rad/s", c("q", "rad/s"))),
            *(("P,rad/s", c("p", "rad/s")), ("R,rad/s", c("r", "rad/s"))),
            *(("pitch,__deg", c("theta", "deg")), ("_roll,__deg", c("phi", "deg"))),
            *(("hding,_true", c("psi", "deg")), ("alpha,__deg", c("alpha", "deg"))),
            *(("_beta,__deg", c("beta", "deg")), ("__lat,__deg", c("latitude", "deg"))),
            *(
                ("__alt,ftmsl", c("altitude", "ft")),
                ("__alt,ftagl", c("height_above_ground", "ft")),
            ),
        ),
        lambda names: "\n " + " | ".join(names) + " | \n",
        number,
        " | ",
        " | ",
    ),
    "JSBSim": Tool(
        (
            *(("Time", T), ("Vtotal (ft/s)", None), ("Q bar (psf)", c("qbar", "psf"))),
            *(("P (deg/s)", c("p", "deg/s")), ("Q (deg/s)", c("q", "deg/s"))),
            *(("R (deg/s)", c("r", "deg/s")), ("Phi (deg)", c("phi", "deg"))),
            *(("Theta (deg)", c("theta", "deg")), ("Psi (deg)", c("psi", "deg"))),
            *(("Alpha (deg)", c("alpha", "deg")), ("Beta (deg)", c("beta", "deg"))),
            *(("Rho (slug/ft^3)", c("rho", "slug/ft^3")), ("Mach", c("mach", "1"))),
            ("Altitude ASL (ft)", c("altitude", "ft")),
        ),
        plain,
        number,
    ),
    "FlightGear": Tool(
        (
            *(("Time", T), ("/velocities/airspeed-kt", c("calibrated_airspeed", "knot"))),
            *(("/orientation/roll-deg", c("phi", "deg")), ("/engines/engine/rpm", None)),
            *(
                ("/orientation/pitch-deg", c("theta", "deg")),
                ("/position/altitude-ft", c("altitude", "ft")),
            ),
            ("/orientation/heading-deg", c("psi", "deg")),
        ),
        plain,
        number,
    ),
    "mavlogdump ATT": Tool(
        (
            *(("timestamp", T), ("TimeUS", T), ("DesRoll", None), ("Roll", c("phi", "deg"))),
            *(("DesPitch", None), ("Pitch", c("theta", "deg")), ("Yaw", c("psi", "deg"))),
            *(("ErrRP", None),),
        ),
        plain,
        lambda t, k: f"{1710253330.0 + t:.4f}" if k == 0 else f"{t * 1e6 + 3e8:.0f}",
    ),
    "ulog2csv airspeed": Tool(
        (
            *(("timestamp", T), ("indicated_airspeed_m_s", c("calibrated_airspeed", "m/s"))),
            ("calibrated_airspeed_m_s", c("calibrated_airspeed", "m/s")),
            *(("true_airspeed_m_s", c("V", "m/s")),),
            ("air_temperature_celsius", c("temperature", "degC")),
            ("confidence", None),
        ),
        plain,
        lambda t, k: f"{t * 1e6 + 1e7:.0f}",
    ),
    "ulog2csv rates": Tool(
        (("timestamp", T), ("xyz[0]", None), ("xyz[1]", None), ("xyz[2]", None)),
        plain,
        lambda t, k: f"{t * 1e6 + 1e7:.0f}",
    ),
    "PlotJuggler": Tool(
        (
            *(("__time", T), ("/imu/angular_velocity/x", c("p", "rad/s"))),
            *(("/imu/angular_velocity/y", c("q", "rad/s", -1.0)),),
            *(("/imu/angular_velocity/z", c("r", "rad/s", -1.0)),),
            *(("/imu/linear_acceleration/x", c("ax_imu", "m/s^2")),),
            ("/imu/linear_acceleration/y", c("ay_imu", "m/s^2", -1.0)),
            ("/imu/linear_acceleration/z", c("az_imu", "m/s^2", -1.0)),
        ),
        plain,
        lambda t, k: f"{1710253330.0 + t:.4f}",
    ),
    "MATLAB writetable": Tool(
        (
            *(("time", T), ("u", None), ("v", None), ("w", None), ("p", c("p", "rad/s"))),
            *(("q", c("q", "rad/s")), ("r", c("r", "rad/s")), ("phi", c("phi", "rad"))),
            *(
                ("theta", c("theta", "rad")),
                ("psi", c("psi", "rad")),
                ("de", c("delta_elevator", "rad")),
            ),
            *(("alpha", c("alpha", "rad")), ("qbar", c("qbar", "Pa"))),
        ),
        plain,
        number,
    ),
    "German measuring system": Tool(
        (
            *(("Zeit [s]", T), ("TAS [kt]", c("V", "knot")), ("alpha [deg]", c("alpha", "deg"))),
            *(("nz [g]", c("az_imu", "g", -1.0)), ("Bat_V", None), ("p [deg/s]", c("p", "deg/s"))),
            ("h_msl [ft]", c("altitude", "ft")),
        ),
        lambda names: "sep=;\n" + plain(names, ";"),
        number,
        ";",
        comma=True,
    ),
    "blackbox_decode": Tool(
        (
            *(
                ("loopIteration", None),
                ("time (us)", T),
                ("axisP[0]", None),
                ("rcCommand[0]", None),
            ),
            *(
                ("gyroADC[0]", None),
                ("gyroADC[1]", None),
                ("accSmooth[2]", None),
                ("motor[0]", None),
            ),
            ("vbatLatest (V)", None),
        ),
        plain,
        lambda t, k: f"{t * 1e6 + 5e6:.0f}",
    ),
    "QGroundControl": Tool(
        (
            *(("Timestamp", T), ("roll", c("phi", "deg")), ("pitch", c("theta", "deg"))),
            *(("heading", c("psi", "deg")), ("rollRate", c("p", "deg/s"))),
            *(("pitchRate", c("q", "deg/s")), ("yawRate", c("r", "deg/s")), ("groundSpeed", None)),
            *(("airSpeed", c("calibrated_airspeed", "m/s")),),
            *(("climbRate", c("velocity_down", "m/s", -1.0)), ("altitudeAMSL", None)),
            *(("batteryVoltage", None), ("throttlePct", None)),
        ),
        plain,
        lambda t, k: f"2024-03-12 {stamp(t)}",
    ),
    "Dynon SkyView": Tool(
        (
            *(
                ("Session Time", T),
                ("Pitch (deg)", c("theta", "deg")),
                ("Roll (deg)", c("phi", "deg")),
            ),
            *(
                ("Magnetic Heading (deg)", None),
                ("Vertical Speed (ft/min)", c("velocity_down", "ft/min", -1.0)),
            ),
            ("Indicated Airspeed (knots)", c("calibrated_airspeed", "knot")),
            *(("True Airspeed (knots)", c("V", "knot")), ("OAT (deg C)", c("temperature", "degC"))),
            *(
                ("Pressure Altitude (ft)", c("pressure_altitude", "ft")),
                ("Oil Pressure (PSI)", None),
                ("Volts 1", None),
            ),
            *(("Wind Speed (knots)", None), ("Angle of Attack (%)", None)),
        ),
        plain,
        number,
    ),
    "Airdata (DJI)": Tool(
        (
            *(("time(millisecond)", T), ("latitude", c("latitude", "deg"))),
            *(("longitude", c("longitude", "deg")), ("height_above_takeoff(feet)", None)),
            *(("speed(mph)", None), ("compass_heading(degrees)", c("psi", "deg"))),
            *(("pitch(degrees)", c("theta", "deg")), ("roll(degrees)", c("phi", "deg"))),
            ("battery_percent", None),
        ),
        plain,
        lambda t, k: f"{t * 1e3:.0f}",
    ),
    "EdgeTX": Tool(
        (
            *(("Time", T), ("1RSS(dB)", None), ("ASpd(kts)", None), ("Alt(m)", None)),
            *(("AccX(g)", c("ax_imu", "g")), ("AccZ(g)", c("az_imu", "g", -1.0)), ("Rud", None)),
            *(("Ele", None), ("Ail", None), ("TxBat(V)", None)),
        ),
        plain,
        lambda t, k: stamp(t),
    ),
    "two-line header": Tool(
        (
            *(("TIME", T), ("VTAS", c("V", "ft/s")), ("ALPHA", c("alpha", "deg"))),
            *(("BETA", c("beta", "deg")), ("P", c("p", "deg/s")), ("NZ", c("az_imu", "g", -1.0))),
            *(("DE", c("delta_elevator", "deg")), ("PS", c("static_pressure", "psf"))),
            ("OAT", c("temperature", "degR")),
        ),
        units_below("sec,ft/sec,deg,deg,deg/sec,G,deg,lbf/ft2,R", "  "),
        number,
        "  ",
    ),
    "rosbag to CSV": Tool(
        (
            *(("rosbagTimestamp", T), ("seq", None), ("angular_velocity.x", c("p", "rad/s"))),
            *(("angular_velocity.y", c("q", "rad/s", -1.0)), ("orientation.x", None)),
            ("linear_acceleration.z", c("az_imu", "m/s^2", -1.0)),
        ),
        plain,
        lambda t, k: f"{1710253330000000000 + round(t * 1e9)}",
    ),
    "Litchi": Tool(
        (
            *(("latitude", c("latitude", "deg")), ("longitude", c("longitude", "deg"))),
            *(("altitude(feet)", None), ("speed(mph)", None), ("time(millisecond)", T)),
            *(("pressure(Pa)", None), ("temperature(F)", None), ("home_latitude", None)),
            *(("velocityX(mps)", c("velocity_north", "m/s")), ("gimbalPitch(raw)", None)),
            *(("velocityZ(mps)", c("velocity_down", "m/s")), ("pitch(deg)", c("theta", "deg"))),
            *(("roll(deg)", c("phi", "deg")), ("yaw(deg)", c("psi", "deg")), ("yawRaw", None)),
        ),
        plain,
        lambda t, k: f"{t * 1e3:.0f}",
    ),
    "Litchi, raw": Tool(
        (
            *(("time(millisecond)", T), ("pitch(raw)", None), ("roll(raw)", None)),
            *(("yaw(raw)", None), ("latitude", c("latitude", "deg")), ("altitude(m)", None)),
        ),
        plain,
        lambda t, k: f"{t * 1e3:.0f}",
    ),
    "DJI flight record": Tool(
        (
            *(("CUSTOM.updateTime [local]", T), ("OSD.flyState", None)),
            *(("OSD.latitude", c("latitude", "deg")), ("OSD.longitude", c("longitude", "deg"))),
            *(("OSD.height [ft]", None), ("OSD.altitude [ft]", c("altitude", "ft"))),
            *(("OSD.xSpeed [MPH]", c("velocity_north", "mile/hour")), ("HOME.latitude", None)),
            *(("OSD.zSpeed [MPH]", c("velocity_down", "mile/hour")), ("GIMBAL.pitch", None)),
            *(("OSD.pitch", c("theta", "deg")), ("OSD.roll", c("phi", "deg")), ("RC.rudder", None)),
            *(("OSD.yaw", c("psi", "deg")), ("BATTERY.temperature [F]", None)),
            *(("APPGPS.latitude", None), ("WEATHER.windSpeed [MPH]", None), ("OSD.isFlying", None)),
        ),
        plain,
        lambda t, k: f"2:{int(t) // 60:02d}:{t % 60:06.3f} PM",
    ),
    "DatCon": Tool(
        (
            *(("offsetTime", T), ("IMU_ATTI(0):accelX", c("ax_imu", "g")), ("RC:Aileron", None)),
            *(("IMU_ATTI(0):accelZ", c("az_imu", "g")), ("IMU_ATTI(0):gyroX", c("p", "deg/s"))),
            *(("IMU_ATTI(0):roll:C", c("phi", "deg")), ("IMU_ATTI(0):magYaw:C", None)),
            *(("GPS(0):heightMSL", c("altitude", "m")), ("General:absoluteHeight:C", None)),
        ),
        plain,
        number,
    ),
    "Yuneec": Tool(
        (
            *(("", T), ("fsk_rssi", None), ("altitude", None), ("roll", c("phi", "deg"))),
            *(("latitude", c("latitude", "deg")), ("tas", None), ("pitch", c("theta", "deg"))),
        ),
        plain,
        lambda t, k: "20240312 " + stamp(t, ":"),
    ),
    "iNav or MAVLink in whole numbers": Tool(
        (
            *(("time_boot_ms", T), ("lat", c("latitude", "deg")), ("lon", c("longitude", "deg"))),
            *(("vx", None), ("hdg", None), ("relative_alt", None), ("nav_roll", None)),
        ),
        plain,
        lambda t, k: f"{t * 1e3 + 20000:.0f}",
        whole=True,
    ),
    "OnSpeed": Tool(
        (
            *(("timeStamp", T), ("Pfwd", None), ("PfwdSmoothed", None), ("P45", None)),
            *(("PStatic", c("static_pressure", "mbar")), ("Palt", c("pressure_altitude", "ft"))),
            *(("IAS", c("calibrated_airspeed", "knot")), ("AngleofAttack", c("alpha", "deg"))),
            *(("flapsPos", None), ("DataMark", None), ("OAT", c("temperature", "degC"))),
            *(("TAS", c("V", "knot")), ("imuTemp", None), ("VerticalG", c("az_imu", "g", -1.0))),
            *(("LateralG", c("ay_imu", "g")), ("ForwardG", c("ax_imu", "g"))),
            *(("RollRate", c("p", "deg/s")), ("PitchRate", c("q", "deg/s"))),
            *(("YawRate", c("r", "deg/s")), ("Pitch", c("theta", "deg"))),
            *(("Roll", c("phi", "deg")), ("FlightPath", None)),
            *(("VSI", c("velocity_down", "ft/min", -1.0)), ("Altitude", c("altitude", "ft"))),
            *(("DerivedAOA", None), ("CoeffP", None)),
        ),
        plain,
        lambda t, k: f"{t * 1000:.0f}",
    ),
    "Piccolo": Tool(
        (
            *(("<Clock>[ms]", T), ("<Lat>[rad]", c("latitude", "rad"))),
            *(("<Lon>[rad]", c("longitude", "rad")), ("<Height>[m]", c("altitude", "m"))),
            *(
                ("<VNorth>[m/s]", c("velocity_north", "m/s")),
                ("<VEast>[m/s]", c("velocity_east", "m/s")),
            ),
            *(
                ("<VDown>[m/s]", c("velocity_down", "m/s")),
                ("<Static>[Pa]", c("static_pressure", "Pa")),
            ),
            *(("<Dynamic>[Pa]", c("qbar", "Pa")), ("<TAS>[m/s]", c("V", "m/s"))),
            *(("<P>[rad/s]", c("p", "rad/s")), ("<Q>[rad/s]", c("q", "rad/s"))),
            *(("<R>[rad/s]", c("r", "rad/s")), ("<Roll>[rad]", c("phi", "rad"))),
            *(("<Pitch>[rad]", c("theta", "rad")), ("<Yaw>[rad]", c("psi", "rad"))),
            *(("<Xaccel>[m/s/s]", c("ax_imu", "m/s^2")), ("<Zaccel>[m/s/s]", c("az_imu", "m/s^2"))),
        ),
        lambda names: plain(names, " "),
        lambda t, k: f"{t * 1000:.0f}",
        " ",
    ),
    "VectorNav": Tool(
        (
            *(("TimeStartup", T), ("Yaw", c("psi", "deg")), ("Pitch", c("theta", "deg"))),
            *(("Roll", c("phi", "deg")), ("AngularRateX", c("p", "rad/s"))),
            *(("AngularRateY", c("q", "rad/s")), ("AngularRateZ", c("r", "rad/s"))),
            *(("AccelX", c("ax_imu", "m/s^2")), ("AccelY", c("ay_imu", "m/s^2"))),
            *(("AccelZ", c("az_imu", "m/s^2")), ("MagX", None), ("Temp", None)),
        ),
        plain,
        lambda t, k: f"{t * 1e9:.0f}",
    ),
    "NovAtel INSPVA": Tool(
        (
            *(("Week", None), ("Seconds", T), ("Latitude", c("latitude", "deg"))),
            *(("Longitude", c("longitude", "deg")), ("Height", c("altitude", "m"))),
            *(
                ("North Velocity", c("velocity_north", "m/s")),
                ("East Velocity", c("velocity_east", "m/s")),
            ),
            *(("Up Velocity", c("velocity_down", "m/s", -1.0)), ("Roll", c("phi", "deg"))),
            *(("Pitch", c("theta", "deg")), ("Azimuth", c("psi", "deg"))),
        ),
        plain,
        lambda t, k: f"{381200 + t:.3f}",
    ),
    "Sensor Logger": Tool(
        (
            *(("time", T), ("seconds_elapsed", None), ("roll", c("phi", "rad"))),
            *(("pitch", c("theta", "rad")), ("yaw", c("psi", "rad")), ("qw", None)),
        ),
        plain,
        lambda t, k: f"{1.71e18 + t * 1e9:.0f}",
    ),
    "phyphox": Tool(
        (
            *(('"Time (s)"', T), ('"Linear Acceleration x (m/s^2)"', None)),
            *(
                ('"Acceleration x (m/s^2)"', c("ax_imu", "m/s^2")),
                ('"Gyroscope x (rad/s)"', c("p", "rad/s")),
            ),
        ),
        plain,
        number,
    ),
    "Stratux": Tool(
        (
            *(("Timestamp", T), ("Pitch", c("theta", "deg")), ("Roll", c("phi", "deg"))),
            *(("Heading", c("psi", "deg")), ("GLoad", c("az_imu", "g", -1.0)), ("SlipSkid", None)),
            *(("PressureAlt", c("pressure_altitude", "ft")), ("TurnRate", None)),
        ),
        plain,
        lambda t, k: f"2024-03-12T{stamp(t)}Z",
    ),
    "Paparazzi": Tool(
        (
            *(("Time", T), ("ATTITUDE.phi", c("phi", "rad")), ("ATTITUDE.psi", c("psi", "rad"))),
            *(("ATTITUDE.theta", c("theta", "rad")), ("AIRSPEED.airspeed", None)),
            *(
                ("DESIRED.roll", None),
                ("IMU_GYRO.gp", c("p", "rad/s")),
                ("IMU_GYRO.gq", c("q", "rad/s")),
            ),
        ),
        plain,
        number,
    ),
    "ForeFlight": Tool(
        (
            *(
                ("Timestamp", T),
                ("Latitude", c("latitude", "deg")),
                ("Longitude", c("longitude", "deg")),
            ),
            *(("Altitude", c("altitude", "ft")), ("Course", None), ("Speed", None)),
            *(("Bank", c("phi", "deg")), ("Pitch", c("theta", "deg")), ("Horizontal Error", None)),
        ),
        lambda names: "Pilot,Tail Number,Derived Origin\nA. Nother,N000,EXPL\n" + plain(names),
        lambda t, k: f"{1710253330000 + t * 1000:.0f}",
    ),
    "airline recorder": Tool(
        (
            *(
                ("TIME", T),
                ("CAS_KTS", c("calibrated_airspeed", "knot")),
                ("TAS_KTS", c("V", "knot")),
            ),
            *(("ALT_STD_FT", c("pressure_altitude", "ft")), ("PITCH_DEG", c("theta", "deg"))),
            *(("ROLL_DEG", c("phi", "deg")), ("AOA_L_DEG", c("alpha", "deg"))),
            *(("VRTG_G", c("az_imu", "g", -1.0)), ("LONG_G", c("ax_imu", "g"))),
            *(("ELEV_L_DEG", None), ("N11_PCT", None), ("SAT_C", c("temperature", "degC"))),
            *(("MACH", c("mach", "1")), ("TRK_DEG", None), ("WIND_SPD_KTS", None)),
        ),
        plain,
        number,
    ),
    "Dewesoft": Tool(
        (
            *(("Time [s]", T), ("TAS [km/h]", c("V", "km/h")), ("AoA [°]", c("alpha", "deg"))),
            *(("AoS [°]", c("beta", "deg")), ("Gyro X [°/s]", c("p", "deg/s"))),
            *(("Gyro Y [°/s]", c("q", "deg/s")), ("p_stat [hPa]", c("static_pressure", "hPa"))),
            *(("q_c [hPa]", c("qbar", "hPa")), ("Elevator [°]", c("delta_elevator", "deg"))),
        ),
        lambda names: "Data file: flight.dxd\nSample rate: 50 Hz\n\n" + plain(names, "\t"),
        number,
        "\t",
        comma=True,
    ),
    "LabVIEW": Tool(
        (
            *(("X_Value", T), ("alpha (deg)", c("alpha", "deg")), ("q (deg/s)", c("q", "deg/s"))),
            ("elevator (deg)", c("delta_elevator", "deg")),
        ),
        lambda names: (
            "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
            "***End_of_Header***\t\n\nChannels\t3\t\nX_Dimension\tTime\tTime\tTime\n"
            "***End_of_Header***\t\n" + plain(names, "\t")
        ),
        number,
        "\t",
    ),
    "XCSoar": Tool(
        (
            *(
                ("Time", T),
                ("Latitude [deg]", c("latitude", "deg")),
                ("Longitude [deg]", c("longitude", "deg")),
            ),
            *(
                ("GPS Alt [m]", c("altitude", "m")),
                ("IAS [km/h]", c("calibrated_airspeed", "km/h")),
            ),
            *(("TAS [km/h]", c("V", "km/h")), ("Vario [m/s]", None), ("MC", None)),
        ),
        lambda names: plain(names, ";"),
        lambda t, k: stamp(t),
        ";",
    ),
    "Simulink signals": Tool(
        (
            *(("time", T), ("aircraft.states.phi_rad", c("phi", "rad"))),
            *(
                ("aircraft.states.theta_rad", c("theta", "rad")),
                ("aircraft.air.TAS_mps", c("V", "m/s")),
            ),
            *(
                ("aircraft.air.alpha_rad", c("alpha", "rad")),
                ("aircraft.states.p_radps", c("p", "rad/s")),
            ),
            *(("cmd.phi_rad", None), ("actuators.elevator_deg", c("delta_elevator", "deg"))),
        ),
        plain,
        number,
    ),
}
#: Tables of each tool, of other flights and rates.
EACH = 6


@pytest.mark.parametrize("name", TOOLS)
def test_channels_of_a_tool_are_right_or_asked(tmp_path: Path, name: str) -> None:
    total: Counter[str] = Counter()
    for seed in range(EACH):
        truth = motion(seed, (10.0, 20.0, 25.0, 40.0, 50.0, 100.0)[seed])
        path = tmp_path / f"table{seed}.{'txt' if name.startswith(('X', 'two')) else 'csv'}"
        write(path, TOOLS[name], truth, seed)
        total += judged(path, TOOLS[name], truth)
    print(f"{name}: {dict(total)}")
    assert total["right"] >= EACH  # at least the clock


def test_at_least_a_hundred_tables_of_fifteen_tools() -> None:
    assert len(TOOLS) >= 15
    assert len(TOOLS) * EACH >= 100


def test_ticks_of_an_unknown_size_are_asked(tmp_path: Path) -> None:
    """Xsens counts 0.1 ms: no unit of a clock, and none is taken in silence."""
    tool = Tool(
        (("SampleTimeFine", T), ("Roll", c("phi", "deg"))), plain, lambda t, k: f"{t * 1e4:.0f}"
    )
    write(tmp_path / "a.csv", tool, motion(1, 50.0), 1)
    draft = draft_mapping(read_tabular(tmp_path / "a.csv"), "own")
    assert draft.clock is None or draft.clock.open
    assert any("time" in question.lower() for question in draft.questions)
