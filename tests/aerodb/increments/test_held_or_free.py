"""Whether the terms of a database are freed beside declared ones: by their held-out errors."""

from dataclasses import replace

import pytest

from aerodb.errors import InputError
from aerodb.increments import (
    DeclaredIncrement,
    ModelFile,
    choose_hold_out,
    held_or_free,
    with_all_terms_free,
)
from aerodb.loop import estimate_declared, validate_declared
from aerodb.tables import AeroDatabase, Term, parse
from tests.support import six_surfaces

NEW = ModelFile(
    increment=tuple(
        DeclaredIncrement(axis=axis, terms=("delta_stabilator_left", "delta_stabilator_right"))
        for axis in ("CY", "Cl", "Cn")
    )
)


def with_wrong_yaw() -> AeroDatabase:
    """The nominal database with half of its yawing moment by sideslip."""
    nominal = six_surfaces.database(False)
    true = six_surfaces.nominal()["Cn"]["beta"]
    halved = [
        replace(term, expression=parse(f"{0.5 * true!r}*beta")) if term.name == "Cn_beta" else term
        for term in nominal.terms
    ]
    return replace(nominal, terms=tuple(halved))


def judged(database: AeroDatabase):
    """Six legs with the left stabilator locked and logged so, two of them held out."""
    source = six_surfaces.legs(range(6), six_surfaces.database())
    split = choose_hold_out(tuple(source.flown), {})
    proofs = []
    for model in (NEW, with_all_terms_free(NEW, database)):
        update = estimate_declared(source, split.identified, model, database)
        proofs.append(validate_declared(source, split, update, model, database)[0])
    return held_or_free([each.axis for each in NEW.increment], *proofs)


def test_a_right_database_is_held() -> None:
    found = judged(six_surfaces.database(False))
    assert found.keep == "held"
    assert set(found.errors) == {"CY", "Cl", "Cn"}
    before, held, free = found.errors["Cn"]
    assert held < 0.8 * before
    assert held == pytest.approx(free, rel=0.05)


def test_a_wrong_one_is_freed() -> None:
    found = judged(with_wrong_yaw())
    assert found.keep == "free"
    assert "Cn" in found.because
    _, held, free = found.errors["Cn"]
    assert free < 0.8 * held


def test_what_cannot_be_compared_is_said() -> None:
    nominal = six_surfaces.database(False)
    with pytest.raises(InputError, match="no flight is held out"):
        held_or_free(["CY"], [], [])
    squared = replace(nominal, terms=(*nominal.terms, Term("odd", "CY", parse("sin(beta)"))))
    with pytest.raises(InputError, match="'odd' is no number times"):
        with_all_terms_free(NEW, squared)
    with pytest.raises(InputError, match="declares no increments"):
        with_all_terms_free(ModelFile(parameters=("one",)), nominal)
