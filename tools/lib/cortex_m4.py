"""Modelled cycles of a Cortex-M4F.

Sources: the instruction tables of the Cortex-M4 technical reference manual (r0p1, 3.3 and
7.2.3). In the model:

- VADD, VSUB, VMUL, VCMP, VABS, VNEG, VCVT, VMOV of one register 1; multiply-accumulate 3;
  VDIV, VSQRT 14; one more where the next instruction reads the result (the addend of a
  multiply-accumulate is read later and does not wait);
- one load 2, one store 1 (a float's, or to a register-offset address, 2); after another one a
  load or store of an integer, and after a float's load a float's load, 1, unless its address
  comes from the load before; n words at once 1 + n;
- a branch that is taken 1 + 2 to refill the pipeline; everything else 1, division 6.

Not in it: wait states of a flash memory (none in tightly coupled memory, up to some tens of
per cent of the time from a plain flash), contention on the bus, what a VDIV lets the integer
side do meanwhile, unaligned access, interrupts. The manual leaves the refill at 1 to 3 and
the division at 2 to 12. So the figure orders variants; it does not certify a deadline.
"""
import re
import subprocess
from collections import namedtuple

REFILL = 2
CONDITION = "(eq|ne|cs|hs|cc|lo|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)?$"
NUMBERED = re.compile(r"\b([rsd])(\d+)\b")
PLAIN = {"sb": "r9", "sl": "r10", "fp": "r11", "ip": "r12", "sp": "r13", "lr": "r14", "pc": "r15"}

Instruction = namedtuple("Instruction", "size kind cycles writes reads address frame")


def registers(text):
    """All registers in an operand, double ones as their halves, ranges expanded."""
    for word, register in PLAIN.items():
        text = re.sub(r"\b%s\b" % word, register, text)
    found = set()
    for bank, first, last in re.findall(r"\b([rsd])(\d+)-[rsd](\d+)\b", text):
        text += "," + ",".join(bank + str(n) for n in range(int(first), int(last) + 1))
    for bank, number in NUMBERED.findall(text):
        number = int(number)
        if bank == "d":
            found |= {"s%d" % (2 * number), "s%d" % (2 * number + 1)}
        else:
            found.add(bank + str(number))
    return found


def decode(name, operands, size):
    """One line of the disassembly as the model sees it."""
    stem = name.split(".")[0]

    def is_(pattern):
        return re.match("(" + pattern + ")" + CONDITION, stem)

    head, _, tail = operands.partition(",")
    writes, reads, address = registers(head), registers(tail), set()
    kind, cycles = "other", 1
    bracket = re.search(r"\[([^\]]*)\]", operands)
    if bracket:
        address = registers(bracket[1])
    if is_("vfn?m[as]|vn?ml[as]"):
        kind, cycles = "multiply-accumulate", 3
    elif is_("vdiv|vsqrt"):
        kind, cycles = "float", 14
    elif is_("vcmpe?"):
        kind, reads, writes = "float", registers(operands), {"flags"}
    elif is_("vmrs|vmsr"):
        kind, reads, writes = "move", {"flags"}, set()
    elif is_("v?push|v?pop|v?ldm(ia|db|fd)?|v?stm(ia|db|fd)?"):
        braces = re.search(r"\{([^}]*)\}", operands)
        listed = registers(braces[1] if braces else "")
        loads = "pop" in stem or "ldm" in stem
        kind, cycles = "block", 1 + len(listed)
        writes, reads = (listed, set()) if loads else (set(), listed)
    elif is_("ldrd|strd") or (is_("vldr|vstr") and re.match(r"\s*d\d", operands)):
        kind, cycles = "block", 3
        writes = registers(operands.partition("[")[0]) if stem.startswith(("ldr", "vldr")) else set()
        reads = set()
    elif is_("v?ldr(s?[bh])?"):
        kind, cycles, reads = "float load" if stem[0] == "v" else "load", 2, set()
    elif is_("v?str[bh]?"):
        kind, reads, writes = "float store" if stem[0] == "v" else "store", writes, set()
        cycles = 2 if stem[0] == "v" or len(address) > 1 else 1
    elif is_("vmov"):
        # Between the two register files a pair of registers takes two.
        kind, cycles = "move", 1 if operands.count(",") < 2 else 2
    elif stem.startswith("v"):
        kind = "float"
    elif is_("[su]div"):
        cycles = 6
    frame = "push" in stem or (stem.startswith("st") and bool(re.search(r"sp!|\[sp, #-\d+\]!", operands)))
    return Instruction(size, kind, cycles, writes, reads, address, frame)


def disassemble(program):
    """Instructions by address."""
    text = subprocess.run(["arm-none-eabi-objdump", "-d", program], check=True, stdout=subprocess.PIPE,
                          text=True).stdout
    code = {}
    for line in text.splitlines():
        cells = line.split("\t")
        if len(cells) < 3 or not re.match(r"\s*[0-9a-f]+:$", cells[0]) or cells[2].startswith("."):
            continue
        size = 2 if len(cells[1].strip()) == 4 else 4
        operands = re.split(r"[;@<]", "\t".join(cells[3:]))[0]
        code[int(cells[0].strip()[:-1], 16)] = decode(cells[2].strip(), operands, size)
    return code


def opens_frame(instruction):
    """True if the instruction lowers the stack pointer by what it stores there."""
    return instruction is not None and instruction.frame


def cycles(code, steps):
    """Cycles of all steps {(from, to): count}; `from` is 0 where a call begins."""
    total = 0
    for (before, at), times in steps.items():
        this, last = code[at], code.get(before)
        cost = this.cycles
        if last is not None:
            if before + last.size != at:
                cost += REFILL
            pair = (last.kind, this.kind)
            if (pair == ("float load",) * 2 or set(pair) <= {"load", "store"}) \
                    and not last.writes & this.address:
                cost = min(cost, 1)
            if last.kind in ("float", "multiply-accumulate") and last.writes & this.reads:
                cost += 1
        total += times * cost
    return total
