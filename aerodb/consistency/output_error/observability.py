"""Which unknowns these manoeuvres can tell apart: those that they cannot are held, and the reason is kept."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerodb.consistency.sensors import Parameter
from aerodb.support import Array

#: What is held first when several unknowns cannot be separated: what a serviceable aircraft is least likely to need.
_ORDER = ("mount", "arm", "probe", "port", "delay", "scale", "terrain", "weather", "wind", "bias", "initial")


@dataclass(frozen=True)
class Held:
    """A parameter that was not estimated; `among`: those with which it trades off (itself included); `spread`: standard error
    that the worst combination of them would have had, in natural sizes."""

    label: str
    among: tuple[str, ...]
    spread: float

    @property
    def because(self) -> str:
        """One plain sentence."""
        if len(self.among) == 1:
            return f"{self.label} is held: these manoeuvres say nothing about it"
        return f"{self.label} is held: these manoeuvres cannot separate {', '.join(self.among)}"


def held_back(items: Sequence[Parameter], information: Array) -> tuple[list[int], tuple[Held, ...]]:
    """Parameters to keep (indices) and to hold, from the information matrix (k, k) (measurements and priors).

    In natural sizes the matrix's small eigenvalues are combinations that stay uncertain by more than a serviceable sensor's
    own error (Belsley, Kuh & Welsch 1980, chapter 3, by eigenvectors): one parameter of each is held, until none is left.
    """
    keep = list(range(len(items)))
    size = np.array([item.size for item in items])
    scaled = information * np.outer(size, size)
    held: list[Held] = []
    while keep:
        values, vectors = np.linalg.eigh(scaled[np.ix_(keep, keep)])
        if values[0] >= 1.0:
            break
        weight = np.abs(vectors[:, 0])
        group = [position for position in range(len(keep)) if weight[position] > 0.05 * weight.max()]
        vague = int(np.sum(values < 1.0))
        helping = [position for position in group if _vague_without(scaled, keep, position) < vague]
        # in order of what is least likely to be needed, among those whose absence leaves the others determined
        victim = min(helping or group, key=lambda position: (_ORDER.index(items[keep[position]].kind), -weight[position]))
        among = tuple(items[keep[position]].label for position in group)
        held.append(Held(items[keep[victim]].label, among, float(1.0 / np.sqrt(max(values[0], 1e-12)))))
        del keep[victim]
    return keep, tuple(held)


def widened(items: Sequence[Parameter], keep: Sequence[int], information: Array, covariance: Array) -> Array:
    """Covariance (k, k) of all unknowns when some were held: those kept are as uncertain as the held ones may be off.

    information : (k, k) of all of them, measurements and priors. covariance : that of the m at `keep` (m, m), given that the
    held ones are zero. A held one is as uncertain as its natural size and the measurements leave it; what it would have moved
    the kept ones by is carried over to them (consider covariance: Bierman, *Factorization Methods*, 1977, chapter VIII).
    """
    kept, held = list(keep), [number for number in range(len(items)) if number not in keep]
    size = np.array([item.size for item in items])
    scaled = information * np.outer(size, size)
    within, between = scaled[np.ix_(kept, kept)], scaled[np.ix_(kept, held)]
    moved = -np.linalg.solve(within, between)
    off = np.linalg.inv(scaled[np.ix_(held, held)] + between.T @ moved + np.eye(len(held)))
    found = np.zeros_like(scaled)
    found[np.ix_(kept, held)] = moved @ off
    found[np.ix_(held, kept)] = (moved @ off).T
    found[np.ix_(held, held)] = off
    found[np.ix_(kept, kept)] = moved @ off @ moved.T
    found *= np.outer(size, size)
    found[np.ix_(kept, kept)] += covariance
    return found


def _vague_without(scaled: Array, keep: list[int], position: int) -> int:
    """How many undetermined combinations remain when one of the kept parameters is held."""
    rest = [number for place, number in enumerate(keep) if place != position]
    return int(np.sum(np.linalg.eigvalsh(scaled[np.ix_(rest, rest)]) < 1.0)) if rest else 0
