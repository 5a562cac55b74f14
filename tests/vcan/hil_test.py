"""Hardware in the loop, with the ZCU102 emulator for a board: the flashed image, its CAN controller on vcan1, the bridge
between vcan1 and vcan0, its serial line a pseudo terminal, and radar_sim --hil on the other end of both.

    hil_test.py RADAR_SIM BRIDGE IMAGE EMULATOR_FOLDER

A beat frame takes an emulator within an emulator about a second, byte by byte, so there are few of them.
"""

import json
import os
import sys
import threading
import time

from can_link import CanLink, Frame, Process, add_interface, check, finish
from serial_cable import SerialCable

RADAR_SIM, BRIDGE, IMAGE, EMULATOR_FOLDER = sys.argv[1:5]
if not os.path.exists(IMAGE):
    print(f"SKIPPED: no image {IMAGE}: cmake --preset zcu102-r5 && cmake --build --preset zcu102-r5")
    sys.exit(0)
sys.path.insert(0, EMULATOR_FOLDER)
from emulator import Emulator  # noqa: E402

OUT = os.environ["VCAN_OUT"]
COMMAND_ECHO, OBJECT = 0x403, 0x411
STARTED = time.monotonic()


def keep_console(connection):
    with open(os.path.join(OUT, "board_console.txt"), "wb", buffering=0) as file:
        try:
            while data := connection.recv(4096):
                file.write(data)
        except OSError:
            pass


def hil(device, *options, name, patience=100, meanwhile=None):
    """Exit code, summary and output of radar_sim --hil. `patience`: short only where nothing is to come."""
    summary = os.path.join(OUT, f"{name}.json")
    begin = time.monotonic()
    with Process(RADAR_SIM, "--hil", device, "--can", "vcan0", "--json", summary, "--patience", str(patience), *options,
                 name=name) as sim:
        if meanwhile:
            meanwhile(sim)
        code = sim.wait(250)
        print(f"--    {name}: {time.monotonic() - begin:.1f} s\n{sim.output()[-1200:]}", flush=True)
        return code, (json.load(open(summary, encoding="utf-8")) if code != 1 else {}), sim.output()


def send_stray_frame(_):
    """An object that the board did not send, once it has answered the command that begins a run."""
    bus.drain(0.0001)
    while (frame := bus.receive()) is not None and frame.can_id != COMMAND_ECHO:
        pass
    bus.send(Frame(OBJECT, "0102030405060708"))


def switch_board_off(sim):
    sim.wait_for(" lists, ", timeout_s=60)  # the comparison is under way
    board.close()


add_interface("vcan1")
bus = CanLink("vcan0", timeout_s=30)
with Process(BRIDGE, "vcan1", "vcan0") as bridge:
    bridge.wait_for("<->")
    # The image polls and never sleeps. As a batch job, the emulator's thread that moves the bytes does not take the processor
    # from it for each single one: three times as fast on a busy machine.
    os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
    with Emulator("zcu102", IMAGE, can_interface="vcan1") as board:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        threading.Thread(target=keep_console, args=(board.serial["console"],), daemon=True).start()
        cable = SerialCable(board.serial["beat"])

        first = bus.receive()
        check("the board is heard", first is not None and 0x400 <= first.can_id <= 0x430, True)
        print(f"--    heard after {time.monotonic() - STARTED:.1f} s", flush=True)

        frames = 6
        code, report, text = hil(cable.device, "--lockstep", "--scenario", "four-targets", "--frames", str(frames),
                                 name="lockstep")
        check("lockstep: exit code and verdict", (code, "verdict        identical" in text), (0, True))
        check("lockstep: every frame processed", report.get("frames_processed"), frames)
        check("lockstep: no list different", report.get("lists_different"), 0)
        check("lockstep: objects among what was compared", report.get("can_frames", 0) > 3 * report.get("lists", 0), True)
        latency = report.get("latency_ms", {})
        check("lockstep: latencies", 0 < latency.get("min", 0) <= latency["mean"] <= latency["p99"] <= latency["max"], True)

        # The board is not restarted by hand in between: this shows that the command does it.
        cable.fault = "flip"
        code, report, text = hil(cable.device, "--lockstep", "--scenario", "approach", "--frames", "2", name="flipped")
        check("a flipped bit on the line: the frame is lost", (code, report.get("frames_lost")), (2, 1))
        check("a flipped bit on the line: all else identical",
              (report.get("lists_different"), "FRAMES LOST, all else identical" in text), (0, True))

        cable.fault = "blank"
        code, report, text = hil(cable.device, "--lockstep", "--scenario", "approach", "--frames", "1", name="blank")
        check("the board computes with other samples: different",
              (code, report.get("lists_different", 0) > 0, "verdict        DIFFERENT" in text), (2, True, True))

        code, report, text = hil(cable.device, "--scenario", "four-targets", "--frames", "3", name="realtime")
        check("real time: no list different", report.get("lists_different"), 0)
        # An emulator slower than time may find two frames waiting: it then takes the newer one.
        check("real time: frames processed", report.get("frames_processed", 0) > 0, True)
        check("real time: the exit code says whether all were", code, 2 if report.get("frames_lost") else 0)

        code, report, text = hil(cable.device, "--lockstep", "--scenario", "approach", "--frames", "1", name="stray",
                                 meanwhile=send_stray_frame)
        check("a frame on the bus that the PC would not have sent: different",
              (code, report.get("lists_different", 0) > 0, "0102030405060708" in text), (2, True, True))

        cable.fault = "cut"
        code, report, text = hil(cable.device, "--lockstep", "--scenario", "approach", "--frames", "1", name="cut", patience=3)
        check("a cut serial line: says so", (code, "no beat frame reached the board" in text), (2, True))
        cable.fault = "stuck"  # the terminal holds one frame and a half
        code, _, text = hil(cable.device, "--lockstep", "--scenario", "approach", "--frames", "3", name="stuck", patience=3)
        check("a serial line that takes nothing: says so", (code, "the board takes no bytes" in text), (1, True))
        cable.fault = "cut"

        code, _, text = hil("/dev/no-such-line", "--scenario", "approach", "--frames", "1", name="no_line")
        check("no serial line: says so", (code, "is the board plugged in?" in text), (1, True))

        code, _, text = hil(cable.device, "--scenario", "approach", "--frames", "200", name="dies", patience=5,
                            meanwhile=switch_board_off)
        check("the board dies during a run: says so", (code, "the board fell silent" in text), (2, True))

    code, _, text = hil(cable.device, "--lockstep", "--scenario", "approach", "--frames", "1", name="absent", patience=3)
    check("no board on the bus: says so", (code, "nothing is heard from a radar on vcan0" in text), (1, True))

print(f"--    {time.monotonic() - STARTED:.1f} s in all")
finish()
