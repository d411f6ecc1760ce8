// The phase's entry points (common/phase.h) and its tiles of pixels: eight neighbours of a row at a
// time, one ray through the centre of each. A mask cuts the last packet of a row to the width. A tile
// is a whole number of packets wide: the packets, and so all bits of the picture, are those of opt4.
#include <stdalign.h>
#include <stdlib.h>

#include "phase.h"
#include "trace.h"
#include "workers/workers.h"

// A tile of scene0 takes some 100 µs, a thousand times the contended counter. A row of 32 pixels fills
// whole cache lines of every plane where the width is a multiple of 32.
enum { TILE_WIDTH = 32, TILE_HEIGHT = 8 };

// The march reads `prepared` alone, as in opt4.
struct threaded {
    struct prepared prepared;
    struct workers *workers; // their scratch memory: one local ray per shape
};

struct prepared *phase_prepare(const struct model *model, int threads) {
    size_t shapes = (size_t)model->shape_count, nodes = (size_t)model->node_count;
    struct threaded *threaded =
        calloc(1, sizeof *threaded + shapes * sizeof *threaded->prepared.primitives +
                      nodes * INSTRUCTIONS_PER_NODE * sizeof *threaded->prepared.instructions);
    if (threaded)
        threaded->workers = workers_start(threads, shapes * sizeof(struct local_ray));
    if (!threaded || !threaded->workers) {
        free(threaded);
        return NULL;
    }
    threaded->prepared.primitives = (struct primitive *)(threaded + 1);
    threaded->prepared.instructions =
        (struct instruction *)(threaded->prepared.primitives + shapes);
    phase_update(&threaded->prepared, model);
    return &threaded->prepared;
}

void phase_release(struct prepared *prepared) {
    struct threaded *threaded = (struct threaded *)prepared; // its first member
    workers_end(threaded->workers);
    free(threaded);
}

// What all workers read of a frame. Aligned, so that it shares no cache line with the caller's stack.
struct job {
    alignas(WORKERS_APART) const struct prepared *prepared;
    const struct view *view;
    struct frame *frame;
    struct point origin;
    int across; // tiles in a row of tiles
};

static void render_tile(const void *data, int tile, void *scratch) {
    COUNT(render_tile, call);
    const struct job *job = data;
    struct frame *frame = job->frame;
    struct world world = {job->prepared, job->view, scratch};
    int left = tile % job->across * TILE_WIDTH, top = tile / job->across * TILE_HEIGHT;
    int right = frame->width - left < TILE_WIDTH ? frame->width : left + TILE_WIDTH;
    int bottom = frame->height - top < TILE_HEIGHT ? frame->height : top + TILE_HEIGHT;
    for (int row = top; row < bottom; row++) {
        for (int column = left; column < right; column += LANES) {
            int count = right - column < LANES ? right - column : LANES;
            ACTIVE(count);
            COUNT(render_tile, packet);
            struct shaded seen;
            trace(job->origin, get_direction(column, row, frame, job->view), v_mask_first(count), 0,
                  &world, &seen);
            ACTIVE(count);
            store(frame, (size_t)row * (size_t)frame->width + (size_t)column, count, &seen);
        }
    }
}

bool phase_render(const struct prepared *prepared, const struct view *view, struct frame *frame) {
    COUNT(phase_render, call);
    const struct threaded *threaded = (const struct threaded *)prepared; // its first member
    int across = (frame->width + TILE_WIDTH - 1) / TILE_WIDTH;
    int down = (frame->height + TILE_HEIGHT - 1) / TILE_HEIGHT;
    struct job job = {prepared, view, frame, point_from_doubles(view->position), across};
    workers_run(threaded->workers, render_tile, &job, across * down);
    return true;
}
