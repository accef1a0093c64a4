"""The red ball: the robot sees it, looks at it and reaches for it, with one hand after the other."""

from __future__ import annotations

import tempfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from rtf.bottle import Bottle, Property, Vocab, as_float, as_list, as_string
from rtf.errors import RtfError
from rtf.middleware.ports.remote import exists
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.types import IMAGE
from rtf.middleware.types.codecs import BOTTLE
from rtf.middleware.wire.contact import Contact
from rtf.red_ball.child_programs import child_program
from rtf.red_ball.detection import find_ball
from rtf.red_ball.eye_check import Look, frozen, swapped
from rtf.red_ball.eyes import cameras_of, in_root, pinhole
from rtf.red_ball.scene import SceneBall
from rtf.red_ball.stereo import locate
from rtf.robot.device import make_device
from rtf.robot.interfaces import ICartesianControl, IGazeControl
from rtf.robot.network.client_settings import unique_local
from rtf.robot.network.latest_message import LatestMessage
from rtf.robot.sensors.camera import FrameGrabberClient
from rtf.robot_testing import RobotTest, Safety, likely_causes
from rtf.robot_testing.robot_name import robot_model
from rtf.testing import Parameter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from rtf.middleware.types.codecs import Codec
    from rtf.robot.device import Device
    from rtf.robot.interfaces import FloatArray
    from rtf.robot.kinematics import Pinhole

T = TypeVar("T")

_EYES = ("left", "right")
_PARTS = ("torso", "head", "left_arm", "right_arm")
#: The joints of the head whose distance from home counts: the neck. The eyes look at something near.
_NECK, _ARM = 3, 7
#: Seconds between two rows of a record, and between two scenes of the film.
_ROW, _FRAME = 0.05, 0.15
#: Time for new pictures, and for the hand to settle, s.
_PICTURES, _REST = 0.4, 0.5
#: How far the ball is moved to see whether the pictures follow, m.
_MOVED = (0.0, 0.04, 0.0)


@dataclass
class _Reach:
    """What was recorded of a reach: times (s), and places in the frame of the root (m)."""

    times: list[float] = field(default_factory=list)
    ball: list[FloatArray] = field(default_factory=list)
    gaze: list[FloatArray] = field(default_factory=list)
    hand: list[FloatArray] = field(default_factory=list)

    def away(self, what: str) -> FloatArray:
        """Return the distances of the gaze or the hand from the ball (m)."""
        found: FloatArray = np.linalg.norm(np.array(getattr(self, what)) - np.array(self.ball), axis=1)
        return found


class DemoRedBall(RobotTest):
    """Has the demonstration look at a ball and reach for it, and judges eyes, gaze, hands and the way home.

    First the pictures of both eyes are compared: they have to follow the ball, and to agree on where it is. In a
    simulation its true place is known. Then, for each hand, the ball is put in front of it; the eyes have to look at
    it, and the hand to reach it. A ``stop`` has to bring all parts home. The programs of the demonstration are
    started if they do not run.
    """

    aliases = ("DemoRedBallTest", "demoRedBall")
    tags = ("motion", "camera", "gaze", "cartesian")
    judged_sensors = ("cameras",)
    safety = Safety.MOTION
    not_per_joint = ("hands", "home")

    hands = Parameter(list[str], "the hands that reach, one after the other", default=["left", "right"])
    demo = Parameter(str, "the beginning of the ports of the demonstration", default="/demoRedBall")
    tracker = Parameter(str, "the same of the tracker", default="/pf3dTracker")
    gaze = Parameter(str, "the same of the gaze controller", default="/iKinGazeCtrl")
    radius = Parameter(float, "radius of the ball", unit="m", default=0.035, low=0.005, high=0.2)
    below = Parameter(float, "how far the ball is put below its first place", unit="m", default=0.3)
    aside = Parameter(float, "how far it is put to the side of the hand", unit="m", default=0.06)
    place_tolerance = Parameter(float, "greatest error of the place of the ball", unit="mm", default=10.0, low=0.0)
    reach_tolerance = Parameter(
        float, "greatest distance of hand and ball", unit="m", default=0.04, low=0.0, aliases=("reach_tol",)
    )
    gaze_tolerance = Parameter(
        float, "greatest distance of the fixation point and the ball", unit="m", default=0.08, low=0.0
    )
    timeout = Parameter(float, "time for a look, a reach, and a way home", unit="s", default=10.0, low=0.1)
    home = Parameter(
        list[float], "home of an arm", unit="deg", default=[-30.0, 30.0, 0.0, 45.0, 0.0, 0.0, 0.0], length=_ARM
    )
    home_tolerance = Parameter(float, "greatest distance from home", unit="deg", default=5.0, low=0.1)
    film = Parameter(bool, "attach a film of it", default=False)
    general = Parameter(
        Bottle, "this section of config-test.ini of the original: reach_tol, left_arm, right_arm", default=Bottle()
    )
    home_arm = Parameter(Bottle, "this section of it: poss, the home of an arm", default=Bottle())

    def check_parameters(self, folder: str) -> None:
        super().check_parameters(folder)
        self._take_file()

    def _take_file(self) -> None:
        """Take what a file of the original says instead. The fixation point has twice the tolerance of the hand."""
        if self.general.check("reach_tol"):
            self.reach_tolerance = as_float(self.general.find("reach_tol"))
            self.gaze_tolerance = 2.0 * self.reach_tolerance
        if len(self.general):
            self.hands = [eye for eye in _EYES if as_string(self.general.find(f"{eye}_arm")) != "off"]
        home = as_list(self.home_arm.find("poss"))
        if home is not None and len(home) == _ARM:
            self.home = [as_float(one) for one in home]

    def parameter_problems(self) -> list[str]:
        wrong = [hand for hand in self.hands if hand not in _EYES]
        return [*super().parameter_problems(), *(f"hands: {hand!r} is neither left nor right" for hand in wrong)]

    # Begin and end ---------------------------------------------------------------------------------------------------

    def setup(self) -> None:
        """Connect to the robot, its eyes and its controllers, and start the demonstration."""
        super().setup()
        robot = robot_model(self)
        self.ports = {eye: f"/{self.robot_name}/{robot.sensors.cameras[eye].port}" for eye in _EYES}
        for eye, port in self.ports.items():
            self.assert_error_if_false(
                self.network.names.query(port), f"there is no {port}, the {eye} eye; start a robot with cameras"
            )
        self.parts = {name: self.open_part(name) for name in _PARTS}
        self.cameras = cameras_of(robot)
        self.scenes: list[tuple[dict[str, float], FloatArray, NDArray[np.uint8] | None]] = []
        self.opened = ExitStack()
        self.add_cleanup(self.opened.close)
        self.asking = self.opened.enter_context(ThreadPoolExecutor(1, thread_name_prefix="rtf-asking"))
        try:
            self._connect()
        except RtfError as error:
            self.assert_error(f"the demonstration cannot be used: {error}")

    def _connect(self) -> None:
        self.camera = self._optics(self.ports["left"])
        self.pictures = {eye: self._reader(f"{eye}-eye", port, IMAGE) for eye, port in self.ports.items()}
        self.looking = self._client("gazecontrollerclient", self.gaze).view(IGazeControl)  # type: ignore[type-abstract]  # it is only looked for
        arms = {hand: f"/{self.robot_name}/cartesianController/{hand}_arm" for hand in self.hands}
        reaching = {hand: self._client("cartesiancontrollerclient", remote) for hand, remote in arms.items()}
        self.reaching = {
            hand: client.view(ICartesianControl)  # type: ignore[type-abstract]  # it is only looked for
            for hand, client in reaching.items()
        }
        self.scene = SceneBall.find(self.robot_name, self.network, self.opened)
        if self.scene is not None:
            self.opened.callback(self.scene.move, (0.0, 0.0, 0.0))
        folder = Path(self.opened.enter_context(tempfile.TemporaryDirectory()))
        self._start("track", self.tracker, f"{self.tracker}/data:o", folder)
        self._start("demo", self.demo, f"{self.demo}/rpc", folder)
        self.rpc = self.opened.enter_context(RpcClient("", f"{self.demo}/rpc", network=self.network))
        self.opened.callback(self._stop)
        self.objects = self._reader("objects", f"{self.demo}/gui:o", BOTTLE)

    def _client(self, kind: str, remote: str) -> Device:
        where = {"remote": remote, "carrier": "tcp", "timeout": 1.0}
        return self.opened.enter_context(closing(make_device(kind, Property(where), network=self.network)))

    def _reader(self, name: str, source: str, codec: Codec[T]) -> LatestMessage[T]:
        reader = LatestMessage(f"{unique_local(self.demo)}/{name}", codec, timeout=1.0, network=self.network)
        self.opened.callback(reader.close)
        reader.connect(source, "tcp")
        return reader

    def _optics(self, port: str) -> Pinhole:
        with closing(FrameGrabberClient("optics", network=self.network)) as camera:
            camera.open(Property({"remote": port, "no_stream": True}))
            return pinhole(camera.width(), camera.height(), camera.field_of_view()[1])

    def _start(self, word: str, name: str, port: str, folder: Path) -> None:
        """Start a program of the demonstration, unless it runs."""
        if exists(self.network, Contact(port)):
            return
        words = ["red-ball", word, "--robot", self.robot_name, "--name", name]
        words += ["--tracker", self.tracker, "--gaze", self.gaze] if word == "demo" else []
        log = folder / f"{word}.log"
        self.add_cleanup(lambda: self.attach(log.read_bytes(), log.name, "text/plain") if log.exists() else None)
        self.opened.enter_context(child_program(words, port, log, network=self.network, wait=lambda: self.sleep(_ROW)))

    def _request(self, *words: str | float) -> Bottle:
        """Ask the demonstration, while time passes. The test fails for a refusal."""
        asked = self.asking.submit(self.rpc.call, Bottle(list(words)))
        while not asked.done():
            self._watch()
        reply = asked.result()
        if reply is None:
            self.assert_fail(f"{self.demo}/rpc has not answered {words[0]}")
        self.assert_true(reply.get(0) == Vocab("ok"), f"{self.demo} has refused {words[0]}: {as_string(reply.get(1))}")
        return reply

    def _stop(self) -> None:
        """Stop the demonstration, in whatever state the test ends."""
        status = self.rpc.call(Bottle(["status"]))
        if status is None or as_string(status.get(1)) == "idle":
            return
        asked = self.asking.submit(self.rpc.call, Bottle(["stop"]))
        while not asked.done():
            self.sleep(_ROW)

    # The test --------------------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Judge the eyes, then each hand. With eyes that do not agree nothing moves."""
        self._judge_eyes()
        for number, hand in enumerate(self.hands):
            self.progress((number + 1) / (len(self.hands) + 1), f"the {hand} hand")
            with self.subresult(f"{hand} hand"):
                self._judge_reach(hand, self._reach(hand))
            self._request("stop")
            with self.subresult(f"home after {hand}"):
                self._judge_home(hand)
        if self.film:
            self._attach_film()

    def _judge_eyes(self) -> None:
        """Compare the pictures of both eyes at two places of the ball."""
        self._request("update_pose", 0.0, 0.0, 0.0)
        before = self._look()
        self._request("update_pose", *_MOVED)
        after = self._look()
        still = [self.ports[eye] for eye in frozen(before, after)]
        self.assert_fail_if_true(
            still, f"pictures of {', '.join(still)} do not move with the ball; {likely_causes('camera frozen')}"
        )
        poses = self.cameras.eyes.poses(self._positions())
        across = np.linalg.inv(poses[0]) @ poses[1]
        self.assert_fail_if_true(
            swapped(after, self.camera, across),
            f"{self.ports['left']} and {self.ports['right']} show what the other one should; "
            f"{likely_causes('cameras swapped')}",
        )
        if after.left is None or after.right is None:
            missing = [self.ports[eye] for eye, seen in zip(_EYES, after, strict=True) if seen is None]
            self.assert_fail(f"{', '.join(missing)} does not show the ball")
        found = locate(after.left, after.right, self.camera, across)
        if found.place is None:
            self.assert_fail(f"{found.problem}; {likely_causes('eyes')}")
        self._judge_place("by the eyes", in_root(found.place, poses[0]))

    def _judge_place(self, name: str, place: FloatArray) -> None:
        """Compare a place of the ball with the true one, where that is known."""
        if self.scene is None:
            return
        away = float(np.linalg.norm(place - self.scene.place())) * 1e3
        self.measure(
            f"place {name}", away, "mm", high=self.place_tolerance,
            hint=f"the ball is seen {away:.0f} mm from where it is; {likely_causes('eyes')}",
        )  # fmt: skip

    def _look(self) -> Look:
        """Return what the eyes see of the ball, some time later."""
        self.sleep(_PICTURES)
        seen = []
        for eye in _EYES:
            latest = self.pictures[eye].latest
            if latest is None:
                self.assert_fail(f"no picture of {self.ports[eye]} came in {_PICTURES:g} s")
            seen.append(find_ball(latest.value.to("rgb").pixels, self.camera, self.radius))
        return Look(*seen)

    def _positions(self) -> FloatArray:
        """Return the positions of the joints that carry the eyes (deg)."""
        known = self._joints("torso", "head")
        return np.array([known[joint] for joint in self.cameras.joints])

    def _joints(self, *names: str) -> dict[str, float]:
        found: dict[str, float] = {}
        for name in names:
            part = self.parts[name]
            found |= dict(zip(part.names, map(float, part.board.encoders()), strict=True))
        return found

    # A reach ---------------------------------------------------------------------------------------------------------

    def _reach(self, hand: str) -> _Reach:
        """Put the ball before a hand, start, and record until both gaze and hand are there, or time is up."""
        side = -1.0 if hand == "left" else 1.0
        self._request("update_pose", 0.0, side * self.aside, -self.below)
        self._request("start", 0.0, -50.0, 10.0)
        found, begin, arrived = _Reach(), self.now(), None
        while self.now() < begin + self.timeout and (arrived is None or self.now() < arrived + _REST):
            self._watch()
            ball = self._shown_ball()
            if ball is None:
                continue
            found.times.append(self.now() - begin)
            found.ball.append(ball)
            found.gaze.append(np.array(self.looking.fixation_point().values))
            found.hand.append(np.array(self.reaching[hand].pose().vector[:3]))
            there = found.away("gaze")[-1] < self.gaze_tolerance and found.away("hand")[-1] < self.reach_tolerance
            arrived = arrived or (self.now() if there else None)
        return found

    def _watch(self) -> None:
        """Let time pass, and keep a scene for the film."""
        self.sleep(_ROW)
        if self.film and self.scene is not None and self.now() >= getattr(self, "_filmed", 0.0) + _FRAME:
            self._filmed = self.now()
            picture = self.pictures["left"].latest
            pixels = None if picture is None else picture.value.to("rgb").pixels
            self.scenes.append((self._joints(*_PARTS), self.scene.place(), pixels))

    def _shown_ball(self) -> FloatArray | None:
        """Return where the demonstration says that the ball is (m)."""
        latest = self.objects.latest
        if latest is None or as_string(latest.value.get(0)) != "object":
            return None
        return np.array([as_float(latest.value.get(place)) for place in (5, 6, 7)]) / 1e3

    def _judge_reach(self, hand: str, found: _Reach) -> None:
        status = self._request("status")
        state, reason = as_string(status.get(1)), as_string(status.get(2))
        self.check_fail_if_true(
            state == "idle", f"{self.demo} has stopped everything: {reason}; {likely_causes('reach')}"
        )
        if not found.times:
            self.assert_true(state == "idle", f"the ball was not seen: {reason}; {likely_causes('eyes')}")
            return
        gaze, reach = found.away("gaze"), found.away("hand")
        self.record("distances from the ball", t=(found.times, "s"), gaze=(gaze, "m"), hand=(reach, "m"))
        places = {
            f"{what} {axis}": (np.array(getattr(found, what))[:, number], "m")
            for what in ("ball", "hand")
            for number, axis in enumerate("xyz")
        }
        self.record("places", t=(found.times, "s"), **{name.replace(" ", "_"): row for name, row in places.items()})
        self._judge_place("by the demonstration", found.ball[-1])
        for what, distances, tolerance in (
            ("fixation point", gaze, self.gaze_tolerance), (f"{hand} hand", reach, self.reach_tolerance)
        ):  # fmt: skip
            near = np.flatnonzero(distances < tolerance)
            self.measure(f"distance of the {what}", float(distances[-1]), "m", high=tolerance,
                         hint=f"the {what} is not at the ball; {likely_causes('reach')}")  # fmt: skip
            if len(near):
                self.measure(f"time of the {what}", found.times[near[0]], "s", high=self.timeout)

    def _judge_home(self, hand: str) -> None:
        """Wait until all parts are at home, and judge where they are."""
        end = self.now() + self.timeout
        while self._from_home(hand) and self.now() < end:
            self._watch()
        for joint, (position, goal) in self._from_home(hand).items():
            self.check_fail_if_true(
                True,
                f"{joint} is at {position:.1f} deg after a stop, home is {goal:.1f}; {likely_causes('does not move')}",
            )
        self.measure("joints not at home", float(len(self._from_home(hand))), high=0.0)

    def _from_home(self, hand: str) -> dict[str, tuple[float, float]]:
        """Return the joints that are not at home: where they are, and where that is (deg)."""
        arm = f"{hand}_arm"
        goals = dict(zip(self.parts[arm].names[:_ARM], self.home, strict=True))
        goals |= dict.fromkeys(self.parts["head"].names[:_NECK], 0.0)
        goals |= dict.fromkeys(self.parts["torso"].names, 0.0)
        here = self._joints(arm, "head", "torso")
        return {
            joint: (here[joint], goal) for joint, goal in goals.items() if abs(here[joint] - goal) > self.home_tolerance
        }

    def _attach_film(self) -> None:
        from rtf.red_ball.film import Scene, film_of

        try:
            made = film_of([Scene(*one) for one in self.scenes], robot_model(self), _FRAME)
        except RtfError as error:
            self.warn(f"there is no film: {error}")
        else:
            self.attach(made, "red-ball.webp", "image/webp")
