// Renders what is asked for and composes it on the canvas.
#include "viewer/show.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

bool show_resize(struct show *show, int width, int height) {
    size_t pixels = (size_t)width * (size_t)height;
    uint32_t *canvas = realloc(show->canvas.pixels, pixels * sizeof *canvas);
    if (!canvas)
        return false;
    memset(canvas, 0, pixels * sizeof *canvas);
    show->canvas = (struct canvas){width, height, canvas};
    show->height = height;
    uint8_t **pictures[] = {&show->left8, &show->right8, &show->difference8};
    for (int i = 0; i < 3; i++) {
        uint8_t *picture = realloc(*pictures[i], 3 * pixels);
        if (!picture)
            return false;
        *pictures[i] = picture;
    }
    return true;
}

bool show_create(struct show *show, int width, int height, int threads) {
    *show = (struct show){.threads = threads, .divider = 0.5, .amplify = 16};
    show->presenter = presenter_create(threads);
    return show->presenter && show_resize(show, width, height);
}

void show_free(struct show *show) {
    stage_close(&show->left);
    stage_close(&show->right);
    presenter_free(show->presenter);
    free(show->left8);
    free(show->right8);
    free(show->difference8);
    free(show->canvas.pixels);
    *show = (struct show){0};
}

bool show_open(struct show *show, const struct viewer_phase *phase, const struct world *world,
               char *error) {
    struct stage next = {0};
    if (!stage_open(&next, phase, world, show->threads, error))
        return false;
    stage_close(&show->left);
    show->left = next;
    if (world != show->world) {
        stage_close(&show->right);
        show->world = world;
        show->camera = world->camera;
    }
    return true;
}

bool show_reference(struct show *show, const struct viewer_phase *reference, char *error) {
    struct stage next = {0};
    if (!stage_open(&next, reference, show->world, show->threads, error))
        return false;
    stage_close(&show->right);
    show->right = next;
    show->reference = reference;
    return true;
}

int show_width(const struct show *show) {
    long width = lround((double)show->height * show->canvas.width / show->canvas.height);
    return width < 1 ? 1 : (int)width;
}

bool show_compares(const struct show *show) {
    return show->split || show->mode == MODE_DIFFERENCE;
}

uint64_t show_ns(const struct show *show) {
    return show->left.ns + (show_compares(show) ? show->right.ns : 0);
}

// Left of the divider the phase, right of it the reference, and of a difference a third between them.
void show_compose(struct show *show) {
    int width = show_width(show);
    struct canvas *canvas = &show->canvas;
    int at = (int)lround(show->divider * canvas->width), begin = at, end = at;
    int height = show->height, all = canvas->width;
    if (show->mode == MODE_DIFFERENCE) {
        int half = show->split ? all / 6 : all;
        begin = at - half < 0 ? 0 : at - half;
        end = at + half > all ? all : at + half;
        picture_difference(show->left8, show->right8, 3 * (size_t)width * (size_t)height,
                           show->amplify, show->difference8);
    } else if (!show->split)
        begin = end = all;
    canvas_scale(canvas, show->left8, width, height, 0, begin);
    canvas_scale(canvas, show->difference8, width, height, begin, end);
    canvas_scale(canvas, show->right8, width, height, end, all);
    for (int y = 0; show->split && y < canvas->height; y++) {
        uint32_t *row = canvas->pixels + (size_t)y * (size_t)all;
        if (begin > 0)
            row[begin - 1] = 0xffffff;
        if (end < all)
            row[end] = 0xffffff;
    }
}

bool show_draw(struct show *show, char *error) {
    struct view view = camera_view(show->world, &show->camera);
    int width = show_width(show), height = show->height;
    bool planes = mode_needs_planes(show->mode);
    double seconds = show->camera.seconds;
    if (!stage_render(&show->left, &view, seconds, width, height, planes, error))
        return false;
    picture_paint(show->mode, &show->left.frame, show->presenter, show->left8);
    if (show_compares(show)) {
        if (!show->right.prepared && !show_reference(show, show->reference, error))
            return false;
        if (!stage_render(&show->right, &view, seconds, width, height, planes, error))
            return false;
        picture_paint(show->mode, &show->right.frame, show->presenter, show->right8);
    }
    show_compose(show);
    return true;
}
