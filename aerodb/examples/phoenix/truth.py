"""The true aerodynamics of the example: how the vehicle that flies differs from preflight.toml.

Only the simulation (mission.py) and the evaluation of the demo after all results are stored may
import this module. The effects and their sizes are those of the Phoenix paper, section IV.D: lift
9-10 % higher than predicted, with another slope beyond 0.175 rad; a force along x due to pitch rate
that the preflight database does not have; clean CX underestimated and speed brakes overestimated;
less than 3 % in the pitching-moment slope; zero terms.
"""

from dataclasses import dataclass, replace

import numpy as np

from aerodb.tables import AeroDatabase, Term, parse


@dataclass(frozen=True)
class Effect:
    """One difference: ``value * regressor`` is added on `axis`.

    effect : its name in docs/reference/contract.md.
    """

    effect: str
    axis: str
    parameter: str
    regressor: str
    value: float


EFFECTS: tuple[Effect, ...] = (
    Effect("zero_offset", "CX", "CX_0", "1", -0.006),
    Effect("alpha_slope", "CX", "CX_alpha", "alpha", 0.030),
    Effect("pitch_rate_force", "CX", "CX_q", "q_hat", -0.80),
    Effect("speed_brake", "CX", "CX_delta_speed_brake", "delta_speed_brake", 0.018),
    Effect("zero_offset", "CZ", "CZ_0", "1", -0.005),
    Effect("alpha_slope", "CZ", "CZ_alpha", "min(alpha, 0.175)", -0.21),
    Effect("alpha_slope_break", "CZ", "CZ_alpha > 0.175", "max(alpha - 0.175, 0)", -0.12),
    Effect("pitch_rate_force", "CZ", "CZ_q", "q_hat", -1.5),
    Effect("body_flap", "CZ", "CZ_delta_body_flap", "delta_body_flap", -0.025),
    Effect("zero_offset", "Cm", "Cm_0", "1", 0.0015),
    Effect("alpha_slope", "Cm", "Cm_alpha", "min(alpha, 0.175)", 0.0022),
    Effect("alpha_slope_break", "Cm", "Cm_alpha > 0.175", "max(alpha - 0.175, 0)", -0.006),
    Effect(
        "control_effectiveness",
        "Cm",
        "Cm_delta_elevator_outboard",
        "delta_elevator_outboard",
        -0.005,
    ),
    Effect(
        "control_effectiveness", "Cm", "Cm_delta_elevator_inboard", "delta_elevator_inboard", 0.004
    ),
    Effect("body_flap", "Cm", "Cm_delta_body_flap", "delta_body_flap", 0.003),
)


#: Effects for `draw_effects`, each large enough to be seen clearly in these flights
#: (docs/reference/conventions.md, "Noise floor and error measures"); their sign is drawn.
CANDIDATES: tuple[Effect, ...] = (
    Effect("pitch_rate_force", "CX", "CX_q", "q_hat", 0.8),
    Effect("pitch_rate_force", "CZ", "CZ_q", "q_hat", 3.0),
    Effect("pitch_damping", "Cm", "Cm_q", "q_hat", 0.12),
    Effect("alpha_slope", "CZ", "CZ_alpha", "alpha", 0.25),
    Effect("beta_slope", "CY", "CY_beta", "beta", 0.12),
    Effect("beta_slope", "Cn", "Cn_beta", "beta", 0.03),
    Effect("roll_damping", "Cl", "Cl_p", "p_hat", 0.04),
    Effect("yaw_damping", "Cn", "Cn_r", "r_hat", 0.08),
    Effect(
        "control_effectiveness",
        "Cm",
        "Cm_delta_elevator_outboard",
        "delta_elevator_outboard",
        0.012,
    ),
    Effect(
        "control_effectiveness", "Cl", "Cl_delta_aileron_outboard", "delta_aileron_outboard", 0.02
    ),
    Effect("control_effectiveness", "Cn", "Cn_delta_rudder", "delta_rudder", 0.02),
    Effect("speed_brake", "CX", "CX_delta_speed_brake", "delta_speed_brake", 0.03),
    Effect("body_flap", "Cm", "Cm_delta_body_flap", "delta_body_flap", 0.01),
)


def draw_effects(seed: int) -> tuple[Effect, ...]:
    """Return one or two random effects of `CANDIDATES` on different axes, with scalar sizes in SI
    units.

    Sizes vary by a fifth, signs are random.
    """
    generator = np.random.default_rng([seed, 7])
    count, chosen = int(generator.integers(1, 3)), list[Effect]()
    for index in generator.permutation(len(CANDIDATES)):
        effect = CANDIDATES[index]
        if len(chosen) < count and effect.axis not in {other.axis for other in chosen}:
            size = generator.choice([-1.0, 1.0]) * generator.uniform(0.8, 1.2)
            chosen.append(replace(effect, value=float(size * effect.value)))
    return tuple(chosen)


def truth(
    preflight: AeroDatabase, effects: tuple[Effect, ...] = EFFECTS
) -> tuple[AeroDatabase, tuple[Effect, ...]]:
    """Return the true database, preflight with effects, and the effects as data."""
    added = tuple(
        Term(
            name=f"truth_{e.axis}_{n}",
            axis=e.axis,
            expression=parse(f"{e.value!r}*({e.regressor})"),
            description=e.effect,
        )
        for n, e in enumerate(effects)
    )
    return replace(preflight, name="truth", terms=(*preflight.terms, *added)), effects
