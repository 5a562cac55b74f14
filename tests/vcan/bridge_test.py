"""zcu102_can_bridge between two virtual CAN interfaces: every kind of frame, both directions.

Expected register forms are written out from the Zynq UltraScale+ register reference (TXFIFO_ID, TXFIFO_DATA1/2), not
computed: standard identifier in bits 31 to 21, SRR/RTR 20, IDE 19, identifier bits 17 to 0 in 18 to 1, RTR 0; data byte
0 in bits 31 to 24 of its word, while the emulator takes bits 7 to 0 for the first byte.
"""

import sys

from can_link import EFF, RTR, CanLink, Frame, Process, add_interface, check, finish

BRIDGE = sys.argv[1]

# (what, register form as the emulator's interface carries it, the frame everybody else sees)
FRAMES = [
    ("status 0x400", Frame(0x80000000, "0403020108070605"), Frame(0x400, "0102030405060708")),
    ("object 0x411", Frame(0x82200000, "0403020108070605"), Frame(0x411, "0102030405060708")),
    ("low identifier 0x001", Frame(0x00200000, "0403020108070605"), Frame(0x001, "0102030405060708")),
    ("highest identifier 0x7FF", Frame(0xFFE00000, "0403020108070605"), Frame(0x7FF, "0102030405060708")),
    ("identifier like a remote frame, 0x22A", Frame(0x45400000, "04030201"), Frame(0x22A, "01020304")),
    ("identifier like an error frame, 0x12A", Frame(0x25400000, "04030201"), Frame(0x12A, "01020304")),
    ("no data", Frame(0x82200000, ""), Frame(0x411, "")),
    # The words are always written whole: five bytes are four of the first word and the top one of the second.
    ("five bytes", Frame(0x82200000, "0403020108070605", length=5), Frame(0x411, "0102030405060708", length=5)),
    ("one byte", Frame(0x82200000, "0403020108070605", length=1), Frame(0x411, "0102030405060708", length=1)),
    ("extended 0x10440001", Frame(0x82380002, "0403020108070605"), Frame(EFF | 0x10440001, "0102030405060708")),
    ("extended 0x1FFFFFFF", Frame(0xFFFFFFFE, "04030201"), Frame(EFF | 0x1FFFFFFF, "01020304")),
    ("remote standard 0x411", Frame(0x82300000, ""), Frame(RTR | 0x411, "")),
    ("remote extended 0x10440001", Frame(0x82380003, ""), Frame(EFF | RTR | 0x10440001, "")),
]

add_interface("vcan1")
emulated = CanLink("vcan1", own_errors=True)
clean = CanLink("vcan0")

with Process(BRIDGE, "vcan1", "vcan0") as bridge:
    bridge.wait_for("<->")
    for what, register_form, plain in FRAMES:
        emulated.send(register_form)
        check(f"from the emulator: {what}", clean.receive(), plain)
        clean.send(plain)
        check(f"to the emulator: {what}", emulated.receive(), register_form)
    check("says that it repairs", "repairing" in bridge.output(), True)
    bursts, burst = 20, 50  # a list of 16 objects is 36 frames
    in_order = True
    for start in range(0, bursts * burst, burst):
        numbers = [f"{i:08X}" for i in range(start, start + burst)]
        for number in numbers:
            emulated.send(Frame(0x82200000, number))
        got = []
        while len(got) < burst and (frame := clean.receive()) is not None:
            got.append(frame)
        in_order = in_order and got == [Frame(0x411, bytes.fromhex(n)[::-1].hex()) for n in numbers]
        if not in_order:
            break
    check(f"{bursts} bursts of {burst} frames, in order", (in_order, len(got)), (True, burst))
    code = bridge.stop()
    check("ends on SIGTERM, nothing lost", (code, f"{len(FRAMES) + bursts * burst} frames from" in bridge.output()), (0, True))

with Process(BRIDGE, "vcan1", "vcan0") as bridge:
    bridge.wait_for("<->")
    emulated.send(Frame(0x411, "0102030405060708"))
    check("plain from the emulator: unchanged", clean.receive(), Frame(0x411, "0102030405060708"))
    check("says that it is not needed", "not needed" in bridge.output(), True)
    clean.send(Frame(0x431, "1122334455667788"))
    check("plain to the emulator: unchanged", emulated.receive(), Frame(0x431, "1122334455667788"))
    bridge.stop()

with Process(BRIDGE, "vcan9", "vcan0") as bridge:
    check("no such interface: exit code", bridge.wait(), 1)
    check("no such interface: remedy", "ip link add dev vcan9 type vcan" in bridge.output(), True)

finish()
