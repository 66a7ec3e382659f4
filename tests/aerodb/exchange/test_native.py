"""The native database file and stored document: exact round trips and refusals by name."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodb.errors import InputError
from aerodb.exchange.native import (
    database_content_sha256,
    database_document_sha256,
    from_document,
    read_native,
    to_document,
)
from aerodb.nomenclature import AXES
from aerodb.support.identity import canonical_json
from aerodb.tables.database import AeroDatabase, Term, Variable
from aerodb.tables.expression import number, parse
from aerodb.tables.increment import Increment, Interval, RefinedShape, Refit
from aerodb.tables.reference import ReferenceGeometry
from aerodb.tables.table import Table

REFERENCE = """name = "handbook"
[reference]
area = "422.5 ft^2"
chord = "6.5 ft"
span = 19.812
moment_reference = ["-211.8 inch", 0, 0]
"""

TABLES = """
[free_inputs]
thrust_coefficient = "both engines, as the source defines it"
[variables.speed_brake]
expression = "max(delta_speedbrake, 0)"
unit = "rad"
[tables.CZ0]
arguments = ["alpha"]
units = ["deg"]
breakpoints = [[-10, 0, 10]]
values = [1, 0, -1.5]
[tables.dCmT]
arguments = ["mach", "speed brake"]
units = ["", "deg"]
breakpoints = [[0, 1], [0, 30, 60]]
values = [[0, 1, 2], [0, 2, 4]]
[[terms]]
name = "base"
axis = "CZ"
expression = "CZ0(alpha)"
[[terms]]
name = "thrust"
axis = "Cm"
expression = "thrust_coefficient*dCmT(mach, speed_brake)"
"""


def test_handbook_derivatives_are_the_linear_model() -> None:
    """The published equation-error model of the Twin Otter's Cn (f1_017) as a handbook database."""
    text = """
    [derivatives.Cn]
    "1" = 0.000459883
    beta = 0.085436779
    p_hat = -0.051510765
    r_hat = -0.197584751
    delta_aileron = 0.002336487
    delta_rudder = -0.130535343
    """
    database = read_native(REFERENCE + text)
    channels = {
        "beta": 0.05,
        "p": 0.1,
        "r": -0.2,
        "V": 72.0,
        "delta_aileron": 0.02,
        "delta_rudder": np.array([0.1, -0.1]),
    }
    assert database.inputs == tuple(sorted(channels))
    p_hat, r_hat = 0.1 * 19.812 / 144, -0.2 * 19.812 / 144
    steady = (
        0.000459883
        + 0.085436779 * 0.05
        - 0.051510765 * p_hat
        - 0.197584751 * r_hat
        + 0.002336487 * 0.02
    )
    prediction = database.predict(channels).coefficients
    assert prediction["Cn"] == pytest.approx(
        steady - 0.130535343 * channels["delta_rudder"], rel=1e-13
    )
    assert (database.reference.area, database.reference.chord) == pytest.approx(
        (422.5 * 0.3048**2, 6.5 * 0.3048), rel=1e-14
    )
    assert database.reference.moment_reference == pytest.approx(
        (-211.8 * 0.0254, 0.0, 0.0), rel=1e-14
    )
    assert not any(prediction[axis].any() for axis in AXES if axis != "Cn")


def test_tables_in_degrees_variables_and_free_inputs() -> None:
    database = read_native(REFERENCE + TABLES)
    channels = {
        "alpha": np.deg2rad([-5.0, 5.0]),
        "mach": 0.5,
        "delta_speedbrake": np.deg2rad([-9.0, 15.0]),
        "thrust_coefficient": 2.0,
    }
    prediction = database.predict(channels).coefficients
    assert prediction["CZ"] == pytest.approx([0.5, -0.75], rel=1e-13)
    assert prediction["Cm"] == pytest.approx([0.0, 1.5], rel=1e-13)
    with pytest.raises(InputError, match="both engines, as the source defines it"):
        database.predict({name: x for name, x in channels.items() if name != "thrust_coefficient"})


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("-10, 0, 10", "-10, 10, 0", "breakpoints of alpha do not increase"),
        (
            "values = [1, 0, -1.5]",
            "values = [1, 0]",
            r"values have shape \(2,\), the breakpoints \(3,\)",
        ),
        ("values = [1, 0, -1.5]", 'values = [1, 0, "x"]', "not a rectangular list"),
        ("[[0, 1, 2], [0, 2, 4]]", "[[0, 1, 2], [0, 2]]", "not a rectangular list"),
        ("CZ0(alpha)", "CZ0(alhpa)", "did you mean 'alpha'"),
        ("CZ0(alpha)", "CZO(alpha)", "did you mean 'CZ0'"),
        ("CZ0(alpha)", "2*(alpha", r"term base: expected '\)'"),
        ('axis = "CZ"', 'axis = "Cz"', "did you mean 'CZ'"),
        ("arguments", "argumenst", "did you mean 'arguments'"),
        ('"deg"]\nbreakpoints = [[-10', '"psi"]\nbreakpoints = [[-10', "unit 'psi'"),
        ('"6.5 ft"', '"6.5 ft^2"', "reference.chord|unit"),
        ("span = 19.812", "span = -1", "reference.span"),
        ("span = 19.812", "", "reference.span"),
        ("[[terms]]", "[[term]]", "did you mean 'terms'"),
        ('name = "handbook"', "name = [", "not valid TOML"),
    ],
)
def test_faulty_files_are_refused_with_the_place(old: str, new: str, message: str) -> None:
    text = REFERENCE + TABLES
    assert old in text
    with pytest.raises(InputError, match=message) as refusal:
        read_native(text.replace(old, new), "otter.toml")
    assert str(refusal.value).startswith("otter.toml")


def test_derivatives_on_unknown_names_and_empty_files_are_refused() -> None:
    with pytest.raises(InputError, match="did you mean 'alpha'"):
        read_native(REFERENCE + "[derivatives.CZ]\nalpah = 1.0")
    with pytest.raises(InputError, match="did you mean 'Cm'"):
        read_native(REFERENCE + "[derivatives.CM]\nalpha = 1.0")
    with pytest.raises(InputError, match="the key '0' would multiply"):
        read_native(REFERENCE + "[derivatives.CZ]\n0 = 0.3")
    with pytest.raises(InputError, match="neither terms nor derivatives"):
        read_native(REFERENCE)
    with pytest.raises(InputError):
        read_native("")


def full_database(seed: int) -> AeroDatabase:
    rng = np.random.default_rng(seed)
    axes = (np.cumsum(rng.random(4)), np.cumsum(rng.random(3)) - 1)
    tables = {
        "T": Table(
            "T", ("alpha", "mach"), axes, rng.normal(size=(4, 3)) * 10.0 ** rng.integers(-300, 300)
        )
    }
    root = rng.normal(size=(2, 2))
    increment = Increment(
        "Cm",
        (parse("1"), parse("alpha*q_hat")),
        rng.normal(size=2),
        root @ root.T,
        {"alpha": Interval(-0.0, rng.random(), rng.random() / 7)},
        ("flight-a", "flight-b"),
        "why",
    )
    terms = (
        Term("a", "CZ", parse("k*T(alpha, mach)"), "text é"),
        Term("b", "C_drag", number(-rng.random())),
    )
    reference = ReferenceGeometry(rng.random() + 0.1, 1 / 3, 2.0, (-0.0, rng.normal(), 1e-300))
    return AeroDatabase(
        "full",
        reference,
        {"k": Variable(parse("2*x^2"), "m", "d")},
        tables,
        terms,
        (increment,),
        {"x": "free"},
        "d",
        "s",
    )


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2**32 - 1))
def test_stored_document_comes_back_exactly(seed: int) -> None:
    """Through canonical JSON, where 1.0 is written as 1: every number, text and expression, and so
    the hash."""
    database = full_database(seed)
    document = to_document(database)
    again = from_document(json.loads(canonical_json(document)))
    assert canonical_json(to_document(again)) == canonical_json(document)
    assert database_content_sha256(again) == database_content_sha256(database)
    assert [t.expression for t in again.terms] == [t.expression for t in database.terms]
    assert np.array_equal(again.increments[0].covariance, database.increments[0].covariance)
    assert again.increments[0].envelope == database.increments[0].envelope
    assert again.reference == database.reference


def test_content_hash_sees_every_kind_of_number() -> None:
    database = full_database(1)
    table, increment = database.tables["T"], database.increments[0]
    changed = [
        replace(database, reference=replace(database.reference, span=2.0 + 1e-15)),
        replace(database, tables={"T": replace(table, values=table.values * (1 + 1e-15))}),
        replace(
            database,
            tables={
                "T": replace(
                    table, breakpoints=(table.breakpoints[0] + 1e-12, table.breakpoints[1])
                )
            },
        ),
        replace(database, increments=(replace(increment, estimates=increment.estimates + 1e-12),)),
        replace(
            database, increments=(replace(increment, envelope={"alpha": Interval(0.0, 2.0, 0.1)}),)
        ),
        replace(database, increments=()),
    ]
    hashes = {database_content_sha256(each) for each in [database, *changed]}
    assert len(hashes) == len(changed) + 1
    assert database_content_sha256(full_database(1)) == database_content_sha256(database)


def test_document_hash_sees_formulas_too() -> None:
    """What is computed with a database must not be taken for what another formula over the same
    numbers gives."""
    database = full_database(1)
    other = replace(
        database,
        terms=(*database.terms[:-1], replace(database.terms[-1], expression=parse("2*alpha"))),
    )
    assert database_content_sha256(other) == database_content_sha256(database)
    assert database_document_sha256(other) != database_document_sha256(database)
    assert database_document_sha256(full_database(1)) == database_document_sha256(database)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("format", 2, "format 2"),
        ("tabels", {}, "did you mean 'tables'"),
        ("reference", None, "reference"),
        ("terms", "x", "terms"),
    ],
)
def test_documents_of_another_form_are_refused(key: str, value: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        from_document({**to_document(full_database(2)), key: value})


def test_a_ragged_covariance_is_refused() -> None:
    document = to_document(full_database(3))
    document["increments"][0]["covariance"] = [[1.0, 0.0], [0.0]]
    with pytest.raises(InputError, match="covariance"):
        from_document(document)


# Increments that say how they were fitted once more, and how far they fade

LIFT = RefinedShape("alpha_slope@C_lift:flap", "C_lift", ("alpha", "mach"), 0.1234)
RATE = RefinedShape("pitch_damping@Cm", "Cm", ("alpha",), 0.25)


def with_increment(**fields: Any) -> AeroDatabase:
    """A database whose one increment has these fields."""
    database = full_database(3)
    return replace(database, increments=(replace(database.increments[0], **fields),))


@pytest.mark.parametrize("note", ["", "traced: pitch_damping@Cm (confirmed)"])
@pytest.mark.parametrize("refit", [None, Refit(), Refit((LIFT, RATE))])
@pytest.mark.parametrize("cells", [0, 4])
def test_what_increments_say_of_themselves_comes_back(
    note: str, refit: Refit | None, cells: int
) -> None:
    database = with_increment(note=note, refit=refit, lengthened_cells=cells)
    document = json.loads(canonical_json(to_document(database)))
    (written,) = document["increments"]
    assert ("refit" in written, "lengthened_cells" in written) == (refit is not None, cells > 0)
    assert written["note"] == database.increments[0].full_note
    (again,) = from_document(document).increments
    assert (again.note, again.refit, again.lengthened_cells) == (note, refit, cells)
    assert database_document_sha256(from_document(document)) == database_document_sha256(database)


def test_documents_with_a_note_alone_are_decoded() -> None:
    """As earlier releases wrote them: the note holds all, with the error of left-out flights to a
    tenth of a percent."""
    refit = "gain fitted once more beside the rest"
    finer = (
        f"{refit}, shape refined of alpha_slope@C_lift:flap over alpha, mach (left-out flights:"
        " 12.3% less error); pitch_damping@Cm over alpha (left-out flights: 25.0% less error)"
    )
    fade = (
        "held and faded over 4 table cells of alpha each: over one, a slope would change sign"
        " outside the data"
    )
    cases: dict[str, tuple[str, Refit | None, int]] = {
        "why; because": ("why; because", None, 0),
        fade: ("", None, 4),
        f"why; {fade}": ("why", None, 4),
        f"traced: a@Cm (confirmed); {refit}": ("traced: a@Cm (confirmed)", Refit(), 0),
        f"why; {finer}; {fade}": ("why", Refit((replace(LIFT, fall=0.123), RATE)), 4),
    }
    for text, expected in cases.items():
        document = to_document(with_increment(note=text))
        (again,) = from_document(document).increments
        assert (again.note, again.refit, again.lengthened_cells) == expected
        assert again.full_note == text
        assert database_document_sha256(from_document(document)) == database_document_sha256(
            with_increment(note=text)
        )
