"""A vortex lattice of its own, and its results in the layout of AVL's output.

Geometry axes: x aft, y right, z up. A small aeroplane of three flat surfaces: a swept wing with dihedral and ailerons, a
tailplane with an elevator and a fin with a rudder. Horseshoe vortices with legs along x; controls tilt the normals.
Reference for the method: Katz & Plotkin, Low-Speed Aerodynamics, section 12.3.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
AREA, CHORD, SPAN = 0.6, 0.2, 3.0
POINT = np.array([0.08, 0.0, 0.02])
CONTROLS = ("aileron", "elevator", "rudder")
AXES = ("CX", "CY", "CZ", "Cl", "Cm", "Cn")
_LAST = 1e6  # where the legs end


@dataclass(frozen=True)
class Lattice:
    """Panels: ends of the bound vortex (n, 3), control point, normal, hinge axis where a control tilts it, and which."""

    left: Array
    right: Array
    control: Array
    normal: Array
    tilt: dict[str, Array]
    inverse: Array


def _surface(
    root: Array, tip: Array, chord: float, strips: int, rows: int
) -> list[tuple[Array, ...]]:
    panels = []
    for k in range(strips):
        a, b = (root + (tip - root) * s / strips for s in (k, k + 1))
        for row in range(rows):
            x = chord * row / rows
            step = np.array([chord / rows, 0.0, 0.0])
            left, right = (end + np.array([x, 0, 0]) + 0.25 * step for end in (a, b))
            middle = 0.5 * (a + b) + np.array([x, 0, 0]) + 0.75 * step
            across = (b - a) * np.array([0, 1, 1])
            normal = np.cross(np.array([1.0, 0, 0]), across / np.linalg.norm(across))
            panels.append((left, right, middle, normal, across / np.linalg.norm(across), x / chord))
    return panels


@cache
def lattice() -> Lattice:
    strips, rows = 12, 4
    tips = np.array([0.06, 1.5, 0.12])
    wing_right = _surface(np.zeros(3), tips, 0.2, strips, rows)
    wing_left = [_mirrored(panel) for panel in wing_right]
    tail_right = _surface(np.array([0.9, 0, 0]), np.array([0.92, 0.3, 0]), 0.12, 6, rows)
    tail = tail_right + [_mirrored(panel) for panel in tail_right]
    fin = _surface(np.array([0.88, 0, 0.01]), np.array([0.94, 0, 0.3]), 0.14, 6, rows)
    panels = [*wing_right, *wing_left, *tail, *fin]
    left, right, middle, normal, hinge, where = (np.array(x) for x in zip(*panels, strict=True))
    aft = where >= 0.74
    side = np.arange(len(panels))
    on = {
        "aileron": np.where(side < len(wing_right), 1.0, -1.0)
        * aft
        * (side < 2 * len(wing_right))
        * (np.abs(middle[:, 1]) > 0.75),
        "elevator": 1.0
        * aft
        * (side >= 2 * len(wing_right))
        * (side < 2 * len(wing_right) + len(tail)),
        "rudder": 1.0 * aft * (side >= 2 * len(wing_right) + len(tail)),
    }
    # A trailing edge that goes down turns the panel about the axis across, to the right: the normal moves aft.
    # A rudder's trailing edge goes to the left of an aeroplane where the fin's normal (across x) says so.
    tilt = {name: weight[:, None] * np.cross(hinge, normal) for name, weight in on.items()}
    influence = np.einsum("ijk,ik->ij", _velocity(middle, left, right), normal)
    return Lattice(left, right, middle, normal, tilt, np.linalg.inv(influence))


def _mirrored(panel: tuple[Array, ...]) -> tuple[Array, ...]:
    left, right, middle, normal, hinge, where = panel
    flip = np.array([1.0, -1, 1])
    return (
        right * flip,
        left * flip,
        middle * flip,
        normal * flip,
        hinge * np.array([1, 1, -1.0]),
        where,
    )


def _segment(points: Array, a: Array, b: Array) -> Array:
    """Velocity (n, m, 3) at points (n, 3) of unit vortices from a to b (m, 3)."""
    r1, r2 = points[:, None] - a, points[:, None] - b
    cross = np.cross(r1, r2)
    n1, n2 = (np.linalg.norm(r, axis=-1) for r in (r1, r2))
    size = n1 * n2 * (n1 * n2 + np.sum(r1 * r2, axis=-1))
    close = np.linalg.norm(cross, axis=-1) < 1e-12
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(close, 0.0, (n1 + n2) / size / (4 * np.pi))
    return cross * factor[..., None]


def _velocity(points: Array, left: Array, right: Array) -> Array:
    far = np.array([_LAST, 0, 0])
    legs = _segment(points, left + far, left) + _segment(points, right, right + far)
    return legs + _segment(points, left, right)


def coefficients(velocity: Array, rates: Array, deflections: dict[str, float]) -> dict[str, float]:
    """Body-axis coefficients at a velocity (u, v, w)/V, rates (pb/2V, qc/2V, rb/2V) and deflections in degrees.

    They are over the dynamic pressure of V.
    """
    grid = lattice()
    wind = np.array([velocity[0], -velocity[1], velocity[2]])
    turn = 2 * rates / np.array([SPAN, CHORD, SPAN]) * np.array([-1, 1, -1])
    normal = grid.normal + sum(
        (np.deg2rad(angle) * grid.tilt[name] for name, angle in deflections.items()), np.zeros(3)
    )
    seen = wind - np.cross(turn, grid.control - POINT)
    strength = grid.inverse @ -np.sum(seen * normal, axis=1)
    middle = 0.5 * (grid.left + grid.right)
    induced = np.einsum("ijk,j->ik", _velocity(middle, grid.left, grid.right), strength)
    local = wind - np.cross(turn, middle - POINT) + induced
    force = 2 / AREA * strength[:, None] * np.cross(local, grid.right - grid.left)
    moment = np.sum(np.cross(middle - POINT, force), axis=0)
    x, y, z = force.sum(axis=0)
    return dict(
        zip(AXES, (-x, y, -z, -moment[0] / SPAN, moment[1] / CHORD, -moment[2] / SPAN), strict=True)
    )


def at(
    alpha: float, beta: float = 0.0, rates: Array | None = None, **deflections: float
) -> dict[str, float]:
    """Coefficients at angles in degrees, rates without dimension and deflections in degrees."""
    a, b = np.deg2rad([alpha, beta])
    velocity = np.array([np.cos(a) * np.cos(b), np.sin(b), np.sin(a) * np.cos(b)])
    return coefficients(velocity, np.zeros(3) if rates is None else rates, deflections)


def _with_lift(values: dict[str, float], alpha: float) -> dict[str, float]:
    """With lift, drag and moments about stability axes, as AVL names them."""
    ca, sa = np.cos(np.deg2rad(alpha)), np.sin(np.deg2rad(alpha))
    x, z, roll, yaw = (values[n] for n in ("CX", "CZ", "Cl", "Cn"))
    return {
        **values, "CL": x * sa - z * ca, "CD": -x * ca - z * sa,
        "Cl'": roll * ca + yaw * sa, "Cn'": yaw * ca - roll * sa,
    }  # fmt: skip


def avl_text(
    alpha: float, *, kind: str = "st", elevator: float = 0.0, pitch_rate: float = 0.0
) -> str:
    """The output of AVL's ST or SB for a run at an angle of attack and an elevator in degrees, and a qc/2V."""
    rates, set_to = np.array([0.0, pitch_rate, 0.0]), {"elevator": elevator}
    total = _with_lift(at(alpha, rates=rates, **set_to), alpha)
    step, small = 1e-4, 1e-4

    def about(function):
        up, down = function(step), function(-step)
        return {n: (up[n] - down[n]) / (2 * step) for n in up}

    a = np.deg2rad(alpha)
    turns = {"p": (np.cos(a), 0, np.sin(a)), "q": (0, 1, 0), "r": (-np.sin(a), 0, np.cos(a))}
    if kind == "sb":
        turns = {"p": (1, 0, 0), "q": (0, 1, 0), "r": (0, 0, 1)}
    by = {
        "a": about(
            lambda x: _with_lift(
                at(alpha + np.rad2deg(x), rates=rates, **set_to), alpha + np.rad2deg(x)
            )
        ),
        "b": about(lambda x: _with_lift(at(alpha, np.rad2deg(x), rates=rates, **set_to), alpha)),
        **{
            n: about(
                lambda x, t=turn: _with_lift(
                    at(alpha, rates=rates + x * np.array(t), **set_to), alpha
                )
            )
            for n, turn in turns.items()
        },
        **{
            f"d{k}": {
                n: value * step / small
                for n, value in about(
                    lambda x, c=control: _with_lift(
                        at(alpha, rates=rates, **{**set_to, c: set_to.get(c, 0.0) + x}), alpha
                    )
                ).items()
            }
            for k, control in enumerate(CONTROLS, 1)
        },
    }
    if kind == "sb":
        speed = np.array([np.cos(a), 0, np.sin(a)])
        for n, axis in zip("uvw", np.eye(3), strict=True):
            by[n] = about(lambda x, v=axis: coefficients(speed + x * v, rates, set_to))
    return _written(alpha, total, by, kind, elevator, pitch_rate)


def _written(alpha, total, by, kind, elevator, pitch_rate) -> str:
    lifts = abs(total["CL"]) > 1e-12
    span_efficiency = total["CL"] ** 2 / (np.pi * SPAN**2 / AREA * total["CD"]) if lifts else np.nan
    x, y, z = POINT
    head = f""" ---------------------------------------------------------------
 Vortex Lattice Output -- Total Forces

 Configuration: three flat surfaces
     # Surfaces =   4
     # Strips   =  42
     # Vortices = 168

  Sref = {AREA:.5g}       Cref = {CHORD:.5g}       Bref = {SPAN:.5g}
  Xref = {x:.5g}       Yref = {y:.5g}       Zref = {z:.5g}

 Standard axis orientation,  X fwd, Z down

 Run case: cruise

  Alpha = {alpha:10.5f}     pb/2V = {0:10.5f}     p'b/2V = {0:10.5f}
  Beta  = {0:10.5f}     qc/2V = {pitch_rate:10.5f}
  Mach  = {0:10.3f}     rb/2V = {0:10.5f}     r'b/2V = {0:10.5f}

  CXtot = {total["CX"]:12.8f}     Cltot = {total["Cl"]:12.8f}     Cl'tot = {total["Cl'"]:12.8f}
  CYtot = {total["CY"]:12.8f}     Cmtot = {total["Cm"]:12.8f}
  CZtot = {total["CZ"]:12.8f}     Cntot = {total["Cn"]:12.8f}     Cn'tot = {total["Cn'"]:12.8f}

  CLtot = {total["CL"]:12.8f}
  CDtot = {total["CD"]:12.8f}
  CDvis = {0:12.8f}     CDind = {total["CD"]:12.8f}
  CLff  = {total["CL"]:12.8f}     CDff  = {total["CD"]:12.8f}    | Trefftz
  CYff  = {total["CY"]:12.8f}         e = {span_efficiency:10.6f}    | Plane

   aileron         = {0:10.5f}
   elevator        = {elevator:10.5f}
   rudder          = {0:10.5f}

 ---------------------------------------------------------------

"""
    if kind == "st":
        rows = {
            " z' force CL |": "CL",
            " y  force CY |": "CY",
            " x' mom.  Cl'|": "Cl'",
            " y  mom.  Cm |": "Cm",
        }
        rows |= {" z' mom.  Cn'|": "Cn'"}
        blocks = ["ab", "pqr"]
        title, headers = (
            " Stability-axis derivatives...",
            ["alpha                beta", "roll rate  p'  pitch rate  q'  yaw rate  r'"],
        )
    else:
        rows = {f" {axis} force |": axis for axis in AXES}
        blocks = ["uvw", "pqr"]
        title, headers = (
            " Geometry-axis derivatives...",
            [
                "axial   vel. u      sideslip vel. v     normal  vel. w",
                "roll rate  p  pitch rate  q  yaw rate  r",
            ],
        )
    parts = [title]
    for header, letters in zip(headers, blocks, strict=True):
        parts += [
            "",
            f"                  {header}",
            "                  ----------------    ----------------",
        ]
        parts += [
            _row(label, axis, [(n, by[n][axis]) for n in letters]) for label, axis in rows.items()
        ]
    names = "     ".join(f"{name}      d{k}" for k, name in enumerate(CONTROLS, 1))
    parts += [
        "",
        f"                  {names}",
        "                  ----------------    ----------------",
    ]
    parts += [
        _row(label, axis, [(f"d{k}", by[f"d{k}"][axis]) for k in (1, 2, 3)])
        for label, axis in rows.items()
    ]
    if kind == "st":
        parts += [
            "",
            " Neutral point  Xnp =   0.150000",
            "",
            " Clb Cnr / Clr Cnb  =   7.674270    (  > 1 if spirally stable )",
        ]
    return head + "\n".join(parts) + "\n"


def _row(label: str, axis: str, values: list[tuple[str, float]]) -> str:
    plain = axis.replace("'", "")
    return label + "".join(f"   {plain + n:>5} = {value:12.8f} " for n, value in values)
