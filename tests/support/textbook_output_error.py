"""Output error as textbooks write it: a loop over samples, one run for each parameter."""

import numpy as np

STEPS = 1e-6


def textbook_output_error(a, b, records, start, tolerance=1e-3, most=100):
    """Estimates and standard errors (Cramer-Rao) of ``x' = A x + B u`` with outputs ``[x', x]``.

    a(theta), b(theta) : matrices. records : (step, inputs (n, m), outputs (n, 2 s)); the first
    state is measured. Gauss-Newton, the diagonal noise covariance estimated in every step, the step
    halved until the likelihood rises.
    """

    def simulated(theta):
        am, bm = a(theta), b(theta)
        whole = []
        for step, inputs, outputs in records:
            s = outputs.shape[1] // 2
            x, rows = outputs[0, s:].copy(), []
            for i in range(len(inputs)):
                rows.append(np.concatenate([am @ x + bm @ inputs[i], x]))
                if i + 1 < len(inputs):
                    first, last = inputs[i], inputs[i + 1]
                    middle = 0.5 * (first + last)
                    k1 = am @ x + bm @ first
                    k2 = am @ (x + 0.5 * step * k1) + bm @ middle
                    k3 = am @ (x + 0.5 * step * k2) + bm @ middle
                    k4 = am @ (x + step * k3) + bm @ last
                    x = x + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            whole.append(np.array(rows))
        return np.concatenate(whole)

    measured = np.concatenate([outputs for _, _, outputs in records])

    def cost(outputs):
        squares = np.mean((measured - outputs) ** 2, axis=0)
        return 0.5 * len(measured) * float(np.log(squares).sum())

    theta = np.array(start, dtype=float)
    with np.errstate(all="ignore"):
        for _ in range(most):
            outputs = simulated(theta)
            error = measured - outputs
            weight = 1.0 / np.mean(error**2, axis=0)
            slopes = np.empty((*outputs.shape, len(theta)))
            for j in range(len(theta)):
                moved = theta.copy()
                moved[j] += STEPS * max(abs(moved[j]), 1.0)
                slopes[:, :, j] = (simulated(moved) - outputs) / (moved[j] - theta[j])
            information = np.einsum("noj,o,nok->jk", slopes, weight, slopes)
            gradient = np.einsum("noj,o,no->j", slopes, weight, error)
            step = np.linalg.solve(information, gradient)
            errors = np.sqrt(np.diag(np.linalg.inv(information)))
            share, before = 1.0, cost(outputs)
            while share > 1e-6 and not cost(simulated(theta + share * step)) <= before:
                share *= 0.5
            theta = theta + share * step
            if np.abs(share * step / errors).max() < tolerance:
                break
    return theta, errors


def attas_textbook(histories, names, start):
    """The ATTAS lateral model in this form, estimates by name."""
    inputs = ("da", "dr", "beta")
    records = [
        (
            record.step,
            np.column_stack([*(record.inputs[name] for name in inputs), np.ones(len(record.time))]),
            record.stacked(("pdot", "rdot", "p", "r")),
        )
        for record in histories
    ]
    theta, errors = textbook_output_error(
        lambda t: np.array([t[0:2], t[6:8]]), lambda t: np.array([t[2:6], t[8:12]]), records, start
    )
    return dict(zip(names, theta, strict=True)), dict(zip(names, errors, strict=True))
