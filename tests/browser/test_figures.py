"""The modules of the figures: places on bars and axes, lines of plots, differences of runs, and long tables.

The modules run in a real browser, which gets them as from the server.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from rtf.page.assets import read_assets

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page, Route

ORIGIN = "http://page.test/"
EMPTY = '<!doctype html><html lang="en"><head><script src="uPlot.iife.min.js"></script></head><body></body></html>'


@pytest.fixture(scope="module")
def page(browser: Browser) -> Iterator[Page]:
    """An empty page that can import the modules."""
    assets = read_assets()

    def serve(route: Route) -> None:
        name = route.request.url.removeprefix(ORIGIN)
        if name in assets:
            route.fulfill(body=assets[name].content, content_type=assets[name].media_type)
        else:
            route.fulfill(body=EMPTY if name == "" else "", content_type="text/html", status=200 if name == "" else 404)

    with browser.new_context() as context:
        context.route(f"{ORIGIN}**", serve)
        opened = context.new_page()
        opened.goto(ORIGIN)
        yield opened


@pytest.fixture
def ask(page: Page) -> Any:
    """Calls a function with the exports of a module, and with values."""

    def call(module: str, function: str, *values: Any) -> Any:
        script = f"async (values) => ({function})(await import('./{module}.js'), ...values)"
        return page.evaluate(script, [*values])

    return call


# Axes and bars -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("low", "high", "texts"),
    [
        (0, 10, ["0 s", "2 s", "4 s", "6 s", "8 s", "10 s"]),
        (0, 0.01, ["0.000 s", "0.002 s", "0.004 s", "0.006 s", "0.008 s", "0.010 s"]),
        (50, 200, ["1:00", "1:30", "2:00", "2:30", "3:00"]),
        (3500, 7300, ["1:00:00", "1:15:00", "1:30:00", "1:45:00", "2:00:00"]),
    ],
)
def test_an_axis_of_time_is_divided_as_clocks_are(ask: Any, low: float, high: float, texts: list[str]):
    """An axis of time is divided by 1, 2, 5, 10, 15 or 30 seconds, minutes or hours."""
    assert (
        ask(
            "chart_helpers", "({ timeTicks }, low, high) => timeTicks(low, high, 5).map((tick) => tick.text)", low, high
        )
        == texts
    )


@pytest.mark.parametrize(
    ("value", "step", "text"),
    [(1.25, 0.25, "1.25"), (-3, 1, "\u22123"), (0.30000000000000004, 0.1, "0.3"), (2e9, 1e9, "2.00e+9")],
)
def test_a_tick_has_the_digits_that_its_step_needs(ask: Any, value: float, step: float, text: str):
    """A tick has as many digits as its step needs."""
    assert ask("chart_helpers", "({ tickText }, value, step) => tickText(value, step)", value, step) == text


def test_thin_bars_merge_but_a_bad_one_stays_in_sight(ask: Any):
    """Many thin bars are merged, except for one of a failed test."""
    bars = [{"from": index / 10, "to": index / 10 + 0.08, "rank": 0 if index == 250 else 12} for index in range(500)]
    merged = ask(
        "chart_helpers",
        "({ mergeBars }, bars) => mergeBars(bars, 4).map((bar) => [bar.rank, bar.members.length])",
        bars,
    )
    assert merged == [[12, 250], [0, 1], [12, 249]]


def test_a_saved_table_is_text_for_a_spreadsheet(ask: Any):
    """A saved table is CSV with doubled quotes; a text is never a formula."""
    rows = [["name", "value"], ['=HYPERLINK("x")', -1.5], ["a,b\nc", None]]
    text = 'name,value\r\n"\'=HYPERLINK(""x"")",-1.5\r\n"a,b\nc",\r\n'
    assert ask("chart_helpers", "({ csvText }, rows) => csvText(rows)", rows) == text


@pytest.mark.parametrize(
    ("measurement", "at", "beyond"),
    [
        ({"value": 12.5, "low": 10, "high": 15}, 48, 0),
        ({"value": 10, "low": 10, "high": 15}, 14, 0),
        ({"value": 99, "low": 10, "high": 15}, 93, 1),
        ({"value": "-Infinity", "low": 10, "high": 15}, 3, -1),
        ({"value": 5, "high": 10}, 48, 0),
        ({"value": 20, "low": 10}, 82, 0),
        ({"value": 0, "low": 0, "high": 0}, 48, 0),
    ],
)
def test_the_mark_of_a_margin_bar_stands_where_the_value_is(
    ask: Any, measurement: dict[str, Any], at: float, beyond: int
):
    """The mark is in proportion between the limits, and at the end of the bar beyond them."""
    mark = ask("margin_bar", "({ marginScale }, measurement) => marginScale(measurement).mark", measurement)
    assert mark == {"at": pytest.approx(at), "beyond": beyond}


@pytest.mark.parametrize("measurement", [{"value": 1}, {"value": "NaN", "low": 0, "high": 1}])
def test_without_a_place_there_is_no_bar(ask: Any, measurement: dict[str, Any]):
    """A measurement without limits, or with NaN, has no bar."""
    assert ask("margin_bar", "({ marginScale }, measurement) => marginScale(measurement)", measurement) is None


def test_a_margin_bar_can_be_heard(page: Page):
    """The label of a margin bar has its values in words."""
    words = page.evaluate(
        """async () => {
          const [{ marginBar }, { format }] = await Promise.all([import("./margin_bar.js"), import("./format.js")]);
          const measurement = { value: 12.5, unit: "deg", low: 10, high: 15, margin: 2.5, verdict: "marginal" };
          return marginBar(measurement, format).getAttribute("aria-label");
        }"""
    )
    assert words == "12.5 deg of 10 to 15 deg, margin 2.5 deg, marginal"


# Plots ---------------------------------------------------------------------------------------------------------------


def series(subject: str, *columns: tuple[str, str], axis: tuple[str, str] = ("time", "s")) -> dict[str, Any]:
    """Return the record of a series."""
    named = [{"name": name, "unit": unit} for name, unit in (axis, *columns)]
    return {
        "test": "s/t",
        "subject": subject,
        "name": "tracking",
        "path": f"{subject}.npz",
        "columns": named,
        "rows": 3,
    }


def layout(ask: Any, *records: dict[str, Any]) -> Any:
    """Return the columns that share a figure: [groups of [figures of column names]]."""
    function = """({ layoutOf, tracesOf }, records) => layoutOf(tracesOf(records, [])).map(
        (group) => group.figures.map((figure) => figure.lines.map((line) => line.name)))"""
    return ask("plot_data", function, [*records])


def test_a_figure_has_at_most_two_scales(ask: Any):
    """A third unit, and a difference, have a figure of their own."""
    record = series(
        "j", ("reference", "deg"), ("measured", "deg"), ("error", "deg"), ("current", "A"), ("speed", "deg/s")
    )
    assert layout(ask, record) == [[["reference", "measured"], ["error"], ["current", "speed"]]]


def test_series_over_other_axes_stay_apart(ask: Any):
    """Series over different axes have figures of their own."""
    over_angle = series("b", ("torque", "Nm"), axis=("angle", "deg"))
    assert layout(ask, series("a", ("torque", "Nm")), over_angle) == [[["torque"]], [["torque"]]]


def test_what_was_wanted_has_the_colour_of_what_came(ask: Any):
    """The reference and the measured line of a joint have one colour."""
    records = [series(f"joint {index}", ("reference", "deg"), ("position", "deg")) for index in range(2)]
    function = """({ layoutOf, tracesOf }, records) => layoutOf(tracesOf(records, []))[0].figures[0].lines.map(
        (line) => [line.trace.record.subject, line.wanted, line.colour])"""
    lines = ask("plot_data", function, records)
    assert sorted(lines) == [["joint 0", False, 0], ["joint 0", True, 0], ["joint 1", False, 1], ["joint 1", True, 1]]


def test_gaps_are_gaps_and_the_axis_ascends(ask: Any):
    """NaN and infinity are gaps; rows are sorted, and rows without a place removed."""
    columns = "[[1, 0, NaN, 2], [10, 5, 7, Infinity]]"
    assert ask("plot_data", f"({{ cleanColumns }}) => cleanColumns({columns})") == [[0, 1, 2], [5, 10, None]]


def test_a_recorded_series_takes_the_place_of_the_live_one(ask: Any):
    """A recorded series replaces the live one, whose data stay until it is loaded."""
    record = series("j", ("measured", "deg"))
    function = """({ tracesOf }, record) => {
      const entry = { record, columns: record.columns, samples: [[0, 1], [5, 6]] };
      const [live] = tracesOf([entry], []);
      live.takeLive();
      const [recorded] = tracesOf([record], [live]);
      return [recorded.key === live.key, recorded.isLive, recorded.state, recorded.data];
    }"""
    assert ask("plot_data", function, record) == [True, False, "new", [[0, 1], [5, 6]]]


def test_limits_are_drawn_only_where_they_are_of_the_column(ask: Any):
    """Limits are drawn for the column with the measurement's name, unit and subject."""
    record = series("joint 1", ("position", "deg"))
    measurements = [
        {"name": "position", "unit": "deg", "subject": "joint 1", "low": -5, "high": 5},
        {"name": "position", "unit": "deg", "subject": "joint 2", "low": -7, "high": 7},
        {"name": "peak", "unit": "deg", "subject": "joint 1", "low": -9, "high": 9},
    ]
    function = """({ layoutOf, limitsOf, tracesOf }, record, measurements) =>
        limitsOf(layoutOf(tracesOf([record], []))[0].figures[0].lines[0], measurements)"""
    assert ask("plot_data", function, record, measurements) == [-5, 5]


# Runs beside each other ----------------------------------------------------------------------------------------------


def outcome(verdict: str | None, *measurements: dict[str, Any]) -> dict[str, Any]:
    """Return the outcome of a test."""
    return {"name": "t", "verdict": verdict, "measurements": [*measurements]}


def compared(ask: Any, older: dict[str, Any], newer: dict[str, Any]) -> Any:
    """Return the differences of two runs."""
    function = """({ compareOutcomes }, older, newer) =>
        compareOutcomes(new Map(Object.entries(older)), new Map(Object.entries(newer)))"""
    return ask("compare", function, older, newer)


@pytest.mark.parametrize(
    ("before", "now", "change"),
    [
        ("passed", "failed", "newly failing"),
        ("passed", "blocked", "newly failing"),
        ("not run", "error", "newly failing"),
        ("failed", "passed", "fixed"),
        ("fixture lost", "flaky", "fixed"),
        ("failed", "error", "other verdict"),
        ("passed", "skipped", "other verdict"),
        ("skipped", "passed", "other verdict"),
        ("passed", "not run", "other verdict"),
    ],
)
def test_a_change_has_a_name(ask: Any, before: str, now: str, change: str):
    """Each change of a verdict has a name, such as newly failing or fixed."""
    (row,) = compared(ask, {"s/t": outcome(before)}, {"s/t": outcome(now)})["tests"]
    assert row["change"] == change


def test_what_has_not_ended_is_no_change(ask: Any):
    """A test that has not ended is no change; one in a single run is new or missing."""
    found = compared(
        ask,
        {"a": outcome("passed"), "b": outcome("passed"), "gone": outcome("passed")},
        {"a": outcome(None), "b": outcome("passed"), "new": outcome("passed")},
    )
    assert [(row["test"], row["change"]) for row in found["tests"]] == [("new", "new test"), ("gone", "missing test")]
    assert found["same"]["tests"] == 1


def test_a_measurement_moves_in_shares_of_its_range(ask: Any):
    """Changed verdicts come first, then the largest changes; unchanged values are counted."""

    def measured(name: str, value: float, verdict: str = "passed") -> dict[str, Any]:
        return {"name": name, "value": value, "low": 0, "high": 10, "verdict": verdict}

    before = [measured("a", 5), measured("b", 5), measured("c", 9.9), measured("d", 1), measured("e", 1)]
    now = [measured("a", 6), measured("b", 8), measured("c", 10.1, "failed"), measured("d", 1), measured("e", 1.01)]
    found = compared(ask, {"s/t": outcome("passed", *before)}, {"s/t": outcome("failed", *now)})
    rows = [(row["record"]["name"], row["changed"], round(row["share"], 3)) for row in found["measurements"]]
    assert rows == [("c", True, 0.02), ("b", False, 0.3), ("a", False, 0.1)]
    assert (found["same"]["measurements"], found["same"]["still"]) == (1, 1)


def test_what_was_measured_twice_is_compared_twice(ask: Any):
    """Repeated measurements are compared in their order."""
    before = [{"name": "m", "value": value} for value in (1, 2)]
    now = [{"name": "m", "value": value} for value in (1, 4)]
    found = compared(ask, {"s/t": outcome("measured", *before)}, {"s/t": outcome("measured", *now)})
    assert [(row["before"], row["now"]) for row in found["measurements"]] == [(2, 4)]


# Tables of any length ------------------------------------------------------------------------------------------------


def test_a_table_of_a_hundred_thousand_rows_has_few(page: Page):
    """A long table draws the visible rows only, and is sorted by its headers."""
    page.add_style_tag(content=".sort-region { --row: 2rem; height: 400px; overflow: auto } td { height: 2rem }")
    page.evaluate(
        """async () => {
          const { SortTable } = await import("./sort_table.js");
          const column = { key: "n", label: "Number", value: (row) => row.n, cell: (row) => String(row.n) };
          const table = new SortTable({ label: "numbers", columns: [column] });
          document.body.append(table.element);
          table.rows = Array.from({ length: 100000 }, (_, index) => ({ n: (index * 7919) % 100000 }));
        }"""
    )
    table = page.get_by_role("table", name="numbers")
    assert table.get_attribute("aria-rowcount") == "100001"
    header = table.get_by_role("columnheader", name="Number")
    header.get_by_role("button").click()
    header.get_by_role("button").click()
    assert header.get_attribute("aria-sort") == "descending"
    assert table.locator("tbody tr[aria-rowindex]").first.inner_text() == "99999"
    assert table.locator("tbody tr[aria-rowindex]").count() < 100
    page.get_by_role("region", name="numbers").evaluate("(region) => region.scrollTo(0, region.scrollHeight)")
    page.wait_for_function("document.querySelector('tr[aria-rowindex=\"100001\"]') !== null")
    assert table.locator("tr[aria-rowindex='100001']").inner_text() == "0"
