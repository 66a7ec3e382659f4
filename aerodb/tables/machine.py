"""Compiled execution of `Instructions`; a module of its own, so that the compiler is loaded only
when something is simulated."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aerodb.support import Array, Integers
from aerodb.tables.instructions import CODE, Instructions
from aerodb.tables.kernel import locate


@njit(cache=True, nogil=True, error_model="numpy")
def _scattered(
    program: Instructions, table: int, first: int, slots: Array, lane: int,
    outside: NDArray[np.bool_], x: Array, weight: Array,
) -> float:  # fmt: skip
    """Linear interpolation between scattered points; outside the hull the point is moved towards
    the centre onto it."""
    data, at = program.scattered, program.first_scattered[table]
    n, simplices, facets = int(data[at]), int(data[at + 1]), int(data[at + 2])
    scale, centre = at + 3, at + 3 + n
    facet = centre + n
    simplex = facet + facets * (n + 1)
    for k in range(n):
        x[k] = slots[program.arguments[first + k], lane] / data[scale + k]
        if not math.isfinite(x[k]):
            outside[table, lane] = True
            return np.nan
    reach = 1.0
    for f in range(facets):
        toward, gap = 0.0, data[facet + f * (n + 1) + n]
        for k in range(n):
            normal = data[facet + f * (n + 1) + k]
            toward += normal * (x[k] - data[centre + k])
            gap += normal * data[centre + k]
        if toward > 0.0:
            reach = min(reach, -gap / toward)
    if reach < 1.0 - 1e-9:
        outside[table, lane] = True
    for k in range(n):
        x[k] = data[centre + k] + reach * (x[k] - data[centre + k])
    best, value = -np.inf, np.nan
    size = (n + 1) * n + n + 1
    for s in range(simplices):
        place = simplex + s * size
        rest, least = 1.0, np.inf
        for i in range(n):
            weight[i] = 0.0
            for j in range(n):
                weight[i] += data[place + i * n + j] * (x[j] - data[place + n * n + j])
            rest -= weight[i]
            least = min(least, weight[i])
        least = min(least, rest)
        if least > best:
            best = least
            value = rest * data[place + (n + 1) * n + n]
            for i in range(n):
                value += weight[i] * data[place + (n + 1) * n + i]
        if best >= 0.0:
            break
    return value


@njit(cache=True, nogil=True, error_model="numpy")
def _unary(kind: int, x: float) -> float:
    """Operations of one operand that are rare or slow enough not to need a loop of their own."""
    if kind == CODE.sqrt:
        return math.sqrt(x) if x >= 0.0 else np.nan
    if kind == CODE.exp:
        return np.exp(x)
    if kind == CODE.log:
        return np.log(x)
    if kind == CODE.sin:
        return np.sin(x)
    if kind == CODE.cos:
        return np.cos(x)
    if kind == CODE.tan:
        return np.tan(x)
    if kind == CODE.asin:
        return np.arcsin(x)
    if kind == CODE.acos:
        return np.arccos(x)
    if kind == CODE.atan:
        return np.arctan(x)
    if kind == CODE.sign:
        return np.nan if np.isnan(x) else (1.0 if x > 0.0 else (-1.0 if x < 0.0 else 0.0))
    if kind == CODE.step:
        return 1.0 if x > 0.0 else 0.0
    if kind == CODE.log10:
        return np.log10(x)
    if kind == CODE.sinh:
        return np.sinh(x)
    if kind == CODE.cosh:
        return np.cosh(x)
    if kind == CODE.tanh:
        return np.tanh(x)
    if kind == CODE.asinh:
        return np.arcsinh(x)
    if kind == CODE.acosh:
        return np.arccosh(x)
    if kind == CODE.atanh:
        return np.arctanh(x)
    if kind == CODE.floor:
        return np.floor(x)
    return np.ceil(x)


@njit(cache=True, nogil=True, error_model="numpy")
def _binary(kind: int, x: float, y: float) -> float:
    """Operations of two operands that are rare or slow."""
    if kind == CODE.power:
        return np.power(x, y)
    if kind == CODE.atan2:
        return np.arctan2(x, y)
    if kind == CODE.rem:
        return np.fmod(x, y)
    if kind == CODE.root:
        size = np.power(abs(x), 1.0 / y)
        if x < 0.0:
            return -size if np.fmod(abs(y), 2.0) == 1.0 else np.nan
        return size
    if np.isnan(x) or np.isnan(y):
        return np.nan
    if kind == CODE.lt:
        holds = x < y
    elif kind == CODE.le:
        holds = x <= y
    elif kind == CODE.gt:
        holds = x > y
    elif kind == CODE.ge:
        holds = x >= y
    elif kind == CODE.eq:
        holds = x == y
    else:
        holds = x != y
    return 1.0 if holds else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def execute(
    program: Instructions, slots: Array, cells: Integers, outside: NDArray[np.bool_], lanes: int
) -> None:
    """Run all instructions for each lane.

    Parameters
    ----------
    slots : (s, k), inputs and constants given, everything else is written.
    cells : (a, k), where each axis of each table was read last.
    outside : (t, k), set where an argument lies outside a table; never cleared here.
    lanes : number of columns to compute.
    """
    stride, weight, point = np.empty(16, np.int64), np.empty(16), np.empty(16)
    code, arguments = program.code, program.arguments
    breaks, starts, strides, modes = program.breaks, program.starts, program.strides, program.modes
    low, high, values = program.low, program.high, program.values
    first_axis, first_value = program.first_axis, program.first_value
    for number in range(code.shape[0]):
        kind, to = code[number, 0], code[number, 1]
        a, b, c = code[number, 2], code[number, 3], code[number, 4]
        if kind == CODE.multiply:
            for k in range(lanes):
                slots[to, k] = slots[a, k] * slots[b, k]
        elif kind == CODE.add:
            for k in range(lanes):
                slots[to, k] = slots[a, k] + slots[b, k]
        elif kind == CODE.lookup:
            # Multilinear interpolation, written out here: a call would count references to every
            # array, which takes longer than the interpolation itself.
            begin, base = first_axis[a], first_value[a]
            dimensions = first_axis[a + 1] - begin
            for k in range(lanes):
                place = base
                for d in range(dimensions):
                    axis = begin + d
                    x = slots[arguments[b + d], k]
                    if not (low[axis] <= x <= high[axis]):
                        outside[a, k] = True
                    left, right = starts[axis], starts[axis + 1] - 1
                    cell = cells[axis, k]
                    below = left + cell
                    # An argument moves little between two calls: its last cell comes first.
                    if modes[axis] == 0 and left < right and breaks[below] < x < breaks[below + 1]:
                        weight[d] = (x - breaks[below]) / (breaks[below + 1] - breaks[below])
                    else:
                        cell, weight[d] = locate(breaks, left, right, modes[axis], x)
                        cells[axis, k] = cell
                    place += cell * strides[axis]
                    stride[d] = strides[axis] if right > left else 0
                total = 0.0
                for corner in range(1 << dimensions):
                    product, index = 1.0, place
                    for d in range(dimensions):
                        if corner >> d & 1:
                            product *= weight[d]
                            index += stride[d]
                        else:
                            product *= 1.0 - weight[d]
                    if product != 0.0:
                        total += product * values[index]
                slots[to, k] = total
        elif kind == CODE.subtract:
            for k in range(lanes):
                slots[to, k] = slots[a, k] - slots[b, k]
        elif kind == CODE.divide:
            for k in range(lanes):
                slots[to, k] = slots[a, k] / slots[b, k]
        elif kind == CODE.negative:
            for k in range(lanes):
                slots[to, k] = -slots[a, k]
        elif kind == CODE.abs:
            for k in range(lanes):
                slots[to, k] = abs(slots[a, k])
        elif kind == CODE.min:
            for k in range(lanes):
                left, right = slots[a, k], slots[b, k]
                slots[to, k] = left if left < right or np.isnan(left) else right
        elif kind == CODE.max:
            for k in range(lanes):
                left, right = slots[a, k], slots[b, k]
                slots[to, k] = left if left > right or np.isnan(left) else right
        elif kind == CODE.select:
            for k in range(lanes):
                holds = slots[a, k]
                if np.isnan(holds):
                    slots[to, k] = np.nan
                else:
                    slots[to, k] = slots[b, k] if holds != 0.0 else slots[c, k]
        elif kind == CODE.scattered:
            for k in range(lanes):
                slots[to, k] = _scattered(program, a, b, slots, k, outside, point, weight)
        elif kind == CODE.power or kind == CODE.atan2 or kind >= CODE.rem:
            for k in range(lanes):
                slots[to, k] = _binary(kind, slots[a, k], slots[b, k])
        else:
            for k in range(lanes):
                slots[to, k] = _unary(kind, slots[a, k])
