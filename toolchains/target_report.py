#!/usr/bin/env python3
"""What a frame costs on the boards: instructions, memory and stack, measured in the emulator, beside bars and aims.

    toolchains/target_report.py                           the tables, for three boards
    toolchains/target_report.py --json costs.json         the figures as well as JSON
    toolchains/target_report.py --plot cost-growth.png    how cost grows with tracks, detections and cluster size
    toolchains/target_report.py --check --board zcu102    compare with tests/target/budget.json

Figures come from
  - the images kernels, association and peers (tests/target/), run each time: a few seconds a board. KissFFT is among the
    peers after toolchains/peers.sh and a new configure;
  - the scenarios, replayed by ctest on each board: build/<preset>/tests/target/<scenario>.json. One that is missing or
    older than the image is replayed now, half a minute each;
  - the linker's map of the image that is flashed;
  - radar_bench on the PC, for precision and frames a second (not with --check).
Instructions and bytes are exact and the same on every machine. Microseconds assume one instruction a clock, at the clocks
named in the tables: the emulator knows no caches, wait states or second pipeline.

Exit code: 0 good; 1 wrong usage, or a figure could not be measured; 2 with --check: something got slower or bigger.
"""

import argparse
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import emulator

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUDGET = ROOT / "tests" / "target" / "budget.json"
SCENARIOS = sorted(p.stem for p in (ROOT / "host_sim" / "scenarios").glob("*.json"))
PERIOD_S = 0.1
MAP_CELLS = 30 * 64  # tested by CFAR: the first two of 32 range cells hold leakage
CHIRPS = 64
SIGNAL_PROCESSING = ["range fft", "doppler fft", "window and power", "cfar", "peaks"]


class Board:
    def __init__(self, name, preset, core, image, clocks_mhz):
        self.name, self.preset, self.core, self.clocks_mhz = name, preset, core, clocks_mhz
        self.build = ROOT / "build" / preset
        self.tests = self.build / "tests" / "target"
        self.map = self.build / "firmware" / f"{image}.map"
        self.replay = self.tests / "replay.elf"


# Clocks: Zynq UltraScale+ RPU as the ZCU102 is set up (the family goes up to 600 MHz); STM32F7 and H7; STM32F4.
BOARDS = {b.name: b for b in [
    Board("zcu102", "zcu102-r5", "Cortex-R5F", "radar_zcu102", [500]),
    Board("mps2-an500", "mps2-an500", "Cortex-M7", "radar_mps2", [216, 480]),
    Board("mps2-an386", "mps2-an386", "Cortex-M4", "radar_mps2", [168]),
]}

# What others need, instructions, measured elsewhere with gcc 12.2 -O2 in the same emulator on a Cortex-M7; a figure's name in
# place of a number: measured by the image peers.
ELSEWHERE = [
    ("64-point FFT", [("CMSIS-DSP arm_cfft_q15", 2500, "SQNR 67.6 / 29.6 dB at full scale / -40 dBFS"),
                      ("CMSIS-DSP arm_rfft_q15 (real input)", 2146, "62.4 / 24.2 dB, 33 KB of tables"),
                      ("CMSIS-DSP arm_cfft_f32, with FPU", 2977, "143.9 dB"),
                      ("KissFFT, 16 bit", 9600, "65.4 / 30.1 dB"),
                      ("KissFFT, 16 bit", "peer.kissfft16", "measured now"),
                      ("plain-C radix-8 with packed intrinsics", 982, "70.2 / 32.2 dB")], "fft64"),
    ("OS-CFAR, a cell", [("std::sort", "peer.os_cfar.sort.cell", "measured now"),
                         ("std::nth_element", "peer.os_cfar.nth_element.cell", "measured now"),
                         ("naive sort, N = 16", 786, ""), ("sliding sorted window, N = 16", 227, ""),
                         ("rank count, early reject, N = 16", 48, ""),
                         ("local maximum first, then rank count, N = 16", 16.6, "")], "cfar.noise.cell"),
    ("whole frame, window to detections", [("best combination of the peers, CMSIS-DSP", 400000, ""),
                                           ("block floating point, shown feasible", 176000, "")], "frame.mean"),
]


class Failure(Exception):
    """A figure cannot be measured; says why and what to do."""


class Skipped(Failure):
    """Something is not built that is not this command's to build."""


def progress(text):
    print(f"  {text}", file=sys.stderr, flush=True)


# --- where figures come from ---

def run_image(board, image):
    """Figures of an image: {kind: {name: value}} of its lines `kind name value`."""
    code, text = emulator.run(board.name, str(image), 120, icount=0)
    if code != 0:
        raise Failure(f"{image} ended with {code}: {text.strip()[-300:]}")
    found = {}
    for kind, name, value in re.findall(r"^(bench|bytes|count) (.+) (\d+)\r?$", text, re.M):
        found.setdefault(kind, {})[name] = int(value)
    if not found.get("bench"):
        raise Failure(f"{image} printed no figures: {text.strip()[-300:]}")
    return found


def scenario(board, name):
    """Figures of a scenario, from its last replay on this image or from a new one."""
    path = board.tests / f"{name}.json"
    if not path.exists() or path.stat().st_mtime < board.replay.stat().st_mtime:
        radar_sim = ROOT / "build" / "host" / "host_sim" / "radar_sim"
        if not radar_sim.exists():
            raise Skipped(f"no {radar_sim}: cmake --build --preset host --target radar_sim")
        progress(f"{board.name}: replaying {name}")
        subprocess.run([sys.executable, ROOT / "tests" / "target" / "scenario_test.py", "--board", board.name,
                        "--image", board.replay, "--radar-sim", radar_sim, "--scenario", name, "--json", path],
                       stdout=subprocess.DEVNULL)
        if not path.exists():
            raise Failure(f"{board.name}: {name} could not be replayed: ctest --preset {board.preset} "
                          f"-R target.scenario.{name}")
    return json.loads(path.read_text())


ROOMS = ["dsp", "tracking", "can", "hal", "firmware", "libraries", "alignment"]


def room_of(file):
    match = re.search(r"libradar_(hal|[a-z]+)(?:_\w+)?\.a", file)
    if match:
        return match.group(1)
    return "firmware" if "/radar_" in file else "libraries"


def read_map(path):
    """(room -> ROM bytes, room -> static RAM bytes, [(bytes, symbol section)] of RAM) of a linker's map."""
    text = path.read_text()
    text = text[text.index("Linker script and memory map"):]
    text = re.sub(r"\n( \.\S+)\n +0x", r"\n\1 0x", text)  # long names stand on a line of their own
    rom, ram = dict.fromkeys(ROOMS, 0), dict.fromkeys(ROOMS, 0)
    objects = []
    output = ""
    for line in text.splitlines():
        section = re.match(r"(\.\w+)", line)
        if section:
            output = section.group(1)
        item = re.match(r" (\.\S+|COMMON)\s+0x([0-9a-f]+)\s+0x([0-9a-f]+) (\S.*)", line)
        if not item or int(item.group(3), 16) == 0:
            continue
        size, room = int(item.group(3), 16), room_of(item.group(4))
        if output in (".text", ".rodata", ".data"):
            rom[room] += size
        if output in (".data", ".bss", ".noinit"):
            ram[room] += size
            objects.append((size, item.group(1)))
    for name, rooms in (("_rom_bytes", rom), ("_ram_bytes", ram)):
        total = int(re.search(rf"0x([0-9a-f]+) +{name} =", text).group(1), 16)
        rooms["alignment"] = total - sum(rooms.values())
        rooms["total"] = total
    return rom, ram, sorted(objects, reverse=True)


def measure(board, kernels=None, only_kernels=False):
    """Everything known of a board: a dictionary that goes to the JSON file as it is."""
    for path in (board.replay, board.map):
        if not path.exists():
            raise Failure(f"no {path}: cmake --preset {board.preset} && cmake --build --preset {board.preset}")
    measured = run_image(board, kernels or board.tests / "kernels.elf")
    figures = dict(measured["bench"])
    for image in ("association", "peers"):
        path = board.tests / f"{image}.elf"
        if path.exists() and not only_kernels:
            figures.update(run_image(board, path)["bench"])
    figures["chirp"] = round(figures["range_transform"] / CHIRPS, 1)
    for frame in ("noise", "four", "crowded", "adversarial"):
        figures[f"cfar.{frame}.cell"] = round(figures[f"cfar.{frame}"] / MAP_CELLS, 2)
    for name in [n for n in figures if n.startswith("peer.os_cfar.")]:
        figures[f"{name}.cell"] = round(figures[name] / MAP_CELLS, 1)
    if only_kernels:
        return {"board": board.name, "figures": figures}

    scenarios = {name: scenario(board, name) for name in SCENARIOS}
    stages = {}
    for stage in next(iter(scenarios.values()))["instructions"]:
        rows = {name: s["instructions"][stage] for name, s in scenarios.items()}
        worst = max(rows, key=lambda name: rows[name]["worst"])
        stages[stage] = {"mean": round(sum(r["mean"] for r in rows.values()) / len(rows)), "worst": rows[worst]["worst"],
                         "worst_in": worst}
    worst = max(scenarios, key=lambda name: scenarios[name]["loop"]["worst"])
    loop = {"mean": round(sum(s["loop"]["mean"] for s in scenarios.values()) / len(scenarios)),
            "worst": scenarios[worst]["loop"]["worst"], "worst_in": worst}
    stack_in = max(scenarios, key=lambda name: scenarios[name]["stack_used"])
    rom, ram, objects = read_map(board.map)
    figures.update({
        "frame.mean": sum(stages[s]["mean"] for s in SIGNAL_PROCESSING),
        "loop.mean": loop["mean"], "loop.worst": loop["worst"], "rom": rom["total"], "ram": ram["total"],
        "stack": scenarios[stack_in]["stack_used"],
    })
    return {"board": board.name, "core": board.core, "figures": figures, "stages": stages, "loop": loop,
            "stack": {"used": scenarios[stack_in]["stack_used"], "in": stack_in,
                      "reserved": scenarios[stack_in]["stack_reserved"]},
            "rom": rom, "ram": ram, "ram_objects": objects[:8], "parts": measured.get("bytes", {}),
            "identical": all(s["identical"] for s in scenarios.values())}


# --- precision and speed on the PC ---

# Row of the table, start of its row of `radar_bench accuracy`, bar, aim. Decibels, and the higher the better in the first.
PRECISION = [
    ("SQNR, FFT, full scale, dB", "64-point FFT, int16, full-scale", 70, 75, True),
    ("SQNR, FFT, -40 dBFS, dB", "  the same at -40 dBFS", 65, 70, True),
    ("noise floor added by the map, mean, dB", "noise floor of the map", 0.5, 0.1, False),
    ("noise floor added, strongest row, dB", "  in the row of the tone", 2.5, 0.5, False),
]
LEAST_FRAMES_PER_SECOND = 20_000


def run_bench(*options):
    """The JSON that radar_bench writes; empty where it is not built."""
    radar_bench = ROOT / "build" / "host" / "tests" / "bench" / "radar_bench"
    if not radar_bench.exists():
        return []
    progress(f"PC: radar_bench {' '.join(options)}")
    with tempfile.TemporaryDirectory() as directory:
        path = pathlib.Path(directory) / "rows.json"
        subprocess.run([radar_bench, *options, "--json", path], stdout=subprocess.DEVNULL)
        return json.loads(path.read_text()) if path.exists() else []


def host_rows():
    """[(what, bar, aim, measured, higher is better)]: what is measured on the PC."""
    precision = run_bench("accuracy", "--only", "dsp")
    rows = [(what, bar, aim, next((r["measured"] for r in precision if r["what"].startswith(start)), None), at_least)
            for what, start, bar, aim, at_least in PRECISION]
    loops = [(f"PC, {t['task']}, frames a second", LEAST_FRAMES_PER_SECOND, None, 1e9 / t["nanoseconds"], True)
             for t in run_bench("speed", "--quick", "--only", "firmware")]
    return rows + loops


# --- the budget ---

def read_budget(path=BUDGET):
    return json.loads(path.read_text())


def compare(budget, board, figures):
    """What is over its limit, and what could not be measured: lists of text."""
    over, missing = [], []
    for entry in budget:
        limit = entry.get("limit", {}).get(board)
        if limit is None:
            continue
        value = figures.get(entry["figure"])
        if value is None:
            missing.append(f"{board}: {entry['what']} ({entry['figure']}) was not measured")
        elif value > limit:
            word = "bigger" if entry["unit"] == "bytes" else "slower"
            over.append(f"{board}: {word}: {entry['what']} ({entry['figure']}): {value} {entry['unit']}, {value - limit:g} "
                        f"more than the limit {limit}")
    return over, missing


def set_limits(budget, results):
    """The limit is what is measured and 2 % more, but not over a bar that is met."""
    for entry in budget:
        for board, result in results.items():
            value = result["figures"].get(entry["figure"])
            if value is None:
                continue
            limit = value * 1.02
            if entry.get("bar") is not None and value <= entry["bar"]:
                limit = min(limit, entry["bar"])
            entry.setdefault("limit", {})[board] = math.ceil(limit) if limit > 100 else round(limit + 0.05, 1)


def write_budget(budget, path=BUDGET):
    path.write_text("[\n" + ",\n".join(" " + json.dumps(entry) for entry in budget) + "\n]\n")


# --- tables ---

def number(value):
    if value is None:
        return "-"
    return f"{value:,.1f}" if isinstance(value, float) and value < 1000 else f"{value:,.0f}"


def mark(value, bar, aim, at_least=False):
    if value is None or bar is None:
        return " "
    reaches = (lambda limit: value >= limit) if at_least else (lambda limit: value <= limit)
    return "+" if aim is not None and reaches(aim) else " " if reaches(bar) else "!"


def table(title, head, rows, notes=()):
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    print(f"\n{title}")
    for row in [head, ["-" * w for w in widths], *rows]:
        print("  " + "  ".join(c.ljust(w) if i == 0 or not head[i] else c.rjust(w)
                               for i, (c, w) in enumerate(zip(row, widths))).rstrip())
    for note in notes:
        print(f"  {note}")


def print_bars(budget, results, host):
    rows = []
    for entry in budget:
        bar, aim = entry.get("bar"), entry.get("aim")
        if bar is None:
            continue
        cells = [number(v) + mark(v, bar, aim) for v in (r["figures"].get(entry["figure"]) for r in results.values())]
        rows.append([f"{entry['what']}, {entry['unit']}", number(bar), number(aim), *cells])
    for what, bar, aim, value, at_least in host:
        text = "-" if value is None else f"{value:,.3g}" if value < 1000 else f"{value:,.0f}"
        sign = ">= " if at_least else ""
        rows.append([what, f"{sign}{bar:,g}", "-" if aim is None else f"{sign}{aim:,g}",
                     text + mark(value, bar, aim, at_least), *["=" if "dB" in what else ""] * (len(results) - 1)])
    table("Bars and aims", ["what", "bar", "aim", *[BOARDS[b].core for b in results]], rows,
          ["+ aim reached, ! bar missed. Precision is measured on the PC; the boards compute the same bits (=)."])


def print_stages(result):
    board = BOARDS[result["board"]]
    clocks = board.clocks_mhz
    rows = []
    for stage, s in [*result["stages"].items(), ("whole loop", result["loop"])]:
        rows.append([stage, number(s["mean"]), number(s["worst"]), s["worst_in"],
                     *[number(s["worst"] / mhz) for mhz in clocks],
                     *[f"{100 * s['worst'] / (mhz * 1e6 * PERIOD_S):.2f} %" for mhz in clocks]])
    stack = result["stack"]
    table(f"{board.core}: instructions a frame, over {len(SCENARIOS)} scenarios",
          ["stage", "mean", "worst", "worst in", *[f"us at {m} MHz" for m in clocks], *[f"of 0.1 s at {m}" for m in clocks]],
          rows, ["Mean of the scenarios' means. Microseconds and share of the period are of the worst cycle, at one instruction "
                 "a clock.",
                 f"Stack: {number(stack['used'])} bytes used at most, in {stack['in']}, of {number(stack['reserved'])} reserved. "
                 + ("CAN bytes equal the PC's." if result["identical"] else "CAN BYTES DIFFER FROM THE PC'S.")])


def print_kernels(results):
    names = [n for n in next(iter(results.values()))["figures"] if not n.startswith(("step.", "growth.", "cluster.", "tracker.", "peer."))
             and n not in ("rom", "ram", "stack", "chirp", "frame.mean", "loop.mean", "loop.worst") and not n.endswith(".cell")]
    rows = [[n, *[number(r["figures"].get(n)) for r in results.values()]] for n in names]
    table("Kernels, instructions", ["kernel", *[BOARDS[b].core for b in results]], rows,
          ["doppler_transform and log_power: one of 32 range cells; range_transform, inspect, noise_level, cfar, "
           "extract_peaks,", "detect: a whole frame; can.frame: encoding and protection of one CAN frame."])


def print_filters(results):
    """The tracker with each filter."""
    figures = {BOARDS[b].core: r["figures"] for b, r in results.items()}
    tasks = [("Tracker step by filter: 4 tracks, 7 detections, every one in every gate", r"step\.4x7\.([^.]+)"),
             ("Whole tracker by filter: 16 tracks, 64 detections, worst frame", r"tracker\.worst\.([^.]+)")]
    columns = [(b, mhz) for b in results for mhz in BOARDS[b].clocks_mhz]
    for title, pattern in tasks:
        rows = []
        for name in next(iter(figures.values())):
            match = re.fullmatch(pattern, name)
            if match:
                rows.append([match.group(1), *[number(f.get(name)) for f in figures.values()],
                             *[number(results[b]["figures"][name] / mhz) for b, mhz in columns]])
        if rows:
            table(title, ["filter", *figures, *[f"us, {BOARDS[b].core.split('-')[1]} {mhz} MHz" for b, mhz in columns]],
                  rows, ["Instructions; microseconds at one instruction a clock."])


def print_memory(results):
    rows = [[room, *[number(r["rom"][room]) for r in results.values()], *[number(r["ram"][room]) for r in results.values()]]
            for room in [*ROOMS, "total"]]
    cores = [BOARDS[b].core for b in results]
    first = next(iter(results.values()))
    parts = ", ".join(f"{name} {number(size)}" for name, size in first["parts"].items())
    table("Memory by room, bytes, from the linker's map", ["room", *[f"ROM {c}" for c in cores], *[f"RAM {c}" for c in cores]],
          rows, ["By the object file a thing is linked from: the one object that is the radar counts as firmware.",
                 f"In it: {parts}."])


def print_elsewhere(results):
    rows = []
    m7 = results.get("mps2-an500") or next(iter(results.values()))
    for what, peers, figure in ELSEWHERE:
        ours = m7["figures"].get(figure)
        rows.append([f"{what}: ours", number(ours), "1", ""])
        for name, value, note in peers:
            value = m7["figures"].get(value) if isinstance(value, str) else value
            if value is None:
                continue
            rows.append([f"  {name}", number(value), f"{value / ours:.2f}" if ours else "-", note])
    table(f"Beside others, instructions on a {BOARDS[m7['board']].core}", ["what", "instructions", "of ours", ""], rows,
          ["What is not measured now was measured elsewhere, with gcc 12.2 -O2 in the same emulator. Our OS-CFAR, and those "
           "measured now:", "N = 20, k = 12; ours with local maxima, the others test every cell."])


def growth_panels(figures):
    """[(title, x label, [(filter, [(x, instructions)])])] from figures `growth|cluster.<tracks>x<detections>.<filter>`."""
    grids = {"growth": {}, "cluster": {}}  # kind -> filter -> {(tracks, detections): instructions}
    for name, value in figures.items():
        match = re.fullmatch(r"(growth|cluster)\.(\d+)x(\d+)\.([^.]+)", name)
        if match:
            kind, tracks, detections, label = match.groups()
            grids[kind].setdefault(label, {})[int(tracks), int(detections)] = value

    def lines(kind, point):
        found = [(label, [p for key, v in grid.items() if (p := point(*key, v))]) for label, grid in grids[kind].items()]
        return [(label, sorted(points)) for label, points in found if len(points) > 2]

    panels = [
        ("tracks apart, 32 detections", "tracks", lines("growth", lambda t, d, v: (t, v) if d == 32 else None)),
        ("8 tracks apart", "detections a frame", lines("growth", lambda t, d, v: (d, v) if t == 8 else None)),
        ("one cluster: all detections in all gates, 3 more than tracks", "tracks in the cluster",
         lines("cluster", lambda t, d, v: (t, v))),
    ]
    return [panel for panel in panels if panel[2]]


def plot(results, path):
    """Instructions of a tracker step over tracks, detections and cluster size, on the first board, by gnuplot."""
    if not shutil.which("gnuplot"):
        raise Failure("gnuplot is not installed: apt-get install gnuplot-nox")
    result = next(iter(results.values()))
    panels = growth_panels(result["figures"])
    if not panels:
        raise Failure("nothing to draw: the image association has not measured how cost grows")
    commands = [f"set terminal pngcairo size {520 * len(panels)},440 font 'sans,11' background '#ffffff'",
                f"set output '{pathlib.Path(path).resolve()}'",
                f"set multiplot layout 1,{len(panels)} title 'Instructions of predicting, gating, associating and updating, "
                f"{BOARDS[result['board']].core}'",
                "set logscale xy 2", "set logscale y 10", "set format y '%.0s%c'", "set grid", "set key top left"]
    for panel, (title, label, lines) in enumerate(panels):
        commands += [f"set title '{title}'", f"set xlabel '{label}'"]
        drawn = []
        for i, (name, points) in enumerate(lines):
            block = f"$data{panel}_{i}"
            commands += [f"{block} << EOD", *[f"{x} {y}" for x, y in points], "EOD"]
            drawn.append(f"{block} using 1:2 with linespoints lw 2 pt 7 ps 0.7 title '{name}'")
        commands.append("plot " + ", ".join(drawn))
    commands.append("unset multiplot")
    subprocess.run(["gnuplot"], input="\n".join(commands) + "\n", text=True, check=True)


# --- the command ---

def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--board", action="append", choices=list(BOARDS), help="only this one (repeatable; default: all three)")
    parser.add_argument("--json", metavar="FILE", help="write all figures there")
    parser.add_argument("--plot", metavar="PNG", help="draw how cost grows, on the first board")
    parser.add_argument("--check", action="store_true", help="no tables: compare with the budget, name what got slower or bigger")
    parser.add_argument("--set-limits", action="store_true",
                        help="write the limits of the budget anew: what is measured and 2 %%, but not over a bar that is met")
    parser.add_argument("--kernels", metavar="ELF",
                        help="with --check and one --board: compare what this image measures, and nothing else")
    arguments = parser.parse_args()
    boards = [BOARDS[name] for name in arguments.board or BOARDS]
    if arguments.kernels and (not arguments.check or len(boards) != 1):
        parser.error("--kernels needs --check and one --board")
    budget = read_budget()
    try:
        results = {b.name: measure(b, arguments.kernels, only_kernels=bool(arguments.kernels)) for b in boards}
        if arguments.json:
            pathlib.Path(arguments.json).write_text(json.dumps(results, indent=1) + "\n")
        if arguments.plot:
            plot(results, arguments.plot)
        if arguments.set_limits:
            set_limits(budget, results)
            write_budget(budget)
        if arguments.check:
            over, missing = [], []
            for name, result in results.items():
                more, absent = compare(budget, name, result["figures"])
                over += more
                missing += [] if arguments.kernels else absent
            for line in over + missing:
                print(line)
            if not over and not missing:
                print(f"{', '.join(results)}: {sum(1 for e in budget if e.get('limit'))} figures within the budget")
            return 2 if over else 1 if missing else 0
        print_bars(budget, results, host_rows())
        for result in results.values():
            print_stages(result)
        print_kernels(results)
        print_filters(results)
        print_memory(results)
        print_elsewhere(results)
    except Skipped as reason:
        print(f"SKIPPED: {reason}")
        return 0 if arguments.check else 1
    except (Failure, OSError, RuntimeError) as failure:
        print(f"target_report.py: {failure}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
