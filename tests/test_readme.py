"""What READMEs promise: links that lead somewhere, examples that run, a front page that is short."""

import doctest
import re
import shlex
import subprocess
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest

from lutgen.commands.parser import parser

ROOT = Path(__file__).parent.parent
LISTED = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True)
TEXTS = [ROOT / name for name in LISTED.stdout.split("\n") if name.endswith((".py", ".cl", ".glsl", ".md"))]
READMES = sorted(path for path in TEXTS if path.name == "README.md" and path.is_file())
FRONT = ROOT / "README.md"
CITED = re.compile(r"((?:\w+/)+README\.md), ((?:[A-Z]|\d)[^\n]{3,60})")
"""A room's README and its section, as comments cite them."""


def prose(path: Path) -> str:
    """A README without its code blocks."""
    return re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def headings(path: Path) -> list[str]:
    return re.findall(r"^#+ (.+)$", prose(path), re.MULTILINE)


def anchor(heading: str) -> str:
    """The fragment that GitHub gives a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def links(path: Path) -> list[tuple[Path, str]]:
    """Targets and fragments of a README's relative links and pictures."""
    matches = re.findall(r"\]\(([^)\s]+)\)|\bsrc=\"([^\"]+)\"", prose(path))
    targets = [link or picture for link, picture in matches if "://" not in link + picture]
    pairs = (unquote(target).partition("#") for target in targets)
    return [((path.parent / target).resolve() if target else path, fragment) for target, _, fragment in pairs]


@pytest.mark.parametrize("readme", READMES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(readme):
    lost = [
        f"{target}#{fragment}"
        for target, fragment in links(readme)
        if not target.exists() or (fragment and fragment not in map(anchor, headings(target)))
    ]
    assert not lost
    assert "@@" not in readme.read_text(encoding="utf-8")


def test_every_room_is_reached_from_the_front_page():
    """By two clicks: the front page names the rooms, and a folder stands for the README that it holds."""
    here, reached = {FRONT}, {FRONT}
    for _ in range(2):
        here = {target / "README.md" if target.is_dir() else target for page in here for target, _ in links(page)}
        here = {page for page in here if page in READMES}
        reached |= here
    assert reached == set(READMES)


def test_the_front_page_is_short_and_its_test_command_one_line():
    text = FRONT.read_text(encoding="utf-8")
    assert len(text) <= 5000
    (command,) = re.findall(r"^```sh\n(apt-get update && .+)\n```$", text, re.MULTILINE)
    assert command.endswith(' && pip install -e ".[all,test]" && pytest')


def test_the_front_pages_python_gives_what_it_shows():
    (block,) = re.findall(r"^```pycon\n(.*?)^```$", FRONT.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    example = doctest.DocTestParser().get_doctest(block, {}, "README.md", str(FRONT), 0)
    assert len(example.examples) >= 8
    with np.printoptions(legacy=False):  # colour-science, once imported, prints arrays as NumPy 1.13 did
        assert doctest.DocTestRunner().run(example).failed == 0


def test_commands_that_readmes_show_parse():
    texts = [path.read_text(encoding="utf-8").replace("\\\n", "") for path in READMES]
    shown = [line for text in texts for block in re.findall(r"^```sh\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
             for line in block.split("\n") if line.startswith("lutgen ")]  # fmt: skip
    shown += re.findall(r"`(lutgen \w[^`]*)`", FRONT.read_text(encoding="utf-8"))
    assert len(shown) > 12
    for line in shown:
        words = shlex.split(line)[1:]
        assert parser(words[:1]).parse_args(words).command == words[0]


def test_sections_that_comments_cite_exist():
    known = {str(path.relative_to(ROOT)): headings(path) for path in READMES}
    cited = [
        (path, readme, words)
        for path in TEXTS
        if path.is_file() and path != Path(__file__)
        for readme, words in CITED.findall(re.sub(r"\s*\n[\s/#]*", " ", path.read_text(encoding="utf-8")))
    ]
    assert len(cited) >= 8
    lost = [c for c in cited if not any(c[2].startswith(heading) for heading in known.get(c[1], ()))]
    assert not lost
