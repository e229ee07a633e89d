# SPDX-License-Identifier: Apache-2.0
"""When the next message of a recording is played: at its time, or as fast as it is answered."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from typing import TypeAlias

# How far the player is ahead of the answers, on each topic, when it plays as fast as possible: less
# than the five messages that a subscriber with the profile of sensor data keeps.
WINDOW = 4
MOST_SILENCES = 10  # waits in vain in which nothing at all has been answered yet
PATIENCE = 1.0  # answers come sooner, on a machine that is not too busy [s]

Stamp: TypeAlias = bytes  # as it is serialised


class Pace:
    """Turns the times of a recording into waits.

    Args:
        rate: Speed; infinite for no wait.
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._begin: tuple[float, int] | None = None

    def wait_until(self, instant: int) -> None:
        """Wait until it is time for what was recorded at an instant [ns]."""
        now = time.monotonic()
        began, first = self._begin = self._begin or (now, instant)
        pause = began + 1e-9 * (instant - first) / self._rate - now
        if pause > 0.0:
            time.sleep(pause)


class Flow:
    """The inputs that wait for their answers.

    Args:
        patience: How long they wait [s].
    """

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self._changed = threading.Condition()
        self._waiting: deque[tuple[str, Stamp]] = deque()  # topic and stamp, in the order sent
        self._topics: Counter[str] = Counter()  # how many of each wait
        self._stamps: Counter[Stamp] = Counter()
        self._answered = False
        self._silences = 0

    @property
    def is_hopeless(self) -> bool:
        """Whether so many inputs found no answer, and none did, that none is to be expected."""
        return not self._answered and self._silences >= MOST_SILENCES

    def send(self, topic: str, stamp: Stamp) -> None:
        """Note an input."""
        with self._changed:
            self._waiting.append((topic, stamp))
            self._topics[topic] += 1
            self._stamps[stamp] += 1

    def answer(self, stamp: Stamp) -> None:
        """Note an output: inputs up to the one with its stamp are dealt with."""
        with self._changed:
            self._answered = True
            done = not self._stamps[stamp]
            while not done:
                topic, first = self._waiting.popleft()
                self._topics[topic] -= 1
                self._stamps[first] -= 1
                done = first == stamp
            self._changed.notify()

    def wait_for_room(self, topic: str) -> None:
        """Wait until few enough inputs of a topic are unanswered for another one."""
        self._wait(lambda: self._topics[topic] < WINDOW)

    def wait_for_all(self) -> None:
        """Wait until every input is answered."""
        self._wait(lambda: not self._waiting)

    def _wait(self, is_over: Callable[[], bool]) -> None:
        """Wait for answers; what has none in the time allowed gets none."""
        with self._changed:
            while not is_over():
                if not self._changed.wait(self._patience):
                    self._silences += 1
                    for each in (self._waiting, self._topics, self._stamps):
                        each.clear()


def stamp_of(message: bytes) -> Stamp:
    """Return the time that a serialised message begins with, if it begins with a header."""
    return message[4:12]
