"""Hardware in the loop, with the ZCU102 emulator for a board: the flashed image, its CAN controller on vcan1, the bridge
between vcan1 and vcan0, its serial line a pseudo terminal, and radar_sim --hil on the other end of both.

    hil_test.py RADAR_SIM BRIDGE IMAGE EMULATOR_FOLDER
"""

import json
import os
import pty
import select
import socket
import sys
import threading
import tty

from can_link import CanLink, Frame, Process, add_interface, check, finish

RADAR_SIM, BRIDGE, IMAGE, EMULATOR_FOLDER = sys.argv[1:5]
if not os.path.exists(IMAGE):
    print(f"SKIPPED: no image {IMAGE}: cmake --preset zcu102-r5 && cmake --build --preset zcu102-r5")
    sys.exit(0)
sys.path.insert(0, EMULATOR_FOLDER)
from emulator import Emulator  # noqa: E402

OUT = os.environ["VCAN_OUT"]


class SerialCable:
    """A pseudo terminal, `device`, that carries its bytes to a socket. `damage(n)` flips a bit of the n-th byte from
    now; `cut()` lets bytes vanish for a while."""

    def __init__(self, connection):
        self.master, slave = pty.openpty()
        tty.setraw(self.master)
        self.device = os.ttyname(slave)
        self.slave = slave  # kept open, so that the terminal survives between two users
        self.connection = connection
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)  # a cable holds no frames
        self.flip_in = -1
        self.stop = False
        self.thread = threading.Thread(target=self._carry, daemon=True)
        self.thread.start()

    def _carry(self):
        while not self.stop:
            readable, _, _ = select.select([self.master], [], [], 0.2)
            if not readable:
                continue
            data = bytearray(os.read(self.master, 65536))
            if 0 <= self.flip_in < len(data):
                data[self.flip_in] ^= 0x10
            self.flip_in = -1 if self.flip_in < len(data) else self.flip_in - len(data)
            self.connection.sendall(data)

    def damage(self, in_bytes):
        self.flip_in = in_bytes


def keep_console(connection):
    with open(os.path.join(OUT, "board_console.txt"), "wb", buffering=0) as file:
        while data := connection.recv(4096):
            file.write(data)


def hil(cable, *options, name):
    summary = os.path.join(OUT, f"{name}.json")
    with Process(RADAR_SIM, "--hil", cable.device, "--can", "vcan0", "--json", summary, *options, name=name) as sim:
        code = sim.wait(90)
        print(sim.output()[-1500:], flush=True)
        return code, (json.load(open(summary, encoding="utf-8")) if code != 1 else {}), sim.output()


add_interface("vcan1")
bus = CanLink("vcan0")
with Process(BRIDGE, "vcan1", "vcan0") as bridge:
    bridge.wait_for("<->")
    with Emulator("zcu102", IMAGE, can_interface="vcan1") as board:
        threading.Thread(target=keep_console, args=(board.serial["console"],), daemon=True).start()
        cable = SerialCable(board.serial["beat"])

        first = bus.receive()
        check("the board is heard", first is not None and 0x400 <= first.can_id <= 0x430, True)

        frames = 8
        code, report, _ = hil(cable, "--lockstep", "--scenario", "four-targets", "--frames", str(frames), name="lockstep")
        check("lockstep: exit code", code, 0)
        check("lockstep: every frame processed", report.get("frames_processed"), frames)
        check("lockstep: no list different", report.get("lists_different"), 0)
        check("lockstep: objects among what was compared", report.get("can_frames", 0) > 3 * report.get("lists", 0), True)

        # The board is not restarted by hand in between: this shows that the command does it.
        cable.damage(8208 + 5000)
        code, report, _ = hil(cable, "--lockstep", "--scenario", "approach", "--frames", "3", name="damaged")
        check("a flipped bit on the line: the frame is lost", (code, report.get("frames_lost")), (2, 1))
        check("a flipped bit on the line: all else identical", report.get("lists_different"), 0)

        code, report, _ = hil(cable, "--scenario", "four-targets", "--frames", "4", name="realtime")
        check("real time: no list different", report.get("lists_different"), 0)
        check("real time: every frame processed", report.get("frames_processed"), 4)

    # The emulator is gone.
    code, _, text = hil(cable, "--lockstep", "--scenario", "approach", "--frames", "2", name="silent")
    check("no board on the bus: exit code", code, 1)
    check("no board on the bus: says so", "nothing is heard from a radar on vcan0" in text, True)

finish()
