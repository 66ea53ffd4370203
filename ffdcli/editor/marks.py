"""Where the values of YAML text stand in it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import yaml
from yaml import events

# Line breaks of YAML 1.1, by which its parser counts lines.
_BREAK = re.compile("\r\n|[\n\r\x85\u2028\u2029]")
# A dash before an item, with comments and line breaks between the two.
_DASH = re.compile(r"-(?=(?:[ \t]*(?:#[^\r\n]*)?[\r\n]+)*[ \t]*\Z)")
_COMMENT_LINE = re.compile(r"[ \t]*(#)[^\r\n]*(?:\r\n|[\r\n]|\Z)")
_COMMENT = re.compile(r"(?:(?<=\s)|\A)#[^\r\n]*")


@dataclass(frozen=True)
class Node:
    """A value in text.

    Parameters
    ----------
    kind : {"list", "mapping", "word", "alias"}
    start, end : int
        Positions of its first character, and after its last one.
    flow : bool
        Whether it is written in brackets.
    items : sequence of Node
        Of a list.
    keys, values : mapping of str to Node
        Of a mapping.
    """

    kind: Literal["list", "mapping", "word", "alias"]
    start: int
    end: int
    flow: bool = False
    items: Sequence[Node] = ()
    keys: dict[str, Node] = field(default_factory=dict)
    values: dict[str, Node] = field(default_factory=dict)

    def get(self, key: str) -> Node | None:
        """The value of a key of a mapping."""
        return self.values.get(key)

    @property
    def aliased(self) -> bool:
        """Whether an alias stands in it."""
        inside = (*self.items, *self.values.values())
        return self.kind == "alias" or any(each.aliased for each in inside)


def read_marks(text: str) -> Node:
    """The positions of the values of the only document of YAML text, which is valid."""
    where = Text(text)
    stream = yaml.parse(text, Loader=yaml.CSafeLoader)
    for event in stream:
        if isinstance(event, events.NodeEvent):
            return _node(event, stream, where)
    raise ValueError("the text holds no value")


def _node(event: events.NodeEvent, stream: Iterator[Any], where: Text) -> Node:
    start, end = (where.position(mark) for mark in (event.start_mark, event.end_mark))
    if isinstance(event, events.AliasEvent):
        return Node("alias", start, end)
    if isinstance(event, events.ScalarEvent):
        return Node("word", start, end)
    flow = bool(event.flow_style)
    items: list[Node] = []
    keys: dict[str, Node] = {}
    values: dict[str, Node] = {}
    if isinstance(event, events.SequenceStartEvent):
        for each in stream:
            if isinstance(each, events.SequenceEndEvent):
                break
            items.append(_node(each, stream, where))
            end = items[-1].end
    else:
        for each in stream:
            if isinstance(each, events.MappingEndEvent):
                break
            key = each.value
            keys[key] = _node(each, stream, where)
            values[key] = _node(next(stream), stream, where)
            end = values[key].end
    # A list or mapping without brackets ends where its last value does.
    end = where.position(each.end_mark) if flow else end
    kind: Literal["list", "mapping"] = "mapping" if keys else "list"
    if isinstance(event, events.MappingStartEvent):
        kind = "mapping"
    return Node(kind, start, end, flow, items, keys, values)


@dataclass(frozen=True)
class Text:
    """Text with the positions of its lines."""

    text: str

    @cached_property
    def lines(self) -> list[int]:
        """Position of the first character of each line."""
        return [0, *(found.end() for found in _BREAK.finditer(self.text))]

    @cached_property
    def line_break(self) -> str:
        """The line break of the text."""
        found = _BREAK.search(self.text)
        return found[0] if found else "\n"

    def position(self, mark: Any) -> int:
        """Position of a mark of the parser."""
        return int(self.lines[mark.line] + mark.column)

    def column(self, position: int) -> int:
        """Number of characters before a position in its line."""
        return position - self.line_start(position)

    def line_start(self, position: int) -> int:
        """Position of the first character of the line of a position."""
        at = position
        while at and self.text[at - 1] not in "\r\n\x85\u2028\u2029":
            at -= 1
        return at

    def line_end(self, position: int) -> int:
        """Position after the line, with its break, that a value before ``position`` ends on."""
        if position and position == self.line_start(position) and self.text[position - 1] in "\r\n":
            return position
        found = _BREAK.search(self.text, position)
        return found.end() if found else len(self.text)

    def over_comments(self, position: int, column: int) -> int:
        """Position after lines of comments alone that begin further in than a column."""
        while found := _COMMENT_LINE.match(self.text, position):
            if found.start(1) - position <= column:
                break
            position = found.end()
        return position

    def back_over_spaces(self, position: int) -> int:
        """Position after the last character that is no space, before a position in its line."""
        while position and self.text[position - 1] in " \t":
            position -= 1
        return position

    def after(self, position: int, lines: Sequence[str]) -> str:
        """Whole lines to put at the beginning of a line, or behind text without a last break."""
        put = "".join(line + self.line_break for line in lines)
        open_end = position and self.text[position - 1] not in "\r\n\x85\u2028\u2029"
        return self.line_break + put if open_end and put else put

    def dashes(self, value: Node) -> list[int]:
        """Positions of the dashes before the items of a list without brackets."""
        found, done = [], value.start
        for item in value.items:
            # The list itself begins at its first dash, or at an anchor before it.
            inside = self.text[done : item.start]
            *_, dash = _DASH.finditer(inside)
            found.append(done + dash.start())
            done = item.end
        return found

    def comments(self, value: Node) -> list[str]:
        """The comments between the items of a list in brackets."""
        found, done = [], value.start
        for end in (*(item.start for item in value.items), value.end):
            found += _COMMENT.findall(self.text[done:end])
            done = next((item.end for item in value.items if item.start == end), end)
        return found
