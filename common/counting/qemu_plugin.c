// A plugin for QEMU's user-mode emulator. It counts how often each translated block of a program runs
// between the entry of one function and its return. scripts/study/counting/qemu.py starts it;
// qemu_recording.c keeps the counts and writes them. Tested with QEMU 7.2 only, with inline counters
// and with callbacks.
//
// Arguments; addresses are hexadecimal, as in the ELF file:
//   out=FILE                   the file to write
//   code=X                     address of the program's first executable segment
//   begin=X                    entry of the function
//   end=X[+X …]                the instructions after the calls of the function
//   jump=FROM+TARGET+NEXT      a conditional jump whose taken executions are counted; any number
//   callback=on                counts by callbacks instead of inline counters
// Counters are not atomic: a guest with a second thread is reported instead of counted.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "counting/qemu_api.h"
#include "counting/qemu_recording.h"

EXPORT int qemu_plugin_version = 1;
EXPORT int qemu_plugin_install(plugin_id id, const struct qemu_info *info, int argc, char **argv);

enum { MAX_ENDS = 16 };
static uint64_t begin, ends[MAX_ENDS];
static int end_count;
static bool by_callback, code_known, bias_known;
static struct jump *pending; // the jump that was executed last, until the next block runs

// Runs before QEMU reads the version, and chooses the oldest one that this QEMU accepts.
__attribute__((constructor)) static void choose_version(void) {
    qemu_plugin_version = qemu_plugin_register_vcpu_tb_exec_inline ? 1 : 2;
}

static void on_thread(plugin_id id, unsigned vcpu) {
    (void)id;
    if (vcpu > 0)
        recording_fail("threads");
}

static void count_block(unsigned vcpu, void *block) {
    (void)vcpu;
    ((struct block *)block)->count++;
}

static void on_begin(unsigned vcpu, void *block) {
    (void)vcpu;
    recording_enter(block);
}

static void on_end(unsigned vcpu, void *block) {
    (void)vcpu;
    recording_leave(block);
}

static void on_jump(unsigned vcpu, void *jump) {
    (void)vcpu;
    pending = jump;
}

// The first instruction of a block that a counted jump leads to.
static void on_arrival(unsigned vcpu, void *block) {
    (void)vcpu;
    if (pending && recording.inside &&
        ((struct block *)block)->address == pending->target + recording.bias)
        pending->taken++;
    pending = NULL;
}

static void on_string(unsigned vcpu, uint32_t info, uint64_t address, void *data) {
    (void)vcpu, (void)address;
    struct repeated *r = data;
    if (!recording.inside)
        return;
    uint64_t bytes = (uint64_t)1 << qemu_plugin_mem_size_shift(info);
    *(qemu_plugin_mem_is_store(info) ? &r->stored : &r->loaded) += bytes;
}

// Returns whether this is a string instruction with a prefix F2 or F3.
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

static bool is_end(uint64_t address) {
    for (int i = 0; i < end_count; i++)
        if (address == ends[i] + recording.bias)
            return true;
    return false;
}

// Registers callbacks for the instructions of a block that are jumps or repeated string instructions.
static void watch_instructions(const struct qemu_plugin_tb *tb, const struct block *block) {
    size_t offset = 0;
    for (size_t i = 0; i < block->instructions; i++) {
        struct qemu_plugin_insn *insn = qemu_plugin_tb_get_insn(tb, i);
        size_t length = qemu_plugin_insn_size(insn);
        uint64_t address = block->address + offset;
        if (is_repeated(block->bytes + offset, length)) {
            struct repeated *r = recording_repeated(block, address);
            if (r)
                qemu_plugin_register_vcpu_mem_cb(insn, on_string, NO_REGS, MEM_RW, r);
            else
                recording_fail("memory");
        }
        for (struct jump *j = recording.jumps; j; j = j->next)
            if (address == j->jump + recording.bias)
                qemu_plugin_register_vcpu_insn_exec_cb(insn, on_jump, NO_REGS, j);
        offset += length;
    }
}

static void on_translation(plugin_id id, struct qemu_plugin_tb *tb) {
    (void)id;
    if (!bias_known) {
        recording.bias = qemu_plugin_start_code() - recording.code;
        bias_known = true;
    }
    struct block *block = recording_block(tb);
    if (!block) {
        recording_fail("memory");
        return;
    }
    if (qemu_plugin_register_vcpu_tb_exec_inline && !by_callback)
        qemu_plugin_register_vcpu_tb_exec_inline(tb, INLINE_ADD_U64, &block->count, 1);
    else
        qemu_plugin_register_vcpu_tb_exec_cb(tb, count_block, NO_REGS, block);
    // Calls, returns and jumps lead to the start of a block.
    struct qemu_plugin_insn *first = qemu_plugin_tb_get_insn(tb, 0);
    for (const struct jump *j = recording.jumps; j; j = j->next)
        if (block->address == j->target + recording.bias ||
            block->address == j->fallthrough + recording.bias) {
            qemu_plugin_register_vcpu_insn_exec_cb(first, on_arrival, NO_REGS, block);
            break;
        }
    watch_instructions(tb, block);
    if (block->address == begin + recording.bias)
        qemu_plugin_register_vcpu_insn_exec_cb(first, on_begin, NO_REGS, block);
    else if (is_end(block->address))
        qemu_plugin_register_vcpu_insn_exec_cb(first, on_end, NO_REGS, block);
}

static void on_finish(plugin_id id, void *data) {
    (void)id, (void)data;
    recording_write();
}

// Reads 1 to `max` hexadecimal addresses separated by '+'. Returns false if the text is anything else.
static bool parse_addresses(const char *text, uint64_t *to, int max, int *count) {
    for (*count = 0; *count < max; text++) {
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

static bool parse_address(const char *text, uint64_t *to) {
    int count;
    return parse_addresses(text, to, 1, &count);
}

static bool add_jump(const char *text) {
    uint64_t addresses[3];
    int count;
    struct jump *made = calloc(1, sizeof *made);
    if (!made || !parse_addresses(text, addresses, 3, &count) || count != 3) {
        free(made);
        return false;
    }
    *made = (struct jump){.next = recording.jumps,
                          .jump = addresses[0],
                          .target = addresses[1],
                          .fallthrough = addresses[2]};
    recording.jumps = made;
    return true;
}

// Reads one argument NAME=VALUE; false if it is not valid.
static bool parse_argument(const char *argument) {
    const char *equals = strchr(argument, '=');
    char name[16];
    if (!equals || equals - argument >= (ptrdiff_t)sizeof name)
        return false;
    snprintf(name, sizeof name, "%.*s", (int)(equals - argument), argument);
    const char *value = equals + 1;
    if (strcmp(name, "out") == 0)
        recording.out = value;
    else if (strcmp(name, "code") == 0)
        return code_known = parse_address(value, &recording.code);
    else if (strcmp(name, "begin") == 0)
        return parse_address(value, &begin);
    else if (strcmp(name, "end") == 0)
        return parse_addresses(value, ends, MAX_ENDS, &end_count);
    else if (strcmp(name, "jump") == 0)
        return add_jump(value);
    else if (strcmp(name, "callback") == 0)
        by_callback = strcmp(value, "on") == 0;
    else
        return false;
    return true;
}

int qemu_plugin_install(plugin_id id, const struct qemu_info *info, int argc, char **argv) {
    recording.api = info->version.cur < NEWEST_KNOWN ? info->version.cur : NEWEST_KNOWN;
    for (int i = 0; i < argc; i++)
        if (!parse_argument(argv[i])) {
            fprintf(stderr, "qemu_plugin: %s is not a valid argument\n", argv[i]);
            return 1;
        }
    if (!recording.out || !code_known || !begin || !end_count) {
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
