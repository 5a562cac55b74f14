#!/usr/bin/env python3
"""The flashed image in the emulator with nothing but a person at its console: banner, status lines, commands; then beat
frames over the serial line, garbage between them, and their effect on the counters.
"""

import argparse
import os
import random
import re
import select
import struct
import sys
import time
import zlib

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "toolchains"))
import emulator  # noqa: E402


class Console:
    def __init__(self, connection):
        self.connection = connection
        self.text = ""

    def expect(self, pattern, seconds=20):
        """The match, and everything up to it is consumed."""
        deadline = time.monotonic() + seconds
        while True:
            match = re.search(pattern, self.text)
            if match:
                self.text = self.text[match.end():]
                return match
            left = deadline - time.monotonic()
            if left <= 0 or not select.select([self.connection], [], [], left)[0]:
                sys.exit(f"no {pattern!r} within {seconds} s; the console said:\n{self.text}")
            data = self.connection.recv(65536)
            if not data:
                sys.exit(f"the emulator ended; the console said:\n{self.text}")
            self.text += data.decode("latin-1")

    def type(self, text):
        self.connection.sendall(text.encode())


def packet(sequence, samples):
    """Written from the table in hal/common/beat_link.hpp."""
    body = struct.pack("<HHI", 8192, 1, sequence) + samples
    return b"\xb5FMW" + body + struct.pack("<I", zlib.crc32(body))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--board", required=True)
    parser.add_argument("--image", required=True)
    arguments = parser.parse_args()
    noise = random.Random(1)

    def samples():
        return b"".join(struct.pack("<h", noise.randint(-200, 200)) for _ in range(4096))

    # An instruction takes about as long as on the board, however busy this machine is: no watchdog bites because of that.
    icount = 1 if arguments.board == "zcu102" else 5
    with emulator.Emulator(arguments.board, arguments.image, icount=icount) as machine:
        console = Console(machine.serial["console"])
        console.expect(r"fmcw radar \d+\.\d+\.\d+ on .*Cortex")
        console.expect(r"waveform: carrier 77000 MHz, sweep 30000 kHz, 64 chirps of 32000 ns, 64 samples")
        console.expect(r"cell: range 4996 mm, range rate 950 mm/s")
        console.expect(r"memory: rom \d+, static ram \d+, stack reserved \d+ bytes")
        console.expect(r"last run ended by: power on")
        console.expect(r"t \d+ ms failed: frame missing \+ ego stale( \+ can error)?, detections \d+, tracks \d+, warning \w[\w ]*, can \w")
        console.type("h")
        console.expect("s status, t tracks, c counters, h help")

        def frames_taken():
            """Cycles that had a frame, and those whose frame was broken."""
            console.type("c")
            figures = console.expect(r"cycles (\d+), overruns \d+, frames lost \d+ missing (\d+) invalid (\d+)")
            cycles, missing, invalid = (int(figure) for figure in figures.groups())
            return cycles - missing - invalid, invalid

        beat = machine.serial["beat"]
        frames_before, _ = frames_taken()
        good = 5
        for sequence in range(good):
            broken = bytearray(packet(1000 + sequence, samples()))
            broken[100 + sequence] ^= 0x10
            beat.sendall(noise.randbytes(700) + bytes(broken) + packet(sequence, samples()))
            deadline = time.monotonic() + 30
            while (taken := frames_taken()[0] - frames_before) <= sequence:
                if time.monotonic() > deadline:
                    sys.exit(f"frame {sequence} was not taken")
            if taken != sequence + 1:
                sys.exit(f"{taken} frames taken, {sequence + 1} good ones sent")
        print(f"{good} good frames taken, none of the broken ones; {frames_taken()[1]} cycles had only a broken one")
    return 0


if __name__ == "__main__":
    sys.exit(main())
