"""``aerodb estimate --record``: linear models of files without a vehicle. The motions are scipy's,
in the units, columns and sampling of the files that users bring."""

from pathlib import Path

import numpy as np
import pytest
from lxml import html
from scipy.integrate import solve_ivp
from scipy.io import savemat

from aerodb.tasks.actors import user
from aerodb.tasks.provenance import code_version
from tests.support.command import aerodb, asked
from tests.support.unstable_aircraft import TRUTH, piloted_flight

ROLL = """
[state_space]
states = ["p"]
inputs = ["delta_aileron"]
outputs = ["p"]
a = [["Lp"]]
b = [["Lda"]]
c = [[1]]
state_bias = ["L0"]
initial = ["p"]
"""
ROLL_TRUTH = {"Lp": -2.1, "Lda": -11.0, "L0": 0.01}
DUTCH_ROLL = """
[state_space]
states = ["beta", "r"]
inputs = ["dr"]
outputs = ["r", "ay"]
a = [["Y", -1], ["Nbeta", "Nr"]]
b = [[0], ["Ndr"]]
c = [[0, 1], ["CY", 0]]
d = [[0], ["Yd"]]
output_bias = [0, "ay0"]
initial = ["beta", "r"]
own = ["ay0"]
"""
DUTCH_ROLL_TRUTH = {"Y": -0.25, "Nbeta": 4.2, "Nr": -0.45, "Ndr": -2.5, "CY": -25.0, "Yd": 4.0}


def doublet(time, start, width, size):
    edges = [np.clip((time - start - k * width) / 0.1, 0.0, 1.0) for k in range(3)]
    return size * (edges[0] - 2.0 * edges[1] + edges[2])


def flown(rates, first, time):
    return solve_ivp(
        rates, time[[0, -1]], first, t_eval=time, rtol=1e-8, atol=1e-10, max_step=0.02
    ).y


def roll(time):
    """Aileron and noisy roll rate, SI."""

    def aileron(at):
        return doublet(at, 1.0, 1.0, 0.09) + doublet(at, 7.0, 0.6, -0.07)

    (p,) = flown(lambda t, x: -2.1 * x - 11.0 * aileron(t) + 0.01, [0.02], time)
    return aileron(time), p + 0.004 * np.random.default_rng(1).standard_normal(len(time))


def dutch_roll(time, start, seed):
    """Rudder, noisy yaw rate and lateral acceleration, SI."""

    def rudder(at):
        return doublet(at, start, 0.8, 0.1)

    def rates(t, x):
        return [-0.25 * x[0] - x[1], 4.2 * x[0] - 0.45 * x[1] - 2.5 * rudder(t)]

    beta, r = flown(rates, [0.01, 0.0], time)
    noise = np.random.default_rng(seed).standard_normal((2, len(time)))
    ay = -25.0 * beta + 4.0 * rudder(time) + 0.3
    return rudder(time), r + 0.003 * noise[0], ay + 0.1 * noise[1]


def written(path: Path, header: str, *columns) -> str:
    np.savetxt(
        path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.9g"
    )
    return str(path)


def model(folder: Path, text: str) -> str:
    (folder / "model.toml").write_text(text)
    return str(folder / "model.toml")


def near(document, truth, errors=3.5):
    """The first method's estimates are those planted."""
    answer = document["methods"][0]
    assert answer.get("converged"), answer
    found = {each["name"]: each for each in answer["estimates"]}
    for name, value in truth.items():
        assert found[name]["standing"] == "estimated", found[name]
        assert abs(found[name]["value"] - value) < errors * found[name]["standard_error"], found
    return found


def test_a_roll_mode_from_a_table_in_degrees_needs_no_vehicle_and_no_workspace(tmp_path) -> None:
    time = np.arange(0.0, 12.0, 0.02)
    aileron, p = roll(time)
    file = written(
        tmp_path / "roll.csv", "time [s],aileron [deg],roll_rate [deg/s]", time,
        np.degrees(aileron), np.degrees(p),
    )  # fmt: skip
    given = ("estimate", "--model", model(tmp_path, ROLL), "--record", file)
    document = asked(tmp_path / "w", *given)
    found = near(document, ROLL_TRUTH)
    assert found["Lp"]["standard_error"] < 0.02
    (record,) = document["records"]
    assert (record["record"], round(record["rate"])) == ("roll", 50)
    assert document["notes"] == []  # the file states its units
    assert not (tmp_path / "w").exists()


def test_a_dutch_roll_whose_sideslip_is_not_measured_from_records_of_two_rates(tmp_path) -> None:
    files = []
    for number, (seconds, step) in enumerate(((15.0, 0.02), (12.0, 0.04))):
        time = np.arange(0.0, seconds, step)
        files += ["--record", written(tmp_path / f"run{number}.csv", "Time,delta_r,r,ay", time,
                                      *dutch_roll(time, 1.0 + number, number))]  # fmt: skip
    path = tmp_path / "page.html"
    given = ("estimate", "--model", model(tmp_path, DUTCH_ROLL), *files, "--output", str(path))
    document = asked(tmp_path / "w", *given)
    found = near(document, DUTCH_ROLL_TRUTH | {"ay0[run0]": 0.3, "ay0[run1]": 0.3})
    assert abs(found["initial_beta[run0]"]["value"] - 0.01) < 0.003
    assert any("subspace" in note for note in document["methods"][0]["notes"])
    assert any("dr is column delta_r, taken in rad" in note for note in document["notes"])
    page = path.read_text()
    assert page.count("<figure ") == 2
    assert found["Nbeta"]["unit"] == "1/s^2"
    assert found["CY"]["unit"] == "m/s^2/rad"
    assert found["initial_beta[run0]"]["unit"] == "rad"
    tree = html.document_fromstring(page)
    facts = {dt.text: dt.getnext().text_content() for dt in tree.xpath("//dl[1]/dt")}
    assert facts["Author"] == user()
    assert facts["Program"] == f"aerodb {code_version()}"
    assert facts["Files"] == ", ".join(str(tmp_path / f"run{number}.csv") for number in (0, 1))
    assert "taken in rad" in tree.text_content()


SHORT_PERIOD = """
[state_space]
states = ["alpha", "q"]
inputs = ["de"]
outputs = ["alpha", "q", "az"]
a = [["Z_alpha", 1], ["M_alpha", "M_q"]]
b = [["Z_de"], ["M_de"]]
c = [[1, 0], [0, 1], ["60*Z_alpha", 0]]
d = [[0], [0], ["60*Z_de"]]
initial = ["alpha", "q"]
"""
FED_BACK = "feedback = { alpha = { alpha = 3.0 }, q = { q = 3.0 } }\n"


def test_an_unstable_motion_is_estimated_with_feedback_or_in_the_frequency_domain(tmp_path) -> None:
    record = piloted_flight(np.random.default_rng(5))
    file = written(
        tmp_path / "piloted.csv", "time [s],de [rad],alpha [rad],q [rad/s],az [m/s^2]",
        record.time, record.inputs["de"], *record.outputs.values(),
    )  # fmt: skip
    rng = np.random.default_rng(6)
    starts = "".join(
        f'[[parameter]]\nname = "{name}"\nvalue = {value * (1.0 + 0.3 * rng.standard_normal())}\n'
        for name, value in TRUTH.items()
    )
    given = ("estimate", "--record", file, "--method", "output-error", "--model")
    plain = asked(tmp_path / "w", *given, model(tmp_path, SHORT_PERIOD + starts))["methods"][0]
    assert {each["standing"] for each in plain["estimates"]} == {"diverged"}
    stable = asked(tmp_path / "w", *given, model(tmp_path, SHORT_PERIOD + FED_BACK + starts))
    found = {each["name"]: each for each in stable["methods"][0]["estimates"]}
    for name, value in TRUTH.items():
        assert abs(found[name]["value"] - value) < 2.0 * found[name]["standard_error"]
    assert any("fed back" in note for note in stable["methods"][0]["notes"])
    given = (*given[:3], "--method", "frequency-domain-output-error", "--model")
    for band, lowest in (("", 0.1), ("band = [0.2, 2.0]\n", 0.2)):
        plain = asked(tmp_path / "w", *given, model(tmp_path, SHORT_PERIOD + band + starts))
        found = near(plain, TRUTH)
        assert any(
            f"frequencies from {lowest:g} to" in note for note in plain["methods"][0]["notes"]
        )
    given = (*given[:3], "--method", "output-error", "--model")
    wrong = FED_BACK.replace("q = { q", "q = { beta")
    refused = aerodb(tmp_path / "w", *given, model(tmp_path, SHORT_PERIOD + wrong + starts))
    assert refused.returncode == 3
    assert "the model has no 'beta'" in refused.stderr


def test_numbered_columns_in_milliseconds_with_a_gap_and_rounded_stamps(tmp_path) -> None:
    time = np.arange(0.0, 12.0, 1.0 / 64.0)
    aileron, p = roll(time)
    stamps = np.round(1000.0 * time)  # 15 or 16 ms apart
    kept = (time < 4.5) | (time > 6.5)
    savemat(tmp_path / "log.mat", {"log": np.column_stack([stamps, p, aileron])[kept]})
    columns = '[columns]\ntime = "1 [ms]"\np = "2 [rad/s]"\ndelta_aileron = "3 [rad]"\n'
    text = columns + ROLL
    document = asked(
        tmp_path / "w", "estimate", "--model", model(tmp_path, text), "--record",
        str(tmp_path / "log.mat"),
    )  # fmt: skip
    near(document, ROLL_TRUTH)
    assert [each["record"] for each in document["records"]] == ["log", "log 2"]
    assert [round(each["rate"]) for each in document["records"]] == [64, 64]
    assert any("cut at gaps into 2 records" in note for note in document["notes"])


def test_matrices_of_a_file_without_a_time_are_joined(tmp_path) -> None:
    time = np.arange(0.0, 12.0, 0.02)
    aileron, p = roll(time)
    savemat(tmp_path / "m.mat", {"u": np.column_stack([0 * time, aileron]), "z": np.column_stack([p, p]),
                                 "spare": np.zeros((7, 2))})  # fmt: skip
    columns = '[columns]\ntime = "0.02 s"\np = "z.1 [rad/s]"\ndelta_aileron = "u.2 [rad]"\n'
    given = ("estimate", "--record", str(tmp_path / "m.mat"), "--model")
    near(asked(tmp_path / "w", *given, model(tmp_path, columns + ROLL)), ROLL_TRUTH)
    without = columns.replace('time = "0.02 s"\n', "")
    refused = aerodb(tmp_path / "w", *given, model(tmp_path, without + ROLL))
    assert refused.returncode == 3
    assert 'time = "0.02 s"' in refused.stderr


def test_uneven_time_steps_are_resampled_and_missing_inputs_bridged(tmp_path) -> None:
    rng = np.random.default_rng(4)
    time = np.cumsum(rng.uniform(0.015, 0.025, 600))
    time -= time[0]
    aileron, p = roll(time)
    aileron[300:304] = np.nan
    file = written(tmp_path / "roll.csv", "t,da,p", time, aileron, p)
    given = ("estimate", "--model", model(tmp_path, ROLL), "--record", file)
    document = asked(tmp_path / "w", *given)
    near(document, ROLL_TRUTH, errors=5.0)  # resampling smooths the noise
    assert any("uneven; resampled" in note for note in document["notes"])
    assert any("bridged" in note for note in document["notes"])


def test_a_delay_that_the_model_lacks_is_a_reservation_and_goes_when_it_is_declared(
    tmp_path,
) -> None:
    time = np.arange(0.0, 12.0, 0.02)
    aileron, p = roll(time)
    file = written(tmp_path / "roll.csv", "t,da,p", time[6:], aileron[6:], p[:-6])
    given = ("estimate", "--record", file, "--method", "output-error", "--model")
    without = asked(tmp_path / "w", *given, model(tmp_path, ROLL))
    found = without["methods"][0]["input_correlations"][0]
    assert (found["output"], found["input"]) == ("p", "delta_aileron")
    assert abs(found["correlation"]) > found["bound"]
    assert any("still hold a response to delta_aileron" in why for why in without["reasons"])
    assert "[[residuals against inputs" in without["methods"][0]["report"]
    late = model(tmp_path, ROLL + 'late_inputs = ["delta_aileron"]\n')
    document = asked(tmp_path / "w", *given, late)
    found = document["methods"][0]["input_correlations"]
    assert abs(found[0]["correlation"]) <= found[0]["bound"]
    assert not any("reservation" in why for why in document["reasons"])
    near(document, ROLL_TRUTH | {"delay_delta_aileron": 0.12})


@pytest.mark.campaign
def test_a_parameter_that_changes_is_followed_where_it_may_walk(tmp_path) -> None:
    time = np.arange(0.0, 20.0, 0.05)

    def aileron(at):
        return sum(doublet(at, 1.0 + 3.0 * k, 0.8, 0.06) for k in range(6))

    def rates(t, x):
        return -(2.1 if t < 10.0 else 1.0) * x - 11.0 * aileron(t)

    (p,) = flown(rates, [0.0], time)
    p = p + 0.003 * np.random.default_rng(6).standard_normal(len(time))
    file = written(tmp_path / "roll.csv", "t,da,p", time, aileron(time), p)
    given = ("estimate", "--record", file, "--method", "output-error", "--method", "ekf", "--model")
    walking = '[[parameter]]\nname = "Lp"\nrandom_walk = 0.3\n'
    document = asked(tmp_path / "w", *given, model(tmp_path, ROLL + walking))
    plain, followed = document["methods"]
    # a jump is no random walk: the filter lags it, says so, and is preferred without being believed
    assert (document["believe"], document["preferred"]) == (None, "ekf")
    assert any("the innovations of ekf are not white" in why for why in document["reasons"])
    assert "Taken as constant: Lp; the random walk is for ekf and ukf." in plain["notes"]
    (history,) = followed["histories"]
    assert (history["record"], history["parameter"], len(history["time"])) == ("roll", "Lp", 200)
    values = np.interp([4.0, 16.0], history["time"], history["value"])
    errors = np.interp([4.0, 16.0], history["time"], history["standard_error"])
    assert np.all(np.abs(values - [-2.1, -1.0]) < 3.0 * errors)
    assert np.all(errors < 0.4)
    refused = aerodb(tmp_path / "w", *given, model(tmp_path, ROLL + walking.replace("0.3", "-0.3")))
    assert refused.returncode == 3
    assert "random_walk" in refused.stderr


def test_a_bound_that_holds_an_estimate_off_is_a_reservation(tmp_path) -> None:
    time = np.arange(0.0, 12.0, 0.02)
    file = written(tmp_path / "roll.csv", "t,da,p", time, *roll(time))
    text = ROLL + '[[parameter]]\nname = "Lp"\nvalue = -1.0\nlower = -1.5\nupper = 0.0\n'
    methods = ("filter-error", "ekf", "principal-components")
    chosen = [word for name in methods for word in ("--method", name)]
    given = ("estimate", "--model", model(tmp_path, text), "--record", file, *chosen)
    document = asked(tmp_path / "w", *given)
    by = {
        entry["method"]: {each["name"]: each for each in entry["estimates"]}
        for entry in document["methods"]
    }
    for name in ("filter-error", "ekf"):
        assert (by[name]["Lp"]["value"], by[name]["Lp"]["standing"]) == (-1.5, "at bound")
        assert "lower bound -1.5" in by[name]["Lp"]["reason"]
    # the others are those most likely at the bound, by both
    assert abs(by["ekf"]["Lda"]["value"] - by["filter-error"]["Lda"]["value"]) < 0.6
    assert any("Lp at a bound" in why for why in document["reasons"])
    assert any("beyond the bounds given" in note for note in document["methods"][2]["notes"])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (ROLL.replace("state_space", "statespace"), "did you mean 'state_space'?"),
        (ROLL.replace('[["Lp"]]', '[["Lp", "Lr"]]'), "a has 1 rows of 2 entries, not 1 of 1"),
        (ROLL.replace('["L0"]', '["L0", "M0"]'), "state_bias has 1 rows of 2 entries"),
        (ROLL.replace('outputs = ["p"]', 'outputs = ["p", "p"]'), "'p' stands twice in outputs"),
        (2 * "[[parameter]]\nname = 'Lp'\n" + ROLL, "'Lp' stands twice in [[parameter]]"),
        ("[state_space\n", "model.toml: not valid TOML"),
    ],
)
def test_a_wrong_model_file_is_refused_by_name(tmp_path, text, said) -> None:
    refused = aerodb(
        tmp_path / "w", "estimate", "--model", model(tmp_path, text), "--record", "roll.csv"
    )
    assert refused.returncode == 3
    assert said in refused.stderr


def test_an_output_that_stands_still_gives_no_estimate_by_any_method(tmp_path) -> None:
    time = np.arange(0.0, 12.0, 0.02)
    file = written(tmp_path / "roll.csv", "t,da,p", time, roll(time)[0], 0.0 * time)
    given = ("estimate", "--model", model(tmp_path, ROLL), "--record", file, "--methods", "all")
    document = asked(tmp_path / "w", *given)
    assert document["believe"] is None
    assert all("output p stands still" in entry["reason"] for entry in document["methods"])


def test_spikes_are_left_out_and_missing_samples_bridged_for_equation_error(tmp_path) -> None:
    time = np.arange(0.0, 12.0, 0.02)
    aileron, p = roll(time)
    p[[100, 400]] = 50.0, -50.0
    p[np.random.default_rng(2).random(len(p)) < 0.1] = np.nan
    file = written(tmp_path / "roll.csv", "t,da,p", time, aileron, p)
    given = ("estimate", "--model", model(tmp_path, ROLL), "--record", file)
    document = asked(tmp_path / "w", *given, "--method", "regression", "--method", "output-error")
    assert any("spikes of p left out (" in note for note in document["notes"])
    plain, _ = document["methods"]
    assert any("missing samples of p bridged" in note for note in plain["notes"])
    near(document, ROLL_TRUTH)
    near({"methods": document["methods"][1:]}, ROLL_TRUTH)
    p[200:220] = np.nan
    written(tmp_path / "roll.csv", "t,da,p", time, aileron, p)
    document = asked(tmp_path / "w", *given, "--method", "regression", "--method", "output-error")
    assert "it has gaps in p" in document["methods"][0]["reason"]
    near({"methods": document["methods"][1:]}, ROLL_TRUTH)


@pytest.mark.parametrize(
    ("header", "text", "said"),
    [
        ("t,da,roll", ROLL, "no column 'p' (columns: t, da, roll)"),
        ("t,da,p", ROLL.replace('"p"', '"w"'), "no column 'w'"),
        ("t,da,p", '[columns]\nq = "p"\n' + ROLL, "no channel 'q'"),
        ("t,da,p", '[columns]\np = "x [deg/s]"\n' + ROLL, "no column 'p'"),
        (
            "t,da,p",
            '[columns]\np = "p [m]"\n' + ROLL,
            "column 'p': unit 'm' cannot be converted to 'rad/s'",
        ),
    ],
)
def test_what_the_file_lacks_is_named_with_a_way_out(tmp_path, header, text, said) -> None:
    time = np.arange(0.0, 12.0, 0.02)
    file = written(tmp_path / "roll.csv", header, time, *roll(time))
    refused = aerodb(tmp_path / "w", "estimate", "--model", model(tmp_path, text), "--record", file)
    assert refused.returncode == 3
    assert said in refused.stderr


def test_a_still_input_and_a_parameter_that_nothing_shows_are_named(tmp_path) -> None:
    time = np.arange(0.0, 12.0, 0.02)
    _, p = roll(time)
    file = written(tmp_path / "roll.csv", "t,da,p", time, 0.0 * time, p)
    given = ("estimate", "--model", model(tmp_path, ROLL), "--record", file)
    (answer,) = asked(tmp_path / "w", *given)["methods"]
    found = {each["name"]: each for each in answer["estimates"]}
    assert found["Lda"]["value"] is None or found["Lda"]["standing"] == "diverged"
    assert found["Lda"]["reason"]
    text = aerodb(tmp_path / "w", *given, "-v").stdout
    assert f"Lda by output-error: {found['Lda']['standing']}, {found['Lda']['reason']}" in text


def test_a_vehicle_or_a_record_and_a_model_that_fits_it_are_asked_for(tmp_path) -> None:
    path = model(tmp_path, ROLL)
    assert "--record" in aerodb(tmp_path / "w", "estimate", "--model", path).stderr
    increments = tmp_path / "increments.toml"
    increments.write_text('[[increment]]\naxis = "Cm"\nterms = ["1"]\n')
    refused = aerodb(tmp_path / "w", "estimate", "--model", str(increments), "--record", "roll.csv")
    assert refused.returncode == 3
    assert "linear model" in refused.stderr


def test_an_output_of_an_estimator_is_a_reservation_and_a_wrong_name_an_error(tmp_path) -> None:
    time = np.arange(0.0, 12.0, 0.02)
    command, p = roll(time)
    log = written(tmp_path / "roll.csv", "time,delta_aileron,p", time, command, p)
    methods = ("--methods", "output-error", "--methods", "regression")

    def answer(line: str):
        text = ROLL.replace('outputs = ["p"]', 'outputs = ["p"]' + line)
        return ("estimate", "--model", model(tmp_path, text), "--record", log, *methods)

    measured = asked(tmp_path / "w", *answer(""))
    assert (measured["believe"], measured["reserved"]) == ("output-error", False)
    made = asked(tmp_path / "w", *answer('\nestimated = ["p"]'))
    assert made["believe"] == made["preferred"] == "regression"
    assert any("output-error fits p, which no sensor measured" in why for why in made["reasons"])
    refused = aerodb(tmp_path / "w", *answer('\nestimated = ["r"]'))
    assert refused.returncode == 3
    assert "no output 'r'" in refused.stderr
