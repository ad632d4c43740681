"""Pages name only what exists, and their blocks of code run."""

from pathlib import Path

import pytest

pytest.importorskip("sybil", reason="sybil is not installed: pip install -e '.[docs]'")

from race_agents.policies import metadata
from race_agents.reproductions import training
from race_agents.training import demonstrations
from race_docs.blocks import counts, run_page, runnable
from race_docs.checks import Facts, check
from race_docs.messages import read_schema
from race_docs.pages import ROOT, Page, all_pages
from race_docs.settings import settings_page
from race_server.competition.launch import free_address
from race_server.live.gateway.handshake import SUBPROTOCOL
from race_server.net.wire.lobby import PROTOCOL
from race_server.storage.results.schema import MIGRATIONS

PAGES = all_pages()


@pytest.fixture(scope="module")
def facts() -> Facts:
    return Facts()


def complaints(facts: Facts, text: str) -> list[str]:
    """Return what is wrong with a page of this text."""
    return [each.message for each in check(Page("docs/page.md", text), facts)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.path)
def test_a_page_names_only_what_exists(page: Page, facts: Facts) -> None:
    assert check(page, facts) == []


def test_the_table_of_decisions_has_each_page_with_its_date_and_title() -> None:
    folder = ROOT / "docs" / "design"
    table = (folder / "index.md").read_text()
    for path in sorted(folder.glob("0*.md")):
        title, _, date = path.read_text().splitlines()[:3]
        number, _, words = title.removeprefix("# ").partition(". ")
        assert f"| [{number}]({path.name}) | {date.strip('*')} | {words} |" in table


@pytest.mark.live
@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    "page", [page for page in PAGES if runnable(page)], ids=lambda page: page.path
)
def test_the_blocks_of_a_page_run(page: Page, tmp_path: Path) -> None:
    address = free_address().removeprefix("tcp/")
    assert run_page(page, tmp_path, address) == len(runnable(page))


def test_every_block_of_code_is_run_or_says_why_not(capsys: pytest.CaptureFixture[str]) -> None:
    ran, left_out = counts(PAGES)
    with capsys.disabled():
        print(f"\n{ran} blocks of code are run, {left_out} are not, each with its reason")
    assert ran >= 15
    fences = sum(page.text.count("\n```python") + page.text.count("\n```console") for page in PAGES)
    assert ran + left_out >= fences


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("`race start --fast`", "`race start` has no option --fast"),
        ("`race fly`", "`race` has no command 'fly'"),
        ("`race track fly`", "`race track` has no command 'fly'"),
        ("Give `--no-such-option 3`.", "no command has the option --no-such-option"),
        ("```console\n$ race serve \\\n  --fast\n```", "`race serve` has no option --fast"),
        ("`Pose.colour`", "the schema's Pose has no 'colour'"),
        (
            "| field of `Pose` | |\n|---|---|\n| `stamp` | |\n| `colour` | |",
            "the schema's Pose has no field 'colour'",
        ),
        ("`race_server.fly`", "there is no race_server.fly"),
        ("```python\nfrom race_server import fly\n```", "there is no race_server.fly"),
        ("`race_server/core/fly.py`", "there is no race_server/core/fly.py"),
        (
            "`race_server/core/step.py:fly`",
            "race_server/core/step.py does not define fly",
        ),
        ("`test_nothing_at_all`", "there is no test test_nothing_at_all"),
    ],
)
def test_what_does_not_exist_is_named(text: str, complaint: str, facts: Facts) -> None:
    assert complaints(facts, text) == [complaint]


@pytest.mark.parametrize(
    "text",
    [
        "`race start --track oval` and `race drill crash | hostile`",
        "```console\n$ race replay FILE --play && race track list\n```",
        "`Pose.stamp`, `race_server.KartClient`, `race_server/core/step.py:step`, `core/step.py`",
        "`--track oval`, `pip install x`, `config.toml`, `schemas/drive.fbs`",
        "```python\nfrom race_server import KartClient\n```",
        "<!-- not run: it explodes -->\n```cpp\nint main();\n```",
        "```text\nrace fly --fast\n```",
    ],
)
def test_what_exists_is_not_complained_of(text: str, facts: Facts) -> None:
    assert complaints(facts, text) == []


def test_a_block_without_a_language_or_a_reason_is_complained_of(facts: Facts) -> None:
    for fence in ("```", "```cpp", "```sh"):
        (complaint,) = complaints(facts, f"{fence}\nx\n```")
        assert "not run: REASON" in complaint


def test_a_console_block_fails_by_its_status_and_by_its_output(tmp_path: Path) -> None:
    from sybil.evaluators.python import PythonEvaluator  # noqa: F401 - sybil is whole
    from sybil.example import SybilFailure

    def run(block: str) -> int:
        return run_page(Page("page.md", f"```console\n{block}\n```\n"), tmp_path, "127.0.0.1:1")

    assert run("$ echo one two\none ...") == 1
    with pytest.raises(SybilFailure, match="ended with 3"):
        run("$ exit 3")
    with pytest.raises(SybilFailure, match="and not"):
        run("$ echo one\ntwo")


def test_a_schema_is_read_with_its_comments() -> None:
    introduction, (kart, colour) = read_schema(
        "// All of it.\nnamespace race.x;\n\n// A kart.\ntable Kart { // identifier KART\n"
        "  x: float32; // [m] east,\n              // or west\n  laps: [uint8] (required);\n}\n"
        "enum Colour : uint8 { RED, BLUE = 4 }\n"
    )
    assert introduction == "All of it."
    assert (kart.name, kart.namespace, kart.note) == (
        "Kart",
        "race.x",
        "A kart. Identifier `KART`.",
    )
    assert [(each.name, each.kind, each.note) for each in kart.members] == [
        ("x", "float32", "[m] east, or west"),
        ("laps", "[uint8] (required)", ""),
    ]
    assert [(each.name, each.kind) for each in colour.members] == [("RED", "0"), ("BLUE", "4")]


def test_settings_are_listed_with_default_bounds_and_meaning() -> None:
    page = settings_page()
    assert "## [warm_start]" in page
    assert "## [[curriculum]]" in page
    assert "## [parking]" in page
    (horizon,) = [line for line in page.splitlines() if line.startswith("| `horizon` |")]
    assert "normalised" in horizon
    assert "| `None` | `float \\| None` |" in horizon
    (rays,) = [line for line in page.splitlines() if line.startswith("| `rays` |")]
    assert rays.endswith("| `201` | `int` |")
    assert "at least 2, at most 2048" in rays


def test_the_changelog_tells_the_versions_of_all_formats() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    rows = {
        row.split("|")[1].strip(): row.split("|")[2].strip()
        for row in changelog.splitlines()
        if row.startswith("| ")
    }
    assert rows["network protocol"] == str(PROTOCOL)
    assert rows["gateway protocol"] == f"`{SUBPROTOCOL}`"
    assert rows["results file"] == str(len(MIGRATIONS))
    assert rows["policies"] == str(metadata.VERSION)
    assert rows["demonstrations"] == str(demonstrations.VERSION)
    assert rows["runs of reproductions"] == str(training.FORMAT)


def test_the_readme_and_the_architecture_are_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) < 120
    assert len((ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8").splitlines()) <= 100
