"""Which logged surface history drives which axis: the elevator's, aileron's and rudder's against
each other, and all of them against the motion.

Of each axis, what flow angles and rates leave is regressed on the histories of one role at a time.
A surface whose field was exchanged explains another axis, and not its own; those of another flight,
or of a clock that is far off, explain none (ratio of likelihoods with the samples that are
independent in the residual: Klein & Morelli, Aircraft System Identification, 2006, chapter 5).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations
from typing import Final

import numpy as np

from aerodb.conditioning import Suspicion
from aerodb.estimation import samples_per_independent
from aerodb.support import SMALL, Array
from aerodb.suspicions.equation_error import MOTION, EquationError
from aerodb.suspicions.evidence import CAUSED, LIKELIER, SWING
from aerodb.suspicions.surfaces import Control

#: Kind of a suspicion of surfaces that explain nothing of what turns the aircraft.
UNRELATED: Final = "unrelated"
#: Largest share of a moment, without that of motion, that surfaces of another flight explain by
#: chance. Right flights have .2 at least on their best axis.
CHANCE: Final = SMALL
#: What one of six assignments of three histories must be likelier for the search (logarithm).
SEARCHED: Final = float(np.log(6.0))
#: Least number of independent samples of an axis on which surfaces explain nothing. With 40, a
#: history of another flight explains a tenth in one of 25.
SAMPLES: Final = 40.0


@dataclass(frozen=True)
class _Share:
    """What the histories of a role explain of an axis: the share of what motion leaves, and how
    much likelier (logarithm) that is."""

    share: float
    likelier: float


def assignment_suspicions(
    axes: Mapping[str, EquationError], controls: Mapping[str, Control]
) -> list[Suspicion]:
    """Return an elevator whose field was exchanged with the aileron's or the rudder's, or surfaces
    that explain nothing on any axis.

    Aileron against rudder alone needs more care, and is judged elsewhere. Deflections [rad], (n,)
    in the flight. Source: `docs/method/consistency.md`, section "Against the vehicle".
    """
    known = _histories(axes)
    groups = {
        role: [n for n, c in controls.items() if c.role == role and n in known] for role in MOTION
    }
    table = {
        role: _shares(axis, known, groups)
        for role, axis in axes.items()
        if groups[role] and _is_finite(axis)
    }
    exchanged = _exchanged(table, groups)
    if exchanged is not None:
        return [exchanged]
    unrelated = _unrelated(table, axes, known, groups)
    return [] if unrelated is None else [unrelated]


def _histories(axes: Mapping[str, EquationError]) -> dict[str, Array]:
    """All controls by name, whichever axis they are regressed on."""
    found: dict[str, Array] = {}
    for axis in axes.values():
        found |= axis.controls
    return found


def _is_finite(axis: EquationError) -> bool:
    columns = [axis.moment, *axis.motion.values()]
    return all(bool(np.isfinite(values[axis.where]).all()) for values in columns)


def _rest(axis: EquationError) -> tuple[Array, Array]:
    """What motion leaves of the moment, (m,), and the basis (m, k) of the motion."""
    moment = axis.moment[axis.where]
    columns = [np.ones_like(moment), *(values[axis.where] for values in axis.motion.values())]
    basis = np.linalg.qr(np.column_stack(columns))[0]
    return moment - basis @ (basis.T @ moment), basis


def _shares(
    axis: EquationError, known: Mapping[str, Array], groups: Mapping[str, list[str]]
) -> dict[str, _Share]:
    """Role -> what its histories explain of the axis. All are judged with as many independent
    samples, those of what the role leaves that explains most: each by its own, a history that
    leaves a coloured rest would be less likely although it explains more."""
    left = {role: _left(axis, known, names) for role, names in groups.items() if names}
    rest, _ = _rest(axis)
    whole = float(rest @ rest)
    least = min(left.values(), key=lambda each: float(each @ each))
    many = _independent(axis, least)
    found = {}
    for role, each in left.items():
        share = 1.0 - float(each @ each) / whole if whole > 0.0 else 0.0
        found[role] = _Share(share, -0.5 * many * float(np.log(max(1.0 - share, 1e-12))))
    return found


def _left(axis: EquationError, known: Mapping[str, Array], names: list[str]) -> Array:
    """What motion and these histories leave of the moment, (m,)."""
    rest, basis = _rest(axis)
    moved = np.column_stack([known[name][axis.where] for name in names])
    if not np.isfinite(moved).all():
        return rest
    own, sizes, _ = np.linalg.svd(moved - basis @ (basis.T @ moved), full_matrices=False)
    own = own[:, sizes > 1e-9 * max(float(np.abs(moved).max()), 1e-300)]
    left: Array = rest - own @ (own.T @ rest)
    return left


def _independent(axis: EquationError, residual: Array) -> float:
    return float(axis.where.sum()) / max(1.0, samples_per_independent(residual))


def _exchanged(
    table: Mapping[str, Mapping[str, _Share]], groups: Mapping[str, list[str]]
) -> Suspicion | None:
    """The exchange that makes all of its axes likelier and one of them clearly, if the elevator
    takes part: no aileron pitches an aircraft, and no elevator rolls or yaws it."""
    roles = [role for role in table if role in table[role]]
    if "pitch" not in roles:
        return None
    best: tuple[float, tuple[str, ...]] | None = None
    for order in permutations(roles):
        changed = [(a, b) for a, b in zip(roles, order, strict=True) if a != b]
        if order[roles.index("pitch")] == "pitch":
            continue
        gains = [table[a][b].likelier - table[a][a].likelier for a, b in changed]
        clear = any(
            gain > LIKELIER + SEARCHED and table[a][b].share > CAUSED
            for gain, (a, b) in zip(gains, changed, strict=True)
        )
        if min(gains) >= 0.0 and clear and (best is None or sum(gains) > best[0]):
            best = sum(gains), order
    if best is None:
        return None
    turns = {b: a for a, b in zip(roles, best[1], strict=True) if a != b}
    words = ", ".join(f"{groups[b][0]} {_TURNS[a]}" for b, a in turns.items())
    sentence = f"the surfaces turn the aircraft about other axes: {words}. The channels are swapped"
    return Suspicion(groups["pitch"][0], "swapped", sentence, {"likelier": best[0]})


_TURNS: Final = {"pitch": "pitches it", "roll": "rolls it", "yaw": "yaws it"}


def _unrelated(
    table: Mapping[str, Mapping[str, _Share]],
    axes: Mapping[str, EquationError],
    known: Mapping[str, Array],
    groups: Mapping[str, list[str]],
) -> Suspicion | None:
    """Surfaces that move, and explain nothing of what turns the aircraft about any axis."""
    judged, largest = [], 0.0
    everything = [name for names in groups.values() for name in names]
    for role in table:
        axis = axes[role]
        moved = max(float(np.std(known[name][axis.where])) for name in groups[role])
        rest = _rest(axis)[0]
        left = _left(axis, known, everything)
        if not moved > SWING or _independent(axis, rest) < SAMPLES:
            continue
        judged.append(role)
        largest = max(largest, 1.0 - float(left @ left) / max(float(rest @ rest), 1e-300))
    if len(judged) < 2 or largest > CHANCE:
        return None
    name = groups[judged[0]][0]
    words = (
        f"{name} and the other surfaces explain {100 * largest:.0f} % at most of what turns the"
        f" aircraft ({', '.join(judged)}). They are of another flight, or their clock is far off"
    )
    return Suspicion(name, UNRELATED, words, {"share": largest})
