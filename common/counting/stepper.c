// Runs a program one instruction at a time (ptrace) between the entry of one function and its return, and
// counts how often each instruction was executed. The program is the one that is timed, unchanged, on this
// processor, with all its instruction sets. scripts/study/counting/ptrace.py starts it.
//
//   stepper OUT ENTRY BEGIN PROGRAM [ARGUMENT …]
//   stepper --probe        ends with 0 if a program can be stepped here
//
// Addresses are hexadecimal, as in the ELF file: its entry and the function. OUT gets one JSON object:
// `trouble` (none if all was counted), `bias` (how far the program was moved from its file's addresses),
// `regions` (calls of the function), `maps` (first address, one behind the last, file) and `steps` (address,
// executions, bytes of code, and of a repeated string instruction bytes loaded and stored, of a masked one
// the active lanes if there are 1, 2, 4 … 32).
#ifndef __x86_64__
#error "stepper: decodes x86-64 instructions; on other machines counts are declared (costs.def)"
#endif

#include <cpuid.h>
#include <elf.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <search.h>
#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/uio.h>
#include <sys/user.h>
#include <sys/wait.h>
#include <unistd.h>

enum { LONGEST = 15, WIDTHS = 6, CANNOT = 3, NO_PROGRAM = 127, MASKS = 8, MASK_STATE = 5 };
#define REGISTER(name) offsetof(struct user_regs_struct, name)

// One instruction. `active`: lanes that a mask let through, if there are 1, 2, 4, 8, 16 or 32.
struct step {
    uint64_t address, count, loaded, stored, active[WIDTHS];
    uint8_t code[LONGEST];
    size_t size;     // of the code that could be read
    size_t repeated; // length of a repeated string instruction; 0: it is none
    int mask;        // number of its k register, 0: none
};

static struct {
    pid_t pid;
    int memory; // /proc/PID/mem
    uint64_t bias, begin, mask_offset;
    int regions;
    void *steps; // of tsearch
    const char *trouble;
    char *maps;
    FILE *out;
    const char *separator;
} it = {.trouble = "none"};

static void fail(const char *what) {
    fprintf(stderr, "stepper: %s: %s\n", what, strerror(errno));
    exit(CANNOT);
}

static uint64_t peek(size_t reg) {
    errno = 0;
    uint64_t value = (uint64_t)ptrace(PTRACE_PEEKUSER, it.pid, reg, NULL);
    if (errno)
        fail("PTRACE_PEEKUSER");
    return value;
}

static size_t prefixes(const uint8_t *code, size_t size) {
    size_t i = 0;
    while (i < size && code[i] && (strchr("\x2e\x36\x3e\x26\x64\x65\x66\x67\xf2\xf3", code[i])))
        i++;
    return i;
}

// What the bytes say that counting must know (Intel SDM vol. 2, 2.1 and 2.7): EVEX and its mask, or a string
// instruction with a prefix F2 or F3.
static void classify(struct step *s) {
    size_t i = prefixes(s->code, s->size);
    bool repeated = memchr(s->code, 0xf2, i) || memchr(s->code, 0xf3, i);
    if (i + 3 < s->size && s->code[i] == 0x62)
        s->mask = s->code[i + 3] & 7;
    if (i < s->size && (s->code[i] & 0xf0) == 0x40)
        i++;
    uint8_t opcode = i < s->size ? s->code[i] : 0;
    if (repeated && ((opcode >= 0xa4 && opcode <= 0xa7) || (opcode >= 0xaa && opcode <= 0xaf)))
        s->repeated = i + 1;
}

static int by_address(const void *a, const void *b) {
    uint64_t one = ((const struct step *)a)->address, other = ((const struct step *)b)->address;
    return (one > other) - (one < other);
}

static struct step *step_at(uint64_t address) {
    struct step key = {.address = address};
    struct step **found = tfind(&key, &it.steps, by_address);
    if (found)
        return *found;
    struct step *made = calloc(1, sizeof *made);
    if (!made || !tsearch((made->address = address, made), &it.steps, by_address))
        fail("counting");
    ssize_t size = pread(it.memory, made->code, LONGEST, (off_t)address);
    made->size = size > 0 ? (size_t)size : 0;
    classify(made);
    return made;
}

static void add_active(struct step *s) {
    uint8_t state[4096];
    struct iovec area = {state, it.mask_offset + MASKS * sizeof(uint64_t)};
    if (!it.mask_offset || area.iov_len > sizeof state ||
        ptrace(PTRACE_GETREGSET, it.pid, (void *)NT_X86_XSTATE, &area) != 0)
        fail("reading the masks");
    uint64_t mask;
    memcpy(&mask, state + it.mask_offset + (size_t)s->mask * sizeof mask, sizeof mask);
    for (int i = 0; i < WIDTHS; i++)
        s->active[i] += (uint64_t)__builtin_popcountll(mask & (((uint64_t)1 << (1 << i)) - 1));
}

// Bytes of the iterations that a repeated string instruction did while rcx fell by `elements`.
static void add_string(struct step *s, uint64_t elements) {
    uint8_t opcode = s->code[s->repeated - 1], rex = s->repeated > 1 ? s->code[s->repeated - 2] : 0;
    bool wide = (rex & 0xf8) == 0x48, small = memchr(s->code, 0x66, s->repeated - 1);
    uint64_t bytes = elements * (opcode % 2 == 0 ? 1 : wide ? 8 : small ? 2 : 4);
    int kind = opcode & ~1; // A4 MOVS, A6 CMPS, AA STOS, AC LODS, AE SCAS
    s->loaded += kind == 0xaa ? 0 : kind == 0xa6 ? 2 * bytes : bytes;
    s->stored += kind == 0xa4 || kind == 0xaa ? bytes : 0;
}

// Lets the program go on until it stops; returns the signal that it waits to be given, −1: it has ended.
static int proceed(enum __ptrace_request how, int sig, int *status) {
    if (ptrace(how, it.pid, NULL, (void *)(intptr_t)sig) != 0 ||
        waitpid(it.pid, status, __WALL) != it.pid)
        fail("ptrace");
    if (!WIFSTOPPED(*status))
        return -1;
    if (*status >> 16 == PTRACE_EVENT_CLONE)
        it.trouble = "threads";
    return WSTOPSIG(*status) == SIGTRAP ? 0 : WSTOPSIG(*status);
}

static void remember_maps(void) {
    char path[64], *line = NULL;
    size_t room = 0, size = 0;
    snprintf(path, sizeof path, "/proc/%d/maps", (int)it.pid);
    FILE *maps = fopen(path, "r"), *text = open_memstream(&it.maps, &size);
    if (!maps || !text)
        fail(path);
    const char *separator = "";
    while (getline(&line, &room, maps) > 0) {
        uint64_t first, last;
        int at = 0;
        line[strcspn(line, "\n\"\\")] = '\0'; // ends a name before what JSON would have to escape
        if (sscanf(line, "%" SCNx64 "-%" SCNx64 " %*s %*s %*s %*s %n", &first, &last, &at) == 2 &&
            at && line[at]) {
            fprintf(text, "%s[%" PRIu64 ",%" PRIu64 ",\"%s\"]", separator, first, last, line + at);
            separator = ",";
        }
    }
    free(line);
    fclose(maps);
    fclose(text);
}

// Steps from the function's first instruction to behind its return. Returns false if the program ended.
static bool region(int *status) {
    uint64_t stack = peek(REGISTER(rsp)), back, at = peek(REGISTER(rip)), from = 0;
    if (pread(it.memory, &back, sizeof back, (off_t)stack) != sizeof back)
        fail("reading the return address");
    for (int sig = 0; at != back || peek(REGISTER(rsp)) != stack + sizeof back;) {
        struct step *s = step_at(at);
        bool again = s->repeated && from == at;
        uint64_t left = s->repeated ? peek(REGISTER(rcx)) : 0;
        s->count += !again;
        if (s->mask)
            add_active(s);
        if (at == it.begin && from)
            it.trouble = "recursion";
        from = at;
        sig = proceed(PTRACE_SINGLESTEP, sig, status);
        if (sig < 0 && WIFEXITED(*status))
            it.trouble = "unfinished";
        if (sig < 0 || strcmp(it.trouble, "none") != 0)
            return sig >= 0;
        at = peek(REGISTER(rip));
        if (s->repeated)
            add_string(s, left - peek(REGISTER(rcx)));
    }
    it.regions++;
    return true;
}

static void write_step(const void *node, VISIT visit, void *unused) {
    (void)unused;
    if (visit != postorder && visit != leaf)
        return;
    const struct step *s = *(const struct step *const *)node;
    fprintf(it.out, "%s[%" PRIu64 ",%" PRIu64 ",\"", it.separator, s->address, s->count);
    it.separator = ",\n";
    for (size_t i = 0; i < (s->repeated ? s->repeated : s->size); i++)
        fprintf(it.out, "%02x", s->code[i]);
    fprintf(it.out, "\",%" PRIu64 ",%" PRIu64 ",[", s->loaded, s->stored);
    for (int i = 0; i < WIDTHS; i++)
        fprintf(it.out, "%s%" PRIu64, i ? "," : "", s->active[i]);
    fputs("]]", it.out);
}

static void write_steps(const char *path) {
    it.out = fopen(path, "w");
    it.separator = "";
    if (!it.out)
        fail(path);
    fprintf(it.out,
            "{\"trouble\":\"%s\",\"bias\":%" PRIu64 ",\"regions\":%d,\"maps\":[%s],\"steps\":[",
            it.trouble, it.bias, it.regions, it.maps ? it.maps : "");
    twalk_r(it.steps, write_step, NULL);
    fputs("]}\n", it.out);
    if (ferror(it.out) || fclose(it.out) != 0)
        fail(path);
}

// Starts the program, stopped before its first instruction.
static void start(char **command) {
    it.pid = fork();
    if (it.pid == 0) {
        if (ptrace(PTRACE_TRACEME, 0, NULL, NULL) != 0)
            fail("ptrace");
        execvp(command[0], command);
        fprintf(stderr, "stepper: %s: %s\n", command[0], strerror(errno));
        _exit(NO_PROGRAM);
    }
    int status = 0;
    if (it.pid < 0 || waitpid(it.pid, &status, 0) != it.pid)
        fail("starting");
    if (WIFEXITED(status))
        exit(WEXITSTATUS(status));
    uintptr_t options = PTRACE_O_EXITKILL | PTRACE_O_TRACECLONE;
    if (ptrace(PTRACE_SETOPTIONS, it.pid, NULL, (void *)options) != 0)
        fail("PTRACE_SETOPTIONS");
}

// How far the program was moved from its file's addresses, by its entry (AT_ENTRY).
static void find_bias(uint64_t entry) {
    char path[64];
    Elf64_auxv_t one;
    snprintf(path, sizeof path, "/proc/%d/auxv", (int)it.pid);
    FILE *auxv = fopen(path, "r");
    while (auxv && fread(&one, sizeof one, 1, auxv) == 1)
        if (one.a_type == AT_ENTRY)
            it.bias = one.a_un.a_val - entry;
    snprintf(path, sizeof path, "/proc/%d/mem", (int)it.pid);
    it.memory = open(path, O_RDONLY | O_CLOEXEC);
    if (!auxv || it.memory < 0)
        fail(path);
    fclose(auxv);
    it.begin += it.bias;
    unsigned size, offset, c, d;
    if (__get_cpuid_count(0xd, MASK_STATE, &size, &offset, &c, &d) && size)
        it.mask_offset =
            offset; // in the standard format, which the kernel gives (Intel SDM vol. 1, 13.4)
}

static void run(void) {
    errno = 0;
    long word = ptrace(PTRACE_PEEKTEXT, it.pid, (void *)it.begin, NULL), trap = 0xcc;
    if (errno)
        fail("reading the function");
    trap |= word & ~0xffL;
    int status = 0, sig = 0;
    for (bool alive = true; alive && strcmp(it.trouble, "none") == 0;) {
        if (ptrace(PTRACE_POKETEXT, it.pid, (void *)it.begin, (void *)trap) != 0)
            fail("PTRACE_POKETEXT");
        sig = proceed(PTRACE_CONT, sig, &status);
        alive = sig >= 0;
        if (sig == 0 && peek(REGISTER(rip)) == it.begin + 1) {
            if (ptrace(PTRACE_POKETEXT, it.pid, (void *)it.begin, (void *)word) != 0 ||
                ptrace(PTRACE_POKEUSER, it.pid, REGISTER(rip), (void *)it.begin) != 0)
                fail("PTRACE_POKEUSER");
            alive = region(&status);
            if (alive && !it.maps)
                remember_maps();
        }
    }
    if (strcmp(it.trouble, "none") == 0 && WIFSIGNALED(status)) {
        signal(WTERMSIG(status), SIG_DFL);
        raise(WTERMSIG(status));
    }
    if (strcmp(it.trouble, "none") == 0 && WEXITSTATUS(status))
        exit(WEXITSTATUS(status));
}

int main(int argc, char **argv) {
    int status;
    if (argc == 2 && strcmp(argv[1], "--probe") == 0) {
        start((char *[]){"/proc/self/exe", NULL});
        return proceed(PTRACE_SINGLESTEP, 0, &status) == 0 ? 0
                                                           : CANNOT; // it dies with this process
    }
    if (argc < 5) {
        fprintf(stderr, "stepper: OUT ENTRY BEGIN PROGRAM … is required\n");
        return 2;
    }
    it.begin = strtoull(argv[3], NULL, 16);
    start(argv + 4);
    find_bias(strtoull(argv[2], NULL, 16));
    run();
    write_steps(argv[1]);
    return 0;
}
