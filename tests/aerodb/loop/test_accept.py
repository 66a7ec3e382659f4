"""What a user asked for and did not get is said with why, and with what would bring it."""

from aerodb.loop import Accept
from aerodb.tracing import Finding


def found(hypothesis: str, verdict: str = "suspected") -> Finding:
    effect, _, axis = hypothesis.partition("@")
    return Finding(
        hypothesis, effect, (axis,), "", verdict, axis, "1", 1.0, (0.9, 1.1), 0.001, (), (), "", "", (),
    )  # type: ignore[arg-type]  # fmt: skip


DAMPING, SLOPE = found("roll_damping@Cl"), found("beta_slope@Cl")


def test_what_was_added_needs_no_reason() -> None:
    accept = Accept(suspected=("roll_damping", "beta_slope@Cl"))
    assert accept.not_added([DAMPING, SLOPE], [DAMPING, SLOPE], ()) == {}


def test_what_was_not_added_has_a_reason_and_a_way() -> None:
    accept = Accept(suspected=("roll_damping",))
    assert accept.not_added([], [], ()) == {"roll_damping": "these flights do not find it"}
    alias = found("roll_damping@Cl", "alias_group")
    (why,) = accept.not_added([alias], [], ()).values()
    assert why == "its verdict is alias group: ask with --accept-lumped"
    (why,) = accept.not_added([found("roll_damping@Cl", "sensor")], [], ()).values()
    assert why == "its verdict is sensor"
    (why,) = accept.not_added([DAMPING], [], {"roll_damping@Cl"}).values()
    assert why == "it lowers no error of flights that did not identify"
    (why,) = accept.not_added([DAMPING, SLOPE, found("flap@CZ")], [], ()).values()
    assert why.endswith("add also --accept-suspected beta_slope@Cl")
    (why,) = accept.not_added([DAMPING], [], ()).values()
    assert why == "with it an axis would become worse"


def test_what_was_asked_for_already_is_no_advice() -> None:
    accept = Accept(suspected=("roll_damping", "beta_slope"))
    reasons = accept.not_added([DAMPING, SLOPE], [], ())
    assert set(reasons.values()) == {"with it an axis would become worse"}
