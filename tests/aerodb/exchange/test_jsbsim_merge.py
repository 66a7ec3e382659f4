"""Exports put into an existing aircraft: JSBSim flies it as before, and the rest of it stays."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from aerodb.errors import InputError
from aerodb.exchange import export_jsbsim, import_jsbsim, merge_jsbsim
from aerodb.exchange.jsbsim.merge import Merged
from aerodb.storage.files import files_beside
from aerodb.tables import AeroDatabase, Term, parse

jsbsim = pytest.importorskip("jsbsim")
ROOT = Path(jsbsim.get_default_root_dir())


def merged(name: str, change: Callable[[AeroDatabase], AeroDatabase] = lambda d: d) -> Merged:
    file = ROOT / "aircraft" / name / f"{name}.xml"
    loader = files_beside(file)
    database = change(import_jsbsim(file.read_bytes(), name=name, loader=loader))
    exported = export_jsbsim(database, name="x")
    done = merge_jsbsim(file.read_bytes(), exported, file.name, loader)
    assert merge_jsbsim(done.xml, exported, file.name, loader).xml == done.xml
    return done


def flown(root: Path, name: str) -> np.ndarray:
    """Alpha, beta, rates and speed over 4 s of doublets by the aircraft's own controls."""
    program = jsbsim.FGFDMExec(str(root))
    program.set_debug_level(0)
    assert program.load_model(name)
    for path, value in {"ic/h-sl-ft": 6000, "ic/vc-kts": 150, "ic/alpha-deg": 3}.items():
        program[path] = value
    program.run_ic()
    paths = ("aero/alpha-rad", "aero/beta-rad", "velocities/vt-fps")
    paths += tuple(f"velocities/{axis}-rad_sec" for axis in "pqr")
    rows = []
    for k in range(480):
        program["fcs/elevator-cmd-norm"] = 0.05 * (60 < k < 120) - 0.05 * (120 < k < 180)
        program["fcs/aileron-cmd-norm"] = 0.05 * (200 < k < 260)
        program.run()
        rows.append([program[path] for path in paths])
    return np.array(rows)


@pytest.mark.parametrize("name", ["T37", "c172p"])
def test_an_aircraft_with_its_own_aerodynamics_put_back_flies_as_before(
    name: str, tmp_path: Path
) -> None:
    shutil.copytree(ROOT / "aircraft" / name, tmp_path / "aircraft" / name)
    for folder in ("engine", "systems"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    (tmp_path / "aircraft" / name / f"{name}.xml").write_bytes(merged(name).xml)
    before, after = flown(ROOT, name), flown(tmp_path, name)
    assert np.all(np.ptp(before, axis=0) > 1e-3)
    np.testing.assert_allclose(after, before, rtol=0, atol=1e-10 * np.ptp(before, axis=0).max())


def canonical(xml: bytes, without: tuple[str, ...]) -> list[bytes]:
    """The parts of a file with their comments, except those of some tags."""
    root = etree.fromstring(xml)
    kept = [each for each in root if each.tag not in without]
    return [etree.tostring(each, method="c14n", with_tail=False) for each in kept]


def test_only_the_aerodynamics_and_what_belongs_to_them_change() -> None:
    changed = merged(
        "T37",
        lambda d: replace(
            d,
            terms=(*d.terms, Term("more lift", "C_lift", parse("0.1*alpha"))),
            reference=replace(d.reference, area=20.0),
        ),
    )
    original = (ROOT / "aircraft" / "T37" / "T37.xml").read_bytes()
    others = ("aerodynamics", "metrics")
    assert canonical(changed.xml, others) == canonical(original, others)
    new, old = (etree.fromstring(xml).find("metrics") for xml in (changed.xml, original))
    assert [each.tag for each in new] == [each.tag for each in old]
    differing = {
        a.tag for a, b in zip(new, old, strict=True) if (a.text or "").split() != b.text.split()
    }
    assert differing >= {"wingarea"}
    assert new.find("htailarea").text == old.find("htailarea").text
    assert changed.moved == pytest.approx(0.0, abs=1e-9)
    again = import_jsbsim(changed.xml, name="again")
    assert again.reference.area == pytest.approx(20.0)
    point = {"alpha": np.array([0.1]), "V": 80.0}
    gained = again.predict({**dict.fromkeys(again.inputs, 0.0), **point}).coefficients["CZ"]
    former = import_jsbsim(original, name="former")
    had = former.predict({**dict.fromkeys(former.inputs, 0.0), **point}).coefficients["CZ"]
    assert gained - had == pytest.approx(-0.01 * np.cos(0.1), rel=1e-9)


def test_what_the_rest_still_reads_and_a_moved_reference_are_named() -> None:
    xml = b"""<fdm_config name="own" version="2.0"><metrics><wingarea unit="M2">1</wingarea>
    <wingspan unit="M">2</wingspan><chord unit="M">.2</chord>
    <location name="AERORP" unit="M"><x>0.5</x><y>0</y><z>0</z></location></metrics>
    <!-- kept --><flight_control name="fcs"><channel name="c"><pure_gain name="g">
    <input>-aero/function/kCLge</input><output>fcs/g</output></pure_gain></channel></flight_control>
    <aerodynamics><function name="aero/function/kCLge"><value>1</value></function></aerodynamics>
    </fdm_config>"""
    base = import_jsbsim(
        (ROOT / "aircraft" / "T37" / "T37.xml").read_bytes(), name="t", loader=lambda _: b""
    )
    exported = export_jsbsim(base, name="t")
    done = merge_jsbsim(xml, exported, "own.xml", lambda _: b"")
    assert done.lost == ("aero/function/kCLge",)
    expected = np.linalg.norm(np.add(base.reference.moment_reference, (0.5, 0.0, 0.0)))
    assert done.moved == pytest.approx(expected)
    assert b"<!-- kept -->" in done.xml
    for bad in (b"<aircraft/>", b"text", b"<!DOCTYPE a []><fdm_config/>"):
        with pytest.raises(InputError):
            merge_jsbsim(bad, exported, "own.xml", lambda _: b"")
