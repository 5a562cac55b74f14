#!/usr/bin/env python3
"""Runs a board image in the emulator and ends by itself.

As a program: prints what the image writes to its console, and exits with the image's exit code (124 when the time is
up). As a module: class Emulator, whose serial lines are sockets that a test talks to.

    toolchains/emulator.py --board zcu102 build/zcu102-r5/firmware/radar_zcu102.elf --seconds 5

With --serve a serial line is offered to another program as a UNIX socket, as a serial adapter would offer it as a tty.
"""

import argparse
import json
import os
import select
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time

# Serial lines in the order of the emulator's -serial options. zcu102: UART0, UART1. mps2: UART0, UART1, UART2.
SERIAL_LINES = {
    "zcu102": ["console", "beat"],
    "mps2-an500": ["console", "can", "beat"],
    "mps2-an386": ["console", "can", "beat"],
}
TIMEOUT_EXIT_CODE = 124


class Emulator:
    """A running image. `serial[name]` is a connected socket for each name of SERIAL_LINES.

    serve: {name: path} of serial lines that another program connects to at that path, in place of `serial`.
    can_interface: SocketCAN interface to join the emulated bus to (zcu102 only).
    icount: one instruction takes 2**icount ns of virtual time; None lets virtual time follow the wall clock.
    directory: where the image's semihosting finds and leaves files.
    warp: with icount, virtual time jumps while the processor sleeps instead of waiting for the wall clock.
    """

    def __init__(self, board, image, can_interface=None, icount=None, warp=False, serve=None,
                 directory=None, extra=()):
        self.board = board
        self.working_directory = directory
        self.directory = tempfile.mkdtemp(prefix="radar_emulator_")
        self.serial = {}
        self.process = None
        self.qmp = None
        try:
            self._start(image, can_interface, icount, warp, serve or {}, list(extra))
        except BaseException:
            self.close()
            raise

    def _start(self, image, can_interface, icount, warp, serve, extra):
        if not os.path.exists(image):
            raise FileNotFoundError(f"no image {image}: build it with cmake --build --preset <board>")
        image = os.path.abspath(image)
        listeners = {}
        serial_options = []
        for name in SERIAL_LINES[self.board]:
            if name in serve:
                serial_options += ["-chardev", f"socket,id={name},path={serve[name]},server=on,wait=off",
                                   "-serial", f"chardev:{name}"]
                continue
            path = os.path.join(self.directory, name)
            listener = socket.socket(socket.AF_UNIX)
            listener.bind(path)
            listener.listen(1)
            listeners[name] = listener
            serial_options += ["-chardev", f"socket,id={name},path={path}", "-serial", f"chardev:{name}"]
        qmp_path = os.path.join(self.directory, "qmp")
        common = ["-qmp", f"unix:{qmp_path},server=on,wait=off", "-display", "none", "-monitor", "none", "-semihosting-config", "enable=on,target=native"]
        if icount is not None:
            common += ["-icount", f"shift={icount}" + (",sleep=off" if warp else "")]
        if self.board == "zcu102":
            command = ["qemu-system-aarch64", "-M", "xlnx-zcu102,canbus0=cb0,canbus1=cb0",
                       "-object", "can-bus,id=cb0", "-smp", "6", "-m", "2G",
                       "-global", "xlnx-zynqmp.boot-cpu=rpu-cpu[0]",
                       "-device", f"loader,file={image},cpu-num=4", "-S"]
            if can_interface:
                command += ["-object", f"can-host-socketcan,id=host0,if={can_interface},canbus=cb0"]
        else:
            command = ["qemu-system-arm", "-M", self.board, "-kernel", image]
        if not shutil.which(command[0]):
            raise FileNotFoundError(f"{command[0]} is not installed: apt-get install qemu-system-arm")
        # Without a sound driver named, the display port's audio looks for one and complains.
        environment = dict(os.environ, QEMU_AUDIO_DRV="none")
        self.messages = open(os.path.join(self.directory, "messages"), "w+")
        self.process = subprocess.Popen(command + common + serial_options + extra, stdin=subprocess.DEVNULL,
                                        stderr=self.messages, env=environment,
                                        cwd=self.working_directory)
        for name, listener in listeners.items():
            self.serial[name] = self._accept(listener)
        self._connect(qmp_path)
        if self.board == "zcu102":
            self._release_r5()
        threading.Thread(target=self._keep_awake, daemon=True).start()

    def _accept(self, listener):
        listener.settimeout(0.2)
        for _ in range(100):
            try:
                connection, _ = listener.accept()
                connection.setblocking(True)
                return connection
            except socket.timeout:
                if self.process.poll() is not None:
                    break
        raise RuntimeError(f"the emulator did not start (exit code {self.process.poll()}): {self.complaints()}")

    def complaints(self):
        """What the emulator has to say, other than that it has no sound."""
        self.messages.flush()
        with open(self.messages.name) as messages:
            return "".join(line for line in messages if "module audio-" not in line)

    def _connect(self, qmp_path):
        """To the emulator's control line."""
        for _ in range(400):
            if os.path.exists(qmp_path) or self.process.poll() is not None:
                break
            time.sleep(0.05)
        self.qmp = socket.socket(socket.AF_UNIX)
        self.qmp.settimeout(20)
        self.qmp.connect(qmp_path)
        self.control = self.qmp.makefile("rw")
        self.control.readline()
        self._execute("qmp_capabilities")

    def _execute(self, command, **arguments):
        self.control.write(json.dumps({"execute": command, "arguments": arguments}) + "\n")
        self.control.flush()
        while True:
            line = self.control.readline()
            if not line:
                raise RuntimeError("the emulator closed its control connection")
            answer = json.loads(line)
            if "error" in answer:
                raise RuntimeError(f"emulator: {answer['error']['desc']}")
            if "return" in answer:
                return

    def _release_r5(self):
        """Without this the emulator leaves the R5 powered off and starts the application processor."""
        for line in ("qom-set /machine/soc/rpu-cluster/rpu-cpu[0] start-powered-off false",
                     "qom-set /machine/soc/apu-cluster/apu-cpu[0] start-powered-off true",
                     "system_reset", "cont"):
            self._execute("human-monitor-command", **{"command-line": line})

    def _keep_awake(self):
        """The emulator can miss that an image has made room for received bytes, and then sleeps until something else
        happens. White space on its control line is that, and nothing more."""
        try:
            while True:
                self.qmp.sendall(b"\n")
                time.sleep(0.02)
        except OSError:
            pass  # it has ended

    def wait(self, seconds):
        """Exit code of the image, or None when it is still running after `seconds`."""
        try:
            return self.process.wait(timeout=seconds)
        except subprocess.TimeoutExpired:
            return None

    def close(self):
        if self.process and self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        for connection in [*self.serial.values(), *([self.qmp] if self.qmp else [])]:
            connection.close()
        shutil.rmtree(self.directory, ignore_errors=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def run(board, image, seconds, on_console=None, **options):
    """Runs to the end or for `seconds`. Returns (exit code or TIMEOUT_EXIT_CODE, console text)."""
    text = bytearray()
    with Emulator(board, image, **options) as emulator:
        deadline = time.monotonic() + seconds
        open_lines = dict(emulator.serial)
        while open_lines and time.monotonic() < deadline:
            readable, _, _ = select.select(list(open_lines.values()), [], [], 0.2)
            for name, connection in list(open_lines.items()):
                if connection not in readable:
                    continue
                try:
                    data = connection.recv(65536)
                except ConnectionResetError:
                    data = b""
                if not data:
                    del open_lines[name]
                elif name == "console":
                    text += data
                    if on_console:
                        on_console(data)
        code = emulator.wait(max(0.0, min(5.0, deadline - time.monotonic())))
    return (TIMEOUT_EXIT_CODE if code is None else code), text.decode("latin-1")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--board", required=True, choices=sorted(SERIAL_LINES))
    parser.add_argument("image")
    parser.add_argument("--seconds", type=float, default=10, help="end after this time (default 10)")
    parser.add_argument("--icount", type=int, help="one instruction takes 2^ICOUNT ns of virtual time")
    parser.add_argument("--warp", action="store_true", help="with --icount: skip the time the processor sleeps")
    parser.add_argument("--serve", metavar="LINE=PATH", action="append", default=[],
                        help="offer a serial line (console, beat, can) as a UNIX socket at PATH")
    parser.add_argument("--can", metavar="IFACE", help="join the emulated CAN bus to this interface (zcu102)")
    arguments = parser.parse_args()

    def show(data):
        sys.stdout.buffer.write(data)
        sys.stdout.flush()

    try:
        code, _ = run(arguments.board, arguments.image, arguments.seconds, show, icount=arguments.icount,
                      warp=arguments.warp,
                      can_interface=arguments.can, serve=dict(line.split("=", 1) for line in arguments.serve))
    except (OSError, RuntimeError) as error:
        print(f"emulator.py: {error}", file=sys.stderr)
        return 1
    if code == TIMEOUT_EXIT_CODE:
        print(f"emulator.py: stopped after {arguments.seconds} s", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
