#!/usr/bin/env python3
"""Writes measuring wrappers for the linker's --wrap around the functions that make up the stages.

    wrap_stages.py --nm NM --cxxfilt CXXFILT -o wrappers.S --options wrappers.rsp LIBRARY.a...

The functions are named as in the source; their linker names are looked up in the libraries. A wrapper leaves registers and
stack as they are, so it fits any signature. Only calls from one object file to another can be wrapped.
"""

import argparse
import re
import subprocess
import sys

# Order of target::Stage in stages.hpp.
STAGES = {
    "input check": [r"^dsp::inspect\(", r"^dsp::noise_level\("],
    "range fft": [r"^dsp::range_fft\("],
    "doppler fft": [r"^dsp::fft64\("],
    "window and power": [r"^dsp::range_doppler\("],
    "cfar": [r"^dsp::cfar_peaks\("],
    "peaks": [r"^dsp::extract_peaks\("],
    "association": [r"^tracking::AssociationStatus tracking::associate<"],
    "filter": [r"^tracking::Tracker<.*>::step\("],
    "warning": [r"^tracking::CollisionWarning<.*>::step\("],
}

WRAPPER = """
    .global __wrap_{name}
    .type __wrap_{name}, %function
    .thumb_func
__wrap_{name}:
    push {{r0-r3, ip, lr}}
    movs r0, #{stage}
    mov r1, lr
    bl enter_stage
    pop {{r0-r3, ip, lr}}
    bl __real_{name}
    push {{r0-r3}}
    bl leave_stage
    mov lr, r0
    pop {{r0-r3}}
    bx lr
"""

# What a wrapper takes is measured with these.
NOTHING = """
    .global {name}
    .type {name}, %function
    .thumb_func
{name}:
    bx lr
"""


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--nm", required=True)
    parser.add_argument("--cxxfilt", required=True)
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--options", required=True)
    parser.add_argument("libraries", nargs="+")
    arguments = parser.parse_args()

    symbols = subprocess.run([arguments.nm, *arguments.libraries], check=True, capture_output=True, text=True).stdout
    undefined = sorted(set(re.findall(r"^ +U (_Z\S+)$", symbols, re.M)))
    names = subprocess.run([arguments.cxxfilt], input="\n".join(undefined), check=True, capture_output=True,
                           text=True).stdout.splitlines()
    wrappers, options = [], []
    for stage, patterns in enumerate(STAGES.values()):
        for pattern in patterns:
            matches = [m for m, name in zip(undefined, names) if re.search(pattern, name)]
            if len(matches) != 1:
                sys.exit(f"wrap_stages.py: {len(matches)} functions called across object files match {pattern}")
            wrappers.append(WRAPPER.format(name=matches[0], stage=stage))
            options.append(f"-Wl,--wrap={matches[0]}")
    wrappers.append(NOTHING.format(name="wrapped_nothing") + NOTHING.format(name="plain_nothing"))
    wrappers.append(WRAPPER.format(name="wrapped_nothing", stage=len(STAGES) + 1))  # Stage::rest
    options.append("-Wl,--wrap=wrapped_nothing")
    with open(arguments.output, "w") as output:
        output.write("    .syntax unified\n    .thumb\n    .text\n" + "".join(wrappers))
    with open(arguments.options, "w") as output:
        output.write("\n".join(options) + "\n")


if __name__ == "__main__":
    main()
