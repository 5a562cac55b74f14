#!/usr/bin/env python3
"""How an image gets into a board, without one: OpenOCD reads the board's configuration; what it would do is written down by
a fake (fake_openocd.tcl) and checked against the manual's order; what it says when no adapter is there. For the ZCU102 also
the image as Linux loads it and toolchains/remoteproc.sh on a fake sysfs, for the MPS2 toolchains/mps2_card.sh.

    flash_test.py --board zcu102 --image radar_zcu102.elf
"""

import argparse
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
import time

HERE = os.path.dirname(os.path.abspath(__file__))
TOOLCHAINS = os.path.normpath(os.path.join(HERE, "..", "..", "toolchains"))
LOAD = 1


def run(*command, **environment):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60,
                          env=dict(os.environ, **environment))
    return done.returncode, done.stdout


def check(what, ok, text=""):
    print(f"{'ok   ' if ok else 'FAIL '} {what}", flush=True)
    if not ok:
        sys.exit(text)


def tool(name):
    return os.path.join(TOOLCHAINS, name)


def fake_load(config, image):
    """What OpenOCD would do to the board."""
    code, text = run("openocd", "-f", config, "-f", os.path.join(HERE, "fake_openocd.tcl"), "-c", f"flash_radar {{{image}}}")
    check("the load sequence runs to its end", code == 0 and "radar started" in text, text)
    return [line[3:].split() for line in text.splitlines() if line.startswith("do ")]


def check_zcu102_sequence(steps):
    """Bits as the register reference UG1087 names them."""
    in_reset, halted, running_clock, lockstep = True, False, False, False
    held = {"0xFF9A0100": False, "0xFF9A0200": False}
    loaded = cleared = False
    for step in steps:
        if step[0] == "load":
            check("loaded into the combined memories, while halted and out of reset",
                  step[1] == "0xFFE00000" and not in_reset and halted and running_clock and lockstep and cleared, str(steps))
            loaded = True
        if step[0] != "write":
            continue
        address, value, count = step[1], int(step[2], 16), int(step[3])
        if address == "0xFF5E023C":
            in_reset = value & 0x7 != 0
            check("other resets untouched", value & ~0x7 == 0x00188FD8, str(step))
        elif address == "0xFF9A0000":
            check("lockstep is chosen in reset", in_reset)
            lockstep = value & 0x58 == 0x50
        elif address in held:
            held[address] = value & 1 == 0
            check("vectors at 0", value & 4 == 0, str(step))
            halted = all(held.values())
            check("runs only when loaded", held[address] or loaded, str(steps))
        elif address == "0xFF5E0090":
            running_clock = value & 0x01000000 != 0
        elif address == "0xFFE00000":
            check("all 256 KiB cleared, while the memories answer", count * 4 == 0x40000 and not in_reset and halted)
            cleared = True
    check("both cores run at the end", loaded and not any(held.values()), str(steps))


def check_mps2_sequence(steps):
    check("reset, load, verify, run", [" ".join(step) for step in steps] ==
          ["init", "reset halt", "load 0x00000000 elf", "verify 0x00000000 elf", "reset run"], str(steps))


def segments(image):
    data = open(image, "rb").read()
    table, = struct.unpack_from("<I", data, 28)
    size, count = struct.unpack_from("<2H", data, 42)
    return [s for i in range(count) if (s := struct.unpack_from("<8I", data, table + i * size))[0] == LOAD]


def check_banks(image):
    """The rule of the kernel's driver: a segment lies in one of four banks of 64 KiB; in file and in memory at the same place."""
    loadable = segments(image)
    check("the image has a segment of ROM and one of RAM", len(loadable) >= 2)
    for _, _, virtual, physical, in_file, in_memory, _, _ in loadable:
        first, last = physical // 0x10000, (physical + in_memory - 1) // 0x10000
        check(f"segment at 0x{physical:05X}, {in_memory} bytes, in one bank of the tightly-coupled memory", first == last < 4)
        check("nothing is loaded where it does not run", virtual == physical or in_file > 0)
    with tempfile.TemporaryDirectory() as directory:
        # The whole ROM by objcopy, which goes by sections, is what the segments say.
        binary = os.path.join(directory, "image.bin")
        subprocess.run(["arm-none-eabi-objcopy", "-O", "binary", image, binary], check=True)
        rom, data = open(binary, "rb").read(), open(image, "rb").read()
        for _, offset, _, physical, in_file, _, _, _ in loadable:
            if data[offset:offset + in_file] != rom[physical:physical + in_file]:
                check("segments hold what sections hold", False, f"differs at 0x{physical:05X}")


class FakeProcessor:
    """A processor in a sysfs of files: what the kernel does when somebody writes to `state`."""

    def __init__(self, root, name="ffe00000.r5f", number=0, refuses=False):
        self.folder = os.path.join(root, f"remoteproc{number}")
        os.makedirs(self.folder)
        self.refuses, self.starts, self.stop = refuses, 0, False
        for file, text in (("name", name), ("state", "offline"), ("firmware", "(null)")):
            self.write(file, text)
        self.thread = threading.Thread(target=self.live, daemon=True)
        self.thread.start()

    def end(self):
        self.stop = True
        self.thread.join()

    def write(self, file, text):
        with open(os.path.join(self.folder, file), "w") as out:
            out.write(text + "\n")

    def read(self, file):
        with open(os.path.join(self.folder, file)) as source:
            return source.read().strip()

    def live(self):
        running = False
        while not self.stop:
            word = self.read("state")
            if word in ("start", "stop"):
                if word == "start":
                    self.starts += 1
                running = word == "start" and not self.refuses
                self.write("state", "running" if running else "offline")
            time.sleep(0.01)


def check_remoteproc(image):
    script = tool("remoteproc.sh")
    with tempfile.TemporaryDirectory() as root:
        sysfs, firmware = os.path.join(root, "sysfs"), os.path.join(root, "firmware")
        os.makedirs(sysfs)
        os.makedirs(firmware)
        options = (script, "--sysfs", sysfs, "--firmware", firmware)
        code, text = run(*options, "start", image)
        check("no processor: names the kernel option", code == 1 and "CONFIG_XLNX_R5_REMOTEPROC" in text, text)
        other = FakeProcessor(sysfs, name="some-dsp", number=3)
        processor = FakeProcessor(sysfs)
        code, text = run(*options, "start", image)
        check("start", code == 0 and text == "remoteproc0: running\n" and processor.read("state") == "running", text)
        check("the firmware is where the kernel looks", processor.read("firmware") == "radar_zcu102.elf" and
              open(os.path.join(firmware, "radar_zcu102.elf"), "rb").read() == open(image, "rb").read())
        code, text = run(*options, "start", image)
        check("start again: stops it first", code == 0 and processor.starts == 2, text)
        code, text = run(*options, "status")
        check("status", code == 0 and text == "remoteproc0 (ffe00000.r5f): running, firmware radar_zcu102.elf\n", text)
        code, text = run(*options, "stop")
        check("stop", code == 0 and processor.read("state") == "offline" and other.starts == 0, text)
        processor.refuses = True
        code, text = run(*options, "start", image)
        check("the kernel refuses it: says where to look", code == 1 and "dmesg" in text, text)
        code, text = run(*options, "start", image + ".gone")
        check("no image: says how to build it", code == 1 and "cmake --build" in text, text)
        second = FakeProcessor(sysfs, name="ffe90000.r5f", number=1)
        code, text = run(*options, "start", image)
        check("split processors: names the lockstep", code == 1 and "xlnx,cluster-mode" in text, text)
        code, text = run(script, "begin")
        check("unknown action: usage", code == 1 and "usage:" in text, text)
        for p in (other, processor, second):
            p.end()


def check_card(image):
    script = tool("mps2_card.sh")
    with tempfile.TemporaryDirectory() as card:
        code, text = run(script, "an500", image, card)
        check("not the board's drive: says so", code == 1 and "HBI0263" in text, text)
        board = os.path.join(card, "MB", "HBI0263C")
        os.makedirs(os.path.join(board, "AN500"))
        code, text = run(script, "an386", image, card)
        check("no FPGA image: names it", code == 1 and "AN386" in text, text)
        with open(os.path.join(board, "board.txt"), "w", newline="") as file:
            file.write("BOARD: HBI0263\r\n[APPLICATION NOTE]\r\nAPPFILE: AN385\\an385_v2.txt ;which\r\n;APPFILE: AN1\\x.txt\r\n")
        for name in ("an500_v1.txt", "images.txt"):
            with open(os.path.join(board, "AN500", name), "w") as file:
                file.write("before\n")
        code, text = run(script, "an500", image, card)
        check("an image on the card", code == 0 and "reset button" in text, text)
        check("under a name of 8.3 characters", open(os.path.join(card, "SOFTWARE", "RADAR.AXF"), "rb").read() ==
              open(image, "rb").read())
        images = open(os.path.join(board, "AN500", "images.txt"), newline="").read()
        check("images.txt names it", "IMAGE0ADDRESS: 0x00000000\r\nIMAGE0FILE: \\SOFTWARE\\RADAR.AXF\r\n" in images, images)
        text = open(os.path.join(board, "board.txt"), newline="").read()
        check("board.txt names the FPGA image, all else kept", text == "BOARD: HBI0263\r\n[APPLICATION NOTE]\r\n"
              "APPFILE: AN500\\an500_v1.txt ;which\r\n;APPFILE: AN1\\x.txt\r\n", text)
        check("what was there is kept", os.path.exists(os.path.join(board, "board.bak")) and
              os.path.exists(os.path.join(board, "AN500", "images.bak")))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--board", required=True, choices=["zcu102", "mps2"])
    parser.add_argument("--image", required=True)
    arguments = parser.parse_args()
    image = os.path.abspath(arguments.image)
    if arguments.board == "zcu102":
        check_banks(image)
        check_remoteproc(image)
    else:
        check_card(image)

    code, text = run(tool("flash.sh"), arguments.board, image + ".gone")
    check("no image: says so", code == 1 and "no image" in text, text)
    with tempfile.TemporaryDirectory() as empty:
        for program in ("bash", "dirname"):
            os.symlink(shutil.which(program), os.path.join(empty, program))
        code, text = run(tool("flash.sh"), arguments.board, image, PATH=empty)
    check("no OpenOCD: says what to install", code == 1 and "apt-get install openocd" in text, text)
    if not shutil.which("openocd"):
        print("SKIPPED: no openocd: apt-get install openocd")
        return
    config = os.path.join(TOOLCHAINS, "openocd", f"{arguments.board}.cfg")
    code, text = run("openocd", "-f", config, "-c", "shutdown")
    check("OpenOCD reads the configuration", code == 0 and "Error" not in text, text)
    steps = fake_load(config, image)
    (check_zcu102_sequence if arguments.board == "zcu102" else check_mps2_sequence)(steps)
    if not os.path.isdir("/dev/bus/usb") or not os.listdir("/dev/bus/usb"):  # else a board may be there
        code, text = run(tool("flash.sh"), arguments.board, image)
        check("no board: says what to connect", code == 1 and f"no {arguments.board} found: USB connector" in text, text)


if __name__ == "__main__":
    main()
