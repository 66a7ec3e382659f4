"""A fit as text: statistics, estimates with their standing, correlations, whiteness of the
residuals."""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from aerodb.estimation import Fit, samples_per_independent
from aerodb.support import Array

#: Correlations below this are not listed.
LEAST_CORRELATION: Final = 0.5
#: Most correlations that are listed.
_MOST: Final = 12


def fit_report(fit: Fit, least_correlation: float = LEAST_CORRELATION) -> str:
    """Return the report of a fit as text.

    Estimates with standard errors (corrected for coloured residuals), 95 % intervals, p-values of a
    value of zero, Cramer-Rao bounds and insensitivities where the method has them; correlations of
    at least `least_correlation`; fit and Theil's parts per output; how coloured the residuals are,
    and how they are correlated with the inputs. Numbers are in the unit of each parameter, SI.
    """
    return "\n".join(
        line
        for part in (
            _head(fit),
            _estimates(fit),
            _correlations("correlations", fit.correlation, fit.names, least_correlation),
            _correlations(
                "correlations of regressors", fit.regressors, fit.names, least_correlation
            ),
            _axes(fit),
            _tail(fit),
        )
        for line in part
    )


def _head(fit: Fit) -> Iterator[str]:
    yield f"[[{fit.method}]]"
    samples = sum(
        int(np.isfinite(values).sum())
        for each in fit.residuals.values()
        for values in each.values()
    )
    state = "converged" if fit.converged else "NOT CONVERGED"
    searched = f", {fit.iterations} iterations" if fit.iterations else ""
    yield (
        f"    {len(fit.names)} parameters, {len(fit.residuals)} records, {samples} samples;"
        f" {state}{searched}"
    )
    if np.isfinite(fit.log_likelihood):
        yield f"    log-likelihood {fit.log_likelihood:.6g}"


def _estimates(fit: Fit) -> Iterator[str]:
    yield "[[estimates]]"
    width = max((len(e.name) for e in fit.estimates), default=0)
    for e in fit.estimates:
        text = f"    {e.name:<{width}}  {e.value: .6g}"
        if np.isfinite(e.standard_error) and e.standard_error > 0:
            low, high = fit.interval(e.name)
            text += f"  standard error {e.standard_error:.3g}"
            if e.value:
                text += f" ({abs(e.standard_error / e.value):.1%})"
            text += f"  95 % [{low:.4g}, {high:.4g}]"
            text += f"  p {fit.p_value(e.name):.2g}"
        if np.isfinite(e.cramer_rao):
            text += f"  Cramer-Rao {e.cramer_rao:.3g}"
        if np.isfinite(e.insensitivity):
            text += f"  insensitivity {e.insensitivity:.3g}"
        if e.unit != "1":
            text += f"  {e.unit}"
        if e.standing != "estimated":
            text += f"  ({e.standing}{': ' + e.reason if e.reason else ''})"
        yield text


def _correlations(
    title: str, correlation: Array | None, names: Sequence[str], least: float
) -> Iterator[str]:
    if correlation is None:
        return
    pairs = sorted(
        (
            (float(correlation[i, j]), names[i], names[j])
            for i in range(len(names))
            for j in range(i)
            if abs(correlation[i, j]) >= least
        ),
        key=lambda pair: -abs(pair[0]),
    )
    if pairs:
        more = f", {len(pairs) - _MOST} more" if len(pairs) > _MOST else ""
        yield f"[[{title} of at least {least:g}{more}]]"
        for value, one, other in pairs[:_MOST]:
            yield f"    {other}, {one}: {value:+.3f}"


def _short(record: str) -> str:
    """A record by the first digits of its flight, its number and its axis."""
    flight, mark, rest = record.partition("#")
    return f"{flight[:12]}{mark}{rest}"


def _axes(fit: Fit) -> Iterator[str]:
    if fit.axes:
        yield "[[axes: error left, R2 about the mean]]"
    for axis, each in fit.axes.items():
        unit = "N" if axis.startswith("C") and axis[1:].isupper() else "N m"
        load = f" ({each.load:.4g} {unit})" if np.isfinite(each.load) else ""
        yield f"    {axis}  {each.error:.4g}{load}, R2 {each.r_squared:.4f}"


def _tail(fit: Fit) -> Iterator[str]:
    rows = [
        (record, output, theil)
        for record, each in fit.theil.items()
        for output, theil in each.items()
    ]
    if rows:
        yield "[[fit]]"
        for record, output, theil in rows:
            residual = fit.residuals.get(record, {}).get(output)
            colour = ""
            if residual is not None and np.isfinite(residual).sum() > 2:
                count = samples_per_independent(residual[np.isfinite(residual)])
                colour = f"; {count:.1f} samples of its residual count as one"
            yield (
                f"    {_short(record)} {output}: fit {theil.fit_percent:.1f} %, error: bias"
                f" {theil.bias:.2f}, variance {theil.variance:.2f}, covariance"
                f" {theil.covariance:.2f}{colour}"
            )
    if fit.input_correlations:
        yield "[[residuals against inputs before them: largest correlation, 95 % bound]]"
    for each in fit.input_correlations:
        inside = abs(each.correlation) <= each.bound
        if inside and each.part != "all":
            continue
        outside = "" if inside else f"  outside, p {each.p_value:.2g}"
        part = "" if each.part == "all" else f" ({each.part} of its motion)"
        yield (
            f"    {each.output}, {each.input}{part} {each.lag:.3g} s before:"
            f" {each.correlation:+.3f}, bound {each.bound:.3f}{outside}"
        )
    for title, lines in (("assumes", fit.assumes), ("notes", fit.notes)):
        if lines:
            yield f"[[{title}]]"
            yield from (f"    {line}" for line in lines)
