"""The effect library: all templates, and the hypotheses they give for one database and one vehicle.

`AERODYNAMIC` and `SENSORS` are the only list of the effects that exist, in the library's order.

It is fixed and hashed before any residual is looked at; a finding is valid for the library with the
hash under which it was made.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any, Final

from aerodb.effects.aerodynamic import (
    alpha_dot,
    alpha_slope,
    alpha_slope_break,
    beta_even,
    beta_slope,
    body_flap,
    control_alpha_coupling,
    control_effectiveness,
    control_nonlinearity,
    control_one_sided,
    cross_rate,
    dynamic_pressure_effect,
    flap,
    ground_effect,
    landing_gear,
    landing_gear_beta,
    lift_lag,
    lift_scale,
    mach_effect,
    model_parameter,
    pitch_damping,
    pitch_rate_force,
    roll_damping,
    sideslip_coupling,
    speed_brake,
    surface_asymmetry,
    table_sign,
    thrust_effect,
    yaw_damping,
    zero_offset,
)
from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.measurement import (
    mass_properties,
    sensor_accelerometer,
    sensor_flow_angles,
    sensor_gyro,
    sensor_qbar,
    surface_calibration,
    surface_motion,
)
from aerodb.effects.stall import stall_hysteresis
from aerodb.effects.template import LibraryContext, LibrarySettings, Template
from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.support import key_of
from aerodb.tables import HAT_RATES, AeroDatabase
from aerodb.vehicle import Vehicle

#: Aerodynamic effects that a database can lack or have wrong.
AERODYNAMIC: Final[tuple[Template, ...]] = (
    zero_offset.TEMPLATE,
    alpha_slope.TEMPLATE,
    alpha_slope_break.TEMPLATE,
    lift_scale.TEMPLATE,
    beta_slope.TEMPLATE,
    beta_even.TEMPLATE,
    table_sign.TEMPLATE,
    sideslip_coupling.TEMPLATE,
    pitch_rate_force.TEMPLATE,
    pitch_damping.TEMPLATE,
    alpha_dot.TEMPLATE,
    lift_lag.TEMPLATE,
    roll_damping.TEMPLATE,
    yaw_damping.TEMPLATE,
    cross_rate.TEMPLATE,
    control_effectiveness.TEMPLATE,
    control_nonlinearity.TEMPLATE,
    control_one_sided.TEMPLATE,
    control_alpha_coupling.TEMPLATE,
    surface_asymmetry.TEMPLATE,
    speed_brake.TEMPLATE,
    body_flap.TEMPLATE,
    flap.TEMPLATE,
    landing_gear.TEMPLATE,
    landing_gear_beta.TEMPLATE,
    ground_effect.TEMPLATE,
    stall_hysteresis.TEMPLATE,
    thrust_effect.TEMPLATE,
    mach_effect.TEMPLATE,
    dynamic_pressure_effect.TEMPLATE,
    model_parameter.TEMPLATE,
)

#: Competing hypotheses: errors of sensors and of the vehicle file.
SENSORS: Final[tuple[Template, ...]] = (
    *sensor_qbar.TEMPLATES,
    *sensor_flow_angles.TEMPLATES,
    sensor_accelerometer.TEMPLATE,
    *sensor_gyro.TEMPLATES,
    *mass_properties.TEMPLATES,
    *surface_calibration.TEMPLATES,
    *surface_motion.TEMPLATES,
)

TEMPLATES: Final[tuple[Template, ...]] = (*AERODYNAMIC, *SENSORS)


def hypotheses_for(
    database: AeroDatabase,
    vehicle: Vehicle,
    channels: Iterable[str],
    *,
    priors: Mapping[str, float] | None = None,
    settings: LibrarySettings | None = None,
    user: Sequence[Template] = (),
    instead: Sequence[Template] = (),
) -> tuple[Hypothesis, ...]:
    """Expand all templates to the hypotheses that apply, in the library's order.

    Parameters
    ----------
    database, vehicle : what the library is made for.
    channels : names of the flights' channels; never their values, so that another flight does not
        change the library.
    priors : sensor parameter -> one sigma (SI), from reconstruction or calibration.
    settings : effects to expand, and angles of slope breaks.
    user : templates of the user, from `parse_effects` and `registered_templates`.
    instead : templates that replace the library's of the same effect and kind (a stall with fitted
        shapes).

    Raises
    ------
    UnknownNameError : an effect in `settings` has no template, or a prior no sensor hypothesis.
    InputError : two hypotheses have the same id, or a prior is not positive and finite.
    """
    settings = settings or LibrarySettings()
    replaced = {(template.effect, template.kind) for template in instead}
    kept = tuple(
        template for template in TEMPLATES if (template.effect, template.kind) not in replaced
    )
    templates = (*kept, *instead, *user)
    known = {template.effect for template in templates}
    for effect in settings.effects:
        if effect not in known:
            raise UnknownNameError(
                f"unknown effect '{effect}'", "library settings", nearest(effect, known)
            )
    context = LibraryContext(database, vehicle, frozenset(channels), dict(priors or {}), settings)
    possible = [
        replace(item, version=template.version)
        for template in templates
        for item in template.hypotheses(context)
    ]
    _check_priors(context.priors, possible)
    possible = _beside_parameters(possible, database)
    by_id: dict[str, Hypothesis] = {}
    for hypothesis in possible:
        if hypothesis.id in by_id:
            raise InputError(
                f"hypothesis '{hypothesis.id}' stands twice",
                "effect library",
                "give one a subject of its own",
            )
        by_id[hypothesis.id] = hypothesis
    wanted = settings.effects or known
    return tuple(
        item for item in by_id.values() if item.effect in wanted and context.knows(item.needs)
    )


#: What every flight has: an effect that changes with it is another shape of a parameter's.
_CONDITION: Final = frozenset({"V", "mach", "qbar"})


def _beside_parameters(possible: Sequence[Hypothesis], database: AeroDatabase) -> list[Hypothesis]:
    """The hypotheses without the library's derivatives by what the database reads, on the axes that
    its parameters reach: there the parameters say what is wrong, and each derivative would be an
    alias of some. What the database does not read, such as a landing gear, stays."""
    reached = {
        axis for each in possible if each.effect == model_parameter.PARAMETER for axis in each.axes
    }
    read = {
        *_CONDITION,
        *database.inputs,
        *(h for h, (rate, _) in HAT_RATES.items() if rate in database.inputs),
    }
    library = {template.effect for template in AERODYNAMIC}
    kept = {model_parameter.PARAMETER, "zero_offset"}
    return [
        each
        for each in possible
        if each.kind == "sensor"
        or each.effect in kept
        or each.effect not in library
        or not reached & set(each.axes)
        or not set(each.drivers) <= read
    ]


def _check_priors(priors: Mapping[str, float], possible: Iterable[Hypothesis]) -> None:
    """Refuse priors that no hypothesis uses, and priors that are not positive and finite."""
    sensors = {hypothesis.parameter for hypothesis in possible if hypothesis.kind == "sensor"}
    for name, sigma in priors.items():
        if name not in sensors:
            raise UnknownNameError(
                f"prior for '{name}', which is not a sensor parameter",
                "effect library",
                nearest(name, sensors),
            )
        if not (math.isfinite(sigma) and sigma > 0):
            raise InputError(
                f"the prior of '{name}' is {sigma:g}",
                "effect library",
                "give one sigma, positive, in SI units",
            )


def library_sha256(
    hypotheses: Iterable[Hypothesis], settings: LibrarySettings | None = None
) -> str:
    """Hash of all that decides what can be found.

    It covers ids, formulas and versions, plausible ranges and priors (scalars, SI units) and
    settings; see docs/method/tracing.md, section 2.
    """
    entries = sorted(
        (_described(hypothesis) for hypothesis in hypotheses), key=lambda entry: str(entry["id"])
    )
    return key_of({"hypotheses": entries, "settings": asdict(settings or LibrarySettings())})


def _described(hypothesis: Hypothesis) -> dict[str, Any]:
    return {
        "id": hypothesis.id,
        "axes": list(hypothesis.axes),
        "parameter": hypothesis.parameter,
        "kind": hypothesis.kind,
        "unit": hypothesis.unit,
        "formula": hypothesis.formula,
        "needs": list(hypothesis.needs),
        "plausible": list(hypothesis.plausible),
        "prior_sigma": hypothesis.prior_sigma,
        "version": hypothesis.version,
    }
