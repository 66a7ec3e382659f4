"""Subspace identification: scipy's simulation of known systems, the WVU YF-22 at its published
noise, measured flights, and output error from start values that nobody gave."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.signal

from aerodb.errors import InputError
from aerodb.estimation import Parameter, Parameters, TimeHistory, output_error, state_space
from aerodb.estimation.linear_models.start_values import with_start_values
from aerodb.estimation.linear_models.subspace import identified_linear_model
from aerodb.estimation.output_error.gauss_newton import search
from tests.support.output_error_cases import (
    ATTAS_LATERAL,
    TWIN_OTTER_LATERAL,
    attas_model,
    attas_records,
    twin_otter_lateral,
)

# "Parameter Identification for Application within a Fault-Tolerant Flight Control System", eq. 1
# and Table 2: angle of attack and pitch rate, stabilator.
YF22_A = np.array([[-5.6878, 0.5931], [-53.7829, -1.996]])
YF22_B = np.array([[-2.1959], [-21.2428]])
YF22_ROOT = -3.8419 + 5.3377j
# Its sensors: 3 sigma of .15 deg of the flow angles and 1 deg/s of the rates.
YF22_NOISE = np.deg2rad([0.05, 0.333])


def simulated(a, b, c, d, u, step, start=None):
    time = step * np.arange(len(u))
    return scipy.signal.lsim((a, b, c, d), u, time, X0=start, interp=True)[1]


def record(name, u, y, step, inputs=("u",), outputs=("y",)):
    return TimeHistory(
        name,
        step * np.arange(len(u)),
        dict(zip(inputs, u.T, strict=True)),
        dict(zip(outputs, y.T, strict=True)),
    )


def test_a_known_system_without_noise_comes_back_to_rounding():
    rng = np.random.default_rng(1)
    a = np.array([[0.0, 1.0, 0.0], [-4.0, -0.8, 0.5], [0.0, 0.0, -2.0]])
    b, c = np.array([[0.0, 0.3], [1.0, 0.0], [0.5, -1.0]]), np.array([[1.0, 0, 0], [0, 1.0, 1.0]])
    d = np.array([[0.0, 0.0], [0.2, 0.0]])
    records = []
    for k in range(2):
        u = scipy.signal.lfilter([0.2], [1, -0.8], rng.standard_normal((500, 2)), axis=0)
        y = simulated(a, b, c, d, u, 0.05, rng.standard_normal(3)) + np.array([0.3 * k, -0.1])
        records.append(record(f"r{k}", u, y, 0.05, ("u1", "u2"), ("y1", "y2")))
    found = identified_linear_model(records, ("u1", "u2"), ("y1", "y2"), direct=("y2",))
    assert len(found.A) == 3
    assert "fall most" in found.note
    roots = np.linalg.eigvals(found.A)
    np.testing.assert_allclose(
        np.sort_complex(roots), np.sort_complex(np.linalg.eigvals(a)), atol=1e-7
    )
    for w in (0.1, 1.0, 5.0):
        one, other = (
            matrices[2] @ np.linalg.solve(1j * w * np.eye(3) - matrices[0], matrices[1])
            + matrices[3]
            for matrices in ((a, b, c, d), (found.A, found.B, found.C, found.D))
        )
        np.testing.assert_allclose(one, other, atol=1e-7)
    np.testing.assert_allclose(found.offset["r1"], [0.3, -0.1], atol=1e-6)


def yf22_records(rng, noise=1.0):
    """Three legs of 10 s with stabilator doublets, each with a trim of its own."""
    records = []
    for k in range(3):
        u = np.zeros((500, 1))
        width = 18 + 4 * k
        u[60 : 60 + width], u[60 + width : 60 + 2 * width] = 0.08, -0.08
        u[280 : 280 + width], u[280 + width : 280 + 2 * width] = -0.06, 0.06
        y = simulated(YF22_A, YF22_B, np.eye(2), np.zeros((2, 1)), u, 0.02)
        y = y + noise * YF22_NOISE * rng.standard_normal(y.shape) + [0.03 + 0.01 * k, 0.0]
        records.append(record(f"leg {k}", u + 0.02, y, 0.02, ("iH",), ("alpha", "q")))
    return records


def test_the_short_period_of_the_yf22_at_its_published_noise():
    rng = np.random.default_rng(3)
    roots = []
    for _ in range(8):
        found = identified_linear_model(
            yf22_records(rng), ("iH",), ("alpha", "q"), states=("alpha", "q")
        )
        roots.append(np.sort_complex(np.linalg.eigvals(found.A))[-1])
    assert np.mean(roots) == pytest.approx(YF22_ROOT, abs=0.35)
    assert "2 as given" in found.note
    np.testing.assert_allclose(found.B[1], YF22_B[1], rtol=0.15)


def test_attas_shows_a_dutch_roll_and_a_roll_mode(measured):
    """From aileron and rudder alone, without a model: three states, and the Dutch roll and the roll
    mode of the book's derivatives."""
    records = attas_records(measured("attas/fAttasAilRud1.mat"))
    found = identified_linear_model(
        records, ("da", "dr"), ("p", "r", "pdot", "rdot"), direct=("pdot", "rdot")
    )
    assert len(found.A) == 3
    roots = np.linalg.eigvals(found.A)
    roll = roots[np.abs(roots.imag) < 1e-9].real
    assert roll == pytest.approx([ATTAS_LATERAL["Lp"]], rel=0.15)
    dutch = roots[roots.imag > 0]
    # omega^2 is near Nbeta, which acts on the measured sideslip.
    assert abs(dutch[0]) ** 2 == pytest.approx(ATTAS_LATERAL["Nbeta"], rel=0.15)


def test_start_values_of_attas(measured):
    records = attas_records(measured("attas/fAttasAilRud1.mat"))
    model = attas_model()
    bare = state_space(
        model.states, model.inputs, model.outputs,
        Parameters(tuple(Parameter(name, 0.0) for name in ATTAS_LATERAL)),
        a=[["Lp", "Lr"], ["Np", "Nr"]],
        b=[["Lda", "Ldr", "Lbeta"], ["Nda", "Ndr", "Nbeta"]],
        c=[["Lp", "Lr"], ["Np", "Nr"], [1, 0], [0, 1]],
        d=[["Lda", "Ldr", "Lbeta"], ["Nda", "Ndr", "Nbeta"], [0, 0, 0], [0, 0, 0]],
        state_bias=["L0", "N0"], output_bias=["L0", "N0", 0, 0],
    )  # fmt: skip
    started = with_start_values(bare, records).parameters
    for name in ("Lp", "Lda", "Lbeta", "Ndr", "Nbeta"):
        assert started[name].value == pytest.approx(ATTAS_LATERAL[name], rel=0.2)
    fit = output_error(bare, records)
    told = output_error(model, records)
    assert fit.converged
    assert any("subspace" in note for note in fit.notes)
    from_what_was_given = search(model, records).iterations
    assert fit.iterations < from_what_was_given
    assert told.iterations < from_what_was_given  # regression on measured states is likelier
    assert any("regression" in note for note in told.notes)
    for name in ATTAS_LATERAL:
        assert fit[name].value == pytest.approx(told[name].value, abs=1e-3 * fit[name].cramer_rao)


def test_start_values_of_the_twin_otter(measured):
    """Derivatives of the moments to a quarter, of the side force, which shows little in sideslip
    and rates, to a third; and output error ends where it ends from values that were given."""
    model, flown = twin_otter_lateral(measured("twin_otter/totter_f1_017_data.mat"))
    bare = replace(
        model, parameters=model.parameters.changed(dict.fromkeys(model.parameters.names, 0.0))
    )
    started = with_start_values(bare, [flown]).parameters
    for name in ("Cl_beta", "Cl_p", "Cl_da", "Cn_beta", "Cn_r", "Cn_dr", "CY_beta", "CY_r"):
        near = 0.34 if name.startswith("CY") else 0.25
        assert started[name].value == pytest.approx(TWIN_OTTER_LATERAL[name], rel=near), name
    fit, told = output_error(bare, [flown]), output_error(model, [flown])
    assert fit.converged
    for name in TWIN_OTTER_LATERAL:
        assert fit[name].value == pytest.approx(told[name].value, abs=1e-3 * fit[name].cramer_rao)


def test_a_fixed_entry_and_a_bound_are_kept():
    records = yf22_records(np.random.default_rng(5), noise=0.0)
    model = state_space(
        ["alpha", "q"], ["iH"], ["alpha", "q"],
        Parameters(
            (
                Parameter("Za", 0.0), Parameter("Zq", 0.5931, free=False),
                Parameter("Ma", 0.0), Parameter("Mq", 0.0, lower=-1.5, upper=0.0),
                Parameter("Zd", 0.0, tied=("Md", 0.1033716)), Parameter("Md", 0.0),
            )
        ),
        a=[["Za", "Zq"], ["Ma", "Mq"]], b=[["Zd"], ["Md"]], c=[[1, 0], [0, 1]],
    )  # fmt: skip
    started = with_start_values(model, records).parameters
    assert started["Za"].value == pytest.approx(-5.6878, rel=1e-4)
    assert started["Md"].value == pytest.approx(-21.2428, rel=1e-4)
    assert started["Mq"].value == -1.5
    assert started["Zq"].value == 0.5931


def test_what_the_records_do_not_give_is_said():
    rng = np.random.default_rng(7)
    (first, *_) = yf22_records(rng)
    still = TimeHistory("still", first.time, {"iH": np.zeros(500)}, first.outputs)
    with pytest.raises(InputError, match="do not move: iH"):
        identified_linear_model([still], ("iH",), ("alpha", "q"))
    twins = TimeHistory(
        "twins", first.time, {"a": first.inputs["iH"], "b": first.inputs["iH"]}, first.outputs
    )
    with pytest.raises(InputError, match="do not excite"):
        identified_linear_model([twins], ("a", "b"), ("alpha", "q"))
    gappy = {**first.outputs, "q": np.where(np.arange(500) == 9, np.nan, first.outputs["q"])}
    with pytest.raises(InputError, match="q has gaps"):
        identified_linear_model(
            [TimeHistory("g", first.time, first.inputs, gappy)], ("iH",), ("q",)
        )
    short = TimeHistory(
        "s", first.time[:60],
        {"iH": first.inputs["iH"][20:80]}, {"q": first.outputs["q"][20:80]},
    )  # fmt: skip
    with pytest.raises(InputError, match="too short"):
        identified_linear_model([short], ("iH",), ("q",))
    with pytest.raises(InputError, match="no output 'beta'"):
        identified_linear_model([first], ("iH",), ("alpha", "q"), states=("beta",))
    quiet = yf22_records(rng, noise=0.0)
    with pytest.raises(InputError, match="the records show 2 states"):
        identified_linear_model(quiet, ("iH",), ("alpha", "q"), order=5)
    model = state_space(
        ["w"], ["iH"], ["alpha"], Parameters((Parameter("Zw", 0.0),)),
        a=[["Zw"]], b=[[1.0]], c=[[1.0]],
    )  # fmt: skip
    few = TimeHistory("few", first.time[:60], {"iH": first.inputs["iH"][20:80]},
                      {"alpha": first.outputs["alpha"][20:80]})  # fmt: skip
    fit = output_error(model, [few])
    assert any("began at zero: 60 samples are too short" in note for note in fit.notes)


def test_states_that_are_not_measured_get_start_values_by_their_structure():
    """The angle of attack from the pitch rate alone; one known entry fixes what it is."""
    records = yf22_records(np.random.default_rng(8), noise=0.0)
    seen = [
        TimeHistory(each.name, each.time, each.inputs, {"q": each.outputs["q"]}) for each in records
    ]
    model = state_space(
        ["alpha", "q"], ["iH"], ["q"],
        Parameters(
            (
                *(Parameter(name, 0.0) for name in ("Za", "Ma", "Mq", "Md")),
                Parameter("Zd", 0.0, tied=("Md", 0.1033716)),
            )
        ),
        a=[["Za", 0.5931], ["Ma", "Mq"]], b=[["Zd"], ["Md"]], c=[[0, 1]],
    )  # fmt: skip
    started = with_start_values(model, seen).parameters
    assert started["Za"].value == pytest.approx(-5.6878, rel=1e-3)
    assert started["Md"].value == pytest.approx(-21.2428, rel=1e-3)
