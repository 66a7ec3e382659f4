"""Files in the layouts of VSPAERO, XFLR5 and Datcom, with the numbers of the tests' lattice."""

import numpy as np

from tests.support import vortex_lattice as lattice

STEP = 1e-4
CASES = ("Base_Aero", "Alpha", "Beta", "Roll__Rate", "Pitch_Rate", "Yaw___Rate", "Mach")
GROUPS = ("Ailerons", "Elevator", "Rudder")
RATES = {"p": (1, 0, 0), "q": (0, 1, 0), "r": (0, 0, 1)}


def wind(values: dict[str, float], alpha: float, beta: float) -> dict[str, float]:
    """Lift, drag and side force along wind axes, of forces on body axes; angles in degrees."""
    a, b = np.deg2rad([alpha, beta])
    ahead = np.array([np.cos(a) * np.cos(b), np.sin(b), np.sin(a) * np.cos(b)])
    right = np.array([-np.cos(a) * np.sin(b), np.cos(b), -np.sin(a) * np.sin(b)])
    down = np.array([-np.sin(a), 0, np.cos(a)])
    force = np.array([values["CX"], values["CY"], values["CZ"]])
    return {"CL": -force @ down, "CD": -force @ ahead, "CS": force @ right}


def slopes(alpha: float, beta: float = 0.0) -> dict[str, dict[str, float]]:
    """Derivatives on body axes by alpha and beta, the rates and the controls, per rad each."""

    def about(function):
        up, down = function(STEP), function(-STEP)
        return {n: (up[n] - down[n]) / (2 * STEP) for n in up}

    degrees = np.rad2deg
    found = {
        "Alpha": about(lambda x: lattice.at(alpha + degrees(x), beta)),
        "Beta": about(lambda x: lattice.at(alpha, beta + degrees(x))),
    }
    for name, turn in RATES.items():
        found[name] = about(
            lambda x, t=turn: lattice.at(alpha, beta, rates=x * np.array(t, dtype=float))
        )
    for control in lattice.CONTROLS:
        found[control] = about(lambda x, c=control: lattice.at(alpha, beta, **{c: degrees(x)}))
    return found


def stab(alpha: float, beta: float = 0.0) -> str:
    """A `.stab` of VSPAERO at an angle of attack and a sideslip in degrees."""
    base, by = lattice.at(alpha, beta), slopes(alpha, beta)
    by = {**by, "Mach": dict.fromkeys(base, 0.0), "U": dict.fromkeys(base, 0.0)}
    x, y, z = lattice.POINT
    head = {
        "Sref_": lattice.AREA, "Cref_": lattice.CHORD, "Bref_": lattice.SPAN, "Xcg_": x, "Ycg_": y, "Zcg_": z,
        "Mach_": 0.1, "AoA_": alpha, "Beta_": beta, "Rho_": 1.2, "Vinf_": 20.0,
        "Roll__Rate": 0.0, "Pitch_Rate": 0.0, "Yaw___Rate": 0.0,
    }  # fmt: skip
    text = ["*" * 60, "", "# Name                   Value      Units"]
    text += [f"{n:<20} {value:12.7f} {'no_unit'}" for n, value in head.items()]
    text += ["#", "Case                   Delta    Units         CFx          CFy  ...", "#"]
    for case in (*CASES, *GROUPS):
        text.append(f"{case:<22} +1.000 {'deg':<9}" + "".join(f" {0.0:12.7f}" for _ in range(12)))
    columns = ["Alpha", "Beta", "p", "q", "r", "Mach", "U", *lattice.CONTROLS]
    named = [*columns[:7], *(f"ConGrp_{k}" for k in (1, 2, 3))]
    text += [
        "#",
        "#             Base    Derivative:",
        "Coef          Total        " + "  ".join(named),
    ]
    text += ["#              -           per", "#"]
    rows = {
        "CFx": ("CX", -1),
        "CFy": ("CY", 1),
        "CFz": ("CZ", -1),
        "CMx": ("Cl", -1),
        "CMy": ("Cm", 1),
        "CMz": ("Cn", -1),
    }
    rows |= {"CMl": ("Cl", 1), "CMm": ("Cm", 1), "CMn": ("Cn", 1)}
    for row, (axis, sign) in rows.items():
        values = [base[axis], *(by[n][axis] for n in columns)]
        text.append(f"{row:<7}" + " ".join(f"{sign * v:14.9f}" for v in values))
    text += [
        "#",
        "# Result                  Value      Units",
        "SM                      0.2500000 no_unit",
    ]
    return "\n".join(text) + "\n"


def polar(alphas: tuple[float, ...], betas: tuple[float, ...]) -> str:
    """A `.polar` of VSPAERO over angles in degrees."""
    names = "Beta Mach AoA Re/1e6 CLo CLi CLtot CDo CDi CDtot CDt CDtott CStot L/D E CFx CFy CFz CMx CMy CMz"
    text = ["  ".join(f"{n:>13}" for n in names.split())]
    for beta in betas:
        for alpha in alphas:
            c = lattice.at(alpha, beta)
            w = wind(c, alpha, beta)
            row = [
                beta,
                0.1,
                alpha,
                0.3,
                0,
                w["CL"],
                w["CL"],
                0,
                w["CD"],
                w["CD"],
                0,
                w["CD"],
                w["CS"],
                9.0,
                0.9,
            ]
            row += [-c["CX"], c["CY"], -c["CZ"], -c["Cl"], c["Cm"], -c["Cn"]]
            text.append("  ".join(f"{v:13.9f}" for v in row))
    return "\n".join(text) + "\n"


def xflr5(alphas: tuple[float, ...], betas: tuple[float, ...] = (0.0,), comma: bool = False) -> str:
    """A polar of XFLR5 over angles in degrees; the moments as of a code whose yaw is positive to the left."""
    names = [
        "alpha",
        "Beta",
        "CL",
        "CDi",
        "CDv",
        "CD",
        "CY",
        "Cl",
        "Cm",
        "Cn",
        "Cni",
        "QInf",
        "XCP",
    ]
    between = ", " if comma else "  "
    text = [
        "xflr5 v6.59",
        "",
        " Calculated polar for: plane",
        "",
        "Freestream speed :   20.000 m/s",
        "",
    ]
    text += [between.join(f"{n:>9}" for n in names), ""]
    for beta in betas:
        for alpha in alphas:
            c = lattice.at(alpha, beta)
            a = np.deg2rad(alpha)
            lift = c["CX"] * np.sin(a) - c["CZ"] * np.cos(a)
            drag = -c["CX"] * np.cos(a) - c["CZ"] * np.sin(a)
            row = [
                alpha,
                beta,
                lift,
                drag,
                0.0,
                drag,
                c["CY"],
                c["Cl"],
                c["Cm"],
                -c["Cn"],
                0.0,
                20.0,
                0.1,
            ]
            text.append(between.join(f"{v:9.6f}" for v in row))
    return "\n".join(text) + "\n"


def xflr5_stability(alpha: float) -> str:
    """Derivatives in the log of a stability analysis of XFLR5 at an angle in degrees; the control per degree."""
    by, a = slopes(alpha), np.deg2rad(alpha)
    ca, sa = np.cos(a), np.sin(a)

    def stable(v: dict[str, float]) -> dict[str, float]:
        return {
            "X": v["CX"] * ca + v["CZ"] * sa, "Y": v["CY"], "Z": v["CZ"] * ca - v["CX"] * sa,
            "L": v["Cl"] * ca + v["Cn"] * sa, "M": v["Cm"], "N": v["Cn"] * ca - v["Cl"] * sa,
        }  # fmt: skip

    along, about, pitch = stable(by["Alpha"]), stable(by["Beta"]), stable(by["q"])
    roll = stable({n: by["p"][n] * ca + by["r"][n] * sa for n in lattice.AXES})
    yaw = stable({n: by["r"][n] * ca - by["p"][n] * sa for n in lattice.AXES})
    control = {n: np.deg2rad(v) for n, v in stable(by["elevator"]).items()}
    rows = [
        ("Xw", "Cxa", along["X"]),
        ("Xq", "Cxq", pitch["X"]),
        ("Zw", "CZa", along["Z"]),
        ("Zq", "CZq", pitch["Z"]),
    ]
    rows += [("Mw", "Cma", along["M"]), ("Mq", "Cmq", pitch["M"])]
    lateral = [
        (f"{n}{s}", f"C{n if n == 'Y' else n.lower()}{b}", v[n])
        for n in "YLN"
        for s, b, v in (("v", "b", about), ("p", "p", roll), ("r", "r", yaw))
    ]
    text = ["      Longitudinal derivatives"]
    text += [f"      {one}  = {9.9:11.5g}         {two}  = {v:13.7g}" for one, two, v in rows]
    text += ["      Neutral Point position = 0.15 m", "", "      Lateral derivatives"]
    text += [f"      {one}  = {9.9:11.5g}         {two}  = {v:13.7g}" for one, two, v in lateral]
    text += ["      Control derivatives", "      Elevator"]
    text += [f"      {n}de = {9.9:11.5g}         C{n}de = {v:13.7g}" for n, v in control.items()]
    return "\n".join(text) + "\n"


def datcom(alphas: tuple[float, ...], per: str = "DEGREE", unit: str = "M") -> str:
    """Output of Datcom over angles in degrees, lateral derivatives about stability axes; lengths in `unit`."""
    size = {"M": 1.0, "FT": 1 / 0.3048}[unit]
    factor = np.deg2rad(1.0) if per == "DEGREE" else 1.0
    x, _, z = lattice.POINT * size
    head = "1          AUTOMATED STABILITY AND CONTROL METHODS PER APRIL 1976 VERSION OF DATCOM\n"

    def page(kind: str, configuration: str) -> str:
        return (
            f"{head}          {kind}\n          {configuration}\n\n"
            " -------- FLIGHT CONDITIONS --------   ------ REFERENCE DIMENSIONS ------\n"
            "  MACH    ALTITUDE   VELOCITY    PRESSURE    TEMPERATURE     REYNOLDS      REF.     REFERENCE LENGTH     MOMENT REF. CENTER\n"
            " NUMBER                                                       NUMBER       AREA       LONG.     LAT.       HORIZ     VERT\n"
            f"             {unit}        {unit}/SEC      N/{unit}**2       DEG K          1/{unit}        {unit}**2       {unit}        {unit}         {unit}       {unit}\n"
            f"0 0.100                                                  4.0E+05   {lattice.AREA * size**2:9.5f}"
            f" {lattice.CHORD * size:9.5f} {lattice.SPAN * size:9.5f} {x:9.5f} {z:9.5f}\n"
        )  # fmt: skip

    static, dynamic = [], []
    for k, alpha in enumerate(alphas):
        c, by = lattice.at(alpha), slopes(alpha)
        a = np.deg2rad(alpha)
        ca, sa = np.cos(a), np.sin(a)

        def stable(values, ca=ca, sa=sa):
            return {
                **values, "Cl": values["Cl"] * ca + values["Cn"] * sa, "Cn": values["Cn"] * ca - values["Cl"] * sa,
                "CL": values["CX"] * sa - values["CZ"] * ca,
            }  # fmt: skip

        beta, pitch = stable(by["Beta"]), stable(by["q"])
        roll = stable({n: by["p"][n] * ca + by["r"][n] * sa for n in c})
        yaw = stable({n: by["r"][n] * ca - by["p"][n] * sa for n in c})
        lift, drag = stable(c)["CL"], -c["CX"] * ca - c["CZ"] * sa
        blank = k > 0
        sides = [
            f"{beta[n] * factor:.4E}" if n == "Cl" or not blank else "" for n in ("CY", "Cn", "Cl")
        ]
        cells = [f"{alpha:.1f}", f"{drag:.5f}", f"{lift:.5f}", f"{c['Cm']:.5f}"]
        cells += ["", "", "", "", "", *sides]
        wide = [7, 9, 9, 10, 8, 9, 9, 13, 13, 13, 13, 13]
        static.append("".join(text.rjust(width) for text, width in zip(cells, wide, strict=True)))
        values = [
            pitch["CL"],
            pitch["Cm"],
            1.5,
            -4.0,
            roll["Cl"],
            roll["CY"],
            roll["Cn"],
            yaw["Cn"],
            yaw["Cl"],
        ]
        widths = [13, 13, 14, 13, 13, 13, 13, 13, 13]
        shown = [f"{v * factor:.4E}" if not (blank and i < 2) else "" for i, v in enumerate(values)]
        dynamic.append(
            f"{alpha:9.2f}" + "".join(s.rjust(w) for s, w in zip(shown, widths, strict=True))
        )
    whole = "WING-BODY-VERTICAL TAIL-HORIZONTAL TAIL CONFIGURATION"
    table = (
        f"0                              -------------------DERIVATIVE (PER {per})-------------------\n"
        "0 ALPHA     CD       CL       CM       CN       CA       XCP        CLA          CMA          CYB          CNB          CLB\n0\n"
    )
    kind = "CHARACTERISTICS AT ANGLE OF ATTACK AND IN SIDESLIP"
    wing = page(kind, "WING ALONE CONFIGURATION") + table + "    0.0    9.000    9.000    9.0000\n"
    damped = (
        f"0                         DYNAMIC DERIVATIVES (PER {per})\n"
        "0           -------PITCHING-------    -----ACCELERATION------    --------------ROLLING--------------    --------YAWING--------\n"
        "0   ALPHA       CLQ          CMQ           CLAD         CMAD         CLP          CYP          CNP          CNR          CLR\n0\n"
    )
    return (
        wing + page(kind, whole) + table + "\n".join(static)
        + "\n0                  ALPHA     Q/QINF    EPSLON  D(EPSLON)/D(ALPHA)\n"
        + page("DYNAMIC DERIVATIVES", whole) + damped + "\n".join(dynamic)
        + "\n0*** NDM PRINTED WHEN NO DATCOM METHODS EXIST\n"
    )  # fmt: skip
