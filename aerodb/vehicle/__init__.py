"""Vehicles: what their files say, and what that adds to a flight.

1. `parse_vehicle(text)` reads a vehicle file into a `Vehicle`; `with_measured` adds what was
   measured outside flight. `vehicle_template` is a file to fill in, `placeholders` what of it is
   still there.
2. `add_combinations`, `with_mass_channels`, `mass_channels` and `cg_positions` give the channels of
   a flight that follow from the file.
3. `flow_angles` turns the pressures of a five-hole probe into angles; `air_data_at_cg` moves air
   data from the probe to the CG.

Modules: `description` (the file), `on_flights`, `template`, `five_hole` and `probe`.
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach_stub(__name__, __file__)
