"""What the tracing may decide, fixed and hashed before anybody looks at a residual."""

from dataclasses import asdict, dataclass

from aerodb.errors import InputError
from aerodb.support import key_of


@dataclass(frozen=True)
class TracingSettings:
    """Settings of tracing.

    bandwidth : Hz, edge of the zero-phase low-pass on both sides: one to two short-period
    frequencies. order : most coefficients of the autoregression that whitens (BIC chooses). level :
    of each test, family-wise. kappa : prior sigmas of the sensors that may not explain a finding.
    prior_dof : degrees of freedom that the within-flight variance counts for. inflation_limit :
    median VIF beyond which nothing is tested. least_share : a flight with less than this part of
    the best flight's information about a hypothesis does not vote on it. fewest : votes below which
    no error rate is promised. most_terms, most_freed : where the search stops. shift_factor : of
    the SIMEX shift in the systematic bound. noisy_copies : at most, of each flight with the states'
    own error added once more, from which that shift is taken. folds : parts that are left out in
    turn to see whether a finding returns.

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
        """Hash of all values: belongs into the key of every stored result."""
        return key_of(asdict(self))


def short_period_frequency(
    Cm_alpha: float, qbar: float, area: float, chord: float, Iyy: float
) -> float:
    """Natural frequency [Hz] of the short period without damping, ``sqrt(|Cm_alpha| qbar S c / Iyy)
    / (2 pi)``.

    Cm_alpha in 1/rad, qbar in Pa, area in m^2, chord in m, Iyy in kg m^2; for an unstable vehicle
    the same time scale. Klein & Morelli, *Aircraft System Identification*, 2006, sec. 3.10 with
    Z_alpha M_q left out.

    >>> round(short_period_frequency(-0.8, 6000.0, 30.0, 3.0, 70000.0), 2)
    0.4
    """
    return float((abs(Cm_alpha) * qbar * area * chord / Iyy) ** 0.5 / 6.283185307179586)
