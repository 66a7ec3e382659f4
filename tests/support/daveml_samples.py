"""Small DAVE-ML files for tests: a frame with reference geometry, two inputs and one output, around
what a test is about."""

FRAME = """<?xml version="1.0"?>
<DAVEfunc xmlns="http://daveml.org/2010/DAVEML">
  <fileHeader name="small"><author name="A. Tester"/><description>a small model</description></fileHeader>
  <variableDef name="referenceWingArea" varID="SREF" units="m2" initialValue="10"/>
  <variableDef name="referenceWingChord" varID="CREF" units="m" initialValue="2"/>
  <variableDef name="referenceWingSpan" varID="BREF" units="m" initialValue="6"/>
  <variableDef name="angleOfAttack" varID="ALP" units="deg" sign="ANU"><isInput/></variableDef>
  <variableDef name="mach" varID="MACH" units="nd"><isInput/></variableDef>
  {body}
</DAVEfunc>
"""


def small(body: str, output: str = "") -> bytes:
    """The bytes of a file; `output` is MathML of the calculation of Cm, else `body` defines it."""
    if output:
        body += f"""<variableDef name="aeroBodyMomentCoefficient_Pitch" varID="CM" units="nd" sign="ANU">
          <calculation><math xmlns="http://www.w3.org/1998/Math/MathML">{output}</math></calculation><isOutput/></variableDef>"""
    return FRAME.format(body=body).encode()


def variable(identity: str, inside: str = "", **attributes: str) -> str:
    """A variableDef."""
    text = "".join(
        f' {key}="{value}"'
        for key, value in {"name": identity, "units": "nd", **attributes}.items()
    )
    return f'<variableDef varID="{identity}"{text}>{inside}</variableDef>'


def pitch(inside: str = "") -> str:
    """The output Cm, defined by a function elsewhere."""
    return variable("CM", f"<isOutput/>{inside}", name="aeroBodyMomentCoefficient_Pitch")
