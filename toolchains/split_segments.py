#!/usr/bin/env python3
"""Rewrites the program headers of an ELF image so that no loadable segment crosses a multiple of --bytes.

    split_segments.py --bytes 65536 radar_zcu102.elf

The Linux kernel's remoteproc driver gives each bank of the real-time processor's tightly-coupled memory, 64 KiB, a mapping
of its own and refuses a segment that lies in two. Contents and addresses stay as they are; running it twice changes nothing.
"""

import argparse
import struct
import sys

HEADER = struct.Struct("<16sHHIIIIIHHHHHH")
SEGMENT = struct.Struct("<8I")  # type, offset, vaddr, paddr, filesz, memsz, flags, align
LOAD = 1


def split(segments, size):
    pieces = []
    for kind, offset, vaddr, paddr, in_file, in_memory, flags, align in segments:
        if kind != LOAD:
            pieces.append((kind, offset, vaddr, paddr, in_file, in_memory, flags, align))
            continue
        at = 0
        while at < in_memory:
            length = min(in_memory - at, size - (paddr + at) % size)
            pieces.append((kind, offset + min(at, in_file), vaddr + at, paddr + at, max(0, min(length, in_file - at)), length,
                           flags, align))
            at += length
    return pieces


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bytes", type=int, required=True)
    parser.add_argument("image")
    arguments = parser.parse_args()
    with open(arguments.image, "rb") as file:
        data = bytearray(file.read())
    header = list(HEADER.unpack_from(data))
    if header[0][:6] != b"\x7fELF\x01\x01":
        sys.exit(f"{arguments.image}: not a little-endian 32-bit ELF file")
    table, entry_bytes, count = header[5], header[9], header[10]
    segments = [SEGMENT.unpack_from(data, table + i * entry_bytes) for i in range(count)]
    pieces = split(segments, arguments.bytes)
    if pieces == segments:
        return
    data += b"\0" * (-len(data) % 4)
    header[5], header[10] = len(data), len(pieces)
    HEADER.pack_into(data, 0, *header)
    for piece in pieces:
        data += SEGMENT.pack(*piece)
    with open(arguments.image, "r+b") as file:  # keeps its mode: it is executable
        file.write(data)
        file.truncate()


if __name__ == "__main__":
    main()
