"""Standard atmosphere, WGS-84 earth, attitudes and rigid bodies, all in SI and radians.

Begin with the relation that you need; nothing here keeps state.

- `standard_atmosphere` gives pressure, temperature and density at a geopotential altitude;
  `density`, `speed_of_sound` and `mach_from_calibrated` relate measured air data (`atmosphere`).
- `euler_321_from_quaternion` and `euler_321_from_enu_quaternion` turn a logged quaternion into
  bank angle, pitch attitude and heading, `quaternion_from_euler` turns them back; `to_body` and
  `to_earth` rotate vectors by one, `cross` is their vector product (`frames`).
- `Earth` is a local origin: `Earth.to_local` gives north and east in metres. `normal_gravity`,
  `radii_of_curvature`, `EARTH_RATE` and `PLUMB_LINE_CURVATURE` are the terms of the equations of
  motion over a rotating oblate earth (`geodesy`).
- `Turbulence` and `DiscreteGust` are moving air: `gust_density` and `gust_covariance` in closed
  form, `gust_series` and `DrydenGusts` as series (`turbulence`).
- `VortexPair` is the wake of an aircraft, `air_at_stations` what another one feels in it (`wake`).
- `specific_force_at_cg` and `inertial_moment` are the motion of a rigid body (`rigid_body`).

Which relation fills which missing channel of a flight is decided in `aerodb.logs.air_data`.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .atmosphere import (
        DENSITY_0,
        GAS_CONSTANT,
        GRAVITY,
        HEAT_RATIO,
        LAYER,
        STANDARD_LAYERS,
        density,
        mach_from_calibrated,
        speed_of_sound,
        standard_atmosphere,
    )
    from .frames import (
        cross,
        euler_321_from_enu_quaternion,
        euler_321_from_quaternion,
        quaternion_from_euler,
        to_body,
        to_earth,
    )
    from .geodesy import (
        EARTH_RATE,
        HIGHEST_LATITUDE,
        PLUMB_LINE_CURVATURE,
        Earth,
        normal_gravity,
        radii_of_curvature,
    )
    from .rigid_body import inertial_moment, specific_force_at_cg
    from .turbulence import (
        FORMS,
        GUST_VELOCITIES,
        HIGH_ALTITUDE_LENGTH,
        PITCH_LAG,
        YAW_LAG,
        DiscreteGust,
        DrydenGusts,
        Form,
        Turbulence,
        gust_covariance,
        gust_density,
        gust_series,
        roll_density,
        rotation_gain,
        turbulence_at,
    )
    from .wake import CORES, LAMB_OSEEN_EXPONENT, Core, VortexPair, air_at_centre, air_at_stations

__getattr__, __dir__, __all__ = attach(__name__, __file__)
