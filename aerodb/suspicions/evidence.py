"""What every suspicion asks of its evidence, the same for all.

A claim needs a contradiction beyond chance (one rate for all claims), a fit that explains the
motion, a cause that moves enough of it, and regressors that the flight tells apart (Klein &
Morelli, Aircraft System Identification, 2006, chapter 5).
"""

import numpy as np

from aerodb.estimation import Regression, samples_per_independent
from aerodb.support import CLAIM, HALF, SLIGHT, likelihood_gain, standard_errors

#: Standard errors beyond a limit from which it is contradicted.
ERRORS = standard_errors(CLAIM)
#: Ratio of likelihoods, as a logarithm, from which one more parameter is believed, with the samples
#: that are independent in the residual.
LIKELIER = likelihood_gain(CLAIM)
#: Least share of a motion that a fit explains for a claim about its sign or its delay: noise and
#: gusts may hold the rest.
EXPLAINED = 0.15
#: Least share that a fit explains for a claim about a size, or for the claim that nothing is
#: missing from it. Least correlation for a claim about a sign without a fit.
WELL_EXPLAINED = 0.8
#: Least share of a motion that a cause itself makes, for a claim about it.
CAUSED = 0.4
#: Least part of an axis, as the database has it, that a variable makes for a claim about it.
PART = SLIGHT
#: Largest variance inflation of a regressor for a claim about it. Standard errors beyond five times
#: those of independent regressors are as wrong as the regressors.
INFLATION = 30.0
#: Least and largest ratio of an effect to that expected (of a wing of this size, or of the
#: database) which a wrong model explains.
RATIOS = (0.3, 3.0)
#: Least and largest ratio of a lift to that expected: sweep and poor sections take away from a
#: wing; tail, body and compressibility add.
LIFTS = (0.55, 1.6)
#: Largest scatter of several ratios about the one that they share, as a part of its logarithm.
SCATTER = HALF
#: Least delay named [s]: shorter ones are servos and filters.
LATE = 0.15
#: Fewest samples from which anything is concluded.
FEWEST = 100
#: Motion up to which a sensor stands still [rad, rad/s; rms]: the noise of most.
STILL = 2e-3
#: Least motion of an angle, a rate or a surface for a claim about what follows from it
#: [rad, rad/s; rms].
SWING = 5e-3
#: Largest angle of a vane, of pitch or of a surface whose limits are not known [rad]: a right angle
#: and its errors.
LARGEST_ANGLE = np.pi / 2 + 0.1


def likelier_by(fit: Regression, unexplained: float) -> float:
    """Return by how much a fit is likelier, as a logarithm, than one that leaves `unexplained`
    times its squares (dimensionless), by the samples that are independent in its residual."""
    independent = len(fit.residual) / max(1.0, samples_per_independent(fit.residual))
    return 0.5 * independent * float(np.log(max(unexplained, 1e-12)))
