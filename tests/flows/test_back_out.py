"""Parameters of a build-up from a linear model: the printed equations by hand, and a build-up whose
downwash lags, of which the equations leave 35 % to the tail."""

import json
from pathlib import Path

import numpy as np
import pytest

from aerodb.exchange.native import read_native
from aerodb.identification import parse_derivative_file, tails_of
from aerodb.tables import AeroDatabase, with_parameters
from tests.aerodb.identification.test_fitted_modes import LATERAL, LONGITUDINAL, noisy, sweep
from tests.aerodb.identification.test_fitted_modes import flown as flown_states
from tests.aerodb.simulation.test_modes import TABLE_1, TABLE_2
from tests.support.build_up import TEXT
from tests.support.command import aerodb, asked, of_schema
from tests.support.effect_flights import AREA, CHORD, SPAN, VEHICLE

#: Gradient of the downwash at the tail of the build-up, and the tail's arm [m] and area share.
DOWNWASH, ARM, SHARE = 0.35, 6.0, 0.2
#: The CG is forward of the wing, so that the short period oscillates.
LAGGING = TEXT.replace("0.65*alpha + 6*q/V", "0.65*alpha + 0.35*6*alphadot/V + 6*q/V").replace(
    '"0.15*wing_lift', '"-0.15*wing_lift'
)
TRUTH = {"tail_CLa": 3.6, "tail_tau": 0.5, "fin_CLa": 2.8, "wing_CLa": 4.4}
WRONG = {"tail_CLa": 5.2, "tail_tau": 0.35, "fin_CLa": 4.1, "wing_CLa": 5.2}
SPEED, ALTITUDE = 60.0, 1000.0
AT = ("--speed", str(SPEED), "--altitude", str(ALTITUDE))
DERIVATIVES = ("Zw", "Mw", "Mq", "Zq", "Zdelta_elevator", "Mdelta_elevator", "Yv", "Nv", "Nr", "Lr")
FLIGHT = f"""
[flight]
mass = 1100.0
Ixx = 1300.0
Iyy = 1800.0
Izz = 2700.0
Ixz = 90.0
area = {AREA}
chord = {CHORD}
span = {SPAN}
pressure = {{pressure}}
V = {SPEED}
alpha = {{alpha}}
"""
#: The published Caravan in its own units and the type's public geometry [slug, slug ft2, ft]:
#: neither mass properties nor geometry are printed, so that these stand for them.
MASS, IYY, IZZ, S, C, B = 250.0, 10_500.0, 16_000.0, 279.4, 6.6, 52.1
S_H, X_H, S_V, X_V, ETA = 70.0, 21.0, 43.0, 20.5, 1.08


def test_the_printed_equations_by_hand_in_feet() -> None:
    """Equations 6 to 24 with the printed Mq, Zde, Nr and Ydr of flaps 0, written out in feet; the
    program has them in SI."""
    zde, mq, nr, ydr = -37.236, TABLE_1[0][6], TABLE_2[0][8], 12.943
    u0 = TABLE_1[0][7]
    pressure = 0.5 * 0.001756 * u0**2
    cm_q = mq * 2.0 * IYY * u0 / (pressure * S * C**2)
    tail = -cm_q / (2.0 * ETA * (S_H / S) * (X_H / C) * (X_H / C))
    elevator = -zde * MASS / (pressure * S) * S / (tail * ETA * S_H)
    cn_r = nr * 2.0 * IZZ * u0 / (pressure * S * B**2)
    fin = -cn_r / (2.0 * ETA * (S_V / S) * (X_V / B) ** 2)
    rudder = ydr * MASS / (pressure * S) * S / (fin * ETA * S_V)
    foot, slug = 0.3048, 14.59390
    file = parse_derivative_file(
        f"""
primed = false
[flight]
mass = {MASS * slug}
Ixx = {9000.0 * slug * foot**2}
Iyy = {IYY * slug * foot**2}
Izz = {IZZ * slug * foot**2}
Ixz = 0.0
area = {S * foot**2}
chord = {C * foot}
span = {B * foot}
pressure = {pressure * slug / (foot)}
V = {u0 * foot}
[derivatives]
Mq = [{mq}, 0.06]
Zdelta_elevator = [{zde * foot}, 0.4]
Nr = {nr}
Ydelta_rudder = {ydr * foot}
[tail.horizontal]
plane = "horizontal"
area = "{S_H * foot**2} m^2"
arm = {X_H * foot}
pressure_ratio = {ETA}
control = "delta_elevator"
[tail.vertical]
plane = "vertical"
area = {S_V * foot**2}
arm = {X_V * foot}
pressure_ratio = {ETA}
control = "delta_rudder"
""",
        "f",
    )
    horizontal, vertical = tails_of(file)
    assert horizontal["horizontal_lift_slope"] == pytest.approx(tail, rel=1e-6)
    assert horizontal["horizontal_effectiveness"] == pytest.approx(elevator, rel=1e-6)
    assert vertical["vertical_lift_slope"] == pytest.approx(fin, rel=1e-6)
    assert vertical["vertical_effectiveness"] == pytest.approx(rudder, rel=1e-6)
    # The slope has the error of Mq, 2 %; the effectiveness that of the force beside it.
    assert horizontal.standard_errors[0] == pytest.approx(tail * 0.06 / 2.999, rel=1e-6)
    expected = elevator * np.hypot(0.06 / 2.999, 0.4 / (37.236 * foot))
    assert horizontal.standard_errors[1] == pytest.approx(expected, rel=1e-6)


def with_values(values: dict[str, float]) -> AeroDatabase:
    return with_parameters(read_native(LAGGING), values)


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("back-out")
    (root / "vehicle.toml").write_text(VEHICLE)
    asked(root / "w", "vehicle", "add", str(root / "vehicle.toml"))
    for name, values in (("truth", {}), ("wrong", WRONG)):
        text = LAGGING
        for parameter, value in values.items():
            text = text.replace(
                f"{parameter} = {{ value = {TRUTH[parameter]}", f"{parameter} = {{ value = {value}"
            )
        (root / f"{name}.toml").write_text(text)
        asked(root / "w", "database", "import", str(root / f"{name}.toml"))
    return root / "w"


@pytest.fixture(scope="module")
def flown(workspace: Path) -> tuple[dict[str, float], str]:
    """Derivatives of the true build-up's linear model, from its matrices by hand, and the text of
    the flight condition."""
    found = asked(workspace, "version", "modes", "v0001", *AT)
    linear, trim = found["linear"], found["channels"]
    a, b = np.array(linear["A"]), np.array(linear["B"])
    states, elevator = linear["states"], linear["inputs"].index("delta_elevator")
    w, q, v, p, r = (states.index(name) for name in "wqvpr")
    along = SPEED * np.cos(trim["alpha"])
    values = {
        "Zw": a[w, w], "Mw": a[q, w], "Mq": a[q, q], "Zq": a[w, q] - along,
        "Zdelta_elevator": b[w, elevator], "Mdelta_elevator": b[q, elevator],
        "Yv": a[v, v], "Nv": a[r, v], "Nr": a[r, r], "Lr": a[p, r],
    }  # fmt: skip
    values = {name: float(value) for name, value in values.items()}
    return values, FLIGHT.format(pressure=trim["qbar"], alpha=trim["alpha"])


def derivative_file(folder: Path, flight: str, values: dict[str, float], error: float) -> str:
    rows = [f"{name} = [{value!r}, {error * abs(value)!r}]" for name, value in values.items()]
    (folder / "linear.toml").write_text("\n".join([flight, "[derivatives]", *rows, ""]))
    return str(folder / "linear.toml")


def backed_out(workspace: Path, file: str, *names: str) -> dict:
    parameters = [part for name in names for part in ("--parameter", name)]
    given = ("v0002", *AT, "--linear", file, *parameters)
    return of_schema("version back-out", asked(workspace, "version", "back-out", *given))


def test_the_fit_finds_the_planted_slopes_and_equation_8_does_not(
    workspace: Path, flown: tuple[dict[str, float], str], tmp_path: Path
) -> None:
    values, flight = flown
    found = backed_out(workspace, derivative_file(tmp_path, flight, values, 0.02), *TRUTH)
    assert found["converged"]
    for each in found["parameters"]:
        assert each["start"] == WRONG[each["name"]]
        assert each["value"] == pytest.approx(TRUTH[each["name"]], rel=2e-3), each
    for each in found["derivatives"]:
        assert each["after"] == pytest.approx(each["given"], rel=2e-3), each
    tails = f"""
[derivatives]
Mq = {values["Mq"]}
[tail.plain]
plane = "horizontal"
area = {SHARE * AREA}
arm = {ARM}
[tail.lagging]
plane = "horizontal"
area = {SHARE * AREA}
arm = {ARM}
downwash = {DOWNWASH}
"""
    (tmp_path / "tails.toml").write_text(flight + tails)
    told = asked(workspace, "derivatives", str(tmp_path / "tails.toml"))["tails"]
    plain, lagging = (each["value"] for each in told)
    # In the build-up the tail's moment is 3.2 tail lifts for an arm of 6 m over a chord of 1.5 m.
    moment = 3.2 / (ARM / CHORD)
    assert plain / moment > 1.25 * TRUTH["tail_CLa"]
    assert lagging / moment == pytest.approx(TRUTH["tail_CLa"], rel=0.05)


def test_intervals_hold_the_truth_over_noise(
    workspace: Path, flown: tuple[dict[str, float], str], tmp_path: Path
) -> None:
    """Derivatives with errors of 3 %: each parameter scatters by its standard error."""
    values, flight = flown
    random = np.random.default_rng(4)
    ratios = []
    for _ in range(12):
        noisy = {n: v * (1.0 + 0.03 * random.standard_normal()) for n, v in values.items()}
        rows = derivative_file(tmp_path, flight, noisy, 0.03)
        for each in backed_out(workspace, rows, *TRUTH)["parameters"]:
            ratios.append((each["value"] - TRUTH[each["name"]]) / each["standard_error"])
    assert 0.7 < np.sqrt(np.mean(np.square(ratios))) < 1.3
    assert np.max(np.abs(ratios)) < 3.5


def test_a_right_build_up_stays(
    workspace: Path, flown: tuple[dict[str, float], str], tmp_path: Path
) -> None:
    values, flight = flown
    file = derivative_file(tmp_path, flight, values, 0.02)
    found = asked(workspace, "version", "back-out", "v0001", *AT, "--linear", file,
                  "--parameter", "tail_CLa", "--parameter", "fin_CLa")  # fmt: skip
    for each in found["parameters"]:
        assert each["value"] == pytest.approx(each["start"], rel=1e-4)


@pytest.mark.parametrize(
    ("rows", "names", "said"),
    [
        ("Mq = [-2.0, 0.1]", ("tail_CLb",), "no parameter 'tail_CLb'"),
        ("Mq = -2.0", ("tail_CLa",), "Mq has no standard error"),
        ("Mq = [-2.0, 0.1]", ("fin_CLa",), "fin_CLa changes none of the derivatives"),
        ("Mq = [-2.0, 0.1]", ("tail_CLa", "wing_CLa"), "are not told apart"),
        ("Cm_q_hat = [-20.0, 1.0]", ("tail_CLa",), "no dimensional derivatives"),
        ("Mq = [-2.0, 0.1]\n[errors]\nIyy = 50.0", ("tail_CLa",), "errors of Iyy are not counted"),
    ],
)
def test_refusals_say_what_to_do(
    workspace: Path, flown: tuple[dict[str, float], str], tmp_path: Path,
    rows: str, names: tuple[str, ...], said: str,
) -> None:  # fmt: skip
    (tmp_path / "linear.toml").write_text(f"{flown[1]}[derivatives]\n{rows}\n")
    parameters = [part for name in names for part in ("--parameter", name)]
    refused = aerodb(workspace, "version", "back-out", "v0002", *AT, "--linear",
                     str(tmp_path / "linear.toml"), *parameters)  # fmt: skip
    assert refused.returncode == 3
    assert said in refused.stderr


#: Inputs of the linear models in the build-up, and the names of their derivatives there.
_INPUTS = {"Ze": "Zdelta_elevator", "Me": "Mdelta_elevator", "Ydr": "Ydelta_rudder",
           "Ndr": "Ndelta_rudder", "La": "Ldelta_aileron"}  # fmt: skip
_USED = ("Zw", "Mw", "Mq", "Ze", "Me", "Yv", "Nv", "Nr", "Ydr", "Ndr")
#: Nothing is zero for granted: the build-up's elevator and pitch rate act along x as well.
_LONGITUDINAL = (
    LONGITUDINAL.replace('"-W0"', '"Xq - W0"')
    .replace('[0, "Mw"', '["Mu", "Mw"')
    .replace("b = [[0]", 'b = [["Xe"]')
)


def _recorded(linear: dict, trim: dict, states: tuple[str, ...], inputs: tuple[str, ...],
              path: Path, seed: int) -> None:  # fmt: skip
    """A table of one sweep per input of a linear model, with the steady flight and noise."""
    rows = [linear["states"].index(name) for name in states]
    columns = [linear["inputs"].index(name) for name in inputs]
    a, b = np.array(linear["A"])[np.ix_(rows, rows)], np.array(linear["B"])[np.ix_(rows, columns)]
    time = np.arange(0.0, 60.0, 0.04)
    moved = np.stack([np.roll(sweep(time, 0.2, 9.0, 0.02), 250 * k) for k in range(len(inputs))])
    steady = {
        "u": SPEED * np.cos(trim["alpha"]),
        "w": SPEED * np.sin(trim["alpha"]),
        "theta": trim["theta"],
    }
    motion = noisy(flown_states(a, b, moved, time), states, seed)
    motion += [[steady.get(name, 0.0)] for name in states]
    held = {name: np.full(len(time), value) for name, value in steady.items() if name not in states}
    names = ("time", *inputs, *states, *held)
    np.savetxt(path, np.column_stack([time, *moved, *motion, *held.values()]), "%.9g", ",",
               header=",".join(names), comments="")  # fmt: skip


def _estimated(workspace: Path, folder: Path, name: str, model: str) -> dict:
    (folder / f"{name}.toml").write_text(model)
    document = asked(workspace, "estimate", "--model", str(folder / f"{name}.toml"),
                     "--record", str(folder / f"{name}.csv"))  # fmt: skip
    (folder / f"{name}.json").write_text(json.dumps(document))
    return document["methods"][0]


def test_from_sweeps_to_modes_beside_the_flight(
    workspace: Path, flown: tuple[dict[str, float], str], tmp_path: Path
) -> None:
    """As the Caravan's: sweeps, linear models by output error, parameters from them with their
    covariance, and tables 3 to 6 of the build-up before and after, by commands alone."""
    found = asked(workspace, "version", "modes", "v0001", *AT)
    linear, trim = found["linear"], found["channels"]
    motions = {
        "longitudinal": (("u", "w", "q", "theta"), ("delta_elevator",), _LONGITUDINAL),
        "lateral": (("v", "p", "r", "phi"), ("delta_aileron", "delta_rudder"), LATERAL),
    }
    rows, correlations = [], []
    for seed, (name, (states, inputs, model)) in enumerate(motions.items()):
        _recorded(linear, trim, states, inputs, tmp_path / f"{name}.csv", seed)
        answer = _estimated(workspace, tmp_path, name, model)
        own = {each["name"]: each for each in answer["estimates"]}
        used = [each for each in _USED if each in own]
        rows += [
            f"{_INPUTS.get(n, n)} = [{own[n]['value']!r}, {own[n]['standard_error']!r}]"
            for n in used
        ]
        (told,) = answer["correlations"]
        for k, one in enumerate(used):
            for other in used[:k]:
                i, j = told["names"].index(one), told["names"].index(other)
                correlations.append(
                    f'[[correlation]]\nof = ["{_INPUTS.get(one, one)}", '
                    f'"{_INPUTS.get(other, other)}"]\nvalue = {told["correlation"][i][j]!r}'
                )
    text = "\n".join([flown[1], "[derivatives]", *rows, *correlations, ""])
    (tmp_path / "flown.toml").write_text(text)
    names = ("tail_CLa", "tail_tau", "fin_CLa", "wing_CLa")
    backed = backed_out(workspace, str(tmp_path / "flown.toml"), *names)
    corrected = (workspace.parent / "wrong.toml").read_text()
    for each in backed["parameters"]:
        assert abs(each["value"] - TRUTH[each["name"]]) < 4.0 * each["standard_error"], each
        corrected = corrected.replace(
            f"{each['name']} = {{ value = {each['start']}",
            f"{each['name']} = {{ value = {each['value']!r}",
        )
    (tmp_path / "corrected.toml").write_text(corrected)
    version = asked(workspace, "database", "import", str(tmp_path / "corrected.toml"))["label"]
    farthest = 0.0
    for name in motions:
        given = ("--flown", str(tmp_path / f"{name}.json"), "--beside", "v0002")
        beside = asked(workspace, "version", "modes", version, *AT, *given)["beside"]
        assert beside["labels"] == ["v0002", version]
        errors = {(row["mode"], row["figure"]): list(row["errors"].values())
                  for row in beside["rows"]}  # fmt: skip
        for (mode, figure), (before, after) in errors.items():
            if figure == "omega" and mode in ("short period", "Dutch roll"):
                farthest = max(farthest, abs(before))
                assert abs(after) < 8.0, (mode, before, after)
    assert farthest > 15.0
    shown = aerodb(workspace, "version", "modes", version, *AT, *given).stdout
    assert "beside the linear model of the flights by output-error" in shown
    page = tmp_path / "page.html"
    asked(workspace, "report", "version", version, "--output", str(page), *given, *AT)
    assert "Modes beside the flights" in page.read_text()
    refused = aerodb(workspace, "report", "version", version, "--output", str(page), *given)
    assert "--flown needs the flight of its modes" in refused.stderr
    (tmp_path / "no.json").write_text("{}")
    refused = aerodb(
        workspace, "version", "modes", version, *AT, "--flown", str(tmp_path / "no.json")
    )
    assert "it holds no modes of a linear model" in refused.stderr
