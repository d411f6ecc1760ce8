// Writes a kernel's source: the sources embedded in the program (embedded.h, by common/build/phase_info.py from
// phase.json's "embedded"), and the scene as C constants. Floats are hexadecimal, so that every bit is kept.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "embedded.h"
#include "kernel/kernel.h"

// With more shapes, loops over shapes stay loops: unrolled, they would not fit the instruction cache and
// would compile for longer than they save.
enum { MAX_UNROLLED = 12 };

static void write_number(FILE *to, const char *name, double value) {
    if (isinf(value))
        fprintf(to, ".%s = %sINFINITY, ", name, value < 0 ? "-" : "");
    else
        fprintf(to, ".%s = %a, ", name, value);
}

static void write_floats(FILE *to, const char *name, const float *values, int count) {
    fprintf(to, ".%s = {", name);
    for (int i = 0; i < count; i++)
        fprintf(to, "%af, ", (double)values[i]);
    fputs("}, ", to);
}

// Writes the doubles: frames for Mandelbulbs and for hits near the bounds.
static void write_exact(FILE *to, const struct primitive *p) {
    fprintf(to, ".centre = {%a, %a, %a}, .row = {", p->centre[0], p->centre[1], p->centre[2]);
    for (int i = 0; i < 3; i++)
        fprintf(to, "{%a, %a, %a}, ", p->row[i][0], p->row[i][1], p->row[i][2]);
    fprintf(to, "}, .offset = %a, ", p->offset);
}

static void write_cells(FILE *to, const struct primitive *p) {
    fprintf(to, ".next_same_grid = %d, .follows_same_grid = %d, .leader = %d, ", p->next_same_grid,
            p->follows_same_grid, p->leader);
    if (!p->repeated)
        return;
    write_floats(to, "cell", p->cell, 3);
    write_floats(to, "per_cell", p->per_cell, 3);
    write_floats(to, "box", p->box, 3);
    write_floats(to, "box_of_grid", p->box_of_grid, 3);
    fprintf(to, ".wide_cell = {%a, %a, %a}, .wide_per_cell = {%a, %a, %a}, ", p->wide_cell[0],
            p->wide_cell[1], p->wide_cell[2], p->wide_per_cell[0], p->wide_per_cell[1],
            p->wide_per_cell[2]);
}

static void write_shape(FILE *to, const struct primitive *p) {
    fprintf(to, "    {.eval = %d, .type = %d, .turned = %d, .repeated = %d, .convex = %d, ",
            p->eval, p->type, p->turned, p->repeated, p->convex);
    write_number(to, "index", (double)p->index);
    write_floats(to, "position", p->position, 3);
    fputs(".turn = {", to);
    for (int i = 0; i < 3; i++)
        fprintf(to, "{%af, %af, %af}, ", (double)p->turn[i][0], (double)p->turn[i][1],
                (double)p->turn[i][2]);
    fputs("}, ", to);
    write_floats(to, "normal", p->normal, 3);
    write_number(to, "a", (double)p->a);
    write_number(to, "b", (double)p->b);
    write_number(to, "c", (double)p->c);
    write_floats(to, "slope", p->slope, 2);
    write_number(to, "per_slope_sq", (double)p->per_slope_sq);
    write_floats(to, "size", p->size, 3);
    write_number(to, "bailout", (double)p->bailout);
    fprintf(to, ".iterations = %d, ", p->iterations);
    write_number(to, "bound", (double)p->bound);
    write_number(to, "bound_sq", (double)p->bound_sq);
    write_floats(to, "color", p->color, 3);
    write_number(to, "share", (double)p->share);
    write_number(to, "shininess", (double)p->shininess);
    write_number(to, "shine_from", (double)p->shine_from);
    write_exact(to, p);
    write_cells(to, p);
    fputs("},\n", to);
}

static void write_model(FILE *to, const struct known_model *m) {
    fprintf(
        to,
        "    .model = {.shape_count = %d, .shadows = %d, .shadow_strength = %a, .fog = %a,\n"
        "              .background = {%a, %a, %a},\n"
        "              .features = {.rotation = %d, .repetition = %d, .mirrors = %d, .fog = %d},\n"
        "              .march = {.bounds_radius = %a, .max_bounces = %d, .normal_step = %a,\n"
        "                        .surface_offset = %a}},\n",
        m->shape_count, m->shadows, m->shadow_strength, m->fog, m->background[0], m->background[1],
        m->background[2], m->features.rotation, m->features.repetition, m->features.mirrors,
        m->features.fog, m->march.bounds_radius, m->march.max_bounces, m->march.normal_step,
        m->march.surface_offset);
}

// Returns the shininess of all shapes if it is one whole number up to 128, else 0.
static int whole_shininess(const struct prepared *p) {
    float first = p->primitives[0].shininess;
    for (int i = 1; i < p->model.shape_count; i++)
        if (p->primitives[i].shininess != first)
            return 0;
    return first >= 1 && first <= 128 && first == floorf(first) ? (int)first : 0;
}

// Returns whether all shapes have the same material.
static bool one_material(const struct prepared *p) {
    const struct primitive *a = &p->primitives[0];
    for (int i = 1; i < p->model.shape_count; i++) {
        const struct primitive *b = &p->primitives[i];
        if (a->color[0] != b->color[0] || a->color[1] != b->color[1] ||
            a->color[2] != b->color[2] || a->share != b->share || a->shininess != b->shininess)
            return false;
    }
    return true;
}

// Returns whether the scene has planes and solids alone, each once, and no hard shadows: a kernel that draws spans
// (opt12_fused) has code for those.
static bool solids_alone(const struct prepared *p) {
    for (int i = 0; i < p->model.shape_count; i++)
        if (p->primitives[i].repeated || p->primitives[i].type == SHAPE_MANDELBULB ||
            p->primitives[i].type == SHAPE_GROUP)
            return false;
    return p->model.shape_count <= MAX_UNROLLED && p->model.shadows != SHADOWS_HARD;
}

// Writes a macro that calls F with the number of each shape of a kind, for functions that are compiled once a shape.
static void write_each(FILE *to, const char *name, const struct prepared *p, bool planes) {
    fprintf(to, "#define %s(F)", name);
    for (int i = 0; i < p->model.shape_count; i++)
        if ((p->primitives[i].eval == EVAL_LINEAR) == planes)
            fprintf(to, " F(%d)", i);
    fputc('\n', to);
}

static void write_scene(FILE *to, const struct prepared *p) {
    const struct known_scene *k = &p->known;
    fprintf(to, "// %d shapes: the constants of the scene.\n#include <math.h>\n#define SHAPES %d\n",
            p->model.shape_count, p->model.shape_count);
    fprintf(to, "enum { WHOLE_SHININESS = %d, ONE_MATERIAL = %d };\n", whole_shininess(p),
            one_material(p));
    fprintf(to, "#define FUSED %d\n#define HAS_GROUPS %d\n", solids_alone(p),
            p->model.features.groups > 0);
    write_each(to, "EACH_PLANE", p, true);
    write_each(to, "EACH_SOLID", p, false);
    fprintf(to, "#define UNROLLED %d\n", p->model.shape_count <= MAX_UNROLLED);
    fputs("static const struct primitive scene_shapes[] = {\n", to);
    for (int i = 0; i < p->model.shape_count; i++)
        write_shape(to, &p->primitives[i]);
    fputs("};\nstatic const struct known_scene scene_known = {\n", to);
    write_model(to, &k->model);
    fprintf(to,
            "    .primitives = scene_shapes, .repeats = %d, .plane = %d, .bulbs = %d, .lit_slope = "
            "%af};\n",
            k->repeats, k->plane, k->bulbs, (double)k->lit_slope);
}

char *kernel_source(const struct prepared *prepared) {
    char *text = NULL;
    size_t size = 0;
    FILE *to = open_memstream(&text, &size);
    if (!to)
        return NULL;
    for (size_t i = 0; i < sizeof embedded_lines / sizeof *embedded_lines; i++)
        if (strstr(embedded_lines[i], "\"scene_kernel.h\""))
            write_scene(to, prepared);
        else
            fputs(embedded_lines[i], to);
    bool sound = !ferror(to);
    if (fclose(to) != 0 || !sound) {
        free(text);
        return NULL;
    }
    return text;
}
