# SPDX-License-Identifier: Apache-2.0
"""YAML whose reading cannot take long or much memory, whoever wrote it.

A few lines can stand for gigabytes, by aliases of aliases, and a file may be of any size or depth.
"""

from __future__ import annotations

from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer, ComposerError
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import AliasEvent, ScalarEvent
from ruamel.yaml.scanner import RoundTripScanner

# Bounds of a document, with every alias written out; the parser takes 0.1 ms for a value.
MOST_CHARACTERS = 2**16
MOST_VALUES = 3000  # mappings, lists, keys and what they hold
MOST_LEVELS = 20


def load_yaml(text: str) -> Any:
    """Return the content of a YAML document, which knows its lines; duplicate keys are errors.

    Raises:
        YAMLError: If it is not YAML, or beyond the bounds.
        Exception: Of other types, if a value is not what its tag or form promises, such as a date.
    """
    if len(text) > MOST_CHARACTERS:
        raise YAMLError(f"{len(text)} characters; allowed: at most {MOST_CHARACTERS}")
    yaml = YAML(typ="rt")
    yaml.Scanner, yaml.Composer = _BoundedScanner, _BoundedComposer
    return yaml.load(text)


class _BoundedScanner(RoundTripScanner):  # type: ignore[misc]
    """Finds brackets that are too deep before it looks for the ends of all of them."""

    def fetch_flow_collection_start(self, *arguments: Any, **keywords: Any) -> None:
        if self.flow_level > MOST_LEVELS:
            raise _too_deep(self.reader.get_mark())
        super().fetch_flow_collection_start(*arguments, **keywords)


class _BoundedComposer(Composer):  # type: ignore[misc]
    """Makes a tree of what is parsed, and stops where it gets too large or too deep."""

    def __init__(self, loader: Any = None) -> None:
        super().__init__(loader)
        self._values = self._characters = self._level = 0
        self._anchored: dict[str, tuple[int, int]] = {}  # values and characters that it holds

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.parser.peek_event()
        if isinstance(event, AliasEvent):
            if event.anchor in self.anchors:
                self._count_alias(event)
            return super().compose_node(parent, index)
        values, characters = self._values, self._characters
        self._anchored.pop(event.anchor, None)
        self._count(event, 1, len(event.value) if isinstance(event, ScalarEvent) else 0)
        self._level += 1
        if self._level > MOST_LEVELS:
            raise _too_deep(event.start_mark)
        node = super().compose_node(parent, index)
        self._level -= 1
        if event.anchor is not None:
            self._anchored[event.anchor] = (self._values - values, self._characters - characters)
        return node

    def _count_alias(self, event: Any) -> None:
        if event.anchor not in self._anchored:
            problem = f"the alias {event.anchor!r} stands within its own meaning"
            raise _refusal(event.start_mark, problem)
        self._count(event, *self._anchored[event.anchor])

    def _count(self, event: Any, values: int, characters: int) -> None:
        self._values += values
        self._characters += characters
        for count, what, most in (
            (self._values, "values", MOST_VALUES),
            (self._characters, "characters", MOST_CHARACTERS),
        ):
            if count > most:
                problem = f"{count} {what}, with aliases written out; allowed: at most {most}"
                raise _refusal(event.start_mark, problem)


def _too_deep(mark: Any) -> ComposerError:
    return _refusal(mark, f"lies deeper than {MOST_LEVELS} levels")


def _refusal(mark: Any, problem: str) -> ComposerError:
    return ComposerError(None, None, problem, mark)
