"""DemoRedBall on the simulated robot, whose configuration has eyes and controllers of gaze and hands."""

from __future__ import annotations

from pathlib import Path

import pytest

from harness import Outcome, run_command, write_files
from rtf.simulator.errors import RenderingError
from rtf.simulator.rendering import rendering_back_end
from rtf.testing.events import Attached
from rtf.testing.verdict import Verdict

#: Name, fault, and what the failure says.
CASES = {
    "healthy": ("", ""),
    "swapped": ("cameras_swapped left", "/icubSim/cam/left and /icubSim/cam/right show what the other one should"),
    "frozen": ("camera_frozen right", "pictures of /icubSim/cam/right do not move with the ball"),
    "overcurrent": ("motor_overcurrent l_elbow", "/demoRedBall has stopped everything: "),
}
HEAD = """<suite name="s">
<fixture name="names"> yarpserver </fixture>
<fixture name="robot" depends="names" param="--config {config}">
<parameter name="arguments">(--lockstep yes --camera_period 0.1)</parameter> robotinterface </fixture>
"""


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """One run of all of them, on one robot."""
    try:
        rendering_back_end()
    except RenderingError as error:
        pytest.skip(str(error))
    folder = tmp_path_factory.mktemp("red_ball")
    config = Path(__file__).parents[2] / "suites" / "robots" / "icubSim" / "redBall.xml"
    tests = ""
    for name, (fault, _) in CASES.items():
        rows = f'<parameter name="inject">"{fault}"</parameter><parameter name="hands">(left)</parameter>'
        rows += f'<parameter name="film">{"false" if fault else "true"}</parameter>'
        tests += f'<test name="{name}">{rows} DemoRedBallTest </test>\n'
    write_files(folder, {"suite.xml": f"{HEAD.format(config=config)}{tests}</suite>"})
    return run_command(folder, "--suite", "suite.xml", limit=280.0)


def test_a_healthy_robot_sees_looks_reaches_and_goes_home(outcome: Outcome, measured):
    """The ball is where the eyes see it, and the hand within 4 cm of it in two seconds; a film shows it."""
    assert outcome.verdict("healthy") is Verdict.PASSED, outcome.detail("healthy")
    assert measured(outcome, "healthy", "place by the eyes")[0].value < 1.0
    assert measured(outcome, "healthy", "place by the demonstration")[0].value < 5.0
    assert measured(outcome, "healthy", "distance of the fixation point")[0].value < 0.02
    assert measured(outcome, "healthy", "time of the left hand")[0].value < 3.0
    (film,) = (event for event in outcome.of(Attached) if event.name == "red-ball.webp")
    assert film.media_type == "image/webp"


@pytest.mark.parametrize("name", [name for name, (fault, _) in CASES.items() if fault])
def test_each_fault_is_found_where_it_is(outcome: Outcome, name: str):
    """At its eye, before anything moves; or by what the demonstration says when a joint stops it."""
    assert outcome.verdict(name) is Verdict.FAILED
    assert CASES[name][1] in outcome.detail(name)
