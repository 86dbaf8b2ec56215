"""Who calls whom in a program for Cortex-M, and how much stack each function opens.

Read from the disassembly. Of a function: the functions it branches to or calls; the bytes by
which it lowers the stack pointer; whether it calls through a register, which a disassembly
does not follow; whether it calls itself.
"""
import re
import subprocess
from collections import namedtuple

Function = namedtuple("Function", "name size frame callees through_register calls_itself")

HEAD = re.compile(r"([0-9a-f]{8}) <(.*)>:$")
TARGET = re.compile(r"\b([0-9a-f]+) <")
JUMP = re.compile(r"(b|bl|blx|cbn?z|b(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le))(\.[nw])?$")
WIDTH = {"r": 4, "s": 4, "d": 8}


def listed(operands):
    """Bytes of the registers in braces."""
    total = 0
    for part in re.search(r"\{([^}]*)\}", operands)[1].split(","):
        part = part.strip()
        span = re.match(r"([rsd])(\d+)-[rsd](\d+)$", part)
        if span:
            total += WIDTH[span[1]] * (int(span[3]) - int(span[2]) + 1)
        else:
            total += WIDTH.get(part[0], 4) if part not in ("sl", "sp") else 4
    return total


def opened(name, operands):
    """Bytes by which an instruction lowers the stack pointer."""
    if re.match(r"v?push", name) or re.match(r"(v?stmdb|stmfd)", name) and operands.startswith("sp!"):
        return listed(operands)
    moved = re.match(r"subw?(\.w)?$", name) and re.match(r"sp, (?:sp, )?#(\d+)", operands)
    if moved:
        return int(moved[1])
    indexed = re.match(r"v?str", name) and re.search(r"\[sp, #-(\d+)\]!", operands)
    if indexed:
        return int(indexed[1])
    if name.startswith("sub") and re.match(r"sp, (sp, )?r", operands):
        raise ValueError("stack pointer lowered by a register: %s %s" % (name, operands))
    return 0


def functions(program):
    """All functions by address."""
    text = subprocess.run(["arm-none-eabi-objdump", "-d", "-C", program], check=True,
                          stdout=subprocess.PIPE, text=True).stdout
    found, start = {}, None
    for line in text.splitlines():
        head = HEAD.match(line)
        if head:
            start = int(head[1], 16)
            name = re.sub(r"::h[0-9a-f]{16}$", "", head[2])
            found[start] = {"name": name, "size": 0, "frame": 0, "targets": set(), "register": False,
                            "itself": False}
            continue
        cells = line.split("\t")
        if start is None or len(cells) < 3 or cells[2].startswith("."):
            continue
        function, name, operands = found[start], cells[2].strip(), "\t".join(cells[3:])
        function["size"] = int(cells[0].strip().rstrip(":"), 16) - start + len(cells[1].replace(" ", "")) // 2
        function["frame"] += opened(name, operands)
        target = JUMP.match(name) and TARGET.search(operands)
        if target:
            function["targets"].add(int(target[1], 16))
            # A branch to its beginning may be a loop, a call is none.
            function["itself"] |= name.startswith("bl") and re.match(r"blx?(\.[nw])?$", name) is not None \
                and int(target[1], 16) == start
        elif re.match(r"blx|bx", name) and not operands.startswith("lr"):
            function["register"] = True
    graph = {}
    for start, function in found.items():
        inside = range(start, start + function["size"])
        callees = frozenset(to for to in function["targets"] if to in found and to not in inside)
        graph[start] = Function(function["name"], function["size"], function["frame"], callees,
                                function["register"], function["itself"])
    return graph


def deepest(graph, start, times=lambda name: 1):
    """Most stack below a call of `start`, bytes, and the functions on the way there. `times`: how
    often a function that calls itself is on the stack at most."""
    known = {}

    def visit(at, above):
        if at in above:
            raise ValueError("%s calls itself" % graph[at].name)
        if at not in known:
            ways = [visit(to, above + (at,)) for to in graph[at].callees]
            depth, way = max(ways, default=(0, ()))
            frames = times(graph[at].name) if graph[at].calls_itself else 1
            known[at] = (graph[at].frame * frames + depth, (at,) + way)
        return known[at]

    depth, way = visit(start, ())
    return depth, [graph[at] for at in way]


def reached(graph, start):
    """Addresses of all functions that `start` calls, itself included."""
    seen, todo = set(), [start]
    while todo:
        at = todo.pop()
        if at not in seen:
            seen.add(at)
            todo.extend(graph[at].callees)
    return seen


def callers(graph, ends):
    """Every function that leads to one of the addresses `ends`: name, and the way there."""
    ways = {end: (end,) for end in ends}
    todo = list(ends)
    while todo:
        at = todo.pop(0)
        for start, function in graph.items():
            if at in function.callees and start not in ways:
                ways[start] = (start,) + ways[at]
                todo.append(start)
    return [[graph[at].name for at in way] for way in ways.values()]
