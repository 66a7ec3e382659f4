"""Vehicle file, database and model file of the tilt-wing of `tests.support.tiltwing_flight`.

Masses, places and speeds of the rotors are those of its appendix. All that a flight is to tell begins
wrong, thrust by a quarter.
"""

from typing import Final

from tests.support.tiltwing_flight import NAMES

HEAD: Final = """\
name = "tilt-wing"
[reference]
area = 0.52
chord = 0.26
span = 2.0
pressure = "100 Pa"
"""
#: Parameter -> start value, bounds.
START: Final = {
    "main_cT0": (0.055, 0.02, 0.15), "main_cT1": (0.05, 0.0, 0.3),
    "tail_cT0": (0.06, 0.02, 0.15), "tail_cT1": (0.05, 0.0, 0.3),
    "rotor_drag": (0.0005, 0.0, 0.01), "wing_slope": (3.5, 1.0, 7.0), "wing_drag": (0.03, 0.0, 0.2),
    "plate_lift": (0.8, 0.2, 2.0), "plate_drag": (1.3, 0.3, 3.0), "elevator_part": (0.4, 0.0, 1.2),
    "aileron_part": (0.3, 0.0, 1.2), "frame_x": (0.03, 0.0, 0.3), "frame_y": (0.03, 0.0, 0.3),
    "frame_z": (0.03, 0.0, 0.3),
}  # fmt: skip
_WING: Final = """
[parts.{name}]
kind = "rotor"
mirror = true
position = [0.055, {y}, -0.02]
axis = [1.0, 0.0, 0.0]
tilt = "delta_tilt"
turns = {turns}
diameter = "16 in"
speed = "(-3058*command_{name}_{{side}}^2 + 9945*command_{name}_{{side}} + 226)/60"
thrust = ["main_cT0", "main_cT1"]
torque = 0.005
drag = "rotor_drag"

[parts.wing_{name}]
kind = "section"
mirror = true
position = [0.02, {y}, -0.02]
area = 0.13
tilt = "delta_tilt"
slipstream = "{name}_{{side}}"
lift = "wing_slope*alpha"
drag = "wing_drag + 0.05*lift^2"
separated = {{ angle = "15 deg", sharpness = 30.0, lift = "plate_lift", drag = ["0.05", "plate_drag"] }}
control = {{ {control} }}
"""
_REST: Final = """
[parts.tail_rotor]
kind = "rotor"
position = [-0.573, 0.0, 0.04]
diameter = "10 in"
speed = "(-1895*command_tail^2 + 10882*command_tail + 213)/60"
thrust = ["tail_cT0", "tail_cT1"]
torque = 0.005
drag = "rotor_drag"

[parts.tailplane]
kind = "section"
position = [-0.85, 0.0, 0.0]
area = 0.09
lift = "3.6*alpha"
drag = 0.02
separated = { angle = "15 deg", sharpness = 30.0, lift = 1.0, drag = [0.05, 1.8] }
control = { delta_elevator = "elevator_part" }

[parts.fin]
kind = "section"
position = [-0.85, 0.0, -0.15]
dihedral = "90 deg"
area = 0.06
lift = "3.0*alpha"
drag = 0.02
separated = { angle = "15 deg", sharpness = 30.0, lift = 1.0, drag = [0.05, 1.8] }

[parts.frame]
kind = "body"
position = [0.0, 0.0, 0.0]
"""
VEHICLE: Final = (
    HEAD
    + """\
[points]
moment_reference = [0.0, 0.0, 0.0]
[mass]
source = "constant"
mass = 6.1
cg = [0.0, 0.0, 0.0]
Ixx = 0.66
Iyy = 0.33
Izz = 1.0
Ixz = 0.0
[surfaces.tilt]
limits = ["0 deg", "95 deg"]
log = { topic = "table", field = "delta_tilt", unit = "rad" }
[surfaces.elevator]
limits = ["-30 deg", "30 deg"]
[surfaces.aileron]
limits = ["-30 deg", "30 deg"]
"""
    + "".join(
        f'[rotors.{name}]\nlag = 0.03\nlog = {{ topic = "table", field = "command_{name}" }}\n'
        for name in NAMES
    )
)
MODEL: Final = (
    f"parameters = [{', '.join(repr(name) for name in START)}]\nown_constants = false\n"
).replace("'", '"')


def database() -> str:
    """The tilt-wing as parts, native TOML."""
    known = "".join(
        f"{name} = {{ value = {value}, bounds = [{low}, {high}] }}\n"
        for name, (value, low, high) in START.items()
    )
    wing = "".join(
        _WING.format(name=name, y=y, turns=turns, control=control)
        for name, y, turns, control in (
            ("outer", 0.748, 1, 'delta_aileron = "side*aileron_part"'), ("inner", 0.323, -1, ""),
        )
    )  # fmt: skip
    frame = "".join(
        f'[[parts.frame.load]]\naxis = "F{axis.upper()}"\n'
        f'expression = "-0.5*rho*frame_{axis}*{own}*abs({own})"\n'
        for axis, own in zip("xyz", "uvw", strict=True)
    )
    return f"{HEAD}moment_reference = [0.0, 0.0, 0.0]\n[parameters]\n{known}{wing}{_REST}{frame}"
