"""JSBSim's propeller in steady flow: its thrust and induced velocity."""

import tempfile
from pathlib import Path
from typing import Final

_FOOT, _POUND = 0.3048, 4.4482216152605
_DIAMETER: Final = 30.0  # inches

_AIRCRAFT: Final = """<?xml version="1.0"?>
<fdm_config name="carrier" version="2.0" release="ALPHA">
<fileheader/>
<metrics><wingarea unit="FT2">10</wingarea><wingspan unit="FT">10</wingspan>
<chord unit="FT">1</chord><location name="AERORP" unit="IN"><x>0</x><y>0</y><z>0</z></location>
</metrics>
<mass_balance><ixx unit="SLUG*FT2">1e6</ixx><iyy unit="SLUG*FT2">1e6</iyy>
<izz unit="SLUG*FT2">1e6</izz><emptywt unit="LBS">1e6</emptywt>
<location name="CG" unit="IN"><x>0</x><y>0</y><z>0</z></location></mass_balance>
<ground_reactions/>
<propulsion><engine file="motor"><location unit="IN"><x>0</x><y>0</y><z>0</z></location>
<thruster file="fan"><location unit="IN"><x>0</x><y>0</y><z>0</z></location></thruster>
</engine></propulsion>
<aerodynamics/></fdm_config>
"""
_MOTOR: Final = '<?xml version="1.0"?>\n<electric_engine name="motor"><power unit="WATTS">{watts}</power></electric_engine>'
_FAN: Final = f"""<?xml version="1.0"?><propeller name="fan" version="1.01">
<ixx>0.5</ixx><diameter unit="IN">{_DIAMETER}</diameter><numblades>2</numblades>
<gearratio>1</gearratio><constspeed>0</constspeed><p_factor>0</p_factor>
<table name="C_THRUST" type="internal"><tableData>
0.0 0.1
1.0 -0.02
</tableData></table>
<table name="C_POWER" type="internal"><tableData>
0.0 0.05
1.0 0.05
</tableData></table></propeller>
"""


def flown() -> list[dict[str, float]]:
    """Conditions with c_T = .1 - .12 J, SI: u, n, rho, diameter, thrust and induced velocity."""
    import jsbsim

    found = []
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for knots, watts in ((20.0, 2000), (40.0, 2000), (40.0, 9000), (5.0, 600)):
            for path, text in (
                ("aircraft/carrier/carrier.xml", _AIRCRAFT),
                ("engine/motor.xml", _MOTOR.format(watts=watts)),
                ("engine/fan.xml", _FAN),
            ):
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text(text, encoding="utf-8")
            program = jsbsim.FGFDMExec(str(root))
            program.set_debug_level(0)
            program.load_model("carrier")
            program.set_dt(0.005)
            program["ic/h-sl-ft"], program["ic/vt-kts"] = 3000.0, knots
            program.run_ic()
            program["propulsion/set-running"] = -1
            program["fcs/throttle-cmd-norm"] = 1.0
            for _ in range(400):
                speed = program["propulsion/engine/propeller-rpm"]  # of which the thrust is
                program.run()
            found.append(
                {
                    "u": program["velocities/u-aero-fps"] * _FOOT,
                    "n": speed / 60.0,
                    "rho": program["atmosphere/rho-slugs_ft3"] * 515.378818393,
                    "diameter": _DIAMETER * 0.0254,
                    "thrust": program["propulsion/engine/thrust-lbs"] * _POUND,
                    "induced": program["propulsion/engine/prop-induced-velocity_fps"] * _FOOT,
                }
            )
    return found
