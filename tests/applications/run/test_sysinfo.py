"""The figures of a machine, on the wire and measured."""

from __future__ import annotations

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from replaying import recordings, segments
from rtf.applications.run.sysinfo import SystemInfo, measure
from rtf.bottle import BottleLimitError, Dialect
from rtf.bottle.binary import TruncatedBottleError

CODEC = SystemInfo.codec
#: Without the words that stand for other values in the text form of YARP, see rtf/bottle/writing.py.
texts = st.text(st.characters(codec="utf-8", exclude_characters="\r\n"), max_size=20).filter(
    lambda text: text not in {"null", "nan", "inf"}
)
numbers = st.integers(-(1 << 31), (1 << 31) - 1)
loads = st.floats(0, 1e6)
infos = st.builds(
    SystemInfo,
    **{
        name: {int: numbers, float: loads, str: texts}[type(getattr(SystemInfo(), name))]
        for name in SystemInfo.__slots__
    },
)


@given(infos, infos)
def test_figures_come_back(info: SystemInfo, next_one: SystemInfo):
    """From their bytes, which end where the next message begins, and from their text."""
    data = b"".join(CODEC.encode(info, Dialect.YARP3))
    behind = b"".join(CODEC.encode(next_one, Dialect.YARP3))
    assert CODEC.decode_from(data + behind, Dialect.YARP3) == (info, len(data))
    assert CODEC.from_text(CODEC.to_text(info)) == info


def test_every_beginning_is_truncated():
    """Each part of the record asks for more than there is, so a reply can arrive in any pieces."""
    data = recorded().removesuffix(b"YA\0\0\0\0RP")
    for size in range(len(data)):
        with pytest.raises(TruncatedBottleError) as raised:
            CODEC.decode_from(data[:size], Dialect.YARP3)
        assert size < raised.value.needed <= len(data)


def test_text_without_an_end():
    """Some mega­bytes of text are not waited for."""
    with pytest.raises(BottleLimitError):
        CODEC.decode_from(bytes(16) + b"x" * (1 << 19), Dialect.YARP3)


def test_figures_of_a_real_node():
    """What yarprun sent, and printed beside it."""
    data = recorded()
    info, size = CODEC.decode_from(data, Dialect.YARP3)
    assert data[size:] == b"YA\0\0\0\0RP"
    assert (info.memory_total, info.memory_free, info.storage_total, info.storage_free) == (24105, 21436, 258019, 78439)
    assert (info.model, info.vendor, info.architecture) == ("AMD EPYC", "AuthenticAMD", "x86_64")
    assert (info.family, info.model_number, info.cores, info.siblings) == (25, 17, 2, 2)
    assert (info.frequency, info.load_1, info.load_5, info.load_15) == (2596.146, 0.23, 0.67, 1.14)
    assert (info.name, info.distribution, info.release, info.codename) == ("Linux", "Debian", "12", "bookworm")
    assert (info.user, info.home, info.user_id, info.cpu_load) == ("root", "/root", 0, 0)
    assert info.environment.startswith('(HOME "/root") (LANG C.UTF-8)')
    assert b"".join(CODEC.encode(info, Dialect.YARP3)) == data[:size]


def recorded() -> bytes:
    """The reply of yarprun."""
    return segments(recordings("3.12.3", "nodes.json")["sysinfo"])[3][1]


def test_measured_figures_reveal_nothing_of_the_user(monkeypatch: pytest.MonkeyPatch):
    """No variable of the environment, no name and no home: a real node sends them all."""
    monkeypatch.setenv("SECRET_TOKEN", "swordfish-4711")
    info = measure()
    assert (info.environment, info.user, info.real_name, info.home, info.user_id) == ("", "", "", "", -1)
    assert b"swordfish" not in b"".join(CODEC.encode(info, Dialect.YARP3))
    assert info.siblings == os.cpu_count()
    assert 0 < info.memory_free < info.memory_total
