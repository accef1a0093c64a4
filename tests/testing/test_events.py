"""Events as lines: written ones read back, and any line is an event or an EventError."""

from __future__ import annotations

import json
import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtf.testing import events
from rtf.testing.events import Event, EventError, Measured, Message, TestEnded, UnknownEventError, from_line, to_line
from rtf.testing.measurement import MeasurementVerdict
from rtf.testing.verdict import FixtureState, Phase, Severity, Verdict

BIGGEST = (1 << 63) - 1
#: Two lone halves of a surrogate pair side by side read back as the character they make up; keep them apart.
TEXT = st.text(st.characters()).filter(
    lambda text: text == text.encode("utf-16", "surrogatepass").decode("utf-16", "surrogatepass")
)
NUMBERS = st.floats()
OF_TYPE = {
    "str": TEXT,
    "Count": st.integers(-BIGGEST, BIGGEST),
    "float": NUMBERS,
    "Moment": st.floats(0, 1e11),
    "bool": st.booleans(),
    "str | None": st.none() | TEXT,
    "Count | None": st.none() | st.integers(-BIGGEST, BIGGEST),
    "float | None": st.none() | NUMBERS,
    "float | str | None": st.none() | NUMBERS | TEXT.filter(lambda text: text not in ("NaN", "Infinity", "-Infinity")),
    "tuple[str, ...]": st.lists(TEXT, max_size=3).map(tuple),
    "tuple[dict[str, str], ...]": st.lists(st.dictionaries(TEXT, TEXT, max_size=3), max_size=3).map(tuple),
    "tuple[tuple[float, ...], ...]": st.lists(st.lists(NUMBERS, max_size=3).map(tuple), max_size=3).map(tuple),
    "dict[str, str]": st.dictionaries(TEXT, TEXT, max_size=3),
    "dict[str, Count]": st.dictionaries(TEXT, st.integers(-BIGGEST, BIGGEST), max_size=3),
    "Severity": st.sampled_from(Severity),
    "Verdict": st.sampled_from(Verdict),
    "FixtureState": st.sampled_from(FixtureState),
    "MeasurementVerdict": st.sampled_from(MeasurementVerdict),
    "Phase": st.sampled_from(Phase),
    "Phase | None": st.none() | st.sampled_from(Phase),
}


def events_of(cls: type[Event]) -> st.SearchStrategy[Event]:
    """Generate events of a class, with any members."""
    return st.builds(cls, **{name: OF_TYPE[annotation] for name, annotation in members_of(cls).items()})


def members_of(cls: type[Event]) -> dict[str, str]:
    """Return the members of a class with their types as in the source."""
    annotations = {**Event.__annotations__, **cls.__annotations__}
    return {name: annotations[name] for name in cls.__struct_fields__}


def same(one: object, other: object) -> bool:
    """Compare two values; NaN equals NaN."""
    if isinstance(one, float) and isinstance(other, float) and math.isnan(one):
        return math.isnan(other)
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return one == other


def test_every_class_of_event_is_known_by_its_kind():
    """The table of kinds has every class of events."""
    assert set(events.KINDS.values()) == set(Event.__subclasses__())


@pytest.mark.parametrize("kind", sorted(events.KINDS))
@given(data=st.data())
@settings(max_examples=25, deadline=None)
def test_event_that_is_written_is_read_back(kind: str, data: st.DataObject):
    """An event is one line of strict JSON, and the same after reading."""
    event = data.draw(events_of(events.KINDS[kind]))
    line = to_line(event)
    assert line.endswith(b"\n")
    assert line.count(b"\n") == 1

    def refuse(word: str) -> float:
        raise AssertionError(f"{word} is no JSON")

    json.loads(line, parse_constant=refuse)
    again = from_line(line)
    assert type(again) is type(event)
    for name in event.__struct_fields__:
        assert same(getattr(event, name), getattr(again, name)), name


@given(
    st.recursive(
        st.none() | st.booleans() | NUMBERS | TEXT, lambda inner: st.lists(inner) | st.dictionaries(TEXT, inner)
    )
)
@settings(max_examples=100, deadline=None)
def test_record_of_anything_is_an_event_or_an_event_error(record: object):
    """JSON that is no event raises EventError."""
    with pytest.raises(EventError):
        from_line(json.dumps(record))


@pytest.mark.parametrize("kind", sorted(events.KINDS))
@given(data=st.data())
@settings(max_examples=15, deadline=None)
def test_member_of_another_type_is_refused(kind: str, data: st.DataObject):
    """A member of a wrong type raises EventError."""
    event = data.draw(events_of(events.KINDS[kind]))
    record = json.loads(to_line(event))
    name = data.draw(st.sampled_from(event.__struct_fields__))
    record[name] = data.draw(st.sampled_from([[[1]], {"a": [1]}, [None], True, 10**400, {"a": None}, [{"a": 1}]]))
    allowed = (
        {"bool"} if record[name] is True else {"tuple[tuple[float, ...], ...]"} if record[name] == [[1]] else set()
    )
    if members_of(type(event))[name] in allowed:
        return
    with pytest.raises(EventError):
        from_line(json.dumps(record))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("", "not JSON"),
        ("{", "not JSON"),
        ("[" * 100_000, "not JSON"),
        ('{"a":' * 100_000, "not JSON"),
        ("9" * 10_000, "not JSON"),
        (b"\xff\xfe", "not JSON"),
        ("[]", "an event is a JSON object, not list"),
        ("{}", "unknown event"),
        ('{"event":["message"]}', "unknown event"),
        ('{"event":"message"}', "message: Object missing required field `severity`"),
        ('{"event":"message","severity":"loud","title":"x"}', "Invalid enum value 'loud' - at `$.severity`"),
        ('{"event":"message","severity":"info","title":7}', "Expected `str`, got `int` - at `$.title`"),
        ('{"event":"interrupted","source":"x","stage":true}', "Expected `int`, got `bool` - at `$.stage`"),
        ('{"event":"interrupted","source":"x","stage":1,"time":"now"}', "Expected `float`, got `str` - at `$.time`"),
        ('{"event":"interrupted","source":"x","stage":1,"time":NaN}', "not JSON: NaN is no number"),
        ('{"event":"interrupted","source":"x","stage":1,"time":true}', "Expected `float`, got `bool` - at `$.time`"),
        ('{"event":"interrupted","source":"x","stage":1,"time":"Infinity"}', "time"),
        ('{"event":"interrupted","source":"x","stage":1,"time":1e19}', "time"),
        ('{"event":"interrupted","source":"x","stage":1.0}', "Expected `int`, got `float` - at `$.stage`"),
        ('{"event":"interrupted","source":"x","stage":99999999999999999999}', "Expected `int` <= 9223372036854775807"),
        (
            '{"event":"series_recorded","test":"t","name":"n","path":"p","rows":1,"columns":[{"name":3}]}',
            "Expected `str`, got `int` - at `$.columns[0][...]`",
        ),
        (
            '{"event":"run_ended","verdict":"passed","exit_code":0,"duration":1,"counts":{"passed":"1"}}',
            "Expected `int`, got `str` - at `$.counts[...]`",
        ),
        (
            '{"event":"run_started","run":"r","version":"1","environment":{"a":1}}',
            "Expected `str`, got `int` - at `$.environment[...]`",
        ),
    ],
)
def test_line_that_is_no_event_is_refused_with_a_reason(line: str | bytes, words: str):
    """The error about any other line has a reason, and is short."""
    with pytest.raises(EventError) as caught:
        from_line(line)
    assert words in str(caught.value)
    assert len(str(caught.value)) < 300


def test_members_that_are_not_known_are_dropped():
    """Unknown members are ignored, so that journals of newer versions can be read."""
    event = from_line('{"event":"interrupted","source":"x","stage":1,"colour":"red","time":5}')
    assert event == events.Interrupted(source="x", stage=1, time=5)


def test_kind_that_is_not_known_is_an_error_of_its_own():
    """An unknown kind raises UnknownEventError, so that readers can skip it."""
    with pytest.raises(UnknownEventError):
        from_line('{"event":"teleported"}')
    with pytest.raises(EventError) as caught:
        from_line('{"event":"message","severity":"unknown event","title":"x"}')
    assert not isinstance(caught.value, UnknownEventError)


def test_members_at_their_default_are_left_out():
    """Members with their default are not written."""
    line = to_line(Message(severity=Severity.INFO, title="x", time=1.0))
    assert json.loads(line) == {"event": "message", "time": 1.0, "severity": "info", "title": "x"}


def test_numbers_that_json_lacks_are_words():
    """NaN and infinities are written as strings, and read as numbers."""
    line = to_line(Measured(test="t", name="n", value=math.nan, low=-math.inf, high=math.inf, time=1.0))
    assert json.loads(line) == {
        "event": "measured",
        "time": 1.0,
        "test": "t",
        "name": "n",
        "value": "NaN",
        "low": "-Infinity",
        "high": "Infinity",
    }
    again = from_line(line)
    assert isinstance(again, Measured)
    assert math.isnan(again.value)
    assert (again.low, again.high) == (-math.inf, math.inf)


def test_text_and_numbers_of_classes_of_their_own_are_written():
    """Numbers and texts of numpy are written as plain ones."""
    event = Measured(test=np.str_("t"), name="n", value=np.float64(1.5), low=np.float64("nan"), time=1.0)
    assert json.loads(to_line(event)) == {
        "event": "measured",
        "time": 1.0,
        "test": "t",
        "name": "n",
        "value": 1.5,
        "low": "NaN",
    }


@pytest.mark.parametrize("kind", ["fixture_changed", "fixture_incident"])
def test_generation_under_its_former_name_is_read(kind: str):
    """Journals with the former name of ``generation`` can be read."""
    members = {"fixture": "rig", "suite": "s", "state": "ready", "phase": "run", "cause": "exit"}
    event = from_line(json.dumps({"event": kind, "incarnation": 2, **members}))
    assert isinstance(event, events.FixtureChanged | events.FixtureIncident)
    assert event.generation == 2


@pytest.mark.fuzz
def test_mangled_lines():
    """A damaged line is an event, or raises EventError."""
    rng = random.Random(1)
    lines = [
        to_line(
            Message(severity=Severity.FAILURE, title="checks", detail="x" * 20, test="s/t", value=1.5, low=-math.inf)
        ),
        to_line(
            Measured(test="s/t", name="n", value=1.0, unit="deg", low=0, high=2, verdict=MeasurementVerdict.PASSED)
        ),
        to_line(TestEnded(test="s/t", verdict=Verdict.PASSED, outcome=Verdict.PASSED, duration=1.25, exit_status=0)),
        to_line(events.TestStarted(test="s/t", pid=7, fixtures={"rig": 1})),
        to_line(events.RunStarted(run="r", version="1", command=("--suite", "x"), environment={"host": "h"})),
        to_line(events.SeriesRecorded(test="t", name="n", path="p", columns=({"name": "t", "unit": "s"},), rows=3)),
    ]
    for _ in range(25_000):
        line = bytearray(rng.choice(lines))
        for _ in range(rng.randrange(1, 4)):
            place = rng.randrange(len(line))
            what = rng.randrange(4)
            if what == 0:
                line[place] = rng.randrange(256)
            elif what == 1:
                del line[place : place + rng.randrange(1, 9)]
            elif what == 2:
                line[place:place] = rng.choice(
                    [b"[", b"{", b'"', b"9" * 30, b"null", b"\\ud800", b"NaN", b"1e999", b"true"]
                )
            else:
                line[place:] = rng.choice(lines)[rng.randrange(40) :]
            if not line:
                break
        try:
            event = from_line(bytes(line))
        except EventError:
            continue
        assert from_line(to_line(event)).kind == event.kind
