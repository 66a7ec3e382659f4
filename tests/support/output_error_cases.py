"""Records and models of published output-error analyses."""

import numpy as np
import scipy.io

from aerodb.estimation import Parameter, Parameters, StateSpace, TimeHistory, state_space

#: Jategaonkar's data pack, AilRud1: two states, beta a measured input.
ATTAS_LATERAL = {
    "Lp": -2.06748, "Lr": 1.02929, "Lda": -6.30585, "Ldr": 1.1452, "Lbeta": -3.84437, "L0": 0.013848,
    "Np": -0.18385, "Nr": -0.48560, "Nda": -0.39121, "Ndr": -1.7609, "Nbeta": 3.03138,
    "N0": 0.034585,
}  # fmt: skip

#: Klein & Morelli, SIDPAC v2.0, Twin Otter f1_017.
TWIN_OTTER_LATERAL = {
    "CY_beta": -0.8646, "CY_r": 0.9331, "CY_dr": 0.3800,
    "Cl_beta": -0.11959, "Cl_p": -0.58590, "Cl_r": 0.18888, "Cl_da": -0.22818, "Cl_dr": 0.04221,
    "Cn_beta": 0.08638, "Cn_p": -0.06441, "Cn_r": -0.19059, "Cn_da": -0.00298, "Cn_dr": -0.13548,
}  # fmt: skip

#: The same, longitudinal (totter_demo).
TWIN_OTTER_LONGITUDINAL = {
    "CZ_alpha": -6.760, "CZ_de": -0.409, "CZ_0": -0.448,
    "Cm_alpha": -1.543, "Cm_q": -33.25, "Cm_de": -1.835,
}  # fmt: skip

_DEG = np.pi / 180.0


def attas_records(path) -> list[TimeHistory]:
    """The two halves of AilRud1, which a gap in time separates."""
    file = scipy.io.loadmat(path)
    data = next(values for name, values in file.items() if not name.startswith("_"))
    column = {"beta": 14, "p": 7, "r": 9, "pdot": 17, "rdot": 19, "dr": 30}
    known = {name: data[:, j - 1] * _DEG for name, j in column.items()}
    known["da"] = 0.5 * (data[:, 28] - data[:, 27]) * _DEG
    gap = int(np.argmax(np.diff(data[:, 0]))) + 1
    return [
        TimeHistory(
            name,
            data[part, 0],
            {each: known[each][part] for each in ("da", "dr", "beta")},
            {each: known[each][part] for each in ("pdot", "rdot", "p", "r")},
        )
        for name, part in (("aileron", slice(0, gap)), ("rudder", slice(gap, None)))
    ]


def attas_model() -> StateSpace:
    """Roll and yaw rate, and their derivatives."""
    start = dict.fromkeys(ATTAS_LATERAL, 0.0) | {"Lp": -1.0, "Nr": -1.0}
    roll, yaw = ["Lda", "Ldr", "Lbeta"], ["Nda", "Ndr", "Nbeta"]
    rates = [["Lp", "Lr"], ["Np", "Nr"]]
    return state_space(
        ["p", "r"],
        ["da", "dr", "beta"],
        ["pdot", "rdot", "p", "r"],
        Parameters(tuple(Parameter(name, value) for name, value in start.items())),
        a=rates,
        b=[roll, yaw],
        c=[*rates, [1, 0], [0, 1]],
        d=[roll, yaw, [0, 0, 0], [0, 0, 0]],
        state_bias=["L0", "N0"],
        output_bias=["L0", "N0", 0, 0],
    )


def twin_otter_lateral(path) -> tuple[StateSpace, TimeHistory]:
    """Dimensionless derivatives at the mean flight condition; a constant in every equation."""
    data = scipy.io.loadmat(path, variable_names=["fdata"])["fdata"]
    column = lambda number: data[:, number - 1]  # noqa: E731
    mean = lambda number: float(column(number).mean())  # noqa: E731
    speed, pressure, mass, area, span, g = *(mean(j) for j in (2, 27, 48, 77, 78)), 32.174
    ixx, izz, ixz = (mean(j) for j in (49, 51, 52))
    alpha, theta = mean(4) * _DEG, mean(9) * _DEG
    roll, half = pressure * area * span / (ixx * izz - ixz**2), span / (2.0 * speed)
    force = pressure * area / mass

    def row(weights, variables):
        """Sum of the coefficients' derivatives for each variable, with a known part."""
        entries = []
        for name, scale, known in variables:
            terms = [
                f"{weight * scale:+.15e}*{axis}_{name}"
                for axis, weight in weights.items()
                if f"{axis}_{name}" in TWIN_OTTER_LATERAL
            ]
            entries.append("".join([f"{known:.15e}", *terms]))
        return entries

    side = {"CY": force / speed}
    ways = (side, {"Cl": roll * izz, "Cn": roll * ixz}, {"Cl": roll * ixz, "Cn": roll * ixx})
    known = ([0.0, np.sin(alpha), -np.cos(alpha)], [0.0] * 3, [0.0] * 3)
    motion = [
        row(way, zip(("beta", "p", "r"), (1.0, half, half), own, strict=True))
        for way, own in zip(ways, known, strict=True)
    ]
    surfaces = (("da", 1.0, 0.0), ("dr", 1.0, 0.0))
    lateral = {"CY": force / g}
    constants = [f"{name}_0" for name in ("betadot", "pdot", "rdot", "phidot", "ay")]
    start = {**dict.fromkeys(TWIN_OTTER_LATERAL, 0.0), **dict.fromkeys(constants, 0.0)}
    start |= {"CY_beta": -0.5, "Cl_p": -0.5, "Cl_beta": -0.1, "Cn_beta": 0.1, "Cn_r": -0.1}
    model = state_space(
        ["beta", "p", "r", "phi"],
        ["da", "dr"],
        ["beta", "p", "r", "phi", "ay"],
        Parameters(tuple(Parameter(name, value) for name, value in start.items())),
        a=[
            [*motion[0], g / speed * float(np.cos(theta))],
            [*motion[1], 0],
            [*motion[2], 0],
            [0, 1, float(np.tan(theta)), 0],
        ],
        b=[*(row(way, surfaces) for way in ways), [0, 0]],
        c=[
            *np.eye(4).tolist(),
            [*row(lateral, (("beta", 1.0, 0.0), ("p", half, 0.0), ("r", half, 0.0))), 0],
        ],
        d=[*np.zeros((4, 2)).tolist(), row(lateral, surfaces)],
        state_bias=constants[:4],
        output_bias=[0, 0, 0, 0, "ay_0"],
    )
    numbers = {"beta": 3, "p": 5, "r": 7, "phi": 8, "da": 15, "dr": 16}
    values = {name: column(j) * _DEG for name, j in numbers.items()} | {"ay": column(12)}
    record = TimeHistory(
        "f1_017",
        column(1),
        {name: values[name] for name in ("da", "dr")},
        {name: values[name] for name in model.outputs},
    )
    return model, record


def twin_otter_longitudinal(path, lag: float) -> tuple[StateSpace, TimeHistory]:
    """Short period at the mean flight condition, gravity by the measured attitude; the angle of
    attack is taken `lag` [s] earlier than recorded."""
    data = scipy.io.loadmat(path, variable_names=["fdata"])["fdata"]
    column = lambda number: data[:, number - 1]  # noqa: E731
    mean = lambda number: float(column(number).mean())  # noqa: E731
    speed, pressure, mass, inertia = (mean(j) for j in (2, 27, 48, 50))
    area, chord, g = mean(77), mean(79), 32.174
    force, moment = pressure * area / mass, pressure * area * chord / inertia
    time = column(1)
    alpha = np.interp(time + lag, time, column(4)) * _DEG
    motion = f"{force / speed:.15e}*CZ_"
    pitch, load = f"{moment:.15e}*Cm_", f"{force / g:.15e}*CZ_"
    start = dict.fromkeys([*TWIN_OTTER_LONGITUDINAL, "Cm_0"], 0.0)
    start |= {"CZ_alpha": -5.0, "Cm_alpha": -1.0, "Cm_q": -20.0}
    model = state_space(
        ["alpha", "q"],
        ["de", "gravity"],
        ["alpha", "q", "az"],
        Parameters(tuple(Parameter(name, value) for name, value in start.items())),
        a=[
            [f"{motion}alpha", 1],
            [f"{pitch}alpha", f"{moment * chord / (2.0 * speed):.15e}*Cm_q"],
        ],
        b=[[f"{motion}de", 1], [f"{pitch}de", 0]],
        c=[[1, 0], [0, 1], [f"{load}alpha", 0]],
        d=[[0, 0], [0, 0], [f"{load}de", 0]],
        state_bias=[f"{motion}0", f"{pitch}0"],
        output_bias=[0, 0, f"{load}0"],
    )
    gravity = g / column(2) * np.cos(column(9) * _DEG - alpha)
    return model, TimeHistory(
        "demo",
        time,
        {"de": column(14) * _DEG, "gravity": gravity},
        {"alpha": alpha, "q": column(6) * _DEG, "az": column(13)},
    )
