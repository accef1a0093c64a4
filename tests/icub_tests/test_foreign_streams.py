"""CameraTest and FtSensorTest on the streams of a robot that is not simulated and has no model."""

from contextlib import ExitStack

import numpy as np
import pytest

from harness import run_command, write_files
from rtf.bottle import Property
from rtf.middleware.naming import configuration
from rtf.middleware.naming.configuration import find_network
from rtf.middleware.naming.server import NameServer
from rtf.middleware.types import Image
from rtf.robot.device import Device
from rtf.robot.devices.fake_camera import FakeFrameGrabber
from rtf.robot.devices.fake_sensors import FakeAnalogSensor
from rtf.robot.interfaces import IMultipleAnalogSensors, SensorCategory, SensorInfo, SensorReading, SensorStatus
from rtf.robot.sensors.analog import AnalogDevice
from rtf.robot.sensors.analog_sensors import AnalogSensorsDevice
from rtf.robot.sensors.camera import FrameGrabberDevice
from rtf.testing.events import Message, SubResultEnded
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import Severity, Verdict

PERIOD = 0.01
#: What picture a camera shows instead of its n-th: of a hundred more than half are one, or only five are.
CAMERAS = {
    "good": lambda n: n,
    "twice": lambda n: n // 2,
    "halting": lambda n: n - min(n % 100, 55),
    "blinking": lambda n: n - min(n % 100, 4),
    "line": lambda n: n + n // 3 + 1,  # no multiple of 4
}
#: One that is coarse in two channels, one that counts, and one that is broken.
REPEATING = {
    "coarse": lambda noise: np.where(np.arange(6) < 2, 34.5, noise),
    "fingers": lambda _: np.arange(6.0),
    "dead": lambda _: np.full(6, 0.25),
}
AGAIN = [f"(/bot/{name}/analog:o 0)" for name in REPEATING]
#: Nothing that a busy machine does to a stream counts.
ANYHOW = {"max_loss": 100, "max_gap": 1e6, "max_jitter": 1e6}
LOUD = {**ANYHOW, "frequency_tolerance": 1e3, "force_noise": 1e3, "torque_noise": 1e3}
LOAD = {"expected": "(0 0 0 0 0 0)", "force_tolerance": 1e3, "torque_tolerance": 1e3}


def entry(name, test, **parameters):
    """A test of the suite."""
    rows = "".join(f'<parameter name="{key}">{value}</parameter>' for key, value in parameters.items())
    return f'<test name="{name}">{rows} {test} </test>'


SUITE = "".join([
    entry("cameras", "CameraTest", expected_frequency=100, tolerance=1000, **ANYHOW),
    entry("unknown", "FtSensorTest", portname="/bot/left_hand/analog:o", **LOUD),
    entry("given", "FtSensorTest", portname="/bot/left_hand/analog:o", **LOUD, **LOAD),
    entry("not-asked", "FtSensorTest", portname="/bot/left_leg/analog:o", use_model="false", **LOUD),
    entry("all", "FtSensorTest", **LOUD, **LOAD),
    entry("full", "FtSensorTest", portname="/bot/left_leg/analog:o", saturation=0.5, **LOUD, **LOAD),
    entry("again", "SensorsDuplicateReadings", ports=f"({' '.join(AGAIN)})"),
    entry("dead-torque", "FtSensorTest", portname="/bot/left_leg/analog:o", least_torque_noise=900, **LOUD, **LOAD),
])  # fmt: skip


class Camera(FakeFrameGrabber):
    """A camera that repeats pictures, or shows a single line; the time of a picture follows from its number."""

    count = 0

    def __init__(self, name, network):
        super().__init__(name, network=network)
        self.shown = CAMERAS[name]

    def image(self):
        """See IFrameGrabber."""
        self.count += 1
        pixels = np.zeros_like(self._background) if self.shown is CAMERAS["line"] else self._background.copy()
        pixels[self.shown(self.count) % self._height, :, 2] = 255
        return Image(pixels, "rgb"), self.count * PERIOD


class Repeating(FakeAnalogSensor):
    """A sensor whose first channels never change; ``made`` computes its values from those of another sensor."""

    def __init__(self, name, network, made):
        super().__init__(name, network=network)
        self.made = made

    def _raw(self, now):
        return self.made(np.random.default_rng().normal(size=6))


class Feet(Device, IMultipleAnalogSensors):
    """Two force sensors, one of them with an unknown name, and a gyroscope."""

    def open(self, configuration):
        """See Device."""

    def close(self):
        """See Device."""

    def sensors(self, category):
        """See IMultipleAnalogSensors."""
        names = {SensorCategory.GYROSCOPE: ["gyro"], SensorCategory.FORCE_TORQUE: ["l_leg_ft", "odd"]}
        return [SensorInfo(name) for name in names.get(category, ())]

    def sensor_status(self, category, index):
        """See IMultipleAnalogSensors."""
        return SensorStatus.OK

    def read_sensor(self, category, index):
        """See IMultipleAnalogSensors."""
        size = 6 if category is SensorCategory.FORCE_TORQUE else 3
        return SensorReading(np.random.default_rng().normal(size=size), 0.0)


def devices(network):
    """The devices of the robot and the servers of each, by the beginning of their port names."""
    for name in CAMERAS:
        yield f"/bot/cam/{name}", Camera(name, network), FrameGrabberDevice
    for place in ("left_leg", "left_hand"):
        yield f"/bot/{place}/analog:o", FakeAnalogSensor(place, network=network), AnalogDevice
    for place, made in REPEATING.items():
        yield f"/bot/{place}/analog:o", Repeating(place, network, made), AnalogDevice
    yield "/bot/feet", Feet("feet"), AnalogSensorsDevice


@pytest.fixture(scope="module")
def outcome(tmp_path_factory):
    """One run of all of them."""
    folder = tmp_path_factory.mktemp("foreign")
    write_files(folder, {"suite.xml": f'<suite name="s">{SUITE}</suite>'})
    with pytest.MonkeyPatch.context() as patch, ExitStack() as opened:
        patch.setenv("YARP_CONFIG_HOME", str(folder / "user"))
        configuration.write_place(opened.enter_context(NameServer()).contact)
        network = find_network()
        opened.callback(network.names.close)
        for place, device, kind in devices(network):
            device.open(Property({"width": 64, "height": 48}))
            server = kind(place, network=network)
            server.open(Property({"name": place, "period": PERIOD / server.unit}))
            opened.callback(server.close)
            server.attach({"device": device})
        return run_command(folder, "--suite", "suite.xml", YARP_ROBOT_NAME="bot", RTF_CLOCK="", YARP_CLOCK="")


def verdicts(outcome, test):
    """The verdicts of a test's sub-results."""
    return {one.subject: one.verdict for one in outcome.of(SubResultEnded, test=f"s/{test}")}


def failures(outcome, test):
    """The texts of a test's failures."""
    return [one.detail for one in outcome.of(Message, test=f"s/{test}", severity=Severity.FAILURE)]


@pytest.mark.parametrize(
    ("camera", "failed"),
    [
        ("good", set()),
        ("twice", {"repeated pictures"}),
        ("halting", {"repeated pictures", "same picture in a row"}),
        ("blinking", {"same picture in a row"}),
        ("line", set()),
    ],
)
def test_no_two_pictures_of_a_real_camera_are_the_same(outcome, measured, camera, failed):
    """Pictures sent twice, a camera that is frozen half of the time, and one that flickers are found."""
    what = ("repeated pictures", "same picture in a row")
    found = [one for name in what for one in measured(outcome, "cameras", name, f"/{camera}")]
    assert {one.name for one in found} == {*what}
    assert {one.name for one in found if one.verdict is MeasurementVerdict.FAILED} == failed
    assert verdicts(outcome, "cameras")[f"/bot/cam/{camera}"] is (Verdict.FAILED if failed else Verdict.PASSED)


def test_one_bright_line_is_a_picture(outcome, measured):
    """Every pixel counts, wherever the line is."""
    (contrast,) = measured(outcome, "cameras", "contrast", "/line")
    assert contrast.value > 5.0


def test_a_load_that_nobody_knows_is_not_passed(outcome, measured):
    """It is inconclusive: rate and noise do not show the load. The message has the hint, and the mean is reported."""
    assert outcome.verdict("unknown") is Verdict.INCONCLUSIVE
    assert "the load of /bot/left_hand/analog:o is unknown" in outcome.detail("unknown")
    assert "or give expected" in outcome.detail("unknown")
    (mean,) = measured(outcome, "unknown", "torque z")
    assert mean.verdict is MeasurementVerdict.RECORDED
    assert outcome.verdict("given") is Verdict.PASSED


def test_a_load_that_is_not_to_be_judged_is_skipped(outcome):
    """The report shows the skipped sub-result beside those that were judged."""
    assert outcome.verdict("not-asked") is Verdict.PASSED
    port = "/bot/left_leg/analog:o"
    assert verdicts(outcome, "not-asked") == {port: Verdict.PASSED, f"{port}/load": Verdict.SKIPPED}


def test_sensors_in_one_message_are_judged_one_by_one(outcome):
    """Also beside sensors of other kinds; those without ports of their own are found by themselves."""
    feet = "/bot/feet/measures:o"
    assert verdicts(outcome, "all") == dict.fromkeys(
        ["/bot/left_leg/analog:o", feet, f"{feet}/l_leg_ft", f"{feet}/odd"], Verdict.PASSED
    )


def test_what_is_coarse_is_not_frozen(outcome):
    """Neither two constant channels beside others that change, nor whole numbers at rest."""
    port = "/bot/{}/analog:o".format
    assert verdicts(outcome, "again") == {
        port("coarse"): Verdict.PASSED,
        port("fingers"): Verdict.INCONCLUSIVE,
        port("dead"): Verdict.FAILED,
    }
    warned = [one.detail for one in outcome.of(Message, test="s/again", severity=Severity.WARNING)]
    assert any("constant: channel 0, channel 1;" in text for text in warned)


def test_what_is_wrong_is_said_in_terms_of_the_sensor(outcome):
    """A sensor at the end of its range, or with dead torques only; with likely causes."""
    (full,) = failures(outcome, "full")
    assert "/bot/left_leg/analog:o is saturated" in full
    assert "likely: " in full
    dead = failures(outcome, "dead-torque")
    assert [text.split(" = ")[0] for text in dead] == [f"noise of torque {axis}" for axis in "xyz"]
