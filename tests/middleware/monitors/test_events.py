"""Events have owners and ends, and constraints are expressions of them, with the meaning of Python's own."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.errors import RtfError
from rtf.middleware.errors import ProtocolError
from rtf.middleware.monitors.events import MAX_EVENTS, Constraint, Events

NAMES = ("a", "b", "c")
EXPRESSIONS = st.recursive(
    st.sampled_from([*NAMES, "true", "false"]),
    lambda inner: st.one_of(
        inner.map(lambda one: f"not {one}"),
        inner.map(lambda one: f"({one})"),
        st.tuples(inner, st.sampled_from(["and", "or"]), inner).map(" ".join),
    ),
    max_leaves=8,
)


@given(text=EXPRESSIONS, active=st.sets(st.sampled_from(NAMES)))
def test_an_expression_means_what_it_means_in_python(text: str, active: set[str]):
    """Priorities and brackets included."""
    known = {name: name in active for name in NAMES} | {"true": True, "false": False}
    assert Constraint(text).holds(active) == eval(text, {}, known)


@given(text=st.text(max_size=30) | st.lists(st.sampled_from(["a", "and", "or", "not", "(", ")", "true"])).map(" ".join))
def test_any_text_is_an_expression_or_an_error_of_ours(text: str):
    """Whatever a peer writes."""
    try:
        Constraint(text).holds({"a"})
    except RtfError:
        return


@pytest.mark.parametrize("text", ["a and", "a b", "(a", "a)", "not", "and a", "a & b", "x" * 1001, "("])
def test_what_cannot_be_read_is_reported(text: str):
    """With the text."""
    with pytest.raises(ProtocolError, match="constraint"):
        Constraint(text)


def test_an_empty_constraint_is_true():
    """Nothing is asked for."""
    assert Constraint().holds(set())


def test_an_event_ends_after_its_lifetime_or_with_its_owner():
    """Each owner ends its own only."""
    events = Events()
    events.set("reflex", "one", now=0.0, lifetime=2.0)
    events.set("reach", "one", now=0.0)
    events.set("reach", "other", now=0.0, lifetime=-1.0)
    events.set("and", "one", now=0.0)
    assert events.active(1.9) == {"reflex", "reach"}
    events.set("reflex", "one", now=1.9, lifetime=2.0)
    assert events.active(3.8) == {"reflex", "reach"}
    assert events.active(3.9) == {"reach"}
    events.unset("reach", "one")
    events.unset("never", "one")
    assert events.active(3.9) == {"reach"}
    events.forget("other")
    assert events.active(3.9) == set()


def test_the_number_of_events_is_bounded():
    """A script cannot fill the memory with names."""
    events = Events()
    for number in range(MAX_EVENTS + 5):
        events.set(f"e{number}", "one", now=0.0)
    assert len(events.active(0.0)) == MAX_EVENTS
