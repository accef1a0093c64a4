"""Joining modules into one: the same program in the order of imports, or an error with line and hint."""

from __future__ import annotations

import re
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtf.page.assets import read_assets
from rtf.page.bundle import BundleError, join_modules
from rtf.page.single_file import page_in_pieces

NODE = shutil.which("node")
needs_node = pytest.mark.skipif(NODE is None, reason="node is not installed")


def check_syntax(text: str, folder: Path) -> str:
    """Return node's syntax errors of a module."""
    path = folder / "joined.mjs"
    path.write_text(text, encoding="utf-8")
    return subprocess.run([str(NODE), "--check", str(path)], capture_output=True, text=True, check=False).stderr


PROGRAM = {
    "main.js": """\
import { greet, Person } from "./people.js";
import { loud } from "./text.js"; // for shouting
// import { nothing } from "./comment.js"; is not an import
const NAMES = ["Ada", "Bo"];
for (const name of NAMES) console.log(loud(greet(new Person(name))));
console.log(await Promise.resolve("done"));
""",
    "people.js": """\
import { joined, loud } from "./text.js";

export class Person {
  constructor(name) { this.name = name; }
}

export async function later() {}

export function greet(person) {
  const local = `${person.name}`;
  return joined("hello", local) + (loud ? "" : "?");
}
let hidden = 1;
""",
    "text.js": """\
/**
 * import of texts, and their export
 */
export const joined = (...words) => words.join(" ");
export function loud(text) { return text.toUpperCase() + "!"; }
""",
    "comment.js": "syntax error (",
}


def test_each_module_stands_after_what_it_imports_and_unused_ones_are_left_out():
    """Modules are joined in the order of imports, without unused ones."""
    joined = join_modules(PROGRAM, "main.js")
    assert re.findall(r"^// (\w+\.js)$", joined, re.MULTILINE) == ["text.js", "people.js", "main.js"]


@needs_node
def test_the_joined_program_does_what_the_modules_do(tmp_path: Path):
    """The joined program has the output of the modules."""
    for name, text in PROGRAM.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "package.json").write_text('{"type": "module"}', encoding="utf-8")
    (tmp_path / "joined.js").write_text(join_modules(PROGRAM, "main.js"), encoding="utf-8")
    said = [
        subprocess.run([str(NODE), str(tmp_path / name)], capture_output=True, text=True, check=True).stdout
        for name in ("main.js", "joined.js")
    ]
    assert said == ["HELLO ADA!\nHELLO BO!\ndone\n"] * 2


@pytest.mark.parametrize(
    "line",
    [
        'import * as all from "./other.js";',
        'import other from "./other.js";',
        'import "./other.js";',
        'import { a as b } from "./other.js";',
        "import { a } from './other.js';",
        'import { a } from "other";',
        'import { a } from "https://example.org/other.js";',
        'import { a } from "./other.js"',
        "import {",
        '  import { a } from "./other.js";',
    ],
)
def test_an_import_of_another_form_is_refused(line: str):
    """An import that is not on one line in the usual form is refused with a hint."""
    with pytest.raises(BundleError, match=r'main\.js:2: .*write it on one line.* import \{ name \} from "\./module'):
        join_modules({"main.js": f"\n{line}\n", "other.js": "export const a = 1;"}, "main.js")


@pytest.mark.parametrize(
    "line", ['const a = await import("./other.js");', "  load(import.meta.url);", "const b = import ('x');"]
)
def test_nothing_is_imported_while_the_page_runs(line: str):
    """A dynamic import is refused."""
    with pytest.raises(BundleError, match=r"main\.js:1: dynamic imports do not work in a single file"):
        join_modules({"main.js": line}, "main.js")


@pytest.mark.parametrize(
    "line",
    [
        "export default class {}",
        "export { a, b };",
        'export * from "./other.js";',
        "export let a = 1;",
        "export var a = 1;",
        "  export const a = 1;",
    ],
)
def test_an_export_of_another_form_is_refused(line: str):
    """An export other than before a declaration is refused with a hint."""
    with pytest.raises(BundleError, match=r"main\.js:3: this export .*write export at the left margin"):
        join_modules({"main.js": f"\n\n{line}\n"}, "main.js")


def test_names_that_could_not_be_seen_are_refused():
    """A destructuring declaration at top level is refused."""
    with pytest.raises(BundleError, match=r"main\.js:1: a declaration at the left margin names one thing"):
        join_modules({"main.js": "const { a, b } = c;"}, "main.js")


def test_what_is_imported_has_to_be_exported():
    """An import of a name that is not exported is refused."""
    sources = {"main.js": 'import { here, hidden } from "./a.js";', "a.js": "export const here = 1;\nconst hidden = 2;"}
    with pytest.raises(BundleError, match=r"main\.js:1: a\.js does not export hidden"):
        join_modules(sources, "main.js")


def test_a_module_that_is_not_there_is_named():
    """The error about a missing module has the line of its import."""
    with pytest.raises(BundleError, match=r"main\.js:2: there is no module gone\.js"):
        join_modules({"main.js": '\nimport { a } from "./gone.js";'}, "main.js")


NAMES = st.from_regex(r"[a-zA-Z_$][\w$]{0,6}", fullmatch=True)
FORMS = st.sampled_from(
    ["function {}() {{}}", "async function {}() {{}}", "function* {}() {{}}", "class {} {{}}", "const {} = 1;"]
)


@given(st.lists(NAMES, min_size=2, max_size=8, unique=True), st.data())
def test_a_name_is_declared_once_among_all_modules(names: list[str], data: st.DataObject):
    """A name that two modules declare is refused with both places."""
    forms = [data.draw(FORMS).format(name) for name in names]
    exported = [f"{data.draw(st.sampled_from(['', 'export ']))}{form}" for form in forms]
    twice = data.draw(st.sampled_from(names))
    again = data.draw(FORMS).format(twice)
    other = 'import { start } from "./other.js";\n'
    sources = {"main.js": other + "\n".join(exported), "other.js": "export const start$0 = 1;"}
    sources["main.js"] = sources["main.js"].replace("start", "start$0")
    assert join_modules(sources, "main.js").count("\n" + forms[0]) == 1
    sources["other.js"] += f"\n\n{again}"
    with pytest.raises(BundleError, match=re.escape(f"{twice} is declared in other.js:3 already")):
        join_modules(sources, "main.js")


def test_a_name_is_declared_once_in_a_module():
    """A name that a module declares twice is refused."""
    with pytest.raises(BundleError, match=r"main\.js:2: a is declared at line 1 already"):
        join_modules({"main.js": "const a = 1;\nfunction a() {}"}, "main.js")


@given(st.dictionaries(st.integers(0, 7), st.sets(st.integers(0, 7), max_size=4), min_size=1, max_size=8))
def test_imports_in_a_circle_are_refused_and_all_others_are_put_in_order(graph: dict[int, set[int]]):
    """Circular imports are refused with the circle, all others are ordered."""
    wanted = {name: sorted(other for other in others if other in graph) for name, others in graph.items()}
    sources = {
        f"m{name}.js": "".join(f'import {{ value{other} }} from "./m{other}.js";\n' for other in others)
        + f"export const value{name} = 1;\n"
        for name, others in wanted.items()
    }
    sources["main.js"] = "".join(f'import {{ value{name} }} from "./m{name}.js";\n' for name in wanted)
    try:
        joined = join_modules(sources, "main.js")
    except BundleError as error:
        circle = [int(name) for name in re.findall(r"m(\d)\.js", str(error).partition("circle, ")[2])]
        assert circle[0] == circle[-1]
        assert all(after in wanted[before] for before, after in pairwise(circle))
    else:
        place = {int(name): index for index, name in enumerate(re.findall(r"// m(\d)\.js", joined))}
        assert all(place[other] < place[name] for name in wanted for other in wanted[name])


# The page itself -------------------------------------------------------------------------------------------------

INDEX = """<!doctype html>
<meta charset="utf-8">
<link rel="stylesheet" href="page.css">
<script src="plain.js"></script>
<script type="module" src="main.js"></script>
</head><body></body>
"""


def page(**sources: str) -> str:
    """Return a small page as one file."""
    files = {"index.html": INDEX, "page.css": "b{}", "plain.js": "var a;", "main.js": "a = 1;"}
    head, tail = page_in_pieces({**files, **{name.replace("__", "."): text for name, text in sources.items()}})
    return (head + tail).decode()


def test_references_are_replaced_and_nothing_else():
    """Styles and scripts replace their references, and the rest stays."""
    text = page()
    assert re.sub(r"<meta http-equiv.*>\n", "", text) == INDEX.replace(
        '<link rel="stylesheet" href="page.css">', "<style>b{}</style>"
    ).replace('<script src="plain.js"></script>', "<script>var a;</script>").replace(
        '<script type="module" src="main.js"></script>', '<script type="module">// main.js\na = 1;\n</script>'
    )


@pytest.mark.parametrize(
    "line",
    [
        '<link href="other.css" rel="stylesheet">',
        '<link rel="icon" href="icon.svg">',
        '<script async src="plain.js"></script>',
        '<img src="logo.png">',
        "<script src='plain.js'></script>",
        '<base href="https://example.org/">',
    ],
)
def test_a_reference_of_another_form_is_refused(line: str):
    """Any other reference is refused, because a single file would lack it."""
    with pytest.raises(BundleError, match=r"index\.html: .* would be missing in a single file"):
        page(index__html=INDEX.replace("<body>", f"{line}<body>"))


def test_a_data_address_stays():
    """A data address stays."""
    icon = '<link rel="icon" href="data:image/png;base64,AAAA">'
    assert icon in page(index__html=INDEX.replace("<body>", f"{icon}<body>"))


@pytest.mark.parametrize("text", ["'</script>'", "'</SCRIPT'", "'<!--'", "'<script>'", "'</style>'"])
def test_a_text_that_would_end_its_element_is_refused(text: str):
    """A text that would end its element is refused."""
    with pytest.raises(BundleError, match=r"plain\.js: .* cannot be in a page that is a single file"):
        page(plain__js=f"var a = {text};")


@pytest.mark.parametrize("missing", ['<meta charset="utf-8">', "</head>"])
def test_the_places_for_policy_and_data_are_needed(missing: str):
    """The page must have places for policy and data."""
    with pytest.raises(BundleError, match="must have"):
        page(index__html=INDEX.replace(missing, ""))


@pytest.mark.parametrize("index", ["index.html", "campaign.html"])
def test_our_pages_become_one_file(index: str):
    """A page has no references as one file, and a policy with hashes and nothing unsafe."""
    head, tail = page_in_pieces(index=index)
    text = (head + tail).decode()
    assert re.findall(r"<script[^>]* src=|<link rel=\"stylesheet\"", text) == []
    (policy,) = re.findall(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', text)
    assert "unsafe" not in policy
    assert policy.startswith("default-src 'none'; ")
    assert policy.count("'sha256-") == len(re.findall(r"<(?:script|style)\b[^>]*>", text))


@needs_node
@pytest.mark.parametrize("entry", ["main.js", "campaign.js"])
def test_our_modules_are_joined_to_a_correct_one(tmp_path: Path, entry: str):
    """Node finds no error in the joined modules."""
    sources = {name: asset.text for name, asset in read_assets().items()}
    assert check_syntax(join_modules(sources, entry), tmp_path) == ""


@pytest.mark.parametrize("page", ["index.html", "logs.html", "applications.html", "campaign.html"])
def test_pages_are_small(page: str):
    """What a browser loads for a page has less than 400 kB, and all of it is there."""
    files = {name: asset.text for name, asset in read_assets().items()}
    loaded = [page]
    for name in loaded:
        named = re.findall(r'(?:src=|href=|from )"(?:\./)?([\w.-]+\.(?:js|css))"', files[name])
        loaded += [one for one in dict.fromkeys(named) if one not in loaded]
    assert len(loaded) > 5
    assert sum(len(files[name].encode()) for name in loaded) < 400_000
