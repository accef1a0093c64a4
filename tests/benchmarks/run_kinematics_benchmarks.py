"""Inverse kinematics by several libraries: ``python tests/benchmarks/run_kinematics_benchmarks.py``.

Each gets the same poses of a chain, all within reach, from the same start, and repeats an attempt that ends beside its
target from the same postures. Only what is installed is run; all of it: ``pip install casadi mink pin-pink scipy``.
Times are those of the processor, in milliseconds; start it with ``OMP_NUM_THREADS=1`` for those of one core.
"""

from __future__ import annotations

import argparse
import time
import timeit
from typing import TYPE_CHECKING, Any

import numpy as np

from rtf.robot.kinematics import InverseKinematics, pose_error, robot_chains
from rtf.robot.kinematics.inverse import ORIENTATION_TOLERANCE, POSITION_TOLERANCE
from rtf.robot.kinematics.poses import skew
from rtf.robot.model import load_robot

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from rtf.robot.kinematics import Chain

    Array = NDArray[np.float64]
    Solver = Callable[[Array, Array], Array]  # target and start (rad) to positions (rad)

#: Weights of errors in metres and radians beside those of the rest posture, for solvers that have no equations.
METRE, RADIAN = 3000.0, 300.0
SMALL_ANGLE = 1e-4


class Task:
    """What all solvers do: the chain, its limits and constraints in radians, and the rest posture."""

    def __init__(self, chain: Chain, start: Array) -> None:
        self.chain, self.rest = chain, start
        self.low, self.high = np.radians(chain.minima), np.radians(chain.maxima)
        matrix, lower, upper, _ = chain.constraint_rows()
        rows, bounds = np.vstack([matrix, -matrix]), np.radians(np.concatenate([upper, -lower]))
        self.rows, self.bounds = rows[np.isfinite(bounds)], bounds[np.isfinite(bounds)]
        self.weights = np.where(np.arange(len(chain)) < 3, 1.0, 0.1)  # the torso moves least, as on the robot

    def error(self, target: Array, positions: Array) -> tuple[Array, Array]:
        """Pose error and its derivative."""
        pose, jacobian = self.chain.pose_and_jacobian(np.degrees(positions))
        error = pose_error(target, pose)
        angle, cross = float(np.linalg.norm(error[3:])), skew(error[3:])
        inverse = np.eye(3) + cross / 2
        if angle > SMALL_ANGLE:
            factor = 1 / angle**2 - (1 + np.cos(angle)) / (2 * angle * np.sin(angle))
            inverse += factor * cross @ cross
        return error, np.vstack([-jacobian[:3], -inverse @ jacobian[3:]])

    def cost(self, target: Array, positions: Array) -> float:
        """Pose error and distance from the rest posture, in one number."""
        error = pose_error(target, self.chain.pose(np.degrees(positions)))
        away = self.weights * (positions - self.rest)
        return float(METRE**2 * error[:3] @ error[:3] + RADIAN**2 * error[3:] @ error[3:] + away @ away)

    def reached(self, target: Array, positions: Array) -> bool:
        """Whether a pose is met, within limits and constraints."""
        error = pose_error(target, self.chain.pose(np.degrees(positions)))
        near = np.linalg.norm(error[:3]) <= POSITION_TOLERANCE
        turned = np.degrees(np.linalg.norm(error[3:])) <= ORIENTATION_TOLERANCE
        return bool(near and turned and not self.chain.violations(np.degrees(positions), 1e-3))


def daqp_solver(task: Task) -> Solver:
    """The one of RTF."""
    inverse = InverseKinematics(task.chain)
    rest, unit = np.degrees(task.rest), np.degrees(1.0)
    return lambda target, start: (
        inverse.solve(target, start * unit, rest=rest, weights=task.weights, attempts=1).positions / unit
    )


def slsqp_solver(task: Task) -> Solver:
    """Sequential quadratic programs of SciPy, with the pose as six equations."""
    from scipy.optimize import minimize

    squares = task.weights**2

    def solve(target: Array, start: Array) -> Array:
        known: dict[bytes, tuple[Array, Array]] = {}

        def at(x: Array) -> tuple[Array, Array]:
            if x.tobytes() not in known:
                known[x.tobytes()] = task.error(target, x)
            return known[x.tobytes()]

        result = minimize(
            lambda x: (squares @ (x - task.rest) ** 2, 2 * squares * (x - task.rest)),
            start,
            jac=True,
            method="SLSQP",
            bounds=list(zip(task.low, task.high, strict=True)),
            constraints=[
                {"type": "eq", "fun": lambda x: at(x)[0], "jac": lambda x: at(x)[1]},
                {"type": "ineq", "fun": lambda x: task.bounds - task.rows @ x, "jac": lambda _: -task.rows},
            ],
            options={"maxiter": 100, "ftol": 1e-6},
        )
        return np.clip(result.x, task.low, task.high)

    return solve


def least_squares_solver(task: Task) -> Solver:
    """Trust regions of SciPy, with the pose as residuals, and constraints as residuals beyond them."""
    from scipy.optimize import least_squares

    scale = np.repeat([METRE, RADIAN], 3)

    def solve(target: Array, start: Array) -> Array:
        def residuals(x: Array) -> Array:
            beyond = np.maximum(task.rows @ x - task.bounds, 0.0)
            return np.concatenate([scale * task.error(target, x)[0], task.weights * (x - task.rest), METRE * beyond])

        def derivative(x: Array) -> Array:
            on = (task.rows @ x > task.bounds)[:, np.newaxis]
            jacobian = scale[:, np.newaxis] * task.error(target, x)[1]
            return np.vstack([jacobian, np.diag(task.weights), METRE * on * task.rows])

        inside = np.clip(start, task.low + 1e-6, task.high - 1e-6)
        limits = (task.low, task.high)
        return least_squares(residuals, inside, derivative, limits, max_nfev=60, xtol=1e-8, ftol=1e-8).x

    return solve


def casadi_solver(task: Task) -> Solver:
    """IPOPT by CasADi, with the pose as six equations."""
    import casadi

    count = len(task.chain)
    q, goal = casadi.SX.sym("q", count), casadi.SX.sym("goal", 12)
    pose = casadi.SX(task.chain.base)
    for place, link in enumerate(task.chain.links):
        cross = skew(np.array(link.axis))
        turn = casadi.SX.eye(4)
        turn[:3, :3] = np.eye(3) + casadi.sin(q[place]) * cross + (1 - casadi.cos(q[place])) * (cross @ cross)
        pose = pose @ turn @ link.frame
    pose = pose @ task.chain.tip
    between = casadi.reshape(goal[3:], 3, 3) @ pose[:3, :3].T
    sines = casadi.vertcat(between[2, 1] - between[1, 2], between[0, 2] - between[2, 0], between[1, 0] - between[0, 1])
    turned = 2 * sines / (1 + casadi.trace(between) + 1e-9)  # twice the tangent of half the angle
    problem = {
        "x": q,
        "p": goal,
        "f": casadi.sum1((task.weights * (q - task.rest)) ** 2),
        "g": casadi.vertcat(goal[:3] - pose[:3, 3], turned, casadi.DM(task.rows) @ q),
    }
    options = {"print_level": 0, "sb": "yes", "max_iter": 100, "tol": 1e-6, "constr_viol_tol": 1e-6}
    ipopt = casadi.nlpsol("s", "ipopt", problem, {"print_time": 0, "ipopt": {**options, "mu_strategy": "adaptive"}})
    upper = np.concatenate([np.zeros(6), task.bounds])
    lower = np.concatenate([np.zeros(6), np.full(task.bounds.size, -np.inf)])

    def solve(target: Array, start: Array) -> Array:
        numbers = np.concatenate([target[:3, 3], target[:3, :3].T.ravel()])
        found = ipopt(x0=start, p=numbers, lbx=task.low, ubx=task.high, lbg=lower, ubg=upper)
        return np.clip(np.array(found["x"]).ravel(), task.low, task.high)

    return solve


def damped(task: Task, step: Callable[[Array, float], Array], target: Array, positions: Array) -> Array:
    """Iterate a library that computes one step, with more damping after a step that is worse."""
    damping, cost = 1e-3, task.cost(target, positions)
    for _ in range(50):
        try:
            move = step(positions, damping)
        except Exception:  # noqa: BLE001 - each library has its own for a quadratic program without a solution
            break
        longest = np.abs(move).max()
        moved = np.clip(positions + move * min(1.0, 0.6 / max(longest, 1e-9)), task.low, task.high)
        after = task.cost(target, moved)
        if after < cost:
            positions, cost, damping = moved, after, max(damping / 10, 1e-6)
        else:
            damping = max(10 * damping, 1e-3)
        if longest < SMALL_ANGLE or damping > 1e7:
            break
    return positions


def mink_solver(task: Task) -> Solver:
    """Steps of mink, which has the kinematics of MuJoCo."""
    import mink
    import mujoco

    def placed(frame: Array) -> dict[str, Array]:
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, frame[:3, :3].flatten())
        return {"pos": frame[:3, 3], "quat": quaternion}

    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    body, frame = spec.worldbody, task.chain.base
    for place, link in enumerate(task.chain.links):
        body = body.add_body(**placed(frame), mass=1, inertia=[1, 1, 1], explicitinertial=True)
        limits = [task.low[place], task.high[place]]
        body.add_joint(name=link.joint, axis=link.axis, range=limits, limited=True)
        frame = link.frame
    body.add_site(name="tip", **placed(frame @ task.chain.tip))
    model = spec.compile()
    configuration = mink.Configuration(model)

    class Constraints(mink.Limit):
        def compute_qp_inequalities(self, configuration: Any, dt: float) -> Any:
            return mink.Constraint(G=task.rows, h=task.bounds - task.rows @ configuration.q)

    limits = [mink.ConfigurationLimit(model, gain=1.0), Constraints()]
    reach = mink.FrameTask("tip", "site", position_cost=METRE, orientation_cost=RADIAN)
    rest = mink.PostureTask(model, cost=task.weights)
    rest.set_target(task.rest)

    def solve(target: Array, start: Array) -> Array:
        reach.set_target(mink.SE3.from_matrix(target))

        def step(positions: Array, damping: float) -> Array:
            configuration.update(positions)
            return mink.solve_ik(configuration, [reach, rest], 1.0, "daqp", damping=damping, limits=limits)

        return damped(task, step, target, start)

    return solve


def pink_solver(task: Task) -> Solver:
    """Steps of Pink, which has the kinematics of Pinocchio."""
    import pink
    import pinocchio
    from pink.limits import ConfigurationLimit, Limit

    model, parent, frame = pinocchio.Model(), 0, task.chain.base
    for place, link in enumerate(task.chain.links):
        joint = pinocchio.JointModelRevoluteUnaligned(np.array(link.axis))
        most = np.array([1e3])
        parent = model.addJoint(
            parent, joint, pinocchio.SE3(frame), link.joint, most, most, task.low[[place]], task.high[[place]]
        )
        frame = link.frame
    kind = pinocchio.FrameType.OP_FRAME
    model.addFrame(pinocchio.Frame("tip", parent, 0, pinocchio.SE3(frame @ task.chain.tip), kind))
    data = model.createData()

    class Constraints(Limit):
        def compute_qp_inequalities(self, configuration: Any, dt: float) -> Any:
            return task.rows, task.bounds - task.rows @ configuration.q

    limits = [ConfigurationLimit(model, 1.0), Constraints()]
    reach = pink.FrameTask("tip", position_cost=METRE, orientation_cost=RADIAN)
    rest = pink.PostureTask(cost=task.weights)
    rest.set_target(task.rest)

    def solve(target: Array, start: Array) -> Array:
        reach.set_target(pinocchio.SE3(target))

        def step(positions: Array, damping: float) -> Array:
            at = pink.Configuration(model, data, positions.copy())
            return pink.solve_ik(
                at, [reach, rest], 1.0, solver="daqp", damping=damping, limits=limits, safety_break=False
            )

        return damped(task, step, target, start)

    return solve


SOLVERS: dict[str, Callable[[Task], Solver]] = {
    "daqp": daqp_solver,
    "mink": mink_solver,
    "pink": pink_solver,
    "casadi": casadi_solver,
    "slsqp": slsqp_solver,
    "least_squares": least_squares_solver,
}


def postures(chain: Chain, count: int, seed: int) -> Array:
    """Random postures within limits and constraints (rad)."""
    generator, found = np.random.default_rng(seed), []
    while len(found) < count:
        posture = generator.uniform(chain.minima, chain.maxima)
        if not chain.violations(posture):
            found.append(np.radians(posture))
    return np.array(found)


def measure(name: str, task: Task, targets: Array, attempts: int) -> None:
    """Print a line of the table."""
    try:
        solve = SOLVERS[name](task)
    except ImportError as error:
        print(f"{name:14} not installed: {error}")
        return
    others = postures(task.chain, 400, 3)
    tips = task.chain.pose(np.degrees(others))
    solve(targets[0], task.rest)
    taken, rests, first, reached = [], [], 0, 0
    for target in targets:
        begin = time.process_time()
        cosines = (np.einsum("nij,ij->n", tips[:, :3, :3], target[:3, :3]) - 1) / 2
        distances = np.linalg.norm(tips[:, :3, 3] - target[:3, 3], axis=1) + 0.3 * np.arccos(np.clip(cosines, -1, 1))
        starts = [task.rest, *others[np.argsort(distances)[: attempts - 1]]]
        for number, start in enumerate(starts):
            found = solve(target, start.copy())
            if task.reached(target, found):
                first += number == 0
                reached += 1
                rests.append(float(np.linalg.norm(task.weights * (found - task.rest))))
                break
        taken.append(1e3 * (time.process_time() - begin))
    shares = [100.0 * number / len(targets) for number in (first, reached)]
    p95, p99 = np.percentile(taken, [95, 99])
    print(
        f"{name:14} {shares[0]:9.2f} {shares[1]:9.2f} {np.median(taken):9.2f} {p95:9.2f} {p99:9.2f} {max(taken):9.2f} "
        f"{np.median(rests) if rests else np.nan:9.3f}"
    )


def out_of_reach(task: Task, targets: Array) -> None:
    """Print what the shipped solver does with targets that are half a metre beyond."""
    inverse = InverseKinematics(task.chain)
    far = targets.copy()
    far[:, :3, 3] += 0.5 * far[:, :3, 3] / np.linalg.norm(far[:, :3, 3], axis=1)[:, np.newaxis]
    taken, left = [], []
    for target in far:
        begin = time.process_time()
        solution = inverse.solve(target, np.degrees(task.rest))
        taken.append(1e3 * (time.process_time() - begin))
        left.append(solution.position_error)
    print(
        f"half a metre further: {np.median(taken):.1f} ms (p99 {np.percentile(taken, 99):.1f} ms) for six attempts, ",
        end="",
    )
    print(f"{np.median(left) * 1e3:.0f} mm left")


def main() -> None:
    """Measure what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--targets", type=int, default=1000)
    parser.add_argument("--attempts", type=int, default=6)
    parser.add_argument("--chain", default="left_arm")
    parser.add_argument("--version", default="2.5")
    parser.add_argument("--solvers", default=",".join(SOLVERS), help="names, with commas")
    options = parser.parse_args()
    robot = load_robot("icub")
    chain = robot_chains(robot).chain(options.chain, options.version).limited_by(robot.axes)
    home = np.array([robot.axis(joint).home for joint in chain.joints])
    task = Task(chain, np.radians(home))
    for name, run in (("pose", chain.pose), ("pose and Jacobian", chain.pose_and_jacobian)):
        print(f"{name}: {min(timeit.repeat(lambda run=run: run(home), number=200, repeat=5)) / 200 * 1e6:.0f} us")
    targets = chain.pose(np.degrees(postures(chain, options.targets, 7)))
    columns = ("first %", "reached %", "median", "p95", "p99", "most", "from rest")
    print(f"{chain.name}, {len(chain)} joints, {len(targets)} poses within reach")
    print(f"{'solver':14} " + " ".join(f"{column:>9}" for column in columns))
    for name in options.solvers.split(","):
        measure(name, task, targets, options.attempts)
    out_of_reach(task, targets[:50])


if __name__ == "__main__":
    main()
