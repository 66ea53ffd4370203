"""Code blocks of Markdown pages, and the folder that their commands run in."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    path for path in (ROOT / "docs").rglob("*.md") if not {"_build", "ci-recipe"} & {*path.parts}
)
_FENCE = re.compile(r"^( *)```([^\n`]*)\n(.*?)^\1```$", flags=re.MULTILINE | re.DOTALL)
_NAME = re.compile(r"# ([\w-]+\.yaml)\n")
# Commands that need no run of their own: `.ci/run`, the build and other tests do them.
ELSEWHERE = (
    "python -m pip install",
    "python -m venv",
    "python -m pytest",
    "python -m sphinx",
    "pre-commit install",
    "ruff check .",
)


@dataclass(frozen=True)
class Block:
    """A fenced block: its language and its text."""

    language: str
    text: str

    @property
    def file(self) -> str | None:
        """The file that a YAML block is to be saved as: its first line says so in a comment."""
        named = _NAME.match(self.text) if self.language == "yaml" else None
        return named and named.group(1)

    @property
    def commands(self) -> list[str]:
        """The commands of a shell block; also what follows an `&&`."""
        lines = [part.strip() for part in re.split(r"\n|&&", self.text)]
        return [line for line in lines if line] if self.language == "sh" else []


def blocks(page):
    """All fenced blocks of a page, in order."""
    text = page.read_text(encoding="utf-8")
    return [Block(language.strip(), inner) for _, language, inner in _FENCE.findall(text)]


def words(command):
    """The arguments of an `ffd` command, and the exit status that a comment on it states."""
    arguments = shlex.split(command, comments=True)[1:]
    stated = re.search(r"# exit status (\d+)$", command)
    return arguments, int(stated.group(1)) if stated else 0
