"""What each robot test commands, as it arrives at the boards, against the specification of the test.

The numbers are those of the suite below and of the tests' descriptions; none comes from the tests themselves.
"""

import math
from itertools import pairwise

import numpy as np
import pytest

from rtf.robot.control_modes import InteractionMode, mode_word
from rtf.testing.verdict import ExitCode


def entry(name, test, **parameters):
    """A test of the suite."""
    rows = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in parameters.items())
    return f'<test name="{name}">{rows} {test} </test>'


TORSO = {"part": "torso"}
#: Gain of a loop without an integral, %/deg: friction takes up to 2 % to either side of what holds the neck; with this
#: gain 4 % are half a degree, what may be left in the end.
ALONE = 8
SUITE = "".join([
    entry("limits", "JointLimits", **TORSO, joints="(0 1)", speed="(50 40)", outOfBoundPosition="(2 3)",
          outputLimitPercent="(60 50)"),
    entry("modes", "ControlModes", **TORSO, joints="(0)"),
    entry("motors", "MotorTest", **TORSO, target="(8 -6 10)", refvel="(20 15 25)", refacc="(300 400 500)"),
    entry("references", "MovementReferencesTest", **TORSO, joints="(0 2)", target="(6 8)", refVel="(20 25)",
          refAcc="(300 400)", duty=1.5, step=0.2, velocity=4),
    entry("open-loop", "OpenLoopConsistency", **TORSO, level=1.5),
    entry("direct", "PositionDirect", **TORSO, joints="(0 2)", zero="(2 5)", frequency=1, amplitude=3, cycles=1,
          sampleTime=0.02),
    entry("steps", "PositionControlAccuracy", **TORSO, joints="(0 2)", zeros="(5 10)", cycles=2, step=2, lead=0.5,
          step_duration=1.2, sampleTime=0.02),
    entry("own-loop", "PositionControlAccuracyExternalPid", part="head", joints="(2)", zeros="(5)", cycles=2, step=3,
          lead=0.5, step_duration=1.2, sampleTime=0.01, Kp=ALONE, Ki=0, Kd=0, pid_vup=0, pid_vdown=0, overshoot=200),
    entry("torque-steps", "TorqueControlAccuracy", **TORSO, joints="(0)", cycles=2, step=0.4, lead=0.3,
          step_duration=0.8, sampleTime=0.01),
    entry("torques", "TorqueControlConsistency", **TORSO, joints="(0 1)", change=0.2),
    entry("impedance", "TorqueControlStiffDampCheck", **TORSO, joints="(0)", home="(4)", stiffness="(3)",
          damping="(0.25)"),
    entry("gravity", "TorqueControlGravityConsistency", **TORSO, joints="(1 2)", postures=2, swing=8, speed=40),
    entry("drift", "OpticalEncodersDrift", **TORSO, joints="(0 1)", min="(-5 -4)", max="(6 7)", speed="(20 15)",
          cycles=5, every=2),
    entry("encoders", "OpticalEncodersConsistency", **TORSO, joints="(0 1)", min="(-5 -4)", max="(6 7)",
          speed="(20 15)", cycles=3),
    entry("stiction", "MotorStiction", **TORSO, joints="(0)", outputStep=0.5, outputDelay=0.1, threshold=1, repeat=1),
    entry("signs", "MotorEncodersSignCheck", **TORSO, joints="(0)", pwmStart=1, pwmStep=1, commandDelay=0.1,
          PosThreshold=2),
    entry("stress", "position-stress", **TORSO, joints="(0 2)", min="(-4 -3)", max="(6 5)", speed="(30 40)", cycles=2,
          shortest=0.2, longest=0.6),
])  # fmt: skip
#: Limits of the torso's joints, deg; what they can exert, Nm; and the currents that its motors bear, A.
LIMITS = ((-50, 50), (-30, 30), (-20, 70))
STRONGEST, PEAK = 50.0, 10.0
#: The share of its time in which a move, which ends gently, comes within a degree of its end.
NEARLY = 0.6
#: Where a test finds a joint without a home in its parameters, is where the one before has left it.
STILL = 0.1


@pytest.fixture(scope="module")
def recording(record_on_robot):
    """One robot for all of them."""
    return record_on_robot(SUITE, "torso", "head")


def test_the_healthy_robot_passes_them_all(recording):
    """So the commands that are compared below are those of complete tests."""
    assert recording.outcome.exit_code == ExitCode.PASSED, recording.outcome.stdout


def home_of(recording, test):
    """The positions when a test gave its first command."""
    return recording.during(test)[0].positions


def close(values, wanted, tolerance=STILL):
    """Return whether the commanded values are these, in this order."""
    return values == pytest.approx(wanted, abs=tolerance)


def runs(commands, gap):
    """Return the commands in groups, which are separated by more than ``gap`` s without commands."""
    cuts = [place for place, (one, two) in enumerate(pairwise(commands), 1) if two.time - one.time > gap]
    return [commands[begin:end] for begin, end in pairwise([0, *cuts, len(commands)])]


# Positions -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("joint", "beyond", "speed", "percent"), [(0, 2, 50, 60), (1, 3, 40, 50)])
def test_joint_limits_go_to_both_limits_and_beyond(recording, joint, beyond, speed, percent):
    """The upper limit, beyond it, the lower, beyond it, and home: at the speed, weakened, with time to get there."""
    low, high = LIMITS[joint]
    home = home_of(recording, "limits")[joint]
    first, *moves = recording.commands("limits", "position_move", joint)
    assert set(first.joints) == {0, 1, 2}
    assert close([one.value(joint) for one in moves], [high, high + beyond, low, low - beyond, home])
    assert recording.in_force("limits", "set_reference_speeds", joint)[1:] == [speed] * 5
    ways = [high - home, 0, high - low, 0]
    for (one, two), way in zip(pairwise(moves), ways, strict=True):
        assert two.time - one.time >= way / speed
    weak, whole = recording.values("limits", "set_pid", joint)
    assert weak.max_output == pytest.approx(whole.max_output * percent / 100)
    assert weak.kp == whole.kp


@pytest.mark.parametrize(
    ("joint", "target", "speed", "acceleration"), [(0, 8, 20, 300), (1, -6, 15, 400), (2, 10, 25, 500)]
)
def test_motors_move_alone_all_together_and_as_a_group(recording, joint, target, speed, acceleration):
    """Each joint to its target alone; all home by the call for all; and a group to the targets again."""
    home = home_of(recording, "motors")[joint]
    moves = recording.commands("motors", "position_move", joint)[:3]
    assert close([one.value(joint) for one in moves], [target, home, target])
    alone, *together = [(one.joints, one.form) for one in moves]
    assert alone[0] == (joint,)
    assert together == [((0, 1, 2), "all"), ((2, 1, 0), "group")]
    assert recording.in_force("motors", "set_reference_speeds", joint)[:3] == [speed] * 3
    assert recording.in_force("motors", "set_reference_accelerations", joint)[:3] == [acceleration] * 3
    turns = [one.joints for one in recording.commands("motors", "position_move")]
    assert turns[:3] == [(0,), (1,), (2,)]


@pytest.mark.parametrize(("joint", "target", "speed", "acceleration"), [(0, 6, 20, 300), (2, 8, 25, 400)])
def test_references_of_every_kind_are_commanded(recording, joint, target, speed, acceleration):
    """A move; a duty cycle, and a move home that PWM mode must not take; a direct position; and a speed."""
    test, home = "references", home_of(recording, "references")[joint]
    moves = recording.commands(test, "position_move", joint)
    assert close([one.value(joint) for one in moves], [home, target, home, home])
    assert recording.in_force(test, "set_reference_speeds", joint)[1] == speed
    assert recording.in_force(test, "set_reference_accelerations", joint)[1] == acceleration
    modes = [mode_word(mode) for mode in recording.in_force(test, "set_control_modes", joint)]
    assert modes == ["pos", "pos", "ipwm", "pos"]
    assert recording.values(test, "set_reference_duty_cycles", joint) == [1.5]
    (direct,) = recording.commands(test, "set_positions", joint)
    assert abs(direct.value(joint) - direct.positions[joint]) == pytest.approx(0.2, abs=0.1)
    speeds = recording.commands(test, "velocity_move", joint)
    way = 1 if speeds[0].positions[joint] < sum(LIMITS[joint]) / 2 else -1
    assert [one.value(joint) for one in speeds[:-1]] == [4 * way] * (len(speeds) - 1)
    assert speeds[-1].value(joint) == 0
    assert speeds[-1].time - speeds[0].time > 0.5
    assert all(two.time - one.time < 0.2 for one, two in pairwise(speeds))


@pytest.mark.parametrize(("joint", "low", "high", "speed"), [(0, -5, 6, 20), (1, -4, 7, 15)])
def test_encoders_are_compared_over_swings(recording, joint, low, high, speed):
    """So many half-swings between the ends, and home; one joint after the other, each at its own speed."""
    home = home_of(recording, "encoders")[joint]
    moves = recording.commands("encoders", "position_move", joint)
    assert close([one.value(joint) for one in moves], [high, low, high, home])
    assert {one.joints for one in moves} == {(joint,)}
    assert recording.in_force("encoders", "set_reference_speeds", joint) == [speed] * 4
    for (one, two), way in zip(pairwise(moves), [high - home, high - low, high - low], strict=True):
        assert two.time - one.time >= NEARLY * way / speed
    turns = [one.joints for one in recording.commands("encoders", "position_move")]
    assert turns == [(0,)] * 4 + [(1,)] * 4


@pytest.mark.parametrize(("joint", "low", "high", "speed"), [(0, -5, 6, 20), (1, -4, 7, 15)])
def test_drift_is_looked_for_after_swings(recording, joint, low, high, speed):
    """Five half-swings after two at the beginning, with home before them, after every second one, and at the end.

    Home is always reached from the lower end.
    """
    home = home_of(recording, "drift")[joint]
    moves = recording.commands("drift", "position_move", joint)
    assert close([one.value(joint) for one in moves], [high, low, home, high, low, home, high, low, home, low, home])
    assert {one.joints for one in moves} == {(0, 1)}
    assert recording.in_force("drift", "set_reference_speeds", joint) == [speed] * 11
    for one, two in pairwise(moves):
        way = abs(one.value(joint) - one.positions[joint])
        rest = 0.7 if one.value(joint) == moves[2].value(joint) else 0.0  # measured at rest, at home only
        assert two.time - one.time >= NEARLY * way / speed + rest


@pytest.mark.parametrize(("joint", "low", "high", "speed"), [(0, -4, 6, 30), (2, -3, 5, 40)])
def test_stress_comes_at_random_moments(recording, joint, low, high, speed):
    """Down, up and back, twice, and home at the end; the waits are random between the shortest and the longest.

    The last command is slow: it corrects what is left of the distance.
    """
    home = home_of(recording, "stress")[joint]
    moves = recording.commands("stress", "position_move", joint)[1:]
    assert close([one.value(joint) for one in moves], [low, high, home, low, high, home, home])
    assert {one.joints for one in moves} == {(joint,)}
    assert recording.in_force("stress", "set_reference_speeds", joint)[1:] == [*[speed] * 6, 1.0]
    waits = [two.time - one.time for one, two in pairwise(moves)]
    assert all(0.2 <= wait <= 0.6 + 0.021 for wait in waits)  # to the next look
    assert np.ptp(waits) > 0.1


@pytest.mark.parametrize(("joint", "other"), [(1, 2), (2, 1)])
def test_gravity_is_measured_in_postures_from_both_sides(recording, joint, other):
    """Eight degrees to each side of home, come to from both sides, at rest; short ways slowly; the other joint, too."""
    home = home_of(recording, "gravity")
    own = [one for one in recording.commands("gravity", "position_move") if one.joints == (joint,)]
    postures = [home[joint] + away for away in (-8, -8, 8, 8)]
    sides = [-2, 2, -2, 2]
    wanted = [value for posture, side in zip(postures, sides, strict=True) for value in (posture + side, posture)]
    turn = [place for place, one in enumerate(own) if abs(one.value(joint) - home[joint]) > 4]
    begin, end = turn[0], turn[-1] + 1
    assert close([one.value(joint) for one in own[begin : end + 1]], [*wanted, home[joint]])
    assert recording.in_force("gravity", "set_reference_speeds", joint)[begin:end] == [40, 20, 20, 20] * 2
    for one, two in list(pairwise(own[begin : end + 1]))[1::2]:
        assert two.time - one.time >= 0.3 + 0.2  # it rests, and is measured
    meanwhile = [
        one.value(other) - home[other]
        for one in recording.commands("gravity", "position_move", other)
        if own[begin].time <= one.time < own[end].time
    ]
    assert close(meanwhile, [-2, 0, 2, 0, -2, 0, 2, 0])


# Direct positions ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["single", "all", "group"])
@pytest.mark.parametrize(("joint", "middle"), [(0, 2), (2, 5)])
def test_position_direct_commands_a_sine(recording, form, joint, middle):
    """Twelve probes about the middle; then 3 deg at 1 Hz sample by sample, with swings that grow and fade."""
    commands = [one for one in recording.commands("direct", "set_positions", joint) if one.form == form]
    assert {one.joints for one in commands} == {{"single": (joint,), "all": (0, 1, 2), "group": (0, 2)}[form]}
    values = np.array([one.value(joint) for one in commands]) - middle
    assert close(values[:13], [-0.2, 0.2] * 6 + [0], 1e-9)
    time = np.array([one.time for one in commands[13:]]) - commands[13].time
    assert close(time, np.arange(150) * 0.02, 1e-6)
    sine = 3 * np.sin(2 * math.pi * time)
    whole = (time >= 1 - 1e-6) & (time <= 2 + 1e-6)
    assert close(values[13:][whole], sine[whole], 1e-4)
    clear = np.abs(sine) > 0.5
    share = values[13:][clear] / sine[clear]
    grows, fades = share[time[clear] < 1], share[time[clear] > 2]
    assert (np.diff(grows) > 0).all()
    assert (np.diff(fades) < 0).all()
    assert 0 <= min(grows[0], fades[-1]) < 0.1
    assert max(grows[-1], fades[0]) < 1 + 1e-6
    assert close([values[13], values[-1]], [0, 0], 0.01)
    assert np.abs(np.diff(values)).max() < 2


def test_position_direct_holds_what_it_does_not_test(recording):
    """In commands to the whole part, a joint that is not chosen has its present position."""
    commands = [one.value(1) for one in recording.commands("direct", "set_positions", 1)]
    assert len(commands) == 13 + 150
    assert np.ptp(commands) == 0
    forms = [one.form for one in recording.commands("direct", "set_positions", 0)]
    assert forms == ["single"] * 163 + ["all"] * 163 + ["group"] * 163


@pytest.mark.parametrize(("joint", "zero"), [(0, 5), (2, 10)])
def test_a_step_of_position_is_a_step(recording, joint, zero):
    """Twice half a second at rest, and then 2 deg more until 1.2 s; home before it and afterwards, at 20 deg/s."""
    commands = recording.commands("steps", "set_positions", joint)
    cycles = runs(commands, 0.1)
    assert len(cycles) == 2
    for cycle in cycles:
        time = np.array([one.time for one in cycle]) - cycle[0].time
        assert close(time, np.arange(60) * 0.02, 1e-6)
        assert close([one.value(joint) for one in cycle], np.where(time < 0.5 - 1e-6, zero, zero + 2), 1e-9)
    moves = [one for one in recording.commands("steps", "position_move") if one.joints == (joint,)]
    assert [one.value(joint) for one in moves] == [zero] * 3
    assert recording.in_force("steps", "set_reference_speeds", joint)[:3] == [20] * 3
    times = [moves[0].time, cycles[0][0].time, moves[1].time, cycles[1][0].time, moves[2].time]
    assert times == sorted(times)


def test_a_step_of_a_loop_of_its_own_is_a_step(recording):
    """With a gain alone, duty cycle and position tell the reference: 5 deg, and 3 more after half a second."""
    cycles = runs(recording.commands("own-loop", "set_reference_duty_cycles", 2), 0.1)
    assert len(cycles) == 2
    for cycle in cycles:
        time = np.array([one.time for one in cycle]) - cycle[0].time
        duties = np.array([one.value(2) for one in cycle])
        positions = np.array([one.positions[2] for one in cycle])
        assert close(time[1:], np.arange(len(time) - 1) * 0.01 + time[1], 1e-6)
        assert time[-1] == pytest.approx(1.2, abs=0.03)
        step = int(np.abs(np.diff(duties)).argmax()) + 1
        assert time[step] == pytest.approx(0.5, abs=0.03)
        assert np.diff(duties)[step - 1] == pytest.approx(ALONE * 3, abs=0.3)
        references = duties / ALONE + positions
        before, after = references[:step], references[step:]
        assert np.ptp(before) < 0.1
        assert close(after - before.mean(), np.full(len(after), 3.0), 0.6)  # of a state that is 10 ms old
    moves = recording.commands("own-loop", "position_move", 2)[:3]
    assert [one.value(2) for one in moves] == [5] * 3


# Torques ---------------------------------------------------------------------------------------------------------


def test_a_step_of_torque_is_a_step(recording):
    """What holds the joint for 0.3 s, and then 0.4 Nm more, or less, until 0.8 s; home before it and afterwards."""
    cycles = runs(recording.commands("torque-steps", "set_reference_torques", 0), 0.1)
    assert len(cycles) == 2
    heights = []
    for cycle in cycles:
        time = np.array([one.time for one in cycle]) - cycle[0].time
        torques = np.array([one.value(0) for one in cycle])
        assert time[-1] == pytest.approx(0.8, abs=0.03)
        assert (np.diff(time) <= 0.02 + 1e-6).all()
        step = int(np.abs(np.diff(torques)).argmax()) + 1
        assert time[step] == pytest.approx(0.3, abs=0.03)
        heights.append(float(torques[-1] - torques[0]))
        assert close(torques - torques[0], np.where(time < time[step], 0, heights[-1]), 1e-9)
        assert abs(torques[0]) < 0.1 * STRONGEST
    assert heights == pytest.approx([0.4, -0.4])
    home = home_of(recording, "torque-steps")[0]
    assert close(recording.values("torque-steps", "position_move", 0), [home] * 3)


@pytest.mark.parametrize("joint", [0, 1])
def test_torques_are_commanded_about_the_one_that_holds(recording, joint):
    """0.2 Nm above, at and below it: a joint alone, a group, and the whole part.

    The joint that shares motors with one of them is commanded what it bears, beside them and with the whole part.
    """
    commands = recording.commands("torques", "set_reference_torques", joint)
    assert [one.form for one in commands] == ["single"] * 4 + ["group"] * 4 + ["all"] * 4
    assert [one.joints for one in commands[::4]] == [(joint,), (0, 1), (0, 1, 2)]
    for form in range(3):
        held, *others = (one.value(joint) for one in commands[4 * form : 4 * form + 4])
        assert close(others, [held + 0.2, held, held - 0.2], 1e-6)
        assert abs(held) < 0.1 * STRONGEST
    other = recording.commands("torques", "set_reference_torques", 2)
    assert [one.form for one in other] == ["group"] * 3 + ["all"] * 4
    # Each is read once, and its sensor has a noise of a thousandth of what the joint can exert.
    assert close([one.value(2) for one in other], [other[0].value(2)] * 7, 0.004 * STRONGEST)
    assert 0 < abs(other[0].value(2)) < 0.1 * STRONGEST


def test_a_compliant_joint_is_pushed_to_both_sides(recording):
    """With stiffness alone and with damping alone; four pushes, as hard as the spring, the damper and friction ask."""
    test = "impedance"
    spring, damper, before = ((one.values, one.time) for one in recording.commands(test, "set_impedance", 0))
    assert spring[0] == (3, 0)
    assert damper[0] == (0, 0.25)
    assert before[0] not in (spring[0], damper[0])
    pushes, releases = recording.commands(test, "push", 0), recording.commands(test, "release", 0)
    # 2.5 deg of the spring, 25 deg/s of the damper, and 3 % of what the joint can exert.
    torques = [3 * 2.5 + 0.03 * STRONGEST] * 4 + [0.25 * 25 + 0.03 * STRONGEST] * 4
    signs = [1, -1, -1, 1] * 2
    assert close([one.values[0] for one in pushes], np.multiply(torques, signs), 1e-6)
    for push, release in zip(pushes, releases, strict=True):
        assert 0.02 <= release.time - push.time <= 0.3 + 0.011
    assert spring[1] < pushes[0].time < pushes[3].time < damper[1] < pushes[4].time < pushes[7].time < before[1]
    asked = recording.commands(test, "set_interaction_modes", 0)
    for push in pushes:
        *_, last = (one.value(0) for one in asked if one.time <= push.time)
        assert InteractionMode(last) is InteractionMode.COMPLIANT
    assert InteractionMode(asked[-1].value(0)) is InteractionMode.STIFF
    assert recording.values(test, "position_move", 0)[:3] == [4] * 3


# Duty cycles -----------------------------------------------------------------------------------------------------


def test_the_open_loop_is_driven_both_ways(recording):
    """In PWM mode: 1.5 %, nothing, and -1.5 %, each for a while."""
    for joint in range(3):
        commands = recording.commands("open-loop", "set_reference_duty_cycles", joint)
        assert [one.value(joint) for one in commands] == [1.5, 0, -1.5]
        modes = recording.commands("open-loop", "set_control_modes", joint)
        inside = [mode_word(one.value(joint)) for one in modes if one.time <= commands[0].time][-1]
        left = next(one for one in modes if one.time > commands[0].time)
        assert inside == "ipwm"
        assert mode_word(left.value(joint)) == "pos"
        assert all(two.time - one.time >= 0.05 - 1e-6 for one, two in pairwise([*commands, left]))


@pytest.mark.parametrize(
    ("test", "start", "step", "threshold"), [("stiction", 0.0, 0.5, 1.0), ("signs", 1.0, 1.0, 2.0)]
)
def test_duty_cycles_grow_until_the_joint_moves(recording, test, start, step, threshold):
    """From what holds the joint, a step every 0.1 s, first up and then down; let go of when it has moved."""
    ramps = runs(recording.commands(test, "set_reference_duty_cycles", 0), 0.2)
    assert len(ramps) == 2
    for sign, ramp in zip((1, -1), ramps, strict=True):
        duties = [one.value(0) for one in ramp]
        *_, held, nothing = duties
        assert nothing == 0
        began = len(duties) - 2 - duties[-3::-1].index(held)  # behind the last time that the holding one was commanded
        grown = ramp[began:-2]
        assert close(
            [sign * (one.value(0) - held) for one in grown], (start or step) + np.arange(len(grown)) * step, 1e-6
        )
        assert len(grown) >= 3
        for one, two in pairwise(grown):
            assert two.time - one.time == pytest.approx(0.1, abs=0.021)
        here = grown[0].positions[0]
        assert abs(grown[-1].positions[0] - here) < threshold
        assert abs(ramp[-1].positions[0] - here) > 0.9 * threshold
        assert sign * (grown[-1].value(0) - held) <= 50


# Modes -----------------------------------------------------------------------------------------------------------

REQUESTS = ("pos", "posd", "vel", "mix", "torq", "icur", "ipwm", "idl", "fidl")
NEVER = ("hwfa", "cfgn", "cfgy", "cal", "cald")
COMMANDS = {
    "position_move": ("pos", "mix"),
    "velocity_move": ("vel", "mix"),
    "set_positions": ("posd",),
    "set_reference_torques": ("torq",),
    "set_reference_currents": ("icur",),
    "set_reference_duty_cycles": ("ipwm",),
}


@pytest.fixture(scope="module")
def walk(recording):
    """Each command of the test of modes to its joint, with the mode that it was in by the rules of the boards.

    A request is obeyed; only a forced idle ends a fault, which a greatest current of zero makes.
    """
    mode, steps = "pos", []
    for one in recording.during("modes"):
        steps.append((mode, one))
        if one.method == "set_max_current" and one.values == (0,):
            mode = "hwfa"
        elif one.method == "set_control_modes":
            word = mode_word(one.value(0))
            if word == "fidl":
                mode = "idl"
            elif mode != "hwfa" and word not in NEVER:
                mode = word
    assert mode == "pos"
    return steps


def test_every_mode_is_asked_for_in_every_mode(walk):
    """Also in fault; and modes that cannot be requested, in position mode and in fault."""
    asked = {(mode, mode_word(one.value(0))) for mode, one in walk if one.method == "set_control_modes"}
    modes = set(REQUESTS) - {"fidl"} | {"hwfa"}
    wanted = {(mode, word) for mode in modes for word in REQUESTS}
    assert asked == wanted | {(mode, word) for mode in ("pos", "hwfa") for word in NEVER}


def test_a_fault_is_made_and_the_current_given_back(walk):
    """A greatest current of zero, and at once the one from before."""
    currents = [one for _, one in walk if one.method == "set_max_current"]
    assert [one.values for one in currents] == [(0,), (15,)]
    assert currents[1].time - currents[0].time < 0.1


def test_a_joint_is_made_compliant_in_every_mode(walk):
    """And stiff again."""
    asked = [(mode, InteractionMode(one.value(0)).word) for mode, one in walk if one.method == "set_interaction_modes"]
    assert asked[1:] == [(mode, word) for mode, _ in asked[1::2] for word in ("comp", "stif")]
    assert {mode for mode, _ in asked} == set(REQUESTS) - {"fidl"}


def test_commands_of_other_modes_are_given(walk):
    """Each that a mode does not take, in the modes that hold a joint: 3 deg, 20 deg/s, a tenth of what it can."""
    held = ("pos", "posd", "vel", "mix")
    wrong = [(mode, one) for mode, one in walk if mode in held and mode not in COMMANDS.get(one.method, held)]
    assert {(mode, one.method) for mode, one in wrong} == {
        (mode, method) for mode in held for method, modes in COMMANDS.items() if mode not in modes
    }
    wanted = {
        "velocity_move": 20,
        "set_reference_torques": STRONGEST / 10,
        "set_reference_currents": PEAK / 10,
        "set_reference_duty_cycles": 10,
    }
    for _, one in wrong:
        inwards = 1 if one.positions[0] < 0 else -1
        moved = one.value(0) - one.positions[0] if one.method in ("position_move", "set_positions") else one.value(0)
        assert moved == pytest.approx(inwards * wanted.get(one.method, 3), abs=0.01), one
