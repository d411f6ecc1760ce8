// The text on the picture.
#include <math.h>
#include <string.h>

#include "viewer/show.h"
#include "viewer/window/window.h"

static const char HELP[] =
    "W A S D       move; Page Up, Page Down: up and down; Shift: faster\n"
    "mouse drag    look around; wheel: speed; Home: the scene's own camera\n"
    "arrow keys    move the light; with Shift, up and down: its height\n"
    "Tab           next scene, Shift+Tab: the one before\n"
    "1 ... 9, 0    phases opt1 ... opt9, opt10; B: baseline\n"
    "P             next phase of all, Shift+P: the one before\n"
    "with Ctrl     1 ... 9, 0, B, P choose the reference instead\n"
    "V             the phase and the reference side by side; the mouse moves the divider\n"
    "Shift+D       difference to the reference; + and -: amplify more or less\n"
    "E Z N I C     evaluations (see 4, opt4), depth, normals, shape ids, colours\n"
    "R             resolution: adaptive or full; ends the throttle\n"
    "T             rods_simd: the throttle of rod marching\n"
    "Space         stop and go on with an animation or a flight\n"
    "K             screenshot; F: write this view as a scene file\n"
    "L             record the camera's path; L again: end\n"
    "O             the figures off and on; H: help; Escape: quit";

// Writes lines on a darkened rectangle. Returns the y below it.
static int block(struct canvas *canvas, int x, int y, int scale, const char *text) {
    int lines = 1, width = 0, longest = 0;
    for (const char *c = text; *c; c++) {
        width = *c == '\n' ? 0 : width + 1;
        lines += *c == '\n';
        longest = width > longest ? width : longest;
    }
    int height = (lines * 10 + 4) * scale;
    canvas_shade(canvas, x, y, (longest * 6 + 6) * scale, height);
    canvas_text(canvas, x + 4 * scale, y + 4 * scale, scale, 0xffffff, text);
    return y + height;
}

static void psnr_line(const struct window *w, char *text, size_t size) {
    const struct comparison *c = &w->compared;
    const struct show *show = w->show;
    const char *reference = show->reference->name;
    if (show->reference == show->left.phase)
        snprintf(text, size, "PSNR: the phase is its own reference (Ctrl+number: another)");
    else if (c->phase != show->left.phase || c->reference != show->reference ||
             c->world != show->world)
        snprintf(text, size, "PSNR to %s: in a moment", reference);
    else if (c->error[0])
        snprintf(text, size, "PSNR: none; %.100s", c->error);
    else if (isinf(c->psnr))
        snprintf(text, size, "PSNR to %s: equal to the last bit (at %d x %d)", reference, c->width,
                 c->height);
    else
        snprintf(text, size, "PSNR to %s: %.1f dB (linear RGB, this view at %d x %d)", reference,
                 c->psnr, c->width, c->height);
}

static void figures(struct window *w, char *text, size_t size) {
    const struct show *show = w->show;
    const struct stage *left = &show->left;
    char psnr[256], other[64] = "", threads[48];
    psnr_line(w, psnr, sizeof psnr);
    double median = (double)times_percentile(&w->renders, 50) / 1e6;
    double slow = (double)times_percentile(&w->renders, 99) / 1e6;
    double pixels = (double)show->height * show_width(show);
    if (show_compares(show))
        snprintf(other, sizeof other, " and %s", show->reference->name);
    if (show_compares(show) && show->right.threads != left->threads)
        snprintf(threads, sizeof threads, "%d and %d threads", left->threads, show->right.threads);
    else
        snprintf(threads, sizeof threads, "%d thread%s", left->threads,
                 left->threads > 1 ? "s" : "");
    snprintf(text, size,
             "%s%s, %s, %s, %s\n"
             "median of %d frames %.2f ms, 99 %% %.2f ms; %.1f ns/pixel; %.0f frames a second\n"
             "resolution %d x %d of %d x %d: %s\n"
             "%s\n"
             "H: help",
             left->phase->name, other, show->world->scene.name, threads, mode_name(show->mode),
             w->renders.count, median, slow, median * 1e6 / pixels, times_rate(&w->frames),
             show_width(show), show->height, show->canvas.width, show->canvas.height, w->pace.says,
             psnr);
}

static void sides(struct window *w, int scale) {
    struct show *show = w->show;
    struct canvas *canvas = &show->canvas;
    char label[128];
    int y = canvas->height - 16 * scale, at = (int)(show->divider * canvas->width);
    int half = show->mode == MODE_DIFFERENCE ? canvas->width / 6 : 0;
    const char *left = show->left.phase->name;
    int before = at - half - ((int)strlen(left) * 6 + 12) * scale;
    block(canvas, before, y, scale, left);
    block(canvas, at + half + 6 * scale, y, scale, show->reference->name);
    if (half) {
        snprintf(label, sizeof label, "|difference| x %g", show->amplify);
        block(canvas, at - (int)strlen(label) * 3 * scale, y, scale, label);
    }
}

void window_overlay(struct window *w) {
    struct show *show = w->show;
    struct canvas *canvas = &show->canvas;
    int scale = canvas->width >= 1000 ? 2 : 1, y = 0;
    char text[1024];
    if (w->overlay) {
        figures(w, text, sizeof text);
        y = block(canvas, 0, 0, scale, text);
        picture_legend(show->mode, &show->left.frame, text, sizeof text);
        if (show->mode == MODE_DIFFERENCE)
            snprintf(text, sizeof text, "difference to %s, amplified %g times (+ and -)",
                     show->reference->name, show->amplify);
        if (*text)
            y = block(canvas, 0, y, scale, text);
        if (w->throttle.on) {
            throttle_say(&w->throttle, text, sizeof text);
            y = block(canvas, 0, y, scale, text);
        }
        if (show->split)
            sides(w, scale);
    }
    if (w->recording) {
        snprintf(text, sizeof text, "recording %s; L: end", w->recording_name);
        y = block(canvas, 0, y, scale, text);
    }
    if (w->script)
        y = block(canvas, 0, y, scale, "playing a script; any key but O and H: end");
    if (SDL_GetTicks() < w->message_until)
        y = block(canvas, 0, y, scale, w->message);
    if (w->help)
        block(canvas, 20 * scale, y + 10 * scale, scale, HELP);
}
