"""OSQP and DAQP on the optimisations of `mpc.rs`: NAME FILE...

Each is set up once a file and then given the linear term and the bounds of step after step, warm
started from the one before, as a controller would. OSQP's time is what the library reports for
update and solve. DAQP reports the solve alone; its update, which brings linear term and bounds into
its own form, has no clock, so a second row has update and solve by the clock around both Python
calls less that around two empty ones. Prints their rows and the largest difference of their optimum
from ours, in volts of the applied valve command.
"""

import sys
import time

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
        yield result.x, result.info.run_time, result.info.run_time


def by_daqp(hessian, constraints, linear, bound):
    solver = daqp.Model()
    upper = np.full(len(bound[0]), 1e30)
    solver.setup(hessian, linear[0].copy(), constraints, upper, bound[0].copy())
    # Its own tolerances leave the optimum off by up to 0.1 V.
    solver.settings = {"primal_tol": 1e-11, "dual_tol": 1e-12}
    for f, lower in zip(linear, bound):
        f, lower = f.copy(), lower.copy()
        start = time.perf_counter()
        solver.update()
        solver.update()
        begin = time.perf_counter()
        solver.update(f=f, blower=lower)
        x, _, _, info = solver.solve()
        both = time.perf_counter() - begin - (begin - start)
        yield np.array(x), info["solve_time"], both


def main():
    name, *files = sys.argv[1:]
    for path in files:
        hessian, constraints, (kind, target, bound, ours) = read(path)
        linear = np.ascontiguousarray(-target @ hessian)
        bound = np.ascontiguousarray(bound)
        constrained = kind[:, 0] > 0.5
        for label, solve in (("osqp", by_osqp), ("daqp", by_daqp)):
            times, worst = np.full((2, len(target)), np.inf), 0.0
            for _ in range(REPEATS):
                for i, (x, *seconds) in enumerate(solve(hessian, constraints, linear, bound)):
                    times[:, i] = np.minimum(times[:, i], np.array(seconds) * 1e6)
                    worst = max(worst, abs(x[0] - ours[i, 0]))
            kinds = [("update and solve", times[1])]
            if label == "daqp":
                kinds.append(("solve alone", times[0]))
            for rows, which in ((~constrained, "no limit active"), (constrained, "constrained")):
                for what, all_times in kinds:
                    if rows.any():
                        part = all_times[rows]
                        median, high = np.quantile(part, [0.5, 0.999])
                        print(
                            f"{f'{name}: {which}, {what}, {label}':<64} {len(part):6d} "
                            f"{median:9.2f} {high:9.2f} {part.max():9.2f}   off by {worst:.1e} V"
                        )


main()
