"""Settings of tracing, fixed and hashed before any residual is read."""

from dataclasses import asdict, dataclass

from aerodb.errors import InputError
from aerodb.support import key_of


@dataclass(frozen=True)
class TracingSettings:
    """Settings of tracing; docs/method/tracing.md, section 22.

    bandwidth : Hz, edge of the zero-phase low-pass: one to two short-period frequencies. order :
    largest order of the whitening autoregression (BIC chooses). level : family-wise level of each
    test. kappa : prior sigmas of the sensors that count as what they may add to an estimate.
    prior_dof : degrees of freedom of the within-flight variance. inflation_limit : median VIF above
    which nothing is tested. least_share : a flight with less than this share of the best flight's
    information about a hypothesis takes no part in its test. fewest : flights below which no error
    rate is promised. most_terms, most_freed : where the search stops. shift_factor : multiplies the
    SIMEX bias in the systematic bound. noisy_copies : at most, copies of each flight with its state
    noise added once more, from which the SIMEX bias is computed. folds : folds of the flights, left
    out in turn to see whether a finding returns.

    Raises InputError for values outside their range.
    """

    bandwidth: float = 1.5
    order: int = 4
    level: float = 0.05
    kappa: float = 2.0
    prior_dof: float = 4.0
    inflation_limit: float = 100.0
    least_share: float = 0.02
    fewest: int = 3
    most_terms: int = 20
    most_freed: int = 3
    shift_factor: float = 1.5
    noisy_copies: int = 2
    folds: int = 10

    def __post_init__(self) -> None:
        allowed = {
            "bandwidth": self.bandwidth > 0.0,
            "order": self.order >= 0,
            "level": 0.0 < self.level < 0.5,
            "kappa": self.kappa >= 0.0,
            "prior_dof": self.prior_dof > 0.0,
            "inflation_limit": self.inflation_limit > 1.0,
            "least_share": 0.0 < self.least_share < 1.0,
            "fewest": self.fewest >= 3,
            "most_terms": self.most_terms >= 1,
            "most_freed": self.most_freed >= 0,
            "shift_factor": self.shift_factor >= 0.0,
            "noisy_copies": self.noisy_copies >= 0,
            "folds": self.folds >= 2,
        }
        for name, good in allowed.items():
            if not good:
                raise InputError(
                    f"{name} = {getattr(self, name)} is out of range",
                    "tracing settings",
                    "see aerodb.tracing.settings",
                )

    @property
    def sha256(self) -> str:
        """Hash of all values; part of the key of every stored result."""
        return key_of(asdict(self))


def short_period_frequency(
    Cm_alpha: float, qbar: float, area: float, chord: float, Iyy: float
) -> float:
    """Undamped natural frequency of the short period.

    ``sqrt(|Cm_alpha| qbar S c / Iyy) / (2 pi)``; for an unstable vehicle the same time scale.

    Parameters
    ----------
    Cm_alpha : [1/rad]
    qbar : [Pa]
    area, chord : [m^2], [m]
    Iyy : [kg m^2]

    Returns
    -------
    float : [Hz]

    References
    ----------
    Klein & Morelli, *Aircraft System Identification*, 2006, sec. 3.10, with Z_alpha M_q left out.

    >>> round(short_period_frequency(-0.8, 6000.0, 30.0, 3.0, 70000.0), 2)
    0.4
    """
    return float((abs(Cm_alpha) * qbar * area * chord / Iyy) ** 0.5 / 6.283185307179586)
