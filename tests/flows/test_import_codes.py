"""`database import` and `version export` of what those without a tunnel have, by command."""

import json
from pathlib import Path

import pytest

from aerodb.exchange import import_code
from tests.aerodb.exchange.test_sweeps import text
from tests.support import code_files, vortex_lattice
from tests.support.command import aerodb, asked
from tests.support.small_glider import NAME, VEHICLE


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A vehicle, and runs of the lattice at four angles of attack and one alone."""
    near = VEHICLE.replace("cg = [-0.4, 0.0, 0.0]", "cg = [-0.08, 0.0, 0.0]")  # that of the files
    (tmp_path / "vehicle.toml").write_text(near, encoding="utf-8")
    asked(tmp_path / "w", "vehicle", "add", str(tmp_path / "vehicle.toml"))
    for alpha in (-2, 0, 2, 6):
        path = tmp_path / f"run{alpha}.st"
        path.write_text(vortex_lattice.avl_text(float(alpha)), encoding="utf-8")
    return tmp_path


def test_runs_of_avl_are_one_version_that_says_what_it_is(folder: Path) -> None:
    files = sorted(map(str, folder.glob("run*.st")))
    open_ = aerodb(folder / "w", "database", "import", *files, "--vehicle", NAME)
    assert open_.returncode == 3
    assert "--bind length_unit=m" in open_.stderr
    bound = ("--vehicle", NAME, "--bind", "length_unit=m")
    document = asked(folder / "w", "database", "import", *files, *bound)
    assert document["released"]
    assert document["lacks"] == []
    assert any("induced" in line for line in document["read_as"])
    assert len(document["curves"]["C_lift"]) == len(document["curves"]["alpha"])
    assert {w["kind"] for w in document["warnings"]} == {"other_reference"}
    same = asked(folder / "w", "database", "import", *reversed(files), *bound)
    assert same["version"] == document["version"], "the order of files is no other database"
    one = asked(folder / "w", "database", "import", files[0], *bound)
    assert one["version"] != document["version"]


def test_what_is_lacking_stands_first(folder: Path) -> None:
    text = (folder / "run2.st").read_text("utf-8")
    bare = text[: text.index("                  roll rate")]
    (folder / "bare.st").write_text(bare, encoding="utf-8")
    said = aerodb(
        folder / "w", "database", "import", str(folder / "bare.st"), "--bind", "length_unit=m"
    ).stdout.splitlines()
    assert said[0].startswith(f"{NAME}: v0001 is released")
    assert said[1].startswith("  lacks  ")
    for effect in ("roll damping", "elevator", "aileron", "rudder"):
        assert effect in "".join(said[1:3])


@pytest.mark.parametrize(("form", "suffix"), [("gazebo", "sdf"), ("sitl", "json")])
def test_a_version_is_exported_to_a_simulator_and_read_back(
    folder: Path, form: str, suffix: str
) -> None:
    bound = ("--vehicle", NAME, "--bind", "length_unit=m")
    asked(folder / "w", "database", "import", str(folder / "run2.st"), *bound)
    wider = (folder / "vehicle.toml").read_text("utf-8")
    wider += "".join(
        f"\n[surfaces.{n}]\nlimits = ['-20 deg', '20 deg']\n" for n in ("aileron", "rudder")
    )
    (folder / "vehicle.toml").write_text(wider, encoding="utf-8")
    asked(folder / "w", "vehicle", "add", str(folder / "vehicle.toml"))
    file = folder / f"model.{suffix}"
    export = ("version", "export", "released", "--format", form, "--output", str(file))
    document = asked(folder / "w", *export)
    assert document["check_cases"] > 0
    assert document["differences"]["Cm"] < 2e-3
    again = asked(folder / "w", "database", "import", str(file), "--vehicle", NAME)
    assert again["label"] == "v0002"
    second = folder / f"second.{suffix}"
    written = ("version", "export", "v0002", "--format", form, "--output", str(second))
    exact = asked(folder / "w", *written)
    assert max(exact["differences"].values()) == 0.0
    assert second.read_bytes() == file.read_bytes()
    assert import_code([(file.name, file.read_bytes())], "x").terms


def test_another_file_beside_a_run_is_refused(folder: Path) -> None:
    (folder / "plane.json").write_text(json.dumps({"c_lift_a": 5.0}), encoding="utf-8")
    done = aerodb(
        folder / "w", "database", "import", str(folder / "run2.st"), str(folder / "plane.json")
    )
    assert done.returncode == 3
    assert "not a file of AVL" in done.stderr


POINT = ("x_ref=0", "y_ref=0", "z_ref=0")  # the vehicle's moves with its CG
ANGLES = (-2.0, 0.0, 2.0, 6.0)
SWEEP_ANSWERS = (
    *("csf=C_side", "cmx=-Cl", "cmy=Cm", "cmz=-Cn"),
    *("force_axes=wind", "moment_axes=body", "reference=vehicle"),
    *POINT,
)
CODE_FILES = {
    "plane.stab": (
        lambda: code_files.stab(3.0).replace("Rudder", "ConGrp"),
        ("length_unit=m", "ailerons=delta_aileron", "congrp=0"),
    ),
    "plane.polar": (lambda: code_files.polar(ANGLES, (0.0,)), ("reference=vehicle", *POINT)),
    "polar.txt": (lambda: code_files.xflr5(ANGLES), ("reference=vehicle", *POINT)),
    "for006.dat": (lambda: code_files.datcom(ANGLES), ("lateral_axes=stability",)),
}


@pytest.mark.parametrize("name", [*CODE_FILES, "sweep.csv"])
def test_every_code_is_imported_by_command(folder: Path, name: str) -> None:
    write, answers = CODE_FILES.get(name, (lambda: text("cfd").decode(), SWEEP_ANSWERS))
    (folder / name).write_text(write(), encoding="utf-8")
    given = [word for answer in answers for word in ("--bind", answer)]
    document = asked(folder / "w", "database", "import", str(folder / name), *given)
    assert document["released"]
    assert document["curves"]["C_lift"][-1] > document["curves"]["C_lift"][0]
    assert document["lacks"], "no such file has everything"
    if answers:
        refused = aerodb(folder / "w", "database", "import", str(folder / name))
        assert refused.returncode == 3
        assert f"--bind {answers[0].split('=')[0]}=" in refused.stderr
