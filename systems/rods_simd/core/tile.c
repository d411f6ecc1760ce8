// Draws the tiles of a picture. Rods find where the rays of a tile begin, and which rays hit nothing. The other rays
// are marched in blocks, four wide, with one ray through the middle of each pixel. Lanes of a block outside the
// picture are masked, so the picture may have any size.
#include "core/camera_rays.h"
#include "core/kernel.h"
#include "core/local_rays.h"
#include "core/trace.h"
#include "core/trace_context.h"
#include "march/march_step.h"
#include "rods.h"

// Where the rays of a block begin, the steps of their rods, and their share of them (see struct survey).
struct ray_starts {
    vfloat start, steps, share;
};

static void store_block_result(struct frame *frame, struct pixel_block block,
                               const struct shaded *seen, const struct ray_starts *starts) {
    store_color(frame, block, seen->color);
    if (!frame->depth)
        return;
    const struct hit *hit = &seen->hit;
    store_aov(frame, block, hit->found, hit->t, hit->shape, hit->normal, hit->evals);
    store_plane(frame->planes[0], 1, frame, block, starts->start);
    store_plane(frame->planes[1], 1, frame, block, starts->steps);
    store_plane(frame->planes[2], 1, frame, block, starts->share);
}

static int tiles_across(const struct frame *frame) {
    return (frame->width + TILE - 1) / TILE;
}

// Divides a worker's memory between the packets of a group.
static struct survey *init_packet_rays(struct packet_group *group, void *scratch, int shapes) {
    vfloat *wake = scratch;
    struct local_ray *local = (struct local_ray *)(wake + shapes * GROUP);
    place_packets(group, GROUP, wake, local, shapes);
    return (struct survey *)(local + GROUP * shapes);
}

struct packet_rays packet_in(void *scratch, const struct prepared *scene) {
    struct packet_group group;
    init_packet_rays(&group, scratch, scene->model.shape_count);
    return group.packet[0];
}

// Sets where a block's rays begin; −1 for rays that hit nothing. Returns the other lanes.
static vmask load_starts(struct pixel_block block, int left, int top, const struct survey *survey,
                         struct ray_starts *starts) {
    float start[LANES], steps[LANES], share[LANES];
    for (int lane = 0; lane < LANES; lane++) {
        int row = block.row - top + lane / BLOCK_WIDTH, column = block.column - left;
        int pixel = row * TILE + column + lane % BLOCK_WIDTH;
        start[lane] = survey->start[pixel];
        steps[lane] = survey->steps[pixel];
        share[lane] = survey->share[pixel];
    }
    *starts = (struct ray_starts){v_load(start), v_load(steps), v_load(share)};
    vmask active = v_cmp_lt_in(in_picture(block), starts->start, v_splat(INFINITY));
    starts->start = v_select(active, starts->start, v_splat(-1.0f));
    return active;
}

// Clears the lanes whose ray was not marched.
static void blank(vmask active, const struct model *model, struct shaded *seen) {
    struct hit *hit = &seen->hit;
    struct vec none = {v_splat(0.0f), v_splat(0.0f), v_splat(0.0f)};
    seen->color = vec_select(active, seen->color, vec_from_doubles(model->background));
    hit->found = v_and(active, hit->found);
    hit->shape = v_select(active, hit->shape, v_splat(-1.0f));
    hit->normal = vec_select(active, hit->normal, none);
    hit->evals = v_select_or_zero(active, hit->evals);
}

// Blocks that wait until a group of them is full.
struct waiting {
    struct pixel_block block[GROUP];
    struct ray_starts starts[GROUP];
    struct ray_group rays;
    int count;
};

static void draw_waiting(struct waiting *waiting, const struct job *job,
                         struct trace_context *world) {
    struct shaded seen[GROUP];
    for (int k = waiting->count; k < GROUP; k++)
        waiting->rays.active[k] = v_mask_none();
    trace(&waiting->rays, 0, world, seen);
    for (int k = 0; k < waiting->count; k++) {
        blank(waiting->rays.active[k], &job->prepared->model, &seen[k]);
        store_block_result(job->frame, waiting->block[k], &seen[k], &waiting->starts[k]);
    }
    waiting->count = 0;
}

static void draw_block(struct pixel_block block, struct point origin, struct ray_starts starts,
                       vmask active, const struct job *job, struct trace_context *world,
                       struct waiting *waiting) {
    const struct settings *settings = &job->prepared->settings;
    struct ray_group *rays = &waiting->rays;
    int k = waiting->count++;
    int cap = step_cap(&job->prepared->model);
    rays->origin[k] = origin;
    rays->direction[k] = get_direction(block, job->frame, job->view);
    rays->active[k] = active;
    world->start[k] = v_select_or_zero(active, starts.start);
    world->cap[k] = settings->finish > 0 ? int_min(cap, settings->finish) : cap;
    waiting->block[k] = block;
    waiting->starts[k] = starts;
    if (waiting->count == GROUP)
        draw_waiting(waiting, job, world);
}

void draw_tile(const void *data, int tile, void *scratch) {
    const struct job *job = data;
    struct frame *frame = job->frame;
    const struct model *model = &job->prepared->model;
    struct packet_group group;
    struct trace_context world = {.scene = job->prepared, .view = job->view, .group = &group};
    struct survey *survey = init_packet_rays(&group, scratch, model->shape_count);
    struct point origin = point_from_doubles(job->view->position);
    int left = tile % tiles_across(frame) * TILE, right = int_min(frame->width, left + TILE);
    int top = tile / tiles_across(frame) * TILE, bottom = int_min(frame->height, top + TILE);
    march_rods(left, top, job, origin, &world, survey);
    struct waiting waiting;
    waiting.count = 0;
    for (int column = left; column < right; column += BLOCK_WIDTH)
        for (int row = top; row < bottom; row += BLOCK_HEIGHT) {
            struct pixel_block block = {column, row, int_min(BLOCK_WIDTH, right - column),
                                        int_min(BLOCK_HEIGHT, bottom - row)};
            struct ray_starts starts;
            vmask active = load_starts(block, left, top, survey, &starts);
            if (v_any(active)) {
                draw_block(block, origin, starts, active, job, &world, &waiting);
                continue;
            }
            struct shaded nothing = {0};
            blank(active, model, &nothing);
            store_block_result(frame, block, &nothing, &starts);
        }
    if (waiting.count > 0)
        draw_waiting(&waiting, job, &world);
}

size_t scratch_size(const struct model *model) {
    return GROUP * (size_t)model->shape_count * (sizeof(vfloat) + sizeof(struct local_ray)) +
           sizeof(struct survey);
}

int count_tiles(const struct job *job) {
    return tiles_across(job->frame) * ((job->frame->height + TILE - 1) / TILE);
}
