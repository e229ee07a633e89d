# SPDX-License-Identifier: Apache-2.0
"""One exception for each way in which recordings can fail, below one root."""


class RecordingError(Exception):
    """A recording cannot be read, written or played; the message says why."""


class BagError(RecordingError):
    """A recording, or a message of it, cannot be read or written."""


class McapDamageError(RecordingError):
    """What is wrong with a file, and where."""


class UnknownTypeError(RecordingError):
    """A message type is not installed here."""


class RecorderError(RecordingError):
    """A recording cannot begin or go on; the message says what is kept, too."""


class ReplayError(RecordingError):
    """A recording cannot be played, or the nodes do not take part."""
