"""A fault of a channel, and the size with which it is likeliest on all axes on which it acts."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from aerodb.conditioning import SETTLED
from aerodb.estimation import samples_per_independent
from aerodb.nomenclature import is_surface
from aerodb.support import HALF, MINUTE, NEARLY_ALL, NOTABLE, SUBSTANTIAL, Array
from aerodb.suspicions.begin import LEFT, explained_from, explained_within
from aerodb.suspicions.evidence import ERRORS, EXPLAINED, LATE, LIKELIER
from aerodb.suspicions.surfaces import role_of

#: Least change of an effect that is said, as a share of the database's. Speed and flaps change it
#: by less within a flight (`changing.RATIOS`).
LEAST_GAIN: Final = NOTABLE
#: Least change of a zero that is said [rad]: rigging and a tunnel's trim are known to a degree;
#: fuel moves a CG by as much.
LEAST_ZERO: Final = float(np.deg2rad(1.0))
#: The same of an accelerometer [m/s2]: three times what its zero may be when it is switched on.
LEAST_OFFSET: Final = 0.3
#: Least change of a delay within a flight that is said [s]: a logger's buffer makes less.
LEAST_DELAY: Final = 0.05
#: Least half of a play that is said [rad]: a sound linkage has half of it.
LEAST_PLAY: Final = float(np.deg2rad(0.1))
#: Least share of what parts a vane from the motion that its axes do not show: they feel gusts.
LEAST_MOTION: Final = HALF
#: Samples are averaged to this step [s]: what jumps does so within two of them.
STEP: Final = 0.1
#: Least share that a change of gain explains of what is left of the axis on which it acts most.
#: Beside right flights a database that lacks an effect makes .38 look like one.
EXPLAINED_GAIN: Final = 0.4
#: The same of a zero, and of what changes evenly over the flight: an aileron in coarse steps makes
#: .11 look like one.
EXPLAINED_ZERO: Final = EXPLAINED
#: The same of one that is likelier than every other fault: none of 700 flights without a fault has
#: one beyond chance.
EXPLAINED_LIKELIEST: Final = 0.05
#: The same of a delay, on all axes on which it is seen. A wing that bends makes .22 look like one
#: on one axis; none of 700 flights without a fault has one on two.
EXPLAINED_DELAY: Final = SUBSTANTIAL
#: The same of a play: gusts make .26 look like one.
EXPLAINED_PLAY: Final = 0.35
#: The same of a vane that leaves the motion: noise of five times what is declared makes none, as it
#: does so all the time.
EXPLAINED_MOTION: Final = SUBSTANTIAL
#: Share of what is left of an axis from which on a fault is said to be seen there.
SEEN: Final = EXPLAINED
#: Times at which a stretch may begin or end in a first search.
STRETCHES: Final = 30
#: Longest delay that is said [s] where it does not explain nearly all: its column is of first
#: order, and a swing takes a few seconds.
MOST_DELAY: Final = 1.0
#: Rates, whose constant delay is told by kinematics: gusts imitate it beside a database.
RATES: Final = ("p", "q", "r")
#: Accelerometers of which an axis shows the zero.
ACCELERATIONS: Final = ("ay", "az")
#: When a fault acts that begins at no sample, in words.
ALWAYS: Final = "all the time"
EVENLY: Final = "over the whole flight"
#: Kinds of faults that act by a shape of their own, all the time.
SHAPES: Final = ("play", "still", "fast")
_LEAST: Final = {
    "gain": LEAST_GAIN,
    "zero": LEAST_ZERO,
    "delay": LEAST_DELAY,
    "play": LEAST_PLAY,
    "motion": LEAST_MOTION,
    "still": LEAST_MOTION,
    "fast": LEAST_MOTION,
}
_EXPLAINED: Final = {
    "gain": EXPLAINED_GAIN,
    "zero": EXPLAINED_ZERO,
    "delay": EXPLAINED_DELAY,
    "play": EXPLAINED_PLAY,
    "motion": EXPLAINED_MOTION,
}


@dataclass(frozen=True, eq=False)
class Axis:
    """One axis: what the database leaves of it (m,), and what motion leaves of that (m,);
    orthonormal columns (m, k) of the motion; what they explain of the database's coefficient (m,);
    how many samples are independent."""

    rest: Array
    left: Array
    basis: Array
    whole: Array
    independent: float

    def own(self, values: Array) -> Array:
        """What motion leaves of `values` (m,)."""
        return np.asarray(values - self.explained(values))

    def explained(self, values: Array) -> Array:
        """What motion explains of `values` (m,)."""
        return np.asarray(self.basis @ (self.basis.T @ values))

    def beside(self, values: Array) -> "Axis":
        """The axis with one more column (m,) among the motion."""
        own = self.own(values)
        size = float(own @ own)
        if not size > LEFT * float(values @ values):
            return self
        wider = replace(self, basis=np.column_stack([self.basis, own / np.sqrt(size)]))
        return replace(wider, left=wider.own(self.left))

    def with_fault(self, fault: "Fault", name: str) -> "Axis":
        """The axis of this name with the samples that are independent once a fault is taken off."""
        left = self.left
        if fault.shares.get(name, 0.0) > 0.0:
            left = left - fault.size * self.own(fault.columns[name])
        return replace(self, independent=len(left) / samples_per_independent(left))


@dataclass(frozen=True, eq=False)
class Fault:
    """A fault of a channel: what changes, and when, in words; axis -> what it adds per unit of the
    change (m,) and the share that it explains of what is left, the axis on which it acts most
    first; its size, the standard error, and the gain of the logarithm of the likelihood; whether it
    begins and ends within the flight."""

    channel: str
    what: str
    when: str
    columns: Mapping[str, Array]
    shares: Mapping[str, float]
    size: float
    error: float
    likelier: float
    is_stretch: bool = False

    @property
    def axes(self) -> list[str]:
        """Axes on which it is seen: the one on which it acts most, and others."""
        first = next(iter(self.shares))
        return [axis for axis, share in self.shares.items() if share > SEEN or axis == first]

    @property
    def is_rival_only(self) -> bool:
        """Whether nothing is said of it alone. Damping is small: any constant looks like a gyro's
        zero. A lift that changes with Mach number looks like that of a flap or speed brake."""
        other = is_surface(self.channel) and not role_of(self.channel)
        return self.what == "zero" and (self.channel in RATES or other)

    def is_large(self, likeliest: bool, alone: bool, beyond: bool) -> bool:
        """Whether its share and its size are large enough to be said. likeliest : of all faults.
        alone : no constant fault is said of the flight, beside which others look as if they grew.
        beyond : likelier than all that a database may lack. A sensor's noise makes its gain and its
        zero seem to change where its motion does."""
        if self.is_rival_only or not abs(self.size) > self.least:
            return False
        share = next(iter(self.shares.values()))
        if self.what == "delay" and abs(self.size) > MOST_DELAY and share < NEARLY_ALL:
            return False
        if beyond and self._is_no_aerodynamics:
            return True
        if self.what not in _EXPLAINED:  # told so alone
            return False
        least = _EXPLAINED[self.what]
        clear = beyond or is_surface(self.channel)
        if clear and (self.what == "zero" or (self.when == EVENLY and alone)):
            least = EXPLAINED_LIKELIEST if likeliest else EXPLAINED_ZERO
        if self.what == "delay" and share > SEEN:  # axes that agree about it count together
            share = 1.0 - float(np.prod([1.0 - s for s in self.shares.values() if s > SEEN]))
        return share > least and (clear or (self.what != "zero" and self.when != EVENLY))

    @property
    def _is_no_aerodynamics(self) -> bool:
        """Whether only a channel is so: late, loose, still or wild. Nothing is told so of a
        stretch, which gusts are as long as, nor of vanes that are late, as flow is."""
        if self.is_stretch or self.what not in ("delay", *SHAPES):
            return False
        sign = {"play": -1.0, "fast": 1.0}.get(self.what, 0.0)
        return sign * self.size >= 0.0 and (is_surface(self.channel) or self.what != "delay")

    def is_borne_out(self, axes: Mapping[str, Axis]) -> bool:
        """Whether it lowers what the database leaves as it is, where motion imitates nearly all of
        it. One that raises that would need errors of the database that hide it, and noise decides
        its size."""
        change = 0.0
        for axis in self.axes:
            rest, column = axes[axis].rest, self.columns[axis]
            own = axes[axis].own(column)
            if not float(own @ own) < MINUTE * len(column) * float(np.var(column)):
                return True
            change += float(np.var(rest - self.size * column) / np.var(rest)) - 1.0
        return change < 0.0

    def is_likelier(self, axes: Mapping[str, Axis], most: Mapping[str, float]) -> bool:
        """Whether it is likelier than what a database may lack, of the likeliest kind on each axis
        where the fault is seen. most : axis -> the share that this explains of what is left."""

        def gain(shares: Mapping[str, float]) -> float:
            left = {axis: np.log(max(1.0 - shares[axis], 1e-12)) for axis in self.axes}
            return float(sum(-0.5 * axes[axis].independent * v for axis, v in left.items()))

        return gain(self.shares) > gain(most) + LIKELIER

    @property
    def least(self) -> float:
        """The size up to which nothing is said."""
        if self.what == "zero" and self.channel in ACCELERATIONS:
            return LEAST_OFFSET
        return LATE if (self.what, self.when) == ("delay", ALWAYS) else _LEAST[self.what]

    def is_certain(self, tried: int) -> bool:
        """Whether it is beyond chance; each sample is tried where one is sought."""
        wanted = LIKELIER + float(np.log(tried))
        if self.when not in (ALWAYS, EVENLY):
            wanted += float(np.log(len(next(iter(self.columns.values())))))
        # A delay is there or not; how much of one is a servo's is no law.
        beyond = 0.0 if (self.what, self.when) == ("delay", ALWAYS) else self.least
        certain = abs(self.size) > max(self.least, beyond + ERRORS * self.error)
        return certain and self.likelier > wanted


def _settled(samples: int) -> int:
    """How many of the samples of a flight, at both ends, no fault begins or ends among."""
    return min(round(SETTLED / STEP), samples // 3)


def makers(slopes: Mapping[str, float], moving: Mapping[str, Array]) -> list[str]:
    """The channels of which the database makes most of an axis, the largest part first.

    slopes : variable -> dC/dvariable. moving : channel -> (m,), in the unit of its slope."""
    parts = {n: abs(slopes[n]) * float(np.std(moving[n])) for n in slopes if n in moving}
    least = NOTABLE * float(np.sqrt(sum(part**2 for part in parts.values())))
    return [n for n in sorted(parts, key=lambda n: -parts[n]) if parts[n] >= least]


def first_sample(axes: Mapping[str, Axis], added: Mapping[str, Array]) -> int:
    """The sample from which on a fault explains most, if each axis had a size of its own."""
    gained: Array | float = 0.0
    for axis, values in added.items():
        whole = max(float(axes[axis].left @ axes[axis].left), 1e-300)
        share = explained_from(values, axes[axis].basis, axes[axis].left) / whole
        gained = gained - axes[axis].independent * np.log(np.maximum(1.0 - share, 1e-12))
    inner = np.asarray(gained)
    edge = _settled(len(inner))
    return edge + int(np.argmax(inner[edge : len(inner) - edge]))


def likeliest_stretch(axes: Mapping[str, Axis], added: Mapping[str, Array]) -> tuple[int, int]:
    """First sample of the stretch in which a fault explains most, and of what follows it, if each
    axis had a size of its own."""
    n = len(next(iter(added.values())))
    edge = _settled(n)
    starts = ends = np.linspace(edge, n - edge, STRETCHES, dtype=int)
    for _ in range(2):  # coarse, then near the best
        gained = np.zeros((len(starts), len(ends)))
        for axis, values in added.items():
            whole = max(float(axes[axis].left @ axes[axis].left), 1e-300)
            found = explained_within(values, axes[axis].basis, axes[axis].left, starts, ends)
            share = np.where(ends > starts[:, None], found, 0.0) / whole
            gained -= axes[axis].independent * np.log(np.maximum(1.0 - share, 1e-12))
        first, last = (int(k) for k in np.unravel_index(np.argmax(gained), gained.shape))
        begin, end = int(starts[first]), int(ends[last])
        width = (n - 2 * edge) // STRETCHES + 1
        near = np.linspace(-width, width, STRETCHES + 1, dtype=int)
        starts, ends = (np.clip(at + near, edge, n - edge) for at in (begin, end))
    return begin, max(end, begin + 1)


def sized(
    axes: Mapping[str, Axis], name: str, what: str, when: str, columns: Mapping[str, Array]
) -> Iterator[Fault]:
    """The fault with the size that makes all axes together likeliest; none where motion leaves
    nothing of it."""
    parts: list[tuple[str, float, float, float]] = []
    for axis, values in columns.items():
        own, left = axes[axis].own(values), axes[axis].left
        size, whole = float(own @ own), float(left @ left)
        if size > LEFT * float(values @ values) and whole > 0.0:
            parts.append((axis, size / whole, float(own @ left) / whole, axes[axis].independent))
    if not parts:
        return
    names, (squares, common, independent) = (
        [p[0] for p in parts],
        np.array([p[1:] for p in parts]).T,
    )

    def unexplained(size: float) -> Array:
        return np.maximum(1.0 + size * (size * squares - 2.0 * common), 1e-12)

    def gain(size: float) -> float:
        return -0.5 * float(independent @ np.log(unexplained(size)))

    size = max((common / squares).tolist(), key=gain)
    for _ in range(5):  # each axis with the weight that its rest has
        weights = independent / unexplained(size)
        size = float(weights @ common) / float(weights @ squares)
    shares = 1.0 - unexplained(size)
    error = float(1.0 / np.sqrt((independent / unexplained(size)) @ squares))
    shared = {names[k]: float(shares[k]) for k in np.argsort(-squares)}
    yield Fault(name, what, when, columns, shared, size, error, gain(size))
