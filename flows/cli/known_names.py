"""Names for the help of commands, which waits for no science; tests compare them with the code."""

from typing import Final

#: `aerodb.identification.METHODS`.
METHODS: Final = (
    "regression, frequency-domain, fourier-regression, recursive, normalised-recursive,"
    " principal-components, total-least-squares, instrumental-variables, stepwise,"
    " orthogonal-functions, output-error, filter-error, ekf, ukf, multiple-shooting,"
    " frequency-domain-output-error, nonlinear-refinement"
)
#: `aerodb.storage.readers.read_log`.
LOGS: Final = "ULog, DataFlash, MCAP, MAT, CSV, ASCII or Parquet"
#: `aerodb.tasks.steps.import_database`.
DATABASES: Final = (
    "DAVE-ML, JSBSim XML, CSV (or a ZIP of them), MAT, NetCDF or native TOML; AVL, VSPAERO, XFLR5,"
    " Datcom, sweeps; ArduPilot SITL, Gazebo"
)
#: `aerodb.effects.library`: of aerodynamics, then of sensors and vehicle data.
EFFECTS: Final = (
    "zero_offset, alpha_slope, alpha_slope_break, lift_scale, beta_slope, beta_even,"
    " table_sign, sideslip_coupling, pitch_rate_force, pitch_damping, alpha_dot, lift_lag,"
    " roll_damping, yaw_damping, cross_rate, control_effectiveness, control_nonlinearity,"
    " control_one_sided, control_alpha_coupling, surface_asymmetry, speed_brake, body_flap,"
    " flap, landing_gear, landing_gear_beta, ground_effect, stall_hysteresis, thrust_effect,"
    " mach_effect, dynamic_pressure_effect, parameter, qbar_scale, qbar_offset, alpha_bias,"
    " alpha_scale, alpha_delay, beta_bias, beta_scale, beta_delay, air_data_position,"
    " accelerometer_bias, gyro_bias, gyro_scale, mass_error, cg_offset, inertia_error,"
    " thrust_scale, thrust_line_offset, surface_scale, surface_bias, surface_delay,"
    " surface_backlash, surface_wide_backlash, surface_dead_zone"
)
