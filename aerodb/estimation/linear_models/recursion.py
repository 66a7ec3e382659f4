"""Compiled recursion of linear models."""

from numba import njit

from aerodb.support import Array


@njit(cache=True, nogil=True, error_model="numpy")
def recursion(phi: Array, psi: Array, states: Array) -> None:
    """Complete ``x_k[i+1] = phi_k x_k[i] + psi_k x_0[i] + f_k[i]``.

    In SI units; a divergence gives inf or NaN.

    Parameters
    ----------
    phi : (k, s, s). psi : (k, s, s), or (0, s, s) for none.
    states : (n, k, s): the first states in its first row, f_k[i] in row i + 1; written.
    """
    n, lanes, s = states.shape
    coupled = psi.shape[0] > 0
    for i in range(n - 1):
        for k in range(lanes):
            for a in range(s):
                total = states[i + 1, k, a]
                for b in range(s):
                    total += phi[k, a, b] * states[i, k, b]
                if coupled:
                    for b in range(s):
                        total += psi[k, a, b] * states[i, 0, b]
                states[i + 1, k, a] = total
