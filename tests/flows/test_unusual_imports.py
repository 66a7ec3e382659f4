"""First imports that no aircraft is: said at import, not released, and released with a reason."""

from pathlib import Path

import pytest

from aerodb.exchange.native import read_native
from aerodb.tables import unusual_content
from tests.support import effect_flights
from tests.support.command import aerodb, asked
from tests.support.jsbsim_flights import aircraft_file
from tests.support.small_glider import DATABASE, NAME, VEHICLE

#: What is wrong in the file -> what replaces what, and a word of the sentence.
WRONG = {
    "drag of the other sign": ({'"1" = -0.03': '"1" = 0.2'}, "negative"),
    "damping reversed": ({"q_hat = -12.0": "q_hat = 12.0", "p_hat = -0.5": "p_hat = 0.5"}, "roll, pitch"),
    "moment reference not given": ({"[-0.4, 0.0, 0.0]": "[0.0, 0.0, 0.0]"}, "chords from the CG"),
    "slopes per degree": (
        {"[0.05, -0.3, -0.65, -1.0, -1.3]": "[-0.294, -0.3, -0.306, -0.312, -0.317]"},
        "per degree",
    ),
    "roll and yaw exchanged": (
        {"[derivatives.Cl]": "[derivatives.X]", "[derivatives.Cn]": "[derivatives.Cl]",
         "[derivatives.X]": "[derivatives.Cn]"},
        "exchanged",
    ),
    "side force of the other sign": ({"beta = -0.3": "beta = 0.3"}, "side force opposes"),
    "no Cm": (
        {"[derivatives.Cm]\nalpha = -0.6\nq_hat = -12.0\ndelta_elevator = -1.1\n": ""},
        "Cm is missing",
    ),
}  # fmt: skip


def wrong(kind: str) -> str:
    text = DATABASE
    for one, other in WRONG[kind][0].items():
        assert text.count(one) == 1, one
        text = text.replace(one, other)
    if kind == "roll and yaw exchanged":  # beta and p then act on the other axis
        assert read_native(text).terms != read_native(DATABASE).terms
    return text


@pytest.mark.parametrize("kind", WRONG)
def test_what_no_aircraft_has_is_said_and_not_released(kind: str, tmp_path: Path) -> None:
    (tmp_path / "vehicle.toml").write_text(VEHICLE, encoding="utf-8")
    file = tmp_path / "database.toml"
    file.write_text(wrong(kind), encoding="utf-8")
    asked(tmp_path / "w", "vehicle", "add", str(tmp_path / "vehicle.toml"))
    document = asked(tmp_path / "w", "database", "import", str(file), "--vehicle", NAME)
    assert len(document["unusual"]) == 1, document["unusual"]
    assert WRONG[kind][1] in document["unusual"][0]
    assert not document["released"]
    promote = ("version", "promote", document["label"], "--name", "released", "--reason", "a wing")
    refused = aerodb(tmp_path / "w", *promote, "--vehicle", NAME)
    assert refused.returncode == 4
    assert "--accept content" in refused.stderr
    moved = asked(tmp_path / "w", *promote, "--vehicle", NAME, "--accept", "content")
    assert moved["moved"]


def test_right_databases_are_released_as_before(tmp_path: Path) -> None:
    (tmp_path / "vehicle.toml").write_text(VEHICLE, encoding="utf-8")
    (tmp_path / "database.toml").write_text(DATABASE, encoding="utf-8")
    asked(tmp_path / "w", "vehicle", "add", str(tmp_path / "vehicle.toml"))
    path = str(tmp_path / "database.toml")
    document = asked(tmp_path / "w", "database", "import", path, "--vehicle", NAME)
    assert document["released"]
    assert document["unusual"] == []


@pytest.mark.parametrize(
    "name", ["737", "f16", "c172x", "T38", "B747", "ah1s", "Concorde", "J3Cub", "fokker50", "pc7"]
)
def test_aircraft_of_jsbsim_hold_nothing_unusual(name: str) -> None:
    from aerodb.exchange.jsbsim.reader import import_jsbsim

    assert unusual_content(import_jsbsim(aircraft_file(name), name=name.lower())) == ()
    assert unusual_content(effect_flights.database()) == ()


@pytest.mark.parametrize(
    ("rolling", "yawing", "lift", "word"),
    [
        ("delta_rudder = -0.2\ndelta_aileron = 0.02", "delta_rudder = -0.01\ndelta_aileron = -0.07",
         "", "the two are exchanged"),
        ("delta_rudder = 0.02\ndelta_aileron = -0.2", "delta_rudder = -0.07\ndelta_aileron = -0.01",
         "[derivatives.C_lift]\nbeta = 5.0\n", "alpha and beta are exchanged"),
        ("delta_rudder = 0.02\ndelta_aileron = -0.2\nq_hat = -12.5",
         "delta_rudder = -0.07\ndelta_aileron = -0.01", "", "pitch rate acts on Cl"),
        ("delta_rudder = 0.02\ndelta_aileron = -0.2", "delta_rudder = -0.07\ndelta_aileron = -0.01",
         "", ""),
    ],
    ids=["aileron and rudder", "lift by sideslip", "pitch and roll", "right"],
)  # fmt: skip
def test_what_is_exchanged_is_said(rolling: str, yawing: str, lift: str, word: str) -> None:
    text = DATABASE.replace("p_hat = -0.5", f"p_hat = -0.5\n{rolling}")
    text = text.replace("beta = 0.06", f"beta = 0.06\n{yawing}") + lift
    found = unusual_content(read_native(text))
    assert len(found) == (1 if word else 0), found
    assert all(word in each for each in found)
