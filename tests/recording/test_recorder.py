"""Recorder and player over real sockets: everything that is sent is kept, and sent again in order with its stamps."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rtf import clock
from rtf.bottle import Bottle
from rtf.middleware.errors import NameNotFoundError
from rtf.middleware.ports.port import Port
from rtf.middleware.types import BYTES, Image, Stamp
from rtf.middleware.wire.contact import Contact
from rtf.recording import Player, Recorder, RecordingError, create_store, open_recording

from .conftest import read_all

if TYPE_CHECKING:
    from pathlib import Path

    from rtf.middleware.ports.network import Network
    from rtf.middleware.wire.incoming_message import IncomingMessage

SENT = 40


def contents(name: str, number: int) -> Bottle | Image | np.ndarray:
    """The message of a number: a vector, a bottle, or an image."""
    if name == "/arm":
        return np.array([number, 0.1 * number, -1.5])
    if name == "/skin":
        return Bottle.parse(f'[set] "number {number}" ({number} 2.5)')
    return Image(np.full((24, 32, 3), number, np.uint8), "rgb")


def expected(name: str, number: int) -> Bottle | Image:
    """The message as a recording has it."""
    value = contents(name, number)
    return Bottle(value.tolist()) if isinstance(value, np.ndarray) else value


NAMES = ("/arm", "/skin", "/camera")


class Listener:
    """A port that keeps what comes, by its sender's stream."""

    def __init__(self, name: str, network: Network) -> None:
        self.got: list[tuple[Stamp | None, Bottle | Image]] = []
        self._images = name == "/camera"
        self.port = Port(f"/heard{name}", self._receive, network=network, outputs=False)

    def _receive(self, message: IncomingMessage) -> None:
        value = message.read(Image.codec) if self._images else message.read()
        self.got.append((Stamp.parse(message.envelope), value))


@pytest.mark.parametrize("carrier", ["tcp", "fast_tcp"])
def test_what_is_recorded_is_played_in_order_with_its_stamps(place: Path, network: Network, carrier: str):
    """Two streams and a camera go through sockets into a file, and from there to readers again."""
    with create_store(place) as store, Recorder(store, network=network) as recorder:
        ports = [Port(name, network=network) for name in NAMES]
        for port in ports:
            recorder.connect(Contact(port.name), carrier)
        for number in range(SENT):
            for port in ports:
                port.write(contents(port.name, number), envelope=str(Stamp(number, 100 + number / 8)))
        recorder.close()
        for port in ports:
            port.close()
    assert recorder.written == dict.fromkeys(NAMES, SENT)
    assert not recorder.dropped
    for name in NAMES:
        found = [(sample.stamp, sample.value) for sample in read_all(place) if sample.source == name]
        assert found == [(Stamp(number, 100 + number / 8), expected(name, number)) for number in range(SENT)]

    listeners = {name: Listener(name, network) for name in NAMES}
    with Player(open_recording(place), network=network) as player:
        for port in player.ports:
            port.add_output(f"/heard{port.name}")
        player.play(rate=1000.0)
    assert player.sent == SENT * len(NAMES)
    for name, listener in listeners.items():
        listener.port.close()
        assert listener.got == [(Stamp(number, 100 + number / 8), expected(name, number)) for number in range(SENT)]


def test_messages_without_stamps_stay_so(place: Path, network: Network):
    """A count of -1 is written, and no envelope is sent when it is played."""
    with (
        create_store(place) as store,
        Recorder(store, network=network) as recorder,
        Port("/a", network=network) as port,
    ):
        recorder.connect(Contact("/a"))
        port.write(Bottle([1]))
        port.write(Bottle([2]), envelope="not a stamp")
        recorder.close()
    assert [sample.stamp for sample in read_all(place)] == [Stamp(), Stamp()]
    envelopes: list[str] = []
    with (
        Port("/reader", lambda message: envelopes.append(message.envelope), network=network),
        Player(open_recording(place), network=network) as player,
    ):
        player.ports[0].add_output("/reader")
        player.play(rate=1000.0)
    assert envelopes == ["", ""]


def test_messages_are_played_at_their_times(tmp_path: Path, network: Network):
    """Half as fast takes twice as long as they took, and none is sent before its time."""
    (tmp_path / "info.log").write_text("Type: Bottle;\nStamp: rx;\n[1.0] /a [connected]\n")
    (tmp_path / "data.log").write_text("0 5.00 0\n1 5.05 1\n2 5.10 2\n")
    arrived: list[float] = []
    with (
        Port("/reader", lambda _: arrived.append(clock.monotonic()), network=network),
        Player(open_recording(tmp_path), network=network) as player,
    ):
        player.ports[0].add_output("/reader")
        begun = clock.monotonic()
        player.play(rate=0.5)
    for number, at in enumerate(arrived):
        assert at - begun >= 0.1 * number
    assert len(arrived) == 3


def test_only_what_is_asked_for_is_played(tmp_path: Path, network: Network):
    """Streams are chosen by port, folder or pattern; a name that none has is refused with what there is."""
    from rtf.recording import Sample

    with create_store(tmp_path / "run") as store:
        for name in ("/icub/head", "/icub/arm", "/other"):
            store.add(Sample(name, 1.0, Stamp(), Bottle([1])))
    recording = open_recording(tmp_path / "run")
    for only, wanted in (
        (["/other"], ["/p/other"]),
        (["icub_arm"], ["/p/icub/arm"]),
        (["/icub/*", "/other"], ["/p/icub/arm", "/p/icub/head", "/p/other"]),
    ):
        with Player(recording, only=only, prefix="/p", network=network) as player:
            assert [port.name for port in player.ports] == wanted
    with pytest.raises(RecordingError, match=r"no stream '/icub/hed'; did you mean /icub/head\?; there are /icub/arm"):
        Player(recording, only=["/icub/hed"], network=network)


def test_a_source_that_comes_back_is_recorded_again(tmp_path: Path, network: Network):
    """Its end and its return are in info.log, and no connection has to be made by hand."""
    with create_store(tmp_path / "run") as store, Recorder(store, network=network) as recorder:
        for number in range(2):
            with Port("/camera", network=network) as port:
                if not number:
                    recorder.connect(Contact("/camera"))
                deadline = clock.Deadline.after(30)
                while not port.outputs:
                    assert not deadline.expired
                    clock.sleep(0.01)
                port.write(Bottle([number]))
                if number:
                    recorder.close()  # before the second end
    info = (tmp_path / "run/camera/info.log").read_text().splitlines()
    assert [line.split(" ", 1)[1] for line in info] == [
        "Bottle;",
        "tx+rx;",
        "/camera [connected]",
        "/camera [disconnected]",
        "/camera [connected]",
    ]
    assert [sample.value for sample in read_all(tmp_path / "run")] == [Bottle([0]), Bottle([1])]


def test_a_source_that_comes_while_the_recorder_looks_has_not_ended(
    tmp_path: Path, network: Network, monkeypatch: pytest.MonkeyPatch
):
    """It is connected once, and its end is not reported."""
    monkeypatch.setattr("rtf.recording.recorder._WATCH", 0.01)
    reported: list[str] = []
    network.report = reported.append
    looked, connected, looked_again = threading.Event(), threading.Event(), threading.Event()

    class Sources(dict[str, str]):
        """The sources of a recorder, whose first look at them is late."""

        def items(self):
            if looked.is_set():
                looked_again.set()
            else:
                looked.set()
                connected.wait(30)
            return super().items()

    with (
        create_store(tmp_path / "run") as store,
        Port("/camera", network=network) as port,
        Recorder(store, network=network) as recorder,
    ):
        recorder._sources = Sources()
        assert looked.wait(30)
        recorder.connect(Contact("/camera"))
        connected.set()
        assert looked_again.wait(30)
        port.write(Bottle([1]))
        recorder.close()
    info = (tmp_path / "run/camera/info.log").read_text().splitlines()
    assert [line.split(" ", 1)[1] for line in info] == ["Bottle;", "tx+rx;", "/camera [connected]"]
    assert reported == []


def test_what_does_not_fit_into_memory_is_counted(tmp_path: Path, network: Network):
    """While the disk does not answer, messages wait up to the limit; the others are dropped, and no sender waits."""
    from rtf.recording.dumper import DumpFolder

    held, let_go = threading.Event(), threading.Event()

    class HeldFolder(DumpFolder):
        def add(self, sample) -> None:
            held.set()
            assert let_go.wait(30)
            super().add(sample)

    with HeldFolder(tmp_path / "run") as store, Port("/a", network=network) as port:
        recorder = Recorder(store, network=network, memory=20_000)
        recorder.connect(Contact("/a"))
        port.write(Bottle([0]))
        assert held.wait(30)
        for number in range(1, 100):
            port.write(Bottle([number]), envelope=str(Stamp(number, 1.0)))
        let_go.set()
        recorder.close()
    assert 20 < recorder.written["/a"] < 60
    assert recorder.written["/a"] + recorder.dropped["/a"] == 100
    assert not recorder.skipped
    assert [sample.value for sample in read_all(tmp_path / "run")] == [
        Bottle([number]) for number in range(recorder.written["/a"])
    ]


def test_what_a_sender_skips_is_counted(tmp_path: Path, network: Network):
    """By the numbers of its stamps; those of a sender that begins again, and messages without any, say nothing."""
    with create_store(tmp_path / "run") as store, Recorder(store, network=network) as recorder:
        with Port("/a", network=network) as port:
            recorder.connect(Contact("/a"))
            for count in (5, 6, 9, 0, 1, -1, 7):
                port.write(Bottle([count]), envelope=str(Stamp(count, 1.0)) if count >= 0 else "")
        recorder.close()
    assert (recorder.written["/a"], recorder.skipped["/a"]) == (7, 2)


def test_what_is_no_message_of_yarp_is_counted_and_reported(tmp_path: Path, network: Network):
    """The others of the stream are recorded."""
    reported: list[str] = []
    network.report = reported.append
    from rtf.middleware.types.codecs import RAW

    with create_store(tmp_path / "run") as store, Recorder(store, network=network) as recorder:
        with Port("/a", network=network) as port:
            recorder.connect(Contact("/a"))
            port.write(Bottle([1]))
            port.write(b"\xff\xff\xff\xff\x01\0\0\0", RAW)
            port.write(b"\x01\x02", BYTES)
        recorder.close()
    assert (recorder.written["/a"], recorder.refused["/a"]) == (2, 1)
    assert [text for text in reported if "a message of /a is not recorded" in text]


def test_a_source_that_is_not_there_is_an_error(tmp_path: Path, network: Network):
    """Nothing waits for it."""
    with (
        create_store(tmp_path / "run") as store,
        Recorder(store, network=network) as recorder,
        pytest.raises(NameNotFoundError),
    ):
        recorder.connect(Contact("/nobody"))
