"""A quadrotor of parts: four rotors in a square, no wing."""

from typing import Final

MASSES: Final = {"mass": 1.5, "Ixx": 0.029, "Iyy": 0.029, "Izz": 0.055}

_ROTOR = """
[parts.{name}]
kind = "rotor"
position = [{x}, {y}, -0.02]
turns = {turns}
diameter = "10 in"
speed = "120*{command}"
thrust = ["cT0", "cT1"]
torque = "0.006"
drag = "rotor_drag"
"""

#: Native TOML.
QUADROTOR: Final = """\
name = "quad"
[reference]
area = 0.2
chord = 0.5
span = 0.5
moment_reference = [0.0, 0.0, 0.0]
[parameters]
cT0 = { value = 0.11, bounds = [0.05, 0.2] }
cT1 = { value = 0.1, bounds = [0.0, 0.3] }
rotor_drag = { value = 0.0006, bounds = [0.0, 0.01] }
""" + "".join(
    _ROTOR.format(name=name, x=x, y=y, turns=turns, command=command)
    for name, x, y, turns, command in (
        ("front_right", 0.16, 0.16, 1, "command_1"),
        ("rear_left", -0.16, -0.16, 1, "command_2"),
        ("front_left", 0.16, -0.16, -1, "command_3"),
        ("rear_right", -0.16, 0.16, -1, "command_4"),
    )
)


def thrust_at(command: float, density: float) -> float:
    """Static thrust [N] of a rotor at a command (0 to 1) and a density [kg/m3]."""
    return density * (120.0 * command) ** 2 * 0.254**4 * 0.11
