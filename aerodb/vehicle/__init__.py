"""Vehicles: what their files say, and what that adds to a flight.

1. `parse_vehicle(text)` reads a vehicle file into a `Vehicle`; `with_measured` adds what was
   measured outside flight. `vehicle_template` is a file to fill in, `placeholders` what of it is
   still there.
2. `add_combinations`, `with_mass_channels`, `mass_channels` and `cg_positions` give the channels of
   a flight that follow from the file.
3. `flow_angles` turns the pressures of a five-hole probe into angles; `air_data_at_cg` moves air
   data from the probe to the CG; `with_flow_over_ground` stands for air data of a vehicle that
   rotors carry.

Modules: `description` (the file), `mass_properties` (with events of mass), `on_flights`,
`template`, `five_hole`, `probe` and `rotorcraft`.
"""

from typing import TYPE_CHECKING

from aerodb.lazy_faces import attach

if TYPE_CHECKING:
    from .description import (
        Accuracy,
        AirData,
        Hinge,
        LoggedRotor,
        LogSource,
        Reference,
        Sensor,
        Surface,
        Thrust,
        ThrustLine,
        Vehicle,
        VerticalAir,
        full_travels,
        parse_vehicle,
        with_measured,
    )
    from .five_hole import Curve, FiveHole, flow_angles, pressure_ratio
    from .mass_properties import MASS_CHANNELS, MassEvent, MassProperties
    from .on_flights import add_combinations, cg_positions, mass_channels, with_mass_channels
    from .probe import air_data_at_cg, angles_from_pressures, probe_configuration, velocity_at_cg
    from .rotorcraft import (
        FLOW,
        FULL,
        lacks_airspeed,
        with_flow_over_ground,
        without_flow_over_ground,
    )
    from .template import UNKNOWN_INERTIA, placeholders, vehicle_template

__getattr__, __dir__, __all__ = attach(__name__, __file__)
