"""What the tests on a virtual CAN interface share: a raw socket, processes that end with the test, checks."""

import dataclasses
import os
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time

EFF = 0x80000000
RTR = 0x40000000
_CAN_RAW_ERR_FILTER = 2  # <linux/can/raw.h>; Python has no name for it
_FRAME = struct.Struct("=IB3x8s")


@dataclasses.dataclass(frozen=True)
class Frame:
    """`can_id` with SocketCAN's flag bits; `data` in hex, all of the eight bytes that the socket carries."""

    can_id: int
    data: str = ""
    length: int = -1

    def __post_init__(self):
        if self.length < 0:
            object.__setattr__(self, "length", len(self.data) // 2)
        object.__setattr__(self, "data", self.data.upper().ljust(16, "0"))

    def payload(self):
        return bytes.fromhex(self.data)[: self.length]

    def __repr__(self):
        return f"{self.can_id:08X} [{self.length}] {self.data}"


class CanLink:
    """A raw CAN socket. `own_errors`: error frames too, as identifiers that look like them must be seen."""

    def __init__(self, interface, own_errors=False, timeout_s=5.0):
        self.socket = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        if own_errors:
            self.socket.setsockopt(socket.SOL_CAN_RAW, _CAN_RAW_ERR_FILTER, 0x1FFFFFFF)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        self.socket.settimeout(timeout_s)
        self.socket.bind((interface,))

    def send(self, frame):
        self.socket.send(_FRAME.pack(frame.can_id, frame.length, bytes.fromhex(frame.data)))

    def receive(self):
        """The next frame, or None when none comes in time."""
        try:
            can_id, length, data = _FRAME.unpack(self.socket.recv(16))
        except TimeoutError:
            return None
        return Frame(can_id, data.hex(), length)

    def drain(self, quiet_s):
        """Everything received until nothing has come for `quiet_s`."""
        before = self.socket.gettimeout()
        self.socket.settimeout(quiet_s)
        frames = []
        while (frame := self.receive()) is not None:
            frames.append(frame)
        self.socket.settimeout(before)
        return frames


class Process:
    """A program whose output goes to a file, and that does not outlive the with-block."""

    def __init__(self, *command, name=None):
        self.path = os.path.join(os.environ.get("VCAN_OUT") or tempfile.mkdtemp(),
                                 f"{name or os.path.basename(command[0])}.{time.monotonic_ns()}.txt")
        self.command = command

    def __enter__(self):
        with open(self.path, "wb") as output:
            self.process = subprocess.Popen(self.command, stdin=subprocess.DEVNULL, stdout=output,
                                            stderr=subprocess.STDOUT)
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()

    def output(self):
        with open(self.path, encoding="utf-8", errors="replace") as file:
            return file.read()

    def wait_for(self, text, timeout_s=10.0):
        end = time.monotonic() + timeout_s
        while text not in self.output():
            if time.monotonic() > end or self.process.poll() is not None and text not in self.output():
                fail(f"{self.command[0]} did not print {text!r} but: {self.output()}")
            time.sleep(0.02)

    def wait(self, timeout_s=30.0):
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            fail(f"{' '.join(self.command)} did not end in {timeout_s} s; it printed: {self.output()[-2000:]}")

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        return self.wait(10.0)


def run(*command, may_fail=False):
    subprocess.run(command, check=not may_fail, stdout=subprocess.DEVNULL)


def add_interface(name):
    run("ip", "link", "add", "dev", name, "type", "vcan")
    run("ip", "link", "set", name, "up", "mtu", "72")


_failures = 0


def check(what, got, expected):
    global _failures
    if got == expected:
        print(f"ok    {what}", flush=True)
    else:
        _failures += 1
        print(f"FAIL  {what}: got {got!r}, expected {expected!r}", flush=True)


def fail(message):
    print(f"FAIL  {message}", flush=True)
    sys.exit(1)


def finish():
    print(f"{_failures} failed" if _failures else "all passed")
    sys.exit(1 if _failures else 0)
