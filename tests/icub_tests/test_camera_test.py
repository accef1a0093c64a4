"""CameraTest on the simulated robot, whose cameras render the scene."""

import pytest
from robot_test_catalogue import entries

from rtf.robot_testing import Safety
from rtf.simulator.errors import RenderingError
from rtf.simulator.rendering import rendering_back_end
from rtf.testing.events import Attached
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import Verdict

CASES = {
    "frozen": ("camera_frozen left", "left", "repeated pictures"),
    "frozen-soon": ("camera_frozen left delay=0.9", "left", "same picture in a row"),
    "frozen-late": ("camera_frozen left delay=2.1", "left", "repeated pictures"),
    "black": ("camera_black right", "right", "contrast"),
    "noisy": ("camera_noise right", "right", "noise"),
    "size": ("camera_size left", "left", "width"),
    "lost": ("loss /icubSim/cam/right share=0.4", "right", "lost"),
}


def case(name, inject="", port=""):
    """One test of a suite."""
    return (
        f'<test name="{name}"><parameter name="measure_time">1</parameter>'
        f'<parameter name="inject">"{inject}"</parameter><parameter name="portname">"{port}"</parameter>'
        " CameraTest </test>"
    )


SUITE = "".join(
    [
        case("healthy"),
        *(case(name, inject) for name, (inject, _, _) in CASES.items()),
        case("no-picture", port="/icubSim/head/state:o"),
        case("absent", port="/icubSim/cam/middle"),
    ]
)


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """One run of all of them."""
    try:
        rendering_back_end()
    except RenderingError as error:
        pytest.skip(str(error))
    return run_on_robot(SUITE, cameras="yes", parts="head")


def test_healthy_cameras_pass(outcome, measured):
    """Rate and pictures of both eyes are judged; the simulated eyes turn, so that every picture differs."""
    assert outcome.verdict("healthy") is Verdict.PASSED
    assert [event.subject for event in measured(outcome, "healthy", "width")] == [
        "/icubSim/cam/left",
        "/icubSim/cam/right",
    ]
    assert [event.value for event in measured(outcome, "healthy", "repeated pictures")] == [0.0, 0.0]
    assert [event.value for event in measured(outcome, "healthy", "same picture in a row")] == [1.0, 1.0]


def test_nobody_is_asked_for_what_does_not_move():
    """Only simulated eyes turn, so the test needs no permission to move on a real robot."""
    (camera,) = [entry for entry in entries() if entry.name == "CameraTest"]
    assert camera.safety is Safety.STILL


def test_a_picture_is_kept(outcome):
    """The last picture of each eye is attached."""
    kept = [event for event in outcome.of(Attached) if event.test.endswith("/healthy")]
    assert {event.media_type for event in kept} == {"image/png"}
    assert len(kept) == 2
    assert (outcome.folder / kept[0].path).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", CASES)
def test_each_fault_is_found_at_its_camera_only(outcome, measured, name):
    """The faulty camera fails in the property that the fault changes; the other camera does not fail."""
    _, side, what = CASES[name]
    assert outcome.verdict(name) is Verdict.FAILED
    failed = {
        (event.subject, event.name)
        for event in outcome.events
        if getattr(event, "verdict", None) is MeasurementVerdict.FAILED and event.test.endswith(f"/{name}")
    }
    assert {subject for subject, _ in failed} == {f"/icubSim/cam/{side}"}
    assert (f"/icubSim/cam/{side}", what) in failed


def test_what_is_no_camera_fails(outcome):
    """Messages that hold no picture, and a port that is not there, fail by name."""
    assert outcome.verdict("no-picture") is Verdict.FAILED
    assert "are no pictures" in outcome.detail("no-picture")
    assert outcome.verdict("absent") is Verdict.FAILED
    assert "/icubSim/cam/middle" in outcome.detail("absent")


def test_the_rate_of_pictures_is_a_setting(outcome, run_on_robot, measured):
    """The original simulator has 60 a second, and its suites expect them."""
    del outcome  # skips where nothing can be rendered
    values = {"expected_frequency": 60, "tolerance": 1, "measure_time": 0.5}
    rows = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in values.items())
    fast = run_on_robot(f'<test name="fast"> {rows} CameraTest </test>', cameras="yes", parts="head", camera_rate=60)
    assert fast.verdict("fast") is Verdict.PASSED, fast.detail("fast")
    assert [event.value for event in measured(fast, "fast", "rate")] == pytest.approx([60.0] * 2, abs=0.5)
