// A plugin for QEMU's user-mode emulator: how often each translated block of a program ran, with
// its bytes, between the entry of one function and its return. scripts/study/qemu.py starts it and
// reads what it writes.
//
// The API is QEMU's documented one (docs/devel/tcg-plugins.rst; the comments of qemu-plugin.h say
// what changed from version to version). No header of it is shipped with distributions, so the few
// declarations used stand here. What a version lacks is bound weakly:
//   version 1 (QEMU 6 to 8)   inline counters; qemu_plugin_insn_data returns a pointer
//   version 2 (QEMU 9.0)      inline counters became per vCPU: a callback counts instead
//   version 3 (QEMU 9.1 …)    qemu_plugin_insn_data copies into a buffer
// Run for real on 7.2 only, by inline counters and by callbacks.
//
// Arguments: out=FILE code=X (virtual address of the program's first executable segment) begin=X
// end=X[+X …] (the function's entry and the instructions behind calls of it), addresses as in the
// ELF file, in hexadecimal; jump=FROM+TARGET+NEXT, as often as
// wanted: a conditional jump whose turns are told apart; callback=on to count by callbacks.
// Counters are not atomic: a guest with a second thread is reported, not counted.
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
#define WEAK __attribute__((weak))

typedef uint64_t plugin_id;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
enum { NO_REGS = 0, INLINE_ADD_U64 = 0, MEM_RW = 3, NEWEST_KNOWN = 3 };

struct qemu_info {
    const char *target_name;
    struct {
        int min, cur;
    } version;
    bool system_emulation;
};

typedef void (*on_vcpu)(plugin_id, unsigned);
typedef void (*on_block)(plugin_id, struct qemu_plugin_tb *);
typedef void (*on_finished)(plugin_id, void *);
typedef void (*on_execution)(unsigned, void *);
typedef void (*on_access)(unsigned, uint32_t, uint64_t, void *);

void qemu_plugin_register_vcpu_init_cb(plugin_id, on_vcpu);
void qemu_plugin_register_vcpu_tb_trans_cb(plugin_id, on_block);
void qemu_plugin_register_atexit_cb(plugin_id, on_finished, void *);
void qemu_plugin_register_vcpu_tb_exec_cb(struct qemu_plugin_tb *, on_execution, int, void *);
void qemu_plugin_register_vcpu_insn_exec_cb(struct qemu_plugin_insn *, on_execution, int, void *);
void qemu_plugin_register_vcpu_mem_cb(struct qemu_plugin_insn *, on_access, int, int, void *);
WEAK void qemu_plugin_register_vcpu_tb_exec_inline(struct qemu_plugin_tb *, int, void *, uint64_t);
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *);
uint64_t qemu_plugin_tb_vaddr(const struct qemu_plugin_tb *);
struct qemu_plugin_insn *qemu_plugin_tb_get_insn(const struct qemu_plugin_tb *, size_t);
size_t qemu_plugin_insn_size(const struct qemu_plugin_insn *);
// One symbol, two prototypes (see above).
const void *insn_data(const struct qemu_plugin_insn *) __asm__("qemu_plugin_insn_data");
size_t copy_insn_data(const struct qemu_plugin_insn *, void *,
                      size_t) __asm__("qemu_plugin_insn_data");
unsigned qemu_plugin_mem_size_shift(uint32_t);
bool qemu_plugin_mem_is_store(uint32_t);
WEAK uint64_t qemu_plugin_start_code(void);

EXPORT int qemu_plugin_version = 1;
EXPORT int qemu_plugin_install(plugin_id id, const struct qemu_info *info, int argc, char **argv);

// One that was translated; the same bytes at the same place share it, however often QEMU drops and
// translates them again. `before`: its count when the region began.
struct block {
    struct block *next;
    uint64_t address, count, before, sum;
    size_t size, instructions;
    unsigned char bytes[];
};

// A repeated string instruction of a block: its accesses to memory, which its count does not tell.
struct repeated {
    struct repeated *next;
    const struct block *block;
    uint64_t address, loaded, stored;
};

// A conditional jump: the next block that runs says whether it was taken.
struct jump {
    struct jump *more;
    uint64_t places[3], taken; // places: of the jump, of its target, behind it
};

enum { BUCKETS = 1 << 16, MOST_ENDS = 16 };
static struct block *blocks[BUCKETS];
static struct repeated *repeats;
static struct jump *jumps, *pending;
static const char *out;
static uint64_t code, begin, ends[MOST_ENDS], bias;
static int end_count, api;
static bool by_callback, placed, inside;
static uint64_t left;
static const char *trouble;
static char *maps;

// Before QEMU reads the version wanted: the oldest that this QEMU still takes.
__attribute__((constructor)) static void choose_version(void) {
    qemu_plugin_version = qemu_plugin_register_vcpu_tb_exec_inline ? 1 : 2;
}

static void fail(const char *what) {
    if (!trouble)
        trouble = what;
}

static void on_thread(plugin_id id, unsigned vcpu) {
    (void)id;
    if (vcpu > 0)
        fail("threads");
}

static void count_block(unsigned vcpu, void *block) {
    (void)vcpu;
    ((struct block *)block)->count++;
}

// The block that holds the boundary has been counted already when its first instruction says so:
// it belongs to what comes, on entry and on return alike.
static void each_block(struct block *current, bool entering) {
    for (size_t i = 0; i < BUCKETS; i++)
        for (struct block *b = blocks[i]; b; b = b->next) {
            uint64_t now = b->count - (b == current);
            if (entering)
                b->before = now;
            else
                b->sum += now - b->before;
        }
}

static void on_begin(unsigned vcpu, void *block) {
    (void)vcpu;
    if (inside)
        fail("recursion");
    inside = true;
    each_block(block, true);
}

// The files mapped into this process, the guest's among them.
static void read_maps(void) {
    FILE *file = fopen("/proc/self/maps", "r");
    size_t size = 0, room = 0;
    while (file) {
        if (size + 1 >= room) {
            char *more = realloc(maps, room = 2 * room + 65536);
            if (!more) {
                fail("memory");
                break;
            }
            maps = more;
        }
        size_t got = fread(maps + size, 1, room - size - 1, file);
        maps[size += got] = '\0';
        if (got == 0)
            break;
    }
    if (file)
        fclose(file);
}

static void on_end(unsigned vcpu, void *block) {
    (void)vcpu;
    if (!inside) // reached by another way than the return
        return;
    inside = false;
    left++;
    each_block(block, false);
    if (!maps)
        read_maps();
}

static void on_jump(unsigned vcpu, void *jump) {
    (void)vcpu;
    pending = jump;
}

static void on_arrival(unsigned vcpu, void *block) {
    (void)vcpu;
    if (pending && inside && ((struct block *)block)->address == pending->places[1] + bias)
        pending->taken++;
    pending = NULL;
}

static void on_string(unsigned vcpu, uint32_t info, uint64_t address, void *data) {
    (void)vcpu, (void)address;
    struct repeated *r = data;
    if (!inside)
        return;
    uint64_t bytes = (uint64_t)1 << qemu_plugin_mem_size_shift(info);
    *(qemu_plugin_mem_is_store(info) ? &r->stored : &r->loaded) += bytes;
}

// F2 or F3 among the prefixes and a string instruction behind them.
static bool is_repeated(const unsigned char *bytes, size_t size) {
    bool prefixed = false;
    size_t i = 0;
    for (; i < size && bytes[i]; i++) {
        if (bytes[i] == 0xf2 || bytes[i] == 0xf3)
            prefixed = true;
        else if (!strchr("\x2e\x36\x3e\x26\x64\x65\x66\x67", bytes[i]) && (bytes[i] & 0xf0) != 0x40)
            break;
    }
    return prefixed && i < size &&
           ((bytes[i] >= 0xa4 && bytes[i] <= 0xa7) || (bytes[i] >= 0xaa && bytes[i] <= 0xaf));
}

static void copy_instruction(const struct qemu_plugin_insn *insn, unsigned char *to, size_t size) {
    if (api >= 3)
        copy_insn_data(insn, to, size);
    else
        memcpy(to, insn_data(insn), size);
}

static struct block *find_block(const struct qemu_plugin_tb *tb) {
    size_t count = qemu_plugin_tb_n_insns(tb), size = 0;
    for (size_t i = 0; i < count; i++)
        size += qemu_plugin_insn_size(qemu_plugin_tb_get_insn(tb, i));
    struct block *made = calloc(1, sizeof *made + size);
    if (!made)
        return NULL;
    made->address = qemu_plugin_tb_vaddr(tb);
    made->size = size;
    made->instructions = count;
    unsigned char *to = made->bytes;
    for (size_t i = 0; i < count; i++) {
        const struct qemu_plugin_insn *insn = qemu_plugin_tb_get_insn(tb, i);
        size_t length = qemu_plugin_insn_size(insn);
        copy_instruction(insn, to, length);
        to += length;
    }
    struct block **place = &blocks[(made->address ^ made->address >> 16) % BUCKETS];
    for (struct block *b = *place; b; b = b->next)
        if (b->address == made->address && b->size == size &&
            memcmp(b->bytes, made->bytes, size) == 0) {
            free(made);
            return b;
        }
    made->next = *place;
    return *place = made;
}

static struct repeated *find_repeated(const struct block *block, uint64_t address) {
    for (struct repeated *r = repeats; r; r = r->next)
        if (r->block == block && r->address == address)
            return r;
    struct repeated *made = calloc(1, sizeof *made);
    if (!made)
        return NULL;
    *made = (struct repeated){.next = repeats, .block = block, .address = address};
    return repeats = made;
}

static bool is_end(uint64_t address) {
    for (int i = 0; i < end_count; i++)
        if (address == ends[i] + bias)
            return true;
    return false;
}

static void on_translation(plugin_id id, struct qemu_plugin_tb *tb) {
    (void)id;
    if (!placed) {
        bias = qemu_plugin_start_code() - code;
        placed = true;
    }
    struct block *block = find_block(tb);
    if (!block) {
        fail("memory");
        return;
    }
    if (qemu_plugin_register_vcpu_tb_exec_inline && !by_callback)
        qemu_plugin_register_vcpu_tb_exec_inline(tb, INLINE_ADD_U64, &block->count, 1);
    else
        qemu_plugin_register_vcpu_tb_exec_cb(tb, count_block, NO_REGS, block);
    // A call, a return and a jump all start a block.
    struct qemu_plugin_insn *first = qemu_plugin_tb_get_insn(tb, 0);
    for (const struct jump *j = jumps; j; j = j->more)
        if (block->address == j->places[1] + bias || block->address == j->places[2] + bias) {
            qemu_plugin_register_vcpu_insn_exec_cb(first, on_arrival, NO_REGS, block);
            break;
        }
    size_t offset = 0;
    for (size_t i = 0; i < block->instructions; i++) {
        struct qemu_plugin_insn *insn = qemu_plugin_tb_get_insn(tb, i);
        size_t length = qemu_plugin_insn_size(insn);
        uint64_t address = block->address + offset;
        if (is_repeated(block->bytes + offset, length)) {
            struct repeated *r = find_repeated(block, address);
            if (r)
                qemu_plugin_register_vcpu_mem_cb(insn, on_string, NO_REGS, MEM_RW, r);
            else
                fail("memory");
        }
        for (struct jump *j = jumps; j; j = j->more)
            if (address == j->places[0] + bias)
                qemu_plugin_register_vcpu_insn_exec_cb(insn, on_jump, NO_REGS, j);
        offset += length;
    }
    if (block->address == begin + bias)
        qemu_plugin_register_vcpu_insn_exec_cb(first, on_begin, NO_REGS, block);
    else if (is_end(block->address))
        qemu_plugin_register_vcpu_insn_exec_cb(first, on_end, NO_REGS, block);
}

static void print_maps(FILE *file) {
    char *rest = maps;
    for (char *line; rest && (line = strsep(&rest, "\n"));) {
        uint64_t start, stop, offset;
        char mode[5];
        int path = 0;
        if (sscanf(line, "%" SCNx64 "-%" SCNx64 " %4s %" SCNx64 " %*s %*s %n", &start, &stop, mode,
                   &offset, &path) == 4 &&
            path > 0 && line[path] == '/')
            fprintf(file, "map %" PRIx64 " %" PRIx64 " %" PRIx64 " %s\n", start, stop, offset,
                    line + path);
    }
}

static void on_finish(plugin_id id, void *data) {
    (void)id, (void)data;
    if (inside)
        fail("unfinished");
    FILE *file = fopen(out, "w");
    if (!file) {
        fprintf(stderr, "qemu_plugin: %s cannot be written\n", out);
        return;
    }
    fprintf(file, "stepwise-qemu 1\ntrouble %s\nstart %" PRIx64 "\nregions %" PRIu64 "\n",
            trouble ? trouble : "none", bias + code, left);
    print_maps(file);
    uint64_t lines = 0;
    for (size_t i = 0; i < BUCKETS; i++)
        for (const struct block *b = blocks[i]; b; b = b->next) {
            if (!b->sum)
                continue;
            lines++;
            fprintf(file, "block %" PRIx64 " %" PRIu64 " ", b->address, b->sum);
            for (size_t j = 0; j < b->size; j++)
                fprintf(file, "%02x", b->bytes[j]);
            fputc('\n', file);
        }
    for (const struct repeated *r = repeats; r; r = r->next)
        if (r->block->sum) {
            lines++;
            fprintf(file, "repeated %" PRIx64 " %" PRIx64 " %zu %" PRIu64 " %" PRIu64 "\n",
                    r->address, r->block->address, r->block->size, r->loaded, r->stored);
        }
    for (const struct jump *j = jumps; j; j = j->more)
        if (j->taken) {
            lines++;
            fprintf(file, "taken %" PRIx64 " %" PRIu64 "\n", j->places[0] + bias, j->taken);
        }
    fprintf(file, "end %" PRIu64 "\n", lines);
    if (ferror(file) | fclose(file))
        fprintf(stderr, "qemu_plugin: %s cannot be written\n", out);
}

static bool addresses(const char *text, uint64_t *to, int most, int *count) {
    for (*count = 0; *count < most; text++) {
        char *stop;
        to[(*count)++] = strtoull(text, &stop, 16);
        if (stop == text || (*stop && *stop != '+'))
            return false;
        text = stop;
        if (!*text)
            return true;
    }
    return false;
}

static bool add_jump(const char *text) {
    struct jump *made = calloc(1, sizeof *made);
    int count;
    if (!made || !addresses(text, made->places, 3, &count) || count != 3) {
        free(made);
        return false;
    }
    made->more = jumps;
    jumps = made;
    return true;
}

int qemu_plugin_install(plugin_id id, const struct qemu_info *info, int argc, char **argv) {
    int given = 0, count;
    api = info->version.cur < NEWEST_KNOWN ? info->version.cur : NEWEST_KNOWN;
    for (int i = 0; i < argc; i++) {
        char *value = strchr(argv[i], '=');
        size_t length = value ? (size_t)(value++ - argv[i]) : 0;
        bool good = true;
#define IS(name) (length == strlen(name) && strncmp(argv[i], name, length) == 0)
        if (IS("out"))
            out = value;
        else if (IS("code"))
            good = addresses(value, &code, 1, &count);
        else if (IS("begin"))
            good = addresses(value, &begin, 1, &count);
        else if (IS("end"))
            good = addresses(value, ends, MOST_ENDS, &end_count);
        else if (IS("jump"))
            good = add_jump(value);
        else if (IS("callback"))
            by_callback = strcmp(value, "on") == 0;
        else
            good = false;
#undef IS
        if (!good) {
            fprintf(stderr, "qemu_plugin: %s is no argument of it\n", argv[i]);
            return 1;
        }
        given++;
    }
    if (!out || !begin || !end_count || given < 4) {
        fprintf(stderr, "qemu_plugin: out=, code=, begin= and end= are required\n");
        return 1;
    }
    if (info->system_emulation || strcmp(info->target_name, "x86_64") != 0 ||
        !qemu_plugin_start_code) {
        fprintf(stderr,
                "qemu_plugin: user-mode emulation of x86_64 by QEMU 7 or newer is required\n");
        return 1;
    }
    qemu_plugin_register_vcpu_init_cb(id, on_thread);
    qemu_plugin_register_vcpu_tb_trans_cb(id, on_translation);
    qemu_plugin_register_atexit_cb(id, on_finish, NULL);
    return 0;
}
