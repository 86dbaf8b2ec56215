/* Firmware in C for the emulated Cortex-M4F board (QEMU's mps2-an386): answers the requests of
 * tests/firmware/src/compensation.rs and prints each answer as that program does. */
#include <truepose.h>

#define JOINTS 6
#define SCATTERED 2000
#define ALONG_A_PATH 100

/* The blobs, as bytes between two symbols. */
#define BLOB(name, file)                                            \
    extern const uint8_t name[], name##_end[];                      \
    __asm__(".section .rodata\n.balign 4\n.global " #name "\n"      \
            #name ":\n.incbin \"" file "\"\n.global " #name "_end\n" \
            #name "_end:\n.previous\n")
BLOB(rigid, "rigid.tpb");
BLOB(spherical, "spherical.tpb");
BLOB(with_effects, "with_effects.tpb");

/* The emulator's console and its end: semihosting. */
static uint32_t semihosting(uint32_t operation, const void *argument) {
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static _Noreturn void leave(bool well) {
    /* SYS_EXIT with ADP_Stopped_ApplicationExit or ADP_Stopped_RunTimeErrorUnknown. */
    semihosting(0x18, (const void *)(uintptr_t)(well ? 0x20026u : 0x20023u));
    for (;;) {
    }
}

/* SYS_OPEN of the console to write: the handle of standard output. */
static uint32_t console(void) {
    static const struct {
        const char *name;
        uint32_t mode, length;
    } terminal = {":tt", 4, 3};
    return semihosting(0x01, &terminal);
}

static uint32_t out;
static char line[128];
static size_t length;

static void text(const char *characters) {
    while (*characters != '\0' && length < sizeof line - 1) {
        line[length++] = *characters++;
    }
}

static void hexadecimal(float number) {
    union {
        float number;
        uint32_t bits;
    } word = {number};
    char digits[9] = {0};
    for (int k = 7; k >= 0; k--) {
        digits[k] = "0123456789abcdef"[word.bits & 15u];
        word.bits >>= 4;
    }
    text(digits);
}

static void end_of_line(void) {
    text("\n");
    const struct {
        uint32_t handle;
        const char *bytes;
        uint32_t length;
    } block = {out, line, length};
    semihosting(0x05, &block); /* SYS_WRITE */
    length = 0;
}

/* The same random numbers as tests/firmware/src/draws.rs. */
static uint64_t state;

static uint64_t bits(void) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    return state;
}

static void seed(uint64_t value) {
    state = value;
    bits();
}

static float symmetric(void) {
    return (float)(uint32_t)(bits() >> 40) * (1.0f / 8388608.0f) - 1.0f;
}

static const float travel[JOINTS] = {2.7f, 2.2f, 2.3f, 2.4f, 1.7f, 4.6f};

static const char *const statuses[] = {
    "Converged",   "Settled",   "IterationLimit",      "OutOfBudget", "ConditionsNotFinite",
    "NotAPose", "PredictionNotFinite", "JointsNotFinite", "OutsideRegion", "NotTaught",
};

static void answer(struct truepose_compensator *arm, const struct truepose_request *request) {
    struct truepose_outcome outcome;
    if (truepose_correct(arm, request, NULL, &outcome) != TRUEPOSE_OK) {
        leave(false);
    }
    for (size_t j = 0; j < JOINTS; j++) {
        hexadecimal(outcome.q[j]);
        text(" ");
    }
    text(statuses[outcome.status]);
    const char iterations[] = {' ', (char)('0' + outcome.iterations), '\0'};
    text(iterations);
    end_of_line();
}

static void run(struct truepose_compensator *arm) {
    struct truepose_request request;
    seed(3);
    for (int index = 0; index < SCATTERED; index++) {
        truepose_reset(arm);
        truepose_request_default(&request);
        for (size_t j = 0; j < JOINTS; j++) {
            request.q[j] = travel[j] * symmetric();
        }
        request.has_pose = index % 2 == 0;
        if (request.has_pose) {
            truepose_nominal_pose(arm, request.q, &request.pose);
        }
        request.conditions.payload = 2.0f + 2.0f * symmetric();
        request.conditions.payload_com[1] = 0.02f;
        request.conditions.payload_com[2] = 0.05f;
        for (size_t j = 0; j < JOINTS; j++) {
            request.conditions.direction[j] = symmetric() < 0.0f ? -1.0f : 1.0f;
        }
        answer(arm, &request);
    }
    truepose_reset(arm);
    for (int index = 0; index < ALONG_A_PATH; index++) {
        const float way = (float)index / (float)ALONG_A_PATH - 0.5f;
        truepose_request_default(&request);
        for (size_t j = 0; j < JOINTS; j++) {
            request.q[j] = 0.6f * travel[j] * way + 0.3f;
        }
        answer(arm, &request);
    }
}

/* Zero, and stays where it is. */
static struct truepose_compensator arm;

int main(void) {
    struct truepose_request request;
    struct truepose_outcome outcome;
    out = console();
    /* What must be refused is refused. */
    bool well = truepose_joints() == JOINTS &&
                truepose_request_default(NULL) == TRUEPOSE_NULL_POINTER &&
                truepose_request_default(&request) == TRUEPOSE_OK &&
                truepose_correct(&arm, &request, NULL, &outcome) == TRUEPOSE_NOT_READY &&
                truepose_init(&arm, rigid, 3) == TRUEPOSE_BLOB_NOT_ONE;
    if (!well || truepose_init(&arm, rigid, (size_t)(rigid_end - rigid)) != TRUEPOSE_OK) {
        leave(false);
    }
    /* A second blob that is refused leaves the first in use. */
    if (truepose_init(&arm, rigid + 1, 100) != TRUEPOSE_BLOB_NOT_ONE) {
        leave(false);
    }
    run(&arm);
    if (truepose_init(&arm, spherical, (size_t)(spherical_end - spherical)) != TRUEPOSE_OK) {
        leave(false);
    }
    run(&arm);
    if (truepose_init(&arm, with_effects, (size_t)(with_effects_end - with_effects)) !=
        TRUEPOSE_OK) {
        leave(false);
    }
    run(&arm);
    leave(true);
}
