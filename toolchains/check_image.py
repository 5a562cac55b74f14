#!/usr/bin/env python3
"""Looks at a linked board image for what must not be in it.

    toolchains/check_image.py IMAGE.elf [--rom BYTES] [--ram BYTES] [--stack BYTES]

From the symbols and the disassembly of the whole image, libraries included:
  - no floating-point instruction, no floating-point helper of the compiler;
  - no heap, no exceptions, no RTTI, no printing, no operating system calls;
  - no recursion: the call graph of all direct calls and jumps has no cycle. Calls through a register are the virtual
    functions of hal/contract; every function whose address is in a virtual table, and every one such a function can
    reach, must make no call through a register itself, so they cannot close a cycle either;
  - ROM and static RAM within the given sizes, and the stack too: the deepest path through the call graph, every
    call through a register taken to reach the virtual function that needs most, each function's need from its
    instructions, plus the deepest interrupt handler.
Exit code 0: clean. 1: something was found, one line each.
"""

import argparse
import collections
import pathlib
import re
import subprocess
import sys

TOOL = "arm-none-eabi-"

# Names as the linker sees them. __aeabi_ conversions and arithmetic on f(loat) and d(ouble), and libgcc's own names.
FLOAT_HELPER = re.compile(
    r"^__aeabi_(c?[fd](add|sub|rsub|mul|div|neg|cmp\w*|2\w+)|[ui]l?2[fd]|l2[fd]|ul2[fd]|h2f\w*|[fd]2h\w*)$"
    r"|^__(add|sub|mul|div|neg|cmp|eq|ne|ge|gt|le|lt|unord)[sdt]f[23]$"
    r"|^__(fix|fixuns|float|floatun|extend|trunc)\w*[sdt]f\w*$|^__pow[isdt]+f2$")
FORBIDDEN = [
    ("heap", re.compile(r"^_?_?(malloc|free|realloc|calloc|sbrk|malloc_r|free_r|_malloc_r|_free_r|_sbrk)\w*$"
                        r"|^_Zn[wa]|^_Zd[la]")),
    ("exceptions", re.compile(r"^_Unwind|^__cxa_(throw|rethrow|begin_catch|end_catch|allocate_exception)|^__gxx_personality"
                              r"|^_ZSt\d+__throw|^_ZSt9terminate")),
    ("run-time type information", re.compile(r"^_ZT[IS]|^__dynamic_cast|typeinfo")),
    ("printing", re.compile(r"^_?v?s?n?f?printf(_r)?$|^puts$|^_ZNSo|^_ZSt4cout")),
    ("operating system calls", re.compile(r"^_(write|read|open|close|lseek|fstat|isatty|kill|getpid|exit)$")),
    ("floating-point helper", FLOAT_HELPER),
]
# Every instruction of the floating-point and Advanced SIMD extensions begins with v; no other Arm instruction does.
FLOAT_INSTRUCTION = re.compile(r"^v[a-z]")

LABEL = re.compile(r"^([0-9a-f]+) <(.+)>:$")
INSTRUCTION = re.compile(r"^\s*([0-9a-f]+):\t[0-9a-f ]+\t(\S+)(?:\t(.*))?$")
TARGET = re.compile(r"^(?:r\d+, )?([0-9a-f]+) <([^>+]+)(\+0x[0-9a-f]+)?>")


def run(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


class Image:
    def __init__(self, path):
        self.path = path
        self.symbols = {}  # name -> (address, size, type)
        for line in run(TOOL + "nm", "-S", path).splitlines():
            parts = line.split()
            if len(parts) == 4:
                self.symbols[parts[3]] = (int(parts[0], 16), int(parts[1], 16), parts[2])
            elif len(parts) == 3:
                self.symbols[parts[2]] = (int(parts[0], 16), 0, parts[1])
        self.instructions = collections.defaultdict(list)  # function -> [(mnemonic, operands)]
        function = None
        for line in run(TOOL + "objdump", "-d", "--no-show-raw-insn", path).splitlines():
            label = LABEL.match(line)
            if label:
                function = label.group(2)
                continue
            parts = line.split("\t")
            if len(parts) >= 2 and function and re.match(r"^\s*[0-9a-f]+:$", parts[0]):
                operands = parts[2].split(" ; ")[0].split("\t")[0] if len(parts) > 2 else ""
                self.instructions[function].append((parts[1].strip(), operands))
        self._words = None

    def size(self, name):
        return self.symbols[name][0] if name in self.symbols else None

    def words(self, address, size):
        """32-bit words of the loaded image."""
        if self._words is None:
            self._words = {}
            for line in run(TOOL + "objdump", "-s", "-j", ".rodata", "-j", ".data", self.path).splitlines():
                match = re.match(r"^ ([0-9a-f]+) ((?:[0-9a-f]{2,8} ?){1,4})  ", line)
                if not match:
                    continue
                at = int(match.group(1), 16)
                data = bytes.fromhex(match.group(2).replace(" ", ""))
                for i in range(0, len(data) - 3, 4):
                    self._words[at + i] = int.from_bytes(data[i:i + 4], "little")
        return [self._words.get(a, 0) for a in range(address, address + size, 4)]


CALLS = re.compile(r"^(bl|blx|b|beq|bne|bcs|bcc|bmi|bpl|bvs|bvc|bhi|bls|bge|blt|bgt|ble|cbz|cbnz)(\.[nw])?$")
THROUGH_REGISTER = re.compile(r"^(blx|bx)(\w\w)?$")


def call_graph(image):
    """function -> set of functions; and the functions that call through a register."""
    graph = {name: set() for name in image.instructions}
    indirect = set()
    for name, instructions in image.instructions.items():
        for mnemonic, operands in instructions:
            target = TARGET.match(operands) if CALLS.match(mnemonic) or mnemonic.startswith("b") else None
            if target:
                callee = target.group(2)
                # A jump inside the function is no call; a branch to its own start is, as "bl" only.
                if callee != name or (mnemonic.startswith("bl") and not mnemonic.startswith(("bls", "blt", "ble"))
                                      and not target.group(3)):
                    graph[name].add(callee)
            elif THROUGH_REGISTER.match(mnemonic) and operands.strip() not in ("lr",):
                if mnemonic.startswith("blx") or not is_return_or_veneer(instructions, operands):
                    indirect.add(name)
    return graph, indirect


def is_return_or_veneer(instructions, operands):
    """`bx rN` after the return address was loaded into rN, or as the last part of a linker's long jump."""
    register = operands.strip()
    return any(m.startswith(("pop", "ldmia")) and register in o for m, o in instructions) or register in ("ip", "r12")


def cycles(graph):
    """Strongly connected components with more than one function, or one that calls itself (Tarjan 1972)."""
    index, low, on_stack, stack, found = {}, {}, set(), [], []
    for root in graph:
        if root in index:
            continue
        work = [(root, iter(graph[root]))]
        index[root] = low[root] = len(index)
        stack.append(root)
        on_stack.add(root)
        while work:
            node, successors = work[-1]
            for successor in successors:
                if successor not in graph:
                    continue
                if successor not in index:
                    index[successor] = low[successor] = len(index)
                    stack.append(successor)
                    on_stack.add(successor)
                    work.append((successor, iter(graph[successor])))
                    break
                if successor in on_stack:
                    low[node] = min(low[node], index[successor])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[node])
                if low[node] == index[node]:
                    component = []
                    while True:
                        member = stack.pop()
                        on_stack.discard(member)
                        component.append(member)
                        if member == node:
                            break
                    if len(component) > 1 or node in graph[node]:
                        found.append(component)
    return found


def reachable(graph, start):
    seen, todo = set(), [start]
    while todo:
        node = todo.pop()
        if node in seen:
            continue
        seen.add(node)
        todo.extend(graph.get(node, ()))
    return seen


def virtual_functions(image):
    at = {address & ~1: name for name, (address, _, kind) in image.symbols.items() if kind in "tTwW"}
    found = set()
    for name, (address, size, _) in image.symbols.items():
        if name.startswith("_ZTV"):
            found.update(at[w & ~1] for w in image.words(address, size) if w & ~1 in at and w != 0)
    return found


def frame_bytes(instructions):
    """Stack a function takes for itself: all that it pushes and reserves, as if none of it were ever given back."""
    total, constants = 0, {}
    for mnemonic, operands in instructions:
        constant = re.match(r"^(r\d+|ip|lr|fp|sl), #(\d+)", operands)
        if mnemonic.startswith("mov") and constant:
            constants[constant.group(1)] = int(constant.group(2))
        if mnemonic.startswith("push") or (mnemonic.startswith(("stmdb", "stmfd")) and operands.startswith("sp!")):
            registers = operands[operands.index("{") + 1:operands.index("}")].split(",")
            total += 4 * len(registers)
        elif mnemonic.startswith("str") and (pre := re.search(r"\[sp, #-(\d+)\]!", operands)):
            total += int(pre.group(1))
        elif mnemonic.startswith("sub") and re.match(r"^sp(, sp)?, ", operands):
            amount = operands.split(", ")[-1]
            if amount.startswith("#"):
                total += int(amount[1:])
            elif amount in constants:
                total += constants[amount]
            else:
                return None  # of a size only known when it runs
    return total


def stack_bound(image, graph, indirect, virtual):
    """Bytes from start_program down, and of the deepest interrupt handler; None if a frame has no fixed size."""
    depth = {}

    def deepest(function):  # as deep as the call graph, which has no cycle
        if function not in depth:
            own = frame_bytes(image.instructions.get(function, []))
            if own is None:
                raise ValueError(function)
            below = set(graph.get(function, ()))
            if function in indirect:
                below |= virtual
            depth[function] = own + max((deepest(f) for f in below), default=0)
        return depth[function]

    try:
        handlers = [f for f in graph if f.endswith("_receive_handler") or f == "timer0_handler"]
        exception_frame = 32
        interrupt = max((exception_frame + deepest(f) for f in handlers), default=0)
        return deepest("start_program") + interrupt
    except ValueError:
        return None


def demangle(names):
    out = run(TOOL + "c++filt", *names) if names else ""
    return [re.sub(r"\(.*", "", line) for line in out.splitlines()]


def check(image, arguments):
    problems = []
    for name in image.symbols:
        for what, pattern in FORBIDDEN:
            if pattern.search(name):
                problems.append(f"{what}: {demangle([name])[0]}")
    for name, instructions in image.instructions.items():
        bad = sorted({m for m, _ in instructions if FLOAT_INSTRUCTION.match(m)})
        if bad:
            problems.append(f"floating-point instruction: {', '.join(bad)} in {demangle([name])[0]}")

    graph, indirect = call_graph(image)
    for component in cycles(graph):
        problems.append("recursion: " + " -> ".join(demangle(sorted(component))))
    virtual = virtual_functions(image)
    for function in sorted(virtual):
        for reached in sorted(reachable(graph, function) & indirect):
            problems.append(f"possible recursion: virtual function {demangle([function])[0]} reaches the call through a "
                            f"register in {demangle([reached])[0]}")

    rom, ram = image.size("_rom_bytes"), image.size("_ram_bytes")
    stack = None if problems else stack_bound(image, graph, indirect, virtual)
    limits = [("ROM", rom, arguments.rom), ("static RAM", ram, arguments.ram)]
    if not problems:
        limits.append(("stack bound", stack, arguments.stack))
    for what, value, limit in limits:
        if limit is not None and (value is None or value > limit):
            problems.append(f"{what}: {value} bytes, more than {limit}")
    if not problems:
        functions = sum(1 for n in graph)
        print(f"{pathlib.Path(image.path).name}: rom {rom}, static ram {ram}, stack bound {stack} bytes; {functions} functions, "
              f"{len(virtual)} of them virtual, {len(indirect)} with calls through a register; nothing forbidden")
    return problems


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("image")
    parser.add_argument("--rom", type=int, help="most bytes of code, constants and initial values")
    parser.add_argument("--ram", type=int, help="most bytes of static data")
    parser.add_argument("--stack", type=int, help="most bytes of stack")
    arguments = parser.parse_args()
    sys.setrecursionlimit(10_000)
    problems = check(Image(arguments.image), arguments)
    for problem in problems:
        print(f"{arguments.image}: {problem}")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
