// Draws the tiles of a picture. A tile's pixels are drawn in blocks, four wide, with one ray through the middle of
// each pixel. Lanes of a block outside the picture are masked, so the picture may have any size.
#include "core/camera_rays.h"
#include "core/kernel.h"
#include "core/local_rays.h"
#include "core/trace.h"
#include "core/trace_context.h"

// 32 pixels of a row are whole cache lines of every plane if the picture's width is a multiple of 32. A tile of scene0
// takes some 30 µs, hundreds of times the cost of the shared counter.
enum { TILE_WIDTH = 32, TILE_HEIGHT = 8 };

static void store_block_result(struct frame *frame, struct pixel_block block,
                               const struct shaded *seen) {
    store_color(frame, block, seen->color);
    if (!frame->depth)
        return;
    const struct hit *hit = &seen->hit;
    store_aov(frame, block, hit->found, hit->t, hit->shape, hit->normal, hit->evals);
}

static int tiles_across(const struct frame *frame) {
    return (frame->width + TILE_WIDTH - 1) / TILE_WIDTH;
}

// Divides a worker's memory between the packets of a group.
static void init_packet_rays(struct packet_group *group, void *scratch, int shapes) {
    vfloat *wake = scratch;
    place_packets(group, GROUP, wake, (struct local_ray *)(wake + shapes * GROUP), shapes);
}

struct packet_rays packet_in(void *scratch, const struct prepared *scene) {
    struct packet_group group;
    init_packet_rays(&group, scratch, scene->model.shape_count);
    return group.packet[0];
}

// Draws a tile, GROUP blocks at a time, column by column.
void draw_tile(const void *data, int tile, void *scratch) {
    const struct job *job = data;
    struct frame *frame = job->frame;
    struct packet_group group;
    struct trace_context world = {job->prepared, job->view, &group};
    init_packet_rays(&group, scratch, job->prepared->model.shape_count);
    struct point origin = point_from_doubles(job->view->position);
    int left = tile % tiles_across(frame) * TILE_WIDTH,
        right = int_min(frame->width, left + TILE_WIDTH);
    int top = tile / tiles_across(frame) * TILE_HEIGHT,
        bottom = int_min(frame->height, top + TILE_HEIGHT);
    int down = (bottom - top + BLOCK_HEIGHT - 1) / BLOCK_HEIGHT;
    int blocks = (right - left + BLOCK_WIDTH - 1) / BLOCK_WIDTH * down;
    for (int first = 0; first < blocks; first += GROUP) {
        struct pixel_block block[GROUP];
        struct ray_group rays;
        struct shaded seen[GROUP];
        for (int k = 0; k < GROUP; k++) {
            int column = left + (first + k) / down * BLOCK_WIDTH;
            int row = top + (first + k) % down * BLOCK_HEIGHT;
            block[k] = (struct pixel_block){
                column, row, first + k < blocks ? int_min(BLOCK_WIDTH, right - column) : 0,
                int_min(BLOCK_HEIGHT, bottom - row)};
            rays.origin[k] = origin;
            rays.direction[k] = get_direction(block[k], frame, job->view);
            rays.active[k] = in_picture(block[k]);
        }
        trace(&rays, 0, &world, seen);
        for (int k = 0; k < GROUP; k++)
            store_block_result(frame, block[k], &seen[k]);
    }
}

size_t scratch_size(const struct model *model) {
    return GROUP * (size_t)model->shape_count * (sizeof(vfloat) + sizeof(struct local_ray));
}

int count_tiles(const struct job *job) {
    return tiles_across(job->frame) * ((job->frame->height + TILE_HEIGHT - 1) / TILE_HEIGHT);
}
