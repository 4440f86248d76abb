"""docs/tune.md has every parameter and every picture; what docs/trouble.md quotes is what the program says; links lead
somewhere."""

import math
import pathlib
import re

from bags import REPOSITORY

SRC, DOCS = REPOSITORY / "src", REPOSITORY / "docs"
ROW = re.compile(r"Row::\w+(?:::<\w+>)?\(\s*\"(\w+)\"")
# What else can hold a quotation mark is passed over: comments, characters, raw texts.
LITERAL = re.compile(r'''//[^\n]*|'(?:[^'\\]|\\.)'|r(#+)".*?"\1|"((?:[^"\\]|\\.)*)"''', re.DOTALL)
PLACE = re.compile(r"\{[^{}]*\}")


def rows():
    """Name of a parameter -> its line of the table; those of a sensor as `<name>.kind`."""
    of_sensor, table = (SRC / "config" / "table.rs").read_text().split("const OF_SENSOR")[1].split("const TABLE")
    found = {}
    for text, prefix in ((of_sensor, "<name>."), (table, "")):
        begins = list(ROW.finditer(text)) + [None]
        for row, after in zip(begins, begins[1:]):
            found[prefix + row[1]] = text[row.end():after.start() if after else None]
    assert len(found) > 20, "the table is written in another way"
    return found


def literals():
    """All texts of the program but those of its tests, where each value stands as NUL."""
    for path in SRC.rglob("*.rs"):
        if any(part.startswith("tests") for part in path.relative_to(SRC).parts):
            continue
        code, *_ = re.split(r"\n#\[cfg\(test\)\]\nmod \w+ \{", path.read_text())
        for _, literal in LITERAL.findall(code):
            yield PLACE.sub("\0", re.sub(r"\\\n\s*", "", literal).replace('\\"', '"'))


NAME = re.compile(r"\b\w+(?:/|\.rs)")
TESTS = re.compile(r"\n#\[cfg\(test\)\]\n(?:#.*\n)?(?:pub\S* )?mod \w+ \{")


def imports():
    """Each module but the command line, as the graph calls it -> the others that it imports, but for its tests."""
    names = {path.name: f"{path.name}/" for path in SRC.iterdir() if path.is_dir()}
    names |= {path.stem: path.name for path in SRC.glob("*.rs")}
    found = {}
    for module in names.keys() - {"lib", "main", "cli"}:
        files = [*SRC.glob(f"{module}.rs"), *SRC.glob(f"{module}/**/*.rs")]
        files = [path for path in files if not any(part.startswith("tests") for part in path.relative_to(SRC).parts)]
        code = [TESTS.split(path.read_text())[0] for path in files]
        used = set(re.findall(r"^[^/\n]*\bcrate::(\w+)", "\n".join(code), re.MULTILINE))
        found[names[module]] = {names[other] for other in used - {module} if other in names}
    return found


def test_the_graph_of_modules_has_the_imports_that_there_are():
    graph = (REPOSITORY / "ARCHITECTURE.md").read_text().split("```\n")[1]
    free = set(NAME.findall(re.search("^.*import nothing of the others", graph, re.MULTILINE)[0]))
    drawn = {each: set() for each in free}
    for begin, targets in re.findall("^(?:    ├──>|    └──>)?(.*) ──> (.*)$", graph, re.MULTILINE):
        drawn |= {each: set(NAME.findall(targets)) - free for each in NAME.findall(begin)}
    assert drawn == {each: others if each in free else others - free for each, others in imports().items()}


def test_the_readme_has_its_parts_in_the_order_in_which_they_are_looked_for():
    headings = re.findall(r"^## (.*)$", (REPOSITORY / "README.md").read_text(), re.MULTILINE)
    assert headings == ["See it", "Use it with a driver", "Read it from a planner", "Replay a bag", "Numbers", "Limits"]


def test_every_page_is_reached_from_the_readme():
    links = re.findall(r"\]\((docs/[\w-]+\.md)", "\n".join((REPOSITORY / name).read_text() for name in ("README.md", "ARCHITECTURE.md")))
    assert {REPOSITORY / link for link in links} == set(DOCS.glob("*.md"))


def anchors(page):
    """What GitHub makes of the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_link_of_a_page_leads_to_a_file_and_a_heading_that_are_there():
    pages = [*REPOSITORY.glob("*.md"), *DOCS.glob("*.md")]
    assert len(pages) > 5
    for page in pages:
        for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
            if "://" in link:
                continue
            path, _, heading = link.partition("#")
            target = (page.parent / path).resolve() if path else page
            assert target.exists(), f"{page.name}: {link}"
            assert not heading or heading in anchors(target), f"{page.name}: {link}"


def test_every_parameter_is_a_heading_of_the_page_and_those_that_change_live_are_listed():
    page = (DOCS / "tune.md").read_text()
    headings = " ".join(re.findall(r"^### .*$", page, re.MULTILINE))
    named = re.findall(r"`([^`]+)`", headings)
    assert sorted(named) == sorted(rows())
    live = re.search(r"^At any time: (.*?)\.$", page, re.MULTILINE | re.DOTALL)[1]
    assert set(re.findall(r"`(\w+)`", live)) == {name for name, row in rows().items() if "Change::Live" in row}


REASON = re.compile(r"\(\s*\"(\w+)\",")


def reasons():
    """The keys by which scans and transforms are counted that are not used."""
    keys = set()
    for path in SRC.rglob("*.rs"):
        if not any(part.startswith("tests") for part in path.relative_to(SRC).parts):
            code = TESTS.split(path.read_text())[0]
            of_errors = "".join(re.findall(r"fn reason\(&self\) -> Reason \{\n(.*?)\n    \}\n", code, re.DOTALL))
            keys |= set(REASON.findall(of_errors)) | set(re.findall(r"\bReason::new\(\s*\"(\w+)\"", code))
    assert len(keys) > 40, "reasons are written in another way"
    return keys


def first_cells(page, header):
    """The names in the first column of the table that has this header, in its order."""
    _, table = (DOCS / page).read_text().split(f"{header}\n|---|---|\n")
    cells = [line.split("|")[1] for line in table.split("\n\n")[0].splitlines()]
    return [name for cell in cells for name in re.findall(r"`(\w+)`", cell)]


def test_every_reason_for_which_a_scan_is_skipped_or_a_transform_refused_is_in_the_table():
    assert sorted(first_cells("trouble.md", "| key | what it means |")) == sorted(reasons())


def test_every_key_of_the_summary_and_every_column_of_the_voxels_is_in_its_table():
    keys = re.search(r"json!\(\{\n(.*?)\n        \}\)", (SRC / "replay" / "summary.rs").read_text(), re.DOTALL)[1]
    assert sorted(first_cells("replay.md", "| key | what it is |")) == sorted(re.findall(r"\"(\w+)\": ", keys))
    columns = re.search(r"writeln!\(out, \"(ix,[\w,]+)\"\)", (SRC / "export" / "voxels.rs").read_text())[1]
    assert first_cells("replay.md", "| column | what it is |") == columns.split(",")
    assert f"\n```\n{columns}\n```\n" in (DOCS / "replay.md").read_text()


def constants(path):
    """The numbers that a file of the engine names, as they are written: name -> value, or its two values."""
    found = re.findall(r"const (\w+): [^=]+ = \[?([\d._]+)(?:, ([\d._]+)\])?;", (SRC / "engine" / path).read_text())
    return {name: [float(value) for value in values if value] for name, *values in found}


def test_the_limits_of_classes_and_states_are_those_of_the_program():
    page = " ".join((DOCS / "planner.md").read_text().split())
    files = ("class", "surfaces/identify", "surfaces/landmarks", "surfaces/tell", "surfaces/waiting")
    engine = {path: constants(f"consistent/{path}.rs") for path in files}
    limits = {name: value for values in engine.values() for name, value in values.items()}
    level, upright = (round(math.degrees(limits[name][0])) for name in ("LEVEL", "UPRIGHT"))
    (narrow, wide), (low, high) = limits["DOOR_WIDTH"], limits["DOOR_HEIGHT"]
    for said in (f"tilted by {level} degrees at most", f"tilted by {upright} degrees or more, so a wall may lean by {90 - upright}",
                 f"the large ones ({limits['FLOOR_AREA'][0]:g} m^2) in its storey ({limits['STOREY'][0]:g} m)",
                 f"more than {100 * limits['STEP'][0]:g} cm higher", f"{narrow:g} to {wide:g} m wide and {low:g} to {high:g} m high",
                 f"fewer than {limits['RELIABLE_VOXELS'][0]:g} voxels", f"less than {limits['RELIABLE_SECONDS'][0]:g} s ago",
                 f"when it has {limits['TOLD'][0]:g} voxels", f"fewer than {limits['NO_LONGER_TOLD'][0]:g}.",
                 f"every {limits['ROUND'][0]:g} scans"):
        assert said in page


def test_every_picture_is_shown_and_all_are_small():
    pictures = {path for path in (DOCS / "tune").iterdir() if path.suffix in (".png", ".svg")}
    shown = re.findall(r"!\[[^\]]+\]\((tune/[^)]+)\)", (DOCS / "tune.md").read_text())
    assert {DOCS / pathlib.Path(path) for path in shown} == pictures
    assert sum(path.stat().st_size for path in pictures) < 400_000


def test_what_the_page_quotes_is_said_by_the_program():
    said = "\n".join(literals())
    quoted = re.findall(r"^( *)```log\n(.*?)^\1```$", (DOCS / "trouble.md").read_text(), re.MULTILINE | re.DOTALL)
    lines = [line.strip() for _, block in quoted for line in block.splitlines()]
    assert len(lines) > 50
    for line in lines:
        # A line may be put together from several texts, with `: ` or `; ` between.
        parts = [part.strip() for part in re.split(r"\.\.\.|[:;] ", line)]
        assert max(map(len, parts)) >= 8, f"nothing to find it by: {line}"
        missing = [part for part in parts if part not in said]
        assert not missing, f"{line}\nThe program never says {missing}."
