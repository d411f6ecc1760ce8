// --headless: a script to PNG files, by the code that draws in the window.
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "viewer/script.h"
#include "viewer/show.h"
#include "viewer/viewer.h"

static int play(struct script *script, const struct viewer_options *options, struct show *show) {
    char error[SCENE_ERROR_SIZE], path[4096];
    int more, frames = 0;
    while ((more = script_next(script, show, error)) > 0) {
        if (!show_draw(show, error))
            return viewer_error(UNSUPPORTED, "%s", error);
        snprintf(path, sizeof path, "%.4000s/%05d.png", options->out, frames);
        if (!canvas_write_png(&show->canvas, path, error))
            return viewer_error(BAD_INPUT, "%s", error);
        printf("%s: %s %s %s %dx%d, %.3f ms, %.1f ns/pixel\n", path, show->left.phase->name,
               show->world->scene.name, mode_name(show->mode), show->canvas.width,
               show->canvas.height, (double)show->left.ns / 1e6,
               (double)show->left.ns / ((double)show->canvas.width * show->canvas.height));
        frames++;
    }
    if (more < 0)
        return viewer_error(BAD_INPUT, "%s", error);
    return fflush(stdout) == 0
               ? OK
               : viewer_error(BAD_INPUT, "standard output cannot be written: %s", strerror(errno));
}

int headless_run(const struct viewer_options *options, struct show *show) {
    char error[SCENE_ERROR_SIZE];
    struct script script;
    if (mkdir(options->out, 0777) != 0 && errno != EEXIST)
        return viewer_error(BAD_INPUT, "%s: cannot be made: %s", options->out, strerror(errno));
    if (!script_read(&script, options->script, error))
        return viewer_error(BAD_INPUT, "%s", error);
    int status = play(&script, options, show);
    script_free(&script);
    return status;
}
