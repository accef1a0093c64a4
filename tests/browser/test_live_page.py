"""The live page: it shows a run as it happens, to clients at any time, without missing or doubled lines."""

from __future__ import annotations

import json
import re
import urllib.request
from typing import TYPE_CHECKING, Any

from playwright.sync_api import expect

from rtf.testing import journal
from rtf.testing.events import Measured, Message
from rtf.testing.verdict import Verdict

if TYPE_CHECKING:
    from collections.abc import Callable

    from playwright.sync_api import Page

#: A test that emits given messages, and one after it.
SAYING = '<test name="say" fixtures="">say.py</test><test name="after" fixtures="">flaky.py</test>'


def title(page: Page) -> Any:
    """Return the heading with the state of the run."""
    return page.get_by_role("heading", level=1)


def row(page: Page, test: str) -> Any:
    """Return the row of a test in the list."""
    return page.get_by_role("listbox", name="Tests").get_by_role("option", name=re.compile(rf"^{test} "))


def let(run: Any, *names: str) -> None:
    """Create the files that tests wait for."""
    for name in names:
        (run.folder / name).touch()


def let_it_say(run: Any, first: int, last: int) -> None:
    """Let the test report these lines, and wait until they are in the journal, each with its measurement."""
    let(run, *[f"say{number}" for number in range(first, last + 1)])
    run.wait_for(
        lambda events: any(isinstance(event, Measured) and event.name == f"quantity {last}" for event in events)
    )


def assert_same_as_journal(page: Page, run: Any) -> None:
    """Check that the page shows each reported line and measurement once, and the journal's verdicts."""
    events = [*journal.read(run.run_folder)]
    said = [event.detail for event in events if isinstance(event, Message) and event.detail.startswith("line ")]
    measured = [event for event in events if isinstance(event, Measured)]
    page.evaluate("() => { location.hash = '#~log'; }")
    page.get_by_role("searchbox", name="Filter log").fill("info line")
    log = page.get_by_role("listbox", name="Log")
    expect(log.get_by_role("option").last).to_have_attribute("aria-setsize", str(len(said)))
    shown = [text for text in log.get_by_role("option").all_inner_texts() if "line" in text]
    assert len(shown) == len(set(shown))
    page.evaluate("() => { location.hash = '#~measurements'; }")
    expect(page.get_by_role("row").filter(has_text="quantity")).to_have_count(len(measured))
    page.evaluate("() => { location.hash = '#'; }")


def test_a_run_is_seen_as_it_happens(live_run: Callable[..., Any], visit: Any, shoot: Callable[..., None]):
    """A crash, a hang, and a lost fixture with its next generation are shown while the run goes on."""
    suite = """
      <timeout setup="10" teardown="5">60</timeout>
      <fixture name="server" backoff="0.05" check-period="0.05">
        <parameter name="command">python3 server.py</parameter>
        <parameter name="directory">.</parameter>
        <parameter name="ready_log">ready to serve</parameter>
        process
      </fixture>
      <test name="measure" fixtures="">measure.py</test>
      <test name="crash" fixtures="">crash.py</test>
      <test name="hang" fixtures="" timeout="0.5">hang.py</test>
      <test name="grow" fixtures="">grow.py</test>
      <test name="collapse" fixtures="server">collapse.py</test>
      <test name="gate" fixtures="server">gate.py</test>
    """
    run = live_run(suite)
    page = visit(run.address)
    expect(row(page, "grow")).to_contain_text("running")
    expect(row(page, "measure")).to_contain_text("failed")
    expect(row(page, "crash")).to_contain_text("error")
    expect(row(page, "hang")).to_contain_text("error")
    expect(row(page, "gate")).to_contain_text("planned")
    row(page, "grow").click()
    expect(page.locator("canvas").first).to_be_visible()
    shoot(page, "live-growing-series")
    let(run, "grown")
    expect(row(page, "gate")).to_contain_text("running")
    expect(row(page, "collapse")).to_contain_text("passed")
    page.get_by_role("link", name="Fixtures").click()
    fixtures = page.get_by_role("region", name="Fixtures", exact=True)
    expect(fixtures.get_by_text("cannot bear it")).to_be_visible()
    expect(title(page)).to_contain_text("running 6 of 6")
    shoot(page, "live-fixtures")
    let(run, "go")
    expect(title(page)).to_have_text("failed")
    shoot(page, "live-ended")
    assert run.wait().exit_code == 1


def test_who_comes_late_sees_all(live_run: Callable[..., Any], visit: Any):
    """A late page shows earlier and later events, also after reloading."""
    run = live_run(SAYING)
    let_it_say(run, 1, 20)
    page = visit(run.address)
    expect(row(page, "say")).to_contain_text("running")
    assert_same_as_journal(page, run)
    let_it_say(run, 21, 25)
    assert_same_as_journal(page, run)
    page.reload()
    expect(row(page, "say")).to_contain_text("running")
    assert_same_as_journal(page, run)
    let(run, "say26", "enough")
    expect(title(page)).to_have_text("failed")
    run.wait()
    assert_same_as_journal(page, run)


def test_a_cut_connection_is_taken_up_again(
    live_run: Callable[..., Any], visit: Any, wire: Any, unreachable: re.Pattern[str], shoot: Callable[..., None]
):
    """After a lost connection, which is shown, the page gets all missed events once."""
    run = live_run(SAYING)
    let_it_say(run, 1, 5)
    cable, address = wire(run.address)
    page = visit(address, expected=unreachable)
    expect(row(page, "say")).to_contain_text("running")
    for cut in (1, 2):
        cable.cut()
        expect(page.get_by_role("alert").filter(has_text="connection to the run is lost")).to_be_visible()
        shoot(page, "live-cut")
        let_it_say(run, 5 * cut + 1, 5 * cut + 5)
        cable.restore()
        expect(page.get_by_text("live", exact=True)).to_be_visible()
        assert_same_as_journal(page, run)
    let(run, "enough")
    expect(title(page)).to_have_text("failed")
    run.wait()
    assert_same_as_journal(page, run)


def test_two_tabs_see_the_same(live_run: Callable[..., Any], visit: Any):
    """Two tabs, one of them hidden, are both complete."""
    run = live_run(SAYING)
    one = visit(run.address)
    other = visit.another_tab(one, run.origin)
    let_it_say(run, 1, 12)
    for page in (one, other):
        page.bring_to_front()
        expect(row(page, "say")).to_contain_text("running")
        assert_same_as_journal(page, run)
    let(run, "enough")
    for page in (one, other):
        page.bring_to_front()
        expect(title(page)).to_have_text("failed")
        assert_same_as_journal(page, run)
    run.wait()


def test_a_question_is_answered_by_mouse(live_run: Callable[..., Any], visit: Any, shoot: Callable[..., None]):
    """Every form of question, with its picture, is answered by mouse; the journal has answers and sources."""
    run = live_run('<test name="ask" fixtures="">ask.py</test>')
    page = visit(run.address)
    question = page.get_by_role("region", name="Question")
    expect(question.get_by_role("img")).to_have_js_property("naturalWidth", 48)
    shoot(page, "live-question")
    question.get_by_role("button", name="No").click()
    expect(question).to_contain_text("Which colour")
    question.get_by_role("button", name="blue").click()
    expect(question).to_contain_text("Who is asking")
    question.get_by_role("textbox").fill("Ada <b>")
    question.get_by_role("button", name="Send").click()
    expect(question).to_contain_text("How heavy")
    question.get_by_role("textbox").fill("much")
    question.get_by_role("button", name="Send").click()
    expect(question).to_contain_text("A number, please")
    question.get_by_role("textbox").fill("3.25")
    question.get_by_role("button", name="Send").click()
    expect(title(page)).not_to_contain_text("running")
    assert answers(run.wait()) == [("no", "web"), ("blue", "web"), ("Ada <b>", "web"), ("3.25", "web")]


def test_a_question_is_answered_by_keyboard(live_run: Callable[..., Any], visit: Any):
    """The first answer has the focus, choices have numbers, and Enter sends a text."""
    run = live_run('<test name="ask" fixtures="">ask.py</test>')
    page = visit(run.address)
    question = page.get_by_role("region", name="Question")
    expect(question.get_by_role("button", name="Yes")).to_be_focused()
    page.keyboard.press("Enter")
    expect(question).to_contain_text("Which colour")
    page.keyboard.press("3")
    expect(question.get_by_role("textbox")).to_be_focused()
    page.keyboard.press("ControlOrMeta+a")
    page.keyboard.type("Bo")
    page.keyboard.press("Enter")
    expect(question).to_contain_text("How heavy")
    expect(question.get_by_role("textbox")).to_be_focused()
    page.keyboard.press("ControlOrMeta+a")
    page.keyboard.type("1,5")
    page.keyboard.press("Enter")
    expect(title(page)).not_to_contain_text("running")
    assert answers(run.wait()) == [("yes", "web"), ("blue", "web"), ("Bo", "web"), ("1.5", "web")]


def answers(outcome: Any) -> list[tuple[str, str]]:
    """Return the answers with their sources."""
    return [(event.answer, event.source) for event in outcome.events if event.kind == "answered"]


STOPPED = '<test name="gate" fixtures="">gate.py</test><test name="after" fixtures="">flaky.py</test>'


def test_a_run_is_stopped_after_the_test(live_run: Callable[..., Any], visit: Any, shoot: Callable[..., None]):
    """The mouse stops the run after the running test, and the page says so."""
    run = live_run(STOPPED)
    page = visit(run.address)
    expect(row(page, "gate")).to_contain_text("running")
    page.get_by_role("button", name="Stop").click()
    shoot(page, "live-stop")
    page.get_by_role("dialog").get_by_role("button", name="After this test").click()
    expect(page.get_by_role("dialog")).to_be_hidden()
    expect(page.get_by_text("stops after this test")).to_be_visible()
    let(run, "go")
    expect(title(page)).to_have_text("interrupted")
    expect(row(page, "after")).to_contain_text("not run")
    ended = run.wait()
    assert ([event.stage for event in ended.events if event.kind == "interrupted"], ended.exit_code) == ([1], 2)
    assert (ended.verdict("gate"), ended.verdict("after")) == (Verdict.PASSED, Verdict.NOT_RUN)


def test_a_run_is_stopped_now(live_run: Callable[..., Any], visit: Any):
    """The keyboard stops the running test after a confirmation, which Escape cancels."""
    run = live_run(STOPPED)
    page = visit(run.address)
    expect(row(page, "gate")).to_contain_text("running")
    page.keyboard.press("s")
    expect(page.get_by_role("dialog")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog")).to_be_hidden()
    page.keyboard.press("s")
    now = page.get_by_role("dialog").get_by_role("button", name="Now")
    page.keyboard.press("Tab")
    expect(now).to_be_focused()
    page.keyboard.press("Enter")
    expect(title(page)).to_have_text("interrupted")
    ended = run.wait()
    assert max(event.stage for event in ended.events if event.kind == "interrupted") == 2
    assert ended.verdict("gate") == Verdict.INTERRUPTED


def test_without_the_token_there_is_only_looking(live_run: Callable[..., Any], visit: Any, shoot: Callable[..., None]):
    """Without the token questions are shown, but cannot be answered, and the run cannot be stopped."""
    run = live_run('<test name="ask" fixtures="">ask.py</test>')
    page = visit(run.origin)
    question = page.get_by_role("region", name="Question")
    expect(question).to_contain_text("Is the lamp green?")
    expect(question).to_contain_text("open the page with the complete address")
    expect(question.get_by_role("button")).to_have_count(0)
    page.keyboard.press("s")
    expect(page.get_by_role("dialog").get_by_role("button", name="Now")).to_be_hidden()
    expect(page.get_by_role("dialog")).to_contain_text("open the page with the complete address")
    shoot(page, "live-without-token")


def test_the_token_is_not_visible(live_run: Callable[..., Any], visit: Any):
    """The token disappears from the address, and is kept on reloading."""
    run = live_run(STOPPED)
    page = visit(run.address)
    expect(row(page, "gate")).to_contain_text("running")
    assert "token" not in page.url
    page.reload()
    expect(row(page, "gate")).to_contain_text("running")
    page.keyboard.press("s")
    expect(page.get_by_role("dialog").get_by_role("button", name="Now")).to_be_visible()
    page.keyboard.press("Escape")
    let(run, "go")
    run.wait()


def test_the_policy_allows_nothing_unsafe(live_run: Callable[..., Any]):
    """The content policy allows neither inline code nor other origins."""
    run = live_run(STOPPED)
    with urllib.request.urlopen(run.origin) as answer:
        policy = answer.headers["Content-Security-Policy"]
    assert "unsafe" not in policy
    assert "default-src 'none'" in policy
    assert "script-src 'self'" in policy
    with urllib.request.urlopen(f"{run.origin}facts") as answer:
        assert json.loads(answer.read())["mode"] == "live"
    let(run, "go")
    run.wait()
