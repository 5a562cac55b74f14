"""The MPS2 board's CAN end to end: the flashed image in the emulator, its CAN UART attached by slcand of can-utils as the
interface slcan0, and there candump, radar_monitor and cansend.

    slcan_test.py RADAR_MONITOR RADAR_DBC IMAGE EMULATOR_FOLDER
"""

import json
import os
import socket
import subprocess
import sys
import threading
import time

from can_link import CanLink, Process, check, finish, run
from dbc import Dbc
from serial_cable import SerialCable

RADAR_MONITOR, DBC_PATH, IMAGE, EMULATOR_FOLDER = sys.argv[1:5]
if not os.path.exists(IMAGE):
    print(f"SKIPPED: no image {IMAGE}: cmake --preset mps2-an500 && cmake --build --preset mps2-an500")
    sys.exit(0)
sys.path.insert(0, EMULATOR_FOLDER)
from emulator import Emulator  # noqa: E402

DBC = Dbc(DBC_PATH)
OUT, TMP = os.environ["VCAN_OUT"], os.environ["TMPDIR"]
EGO_STALE = 0x100
SET_CFAR_SCALE, APPLIED = 2, 1
STARTED = time.monotonic()


def keep(connection, name):
    with open(os.path.join(OUT, name), "wb", buffering=0) as file:
        try:
            while data := connection.recv(4096):
                file.write(data)
        except OSError:
            pass


def cansend(name, counter, **signals):
    can_id, payload = DBC.encode(name, counter, **signals)
    run("cansend", "slcan0", f"{can_id:03X}#{payload.hex().upper()}")


def network_interfaces():
    return {name for _, name in socket.if_nameindex()}


class Bus:
    def __init__(self):
        self.link = CanLink("slcan0", timeout_s=1.0)

    def next(self, name, within_s=15.0, where=lambda values: True):
        """The next message of this name that is whole and satisfies the condition; else None."""
        end = time.monotonic() + within_s
        while time.monotonic() < end:
            frame = self.link.receive()
            if frame is None or frame.can_id != DBC.messages[name][0]:
                continue
            values = DBC.decode(name, frame.payload())
            if values is not None and where(values):
                return values
        return None


# An instruction takes about as long as on the board, however busy this machine is: no watchdog bites because of that.
with Emulator("mps2-an500", IMAGE, icount=5) as board:
    threading.Thread(target=keep, args=(board.serial["console"], "board_console.txt"), daemon=True).start()
    can_line = SerialCable(board.serial["can"])
    # Told a name, slcand of Debian 12 fails to give it on kernels whose interface is called can0.
    interfaces = network_interfaces()
    with Process("slcand", "-F", "-o", "-c", "-s6", "-S", "1000000", can_line.device) as daemon:
        for _ in range(200):
            if names := network_interfaces() - interfaces:
                break
            time.sleep(0.1)
        else:
            print(f"SKIPPED: slcand's interface is not in this network namespace, but in the machine's: {daemon.output()}")
            sys.exit(0)
        run("ip", "link", "set", names.pop(), "name", "slcan0")
        run("ip", "link", "set", "slcan0", "up")
        bus = Bus()
        check("the board is heard", bus.next("RadarStatus") is not None, True)
        check("it misses the car's motion", bus.next("RadarStatus", where=lambda v: v["Faults"] & EGO_STALE) is not None, True)
        print(f"--    heard after {time.monotonic() - STARTED:.1f} s", flush=True)

        with open(os.path.join(TMP, "candump.log"), "wb") as log:
            dump = subprocess.Popen(["stdbuf", "-oL", "candump", "-L", "slcan0"], stdout=log)
        with Process(RADAR_MONITOR, "slcan0", "--frames", "40", "--json", os.path.join(OUT, "monitor.json"),
                     name="monitor") as monitor:
            monitor.wait_for("listening")
            # candump says nothing before it hears something: the board, ten times a second.
            end = time.monotonic() + 20
            while os.path.getsize(os.path.join(TMP, "candump.log")) == 0 and time.monotonic() < end:
                time.sleep(0.02)
            cansend("EgoMotion", 0, Speed=2000, Valid=1)
            heard = bus.next("RadarStatus", where=lambda v: not v["Faults"] & EGO_STALE)
            check("cansend of ego motion: the fault is gone", heard is not None, True)
            cansend("Command", 0, Code=SET_CFAR_SCALE, Sequence=17, Value=150)
            echo = bus.next("CommandEcho")
            check("cansend of a command: applied",
                  echo and (echo["Code"], echo["Result"], echo["Sequence"], echo["ValueInForce"]),
                  (SET_CFAR_SCALE, APPLIED, 17, 150))
            monitor.wait(90)
        dump.terminate()
        dump.wait()
        with open(os.path.join(OUT, "monitor.json"), encoding="utf-8") as file:
            summary = json.load(file)
        check("radar_monitor decodes lists", summary["lists"]["whole"] >= 10, True)
        errors = {what: n for what, n in summary["errors"].items() if n and what not in ("total", "overdue")}
        check("radar_monitor finds no error", errors, {})
        with open(os.path.join(TMP, "candump.log"), encoding="ascii") as file:
            dumped = file.read()
        check("candump sees both directions", (dumped.count(" 400#") >= 10, dumped.count(" 431#")), (True, 1))

print(f"--    {time.monotonic() - STARTED:.1f} s in all")
finish()
