"""An integrator of fourth order: what the equations of motion and the simulator's own integrator
are set against."""

from aerodb.simulation.motion import Derivative, normalised
from aerodb.support import Array


def runge_kutta_step(
    rate: Derivative, time: float, state: Array, step: float, first: Array
) -> Array:
    """One step of the classical fourth-order Runge-Kutta rule; arguments as in `midpoint_step`."""
    second = rate(time + step / 2, state + step / 2 * first)
    third = rate(time + step / 2, state + step / 2 * second)
    fourth = rate(time + step, state + step * third)
    return normalised(state + step / 6 * (first + 2 * second + 2 * third + fourth))
