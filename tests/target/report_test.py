#!/usr/bin/env python3
"""toolchains/target_report.py: the budget names what is over it, limits follow their rule, a map is read to the byte."""

import copy
import os
import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "toolchains"))
import target_report  # noqa: E402

BUDGET = [
    {"figure": "fft64", "what": "FFT", "unit": "instructions", "bar": 950, "limit": {"zcu102": 900}},
    {"figure": "rom", "what": "ROM", "unit": "bytes", "bar": 65536, "limit": {"zcu102": 60000, "mps2-an500": 1}},
]

MAP = """Discarded input sections

 .text.unused   0x00000000      0x500 dsp/libradar_dsp.a(fft64.cpp.obj)

Linker script and memory map

.text           0x00000000       0x40
 .vectors       0x00000000       0x10 hal/mps2/libradar_hal_mps2.a(startup.S.obj)
 .text._ZN3dsp5fft64EOneWithALongName
                0x00000010       0x20 dsp/libradar_dsp.a(fft64.cpp.obj)
                0x00000010                dsp::fft64()
 *fill*         0x00000030        0x4
 .text.memcpy   0x00000034        0xc /usr/lib/libc_nano.a(memcpy.o)
.rodata         0x00000040        0x8
 .rodata.table  0x00000040        0x8 tracking/libradar_tracking.a(tracker.cpp.obj)
.stack          0x20000000      0x100
 *fill*         0x20000000      0x100
.data           0x20000100        0x4 load address 0x00000048
 .data.mode     0x20000100        0x4 can/libradar_can.a(codec.cpp.obj)
.bss            0x20000104       0x30
 .bss.radar     0x20000104       0x30 firmware/CMakeFiles/radar_mps2.dir/main_mps2.cpp.obj
                0x0000004c                        _rom_bytes = ((LOADADDR (.data) + SIZEOF (.data)) - ORIGIN (ROM))
                0x00000034                        _ram_bytes = (_bss_end - _fault_stack_top)
.comment        0x00000000       0x26
 .comment       0x00000000       0x26 dsp/libradar_dsp.a(fft64.cpp.obj)
"""


class Budget(unittest.TestCase):
    def test_names_what_is_over_its_limit(self):
        self.assertEqual(([], []), target_report.compare(BUDGET, "zcu102", {"fft64": 900, "rom": 60000}))
        over, missing = target_report.compare(BUDGET, "zcu102", {"fft64": 901, "rom": 60000})
        self.assertEqual(["zcu102: slower: FFT (fft64): 901 instructions, 1 more than the limit 900"], over)
        over, missing = target_report.compare(BUDGET, "zcu102", {"fft64": 1, "rom": 60001})
        self.assertEqual(["zcu102: bigger: ROM (rom): 60001 bytes, 1 more than the limit 60000"], over)

    def test_a_figure_that_was_not_measured_is_no_success(self):
        over, missing = target_report.compare(BUDGET, "zcu102", {"rom": 60000})
        self.assertEqual([], over)
        self.assertEqual(1, len(missing))

    def test_a_limit_is_two_percent_above_but_not_over_a_bar_that_is_met(self):
        budget = copy.deepcopy(BUDGET)
        target_report.set_limits(budget, {"zcu102": {"figures": {"fft64": 940, "rom": 70000}}})
        self.assertEqual(950, budget[0]["limit"]["zcu102"])
        self.assertEqual(71400, budget[1]["limit"]["zcu102"])

    def test_what_the_shipped_budget_limits_it_limits_on_every_board(self):
        for entry in target_report.read_budget():
            if "limit" in entry:
                self.assertEqual(set(target_report.BOARDS), set(entry["limit"]), entry["figure"])


class Map(unittest.TestCase):
    def test_every_byte_is_in_a_room(self):
        with tempfile.TemporaryDirectory() as directory:
            path = pathlib.Path(directory) / "image.map"
            path.write_text(MAP)
            rom, ram, objects = target_report.read_map(path)
        self.assertEqual({"dsp": 32, "tracking": 8, "can": 4, "hal": 16, "firmware": 0, "libraries": 12, "alignment": 4,
                          "total": 76}, rom)
        self.assertEqual({"dsp": 0, "tracking": 0, "can": 4, "hal": 0, "firmware": 48, "libraries": 0, "alignment": 0,
                          "total": 52}, ram)
        self.assertEqual((48, ".bss.radar"), objects[0])


if __name__ == "__main__":
    unittest.main()
