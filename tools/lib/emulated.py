"""Programs for the emulated Cortex-M4F: their symbols, and what runs in them."""
import collections
import os
import re
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
EMULATOR = ["qemu-system-arm", "-M", "mps2-an386", "-cpu", "cortex-m4", "-nographic",
            "-monitor", "none", "-serial", "null", "-icount", "shift=8",
            "-semihosting-config", "enable=on,target=native"]


def output_of(command, **more):
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, **more)
    if done.returncode != 0:
        sys.exit("failed: %s\n%s" % (" ".join(command), done.stdout))
    return done.stdout


class Symbols:
    """Functions of a program: address and size by demangled name."""

    def __init__(self, program):
        self.functions = []
        self.stack_floor = 0
        for line in output_of(["arm-none-eabi-nm", "-C", "-S", program]).splitlines():
            sized = re.match(r"([0-9a-f]{8}) ([0-9a-f]{8}) [tTwW] (.*)", line)
            if sized:
                address, size, name = int(sized[1], 16) & ~1, int(sized[2], 16), sized[3]
                self.functions.append((address, size, re.sub(r"::h[0-9a-f]{16}$", "", name)))
            end = re.match(r"([0-9a-f]{8}) \S __ebss$", line)
            if end:
                self.stack_floor = int(end[1], 16)
        self.functions.sort()

    def beginning(self, prefix):
        """Addresses of the functions whose names begin so, by the rest of the name."""
        return {name[len(prefix):]: address for address, _, name in self.functions
                if name.startswith(prefix)}

    def code_of(self, addresses):
        """Bytes of all functions that hold one of the addresses."""
        return sum(size for start, size, _ in self.functions
                   if any(start <= a < start + size for a in addresses))


def count(program, symbols, entries):
    """Runs the program under the plug-in: its text, and per function of `entries` (name to
    address) calls and steps."""
    names = list(entries)
    with tempfile.TemporaryDirectory(prefix="truepose-cost-") as room:
        record = os.path.join(room, "record")
        arguments = ["out=" + record, "stack=0x%x" % symbols.stack_floor]
        arguments += ["at=0x%x" % entries[name] for name in names]
        for api in range(1, 6):
            plugin = os.path.join(room, "count%d.so" % api)
            output_of(["cc", "-O2", "-shared", "-fPIC", "-DPLUGIN_API=%d" % api, "-o", plugin,
                       os.path.join(HERE, "count.c")])
            run = subprocess.run(EMULATOR + ["-plugin", ",".join([plugin] + arguments),
                                             "-kernel", program],
                                 stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=900)
            if "API version" not in run.stderr:
                break
        if run.returncode != 0:
            sys.exit("the emulator ended with %d\n%s%s" % (run.returncode, run.stdout, run.stderr))
        calls = collections.defaultdict(list)
        steps = collections.defaultdict(dict)
        with open(record) as lines:
            for line in lines:
                word = line.split()
                name = names[int(word[1])]
                if word[0] == "call":
                    calls[name].append((int(word[2]), int(word[3]), int(word[4], 16)))
                elif word[0] == "step":
                    steps[name][int(word[2], 16), int(word[3], 16)] = int(word[4])
                else:
                    sys.exit("%s did not return" % name)
    return run.stdout, calls, steps
