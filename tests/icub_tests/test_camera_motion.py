"""CameraMotion on the simulated robot, whose eyes turn."""

import pytest

from rtf.simulator.errors import RenderingError
from rtf.simulator.rendering import rendering_back_end
from rtf.testing.events import Attached
from rtf.testing.verdict import Verdict

CASES = {
    "healthy": ("", ""),
    "swapped": ("cameras_swapped left", "/icubSim/cam/left shows what /icubSim/cam/right should"),
    "zoom": ("camera_zoom right factor=1.3", "/icubSim/cam/right: its pictures move by 1"),
    "colours": ("camera_colours left", "see the same scene and show other colours: red, green and blue are"),
    "grey": ("camera_grey right", "/icubSim/cam/right has 0 % of the colours of /icubSim/cam/left"),
    "column": ("camera_dead_columns left", "/icubSim/cam/left: 0.6"),
    "lines": ("camera_lines right", "/icubSim/cam/right: neighbouring lines differ more than others"),
    "blur": ("camera_blur right", "% of the sharpness of /icubSim/cam/left, which sees the same scene"),
    "jam": ("jam eyes_version", "eyes_version does not move"),
    "frozen": ("camera_frozen left", "pictures of /icubSim/cam/left do not move"),
}
SUITE = "".join(
    f'<test name="{name}"><parameter name="inject">"{inject}"</parameter> CameraMotion </test>'
    for name, (inject, _) in CASES.items()
)


@pytest.fixture(scope="module")
def outcome(run_on_robot):
    """One run of all of them."""
    try:
        rendering_back_end()
    except RenderingError as error:
        pytest.skip(str(error))
    return run_on_robot(SUITE, cameras="yes", camera_rate=10, parts="head")


def test_healthy_pictures_move_as_the_field_of_view_says(outcome, measured):
    """With tilt, version and vergence; the last one turns the eyes in opposite directions."""
    assert outcome.verdict("healthy") is Verdict.PASSED, outcome.detail("healthy")
    ways = measured(outcome, "healthy", "way of the pictures")
    assert [one.subject for one in ways] == ["/icubSim/cam/left", "/icubSim/cam/right"]
    (apart,) = measured(outcome, "healthy", "difference of the colours")
    assert (apart.subject, apart.value < 3.0) == ("/icubSim/cam/left and /icubSim/cam/right", True)
    assert measured(outcome, "healthy", "sharpness")[0].value > 85.0
    assert measured(outcome, "healthy", "colourfulness")[0].value > 90.0
    assert [one.value for one in measured(outcome, "healthy", "edges that stand still")] == [0.0, 0.0]
    assert max(one.value for one in measured(outcome, "healthy", "difference of lines")) < 0.9
    assert all(one.value == pytest.approx(100.0, abs=12.0) for one in ways)
    for joint in ("eyes_tilt", "eyes_version", "eyes_vergence"):
        assert measured(outcome, "healthy", f"expected with {joint}")[0].value > 8.0


def test_a_picture_shows_what_stands_still(outcome):
    """Attached to the test that has found it, and to no other."""
    (shown,) = outcome.of(Attached, name="icubSim-cam-left.png")
    assert (shown.test.rpartition("/")[2], shown.media_type) == ("column", "image/png")


@pytest.mark.parametrize("name", [name for name, (inject, _) in CASES.items() if inject])
def test_each_fault_is_named(outcome, name):
    """The failure names the camera, or the joint that does not turn the eyes, and the fault."""
    assert outcome.verdict(name) is Verdict.FAILED
    assert CASES[name][1] in outcome.detail(name)
