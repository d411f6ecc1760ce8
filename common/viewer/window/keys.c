// What keys and mouse do. docs/view.md lists them.
#include <math.h>
#include <unistd.h>

#include "viewer/script.h"
#include "viewer/show.h"
#include "viewer/window/window.h"

static void set_mode(struct window *w, enum mode mode) {
    w->show->mode = w->show->mode == mode ? MODE_COLOURS : mode; // again: back
    window_restart(w);
}

static void choose_phase(struct window *w, int index, bool as_reference) {
    char error[SCENE_ERROR_SIZE];
    if (index < 0)
        window_say(w, "this phase is not linked; viewer --list");
    else if (!as_reference)
        window_open(w, phases_at(index), w->show->world);
    else if (!show_reference(w->show, phases_at(index), error))
        window_say(w, "%s", error);
    else
        window_restart(w);
}

// The next phase that this CPU can run, `step` on or back.
static void next_phase(struct window *w, int step, bool as_reference) {
    const struct viewer_phase *now = as_reference ? w->show->reference : w->show->left.phase;
    int count = phases_count(), index = phases_find(now->name);
    do
        index = (index + step + count) % count;
    while (phases_at(index)->missing() ||
           (phases_at(index) != now && why_unsupported(phases_at(index), &w->show->world->scene)));
    choose_phase(w, index, as_reference);
}

static void next_scene(struct window *w, int step) {
    char error[SCENE_ERROR_SIZE];
    const struct world *world = world_next(w->show->world, step, error);
    if (world)
        window_open(w, w->show->left.phase, world);
    else
        window_say(w, "%s", error);
}

// A name that is not taken: view-0001.png, ...
static void free_name(char name[64], const char *stem, const char *ending) {
    for (int number = 1; number < 10000; number++) {
        snprintf(name, 64, "%s-%04d.%s", stem, number, ending);
        if (access(name, F_OK) != 0)
            return;
    }
}

static void save(struct window *w, bool scene) {
    char error[SCENE_ERROR_SIZE], name[64];
    free_name(name, "view", scene ? "json" : "png");
    bool written = scene ? world_save(w->show->world, &w->show->camera, name, error)
                         : canvas_write_png(&w->show->canvas, name, error);
    if (written)
        window_say(w, "written: %s", name);
    else
        window_say(w, "%s", error);
}

static void record(struct window *w) {
    if (w->recording) {
        bool failed = ferror(w->recording), written = fclose(w->recording) == 0 && !failed;
        w->recording = NULL;
        window_say(w, "%s: %s", w->recording_name,
                   written ? "written; --script plays it" : "cannot be written");
        return;
    }
    free_name(w->recording_name, "path", "jsonl");
    w->recording = fopen(w->recording_name, "w");
    if (!w->recording)
        window_say(w, "%s: cannot be written", w->recording_name);
}

static bool digit(SDL_Keycode key, int *number) {
    bool main_row = key >= SDLK_0 && key <= SDLK_9, pad = key >= SDLK_KP_1 && key <= SDLK_KP_0;
    if (main_row)
        *number = key - SDLK_0;
    else if (pad)
        *number = (key - SDLK_KP_1 + 1) % 10;
    if ((main_row || pad) && *number == 0)
        *number = 10;
    return main_row || pad;
}

static void amplify(struct window *w, double factor) {
    double wanted = w->show->amplify * factor;
    w->show->amplify = wanted < 1 ? 1 : wanted > 255 ? 255 : wanted;
}

// Keys that change what is shown.
static void key_show(struct window *w, SDL_Keycode key, bool shift, bool control) {
    struct show *show = w->show;
    int number;
    if (digit(key, &number)) {
        choose_phase(w, phases_of_number(number), control);
        return;
    }
    switch (key) {
    case SDLK_b: choose_phase(w, phases_of_number(0), control); break;
    case SDLK_p: next_phase(w, shift ? -1 : 1, control); break;
    case SDLK_TAB: next_scene(w, shift ? -1 : 1); break;
    case SDLK_d:
        if (shift)
            set_mode(w, MODE_DIFFERENCE);
        w->rightward = !shift; // also if Shift is let go first: the D of Shift+D never moves
        break;
    case SDLK_e: set_mode(w, MODE_EVALS); break;
    case SDLK_z: set_mode(w, MODE_DEPTH); break;
    case SDLK_n: set_mode(w, MODE_NORMALS); break;
    case SDLK_i: set_mode(w, MODE_IDS); break;
    case SDLK_c:
        show->mode = MODE_COLOURS;
        window_restart(w);
        break;
    case SDLK_v:
        show->split = !show->split;
        window_restart(w);
        break;
    case SDLK_r:
        if (w->throttle.on)
            window_throttle(w, false);
        w->pace.adaptive = !w->pace.adaptive;
        window_restart(w);
        break;
    case SDLK_t: window_throttle(w, !w->throttle.on); break;
    case SDLK_PLUS:
    case SDLK_EQUALS:
    case SDLK_KP_PLUS: amplify(w, 2); break;
    case SDLK_MINUS:
    case SDLK_KP_MINUS: amplify(w, 0.5); break;
    case SDLK_HOME: show->camera = show->world->camera; break;
    }
}

static void key_down(struct window *w, const SDL_KeyboardEvent *event) {
    SDL_Keycode key = event->keysym.sym;
    bool shift = event->keysym.mod & KMOD_SHIFT, control = event->keysym.mod & KMOD_CTRL;
    bool modifier = key == SDLK_LSHIFT || key == SDLK_RSHIFT || key == SDLK_LCTRL ||
                    key == SDLK_RCTRL || key == SDLK_LALT || key == SDLK_RALT;
    if (event->repeat && key != SDLK_PLUS && key != SDLK_MINUS)
        return;
    if (w->script && !modifier && key != SDLK_o && key != SDLK_h) {
        script_free(w->script);
        w->script = NULL;
    }
    switch (key) {
    case SDLK_ESCAPE: w->open = false; break;
    case SDLK_h:
    case SDLK_F1: w->help = !w->help; break;
    case SDLK_o: w->overlay = !w->overlay; break;
    case SDLK_SPACE: w->paused = !w->paused; break;
    case SDLK_k: save(w, false); break;
    case SDLK_f: save(w, true); break;
    case SDLK_l: record(w); break;
    default: key_show(w, key, shift, control);
    }
}

void window_event(struct window *w, const SDL_Event *event) {
    struct show *show = w->show;
    switch (event->type) {
    case SDL_QUIT: w->open = false; break;
    case SDL_KEYDOWN: key_down(w, &event->key); break;
    case SDL_MOUSEBUTTONDOWN:
    case SDL_MOUSEBUTTONUP:
        w->dragging = event->type == SDL_MOUSEBUTTONDOWN && event->button.button == SDL_BUTTON_LEFT;
        break;
    case SDL_MOUSEMOTION:
        if (w->dragging) { // the point under the mouse stays under it, near the picture's centre
            double angle = 2 * show->world->scene.view.tan_half_fov / show->canvas.height;
            camera_turn(&show->camera, -angle * event->motion.xrel, angle * event->motion.yrel);
        } else {
            show->divider = (double)event->motion.x / show->canvas.width;
            w->divider_moves = true;
        }
        break;
    case SDL_MOUSEWHEEL:
        w->speed *= event->wheel.y > 0 ? 1.25 : 0.8;
        window_say(w, "speed %.3g scene units a second", w->speed);
        break;
    case SDL_WINDOWEVENT:
        if (event->window.event == SDL_WINDOWEVENT_SIZE_CHANGED) {
            if (!show_resize(show, event->window.data1, event->window.data2))
                w->open = false;
            window_restart(w);
        }
        break;
    }
}

void window_held_keys(struct window *w, double seconds) {
    const Uint8 *held = SDL_GetKeyboardState(NULL);
    SDL_Keymod mod = SDL_GetModState();
    struct show *show = w->show;
    bool shift = mod & KMOD_SHIFT;
    double step = seconds * w->speed * (shift ? 4 : 1);
    double move[3] = {
        step * ((held[SDL_SCANCODE_D] && w->rightward) - held[SDL_SCANCODE_A]),
        step * (held[SDL_SCANCODE_PAGEUP] - held[SDL_SCANCODE_PAGEDOWN]),
        step * (held[SDL_SCANCODE_W] - held[SDL_SCANCODE_S]),
    };
    double away = held[SDL_SCANCODE_UP] - held[SDL_SCANCODE_DOWN];
    double apart =
        0; // of light and camera: the step grows with it, else a far light seems to stand
    for (int i = 0; i < 3; i++)
        apart += pow(show->camera.light[i] - show->camera.position[i], 2);
    double light_step = seconds * fmax(w->speed, sqrt(apart) / 3);
    double light[3] = {light_step * (held[SDL_SCANCODE_RIGHT] - held[SDL_SCANCODE_LEFT]),
                       shift ? light_step * away : 0, shift ? 0 : light_step * away};
    struct view view = camera_view(show->world, &show->camera);
    camera_move(&show->camera, &view, move);
    camera_move_light(&show->camera, &view, light);
}
