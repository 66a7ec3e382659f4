"""JSBSim operations, frames and tables that its aircraft hardly use, compared with JSBSim."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.exchange.jsbsim import import_jsbsim
from aerodb.storage.writers.jsbsim_executive import loaded_in_jsbsim
from aerodb.tables.database import AeroDatabase, Term
from aerodb.tables.expression import Name
from tests.support.jsbsim_flights import FOOT, centre_of_gravity, compare, own_coefficients

METRICS = """<metrics><wingarea unit="FT2">200</wingarea><wingspan unit="FT">30</wingspan><chord unit="FT">6</chord>
<location name="AERORP" unit="IN"><x>40</x><y>3</y><z>-5</z></location></metrics>"""
MASS = """<mass_balance><ixx unit="SLUG*FT2">900</ixx><iyy unit="SLUG*FT2">900</iyy><izz unit="SLUG*FT2">900</izz>
<emptywt unit="LBS">900</emptywt><location name="CG" unit="IN"><x>52</x><y>-2</y><z>7</z></location></mass_balance>
<ground_reactions/><system name="given"><property value="0">t/x</property><property value="0">t/y</property></system>"""
QS = "<p>aero/qbar-psf</p><p>metrics/Sw-sqft</p>"

X, Y = "<p>t/x</p>", "<p>t/y</p>"
OPERATIONS = {
    **{
        name: f"<{name}>{X}{Y}</{name}>"
        for name in ("gt", "ge", "lt", "le", "eq", "nq", "min", "max", "atan2", "fmod")
    },
    **{
        name: f"<{name}>{X}</{name}>"
        for name in ("sign", "floor", "ceil", "abs", "exp", "toradians", "todegrees", "sin")
    },
    **{name: f"<{name}><abs>{X}</abs></{name}>" for name in ("sqrt", "ln", "log2", "log10")},
    "avg": f"<avg>{X}{Y}<v>3</v></avg>",
    "pi": f"<product><pi/>{X}</product>",
    "pow": f"<pow><abs>{X}</abs>{Y}</pow>",
    "and": f"<and><gt>{X}<v>0</v></gt><lt>{Y}<v>1</v></lt></and>",
    "or": f"<or><gt>{X}<v>0</v></gt><lt>{Y}<v>1</v></lt></or>",
    "not": f"<not><gt>{X}{Y}</gt></not>",
    "ifthen": f"<ifthen><gt>{X}{Y}</gt><product>{X}<v>2</v></product>{Y}</ifthen>",
    "switch": f"<switch><min><max>{X}<v>0</v></max><v>2.2</v></min><v>5</v>{Y}<v>7</v></switch>",
    "interpolation": (
        f"<interpolate1d>{X}<v>-1</v><v>4</v><v>0.5</v>{Y}<v>1</v><product>{X}{X}</product></interpolate1d>"
    ),
}


def test_every_operation_equals_jsbsim() -> None:
    """Random numbers, and pairs on which comparisons turn."""
    functions = "".join(
        f'<function name="t/{name}-of">{text}</function>' for name, text in OPERATIONS.items()
    )
    text = f"<fdm_config name='t'>{METRICS}{MASS}<aerodynamics>{functions}</aerodynamics></fdm_config>".encode()
    database, executive, rng = (
        import_jsbsim(text, name="t"),
        loaded_in_jsbsim(text),
        np.random.default_rng(41),
    )
    pairs = [
        (0.0, 0.0),
        (1.0, 1.0),
        (-1.0, 2.0),
        (0.5, -0.5),
        *rng.uniform(-3, 3, (60, 2)).tolist(),
    ]
    channels = dict(zip(("t_x", "t_y"), np.array(pairs).T, strict=True))
    ours = {}
    for name in OPERATIONS:
        term = Term(name, "CX", Name(f"t_{name}_of"))
        ours[name] = replace(database, terms=(term,)).predict(channels).coefficients["CX"]
    for row, (x, y) in enumerate(pairs):
        executive["t/x"], executive["t/y"] = x, y
        executive.run_ic()
        for name in OPERATIONS:
            theirs = executive[f"t/{name}-of"]
            if not abs(theirs) < 1e300:  # a logarithm of zero, a remainder of nothing
                assert not abs(ours[name][row]) < 1e300
            else:
                assert ours[name][row] == pytest.approx(theirs, rel=1e-14, abs=1e-14), (name, x, y)


def errors_of(aerodynamics: str, seed: int) -> float:
    """Largest error of an import over 1e-9 at random angles, with the centre of gravity off the
    reference point."""
    text = (
        "<fdm_config"
        f" name='t'>{METRICS}{MASS}<aerodynamics>{aerodynamics}</aerodynamics></fdm_config>".encode()
    )
    database, executive, rng = (
        import_jsbsim(text, name="t"),
        loaded_in_jsbsim(text),
        np.random.default_rng(seed),
    )
    rows, theirs = [], []
    for _ in range(20):
        executive["ic/vt-fps"], executive["ic/h-sl-ft"] = 200.0, 3000.0
        executive["ic/alpha-rad"], executive["ic/beta-rad"] = rng.uniform(-0.6, 0.6, 2)
        executive.run_ic()
        rows.append(
            (
                executive["aero/alpha-rad"],
                executive["aero/beta-rad"],
                executive["aero/qbar-psf"] * 4.4482216152605 / FOOT**2,
            )
        )
        theirs.append(own_coefficients(executive))
    channels = dict(zip(("alpha", "beta", "qbar"), np.array(rows).T, strict=True))
    return max(
        compare(
            database, channels, np.array(centre_of_gravity(executive)), np.array(theirs)
        ).values()
    )


def axis(name: str, frame: str, number: float, length: str = "") -> str:
    factors = QS + (f"<p>metrics/{length}-ft</p>" if length else "")
    attribute = f' frame="{frame}"' if frame else ""
    return (
        f'<axis name="{name}"{attribute}><function name="aero/{name}">'
        f"<product>{factors}<v>{number}</v><sum><v>1</v><p>aero/alpha-rad</p></sum></product></function></axis>"
    )


@pytest.mark.parametrize("moments", ["", "BODY", "STABILITY", "WIND"])
@pytest.mark.parametrize("forces", ["", "BODY", "STABILITY", "WIND"])
def test_frames_of_forces_and_moments(forces: str, moments: str) -> None:
    axes = [axis(name, forces, number) for name, number in (("X", 0.1), ("Y", 0.3), ("Z", 0.7))]
    lengths = (("ROLL", 0.02, "bw"), ("PITCH", 0.05, "cbarw"), ("YAW", 0.03, "bw"))
    axes += [axis(name, moments, number, length) for name, number, length in lengths]
    assert errors_of("".join(axes), 42) <= 1.0


@pytest.mark.parametrize("system", [("DRAG", "SIDE", "LIFT"), ("AXIAL", "SIDE", "NORMAL")])
def test_reference_point_shift_in_other_force_systems(system: tuple[str, ...]) -> None:
    shift = """<aero_ref_pt_shift_x><function name="t/shift"><product><v>0.3</v><p>aero/alpha-rad</p></product></function>
    </aero_ref_pt_shift_x>"""
    axes = [axis(name, "", number) for name, number in zip(system, (0.1, 0.3, 0.7), strict=True)]
    assert errors_of(shift + "".join(axes) + axis("PITCH", "", 0.05, "cbarw"), 43) <= 1.0


FOUR = """<table><independentVar lookup="row">aero/alpha-rad</independentVar>
<independentVar lookup="column">aero/beta-rad</independentVar><independentVar lookup="table">aero/mag-beta-rad</independentVar>
<independentVar lookup="axis4">aero/alpha-deg</independentVar>
<tableData breakPoint="-20"><tableData breakPoint="0">
 -0.3 0.1 0.4
-0.2 1 2 5
0.3 2 7 1
</tableData><tableData breakPoint="0.3">
 -0.3 0.2
-0.5 3 1
0.1 0 2
</tableData></tableData>
<tableData breakPoint="15"><tableData breakPoint="0.1">
 -0.3 0.4
-0.2 9 2
0.3 2 1
</tableData><tableData breakPoint="0.2">
 -0.3 0.2
-0.2 3 1
0.1 8 2
</tableData></tableData></table>"""


def four_dimensions() -> tuple[str, AeroDatabase]:
    lift = (
        '<axis name="LIFT"><function'
        f' name="aero/four"><product>{QS}{FOUR}</product></function></axis>'
    )
    text = f"<fdm_config name='t'>{METRICS}{MASS}<aerodynamics>{lift}</aerodynamics></fdm_config>"
    return lift, import_jsbsim(text.encode(), name="t")


def test_four_dimensional_table_with_slices_on_different_breakpoints() -> None:
    lift, database = four_dimensions()
    assert database.tables["four"].values.shape == (4, 4, 4, 2)
    assert errors_of(lift, 44) <= 1.0


def test_a_property_with_the_name_of_a_surface_is_an_input_of_its_own() -> None:
    """``delta-x`` becomes ``_delta_x``: counting up behind ``delta_x`` gave surface after surface,
    for ever."""
    axis = (
        "<axis name='LIFT'><function"
        f" name='a'><product>{QS}<p>delta-x</p></product></function></axis>"
    )
    text = (
        f"<fdm_config name='t'>{METRICS}<aerodynamics>{axis}</aerodynamics></fdm_config>".encode()
    )
    database = import_jsbsim(text, name="t")
    assert any("delta_x" in name and name.startswith("_") for name in database.inputs), (
        database.inputs
    )
