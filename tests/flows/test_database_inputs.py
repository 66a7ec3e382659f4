"""What a database needs and flights lack is asked for by name, by command: the Twin Otter beside the
DHC-6 of JSBSim, and a small glider whose database knows an engine."""

from pathlib import Path

import jsbsim
import numpy as np
import pytest

from tests.support.command import aerodb, asked
from tests.support.paths import VEHICLES
from tests.support.small_glider import AREA, CHORD, DATABASE, NAME, VEHICLE, channels, write_csv

#: The small glider as JSBSim has it: drag of a spoiler that no log holds, lift of alphadot.
AIRCRAFT = f"""<fdm_config name="g"><metrics><wingarea unit="M2">{AREA}</wingarea>
<wingspan unit="M">3.6</wingspan><chord unit="M">{CHORD}</chord>
<location name="AERORP" unit="M"><x>0.4</x><y>0</y><z>0</z></location></metrics><aerodynamics>
<axis name="DRAG"><function name="aero/brake"><product><property>aero/qbar-psf</property>
<property>metrics/Sw-sqft</property><property>fcs/brake-norm</property><value>0.02</value></product>
</function></axis><axis name="LIFT"><function name="aero/lift"><product>
<property>aero/qbar-psf</property><property>metrics/Sw-sqft</property>
<property>aero/alpha-rad</property><value>5.0</value></product></function>
<function name="aero/flap"><product><property>aero/qbar-psf</property>
<property>metrics/Sw-sqft</property><property>fcs/flap-pos-rad</property><value>0.5</value>
</product></function></axis><axis name="PITCH"><function name="aero/moment"><product>
<property>aero/qbar-psf</property><property>metrics/Sw-sqft</property>
<property>metrics/cbarw-ft</property><property>aero/alpha-rad</property><value>-0.6</value>
</product></function></axis></aerodynamics></fdm_config>"""


@pytest.fixture
def glider(tmp_path):
    (tmp_path / "vehicle.toml").write_text(VEHICLE, encoding="utf-8")
    (tmp_path / "g.xml").write_text(AIRCRAFT, encoding="utf-8")
    asked(tmp_path / "w", "vehicle", "add", str(tmp_path / "vehicle.toml"))
    return tmp_path / "w", ("database", "import", str(tmp_path / "g.xml"), "--vehicle", NAME)


def ingested(workspace: Path, seeds=(1, 2)):
    logs = [str(write_csv(workspace / f"{seed}.csv", channels(seed))) for seed in seeds]
    return asked(workspace, "flight", "ingest", *logs, "--vehicle", NAME, "--direct")


def uses(document):
    return {use["name"]: use for use in document["uses"]}


def test_lacking_inputs_are_named_proposed_and_taken_by_one_flag(glider):
    workspace, importing = glider
    first = asked(workspace, *importing)
    assert first["lacking"] == ["fcs_brake_norm"]  # no flight yet: what no log can hold
    assert "once flights are stored" in uses(first)["fcs_brake_norm"]["sentence"]
    (flight, _) = ingested(workspace)
    assert "aerodb database inputs" in flight["comparison"]["reason"]

    asking = asked(workspace, "database", "inputs", "--vehicle", NAME)
    assert asking["lacking"] == ["delta_flap", "fcs_brake_norm"]
    brake = uses(asking)["fcs_brake_norm"]
    assert (brake["binding"], brake["accepted"]) == ("zero", False)
    (effect,) = brake["effects"]
    assert (effect["axis"], effect["change"]) == ("C_drag", pytest.approx(0.02))  # full travel

    taken = asked(workspace, *importing, "--accept-proposals")
    assert taken["held"] == ["delta_flap", "fcs_brake_norm"]
    assert taken["lacking"] == []
    assert taken["released"]  # in place of the first, of which nothing was made
    assert all(use["accepted"] for use in taken["uses"])
    shown = asked(workspace, "version", "show", "released")
    assert shown["settings"]["held"] == shown["report"]["held_at_zero"] == taken["held"]
    again = asked(workspace, "flight", "show", flight["flight"])
    assert again["flight"] == flight["flight"]
    assert ingested(workspace, (3,))[0]["comparison"]["axes"]  # now it can be compared


def test_another_aircraft_and_a_removed_control_are_warned_of(glider):
    workspace, importing = glider
    ingested(workspace, (1,))
    assert asked(workspace, *importing)["warnings"] == []
    other = jsbsim.get_default_root_dir() + "/aircraft/c172x/c172x.xml"
    done = aerodb(workspace, "database", "import", other, "--vehicle", NAME)
    said = [
        line for line in done.stderr.splitlines() + done.stdout.splitlines() if "WARNING" in line
    ]
    assert "its moments are about (-1.097, 0, -1.509) m, 1.1 chords from the CG" in said[0]
    assert f"area is 16.17 m^2, the vehicle file's {AREA} m^2: is it the same" in said[1]
    assert "zero for delta_rudder removes the rudder" in said[4]
    assert "zero for fcs/effective-aileron-pos removes the aileron" in said[5]
    warned = asked(workspace, "database", "import", other, "--vehicle", NAME, "--accept-proposals")
    assert [(each["kind"], each["name"]) for each in warned["warnings"][:3]] == [
        ("other_reference", name) for name in ("area", "span", "chord")
    ]
    assert [each["control"] for each in warned["warnings"][3:]] == ["rudder", "aileron"]


def test_a_hump_of_ground_effect_is_warned_of(glider):
    workspace, importing = glider
    file = jsbsim.get_default_root_dir() + "/aircraft/c172p/c172p.xml"
    found = asked(workspace, "database", "import", file, "--vehicle", NAME)["warnings"]
    (uneven,) = [each for each in found if each["kind"] == "uneven_table"]
    assert "1.046, 1.055, 1.019" in uneven["sentence"]
    assert not any(w["kind"] == "uneven_table" for w in asked(workspace, *importing)["warnings"])


def test_what_flights_have_is_not_asked_for(glider):
    workspace, importing = glider
    ingested(workspace, (1,))
    log = {**channels(5), "delta_flap": np.full_like(channels(5)["time"], 0.1)}
    path = write_csv(workspace / "flap.csv", log)
    asked(workspace, "flight", "ingest", str(path), "--vehicle", NAME, "--direct")
    assert asked(workspace, *importing)["lacking"] == ["fcs_brake_norm"]


# The Twin Otter


@pytest.fixture(scope="module")
def twin_otter(measured, tmp_path_factory):
    """Records and database, imported as a new user would, with what it answers."""
    root = tmp_path_factory.mktemp("twin-otter") / "w"
    names = ("demo", "f1_017")
    logs = [str(measured(f"twin_otter/totter_{name}_data.mat")) for name in names]
    aircraft = Path(jsbsim.get_default_root_dir()) / "aircraft" / "DHC6" / "DHC6.xml"
    asked(root, "vehicle", "add", str(VEHICLES / "twin_otter.toml"))
    asked(root, "flight", "ingest", *logs, "--vehicle", "twin-otter", "--direct")
    importing = ("database", "import", str(aircraft), "--vehicle", "twin-otter")
    return root, importing, asked(root, *importing, "--accept-proposals")


def test_twin_otter_needs_no_bindings_that_only_an_expert_knows(twin_otter):
    _, _, document = twin_otter
    assert document["held"] == ["fcs_speedbrake_pos_norm", "systems_propulsion_thrust_coefficient"]
    assert "delta_flap" in document["inputs"]  # of which Systems/Flaps.xml makes fcs/flap-pos-norm
    motion = {use["name"]: use for use in document["uses"] if use["binding"] == "motion"}
    assert set(motion) == {"alphadot", "aero_mag_beta_rad", "fcs_mag_elevator_pos_rad"}


@pytest.mark.campaign
def test_an_update_says_what_is_held_and_ends_the_release_of_what_is_imported(twin_otter):
    root, importing, _ = twin_otter
    model = str(VEHICLES / "twin_otter_increments.toml")
    update = asked(
        root,
        "update",
        "--vehicle",
        "twin-otter",
        "--model",
        model,
        "--hold-out",
        "none",
        "--direct",
    )
    said = [remark for remark in update["remarks"] if "held at zero" in remark]
    assert len(said) == 3
    bound = asked(root, *importing, "--accept-proposals", "--bind", "fcs/mag-elevator-pos-rad=0.01")
    assert not bound["released"]


def test_drag_of_sideslip_is_what_the_flights_speak_against(twin_otter):
    """The file's table of drag over |beta| is larger than what these flights have: the residual of
    C_drag falls to a third without it, and the line that leaves it out is said."""
    root, _, document = twin_otter
    (beta,) = [use for use in document["uses"] if use["name"] == "aero_mag_beta_rad"]
    (drag,) = [each for each in beta["residuals"] if each["axis"] == "C_drag"]
    assert drag["with_zero"] < 0.5 * drag["now"]
    printed = aerodb(root, "database", "inputs").stdout
    assert "on C_drag the flights speak for zero: --bind aero/mag-beta-rad=0" in printed


def test_what_was_bound_to_zero_is_told_against_the_flights_own_values(twin_otter):
    root, importing, document = twin_otter
    bound = asked(root, *importing, "--accept-proposals", "--bind", "fcs/mag-elevator-pos-rad=0")
    (elevator,) = [use for use in bound["uses"] if "mag-elevator" in use["source"]]
    (before,) = [use for use in document["uses"] if "mag-elevator" in use["source"]]
    assert elevator["binding"] == "zero"
    assert before["binding"] == "motion"
    assert elevator["effects"][0]["axis"] == "C_drag"
    assert elevator["effects"][0]["change"] == pytest.approx(before["effects"][0]["change"])


RATIO = AIRCRAFT.replace(
    "<property>aero/alpha-rad</property><value>5.0</value>",
    "<property>aero/alpha-rad</property><quotient><property>aircraft/wing/S-ft2</property>"
    "<property>{}</property></quotient><value>5.0</value>",
).replace("fcs/brake-norm", "aero/mach-unknown")


@pytest.mark.parametrize("divisor", ["aircraft/wing/S-ft2", "other/span-of-sim"])
def test_zero_is_not_proposed_for_what_divides(glider, divisor):
    """Both inputs alone at zero: 0/0, or a number over zero, leave the lift without a value."""
    workspace, importing = glider
    Path(importing[2]).write_text(RATIO.format(divisor), encoding="utf-8")
    document = asked(workspace, *importing)
    (name,) = document["dividing"]
    assert document["written"][name] == divisor
    assert f"{divisor}=0" not in document["proposals"][name]
    assert document["without_values"] == []
    assert not document["released"]
    printed = aerodb(workspace, *importing).stdout
    assert "the database divides by it: not released" in printed
    assert f"--bind {divisor}=NUMBER" in printed
    assert "to take all zeros" not in printed
    refused = aerodb(workspace, *importing, "--accept-proposals")
    assert refused.returncode != 0
    assert f"the database divides by {divisor}" in refused.stderr
    assert f"--bind {divisor}=NUMBER" in refused.stderr
    others = [f"{written}=174" for written in ("aircraft/wing/S-ft2", divisor)]
    bound = asked(
        workspace,
        *importing,
        *(word for text in dict.fromkeys(others) for word in ("--bind", text)),
        "--accept-proposals",
    )
    assert bound["without_values"] == []
    assert bound["dividing"] == []


SUM = "<sum><property>other/a</property><property>other/b</property></sum>"
INTAKE = """<table><independentVar lookup="row">aero/intake</independentVar>
<tableData>0 1.0
5 2.0</tableData></table>"""


@pytest.mark.parametrize("above", ["<value>2</value>", "<property>other/flow</property>"])
@pytest.mark.parametrize("below", ["<property>other/a</property>", SUM])
def test_a_divisor_that_a_table_hides_is_found(glider, above, below):
    """A table takes an infinite argument for its end, and 0/0 comes of all zeros together only."""
    workspace, importing = glider
    text = AIRCRAFT.replace("<value>5.0</value>", INTAKE).replace(
        "<aerodynamics>",
        f"<aerodynamics><function name='aero/intake'><quotient>{above}{below}</quotient></function>",
    )
    Path(importing[2]).write_text(text, encoding="utf-8")
    document = asked(workspace, *importing)
    divide = {"other_a", "other_b"} if below == SUM else {"other_a"}
    assert set(document["dividing"]) == divide
    assert not document["released"]
    for name in divide:
        assert f"{document['written'][name]}=0" not in document["proposals"][name]


@pytest.mark.parametrize(
    ("expression", "held"),
    [("sqrt(alpha - 0.1)", True), ("1/step(alpha)", True), ("sqrt(abs(alpha))", False)],
)
def test_a_database_without_a_value_at_some_points_is_not_released(tmp_path, expression, held):
    (tmp_path / "vehicle.toml").write_text(VEHICLE, encoding="utf-8")
    term = f'[[terms]]\nname = "t"\naxis = "CZ"\nexpression = "-0.01*{expression}"\n'
    (tmp_path / "d.toml").write_text(DATABASE + term, encoding="utf-8")
    asked(tmp_path / "w", "vehicle", "add", str(tmp_path / "vehicle.toml"))
    words = ("database", "import", str(tmp_path / "d.toml"), "--vehicle", NAME)
    document = asked(tmp_path / "w", *words)
    assert document["without_values"] == (["CZ"] if held else [])
    assert document["released"] is not held
    assert (
        "CZ has no finite value at some points" in aerodb(tmp_path / "w", *words).stdout
    ) is held


def test_a_database_without_any_value_is_stored_and_not_released(glider):
    workspace, importing = glider
    Path(importing[2]).write_text(RATIO.format("aircraft/wing/S-ft2"), encoding="utf-8")
    words = (*importing, "--bind", "aircraft/wing/S-ft2=0", "--accept-proposals")
    document = asked(workspace, *words)
    assert not document["released"]
    assert {"CX", "CZ"} & set(document["without_values"])
    assert "no finite value" in aerodb(workspace, *words).stdout


def test_an_input_that_does_not_divide_is_proposed_at_zero_as_before(glider):
    workspace, importing = glider
    document = asked(workspace, *importing)
    assert document["dividing"] == []
    assert document["proposals"]["fcs_brake_norm"][-1] == "fcs/brake-norm=0"


def test_a_long_database_is_shown_by_axis_and_whole_when_asked(tmp_path):
    (tmp_path / "vehicle.toml").write_text(VEHICLE, encoding="utf-8")
    terms = "".join(
        f'[[terms]]\nname = "t{k}"\naxis = "CZ"\nexpression = "-{k}*alpha"\n' for k in range(9)
    )
    (tmp_path / "long.toml").write_text(DATABASE + terms, encoding="utf-8")
    asked(tmp_path / "w", "vehicle", "add", str(tmp_path / "vehicle.toml"))
    asked(tmp_path / "w", "database", "import", str(tmp_path / "long.toml"), "--vehicle", NAME)
    short = aerodb(tmp_path / "w", "version", "show", "released").stdout
    assert ["CZ", "10", "alpha"] in [line.split() for line in short.splitlines()]
    assert ["Cm", "3", "alpha", "q_hat", "delta_elevator"] in [
        line.split() for line in short.splitlines()
    ]
    assert "-8*alpha" not in short
    assert "-8*alpha" in aerodb(tmp_path / "w", "version", "show", "released", "-v").stdout
