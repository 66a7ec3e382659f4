"""JSBSim carries a ``<propulsion>`` file through still air, as a heavy body: ``python -m`` this.

Standard input: JSON with `xml` and `flows`, velocities u, v, w [m/s] and throttles. Output: JSON of the
conditions at the end and the loads on the body [N, N m] about the datum, in SI.
"""

import json
import sys
import tempfile
from pathlib import Path
from typing import Any, Final

_FOOT, _POUND = 0.3048, 4.4482216152605
_AIRCRAFT: Final = """<?xml version="1.0"?>
<fdm_config name="carrier" version="2.0" release="ALPHA">
<fileheader/>
<metrics><wingarea unit="FT2">10</wingarea><wingspan unit="FT">10</wingspan>
<chord unit="FT">1</chord><location name="AERORP" unit="M"><x>0</x><y>0</y><z>0</z></location>
</metrics>
<mass_balance><ixx unit="SLUG*FT2">1e9</ixx><iyy unit="SLUG*FT2">1e9</iyy>
<izz unit="SLUG*FT2">1e9</izz><emptywt unit="LBS">1e9</emptywt>
<location name="CG" unit="M"><x>0</x><y>0</y><z>0</z></location></mass_balance>
<ground_reactions/>
<propulsion file="rotors.xml"/>
<aerodynamics/></fdm_config>
"""


def carried(xml: str, flow: tuple[float, ...], throttles: list[float]) -> dict[str, Any]:
    """Speeds [rev/s], velocity [m/s], density, thrusts [N] and loads (6,) after two seconds."""
    import jsbsim

    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "aircraft" / "carrier"
        place.mkdir(parents=True)
        (place / "carrier.xml").write_text(_AIRCRAFT, encoding="utf-8")
        (place / "rotors.xml").write_text(xml, encoding="utf-8")
        program = jsbsim.FGFDMExec(folder)
        program.set_debug_level(0)
        assert program.load_model("carrier")
        program.set_dt(0.002)
        program["ic/h-sl-ft"] = 3000.0
        for name, value in zip("uvw", flow, strict=True):
            program[f"ic/{name}-fps"] = value / _FOOT
        program.run_ic()
        program["propulsion/set-running"] = -1
        count = len(throttles)
        for k, throttle in enumerate(throttles):
            program[f"fcs/throttle-cmd-norm[{k}]"] = throttle
        for _ in range(1000):
            speeds = [program[f"propulsion/engine[{k}]/propeller-rpm"] / 60.0 for k in range(count)]
            program.run()  # its loads are of the speeds before it
        forces = [program[f"forces/fb{axis}-prop-lbs"] * _POUND for axis in "xyz"]
        moments = [program[f"moments/{axis}-prop-lbsft"] * _POUND * _FOOT for axis in "lmn"]
        return {
            "speeds": speeds,
            "flow": [program[f"velocities/{axis}-aero-fps"] * _FOOT for axis in "uvw"],
            "rho": program["atmosphere/rho-slugs_ft3"] * 515.378818393,
            "loads": [*forces, *moments],
        }


if __name__ == "__main__":
    job = json.load(sys.stdin)
    found = [carried(job["xml"], *each) for each in job["flows"]]
    print(json.dumps(found))
