"""Requests to a control board: each request of the protocol has its exact reply, and any other one has a reply, too."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import closing
from itertools import count

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtf import clock
from rtf.bottle import Bottle, Vocab
from rtf.bottle.binary import encode
from rtf.middleware.ports.network import Network
from rtf.middleware.ports.rpc import RpcClient
from rtf.middleware.types.codecs import RAW
from rtf.robot.boards.server import ControlBoardServer
from rtf.robot.yarp3.server import ControlBoardRequests
from rtf.robot.yarp3.table import COMMANDS, TOPICS

from ..control_board_bench import QUESTIONS, Axes, CalibratedBoard
from ..sensor_bench import ManualClock

#: Requests in order, with their replies; ``@`` is a stamp, whose count goes on, and ``&`` nine zeros. A reply of one
#: word is written without brackets.
CONVERSATION = """
[get] [axes] > [is] [axes] 2 @
[get] [prot] > [prot] 1 9 0 [ok]
[get] [name] 0 > [is] [name] joint0 @
[get] [type] 0 > [is] [type] 1987212385 @
[get] [llim] 0 > [is] [llim] 0.0 100.0 @
[set] [llim] 0 -90.0 90.0 > ok
[set] [llim] 1 -90 90 > ok
[get] [llim] 0 > [is] [llim] -90.0 90.0 @
[set] [llim] 0 90.0 -90.0 > fail
[get] [vlim] 0 > [is] [vlim] 0.0 50.0 @
[set] [vlim] 0 0.0 40.0 > ok
[get] [vlim] 0 > [is] [vlim] 0.0 40.0 @

[get] [encs] > [is] [encs] (0.0 0.0) @
[set] [pos] 0 5.0 > ok
[get] [pos] 0 > [is] [pos] 5.0 @
[get] [don] 0 > [is] [don] 0 @
[get] [don] 1 > [is] [don] 1 @
[get] [dons] > [is] [dons] 0 @
[get] [dong] 2 (1 0) > [is] [dong] 0 @
[set] [poss] (7.0 -8.0) > ok
[get] [poss] > [is] [poss] (7.0 -8.0) @
[set] [posg] 2 (1 0) (3.0 4) > ok
[get] [posg] 2 (0 1) > [is] [posg] (4.0 3.0) @
[set] [sto] 0 > ok
[set] [stog] 1 (1) > ok
[set] [stos] > ok
[get] [dons] > [is] [dons] 1 @
[set] [rel] 0 1.5 > ok
[get] [pos] 0 > [is] [pos] 1.5 @
[set] [rels] (1.0 2.0) > ok
[set] [relg] 1 (1) (0.5) > ok
[get] [poss] > [is] [poss] (1.0 0.5) @
[set] [stos] > ok
[set] [vel] 0 11.0 > ok
[get] [vel] 0 > [is] [vel] 11.0 @
[set] [vels] (12.0 13.0) > ok
[get] [vels] > [is] [vels] (12.0 13.0) @
[set] [velg] 1 (1) (14.0) > ok
[get] [velg] 1 (1) > [is] [velg] (14.0) @
[set] [acc] 0 100.0 > ok
[get] [acc] 0 > [is] [acc] 100.0 @
[set] [accs] (101.0 102.0) > ok
[get] [accs] > [is] [accs] (101.0 102.0) @
[set] [accg] 2 (0 1) (103.0 104.0) > ok
[get] [accg] 2 (1 0) > [is] [accg] (104.0 103.0) @

[get] [icmd] [cmod] 0 > [is] 0 [pos] @
[set] [icmd] [cmod] 0 [vel] > ok
[get] [icmd] [cmds] > [is] [cmds] ([vel] [pos]) @
[set] [icmd] [cmog] 2 (1 0) ([posd] [pos]) > ok
[get] [icmd] [cmog] 2 (0 1) > [is] [cmog] ([pos] [posd]) @
[set] [icmd] [cmds] ([vel] [vel]) > ok
[set] [icmd] [vel] 1 [posd] > ok
[get] [icmd] [cmds] > [is] [cmds] ([vel] [posd]) @
[set] [icmd] [cmds] ([vel]) > fail
[set] [icmd] [cmod] 0 [hwfa] > fail
[set] [icmd] [cmod] 0 [nope] > fail
[set] [icmd] [cmod] 2 [pos] > fail
[set] [vmos] (0.0 1.0) > ok
[get] [vmo] 1 > [is] [vmo] 0.0 @
[get] [vmos] > [is] [vmos] (0.0 0.0) @
[get] [vmog] 1 (0) > [is] [vmog] (0.0) @
[set] [vmo] 0 1.0 > fail
[get] [dpo] 1 > [is] [dpo] 0.0 @
[get] [dpos] > [is] [dpos] (0.0 0.0) @
[get] [dpog] 2 (1 0) > [is] [dpog] (0.0 0.0) @
[set] [dpo] 1 1.0 > fail
[set] [icmd] [cmds] ([pos] [pos]) > ok

[get] [intm] [mode] 0 > [stif] @
[set] [intm] [mode] 0 [comp] > ok
[get] [intm] [mods] > ([comp] [stif]) @
[set] [intm] [modg] 2 (1 0) ([comp] [stif]) > ok
[get] [intm] [modg] 2 (0 1) > ([stif] [comp]) @
[set] [intm] [mods] ([stif] [stif]) > ok
[set] [intm] [mode] 0 [unkn] > fail
[set] [intm] [mode] 0 [pos] > fail

[set] [enc] 0 12.5 > ok
[get] [enc] 0 > [is] [enc] 12.5 @
[set] [encs] (1.5 2.5) > ok
[get] [encs] > [is] [encs] (1.5 2.5) @
[get] [esp] 0 > [is] [esp] 0.0 @
[get] [esps] > [is] [esps] (0.0 0.0) @
[get] [eac] 0 > [is] [eac] 0.0 @
[get] [eacs] > [is] [eacs] (0.0 0.0) @
[get] [mnc] 0 > [is] [mnc] 150.0 @
[set] [ere] 0 > ok
[get] [encs] > [is] [encs] (0.0 2.5) @
[set] [eres] > ok
[get] [mncs] > [is] [mncs] (0.0 0.0) @
[set] [mnc] 1 7.0 > ok
[set] [mncs] (8.0 9.0) > ok
[get] [mncs] > [is] [mncs] (8.0 9.0) @
[set] [mre] 0 > ok
[get] [mncs] > [is] [mncs] (0.0 9.0) @
[set] [mres] > ok
[get] [msp] 0 > [is] [msp] 0.0 @
[get] [msps] > [is] [msps] (0.0 0.0) @
[get] [mac] 0 > [is] [mac] 0.0 @
[get] [macs] > [is] [macs] (0.0 0.0) @
[get] [mcpr] 0 > [is] [mcpr] 4096.0 @
[set] [mcpr] 0 1000 > ok
[get] [mcpr] 0 > [is] [mcpr] 1000.0 @
[get] [mnum] > [is] [mnum] 2 @
[get] [mtnm] > [is] [mtnm] 2 @
[get] [tmp] 0 > [is] [tmp] 25.0 @
[get] [tmps] > [is] [tmps] (25.0 25.0) @
[set] [tmpl] 1 60.0 > ok
[get] [tmpl] 1 > [is] [tmpl] 60.0 @
[set] [gbxr] 1 -50.0 > ok
[get] [gbxr] 1 > [is] [gbxr] -50.0 @

[set] [adi] 0 > ok
[get] [icmd] [cmod] 0 > [is] 0 [idl] @
[set] [aen] 0 > ok
[get] [icmd] [cmod] 0 > [is] 0 [pos] @
[get] [asta] > [is] [asta] (0 0) @
[get] [asts] 0 > [is] [asts] 0 @
[get] [acu] 0 > [is] [acu] 0.0 @
[get] [acus] > [is] [acus] (0.0 0.0) @
[set] [maxc] 0 5.0 > ok
[get] [maxc] 0 > [is] [maxc] 5.0 @
[set] [acno] 0 2.0 > ok
[get] [acno] 0 > [is] [acno] 2.0 @
[set] [acpk] 0 7.0 > ok
[get] [acpk] 0 > [is] [acpk] 7.0 @
[get] [pwm] 0 > [is] [pwm] 0.0 @
[set] [pwml] 0 33.0 > ok
[get] [pwml] 0 > [is] [pwml] 33.0 @
[get] [avsu] 0 > [is] [avsu] 24.0 @
[get] [ijfl] [jhfl] 0 > [is] 0 "" [ok]
[set] [maxc] 0 0.0 > ok
[get] [ijfl] [jhfl] 0 > [is] 1 "joint0: over-current: more than 0 A" [ok]
[get] [asta] > [is] [asta] (1 0) @
[set] [icmd] [cmod] 0 [pos] > ok
[get] [icmd] [cmod] 0 > [is] 0 [hwfa] @
[set] [maxc] 0 5.0 > ok
[set] [icmd] [cmod] 0 [fidl] > ok
[get] [icmd] [cmod] 0 > [is] 0 [idl] @
[set] [icmd] [cmod] 0 [pos] > ok

[get] [torq] [trq] 0 > [is] [torq] 0.0 @
[get] [torq] [trqs] > [is] [torq] (0.0 0.0) @
[get] [torq] [rng] 0 > [is] [torq] -100.0 100.0 @
[get] [torq] [rngs] > [is] [torq] (-100.0 -100.0) (100.0 100.0) @
[set] [torq] [trqd] > ok
[get] [icmd] [cmds] > [is] [cmds] ([torq] [torq]) @
[set] [torq] [ref] 0 1.5 > ok
[get] [torq] [ref] 0 > [is] [torq] 1.5 @
[set] [torq] [refs] (2.5 3.5) > ok
[get] [torq] [refs] > [is] [torq] (2.5 3.5) @
[set] [torq] [mtps] 0 (1.0 2.0 3.0 4.0 5.0 6.0 7.0 8.0 9.0) > ok
[get] [torq] [mtps] 0 > [is] [torq] (1.0 2.0 3.0 4.0 5.0 6.0 7.0 8.0 9.0) @
[set] [torq] [mtps] 0 (1.0 2.0 3.0 4.0) > fail
[get] [iimp] [ipr] 0 > [is] [iimp] (0.0 0.0) @
[set] [iimp] [ipr] 0 (0.5 0.25) > ok
[get] [iimp] [ipr] 0 > [is] [iimp] (0.5 0.25) @
[set] [iimp] [ipr] 0 (0.5) > fail
[set] [iimp] [ipr] 0 (-1.0 0.0) > fail
[set] [iimp] [iof] 0 (1.5) > ok
[get] [iimp] [iof] 0 > [is] [iimp] (1.5) @
[get] [iimp] [llim] 0 > [is] [iimp] (0.0 1000.0 0.0 100.0) @
[get] [icur] [ref] 0 > [is] [icur] 0.0 [ok]
[get] [icur] [refs] > [is] [icur] (0.0 0.0) [ok]
[get] [icur] [rng] 0 > [is] [icur] -7.0 7.0 [ok]
[get] [icur] [rngs] > [is] [icur] (-7.0 -15.0) (7.0 15.0) [ok]
[set] [icur] [ref] 0 1.0 > fail
[get] [ipwm] [ref] 0 > [is] [ipwm] 0.0 [ok]
[get] [ipwm] [refs] > [is] [ipwm] (0.0 0.0) [ok]
[get] [ipwm] [pwm] 0 > [is] [ipwm] 0.0 [ok]
[get] [ipwm] [pwms] > [is] [ipwm] (0.0 0.0) [ok]
[set] [ipwm] [ref] 0 1.0 > fail

[get] [pid] [pid] [pos] 0 > [is] [pid] (0.0 0.0 0.0 0.0 0.0 0.0 1.0 0.0 0.0 0.0) [ok]
[set] [pid] [pid] [trq] 1 (1.0 2.0 3.0 4.0 5.0 6.0 7.0 8.0 9.0 10.0) > ok
[get] [pid] [pid] [trq] 1 > [is] [pid] (1.0 2.0 3.0 4.0 5.0 6.0 7.0 8.0 9.0 10.0) [ok]
[set] [pid] [pid] [trq] 1 (1.0 2.0) > fail
[set] [pid] [pids] [cur] ((1 0 0 0 0 0 0 0 0 0) (2 0 0 0 0 0 0 0 0 1.5)) > ok
[get] [pid] [pids] [cur] > [is] [pid] ((1.0 &) (2.0 0.0 0.0 0.0 0.0 0.0 0.0 0.0 0.0 1.5)) [ok]
[set] [pid] [pids] [cur] ((1.0 0.0 0.0 0.0 0.0 0.0 0.0 0.0 0.0 0.0)) > fail
[set] [pid] [ref] [vel] 0 1.5 > fail
[set] [icmd] [cmds] ([posd] [posd]) > ok
[set] [pid] [ref] [pos] 0 1.5 > ok
[get] [pid] [ref] [pos] 0 > [is] [pid] 1.5 [ok]
[set] [pid] [refs] [pos] (2.5 3.5) > ok
[get] [pid] [refs] [pos] > [is] [pid] (2.5 3.5) [ok]
[get] [pid] [err] [pos] 0 > [is] [pid] 0.0 [ok]
[get] [pid] [errs] [pos] > [is] [pid] (0.0 0.0) [ok]
[get] [pid] [out] [pos] 0 > [is] [pid] 0.0 [ok]
[get] [pid] [outs] [pos] > [is] [pid] (0.0 0.0) [ok]
[set] [pid] [lim] [pos] 0 4.5 > ok
[get] [pid] [lim] [pos] 0 > [is] [pid] 4.5 [ok]
[set] [pid] [lims] [pos] (5.5 6.5) > ok
[get] [pid] [lims] [pos] > [is] [pid] (5.5 6.5) [ok]
[set] [pid] [off] [trq] 1 0.5 > ok
[get] [pid] [pid] [trq] 1 > [is] [pid] (1.0 2.0 3.0 4.0 5.0 0.5 7.0 8.0 9.0 10.0) [ok]
[set] [pid] [res] [pos] 0 > ok
[get] [pid] [ena] [pos] 0 > [is] [pid] 1 [ok]
[set] [pid] [dis] [pos] 0 > ok
[get] [pid] [ena] [pos] 0 > [is] [pid] 0 [ok]
[set] [pid] [ena] [pos] 0 > ok
[get] [pid] [ena] [pos] 0 > [is] [pid] 1 [ok]
[set] [pid] [dis] [pos] 0 > ok
[get] [pid] [ena] [pos] 0 > [is] [pid] 0 [ok]
[get] [pid] [pid] [nope] 0 > fail
[get] [pid] [pid] 0 > fail

[get] [ivar] [lvar] > [is] [ivar] (one two) [ok]
[get] [ivar] [mvar] one > [is] [ivar] (1.5) [ok]
[get] [ivar] [mvar] two > [is] [ivar] (a (b c)) [ok]
[set] [ivar] [mvar] one 2.5 (x y) > ok
[get] [ivar] [mvar] one > [is] [ivar] (2.5 (x y)) [ok]
[get] [ivar] [mvar] three > fail
[set] [ivar] [mvar] three 1 > fail

[get] [reca] [isca] > [is] [reca] 1 [ok]
[set] [reca] [cal] 1 > ok
[set] [reca] [cals] > ok
[set] [reca] [hom] 1 > ok
[set] [reca] [homs] > ok
[set] [reca] [par] 0 > ok
[set] [reca] [pars] > ok
[set] [reca] [quca] > ok
[set] [reca] [qupa] > ok
[set] [reca] [cal] 7 > fail
[calj] 0 3 1.0 2.0 3.0 > ok
[cljp] 0 3 1.0 2.0 3.0 4.0 > ok
[cald] 0 > ok
[cald] 7 > fail
[cal] 0 > ok
[park] 1 > ok
[abca] 0 > fail

[get] [foo] > fail
foo bar > fail
[cal] > nak
[park] > nak
[foo] > nak
[help] > nak
get axes > [is] axes 2 @
set pos 0 1 > ok
[get] [pos] > fail
[get] [pos] 2 > fail
[get] [pos] -1 > fail
[get] [pos] x > fail
[get] [posg] 3 (0 1) > fail
[get] [posg] 2 (0 5) > fail
[set] [pos] 0 > fail
[set] [pos] 0 word > fail
[set] [pos] 0 [pos] > fail
[set] [pos] 0 nan > fail
[set] [poss] (1.0) > fail
[set] [poss] (1.0 2.0 3.0) > fail
[set] [poss] 1.0 2.0 > fail
[set] [posg] 2 (0 1) (1.0) > fail
[set] [axes] 3 > fail
[get] [icmd] > fail
[get] [axes] > [is] [axes] 2 @
"""
_ZEROS = " ".join(["0.0"] * 9)
#: Families whose answers have no stamps, and the one topic.
_UNSTAMPED = {"pid", "icur", "ipwm", "ivar", "reca", "ijfl", "prot"}


@pytest.fixture
def board(stepped: ManualClock) -> CalibratedBoard:
    """A board whose time stands still."""
    return CalibratedBoard()


@pytest.fixture
def server(board: CalibratedBoard, network: Network) -> Iterator[ControlBoardServer]:
    """The server of the board."""
    with closing(ControlBoardServer(board, "/robot/arm", network=network)) as opened:
        yield opened


@pytest.fixture
def client(server: ControlBoardServer, network: Network) -> Iterator[RpcClient]:
    """A client of the server's RPC port."""
    with RpcClient("/client", "/robot/arm/rpc:i", network=network) as opened:
        yield opened


def lines() -> Iterator[tuple[str, str]]:
    """The requests and answers of the recorded conversation."""
    for line in CONVERSATION.strip().splitlines():
        if line:
            question, _, answer = line.partition(" > ")
            yield question, answer


def test_every_question_has_its_answer(client: RpcClient, board: CalibratedBoard, stepped: ManualClock):
    """Answers have the expected words and types, and stamps with consecutive counts and the robot's time."""
    numbers = count()
    for question, expected in lines():
        asked = Bottle.parse(question)
        answer = client.call(asked, timeout=5)
        verb, *words = [str(value) for value in asked[:2]]
        number = next(numbers) if verb == "get" and words and words[0] not in _UNSTAMPED else -1
        text = f"[{expected}]" if expected in ("ok", "fail", "nak") else expected
        wanted = Bottle.parse(text.replace("&", _ZEROS).replace("@", f"[tsta] {number} {stepped.now()!r} [ok]"))
        assert answer == wanted, question
    stepped.sleep(0.125)
    last = client.call(Bottle.parse("[get] [axes]"), timeout=5)
    assert str(last) == f"[is] [axes] 2 [tsta] {next(numbers)} {stepped.now()} [ok]"
    assert board.asked == [
        "calibrate 1",
        "calibrate",
        "home 1",
        "home",
        "park 0",
        "park",
        "quit calibrate",
        "quit park",
        "calibrate",
        "park",
    ]


def test_the_conversation_leaves_nothing_out():
    """Every row of the table has a get and a set in the conversation, as far as the protocol has them."""
    answered = {
        " ".join(question.replace("[", "").replace("]", "").split()[:3])
        for question, answer in lines()
        if answer not in ("fail", "nak")
    }
    for words, topic in TOPICS.items():
        for verb, method in (("get", topic.get), ("set", topic.set)):
            if method:
                wanted = " ".join((verb, *words))
                assert any(one == wanted or one.startswith(wanted + " ") for one in answered), wanted
    assert {one.split()[0] for one in answered} >= set(COMMANDS)


def test_bytes_of_an_answer(client: RpcClient):
    """The list in an answer is of mixed types, with whole numbers of 32 bits and floats of 64."""
    client.call(Bottle.parse("[set] [icmd] [cmod] 0 [vel]"))
    answer = client.call(Bottle.parse("[get] [icmd] [cmod] 0"), answer=RAW)
    assert answer is not None
    assert answer.hex(" ").startswith(
        "00 01 00 00 07 00 00 00 09 00 00 00 69 73 00 00 01 00 00 00 00 00 00 00 09 00 00 00 76 65 6c 00"
    )


def test_a_device_without_an_interface_fails(network: Network, stepped: ManualClock):
    """Requests of a missing interface are answered [fail]; others work."""
    with (
        closing(ControlBoardServer(Axes(), "/robot/arm", network=network)),
        RpcClient("/client", "/robot/arm/rpc:i", network=network) as asking,
    ):
        assert asking.call(Bottle.parse("[get] [encs]")) == Bottle([Vocab("fail")])
        assert str(asking.call(Bottle.parse("[get] [reca] [isca]"))) == "[fail]"
        assert str(asking.call(Bottle.parse("[get] [axes]"))).startswith("[is] [axes] 2 [tsta] 1 ")


def test_an_unexpected_error_of_the_device(network: Network, stepped: ManualClock, said: list[str]):
    """An unexpected error of a device is answered [fail], and reported with the request."""
    with (
        closing(ControlBoardServer(Axes(), "/robot/arm", network=network)),
        RpcClient("/client", "/robot/arm/rpc:i", network=network) as asking,
    ):
        assert str(asking.call(Bottle.parse("[get] [name] 1"))) == "[fail]"
        assert str(asking.call(Bottle.parse("[get] [type] 1"))) == "[fail]"
        assert said == ["/robot/arm: [[get] [name] 1] failed: ZeroDivisionError: joint 1"]


def test_clients_do_not_wait_for_each_other(network: Network, stepped: ManualClock):
    """A request of one client is answered while one of another client is being executed."""
    busy, go_on = threading.Event(), threading.Event()

    class Slow(CalibratedBoard):
        def calibrate_part(self) -> None:
            busy.set()
            assert go_on.wait(10)

    with (
        closing(ControlBoardServer(Slow(), "/robot/arm", network=network)),
        RpcClient("/one", "/robot/arm/rpc:i", network=network) as one,
        RpcClient("/two", "/robot/arm/rpc:i", network=network) as two,
    ):
        waiting = threading.Thread(target=one.call, args=(Bottle.parse("[set] [reca] [cals]"),))
        waiting.start()
        assert busy.wait(10)
        assert str(two.call(Bottle.parse("[get] [axes]"), timeout=5)).startswith("[is] [axes] 2")
        go_on.set()
        waiting.join(10)


@settings(max_examples=75, deadline=None)
@given(question=QUESTIONS)
def test_any_question_is_answered(question: Bottle):
    """Any request has an answer that can be encoded, and no exception escapes."""
    said: list[str] = []
    with clock.use(ManualClock()):
        answer = ControlBoardRequests(CalibratedBoard(), said.append).answer(question)
    assert answer[-1] in (Vocab("ok"), Vocab("fail"), Vocab("nak"))
    encode(answer)
    assert said == []


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(questions=st.lists(QUESTIONS, min_size=1, max_size=5))
def test_any_questions_over_the_network(client: RpcClient, questions: list[Bottle]):
    """The port answers any request, and the next one."""
    for question in questions:
        assert client.call(question, timeout=5) is not None
    assert str(client.call(Bottle.parse("[get] [mnum]"), timeout=5)).startswith("[is] [mnum] 2")
