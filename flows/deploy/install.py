"""Install packages by their hashes, with what the environment has that runs this file:
``python install.py FILE``.

uv (docs.astral.sh/uv) downloads and unpacks them all at once; it asks where pip's settings say, and
comes from there itself, by the hash in ``uv.txt``. Where it cannot be had, or fails, pip installs
them one after the other.
"""

import ast
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Final

#: Setting of pip -> variable by which uv is told the same, and what stands between its values.
_SAME: Final = {
    "index-url": ("UV_DEFAULT_INDEX", " "),
    "extra-index-url": ("UV_INDEX", " "),
    "find-links": ("UV_FIND_LINKS", ","),
    "no-index": ("UV_NO_INDEX", " "),
    "trusted-host": ("UV_INSECURE_HOST", " "),
    "cert": ("SSL_CERT_FILE", " "),
    "proxy": ("ALL_PROXY", " "),
}
_PIP: Final = (sys.executable, "-m", "pip", "--disable-pip-version-check")
_BY_HASH: Final = ("--quiet", "--no-deps", "--require-hashes")


def settings_for_uv(listed: str, environment: Mapping[str, str]) -> dict[str, str]:
    """Return the environment with which uv asks where pip would, from what ``pip config list``
    prints (text, later lines count); what the environment says to uv itself stays."""
    told = dict[str, str]()
    for name, value in re.findall(r"^\S*\.([a-z-]+)=('.*'|\".*\")$", listed, re.MULTILINE):
        if name in _SAME:
            variable, between = _SAME[name]
            told[variable] = between.join(str(ast.literal_eval(value)).split())
    return told | dict(environment)


def install(file: Path) -> None:
    """Install the packages of a file of pins with hashes; CalledProcessError where pip fails."""
    home = Path(sys.prefix) / "uv"
    uv = home / "bin" / "uv"
    if not uv.exists():
        hashed = str(Path(__file__).with_name("uv.txt"))
        asked = (*_PIP, "install", *_BY_HASH, "--target", str(home), "-r", hashed)
        subprocess.run(asked, check=False, stderr=subprocess.DEVNULL)
    if uv.exists():
        listed = subprocess.run((*_PIP, "config", "list"), capture_output=True, text=True)
        # All indices count alike, as for pip: hashes say what is right.
        every = ("--python", sys.executable, "--index-strategy", "unsafe-best-match")
        done = subprocess.run(
            (str(uv), "pip", "install", *every, *_BY_HASH, "-r", str(file)),
            env=settings_for_uv(listed.stdout, os.environ),
            check=False,
        )
        if not done.returncode:
            return
        print("uv could not install them (above): pip does", file=sys.stderr)
    subprocess.run((*_PIP, "install", "--no-compile", *_BY_HASH, "-r", str(file)), check=True)


if __name__ == "__main__":
    try:
        install(Path(sys.argv[1]))
    except subprocess.CalledProcessError as error:
        sys.exit(error.returncode)
