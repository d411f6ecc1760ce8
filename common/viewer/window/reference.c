// The thread that compares. It has stages of its own, since a phase draws one frame at a time.
#include "viewer/window/reference.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>

#include "viewer/show.h"

enum { STACK = 64 << 20, LEAST_HEIGHT = 18, SECOND = 1000000000 };

struct reference {
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t asked;
    bool busy, finished, ending;
    // What the job has; the thread's while `busy`.
    struct comparison job;
    struct camera camera;
    int most; // height of what is shown
    double aspect;
    // The thread's own.
    struct stage left, right;
    double ns_per_pixel; // of both; 0: not known
};

static bool fit(struct stage *stage, const struct viewer_phase *phase, const struct comparison *job,
                bool *changed, char *error) {
    if (stage->prepared && stage->phase == phase && stage->world == job->world &&
        !stage_outdated(stage))
        return true;
    *changed = true;
    return stage_open(stage, phase, job->world, 1, error);
}

static bool compare(struct reference *r) {
    struct comparison *job = &r->job;
    bool changed = false;
    if (!fit(&r->left, job->phase, job, &changed, job->error) ||
        !fit(&r->right, job->reference, job, &changed, job->error))
        return false;
    if (changed)
        r->ns_per_pixel = 0;
    double height = LEAST_HEIGHT;
    if (r->ns_per_pixel > 0) // at most twice as high as before: a guess can be wrong
        height = fmin(2.0 * r->right.frame.height, sqrt(SECOND / r->ns_per_pixel / r->aspect));
    job->height = (int)fmin(r->most, fmax(LEAST_HEIGHT, height));
    job->width = (int)fmax(1, round(job->height * r->aspect));
    struct view view = camera_view(job->world, &r->camera);
    if (!stage_render(&r->left, &view, r->camera.seconds, job->width, job->height, false,
                      job->error) ||
        !stage_render(&r->right, &view, r->camera.seconds, job->width, job->height, false,
                      job->error))
        return false;
    r->ns_per_pixel =
        (double)(r->left.ns + r->right.ns) / ((double)job->width * (double)job->height);
    job->psnr = picture_psnr(&r->left.frame, &r->right.frame);
    return true;
}

static void *work(void *argument) {
    struct reference *r = argument;
    pthread_mutex_lock(&r->lock);
    for (;;) {
        while (!r->ending && (!r->busy || r->finished))
            pthread_cond_wait(&r->asked, &r->lock);
        if (r->ending)
            break;
        pthread_mutex_unlock(&r->lock);
        r->job.error[0] = '\0';
        compare(r);
        pthread_mutex_lock(&r->lock);
        r->finished = true;
    }
    pthread_mutex_unlock(&r->lock);
    stage_close(&r->left);
    stage_close(&r->right);
    return NULL;
}

struct reference *reference_start(void) {
    struct reference *r = calloc(1, sizeof *r);
    pthread_attr_t attributes;
    if (!r)
        return NULL;
    pthread_mutex_init(&r->lock, NULL); // glibc's never fail
    pthread_cond_init(&r->asked, NULL);
    pthread_attr_init(&attributes);
    pthread_attr_setstacksize(&attributes, STACK); // phases recurse for mirrors
    int failed = pthread_create(&r->thread, &attributes, work, r);
    pthread_attr_destroy(&attributes);
    if (failed) {
        free(r);
        return NULL;
    }
    return r;
}

bool reference_ask(struct reference *r, const struct show *show) {
    pthread_mutex_lock(&r->lock);
    bool taken = !r->busy;
    if (taken) {
        r->job = (struct comparison){
            .phase = show->left.phase, .reference = show->reference, .world = show->world};
        r->camera = show->camera;
        r->most = show->height;
        r->aspect = (double)show->canvas.width / show->canvas.height;
        r->busy = true;
        pthread_cond_signal(&r->asked);
    }
    pthread_mutex_unlock(&r->lock);
    return taken;
}

bool reference_result(struct reference *r, struct comparison *result) {
    pthread_mutex_lock(&r->lock);
    bool finished = r->finished;
    if (finished) {
        *result = r->job;
        r->busy = r->finished = false;
    }
    pthread_mutex_unlock(&r->lock);
    return finished;
}

void reference_end(struct reference *r) {
    if (!r)
        return;
    pthread_mutex_lock(&r->lock);
    r->ending = true;
    pthread_cond_signal(&r->asked);
    pthread_mutex_unlock(&r->lock);
    pthread_join(r->thread, NULL);
    pthread_cond_destroy(&r->asked);
    pthread_mutex_destroy(&r->lock);
    free(r);
}
