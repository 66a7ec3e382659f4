"""Licences of what production installs and of what the console brings with it."""

import hashlib
import re
from importlib.metadata import PackageNotFoundError, metadata

import pytest

from tests.support.paths import ROOT
from tests.test_pins import RUNTIME, _pins

#: What lets a program be used, changed and passed on with its notice kept.
PERMISSIVE = re.compile(r"MIT|BSD|Apache|ISC|PSF|Python Software|Zlib|HPND|Unlicense|CC0")
#: Others, each with why it may stand beside Apache-2.0 code.
OTHERS = {
    "certifi": "Mozilla 2.0, by file: nothing of it is changed here",
    "jsbsim": "LGPL 2: installed as its own package, which a user can replace",
    "pathspec": "Mozilla 2.0, by file: nothing of it is changed here",
    "psycopg": "LGPL 3: installed as its own package, which a user can replace",
    "psycopg-binary": "LGPL 3: installed as its own package, which a user can replace",
    "text-unidecode": "Artistic Licence or GPL, as one chooses: the Artistic Licence",
}
#: The released npm file of uPlot 1.6.32 and its style sheet.
UPLOT = {
    "uPlot.iife.min.js": "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f",
    "uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
}


def _licence(name: str) -> str:
    about = metadata(name)
    of_classifiers = [
        entry.rpartition("::")[2].strip()
        for entry in about.get_all("Classifier", [])
        if entry.startswith("License ::")
    ]
    told = about.get("License-Expression") or "; ".join(of_classifiers) or about.get("License", "")
    return (told or "")[:200]


def test_every_package_of_production_has_a_licence_that_allows_it() -> None:
    open_cases = {}
    for name in _pins(RUNTIME):
        try:
            licence = _licence(name)
        except PackageNotFoundError:  # of another system or an older Python
            continue
        if not PERMISSIVE.search(licence) and name not in OTHERS:
            open_cases[name] = licence
    assert open_cases == {}
    assert set(OTHERS) <= set(_pins(RUNTIME)), "what is explained is installed"


@pytest.mark.parametrize(("name", "sha256"), UPLOT.items())
def test_the_plotting_library_is_its_released_file_with_its_notice(name: str, sha256: str) -> None:
    folder = ROOT / "flows" / "web" / "static"
    assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == sha256
    assert "Permission is hereby granted" in (folder / "uPlot.LICENSE.txt").read_text("utf-8")
