// The order in which queued shadow rays are marched, and where each batch of them ends.
#include "shadow/shadow_batch.h"

// MORTON_BITS: of each coordinate, relative to the bounding box of all rays. PLANE_CODE marks a ray from a
// plane.
enum { MORTON_BITS = 5, PLANE_CODE = 1 << 15 };
// A box narrower than this is one cell: otherwise the number of cells over the width may overflow a float.
#define NO_WIDTH 1e-30f

// Returns the bits of a, with two zeros after each.
static unsigned spread_bits(unsigned a) {
    unsigned code = 0;
    for (int i = 0; i < MORTON_BITS; i++)
        code |= (a >> i & 1u) << (3 * i);
    return code;
}

// One pass of a radix sort, over 8 bits of the code. Rays of equal digits keep their order.
static void sort_by(const unsigned short *code, int shift, int count, const unsigned short *from,
                    unsigned short *to) {
    int first[257] = {0};
    for (int i = 0; i < count; i++)
        first[(code[from[i]] >> shift & 255) + 1]++;
    for (int i = 0; i < 256; i++)
        first[i + 1] += first[i];
    for (int i = 0; i < count; i++)
        to[first[code[from[i]] >> shift & 255]++] = from[i];
}

// Sets the rays' codes to their places in Morton order (G. M. Morton, "A computer oriented geodetic data
// base", IBM 1966).
static void morton_codes(struct worker_scratch *scratch, int count) {
    for (int i = 0; i < count; i++)
        scratch->code[i] = 0;
    for (int k = 0; k < 3; k++) {
        const float *x = scratch->shadow[S_POINT + k];
        float least = INFINITY, most = -INFINITY;
        for (int i = 0; i < count; i++) {
            least = x[i] < least ? x[i] : least;
            most = x[i] > most ? x[i] : most;
        }
        float per = most - least > NO_WIDTH ? ((1 << MORTON_BITS) - 0.5f) / (most - least) : 0.0f;
        for (int i = 0; i < count; i++) {
            float place = (x[i] - least) * per;
            unsigned cell = place > 0 ? (unsigned)place : 0; // 0 for NaN
            scratch->code[i] |= (unsigned short)(spread_bits(cell) << k);
        }
    }
}

void sort_shadow_rays(struct worker_scratch *scratch, const struct prepared *scene) {
    int count = scratch->shadows;
    if (scene->plane_count)
        morton_codes(scratch, count);
    for (int i = 0; i < count; i++) {
        int shape = (int)scratch->shadow[S_SHAPE][i];
        bool linear = scene->primitives[shape].eval == EVAL_LINEAR;
        scratch->code[i] = (unsigned short)(linear ? scratch->code[i] | PLANE_CODE
                                                   : scene->primitives[shape].bvh_rank);
        scratch->order[0][i] = (unsigned short)i;
    }
    sort_by(scratch->code, 0, count, scratch->order[0], scratch->order[1]);
    sort_by(scratch->code, 8, count, scratch->order[1], scratch->order[0]);
}

// A batch holds rays from one solid only, or rays from planes: batch_packet.solid relies on it. Rays from one solid
// stay close together. Among rays from two solids, some would wait wherever the others march.
int batch_end(const struct worker_scratch *scratch, int first) {
    const unsigned short *order = scratch->order[0];
    int end = first + 1, most = int_min(scratch->shadows, first + BATCH_RAYS);
    unsigned code = scratch->code[order[first]];
    if (code & PLANE_CODE)
        return most;
    while (end < most && scratch->code[order[end]] == code)
        end++;
    return end;
}
