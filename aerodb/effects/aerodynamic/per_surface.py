"""Shared constructor of the control-surface templates: one hypothesis per surface and axis."""

from collections.abc import Callable, Mapping

from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.surfaces import Deflection, Role
from aerodb.effects.template import LibraryContext, Template, additive

#: Kind of surface -> body axis -> largest believable correction.
Sizes = Mapping[Role, Mapping[str, float]]


def per_surface(
    effect: str,
    regressor: Callable[[str], str],
    sizes: Sizes,
    *,
    unit: str,
    grows: str,
    name: str,
    source: str,
    side: str = "",
    named: bool = True,
) -> Template:
    """Return the template ``C_axis += k * regressor(delta)`` for every surface of the kinds in
    `sizes` (largest believable k, in `unit`).

    grows and name hold ``{surface}``, which becomes the surface's words and channel. side : what
    stands before the surface in the hypothesis' id. named : whether the surface is in it also where
    it is the only one of its kind.
    """

    def hypotheses(context: LibraryContext) -> list[Hypothesis]:
        expanded = []
        for surface in context.surfaces:
            for axis, size in sizes.get(surface.role, {}).items():
                expanded.append(_one(context, surface, axis, size))
        return expanded

    def _one(context: LibraryContext, surface: Deflection, axis: str, size: float) -> Hypothesis:
        alone = sum(other.role == surface.role for other in context.surfaces) == 1
        return additive(
            context,
            effect,
            axis,
            regressor(surface.channel),
            size=size,
            unit=unit,
            grows=grows.format(surface=surface.words),
            name=name.format(surface=surface.channel),
            subject="_".join(filter(None, (side, surface.name if named or not alone else ""))),
            source=source,
        )

    axes = sorted({axis for by_axis in sizes.values() for axis in by_axis})
    return Template(
        effect, "aerodynamic", f"{', '.join(axes)} += k*({regressor('delta')})", source, hypotheses
    )


def of_device(
    kind: Role,
    sizes: Mapping[str, float],
    source: str,
    unit: str = "1/rad",
    grows: str = "that grows with {surface} deflection",
) -> Template:
    """Return the template ``C_axis += k * delta`` for surfaces of one kind, delta as it is recorded
    ([rad]; of a gear 0 up to 1 down).

    sizes : body axis -> largest believable k, in `unit`; the effect is named like the kind.
    """
    return per_surface(
        kind,
        lambda delta: delta,
        {kind: sizes},
        unit=unit,
        grows=grows,
        name="{surface}",
        source=source,
        named=False,
    )
