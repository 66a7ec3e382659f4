"""Put exported aerodynamics into an existing JSBSim aircraft file, and keep the rest of it.

Replaced are ``<aerodynamics>``, and what its numbers refer to: area, span, chord and AERORP of
``<metrics>``, and the system that declares its inputs. Mass, gear, engines, flight controls,
comments and everything else stay as they are.
"""

from collections.abc import Iterable
from copy import deepcopy
from dataclasses import dataclass

import numpy as np
from lxml import etree

from aerodb.errors import InputError
from aerodb.exchange.jsbsim.elements import Element
from aerodb.exchange.jsbsim.export import INPUTS
from aerodb.exchange.jsbsim.metrics import read_reference, read_root, read_section
from aerodb.exchange.jsbsim.reader import Loader


@dataclass(frozen=True)
class Merged:
    """An aircraft file with new aerodynamics.

    lost : properties that only the former aerodynamics defined and that other parts of the file
    read. moved : metres by which the moment reference moved in the file's structural axes; None
    where the file had none.
    """

    xml: bytes
    lost: tuple[str, ...]
    moved: float | None


def merge_jsbsim(aircraft: bytes, exported: bytes, where: str, loader: Loader) -> Merged:
    """Return `aircraft` with the aerodynamics of `exported`, a file of `export_jsbsim`.

    where : the aircraft file's name for messages. loader : returns the content of a file that the
    aircraft names for its metrics or aerodynamics; they are written into the aircraft's own file.
    Merging twice gives the same file.

    Raises InputError for a file that is no JSBSim aircraft, for a document type, and for a named
    file that cannot be read.
    """
    checked, new = read_root(aircraft, where), read_root(exported, "export")
    root = etree.fromstring(aircraft, etree.XMLParser(resolve_entities=False, no_network=True))
    if root.tag != "fdm_config":
        raise InputError(f"root element <{root.tag}>", where, "name a JSBSim aircraft file")
    former = [
        read_section(checked, tag, where, loader) if root.find(tag) is not None else None
        for tag in ("metrics", "aerodynamics")
    ]
    moved = _metrics(root, former[0], new.find("metrics"), where)
    cases = new.find("check_cases")
    for tag in (f"system[@name='{INPUTS}']", *(("check_cases",) if cases is None else ())):
        for element in root.findall(tag):
            root.remove(element)
    aerodynamics = _put(root, new.find("aerodynamics"))
    declared = _declared(root)
    system = deepcopy(new.find("system"))
    for each in list(system):
        if (each.text or "").strip() in declared:
            system.remove(each)
    if len(system):
        aerodynamics.addprevious(system)
        system.tail = "\n\n  "
    if cases is not None:
        _put(root, cases)
    if root.find("mass_balance") is None:
        _put(root, new.find("mass_balance"))
    own = _defined(aerodynamics) | declared
    lost = _defined(former[1]) - own if former[1] is not None else set()
    read = set(_texts(each for each in root if each.tag not in ("aerodynamics", "output")))
    xml = etree.tostring(root.getroottree(), xml_declaration=True, encoding="UTF-8")
    return Merged(xml, tuple(sorted(lost & read)), moved)


def _metrics(root: Element, former: Element | None, new: Element, where: str) -> float | None:
    """Write area, span, chord and AERORP; return how far AERORP moved, m."""
    if former is None:
        _put(root, new)
        return None
    own = root.find("metrics")
    if own.get("file"):  # its content comes from the file that it names
        own = _put(root, former)
    moved = None
    if former.find("location[@name='AERORP']") is not None:
        before, after = (read_reference(each, where) for each in (former, new))
        shift = np.subtract(after.moment_reference, before.moment_reference)
        moved = float(np.linalg.norm(shift))
    for each in new:
        name = f"[@name='{each.get('name')}']" if each.get("name") else ""
        _put(own, each, f"{each.tag}{name}")
    return moved


def _put(parent: Element, new: Element, path: str = "") -> Element:
    """Put a copy of `new` in the place of the child at `path` (its tag), or at the end."""
    copy, former = deepcopy(new), parent.find(path or new.tag)
    if former is not None:
        copy.tail = former.tail
        parent.replace(former, copy)
        return copy
    indent = "\n" + "  " * (1 + sum(1 for _ in parent.iterancestors()))
    if len(parent):
        parent[-1].tail = indent
    else:
        parent.text = indent
    copy.tail = indent[:-2]
    parent.append(copy)
    return copy


def _declared(root: Element) -> set[str]:
    """Properties that the file creates outside its aerodynamics: declared, or put out."""
    declared = {
        (each.text or "").strip()
        for parent in root
        if parent.tag in ("system", "flight_control", "autopilot", "propulsion")
        for each in parent.findall("property")
    }
    return declared | {(each.text or "").strip() for each in root.iterfind(".//*/output")}


def _defined(aerodynamics: Element) -> set[str]:
    """Properties that an aerodynamics section creates."""
    functions = {each.get("name", "").strip() for each in aerodynamics.iter("function")}
    return functions | {(each.text or "").strip() for each in aerodynamics.findall("property")}


def _texts(parts: Iterable[Element]) -> Iterable[str]:
    """Texts of elements: a property that is read is one, with a minus sign at times."""
    for part in parts:
        for element in part.iter(etree.Element):
            yield (element.text or "").strip().lstrip("-")
