"""Modes of fitted linear models: the published Caravan, flown with noise, and numpy's eigenvalues."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from aerodb.estimation import TimeHistory
from aerodb.identification import METHODS, fitted_modes, parse_state_space, state_space_fit
from tests.aerodb.simulation.test_modes import TABLE_1, TABLE_2
from tests.support.command import aerodb, asked

FOOT = 0.3048
G = 9.80665

LONGITUDINAL = """
[state_space]
states = ["u", "w", "q", "theta"]
inputs = ["delta_elevator"]
outputs = ["u", "w", "q", "theta"]
a = [["Xu", "Xw", "-W0", "-9.80665*cos_theta0"], ["Zu", "Zw", "U0 + Zq", "-9.80665*sin_theta0"],
     [0, "Mw", "Mq", 0], [0, 0, 1, 0]]
b = [[0], ["Ze"], ["Me"], [0]]
c = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
state_bias = ["X0", "Z0", "M0", "T0"]
initial = ["u", "w", "q", "theta"]
own = ["X0", "Z0", "M0", "T0"]
"""
LATERAL = """
[state_space]
states = ["v", "p", "r", "phi"]
inputs = ["delta_aileron", "delta_rudder"]
outputs = ["v", "p", "r", "phi"]
a = [["Yv", "Yp + W0", "Yr - U0", "9.80665*cos_theta0"], ["Lv", "Lp", "Lr", 0],
     ["Nv", "Np", "Nr", 0], [0, 1, "tan_theta0", 0]]
b = [[0, "Ydr"], ["La", "Ldr"], ["Na", "Ndr"], [0, 0]]
c = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
initial = ["v", "p", "r", "phi"]
"""
#: Standard deviations of noise: m/s and rad(/s).
NOISE = {"u": 0.15, "w": 0.15, "v": 0.15, "p": 2e-3, "q": 1e-3, "r": 1e-3, "phi": 2e-3, "theta": 1e-3}  # fmt: skip


def longitudinal(flaps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A and B of table 1 in SI, and the steady u, w, q, theta."""
    xu, xw, zu, zw, zq, mw, mq, u0, w0, theta = TABLE_1[flaps]
    zq, mw, u0, w0 = zq * FOOT, mw / FOOT, u0 * FOOT, w0 * FOOT
    a = [
        [xu, xw, -w0, -G * np.cos(theta)],
        [zu, zw, u0 + zq, -G * np.sin(theta)],
        [0.0, mw, mq, 0.0],
        [0.0, 0.0, 1.0, 0.0],
    ]
    return (
        np.array(a),
        np.array([[0.0], [-37.236 * FOOT], [-11.95], [0.0]]),
        np.array([u0, w0, 0.0, theta]),
    )


def lateral(flaps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A and B of table 2 in SI, and U0, W0, theta0."""
    yv, yp, yr, lv, lp, lr, nv, n_p, nr, u0, w0, theta = TABLE_2[flaps]
    yp, yr, u0, w0, lv, nv = yp * FOOT, yr * FOOT, u0 * FOOT, w0 * FOOT, lv / FOOT, nv / FOOT
    a = [
        [yv, yp + w0, yr - u0, G * np.cos(theta)],
        [lv, lp, lr, 0.0],
        [nv, n_p, nr, 0.0],
        [0.0, 1.0, np.tan(theta), 0.0],
    ]
    b = [[0.0, 12.943 * FOOT], [2.207, 0.115], [0.171, -2.862], [0.0, 0.0]]
    return np.array(a), np.array(b), np.array([u0, w0, theta])


def sweep(time: np.ndarray, first: float, last: float, size: float) -> np.ndarray:
    """A frequency sweep [rad/s] that grows exponentially."""
    rate = np.log(last / first) / time[-1]
    return size * np.sin(first * np.expm1(rate * time) / rate)


def flown(a: np.ndarray, b: np.ndarray, inputs: np.ndarray, time: np.ndarray) -> np.ndarray:
    """States (s, n) by scipy, inputs (m, n) linear between samples."""

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        return a @ x + b @ [np.interp(t, time, row) for row in inputs]

    return solve_ivp(
        rates, time[[0, -1]], np.zeros(len(a)), t_eval=time, rtol=1e-8, atol=1e-10, max_step=0.05
    ).y


def noisy(states: np.ndarray, names: tuple[str, ...], seed: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    return states + [[NOISE[name]] for name in names] * random.standard_normal(states.shape)


def by_numpy(a: np.ndarray) -> dict[str, tuple[float, ...]]:
    """Omega and zeta of oscillations by falling frequency, and time constants of real roots."""
    roots = np.linalg.eigvals(a)
    pairs = sorted((root for root in roots if root.imag > 0), key=abs, reverse=True)
    real = sorted(root.real for root in roots if root.imag == 0)
    return {
        "pairs": tuple(x for root in pairs for x in (abs(root), -root.real / abs(root))),
        "real": tuple(-1.0 / root for root in real),
    }


@pytest.mark.parametrize("flaps", [0, 10])
def test_the_caravans_modes_by_command_with_steady_values_from_the_record(
    flaps: int, tmp_path
) -> None:
    """Two sweeps of the published model with sensor noise; U0, W0 and theta0 are not stated."""
    a, b, steady = longitudinal(flaps)
    names = ("u", "w", "q", "theta")
    time = np.arange(0.0, 60.0, 0.04)
    files = []
    for k, size in enumerate((0.02, -0.02)):
        elevator = sweep(time, 0.15, 8.0, size)
        states = noisy(flown(a, b, elevator[None], time) + steady[:, None], names, 10 * flaps + k)
        files += ["--record", str(tmp_path / f"sweep{k}.csv")]
        np.savetxt(files[-1], np.column_stack([time, elevator, *states]), "%.9g", ",",
                   header=",".join(("time", "delta_elevator", *names)), comments="")  # fmt: skip
    (tmp_path / "model.toml").write_text(LONGITUDINAL)
    page = tmp_path / "page.html"
    given = ("estimate", "--model", str(tmp_path / "model.toml"), *files)
    document = asked(tmp_path / "w", *given, "--output", str(page))
    (answer,) = document["methods"]
    own = {each["name"]: each for each in answer["estimates"]}
    assert own["U0"]["standing"] == "fixed"
    assert own["U0"]["value"] == pytest.approx(steady[0], abs=0.5)
    assert own["W0"]["value"] == pytest.approx(steady[1], abs=0.5)
    assert any(
        note.startswith("U0 =") and "mean of 2 records" in note for note in document["notes"]
    )
    truth = by_numpy(a)["pairs"]
    for mode, (omega, zeta) in zip(answer["modes"], (truth[:2], truth[2:]), strict=True):
        for name, value in (("omega", omega), ("zeta", zeta)):
            error = mode["standard_errors"][name]
            assert error < 0.05 * max(value, 0.2)
            # The mean of the record is not quite the steady flight: U0 and theta0 are fixed at it.
            assert abs(mode["figures"][name] - value) < 3.5 * error + 5e-3 * value, mode
    assert [mode["name"] for mode in answer["modes"]] == ["short period", "phugoid"]
    shown = aerodb(tmp_path / "w", *given).stdout
    assert "short period" in shown
    assert "omega [rad/s]" in shown
    assert "modes with standard errors" in page.read_text()


def test_standard_errors_of_modes_are_their_scatter_over_noise() -> None:
    """40 records of the lateral model. Dutch roll, roll and spiral: scatter of each figure in its
    standard errors, and mean error below what chance leaves."""
    a, b, (u0, w0, theta) = lateral(0)
    names = ("v", "p", "r", "phi")
    time = np.arange(0.0, 40.0, 0.05)
    inputs = np.stack([sweep(time, 0.3, 6.0, 0.05), np.roll(sweep(time, 0.3, 6.0, 0.04), 100)])
    clean = flown(a, b, inputs, time)
    stated = "".join(
        f'[[parameter]]\nname = "{name}"\nvalue = {float(value)!r}\nfixed = true\n'
        for name, value in (
            ("U0", u0), ("W0", w0), ("cos_theta0", np.cos(theta)), ("tan_theta0", np.tan(theta)),
        )
    )  # fmt: skip
    file = parse_state_space(LATERAL + stated)
    truth = by_numpy(a)
    wanted = {
        ("Dutch roll", "omega"): truth["pairs"][0],
        ("Dutch roll", "zeta"): truth["pairs"][1],
        ("roll", "time_constant"): truth["real"][0],
        ("spiral", "time_constant"): truth["real"][1],
    }
    errors: dict[tuple[str, str], list[float]] = {key: [] for key in wanted}
    for seed in range(40):
        measured = noisy(clean, names, seed)
        record = TimeHistory(
            "sweep", time, dict(zip(("delta_aileron", "delta_rudder"), inputs, strict=True)),
            dict(zip(names, measured, strict=True)),
        )  # fmt: skip
        fit = state_space_fit(METHODS["output-error"], [record], file)
        found = {mode.name: mode for mode in fitted_modes(fit, file, [record])}
        assert fitted_modes(replace(fit, converged=False), file, [record]) == ()
        for (name, figure), value in wanted.items():
            error = found[name].standard_errors[figure]
            errors[name, figure].append((found[name].figures[figure] - value) / error)
    for key, values in errors.items():
        assert 0.75 < np.std(values) < 1.3, (key, np.std(values))
        assert abs(np.mean(values)) < 3.3 / np.sqrt(40), (key, np.mean(values))


def test_a_model_of_roll_alone_and_one_without_steady_values_say_so(tmp_path) -> None:
    time = np.arange(0.0, 12.0, 0.02)
    aileron = sweep(time, 0.5, 6.0, 0.05)
    p = noisy(flown(np.array([[-2.1]]), np.array([[-11.0]]), aileron[None], time), ("p",), 1)[0]
    table = tmp_path / "roll.csv"
    np.savetxt(table, np.column_stack([time, aileron, p]), "%.9g", ",",
               header="time,delta_aileron,p", comments="")  # fmt: skip
    model = tmp_path / "model.toml"
    roll = '[state_space]\nstates = ["p"]\ninputs = ["delta_aileron"]\noutputs = ["p"]\n'
    model.write_text(roll + 'a = [["Lp"]]\nb = [["Lda"]]\nc = [[1]]\n')
    given = ("estimate", "--model", str(model), "--record", str(table))
    assert "modes" not in asked(tmp_path / "w", *given)["methods"][0]
    model.write_text(roll + 'a = [["Lp + 0.01*U0"]]\nb = [["Lda"]]\nc = [[1]]\n')
    answer = aerodb(tmp_path / "w", *given)
    assert answer.returncode == 3
    assert "no V and alpha or u, of which U0 is the mean" in answer.stderr
