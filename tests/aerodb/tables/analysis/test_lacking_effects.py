"""What a database lacks is asked in air that exists: terms that divide by its pressure, or by the
temperature, are no gaps."""

import numpy as np

from aerodb.exchange import read_native
from aerodb.tables import curves, lacking_effects

TEXT = """name = "airliner"
[reference]
area = 300.0
chord = 7.0
span = 50.0
moment_reference = [0.0, 0.0, 0.0]
[variables.lift]
expression = "(0.2 + 5.0*alpha)*qbar"
[derivatives.Cm]
alpha = -1.0
q_hat = -12.0
delta_elevator = -1.5
[derivatives.Cl]
beta = -0.1
p_hat = -0.4
delta_aileron = -0.2
[derivatives.Cn]
beta = 0.1
r_hat = -0.2
delta_rudder = -0.1
[[terms]]
name = "lift"
axis = "CZ"
expression = "-lift/qbar"
[[terms]]
name = "induced drag"
axis = "CX"
expression = "-0.02 - 0.04*(lift/qbar)^2 - 0.001*300/temperature"
"""


def test_nothing_is_lacking_where_terms_divide_by_the_air() -> None:
    database = read_native(TEXT)
    assert {"qbar", "temperature"} <= set(database.inputs)
    assert lacking_effects(database) == ()
    assert np.isfinite(curves(database, np.array([-0.1, 0.2]))["C_drag"]).all()


def test_what_is_zero_is_lacking() -> None:
    without = TEXT[: TEXT.index("[[terms]]")].replace("alpha = -1.0\n", "")
    lacking = ("drag", "lift over alpha", "pitching moment over alpha")
    assert lacking_effects(read_native(without)) == lacking
