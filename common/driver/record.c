// JSON records: what a frame took, and under which conditions (fields: results/README.md).
#include <gnu/libc-version.h>
#include <math.h>
#include <stdio.h>

#include "driver/driver.h"

enum { SCHEMA = 1 };

// Copies `text` with '?' for every byte beyond ASCII. File names are bytes, JSON must be UTF-8.
static const char *in_ascii(const char *text, char ascii[4096]) {
    size_t i = 0;
    for (; text && text[i] && i < 4095; i++)
        ascii[i] = (unsigned char)text[i] < 0x80 ? text[i] : '?';
    ascii[i] = '\0';
    return text ? ascii : NULL;
}

// Adds the facts of a generated kernel; null for a phase that generates none.
static bool add_kernel_facts(json_t *header, const struct session *s) {
    const struct kernel_facts *facts = phase_kernel ? phase_kernel(s->prepared) : NULL;
    char said[320] = "generated", ascii[4096];
    if (facts && !facts->generated)
        snprintf(said, sizeof said, "general: %s", facts->reason);
    json_t *kernel =
        json_pack("{s:s?, s:s?, s:s?, s:o?, s:o?, s:o?}", "kernel",
                  in_ascii(facts ? said : NULL, ascii), "kernel_hash", facts ? facts->hash : NULL,
                  "kernel_compiler", facts ? facts->compiler : NULL, "kernel_generate_ns",
                  facts ? json_integer((json_int_t)facts->generate_ns) : NULL, "kernel_compile_ns",
                  facts ? json_integer((json_int_t)facts->compile_ns) : NULL, "kernel_load_ns",
                  facts ? json_integer((json_int_t)facts->load_ns) : NULL);
    bool added = header && kernel && json_object_update(header, kernel) == 0;
    json_decref(kernel);
    return added;
}

json_t *driver_header(const struct session *s) {
    char image[4096];
    const struct limits *march = &s->scene.model.march;
    const struct program *program = &s->program;
    const struct scene_overrides *over = &s->options.overrides;
    json_t *about = json_pack(
        "{s:i, s:s, s:s, s:s, s:s, s:i, s:i, s:i, s:s, s:s, s:i, s:s, s:s, s:s, s:f, s:i, s:b, "
        "s:I, s:I, s:f, s:f, s:i, s:s?, s:s?, s:s?}",
        "schema", SCHEMA, "phase", program->phase, "flags_from", program->flags_from, "scene",
        s->scene.name, "scene_hash", s->scene.hash, "width", s->options.width, "height",
        s->options.height, "threads", s->options.threads, "isa", program->variant.isa, "precision",
        program->precision, "lanes", program->variant.lanes, "flags", program->variant.flags,
        "compiler", program->compiler, "libc", gnu_get_libc_version(), "hit_distance",
        march->hit_distance, "max_steps", march->max_steps, "overridden",
        over->hit_distance > 0 || over->max_steps > 0, "prepare_ns", (json_int_t)s->prepare_ns,
        "timer_overhead_cycles", (json_int_t)s->overhead, "tsc_hz", s->tsc_hz, "core_hz_load",
        s->core_hz_load, "cpu", driver_cpu(), "image", in_ascii(s->options.out, image), "settings",
        phase_settings ? phase_settings(s->prepared) : NULL, "display",
        !s->options.display ? NULL
        : s->rgb8           ? "driver"
                            : "phase");
    // Only where there are several: every record of a run is of one ray a pixel.
    int samples = s->options.samples;
    if (add_kernel_facts(about, s) &&
        (samples == 1 || json_object_set_new(about, "samples", json_integer(samples)) == 0))
        return about;
    json_decref(about);
    return NULL;
}

bool driver_print(json_t *object) {
    bool ok = object && json_dumpf(object, stdout, JSON_REAL_PRECISION(15)) == 0 &&
              fputc('\n', stdout) != EOF && fflush(stdout) == 0;
    json_decref(object);
    return ok;
}

json_t *driver_record(const struct measured *m, const struct session *s, int index, bool warmup,
                      bool first) {
    const struct conditions *before = &m->before, *after = &m->after;
    return json_pack("{s:i, s:b, s:b, s:I, s:I, s:f, s:I, s:f, s:f, s:f, s:f, s:I, s:I, s:I, s:I, "
                     "s:I, s:I, s:I}",
                     "frame", index, "warmup", warmup, "first", first, "ns", (json_int_t)m->ns,
                     "update_ns", (json_int_t)m->update_ns, "scene_time", m->scene_time,
                     "tsc_cycles", (json_int_t)m->tsc, "core_cycles",
                     round((double)m->ns * (m->core_before + m->core_after) / 2e9), "tsc_hz",
                     s->tsc_hz, "core_hz_before", m->core_before, "core_hz_after", m->core_after,
                     "present_ns", (json_int_t)m->present_ns, "steal_ticks",
                     (json_int_t)(after->steal_ticks - before->steal_ticks), "ctx_voluntary",
                     (json_int_t)(after->ctx_voluntary - before->ctx_voluntary), "ctx_involuntary",
                     (json_int_t)(after->ctx_involuntary - before->ctx_involuntary), "faults_minor",
                     (json_int_t)(after->faults_minor - before->faults_minor), "faults_major",
                     (json_int_t)(after->faults_major - before->faults_major), "max_rss_kib",
                     (json_int_t)after->max_rss_kib);
}
