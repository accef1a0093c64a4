"""A solver as a part of its own: its ports and messages, the controller that uses it, its end and its return."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, suppress
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.bottle import Bottle, Property, Vocab
from rtf.middleware.ports import remote
from rtf.middleware.ports.buffered import BufferedPort
from rtf.middleware.ports.port import Port
from rtf.middleware.ports.rpc import RpcClient, RpcServer
from rtf.middleware.wire.contact import Contact
from rtf.robot.cartesian.controller import CartesianController
from rtf.robot.cartesian.remote_solver import RemoteSolver
from rtf.robot.cartesian.solver import SOLVER_TABLE, CartesianSolver, SolverPorts
from rtf.robot.cartesian.solver_messages import AnswerMessage, read_answer, read_target, write_answer, write_target
from rtf.robot.control_modes import ControlMode
from rtf.robot.devices.fake_board import FakeBoard
from rtf.robot.errors import RefusedError, StaleStateError
from rtf.robot.kinematics import PointPreference, robot_chains, vector_of
from rtf.robot.model import load_robot
from rtf.robot.network.request_table import ACK
from waiting import eventually

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rtf.middleware.ports.network import Network
    from rtf.robot.interfaces import FloatArray

ICUB = load_robot("icub")
CHAIN = robot_chains(ICUB).chain("left_arm", "2.5").limited_by(ICUB.axes)
START = np.array([0.0, 0.0, 0.0, -30.0, 30.0, 0.0, 45.0, 0.0, 0.0, 0.0])
ARM_ALONE = [False] * 3 + [True] * 7
NAME, OWN = "/cartesianSolver/left_arm", "/bot/cartesianSolver/left_arm"
ELBOW = PointPreference(5, (0.0, 0.0, -1.0), (0.0, 0.0, 1.0))
TARGET = vector_of(CHAIN.pose(START + np.array([0, 0, 0, -10, 10, 5, 15, 10, -5, 5])))


class Board(FakeBoard):
    """A board whose encoders can be lost."""

    lost = False

    def encoders(self, *joints: object) -> FloatArray:
        """See IEncoders."""
        if self.lost:
            raise StaleStateError("the states are old")
        return super().encoders(*joints)  # type: ignore[arg-type]


@pytest.fixture
def board() -> Board:
    """The joints of the chain at the start, in direct position mode."""
    opened = Board("arm")
    limits = " ".join(f"({word} {' '.join(map(str, values))})" for word, values in
                      (("Min", CHAIN.minima), ("Max", CHAIN.maxima)))  # fmt: skip
    opened.open(Property.parse(f"(GENERAL (Joints {len(CHAIN)})) (LIMITS {limits})"))
    opened.set_control_modes(ControlMode.POSITION_DIRECT)
    opened.set_positions(START)
    return opened


class Solver:
    """A solver with its ports, which can be ended and started again."""

    def __init__(self, board: Board, network: Network) -> None:
        self.board, self.network = board, network
        self.said: list[str] = []
        self.quits = threading.Event()
        self.start()

    def start(self) -> None:
        """Open the ports."""
        self.ports = SolverPorts(
            NAME,
            lambda answer: CartesianSolver(
                self.board, CHAIN, active=ARM_ALONE, together=CHAIN.joints[3:6], answer=answer,
                quits=self.quits.set, report=self.said.append,
            ),
            self.network,
        )  # fmt: skip

    def close(self) -> None:
        """Close them."""
        self.ports.close()


@pytest.fixture
def solver(board: Board, network: Network) -> Iterator[Solver]:
    """A solver on the board."""
    with closing(Solver(board, network)) as opened:
        yield opened


class Asker:
    """The other side of a solver, as a server has it."""

    def __init__(self, network: Network) -> None:
        self.answers: list[Bottle] = []
        with ExitStack() as opened:
            self.rpc = opened.enter_context(closing(RpcClient("/asker/rpc", f"{NAME}/rpc", network=network)))
            self.out: BufferedPort[Bottle] = opened.enter_context(
                BufferedPort("/asker/out", network=network, inputs=False)
            )
            received = opened.enter_context(
                BufferedPort(
                    "/asker/in", strict=True, callback=lambda message: self.answers.append(message.value),
                    network=network, outputs=False,
                )
            )  # fmt: skip
            self.out.add_output(f"{NAME}/in", "tcp")
            remote.connect(network, Contact(f"{NAME}/out"), Contact(received.name), "tcp")
            self._opened = opened.pop_all()

    def close(self) -> None:
        """Close the ports."""
        self._opened.close()

    def ask(self, text: str) -> str:
        """Send a request, and return the reply as text."""
        reply = self.rpc.call(Bottle.parse(text), timeout=5.0)
        return "" if reply is None else reply.to_text()

    def answer(self, text: str) -> Bottle:
        """Send a target, and return its answer."""
        before = len(self.answers)
        self.out.write(Bottle.parse(text), strict=True)
        eventually(lambda: len(self.answers) > before, "there is no answer")
        return self.answers[-1]


@pytest.fixture
def asker(solver: Solver, network: Network) -> Iterator[Asker]:
    """Ports that talk with the solver."""
    assert solver.ports.name == NAME
    with closing(Asker(network)) as opened:
        yield opened


def test_a_target_is_answered_with_its_token(asker: Asker):
    """By the pose that is reached, and by the active joints; a position has any orientation."""
    numbers = " ".join(map(repr, TARGET.tolist()))
    answer = asker.answer(f"([xd] ({numbers})) ([pose] [full]) ([mode] [shot]) ([tok] 12.5)")
    found = read_answer(answer)
    assert found.token == 12.5
    assert found.joints.size == 7
    assert found.pose == pytest.approx(TARGET, abs=2e-4)
    posture = np.concatenate([START[:3], found.joints])
    assert vector_of(CHAIN.pose(posture)) == pytest.approx(found.pose, abs=1e-6)
    place = read_answer(asker.answer("(xd (-0.3 -0.2 0.1)) (tok 13.0) (pose xyz)"))
    assert place.pose[:3] == pytest.approx([-0.3, -0.2, 0.1], abs=2e-4)
    everything = read_answer(asker.answer("(xd (-0.35 -0.1 0.1)) (pose xyz) (dof (1 1 1)) (tok 14.0)"))
    assert everything.joints.size == 10, "settings may come with a target"


def test_its_settings_are_those_of_the_original(asker: Asker, solver: Solver):
    """Words and vocabs; what is wrong is refused; questions move nothing."""
    assert asker.ask("[get] [dof]") == "[ack] (0 0 0 1 1 1 1 1 1 1)"
    assert asker.ask("set dof (1 1 1 0)") == "[ack] (1 1 1 1 1 1 1 1 1 1)"
    assert asker.ask("get pose") == "[ack] [full]"
    assert asker.ask("set pose xyz") == "[ack]"
    assert asker.ask("get pose") == "[ack] [xyz]"
    assert asker.ask("set prio ang") == "[ack]"
    assert asker.ask("get prio") == "[ack] [ang]"
    assert asker.ask("set mode cont") == "[ack]"
    assert asker.ask("get mode") == "[ack] [cont]"
    assert asker.ask("set lim 0 -5.0 5.0") == "[ack]"
    assert asker.ask("get lim 0") == "[ack] -5.0 5.0"
    assert asker.ask("set lim 0 -500.0 5.0") == "[nack]"
    assert asker.ask("set tsk2 (6 (0 0 -1) (0 0 1))") == "[ack]"
    assert solver.ports.solver.drawn() == ELBOW
    assert asker.ask("get tsk2") == "[ack] (6 (0.0 0.0 -1.0) (0.0 0.0 1.0))"
    assert asker.ask("set tsk2 (60 (0 0 -1) (0 0 1))") == "[nack]"
    assert asker.ask("set tsk2 (-1)") == "[ack]"
    assert solver.ports.solver.drawn() is None
    assert asker.ask("set verb off") == "[ack]"
    assert asker.ask("ask (xd (-0.3 -0.2 0.1)) (pose xyz)").startswith("[ack] ([x] (-0.3")
    assert asker.ask("nonsense") == "[nack]"
    assert not solver.quits.is_set()
    assert asker.ask("quit") == "[ack]"
    assert solver.quits.is_set()


def test_it_is_suspended_and_goes_on(asker: Asker, board: Board, solver: Solver):
    """On request, and while the board sends no states; the reason is reported once."""
    assert asker.ask("stat") == "[ack] running"
    assert asker.ask("susp") == "[ack]"
    assert asker.ask("stat") == "[ack] suspended"
    asker.out.write(Bottle.parse("(xd (-0.3 -0.2 0.1)) (pose xyz) (tok 1.0)"), strict=True)
    assert asker.ask("run") == "[ack]"
    eventually(lambda: len(asker.answers) == 1, "the target is not answered after the pause")
    board.lost = True
    asker.out.write(Bottle.parse("(xd (-0.3 -0.2 0.1)) (pose xyz) (tok 2.0)"), strict=True)
    eventually(lambda: asker.ask("stat") == "[ack] suspended", "lost encoders do not suspend it")
    board.lost = False
    eventually(lambda: asker.ask("stat") == "[ack] running", "it does not go on")
    assert solver.said == ["no answer: the states are old", "it goes on"]
    assert read_answer(asker.answer("(xd (-0.3 -0.2 0.1)) (pose xyz) (tok 3.0)")).token == 3.0


def test_a_target_that_waits_for_the_end_of_a_pause_wakes_nobody(solver: Solver, monkeypatch: pytest.MonkeyPatch):
    """A suspended solver waits between two looks, as without a target."""
    suspended = solver.ports.solver
    wait_for = suspended._awake.wait_for
    awake: list[bool] = []

    def wait_and_note(predicate: Callable[[], bool], timeout: float | None = None) -> bool:
        awake.append(predicate())
        return wait_for(predicate, timeout)

    suspended.suspend()
    suspended.take(write_target(TARGET, 1.0))
    monkeypatch.setattr(suspended._awake, "wait_for", wait_and_note)
    eventually(lambda: len(awake) >= 3, "it does not look")
    assert awake[:3] == [False] * 3


def test_a_tracked_target_is_solved_again(asker: Asker, board: Board):
    """When the torso, which takes no part, has turned."""
    first = read_answer(asker.answer("(xd (-0.3 -0.2 0.1)) (pose xyz) (mode cont) (tok 1.0)"))
    board.set_positions([5.0], [2])
    eventually(lambda: len(asker.answers) >= 2, "it is not solved again")
    second = read_answer(asker.answers[-1])
    assert second.pose[:3] == pytest.approx(first.pose[:3], abs=2e-4)
    assert np.abs(second.joints - first.joints).max() > 1.0


@pytest.mark.parametrize("text", ["", "(xd (1 2))", "(pose full)", "(xd (-0.3 -0.2 0.1)) (pose full)", "xd", "1 2 3"])
def test_nonsense_is_ignored(asker: Asker, text: str):
    """And the next target is answered."""
    asker.out.write(Bottle.parse(text), strict=True)
    assert read_answer(asker.answer("(xd (-0.3 -0.2 0.1)) (pose xyz) (tok 7.0)")).token == 7.0
    assert len(asker.answers) == 1


numbers = st.floats(-10.0, 10.0)


@given(st.one_of(st.tuples(*[numbers] * 3), st.tuples(*[numbers] * 7)), st.floats(0, 1e9))
def test_targets_survive_the_wire(target: tuple[float, ...], token: float):
    """Positions stay positions, and poses poses."""
    read = read_target(write_target(np.array(target), token), whole_pose=True)
    assert read.target.tolist() == list(target)
    assert (read.tracking, read.token, read.others) == (False, token, {})


@given(st.lists(numbers, max_size=12), st.one_of(st.none(), st.floats(0, 1e9)))
def test_answers_survive_the_wire(joints: list[float], token: float | None):
    """With and without a token."""
    read = read_answer(write_answer(TARGET, AnswerMessage(TARGET, np.array(joints), token)))
    assert (read.joints.tolist(), read.pose.tolist(), read.token) == (joints, TARGET.tolist(), token)


scalars = st.one_of(st.integers(-9, 9), numbers, st.just(Vocab("xd")), st.text(max_size=3))
values = st.recursive(scalars, lambda inside: st.lists(inside, max_size=4).map(Bottle))


@given(st.lists(values, max_size=4).map(Bottle))
def test_any_message_is_read_or_refused(message: Bottle):
    """Nothing else is raised."""
    for read in (lambda: read_target(message, whole_pose=True), lambda: read_answer(message)):
        with suppress(RefusedError):
            read()


def test_all_requests_have_methods():
    """Of the solver."""
    assert [row.method for row in SOLVER_TABLE.requests if not hasattr(CartesianSolver, row.method)] == []


# The controller with it ----------------------------------------------------------------------------------------------


class Used:
    """A controller on the board that uses the solver, and lives on its own clock."""

    def __init__(self, board: Board, network: Network, patience: float = 5.0) -> None:
        self.board = board
        self.solver = RemoteSolver(NAME, OWN, network=network, drawn=ELBOW, patience=patience)
        self.controller = CartesianController(board, CHAIN, active=ARM_ALONE, solver=self.solver)
        self.now = 0.0

    def run(self, seconds: float) -> None:
        """Do the periods of some seconds."""
        for _ in range(round(seconds / 0.01)):
            self.now += 0.01
            self.controller.publish(self.now)

    def close(self) -> None:
        """Close the ports."""
        self.solver.close()


def test_a_controller_reaches_by_a_solver_elsewhere(board: Board, solver: Solver, network: Network):
    """Its settings, tool and limits among them, are those of the solver; a question with a start moves nothing."""
    with closing(Used(board, network)) as used:
        control = used.controller
        eventually(control.solver_connected, "the solver is not found")
        control.set_tolerance(0.001)
        control.set_tip([0.0, 0.0, 0.05, 0.0, 0.0, 1.0, 0.0])
        control.set_limits(6, 20.0, 100.0)
        control.go_to(TARGET, 0.5)
        used.run(1.5)
        assert control.motion_done()
        assert control.pose().vector == pytest.approx(TARGET, abs=2e-3)
        assert solver.ports.solver.tip() == pytest.approx([0.0, 0.0, 0.05, 0.0, 0.0, 1.0, 0.0])
        assert solver.ports.solver.limits(6) == (20.0, 100.0)
        assert solver.ports.solver.drawn() == ELBOW
        before = board.encoders()
        found = control.ask(TARGET, START[3:])
        assert found.pose == pytest.approx(TARGET, abs=2e-4)
        assert found.joints.size == len(CHAIN)
        assert board.encoders().tolist() == before.tolist()


def test_a_streamed_velocity_is_solved_elsewhere(board: Board, solver: Solver, network: Network):
    """Without a period that waits for an answer."""
    assert solver.ports.name == NAME
    with closing(Used(board, network)) as used:
        control = used.controller
        eventually(control.solver_connected, "the solver is not found")
        first = control.pose().vector
        control.stream_velocity([0.0, 0.0, 0.05, 0.0, 0.0, 1.0, 0.0])

        def risen() -> bool:
            used.run(0.01)
            return float(control.pose().vector[2] - first[2]) > 0.01

        eventually(risen, "the hand does not rise")
        control.stop()
        assert control.motion_done()


def test_a_solver_that_ends_is_missed_and_found_again(board: Board, solver: Solver, network: Network):
    """Targets are refused meanwhile, nobody hangs, a motion under way goes on; a new solver gets the settings."""
    with closing(Used(board, network)) as used:
        control = used.controller
        eventually(control.solver_connected, "the solver is not found")
        control.set_limits(6, 20.0, 100.0)
        control.go_to(TARGET, 0.5)
        solver.close()
        eventually(lambda: not control.solver_connected(), "its end is not noticed")
        used.run(1.0)
        assert control.motion_done()
        with pytest.raises(RefusedError, match="cartesianSolver/left_arm is not there; start it"):
            control.go_to(TARGET)
        solver.start()
        eventually(control.solver_connected, "the new one is not found")
        control.go_to(START_POSE, 0.5)
        used.run(1.0)
        assert control.motion_done()
        assert solver.ports.solver.limits(6) == (20.0, 100.0)


def test_a_solver_that_does_not_answer_is_refused_in_time(board: Board, solver: Solver, network: Network):
    """It is suspended; when it goes on, the next target is reached."""
    with closing(Used(board, network, patience=0.3)) as used:
        control = used.controller
        eventually(control.solver_connected, "the solver is not found")
        solver.ports.solver.suspend()
        with pytest.raises(RefusedError, match=r"has not answered in 0\.3 s"):
            control.go_to(TARGET)
        assert control.motion_done()
        used.solver._patience = 10.0
        solver.ports.solver.resume()
        eventually(control.solver_connected, "it is not connected again")
        control.go_to(TARGET, 0.5)
        used.run(1.0)
        assert control.motion_done()


def test_a_solver_that_takes_no_target_does_not_block_the_controller(board: Board, network: Network):
    """Its process was stopped, say: the motion ends within the patience, and ``stop`` returns."""
    let_go = threading.Event()
    with ExitStack() as opened:
        for port in (
            Port(f"{NAME}/in", lambda _: let_go.wait(20), network=network, outputs=False),
            BufferedPort(f"{NAME}/out", network=network, inputs=False),
            RpcServer(f"{NAME}/rpc", lambda _: Bottle([ACK]), network=network),
        ):
            opened.enter_context(port)
        used = opened.enter_context(closing(Used(board, network, patience=0.3)))
        control = used.controller
        eventually(control.solver_connected, "the solver is not found")
        pool = opened.enter_context(ThreadPoolExecutor(1))
        opened.callback(let_go.set)
        control.stream_velocity([0.0, 0.0, 0.05, 0.0, 0.0, 1.0, 0.0])

        def move() -> None:
            while not let_go.is_set():
                used.run(0.05)

        running = pool.submit(move)
        with pytest.raises(RefusedError, match=r"the motion was ended: .* has taken no target for 0\.3 s"):
            running.result(5.0)
        control.stop()
        assert control.motion_done()


START_POSE = vector_of(CHAIN.pose(START))
