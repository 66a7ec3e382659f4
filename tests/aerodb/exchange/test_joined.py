"""A TOML file of parts joined to a database of another file: the sum of both, or a refusal."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange import from_document, joined, read_native, to_document
from aerodb.tables import AeroDatabase
from tests.support.three_wheels import THREE_WHEELS, WITH_AIR

#: The wheels without what the other file has: lengths, and the name.
LEGS = 'name = "legs"\n' + THREE_WHEELS[THREE_WHEELS.index("[free_inputs]") :]
AIR = 'name = "air"\n' + WITH_AIR[WITH_AIR.index("[reference]") : WITH_AIR.index("[free_inputs]")]
AIR += WITH_AIR[WITH_AIR.index("[derivatives.CX]") :]
AT = {
    "V": 40.0, "alpha": 0.02, "beta": 0.03, "qbar": 980.0, "phi": 0.01, "theta": 0.02, "psi": 0.3,
    "p": 0.02, "q": 0.01, "r": -0.03, "height_above_ground": 1.1, "velocity_north": 38.0,
    "velocity_east": 12.0, "velocity_down": 0.1, "brake": 0.5, "steering": 0.01, "cg_x": 0.1,
    "cg_y": 0.0, "cg_z": -0.05,
}  # fmt: skip


def loads(database: AeroDatabase) -> np.ndarray:
    found = database.predict(AT).coefficients
    return np.array([found[axis] for axis in ("CX", "CY", "CZ", "Cl", "Cm", "Cn")])


def test_it_is_the_database_of_one_file_with_both() -> None:
    both = joined(read_native(AIR), LEGS, "legs.toml")
    assert both.name == "air"
    assert np.array_equal(loads(both), loads(read_native(WITH_AIR)))
    assert not np.allclose(loads(both), loads(read_native(AIR)), rtol=1e-2)
    assert to_document(from_document(to_document(both))) == to_document(both)
    assert set(both.parts) == {"nose", "main"}
    assert both.parameters["mu_roll"] == 0.043


def test_expressions_may_use_what_the_other_file_has() -> None:
    known = AIR + '[variables.slow]\nexpression = "1 - V/100"\n'
    term = '[[terms]]\nname = "more"\naxis = "CX"\nexpression = "-0.1*slow"\n'
    both = joined(read_native(known), 'name = "more"\n' + term, "more.toml")
    assert loads(both)[0] - loads(read_native(known))[0] == pytest.approx(-0.06)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (THREE_WHEELS, "legs.toml: [reference]"),
        (LEGS + '[variables.slow]\nexpression = "1"\n', "legs.toml: [variables]"),
        (LEGS.replace('kind = "leg"', 'kind = "log"'), "[parts.nose]"),
        ("name = 3\n", "name"),
    ],
)
def test_what_does_not_fit_is_said_with_its_place(text: str, place: str) -> None:
    known = read_native(AIR + '[variables.slow]\nexpression = "1 - V/100"\n')
    with pytest.raises(InputError) as refused:
        joined(known, text, "legs.toml")
    assert place in str(refused.value)
