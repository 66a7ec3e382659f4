"""Names of fields that are near to a channel's: those of other things are none, and what a name
leaves open is asked."""

import pytest

from aerodb.logs.field_names import named

#: Names of other things.
OTHERS = [
    "delta_angle_x",
    "delta_velocity_z",
    "delta_t",
    "delta_time",
    "delta_pressure",
    "delta_altitude",
    "delta_theta",
    "delta_alpha",
    "delta_throttle",
    "delta_temp",
    "delta_mass",
    "DelAngX",
    "DelVelX",
    "delta_velocity[2]",
    "elevator_temp",
    "gyro_temp",
    "motor_temp",
    "imu_temp",
    "baro_temp",
    "skin_temp",
    "accel_temp",
    "total_temp",
    "temp_imu",
    "geoid_height",
    "terrain_alt",
    "decision_height",
    "target_alt",
    "antenna_height",
    "tree_height",
    "rtl_alt",
    "tank_height",
    "C_m_alpha",
    "Cm_alpha",
    "CL_alpha",
    "cl_q",
    "gust_alpha",
    "downwash_alpha",
    "gust_beta",
    "tail_alpha",
    "stall_alpha",
    "delta_aoa",
    "q[0]",
    "q[1]",
    "q[2]",
    "q[3]",
    "p[0]",
    "r_1",
    "payload_mass",
    "ballast_mass",
    "empty_mass",
    "hub_thrust",
    "tip_mach",
    "blade_pitch",
    "collective_pitch",
    "cam_pitch",
    "ship_roll",
    "runway_heading",
    "intruder_lat",
    "dest_lat",
    "accel_bias_x",
    "alpha_dot",
    "p_dot",
    "roll_min",
    "alpha_max",
    "tas_min [m/s]",
    "climb_rms",
    "airspeed_stdev",
    "sim/cockpit2/controls/pitch_ratio",
]
#: Name -> channel, its unit or '', and whether it is asked.
PLAIN = {
    "phi_dot": ("p", "", True),
    "theta_dot [deg/s]": ("q", "deg/s", True),
    "psidot": ("r", "", True),
    "T_amb": ("temperature", "", False),
    "T_inf [K]": ("temperature", "K", False),
    "ralt [ft]": ("height_above_ground", "ft", True),
    "radar_altitude": ("height_above_ground", "", True),
    "hdot [m/s]": ("velocity_down", "m/s", False),
    "alt_rate [ft/min]": ("velocity_down", "ft/min", False),
    "lon_accel": ("ax_imu", "", False),
    "lat_accel": ("ay_imu", "", False),
    "norm_accel": ("az_imu", "", False),
    "accel_lat": ("ay_imu", "", False),
    "a_long": ("ax_imu", "", False),
    "vert_accel": ("az_imu", "", True),
    "Baro Altitude": ("altitude", "", True),
    "BaroAlt [ft]": ("altitude", "ft", True),
    "Pressure Altitude [ft]": ("pressure_altitude", "ft", False),
    "Hp": ("pressure_altitude", "", True),
    "h [m]": ("altitude", "m", True),
    "delta_canard": ("delta_canard", "", False),
    "delta_e_left": ("delta_e_left", "", False),
    "delta_roll": ("delta_roll", "", True),
    "delta_e_raw": ("delta_elevator", "", True),
    "ext_temp": ("temperature", "", True),
    "gps_height": ("altitude", "", True),
    "nose_alpha": ("alpha", "", True),
    "gyro[0]": ("p", "", True),
    "OAT_C": ("temperature", "degC", False),
    "T_amb_K": ("temperature", "K", False),
    "EAS": ("calibrated_airspeed", "", True),
    "KEAS": ("calibrated_airspeed", "knot", True),
    "KTAS": ("V", "knot", False),
    "kcas": ("calibrated_airspeed", "knot", False),
    "hdg_mag": ("psi", "", True),
    "HDG M": ("psi", "", True),
    "magHeading": ("psi", "", True),
    "AGL_alt": ("height_above_ground", "", False),
    "p_amb": ("static_pressure", "", False),
    "aircraft_mass": ("mass", "", False),
    "climb_ft_min": ("velocity_down", "ft/min", False),
    "sim/flightmodel/position/P": ("p", "", False),
    "sim/flightmodel/position/theta": ("theta", "", False),
    "sim/cockpit2/autopilot/pitch": ("theta", "", True),
}


@pytest.mark.parametrize("name", OTHERS)
def test_the_name_of_another_thing_is_no_channel(name: str) -> None:
    assert named(name) is None


@pytest.mark.parametrize("name", PLAIN)
def test_a_plain_name_is_its_channel(name: str) -> None:
    channel, unit, is_asked = PLAIN[name]
    found = named(name)
    assert found is not None
    assert (found.channel, found.unit) == (channel, unit)
    assert (bool(found.open) or found.how == "part") == is_asked


def test_a_rate_of_climb_counts_against_the_channel() -> None:
    assert [named(each).sign for each in ("hdot", "alt_dot", "vvi", "sink_rate")] == [-1, -1, -1, 1]
