"""Mappings drafted for tables in the layouts of more tools: every channel is right or asked, none is
wrong in silence. Names and units are those of the tools' own documents; the tables are our own."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.log_tables import (
    Meaning,
    T,
    Tool,
    c,
    judged,
    motion,
    number,
    plain,
    stamp,
    write,
)

#: Columns in their order, between bars: a name, and behind = the channel with its unit, with a minus
#: where the column counts the other way.
COLUMNS = {
    "DASHlink (NASA)": """
        TIME = time | ALT = pressure_altitude ft | CAS = calibrated_airspeed knot | TAS = V knot
        MACH = mach 1 | AOAC = alpha deg | PTCH = theta deg | ROLL = phi deg | TH = psi deg | MH
        DA | LONG = ax_imu g | LATG = ay_imu g | VRTG = -az_imu g | LATP = latitude deg
        LONP = longitude deg | SAT = temperature degC | TAT | PSA = static_pressure inHg | PI
        ALTR = -velocity_down ft/min | RALT = height_above_ground ft | ELEV_1 = delta_elevator deg
        AIL_1 = delta_aileron deg | RUDD = delta_rudder deg | GS | WS | WD | PH
        IVV = -velocity_down ft/min | BLAC | CTAC
    """,
    "NESC check case": """
        time = time | gePosition_ft_X | feVelocity_ft_s_X = velocity_north ft/s
        feVelocity_ft_s_Y = velocity_east ft/s | feVelocity_ft_s_Z = velocity_down ft/s
        altitudeMsl_ft = altitude ft | longitude_deg = longitude deg | latitude_deg = latitude deg
        localGravity_ft_s2 | eulerAngle_deg_Yaw = psi deg | eulerAngle_deg_Pitch = theta deg
        eulerAngle_deg_Roll = phi deg | bodyAngularRateWrtEi_deg_s_Roll = p deg/s
        bodyAngularRateWrtEi_deg_s_Pitch = q deg/s | bodyAngularRateWrtEi_deg_s_Yaw = r deg/s
        altitudeRateWrtMsl_ft_min = -velocity_down ft/min | speedOfSound_ft_s
        airDensity_slug_ft3 = rho slug/ft^3 | ambientPressure_lbf_ft2 = static_pressure psf
        ambientTemperature_dgR = temperature degR | aero_bodyForce_lbf_X | aero_bodyMoment_ftlbf_L
        mach = mach 1 | dynamicPressure_lbf_ft2 = qbar psf | trueAirspeed_nmi_h = V knot
    """,
    "CloudAhoy": """
        seconds/t = time | degrees/LAT = latitude deg | degrees/LON = longitude deg
        feet/ALT (GPS) = altitude ft | ft Baro/AltB = pressure_altitude ft | knots/GS
        knots/IAS = calibrated_airspeed knot | knots/TAS = V knot | degrees/HDG = psi deg
        degrees/MagHDG | degrees/PITCH = theta deg | degrees/ROLL = phi deg
        degrees/YAW = beta deg | degrees/WndDr | knots/WndSpd | fpm/VS = -velocity_down ft/min
        G/NormAc = -az_imu g | degrees/AOA = alpha deg
    """,
    "MSFS SimConnect": """
        SIMULATION TIME = time | PLANE LATITUDE = latitude deg | PLANE LONGITUDE = longitude deg
        PLANE ALTITUDE = altitude ft | PLANE ALT ABOVE GROUND = height_above_ground ft
        PLANE PITCH DEGREES = -theta rad | PLANE BANK DEGREES = -phi rad
        PLANE HEADING DEGREES TRUE = psi rad | AIRSPEED TRUE = V knot
        AIRSPEED INDICATED = calibrated_airspeed knot | AIRSPEED MACH = mach 1
        INCIDENCE ALPHA = alpha rad | INCIDENCE BETA = beta rad
        VERTICAL SPEED = -velocity_down ft/min | ROTATION VELOCITY BODY X = -q rad/s
        ROTATION VELOCITY BODY Y = r rad/s | ROTATION VELOCITY BODY Z = -p rad/s
        ACCELERATION BODY X = ay_imu ft/s^2 | ACCELERATION BODY Y
        ACCELERATION BODY Z = ax_imu ft/s^2 | VELOCITY BODY X | VELOCITY BODY Y
        VELOCITY BODY Z = V ft/s | VELOCITY WORLD X = velocity_east ft/s
        VELOCITY WORLD Y = -velocity_down ft/s | VELOCITY WORLD Z = velocity_north ft/s
        G FORCE = -az_imu g | ELEVATOR DEFLECTION = delta_elevator rad
        RUDDER DEFLECTION = delta_rudder rad | ELEVATOR POSITION
        AMBIENT TEMPERATURE = temperature degC | AMBIENT PRESSURE = static_pressure inHg
        AMBIENT WIND VELOCITY | AMBIENT DENSITY = rho slug/ft^3 | TOTAL WEIGHT
    """,
    "X-Plane FDR": """
        time = time | temp = temperature degC | lon = longitude deg | lat = latitude deg
        h msl = altitude ft | radio altft = height_above_ground ft | ailn ratio | elev ratio
        rudd ratio | ptch deg = theta deg | roll deg = phi deg | hdng TRUE = psi deg
        speed KIAS = calibrated_airspeed knot | VVI ft/min = -velocity_down ft/min | slip deg
        turn deg | mach # = mach 1 | AOA deg = alpha deg
    """,
    "Tacview CSV": """
        Unix time = time | Longitude = longitude deg | Latitude = latitude deg
        Altitude = altitude m | Roll = phi deg | Pitch = theta deg | Yaw = psi deg
        AGL = height_above_ground m | HDG | HDM | TAS = V m/s | CAS = calibrated_airspeed m/s
        IAS = calibrated_airspeed m/s | Mach = mach 1 | AOA = alpha deg | AOS = beta deg
        VerticalGForce = -az_imu g | LateralGForce = ay_imu g | LongitudinalGForce = ax_imu g
        RollControlInput | PitchControlInput | Throttle | AirBrakes
    """,
    "ArduPilot NKF1": """
        TimeUS = time | Roll = phi deg | Pitch = theta deg | Yaw = psi deg
        VN = velocity_north m/s | VE = velocity_east m/s | VD = velocity_down m/s | dPD | PN | PE
        PD | GX | GY | GZ | OH
    """,
    "ArduPilot RATE": """
        TimeUS = time | RDes | R = p deg/s | ROut | PDes | P = q deg/s | POut | YDes | Y = r deg/s
        YOut | ADes | A | AOut
    """,
    "ArduPilot PIDR": """
        TimeUS = time | Tar | Act | Err | P | I | D | FF | DFF | Dmod | SRate | Limit
    """,
    "ulog2csv local position": """
        timestamp = time | x | y | z | vx = velocity_north m/s | vy = velocity_east m/s
        vz = velocity_down m/s | ax | ay | az | heading = psi rad | dist_bottom | eph
    """,
    "ROS odometry": """
        time = time | field.pose.pose.position.x | field.pose.pose.orientation.x
        field.twist.twist.linear.x | field.twist.twist.linear.y | field.twist.twist.linear.z
        field.twist.twist.angular.x = p rad/s | field.twist.twist.angular.y = -q rad/s
        field.twist.twist.angular.z = -r rad/s
    """,
    "OpenSky states": """
        time = time | icao24 | lat = latitude deg | lon = longitude deg | velocity | heading
        vertrate = -velocity_down m/s | baroaltitude = pressure_altitude m | geoaltitude
    """,
    "traffic (ADS-B)": """
        timestamp = time | latitude = latitude deg | longitude = longitude deg
        altitude = pressure_altitude ft | groundspeed | track
        vertical_rate = -velocity_down ft/min | IAS = calibrated_airspeed knot | TAS = V knot
        Mach = mach 1 | roll = phi deg | heading | selected_mcp
    """,
    "INAV blackbox": """
        loopIteration | time (us) = time | axisRate[0] | axisP[0] | rcData[0]
        gyroADC[0] = p deg/s | gyroADC[1] = -q deg/s | gyroADC[2] = -r deg/s | accSmooth[0]
        accSmooth[1] | accSmooth[2] | attitude[0] = phi deg | attitude[1] | attitude[2] = psi deg
        navPos[0] | navVel[0] = velocity_north cm/s | navVel[1] = velocity_east cm/s
        navVel[2] = -velocity_down cm/s | navTgtVel[0] | airspeed = V cm/s | BaroAlt (cm)
        servo[0] | wind[0]
    """,
    "Trick (NASA)": """
        sys.exec.out.time {s} = time | veh.aero.alpha {rad} = alpha rad
        veh.aero.beta {rad} = beta rad | veh.aero.mach {--} = mach 1
        veh.state.pqr[0] {rad/s} = p rad/s | veh.state.pqr[1] {rad/s} = q rad/s
        veh.state.phi {degree} = phi deg | veh.state.altitude {ft} = altitude ft
    """,
    "MoTeC i2": """
        Time = time | Airspeed True = V km/h | Ground Speed | G Force Lat = ay_imu g
        G Force Long = ax_imu g | G Force Vert | Roll Rate = p deg/s | Pitch Rate = q deg/s
        Angle of Attack = alpha deg | Elevator Pos = delta_elevator deg | Battery Volts
    """,
    "IADS / IRIG": """
        IRIG_TIME = time | ALPHA_BOOM (DEG) = alpha deg | BETA_BOOM (DEG) = beta deg
        TAS_ADC (KT) = V knot | HP_ADC (FT) = pressure_altitude ft | NZ_CG (G) = -az_imu g
        NY_CG (G) = ay_imu g | PITCH_RATE (DEG/S) = q deg/s | STAB_POS (DEG) | LH_AIL_POS (DEG)
        RH_AIL_POS (DEG)
    """,
    "VBOX": """
        sats | time = time | lat = latitude arcminute | long = longitude arcminute | velocity kmh
        heading | height = altitude m | vertvel kmh = -velocity_down km/h
        YAW RATE deg/s = r deg/s | PITCH deg = theta deg
    """,
    "AeroProbe": """
        Time (s) = time | Velocity (m/s) = V m/s | AOA (deg) = alpha deg | AOS (deg) = beta deg
        Altitude (m) | Q (Pa) = qbar Pa | Ps (Pa) = static_pressure Pa
    """,
    "SBG": """
        timestamp = time | roll = phi deg | pitch = theta deg | yaw = psi deg | rollStd | pitchStd
        yawStd | velocityNorth = velocity_north m/s | velocityEast = velocity_east m/s
        velocityDown = velocity_down m/s | undulation | gyroX = p deg/s | gyroY = q deg/s
        gyroZ = r deg/s | temp
    """,
    "Garmin G3X": """
        Local Time (hh:mm:ss) = time | GPS Altitude (ft) = altitude ft | GPS Ground Speed (kt)
        GPS Ground Track (deg) | Magnetic Heading (deg)
        Pressure Altitude (ft) = pressure_altitude ft | Baro Altitude (ft)
        Vertical Speed (ft/min) = -velocity_down ft/min
        Indicated Airspeed (kt) = calibrated_airspeed knot | True Airspeed (kt) = V knot
        Pitch (deg) = theta deg | Roll (deg) = phi deg | Lateral Acceleration (G) = ay_imu g
        Normal Acceleration (G) = -az_imu g | Selected Heading (deg) | Selected Altitude (ft)
        AOA | Elevator Trim | Outside Air Temp (deg C) = temperature degC | Density Altitude (ft)
        Height Above Ground (ft) = height_above_ground ft
    """,
    "SBET ascii": """
        TIME = time | DISTANCE | EASTING | ELLIPSOID HEIGHT | LATITUDE = latitude deg
        LONGITUDE = longitude deg | ROLL = phi deg | PITCH = theta deg | HEADING = psi deg
        EAST VELOCITY = velocity_east m/s | NORTH VELOCITY = velocity_north m/s
        UP VELOCITY = -velocity_down m/s | X BODY ANGULAR RATE = p deg/s
        Y BODY ANGULAR RATE = q deg/s | Z BODY ANGULAR RATE = r deg/s
        X BODY ACCEL = ax_imu m/s^2 | Z BODY ACCEL = az_imu m/s^2
    """,
    "MATLAB timetable": """
        Time = time | phi_deg = phi deg | V_mps = V m/s | alpha_deg = alpha deg
        q_degps = q deg/s
    """,
    "pandas timedelta": """
         = time | phi = phi rad | alpha = alpha rad | tas = V m/s
    """,
    "LibrePilot GCS": """
        Timestamp = time | AttitudeState.Roll = phi deg | AttitudeState.Pitch = theta deg
        AttitudeState.Yaw = psi deg | AttitudeState.q1 | GyroState.x = p deg/s
        GyroState.y = q deg/s | GyroState.z = r deg/s | AccelState.x = ax_imu m/s^2
        AccelState.y = ay_imu m/s^2 | AccelState.z = az_imu m/s^2
        AirspeedState.CalibratedAirspeed = calibrated_airspeed m/s
        AirspeedState.TrueAirspeed = V m/s | VelocityState.North = velocity_north m/s
        VelocityState.East = velocity_east m/s | VelocityState.Down = velocity_down m/s
        ActuatorDesired.Roll | StabilizationDesired.Pitch | BaroSensor.Altitude | MagState.x
    """,
    "FlightGear properties": """
        /sim/time/elapsed-sec = time | /orientation/roll-deg = phi deg
        /orientation/pitch-deg = theta deg | /orientation/heading-deg = psi deg
        /orientation/alpha-deg = alpha deg | /orientation/side-slip-deg = beta deg
        /orientation/roll-rate-degps = p deg/s | /orientation/pitch-rate-degps = q deg/s
        /orientation/yaw-rate-degps | /velocities/airspeed-kt = calibrated_airspeed knot
        /velocities/uBody-fps | /velocities/vBody-fps | /velocities/wBody-fps
        /velocities/speed-north-fps = velocity_north ft/s
        /velocities/speed-east-fps = velocity_east ft/s
        /velocities/speed-down-fps = velocity_down ft/s
        /velocities/vertical-speed-fps = -velocity_down ft/s | /velocities/mach = mach 1
        /position/altitude-ft = altitude ft | /position/altitude-agl-ft = height_above_ground ft
        /accelerations/pilot/x-accel-fps_sec = ax_imu ft/s^2
        /accelerations/pilot/z-accel-fps_sec = az_imu ft/s^2 | /accelerations/pilot-g = -az_imu g
        /controls/flight/elevator | /controls/flight/aileron
        /surface-positions/elevator-pos-norm | /environment/temperature-degc = temperature degC
        /environment/pressure-inhg = static_pressure inHg
        /environment/density-slugft3 = rho slug/ft^3 | /environment/wind-speed-kt
    """,
    "MGL / GRT EFIS": """
        Time = time | ASI = calibrated_airspeed knot | TAS = V knot | ALT
        VSI = -velocity_down ft/min | AOA | HEAD = psi deg | BANK = phi deg | PITCH = theta deg
        GForce = -az_imu g | SLIP | YAW = beta deg | OAT = temperature degC
    """,
    "FOQA": """
        Frame | Time (secs) = time | Baro Corr Alt (ft) | Pressure Alt (ft) = pressure_altitude ft
        Comp Airspeed (kts) = calibrated_airspeed knot | Body AOA (deg) = alpha deg
        AOA Vane L (deg) | Flight Path Accel (g) | Long Accel (g) = ax_imu g
        Lat Accel (g) = ay_imu g | Vert Accel (g) = -az_imu g | Control Column Pos (deg)
        Elev L Pos (deg) | Rudder Pos (deg) = delta_rudder deg | Drift Angle (deg)
        Longitude (deg) = longitude deg | Track Angle (deg) | Ground Speed (kts)
    """,
    "JSBSim long names": """
        Time = time | Aileron Command | Left Aileron Position (rad)
        Elevator Position (rad) = delta_elevator rad | Rudder Position (rad) = delta_rudder rad
        Altitude ASL (ft) = altitude ft | Altitude AGL (ft) = height_above_ground ft
        Phi (deg) = phi deg | Theta (deg) = theta deg | Psi (deg) = psi deg
        Alpha (deg) = alpha deg | Beta (deg) = beta deg | Alpha Dot (deg/s) | P (deg/s) = p deg/s
        Pdot (deg/s^2) | P Inertial (deg/s) | V_{Total} (ft/s) = V ft/s | UBody
        V_{North} (ft/s) = velocity_north ft/s | V_{East} (ft/s) = velocity_east ft/s
        V_{Down} (ft/s) = velocity_down ft/s | Q bar (psf) = qbar psf
        Rho (slugs/ft^3) = rho slug/ft^3 | P Total (psf) | P stagnation (psf) | T (R) | Nx (G)
    """,
}
#: Tool -> how it writes a time; others write seconds.
CLOCKS: dict[str, Callable[[float], str]] = {
    **dict.fromkeys(
        (
            "ArduPilot NKF1",
            "ArduPilot RATE",
            "ArduPilot PIDR",
            "ulog2csv local position",
            "INAV blackbox",
            "SBG",
        ),
        lambda t: f"{t * 1e6:.0f}",
    ),
    "LibrePilot GCS": lambda t: f"{t * 1e3:.0f}",
    **dict.fromkeys(("Tacview CSV", "OpenSky states"), lambda t: f"{1.7e9 + t:.3f}"),
    "Garmin G3X": stamp,
    "traffic (ADS-B)": lambda t: f"2024-03-01 10:00:{t:09.6f}+00:00",
    "IADS / IRIG": lambda t: f"123:14:00:{t:06.3f}",
    "VBOX": lambda t: f"1012{t:05.2f}",
    "MATLAB timetable": lambda t: f"{t:.3f} sec",
    "pandas timedelta": lambda t: f"0 days 00:00:{t:09.6f}",
}
MOTEC = '"Format","MoTeC CSV File",,,"Workbook",""\n"Sample Rate","50.000","Hz",,"Range",""\n\n'
MOTEC_UNITS = "s,km/h,km/h,G,G,G,deg/s,deg/s,deg,deg,V\n\n"
SBG_UNITS = (
    "(us) (deg) (deg) (deg) (deg) (deg) (deg) (m/s) (m/s) (m/s) (m) (deg/s) (deg/s) (deg/s) (C)"
)
#: Tool -> the lines above its data, of the names; others write the names alone.
HEADS: dict[str, Callable[[list[str]], str]] = {
    "MoTeC i2": lambda names: MOTEC + plain([f'"{each}"' for each in names]) + MOTEC_UNITS,
    "SBG": lambda names: plain(names, "\t") + plain(SBG_UNITS.split(), "\t"),
    "AeroProbe": lambda names: plain(names, "\t"),
}


def tool_of(name: str) -> Tool:
    columns: list[tuple[str, Meaning]] = []
    for cell in COLUMNS[name].replace("\n", "|").split("|"):
        field, _, meant = (part.strip() for part in cell.partition(" = "))
        known, _, unit = meant.partition(" ")
        if meant == "time":
            columns.append((field, T))
        elif meant:
            columns.append(
                (field, c(known.removeprefix("-"), unit, -1.0 if known[0] == "-" else 1))
            )
        elif field:
            columns.append((field, None))
    clock = CLOCKS.get(name)
    tabs = "\t" if name in ("SBG", "AeroProbe") else ","
    write_time = number if clock is None else lambda t, _: clock(t)
    return Tool(tuple(columns), HEADS.get(name, plain), write_time, tabs)


@pytest.mark.parametrize("name", COLUMNS)
def test_channels_of_a_tool_are_right_or_asked(tmp_path: Path, name: str) -> None:
    tool = tool_of(name)
    for seed, rate in ((1, 20.0), (2, 50.0)):
        truth = motion(seed, rate)
        path = tmp_path / f"table{seed}.{'txt' if tool.sep != ',' else 'csv'}"
        write(path, tool, truth, seed)
        assert judged(path, tool, truth)["right"] >= 1  # at least the clock
