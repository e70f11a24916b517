"""OSQP and DAQP on the optimisations of `mpc.rs`: NAME FILE...

Each is set up once a file and then given the linear term and the bounds of step after step, warm
started from the one before, as a controller would. The times are those that the libraries report
for the solve alone; OSQP's includes its update. Prints their rows and the largest difference of
their optimum from ours, in volts of the applied valve command.
"""

import sys

import daqp
import numpy as np
import osqp
import scipy.sparse as sparse

REPEATS = 3


def read(path):
    numbers = np.fromfile(path, "<f8")
    n, m, count = numbers[:3].astype(int)
    start = 3 + n * n + m * n
    hessian = numbers[3 : 3 + n * n].reshape(n, n)
    constraints = numbers[3 + n * n : start].reshape(m, n)
    steps = numbers[start:].reshape(count, 1 + n + m + n)
    return hessian, constraints, np.split(steps, [1, 1 + n, 1 + n + m], axis=1)


def by_osqp(hessian, constraints, linear, bound):
    solver = osqp.OSQP()
    solver.setup(
        sparse.csc_matrix(np.triu(hessian)),
        linear[0],
        sparse.csc_matrix(constraints),
        bound[0],
        np.full(len(bound[0]), np.inf),
        verbose=False,
        eps_abs=1e-7,
        eps_rel=1e-7,
        max_iter=20000,
    )
    for q, l in zip(linear, bound):
        solver.update(q=q, l=l)
        result = solver.solve()
        yield result.x, result.info.run_time


def by_daqp(hessian, constraints, linear, bound):
    solver = daqp.Model()
    upper = np.full(len(bound[0]), 1e30)
    solver.setup(hessian, linear[0].copy(), constraints, upper, bound[0].copy())
    # Its own tolerances leave the optimum off by up to 0.1 V.
    solver.settings = {"primal_tol": 1e-11, "dual_tol": 1e-12}
    for f, lower in zip(linear, bound):
        solver.update(f=f.copy(), blower=lower.copy())
        x, _, _, info = solver.solve()
        yield np.array(x), info["solve_time"]


def main():
    name, *files = sys.argv[1:]
    for path in files:
        hessian, constraints, (kind, target, bound, ours) = read(path)
        linear = np.ascontiguousarray(-target @ hessian)
        bound = np.ascontiguousarray(bound)
        constrained = kind[:, 0] > 0.5
        for label, solve in (("osqp", by_osqp), ("daqp", by_daqp)):
            times, worst = np.full(len(target), np.inf), 0.0
            for _ in range(REPEATS):
                for i, (x, time) in enumerate(solve(hessian, constraints, linear, bound)):
                    times[i] = min(times[i], time * 1e6)
                    worst = max(worst, abs(x[0] - ours[i, 0]))
            for rows, which in ((~constrained, "no limit active"), (constrained, "constrained")):
                if rows.any():
                    median, high = np.quantile(times[rows], [0.5, 0.999])
                    print(
                        f"{name + ': ' + which + ', ' + label:<42} {rows.sum():6d} {median:9.2f} "
                        f"{high:9.2f} {times[rows].max():9.2f}   off by {worst:.1e} V"
                    )


main()
