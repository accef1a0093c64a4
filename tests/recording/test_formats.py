"""Formats: what is written is read, and any text or bytes give an error of ours."""

from __future__ import annotations

import json
import struct
import tempfile
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer
from PIL import Image as Pillow

from rtf.bottle import Bottle
from rtf.errors import Location
from rtf.middleware.types import Image, Stamp
from rtf.recording import RecordingError, Sample, create_store, open_recording
from rtf.recording.dump_reading import TYPES, Info, parse_info, parse_line
from rtf.recording.mcap_messages import bottle_to_json, cdr_to_image, image_to_cdr, json_to_bottle

from .conftest import bottles, exact_bottles, images, more_images, read_all, stamps, times

if TYPE_CHECKING:
    from collections.abc import Callable

WHERE = Location("data.log", 1)
SOURCE = "/robot/state:o"


def written(path: Path, samples: list[Sample]) -> None:
    """Write a recording."""
    with create_store(path) as store:
        for sample in samples:
            store.add(sample)


@settings(max_examples=50)
@given(st.lists(st.tuples(times, stamps, bottles), min_size=1, max_size=5))
def test_bottles_in_a_dump_are_what_was_written(rows):
    """Times, stamps and messages of a folder are those that were given to it, to the last bit."""
    samples = [Sample(SOURCE, *row) for row in rows]
    with tempfile.TemporaryDirectory() as folder:
        written(Path(folder) / "run", samples)
        found = read_all(Path(folder) / "run")
    assert found == samples


@settings(max_examples=30)
@given(st.lists(images, min_size=1, max_size=3))
def test_images_in_a_dump_are_what_was_written(shown: list[Image]):
    """Grey, colours in both orders, and depths are files that are read as they were."""
    depth = [image.code == "dec" for image in shown]
    samples = [Sample("/camera", float(number), Stamp(number, 0.5), image) for number, image in enumerate(shown)]
    with tempfile.TemporaryDirectory() as folder:
        written(Path(folder) / "run", samples)
        assert read_all(Path(folder) / "run") == samples
        assert f"Type: {'Depth' if depth[0] else 'Image'};" in (Path(folder) / "run/camera/info.log").read_text()


@settings(max_examples=50)
@given(exact_bottles, stamps)
def test_a_message_as_json_is_what_it_was(bottle: Bottle, stamp: Stamp):
    """Every type of number comes back as it was, also inside lists."""
    found, stamped = json_to_bottle(bottle_to_json(bottle, stamp))
    assert (found, stamped) == (bottle, stamp)
    assert found.to_text() == bottle.to_text()
    assert [type(value) for value in found] == [type(value) for value in bottle]


@settings(max_examples=50)
@given(more_images)
def test_an_image_of_ros_is_what_it_was(image: Image):
    """Pixels and their format come back, also of formats that ROS does not know; so does the stamp."""
    stamp = Stamp(7, 1732716519.25)
    assert cdr_to_image(image_to_cdr(image, stamp, "camera"), 7) == (image, stamp)
    assert cdr_to_image(image_to_cdr(image, Stamp(), "camera"), 0) == (image, Stamp())


INFO_PARTS = ["Type: ", "Bottle;", "Stamp:", "tx;", "\n", "[1.0] /x [connected]", ";"]
LINE_PARTS = ["0", "-1", "1e9", "nan", "1.5", "(", ")", '"', "[set]", "00000000.ppm", "..", "/", "[rgb]", "{1"]

LINES = st.text() | st.lists(st.sampled_from(LINE_PARTS)).map(" ".join)


def outcome(read: Callable[[], Any]) -> Any:
    """What a reader returns, or the text of its error."""
    try:
        return read()
    except RecordingError as error:
        return str(error)


@given(st.text() | st.lists(st.sampled_from(INFO_PARTS)).map("".join))
def test_any_info_gives_a_type_or_an_error_with_its_line(text: str):
    """The parser of info.log ends in no other way, whatever it reads."""
    found = outcome(lambda: parse_info(text))
    assert found.startswith("info.log:") if isinstance(found, str) else found.kind in TYPES


@settings(max_examples=300)
@given(
    st.text() | st.lists(st.sampled_from(LINE_PARTS)).map(" ".join),
    st.sampled_from([*TYPES]),
    st.sampled_from(["rx", "tx", "tx+rx"]),
)
def test_any_line_gives_a_message_or_an_error_with_its_place(text: str, kind: str, stamps: str):
    """The parser of data.log ends in no other way."""
    found = outcome(lambda: parse_line(text, Info(kind, stamps, SOURCE), SOURCE, Path("nowhere"), WHERE))
    if isinstance(found, str):
        assert found.startswith(("data.log:1: ", "nowhere/"))
    else:
        assert isinstance(found.value, Bottle)


def test_no_image_is_outside_its_folder(tmp_path: Path):
    """A log that was made to read other files is refused."""
    for name in ("../secret.ppm", "/etc/secret.ppm", ".."):
        line = f"0 1.0 {name} [rgb]\n"
        with pytest.raises(RecordingError, match=r"^data\.log:1: "):
            parse_line(line, Info("Image", "rx", SOURCE), SOURCE, tmp_path, WHERE)


@settings(max_examples=200)
@given(st.binary(max_size=80), st.integers(0, 400), st.integers(0, 400))
def test_a_damaged_mcap_file_gives_messages_or_an_error(damage: bytes, start: int, cut: int):
    """A file whose bytes are others, or that is cut off anywhere, is read or refused with its name."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        written(path, [Sample(SOURCE, 1.0, Stamp(1, 2.0), Bottle([1.5]))])
        whole = path.read_bytes()
        path.write_bytes((whole[:start] + damage + whole[start + len(damage) :])[: len(whole) - cut])
        found = outcome(lambda: read_all(path))
        assert str(path) in found if isinstance(found, str) else len(found) <= 1


def test_a_dump_of_yarp_is_read(tmp_path: Path):
    """Folders as yarpdatadumper writes them: one stamp, both, and a message without a stamp."""
    for name, head, rows in (
        ("one", "Type: Bottle;\nStamp: rx;\n[9.5] /icub/head/state:o [connected]\n", "4 10.500000 1.0 [pos] (2 x)\n"),
        ("both", "Type: Bottle;\nStamp: tx+rx;\n[9.5] /both [connected]\n", "5 10.000000 10.600000 7\n"),
        ("tx", "Type: Bottle; \nStamp: tx;\n[9.5] /tx [connected]\n", "6 10.700000 8\n-1 0.000000 10.800000 9\n"),
    ):
        (tmp_path / name).mkdir()
        (tmp_path / name / "info.log").write_text(head)
        (tmp_path / name / "data.log").write_text(rows)
    assert read_all(tmp_path) == [
        Sample("/icub/head/state:o", 10.5, Stamp(4, 10.5), Bottle.parse("1.0 [pos] (2 x)")),
        Sample("/both", 10.6, Stamp(5, 10.0), Bottle([7])),
        Sample("/tx", 10.7, Stamp(6, 10.7), Bottle([8])),
        Sample("/tx", 10.8, Stamp(), Bottle([9])),
    ]


def test_a_line_that_is_broken_is_named_and_one_that_is_cut_off_left_out(tmp_path: Path):
    """What a crash leaves at the end is no error; anything else has its file and line."""
    (tmp_path / "info.log").write_text("Type: Bottle;\nStamp: rx;\n")
    log = tmp_path / "data.log"
    log.write_text("0 1.0 1\n1 2.0 2\n2 3.")
    recording = open_recording(tmp_path)
    (stream,) = recording.streams
    assert [sample.value for sample in recording.samples([stream.source])] == [Bottle([1]), Bottle([2])]
    assert recording.notes == [f"{log}:3: the last line is cut off, and left out"]
    log.write_text("0 1.0 1\n1 later 2\n")
    with pytest.raises(RecordingError, match=r"data\.log:2: 'later' is not a time"):
        read_all(tmp_path)


def test_images_of_other_programs_are_read(tmp_path: Path):
    """PNG and JPEG files, a PGM file with a comment, and depths by zlib."""
    pixels = np.full((4, 6, 3), (200, 100, 50), np.uint8)
    Pillow.fromarray(pixels).save(tmp_path / "0.png")
    Pillow.fromarray(pixels).save(tmp_path / "1.jpg", quality=95)
    (tmp_path / "2.pgm").write_bytes(b"P5\n# a comment\n2 1\n255\n\x05\x06")
    (tmp_path / "info.log").write_text("Type: Image:png;\nStamp: rx;\n[1.0] /camera [connected]\n")
    (tmp_path / "data.log").write_text(
        "0 1.0 0.png [bgr]\n1 2.0 1.jpg [rgb]\n2 3.0 2.pgm [mono]\n3 4.0 3.floatzip [dec]\n"
    )
    (tmp_path / "3.floatzip").write_bytes(struct.pack("<2Q", 1, 2) + zlib.compress(struct.pack("<2f", 1.5, 2.5)))
    png, jpg, pgm, depth = (sample.value for sample in read_all(tmp_path))
    assert png == Image(pixels[..., ::-1].copy(), "bgr")
    assert np.abs(jpg.pixels.astype(int) - pixels).max() < 8
    assert pgm == Image(np.array([[5, 6]], np.uint8), "mono")
    assert depth == Image(np.array([[1.5, 2.5]], np.float32), "dec")


def test_what_is_there_is_not_overwritten(place: Path):
    """A recording that exists stays as it is."""
    written(place, [Sample(SOURCE, 1.0, Stamp(), Bottle([1]))])
    with pytest.raises(RecordingError, match="new"):
        create_store(place)
    assert len(read_all(place)) == 1


def test_a_stream_that_changes_between_images_and_others_is_refused_by_the_dumper_only(place: Path):
    """A folder of the dumper has one type; MCAP has a channel for each."""
    image = Sample("/x", 2.0, Stamp(), Image(np.zeros((2, 2), np.uint8)))
    with create_store(place) as store:
        store.add(Sample("/x", 1.0, Stamp(), Bottle([1])))
        if place.suffix:
            store.add(image)
        else:
            with pytest.raises(RecordingError, match="/x sends images among other messages; record it as MCAP"):
                store.add(image)
    assert len(read_all(place)) == (2 if place.suffix else 1)


def test_streams_of_other_programs_in_an_mcap_file_are_left_out_and_named(tmp_path: Path):
    """A file of ROS is no error, though nothing of it can be played."""
    path = tmp_path / "other.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/chatter", "cdr", schema)
        writer.add_message(channel, 1, b"\0\1\0\0", 1)
        writer.finish()
    assert read_all(path) == []
    assert open_recording(path).notes == [
        f"{path}: streams of other programs are left out: /chatter (std_msgs/msg/String)"
    ]


def plain(schema: dict[str, Any]) -> bool:
    """Whether Foxglove reads a JSON schema: by the types that its parser takes."""
    kind = schema.get("type")
    if kind == "object":
        return all(plain(inner) for inner in schema["properties"].values())
    if kind == "array":
        return schema["items"].get("type") in ("boolean", "string", "number", "integer")
    return kind in ("boolean", "number", "integer") or (
        kind == "string" and schema.get("contentEncoding") in (None, "base64")
    )


def test_an_mcap_file_is_one_for_any_reader(tmp_path: Path):
    """Checksums and index are right; times and schemas are what a viewer needs, and numbers are flat."""
    path = tmp_path / "run.mcap"
    image = Image(np.zeros((2, 3, 3), np.uint8))
    with create_store(path) as store:
        store.note(0.5, SOURCE, connected=True)
        store.add(Sample(SOURCE, 1.0, Stamp(7, 0.75), Bottle.parse("[set] 1 (2.5 x)")))
        store.add(Sample("/camera", 2.0, Stamp(), image))
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = [*reader.iter_messages()]
        notes = [(note.name, note.metadata) for note in reader.iter_metadata()]
    (schema, channel, message), (of_image, camera, shown) = found
    assert (channel.topic, channel.message_encoding, schema.encoding) == (SOURCE, "json", "jsonschema")
    assert plain(json.loads(schema.data))
    assert (message.log_time, message.publish_time, message.sequence) == (1_000_000_000, 750_000_000, 7)
    decoded = json.loads(message.data)
    assert (decoded["values"], decoded["text"]) == ([None, 1, 2.5, None], "[set] 1 (2.5 x)")
    assert (camera.topic, of_image.name, of_image.encoding) == ("/camera", "sensor_msgs/msg/Image", "ros2msg")
    assert (shown.log_time, shown.publish_time, shown.sequence) == (2_000_000_000, 2_000_000_000, 0)
    assert notes == [("connected", {"port": SOURCE, "time": "0.500000"})]
