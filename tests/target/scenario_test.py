#!/usr/bin/env python3
"""A scenario on the PC and on an emulated board: the same beat frames and the same frames from the bus must give the same
CAN frames, byte for byte. Counts instructions by stage on the way.

    scenario_test.py --board zcu102 --image replay.elf --radar-sim build/host/host_sim/radar_sim --scenario highway
"""

import argparse
import json
import os
import re
import struct
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "toolchains"))
import emulator  # noqa: E402

STAGES = ["input check", "range fft", "doppler fft", "window and power", "cfar", "peaks", "association",
          "filter", "warning", "can", "rest"]  # target::kStageNames
TO_RADAR = {0x431, 0x432}
STATUS = 0x400  # first frame of every cycle that the radar sends
FRAME_BYTES = 8192
RECORD = struct.Struct("<HBB8s")
MEMORY = struct.Struct("<4I")
EXIT_CODES = {2: "frames.bin or bus.bin missing", 3: "bus.bin ended early", 4: "cannot write", 5: "CAN frames dropped",
              6: "tracker.txt names no tracker of this image", emulator.TIMEOUT_EXIT_CODE: "not finished in time"}


def read_log(path):
    """Cycles of a candump log: ([frames to the radar], [frames from it])."""
    cycles = []
    pending = []
    for line in open(path):
        match = re.fullmatch(r"\(\d+\.\d+\) \S+ ([0-9A-F]{3})#([0-9A-F]*)( [RT])?\n?", line)
        if not match:
            sys.exit(f"{path}: not a line of candump -L: {line!r}")
        frame = (int(match.group(1), 16), bytes.fromhex(match.group(2)))
        if frame[0] in TO_RADAR:
            pending.append(frame)
            continue
        if frame[0] == STATUS:
            cycles.append((pending, []))
            pending = []
        cycles[-1][1].append(frame)
    return cycles


def write_bus(path, cycles):
    with open(path, "wb") as out:
        for received, _ in cycles:
            out.write(struct.pack("<I", len(received)))
            for identifier, data in received:
                out.write(RECORD.pack(identifier, len(data), 0, data.ljust(8, b"\0")))
        out.write(struct.pack("<I", 0))  # of the cycle in which the frames have ended


def read_sent(path):
    data = open(path, "rb").read()
    cycles, at = [], 0
    while at < len(data):
        (count,) = struct.unpack_from("<I", data, at)
        at += 4
        frames = []
        for _ in range(count):
            identifier, length, _, payload = RECORD.unpack_from(data, at)
            at += RECORD.size
            frames.append((identifier, payload[:length]))
        cycles.append(frames)
    return cycles


def show(frame):
    return "nothing" if frame is None else f"{frame[0]:03X}#{frame[1].hex().upper()}"


def first_difference(expected, got):
    for cycle in range(max(len(expected), len(got))):
        a = expected[cycle] if cycle < len(expected) else []
        b = got[cycle] if cycle < len(got) else []
        for i in range(max(len(a), len(b))):
            x = a[i] if i < len(a) else None
            y = b[i] if i < len(b) else None
            if x != y:
                return f"cycle {cycle}, frame {i}: PC {show(x)}, board {show(y)}"
    return None


def replay(board, image, frames_path, cycles, seconds, tracker=None):
    """Runs the image. Returns (sent cycles, instructions per cycle and stage, memory figures)."""
    with tempfile.TemporaryDirectory() as directory:
        os.link(frames_path, os.path.join(directory, "frames.bin"))
        write_bus(os.path.join(directory, "bus.bin"), cycles)
        if tracker:
            with open(os.path.join(directory, "tracker.txt"), "w") as out:
                out.write(tracker)
        code, text = emulator.run(board, image, seconds, icount=0, directory=directory)
        if code != 0:
            sys.exit(f"{board}: the image ended with {code} ({EXIT_CODES.get(code, 'unknown')}) {text}")
        sent = read_sent(os.path.join(directory, "sent.bin"))
        counts = open(os.path.join(directory, "instructions.bin"), "rb").read()
    row = struct.Struct(f"<{len(STAGES)}i")
    instructions = [row.unpack_from(counts, at) for at in range(0, len(counts) - MEMORY.size, row.size)]
    rom, ram, stack, stack_used = MEMORY.unpack(counts[-MEMORY.size:])
    return sent, instructions, {"stack_used": stack_used, "stack_reserved": stack}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--board", required=True, choices=sorted(emulator.SERIAL_LINES))
    parser.add_argument("--image", required=True)
    parser.add_argument("--radar-sim", required=True)
    parser.add_argument("--scenario", required=True)
    parser.add_argument("--tracker", help="as of radar_sim; the image must have it")
    parser.add_argument("--frames", type=int, help="at most this many")
    parser.add_argument("--seconds", type=float, default=280, help="give up after")
    parser.add_argument("--json", help="write the figures there")
    arguments = parser.parse_args()
    if not os.path.exists(arguments.radar_sim):
        print(f"SKIPPED: no {arguments.radar_sim}: build the preset host first")
        return 0

    with tempfile.TemporaryDirectory() as directory:
        frames_path, log_path = os.path.join(directory, "frames.bin"), os.path.join(directory, "run.log")
        command = [os.path.abspath(arguments.radar_sim), "--scenario", arguments.scenario, "--record", frames_path,
                   "--log", log_path]
        if arguments.tracker:
            command += ["--tracker", arguments.tracker]
        if arguments.frames:
            command += ["--frames", str(arguments.frames)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        cycles = read_log(log_path)
        recorded = os.path.getsize(frames_path) // FRAME_BYTES
        if recorded != len(cycles):
            sys.exit(f"{arguments.scenario}: {recorded} beat frames recorded, but {len(cycles)} cycles in the log")
        sent, instructions, memory = replay(arguments.board, arguments.image, frames_path, cycles, arguments.seconds,
                                            arguments.tracker)

    expected = [frames for _, frames in cycles]
    difference = first_difference(expected, sent)
    totals = [sum(row) for row in instructions]
    columns = list(zip(*instructions))
    result = {
        "board": arguments.board, "scenario": arguments.scenario, "tracker": arguments.tracker,
        "frames": len(cycles),
        "can_frames": sum(len(c) for c in expected), "identical": difference is None,
        "instructions": {name: {"mean": round(sum(c) / len(c)), "worst": max(c)} for name, c in zip(STAGES, columns)},
        "loop": {"mean": round(sum(totals) / len(totals)), "worst": max(totals)}, **memory,
    }
    if arguments.json:
        with open(arguments.json, "w") as out:
            json.dump(result, out, indent=1)
    name = " ".join(filter(None, (arguments.board, arguments.scenario, arguments.tracker)))
    print(f"{name}: {result['frames']} frames, {result['can_frames']} CAN frames, "
          f"{'identical' if difference is None else 'DIFFERENT'}; loop {result['loop']['mean']} instructions mean, "
          f"{result['loop']['worst']} worst; stack {memory['stack_used']} bytes")
    for name in STAGES:
        print(f"  {name:<18}{result['instructions'][name]['mean']:>10}{result['instructions'][name]['worst']:>10}")
    if difference:
        print(f"first difference: {difference}")
    return 1 if difference else 0


if __name__ == "__main__":
    sys.exit(main())
