# SPDX-License-Identifier: Apache-2.0
"""Decompression that ends, whatever comes out: a small file can hold terabytes of zeros.

What is allowed is far beyond what sensors yield: messages of robots shrink to a tenth, maps of
nothing but unknown cells to a thousandth.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from backports import zstd
from leg_msgs_py.recordings.errors import BagError
from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

LARGEST = 2**28  # bytes of a message, of a chunk of messages, and of all that a small file holds
MOST_GROWTH = 200  # bytes that a byte of a larger file may become
SLICE = 2**14  # bytes that are unpacked at once: what precedes a fault is kept
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"  # a message in CDR begins otherwise
DECOMPRESSORS: dict[str, Any] = {"zstd": zstd.ZstdDecompressor, "lz4": LZ4FrameDecompressor}


def most_unpacked(size: int) -> int:
    """Return how many bytes the content of a file of a size [bytes] may have in all."""
    return LARGEST + MOST_GROWTH * size


def unpack(packed: bytes, compression: str, most: int) -> tuple[bytes, str]:
    """Return the content before the first fault, and the fault.

    Args:
        packed: What is compressed.
        compression: Name of the compression; "" for none.
        most: How many bytes the content may have.
    """
    if not compression:
        return packed[:most], _excess(len(packed), most)
    if compression not in DECOMPRESSORS:
        return b"", f"has the unknown compression {compression!r}"
    decompressor, content = DECOMPRESSORS[compression](), bytearray()
    for start in range(0, len(packed), SLICE):
        piece = packed[start : start + SLICE]
        try:
            while piece or not (decompressor.needs_input or decompressor.eof):
                content += decompressor.decompress(piece, max_length=most + 1 - len(content))
                piece = b""
                if len(content) > most:
                    return bytes(memoryview(content)[:most]), _excess(len(content), most)
        except (zstd.ZstdError, RuntimeError, EOFError, MemoryError) as error:
            return bytes(content), f"cannot be decompressed: {error}"
    return bytes(content), ""


def unpack_message(data: bytes) -> bytes:
    """Return a message that may be compressed by itself, as rosbag2's message mode does.

    Raises:
        BagError: If it cannot be unpacked.
    """
    if data[:4] != ZSTD_MAGIC:
        return data
    content, fault = unpack(data, "zstd", LARGEST)
    if fault:
        raise BagError(f"a message {fault}")
    return content


def unpack_file(packed: Path, plain: Path) -> str:
    """Unpack a file (zstd) as far as it can be; return what stands against the rest, or ""."""
    room = most_unpacked(packed.stat().st_size)
    try:
        with zstd.open(packed) as source, plain.open("wb") as target:
            while piece := source.read(SLICE):
                target.write(piece[:room])
                room -= len(piece)
                if room < 0:
                    return _excess(target.tell() + 1, target.tell())
    except (zstd.ZstdError, EOFError, MemoryError):
        return ""  # cut off or corrupt: what is missing shows in the plain file
    except OSError as error:  # of a full disk
        return f"cannot be unpacked: {error.strerror}"
    return ""


def _excess(size: int, most: int) -> str:
    return f"unpacks to more than {most} bytes; what is beyond is not read" if size > most else ""
