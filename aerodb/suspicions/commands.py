"""Commands of rotors as a log has them: not logged, of a motor that never turns, out of range."""

from typing import Final

import numpy as np

from aerodb.conditioning import Suspicion, carried
from aerodb.flight import Flight
from aerodb.support import SMALL
from aerodb.suspicions.controls import UNMOVED
from aerodb.suspicions.evidence import FEWEST
from aerodb.vehicle import FULL, LoggedRotor, Vehicle

#: Share of the usual command of all rotors up to which one stands still. By the square, its thrust
#: would be a hundredth of the others'.
STANDING: Final = SMALL


def command_suspicions(flight: Flight, vehicle: Vehicle) -> tuple[Suspicion, ...]:
    """Return rotors of the vehicle file whose command (n,) is not in the flight, stands still while
    others carry the vehicle, or is beyond 0 to 1 (-1 to 1 if it turns back).

    Source: `docs/reference/parts.md`, section "rotor".
    """
    absent = [name for name in vehicle.rotors if f"command_{name}" not in flight]
    listed = [_absent(absent, vehicle)] if absent else []
    names = [name for name in vehicle.rotors if name not in absent]
    where = carried(flight)
    if not where.any():
        where = np.ones_like(where)
    values = {
        name: np.abs(flight[f"command_{name}"][where & flight.usable([f"command_{name}"])])
        for name in names
    }
    values = {name: each for name, each in values.items() if len(each) >= FEWEST}
    usual = float(np.mean([np.median(each) for each in values.values()])) if values else 0.0
    for name, each in values.items():
        rotor, largest = vehicle.rotors[name], float(np.quantile(each, 0.98))
        if largest > FULL:
            words = (
                f"command_{name} reaches {largest:.3g}, and 1 is all: {_place(rotor)} is beyond"
                f" range = [{rotor.range[0]:g}, {rotor.range[1]:g}] of [rotors.{name}] in the"
                " vehicle file. Write the logged values at standstill and at full speed"
            )
            listed.append(Suspicion(f"command_{name}", "unit", words, {"largest": largest}))
        elif largest <= STANDING * usual:
            words = (
                f"rotor {name} never turns: command_{name} ({_place(rotor)}) is {largest:.2g} at"
                f" most, and {usual:.2g} is usual for all. Its motor stood still, or its command is"
                " in another field of the log: correct [rotors] in the vehicle file"
            )
            kind = UNMOVED if vehicle.surfaces else "stuck"  # a pusher may stand still
            listed.append(Suspicion(f"command_{name}", kind, words, {"largest": largest}))
    return tuple(listed)


def _absent(names: list[str], vehicle: Vehicle) -> Suspicion:
    places = ", ".join(_place(vehicle.rotors[name]) for name in names[:3])
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    words = (
        f"the log has no command of rotor {', '.join(names)}: {places}{more} is not in it. Correct"
        " `log` of [rotors] in the vehicle file (aerodb log inspect shows the fields)"
    )
    return Suspicion(f"command_{names[0]}", "missing", words, {"rotors": float(len(names))})


def _place(rotor: LoggedRotor) -> str:
    return f"{rotor.log.topic} {rotor.log.field}"
