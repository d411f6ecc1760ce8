// See qemu_recording.h.
#include "counting/qemu_recording.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BUCKETS = 1 << 16 };
static struct block *blocks[BUCKETS];
static char *maps; // text of /proc/self/maps
struct recording recording;

void recording_fail(const char *problem) {
    if (!recording.trouble)
        recording.trouble = problem;
}

static void copy_instruction(const struct qemu_plugin_insn *insn, unsigned char *to, size_t size) {
    if (recording.api >= 3)
        copy_insn_data(insn, to, size);
    else
        memcpy(to, insn_data(insn), size);
}

struct block *recording_block(const struct qemu_plugin_tb *tb) {
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
    struct block **bucket = &blocks[(made->address ^ made->address >> 16) % BUCKETS];
    for (struct block *b = *bucket; b; b = b->next)
        if (b->address == made->address && b->size == size &&
            memcmp(b->bytes, made->bytes, size) == 0) {
            free(made);
            return b;
        }
    made->next = *bucket;
    return *bucket = made;
}

struct repeated *recording_repeated(const struct block *block, uint64_t address) {
    for (struct repeated *r = recording.strings; r; r = r->next)
        if (r->block == block && r->address == address)
            return r;
    struct repeated *made = calloc(1, sizeof *made);
    if (!made)
        return NULL;
    *made = (struct repeated){.next = recording.strings, .block = block, .address = address};
    return recording.strings = made;
}

void recording_enter(const struct block *current) {
    if (recording.inside)
        recording_fail("recursion");
    recording.inside = true;
    for (size_t i = 0; i < BUCKETS; i++)
        for (struct block *b = blocks[i]; b; b = b->next)
            b->before = b->count - (b == current);
}

// Reads the list of files that are mapped into this process, the guest's among them.
static void read_maps(void) {
    FILE *file = fopen("/proc/self/maps", "r");
    size_t size = 0, room = 0;
    while (file) {
        if (size + 1 >= room) {
            char *more = realloc(maps, room = 2 * room + 65536);
            if (!more) {
                recording_fail("memory");
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

void recording_leave(const struct block *current) {
    if (!recording.inside) // reached without a return from the function
        return;
    recording.inside = false;
    recording.regions++;
    for (size_t i = 0; i < BUCKETS; i++)
        for (struct block *b = blocks[i]; b; b = b->next)
            b->sum += b->count - (b == current) - b->before;
    if (!maps)
        read_maps();
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

// Prints a line for each block, repeated instruction and jump of the region; returns their number.
static uint64_t print_counts(FILE *file) {
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
    for (const struct repeated *r = recording.strings; r; r = r->next)
        if (r->block->sum) {
            lines++;
            fprintf(file, "repeated %" PRIx64 " %" PRIx64 " %zu %" PRIu64 " %" PRIu64 "\n",
                    r->address, r->block->address, r->block->size, r->loaded, r->stored);
        }
    for (const struct jump *j = recording.jumps; j; j = j->next)
        if (j->taken) {
            lines++;
            fprintf(file, "taken %" PRIx64 " %" PRIu64 "\n", j->jump + recording.bias, j->taken);
        }
    return lines;
}

void recording_write(void) {
    if (recording.inside)
        recording_fail("unfinished");
    FILE *file = fopen(recording.out, "w");
    if (!file) {
        fprintf(stderr, "qemu_plugin: %s cannot be written\n", recording.out);
        return;
    }
    fprintf(file, "stepwise-qemu 1\ntrouble %s\nstart %" PRIx64 "\nregions %" PRIu64 "\n",
            recording.trouble ? recording.trouble : "none", recording.bias + recording.code,
            recording.regions);
    print_maps(file);
    uint64_t lines = print_counts(file);
    fprintf(file, "end %" PRIu64 "\n", lines);
    if (ferror(file) | fclose(file))
        fprintf(stderr, "qemu_plugin: %s cannot be written\n", recording.out);
}
