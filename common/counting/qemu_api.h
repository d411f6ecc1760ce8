// QEMU's plugin API: docs/devel/tcg-plugins.rst, and qemu-plugin.h, whose comments list the changes
// from version to version. Distributions do not ship this header, so the declarations that we need
// are here. A function that some version lacks is weak:
//   version 1 (QEMU 6 to 8)   inline counters; qemu_plugin_insn_data returns a pointer
//   version 2 (QEMU 9.0)      inline counters are per vCPU, so a callback counts instead
//   version 3 (QEMU 9.1 …)    qemu_plugin_insn_data copies into a buffer
#ifndef STEPWISE_COUNTING_QEMU_API_H
#define STEPWISE_COUNTING_QEMU_API_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

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
unsigned qemu_plugin_mem_size_shift(uint32_t);
bool qemu_plugin_mem_is_store(uint32_t);
WEAK uint64_t qemu_plugin_start_code(void);

// The two prototypes of qemu_plugin_insn_data, before and from version 3.
const void *insn_data(const struct qemu_plugin_insn *) __asm__("qemu_plugin_insn_data");
size_t copy_insn_data(const struct qemu_plugin_insn *, void *,
                      size_t) __asm__("qemu_plugin_insn_data");

#endif
