/* A QEMU TCG plug-in that counts what chosen functions execute. tools/cost builds and reads it.
 *
 *   -plugin count.so,out=FILE,at=ENTRY,at=ENTRY...
 *
 * A call of the function at ENTRY lasts from its first instruction until the instruction
 * after its caller's BL is reached; what it calls belongs to it. FILE gets, for the k-th at=:
 *
 *   call K INSTRUCTIONS STACK AT  one line a call; STACK in bytes below the caller's stack
 *                               pointer, AT the instruction (hex) that wrote first
 *   step K FROM TO COUNT        how often TO was executed right after FROM (hex), all calls
 *   open K                      a call that had not returned when the machine stopped
 *
 * STACK is seen from the writes: the first one is taken for the function's own PUSH, just
 * below the caller's stack pointer (the reader checks that it is one), and the lowest one is
 * the depth. Writes below `stack=`
 * (static memory) are left out.
 *
 * The emulator's few entry points used here are declared here: no header of it is needed.
 */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

__attribute__((visibility("default"))) int qemu_plugin_version = PLUGIN_API;

struct qemu_plugin_tb;
struct qemu_plugin_insn;
void qemu_plugin_register_vcpu_tb_trans_cb(uint64_t, void (*)(uint64_t, struct qemu_plugin_tb *));
void qemu_plugin_register_vcpu_insn_exec_cb(struct qemu_plugin_insn *, void (*)(unsigned, void *),
                                            int, void *);
void qemu_plugin_register_vcpu_mem_cb(struct qemu_plugin_insn *,
                                      void (*)(unsigned, uint32_t, uint64_t, void *), int, int,
                                      void *);
void qemu_plugin_register_atexit_cb(uint64_t, void (*)(uint64_t, void *), void *);
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *);
struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *, size_t);
uint64_t qemu_plugin_insn_vaddr(const struct qemu_plugin_insn *);
size_t qemu_plugin_insn_size(const struct qemu_plugin_insn *);
enum { NO_REGISTERS = 0, WRITES = 2 };

enum { FUNCTIONS = 64, STEPS = 1 << 16 };

struct step { uint32_t from, to; uint64_t count; };

static struct function {
    uint32_t entry, back;      /* first instruction; where the present call returns to */
    int open;
    uint64_t instructions;
    uint32_t top, low;         /* caller's stack pointer, lowest write; 0: no write yet */
    uint32_t first_pc;         /* instruction of the first write */
    struct step *steps;        /* open addressing; count 0: free */
} functions[FUNCTIONS];
static unsigned count;
static uint32_t last_pc, after_last, stack_floor;
static FILE *out;

static void tally(struct step *steps, uint32_t from, uint32_t to)
{
    uint32_t place = (from * 2654435761u ^ to * 2246822519u) >> 7;
    for (unsigned tried = 0; tried < STEPS; tried++, place++) {
        struct step *s = &steps[place % STEPS];
        if (!s->count) {
            s->from = from;
            s->to = to;
        }
        if (s->from == from && s->to == to) {
            s->count++;
            return;
        }
    }
    fprintf(stderr, "count: more than %d different steps\n", STEPS);
    abort();
}

static void executed(unsigned cpu, void *insn)
{
    uint64_t word = (uintptr_t)insn;
    uint32_t pc = (uint32_t)word;
    (void)cpu;
    for (unsigned k = 0; k < count; k++) {
        struct function *f = &functions[k];
        if (f->open && pc == f->back) {
            fprintf(out, "call %u %llu %u %x\n", k, (unsigned long long)f->instructions,
                    f->top - f->low, f->first_pc);
            f->open = 0;
        }
        if (!f->open && pc == f->entry) {
            f->open = 1;
            f->back = after_last;
            f->instructions = 0;
            f->top = f->low = f->first_pc = 0;
        }
        if (f->open) {
            tally(f->steps, f->instructions ? last_pc : 0, pc);
            f->instructions++;
        }
    }
    last_pc = pc;
    after_last = pc + (uint32_t)(word >> 32);
}

static void wrote(unsigned cpu, uint32_t info, uint64_t address, void *insn)
{
    uint32_t at = (uint32_t)address;
    (void)cpu, (void)info, (void)insn;
    if (at < stack_floor)
        return;
    for (unsigned k = 0; k < count; k++) {
        struct function *f = &functions[k];
        if (!f->open)
            continue;
        if (!f->first_pc) {
            f->first_pc = last_pc;
            f->low = at;
        }
        if (last_pc == f->first_pc && at + 4 > f->top && f->instructions < 8)
            f->top = at + 4;
        if (at < f->low)
            f->low = at;
    }
}

static void translated(uint64_t id, struct qemu_plugin_tb *block)
{
    (void)id;
    for (size_t i = 0; i < qemu_plugin_tb_n_insns(block); i++) {
        struct qemu_plugin_insn *insn = qemu_plugin_tb_get_insn(block, i);
        uint64_t word = (uint32_t)qemu_plugin_insn_vaddr(insn)
                        | (uint64_t)qemu_plugin_insn_size(insn) << 32;
        void *data = (void *)(uintptr_t)word;
        qemu_plugin_register_vcpu_insn_exec_cb(insn, executed, NO_REGISTERS, data);
        qemu_plugin_register_vcpu_mem_cb(insn, wrote, NO_REGISTERS, WRITES, data);
    }
}

static void stopped(uint64_t id, void *nothing)
{
    (void)id, (void)nothing;
    for (unsigned k = 0; k < count; k++) {
        if (functions[k].open)
            fprintf(out, "open %u\n", k);
        for (unsigned i = 0; i < STEPS; i++) {
            struct step *s = &functions[k].steps[i];
            if (s->count)
                fprintf(out, "step %u %x %x %llu\n", k, s->from, s->to,
                        (unsigned long long)s->count);
        }
    }
    fclose(out);
}

__attribute__((visibility("default"))) int qemu_plugin_install(uint64_t id, const void *info,
                                                               int argc, char **argv)
{
    const char *path = NULL;
    (void)info;
    for (int i = 0; i < argc; i++) {
        const char *value = strchr(argv[i], '=');
        if (!value++)
            return -1;
        if (!strncmp(argv[i], "out", 3)) {
            path = value;
        } else if (!strncmp(argv[i], "stack", 5)) {
            stack_floor = (uint32_t)strtoul(value, NULL, 0);
        } else if (count < FUNCTIONS) {
            functions[count].steps = calloc(STEPS, sizeof(struct step));
            functions[count++].entry = (uint32_t)strtoul(value, NULL, 0);
        }
    }
    out = path ? fopen(path, "w") : NULL;
    if (!out)
        return -1;
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_atexit_cb(id, stopped, NULL);
    return 0;
}
