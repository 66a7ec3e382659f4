"""``version trim``, ``modes`` and ``sweep`` of a stored version, with its vehicle's masses."""

from pathlib import Path
from typing import Any

import pytest

from tests.support.command import aerodb, asked
from tests.support.shared_workspace import SharedWorkspaces

AT = ("--speed", "25", "--altitude", "500")


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Path:
    root = tmp_path_factory.mktemp("trim") / "workspace"
    shared.updated(root)
    return root


def test_a_glider_glides_with_standard_errors_from_its_estimates(workspace: Path) -> None:
    base = asked(workspace, "version", "trim", "v0001", *AT)
    assert base["standard_errors"] is None
    assert base["channels"]["climb"] < 0
    assert base["inputs"]["delta_elevator"] == pytest.approx(
        -0.6 / 1.1 * base["channels"]["alpha"], abs=1e-9
    )
    updated = asked(workspace, "version", "trim", "candidate", *AT)
    assert 0 < updated["standard_errors"]["alpha"] < 0.01
    assert 0 < updated["standard_errors"]["climb"] < 0.01
    assert updated["standard_errors"]["V"] == 0


def test_modes_come_with_the_linear_model(workspace: Path) -> None:
    found = asked(workspace, "version", "modes", "candidate", *AT)
    names = {mode["name"]: mode for mode in found["modes"]}
    assert {"short period", "phugoid", "roll"} <= set(names)
    assert names["short period"]["standard_errors"]["omega"] > 0
    linear = found["linear"]
    assert len(linear["A"]) == len(linear["states"]) == 8
    assert len(linear["B"][0]) == len(linear["D"][0]) == len(linear["inputs"])
    text = aerodb(workspace, "version", "modes", "candidate", *AT).stdout
    assert "short period" in text
    assert "+-" in text


def test_a_sweep_keeps_what_does_not_trim(workspace: Path) -> None:
    found: dict[str, Any] = asked(
        workspace, "version", "sweep", "candidate", *AT,
        "--variable", "V", "--from", "5", "--to", "35", "--steps", "4",
    )  # fmt: skip
    points = found["points"]
    assert [point["value"] for point in points] == [5.0, 15.0, 25.0, 35.0]
    assert "lift is too small by 82 % of the weight" in points[0]["reason"]
    assert "table CZ0 is left" in points[0]["reason"]
    assert points[2]["channels"]["alpha"] > points[3]["channels"]["alpha"]
    text = aerodb(
        workspace, "version", "sweep", "candidate", *AT,
        "--variable", "V", "--from", "5", "--to", "35", "--steps", "4",
    ).stdout  # fmt: skip
    assert "no trim" in text


def test_a_held_sweep_gives_the_coefficients_along_a_rate(workspace: Path) -> None:
    """As the version evaluates there: the handbook's Cm has -12 q c/(2 V)."""
    held = ("--variable", "q", "--from", "-10deg/s", "--to", "10deg/s", "--steps", "3", "--hold")
    found = asked(workspace, "version", "sweep", "candidate", *AT, *held)
    moments = [point["coefficients"]["Cm"] for point in found["points"]]
    assert moments[1] == pytest.approx(0.0, abs=1e-7)
    rate = 0.17453292519943295 * 0.25 / 50.0
    assert moments[2] - moments[1] == pytest.approx(-12.0 * rate, rel=1e-6)
    point, trimmed = found["points"][2], found["channels"]
    at = f"alpha={trimmed['alpha']},q={point['value']},V=25,delta_elevator="
    value = asked(
        workspace, "version", "evaluate", "candidate",
        "--at", f"{at}{found['inputs']['delta_elevator']}",
    )  # fmt: skip
    assert point["coefficients"]["CZ"] == pytest.approx(value["coefficients"]["CZ"], abs=1e-9)
    assert point["standard_errors"]["CZ"] == pytest.approx(value["standard_errors"]["CZ"], rel=1e-3)
    text = aerodb(workspace, "version", "sweep", "candidate", *AT, *held).stdout
    assert "CZ" in text


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (("--sideslip", "20deg"), "no steady flight"),
        (("--glide", "--climb", "0"), "--glide and --climb"),
        (("--set", "delta_elevater=1deg"), "did you mean 'delta_elevator'"),
        (("--set", "nothing"), "is not NAME=VALUE"),
        (("--control", "pich=delta_elevator"), "did you mean 'pitch'"),
        (("--fuel", "3 kg"), "its mass is constant"),
        (("--bank", "10deg", "--load-factor", "2"), "load factor and bank together"),
        (
            (
                "--bank",
                "10 apples",
            ),
            "apples",
        ),
    ],
)
def test_refusals_say_what_to_do(workspace: Path, wrong: tuple[str, ...], said: str) -> None:
    refused = aerodb(workspace, "version", "trim", "candidate", *AT, *wrong)
    assert refused.returncode == 3
    assert said in refused.stderr
    assert refused.stdout == ""


def test_the_next_permitted_point_says_what_stops_it(workspace: Path) -> None:
    """Full step with wide margins; none beyond the angle of attack that is permitted."""
    ask = ("version", "expand", "candidate", *AT, "--variable", "V", "--from", "25", "--to", "23",
           "--step", "1", "--growth-rate", "10")  # fmt: skip
    full = asked(workspace, *ask)
    assert full["value"] == 24.0
    assert not full["reached"]
    assert full["stopped_by"] == []
    at = asked(workspace, "version", "trim", "candidate", *AT)["channels"]["alpha"]
    short = asked(workspace, *ask, "--growth", "CZ:alpha=0.1", "--limit", f"alpha=0:{at + 0.005}")
    assert 24.0 < short["value"] < 25.0
    assert "alpha" in short["stopped_by"][0]


def test_what_flights_tell_of_declared_terms_decides_how_far_the_next_point_may_be(
    workspace: Path, tmp_path: Path
) -> None:
    """Flights determine the terms; without any, each needs a prior, and the vaguer that is, the
    shorter is the step."""
    slow = asked(workspace, "version", "trim", "candidate", "--speed", "23", *AT[2:])
    most = slow["channels"]["alpha"] + 0.01
    ask = ("version", "expand", "candidate", *AT, "--variable", "V", "--from", "25", "--to", "23",
           "--step", "2", "--growth-rate", "10", "--limit", f"alpha=0:{most}")  # fmt: skip
    file = tmp_path / "model.toml"
    terms = '[[increment]]\naxis = "CZ"\nterms = ["1", "alpha"]\n'
    file.write_text(terms)
    found = asked(workspace, *ask, "--model", str(file))
    known = {each["parameter"]: each["standard_error"] for each in found["known"]}
    assert set(known) == {"CZ_0", "CZ_alpha"}
    assert 0.0 < known["CZ_alpha"] < 1.0
    assert (found["value"], found["reached"]) == (23.0, True)
    refused = aerodb(workspace, *ask, "--model", str(file), "--flights", "none")
    assert refused.returncode == 3
    assert "the flights tell nothing of CZ_0" in refused.stderr

    def step(sigma: float) -> float:
        file.write_text(terms + f'prior = {{ "1" = [0.0, 1e-4], alpha = [0.0, {sigma}] }}\n')
        return asked(workspace, *ask, "--model", str(file), "--flights", "none")["value"]

    assert 23.0 == step(0.01) < step(1.5) < 25.0
