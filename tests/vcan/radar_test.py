"""radar_sim and radar_monitor on a real vcan0, beside can-utils: candump, cansend, cangen, and ip and tc on the interface.

    radar_test.py RADAR_SIM RADAR_MONITOR RADAR_DBC
"""

import contextlib
import json
import os
import shutil
import subprocess
import sys
import time

from can_link import CanLink, Process, check, finish, run
from dbc import Dbc

RADAR_SIM, RADAR_MONITOR = sys.argv[1:3]
DBC = Dbc(sys.argv[3])
OUT = os.environ["VCAN_OUT"]

STATUS, ECHO, EGO, COMMAND = 0x400, 0x403, 0x431, 0x432
APPLIED, UNKNOWN_COMMAND, OUT_OF_RANGE = 1, 2, 3
SET_CFAR_SCALE, RESTART = 2, 5
MARKER = "7FF#00"
EGO_STALE, CAN_ERROR = 0x100, 0x200


def path(name):
    return os.path.join(OUT, name)


def load(name):
    with open(path(name), encoding="utf-8") as file:
        return json.load(file)


def log_lines(name):
    """The frames of a candump log, as text, in order."""
    with open(path(name), encoding="ascii") as file:
        return [line.split()[2] for line in file if line.endswith("\n")]


def radar(*options, name):
    return Process(RADAR_SIM, "--can", "vcan0", "--quiet", "--json", path(f"{name}.json"), *options, name=name)


def cansend(text):
    run("cansend", "vcan0", text)


def hexed(name, counter, **signals):
    can_id, payload = DBC.encode(name, counter, **signals)
    return f"{can_id:03X}#{payload.hex().upper()}"


class Bus:
    """What the test itself hears on the bus."""

    def __init__(self):
        self.link = CanLink("vcan0", timeout_s=1.0)

    def next(self, name, within_s=5.0, where=lambda values: True):
        """The next message of this name that decodes, is protected rightly and satisfies the condition; else None."""
        can_id = DBC.messages[name][0]
        end = time.monotonic() + within_s
        while time.monotonic() < end:
            frame = self.link.receive()
            if frame is None or frame.can_id != can_id:
                continue
            values = DBC.decode(name, frame.payload())
            if values is not None and where(values):
                return values
        return None

    def forget(self):
        self.link.drain(0.0001)


def candump_and_monitor_agree_with_our_own_log():
    # Not to OUT: that may be a share of another machine, too slow for a line at a time.
    dump_path = os.path.join(os.environ["TMPDIR"], "candump.log")
    with open(dump_path, "wb") as log:
        dump = subprocess.Popen(["stdbuf", "-oL", "candump", "-L", "-r", "4194304", "vcan0"], stdout=log)
    for _ in range(100):  # until candump listens
        cansend(MARKER)
        time.sleep(0.1)
        if log_lines(dump_path):
            break
    with Process(RADAR_MONITOR, "vcan0", "--json", path("monitor.json"), name="monitor") as monitor:
        monitor.wait_for("listening")
        frames = 40
        with radar("--scenario", "four-targets", "--frames", str(frames), "--log", path("own.log"), "--speed", "4",
                   name="agree") as sim:
            check("radar_sim on vcan0: exit code", sim.wait(60), 0)
        monitor.stop()
        cansend("7FF#FF")
        for _ in range(200):  # until candump has written everything
            if log_lines(dump_path)[-1] == "7FF#FF":
                break
            time.sleep(0.1)
        dump.terminate()
        dump.wait()
        shutil.copy(dump_path, path("candump.log"))
        text = monitor.output()
    own = log_lines("own.log")
    dumped = [line for line in log_lines("candump.log") if not line.startswith("7FF#")]
    check("candump saw as many frames as we logged", len(dumped), len(own))
    check("the same frames, the same bytes, the same order", dumped == own, True)
    check("objects among them", sum(line.startswith("411#") for line in own) > 10, True)
    summary = load("monitor.json")
    check("radar_monitor decoded every frame", summary["frames"], len(own))
    # On a busy machine some message may come late; anything else would be an error.
    errors = {what: n for what, n in summary["errors"].items() if n and what not in ("total", "overdue")}
    check("radar_monitor finds no error", errors, {})
    check("radar_monitor shows tracks", " m " in text or " m/s" in text, True)
    check("nothing was dropped", load("agree.json")["dropped_frames"], 0)
    run(RADAR_MONITOR, path("candump.log"), "--quiet", "--json", path("log_monitor.json"), may_fail=True)
    check("radar_monitor finds the same in candump's log", load("log_monitor.json")["lists"], summary["lists"])


def commands_good_and_bad():
    bus = Bus()
    with Process(RADAR_MONITOR, "vcan0", "--quiet", "--json", path("commands_monitor.json"), name="commands_monitor") \
            as monitor:
        monitor.wait_for("listening")
        with radar("--scenario", "approach", "--realtime", name="commands") as sim:
            bus.next("RadarStatus")
            counter = iter(range(100))

            def command(code, sequence, value):
                return hexed("Command", next(counter) % 15, Code=code, Sequence=sequence, Value=value)

            def answer(text, sequence, within_s=3.0):
                bus.forget()
                cansend(text)
                return bus.next("CommandEcho", within_s, lambda v: v["Sequence"] == sequence)

            echo = answer(command(SET_CFAR_SCALE, 17, 150), 17)
            check("good command: applied, value in force",
                  echo and (echo["Code"], echo["Result"], echo["ValueInForce"]), (SET_CFAR_SCALE, APPLIED, 150))
            echo = answer(command(SET_CFAR_SCALE, 18, 99999), 18)
            check("value out of range: refused, the old value in force",
                  echo and (echo["Result"], echo["ValueInForce"]), (OUT_OF_RANGE, 150))
            echo = answer(command(9, 19, 0), 19)
            check("unknown command: answered so", echo and echo["Result"], UNKNOWN_COMMAND)

            good = command(SET_CFAR_SCALE, 20, 300)
            crc = int(good[4:6], 16)
            check("bad CRC: no answer", answer(f"{good[:4]}{crc ^ 1:02X}{good[6:]}", 20, 0.8), None)
            check("one byte short: no answer", answer(good[:-2], 20, 0.8), None)
            check("one byte long: no answer", answer(good + "00", 20, 0.8), None)
            check("remote frame: no answer", answer("432#R", 20, 0.8), None)
            check("extended identifier: no answer", answer(f"00000432#{good[4:]}", 20, 0.8), None)
            echo = answer(good, 20)
            check("the same command unspoilt: applied", echo and (echo["Result"], echo["ValueInForce"]), (APPLIED, 300))
            check("the same frame again: a repetition, no answer", answer(good, 20, 0.8), None)
            monitor.stop()  # a restart sets all counters to 0, which may be what they are: a repetition one time in 15

            echo = answer(command(RESTART, 21, 0), 21)
            check("restart: answered", echo and echo["Result"], APPLIED)
            status = bus.next("RadarStatus")
            check("restart: the cycle counter begins anew", status and status["Cycle"] < 10, True)
            sim.process.terminate()
            sim.process.wait()
    rejected = load("commands_monitor.json")
    errors = rejected["errors"]
    check("radar_monitor counted the bad CRC, the wrong lengths and the repetition",
          (errors["bad_crc"], errors["wrong_length"], errors["repeated"]), (1, 2, 1))
    check("radar_monitor counted the remote and the extended frame", rejected["other"]["rejected"], 2)


def ego_motion_from_the_bus():
    with Process(RADAR_SIM, "--scenario", "approach", "--frames", "20", "--quiet", "--record", path("beats.bin")) as sim:
        check("recording for the next test", sim.wait(60), 0)
    bus = Bus()
    with radar("--replay", path("beats.bin"), "--realtime", name="replay") as sim:
        status = bus.next("RadarStatus")
        check("nobody tells the speed: ego stale", status and bool(status["Faults"] & EGO_STALE), True)
        sent = 0
        heard = None
        while sent < 12 and heard is None:
            cansend(hexed("EgoMotion", sent % 15, Valid=1, Speed=20 * 200, Acceleration=0))
            sent += 1
            heard = bus.next("RadarStatus", 0.15, lambda v: not v["Faults"] & EGO_STALE)
        check("cansend tells it: no longer stale", heard is not None, True)
        check("the replay goes to its end", sim.wait(30), 0)
    bus.forget()
    with radar("--replay", path("beats.bin"), "--realtime", name="replay_bad") as sim:
        bus.next("RadarStatus")
        cleared = False
        for i in range(10):
            text = hexed("EgoMotion", i % 15, Valid=1, Speed=20 * 200, Acceleration=0)
            cansend(f"431#{int(text[4:6], 16) ^ 0x80:02X}{text[6:]}")
            status = bus.next("RadarStatus", 0.2)
            cleared = cleared or status is not None and not status["Faults"] & EGO_STALE
        check("ego motion with bad CRC: not believed", cleared, False)
        check("the replay goes to its end", sim.wait(30), 0)


def interface_down_and_up():
    bus = Bus()
    with radar("--scenario", "approach", "--frames", "70", "--realtime", name="down_up") as sim:
        bus.next("RadarStatus")
        time.sleep(0.7)
        run("ip", "link", "set", "vcan0", "down")
        time.sleep(1.0)
        run("ip", "link", "set", "vcan0", "up")
        after = Bus()
        status = after.next("RadarStatus", where=lambda v: v["Faults"] & CAN_ERROR)
        check("up again: the radar is back and tells of the CAN error", status is not None, True)
        status = after.next("RadarStatus", where=lambda v: not v["Faults"] & CAN_ERROR)
        check("and then it is over", status is not None, True)
        check("the run went to its end", sim.wait(30), 0)
    summary = load("down_up.json")
    check("all cycles ran", summary["frames"], 70)
    check("what could not be sent is counted", summary["dropped_frames"] >= 3 * 5, True)
    check("and named", "CanError" in summary["faults"], True)


def full_transmit_queue():
    # 12 frames a second and a queue of ten: a fraction of what the radar says.
    run("tc", "qdisc", "add", "dev", "vcan0", "root", "tbf", "rate", "1600bit", "burst", "32", "limit", "160")
    start = time.monotonic()
    with radar("--scenario", "approach", "--frames", "20", "--realtime", name="full_queue") as sim:
        check("full queue: the run goes to its end", sim.wait(30), 0)
    check("full queue: and in time", time.monotonic() - start < 10, True)
    summary = load("full_queue.json")
    check("full queue: what did not fit is counted", summary["dropped_frames"] > 20, True)
    check("full queue: and named", "CanError" in summary["faults"], True)
    run("tc", "qdisc", "del", "dev", "vcan0", "root")


def busy_bus():
    bus = Bus()
    # Up to a whole bus of 500 kbit/s: 4000 frames a second.
    load_generators = [Process("cangen", "vcan0", "-g", "1", "-I", f"12{i}", "-L", "8", "-D", "i", name=f"cangen{i}")
                       for i in range(4)]
    with contextlib.ExitStack() as stack:
        for generator in load_generators:
            stack.enter_context(generator)
        monitor = stack.enter_context(Process(RADAR_MONITOR, "vcan0", "--json", path("busy_monitor.json"), "--quiet",
                                              name="busy_monitor"))
        monitor.wait_for("listening")
        with radar("--scenario", "four-targets", "--frames", "30", "--realtime", name="busy") as sim:
            bus.next("RadarStatus")
            check("busy bus: the run goes to its end", sim.wait(30), 0)
        monitor.stop()
    summary, heard = load("busy.json"), load("busy_monitor.json")
    rate = heard["other"]["foreign"] / heard["duration_s"]
    print(f"      {rate:.0f} frames a second of other nodes", flush=True)
    check("busy bus: it was busy", rate > 200, True)
    check("busy bus: nothing dropped", summary["dropped_frames"], 0)
    check("busy bus: the ego motion is heard", "EgoStale" in summary["faults"], False)
    errors = {what: n for what, n in heard["errors"].items() if n and what not in ("total", "overdue")}
    if "lost_here" in errors:
        print("      this machine is too busy for radar_monitor to keep up, and it says so", flush=True)
    else:
        check("busy bus: every list whole and free of errors", (heard["lists"]["whole"], errors), (30, {}))


for case in (candump_and_monitor_agree_with_our_own_log, commands_good_and_bad, ego_motion_from_the_bus,
             interface_down_and_up, full_transmit_queue, busy_bus):
    print(f"-- {case.__name__.replace('_', ' ')}", flush=True)
    case()
finish()
