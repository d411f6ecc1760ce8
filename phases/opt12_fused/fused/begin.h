// What is computed once a frame, in doubles.
#pragma once

static double distance_of(const double a[3], const double b[3]) {
    double square = 0;
    for (int k = 0; k < 3; k++)
        square += (a[k] - b[k]) * (a[k] - b[k]);
    return sqrt(square);
}

static double height_of(const struct primitive *plane, const double p[3]) {
    double height = -plane->offset;
    for (int k = 0; k < 3; k++)
        height += plane->row[0][k] * (p[k] - plane->centre[k]);
    return height;
}

// Whether the light can be so low that a ray towards it rises by less than the slope of a shadow's cone.
static bool is_low(double light_height, const struct fused_frame *frame) {
    const double origin[3] = {0, 0, 0};
    double furthest = frame->bounds_radius + distance_of(frame->light, origin);
    return light_height < frame->slope * (1 + 1e-5) * furthest;
}

// Sets in which solids a mirror ray may start.
static void set_mirror(int mirror, struct fused *f) {
    const struct primitive *from = SHAPE(mirror);
    double offset = scene_known.model.march.surface_offset;
    for (int i = 0; i < SHAPES; i++) {
        const struct primitive *s = SHAPE(i);
        if (s->eval == EVAL_LINEAR || i == mirror)
            continue;
        double apart = from->eval == EVAL_LINEAR
                           ? height_of(from, s->centre) - s->bound
                           : distance_of(from->centre, s->centre) - s->bound - from->bound;
        f->crevice[i] = f->crevice[i] || apart < 2 * offset;
    }
}

static bool fused_begin(const struct job *job) {
    const struct view *view = job->view;
    struct fused *f = job->frame_memory;
    f->stream = !job->frame->shown && past_caches(job->frame);
    f->any_low = false;
    memset(f->crevice, 0, sizeof f->crevice);
    if (!fused_frame_set(&scene_known, view, job->frame->width, job->frame->height, LANES,
                         &f->frame))
        return false;
    f->per = (float)f->frame.per_pixel;
    for (int k = 0; k < 3; k++) {
        f->eye[k] = (float)view->position[k];
        f->forward[k] = (float)view->forward[k];
        f->right[k] = (float)view->right[k];
        f->up[k] = (float)view->up[k];
        f->light[k] = (float)view->light_position[k];
        f->emission[k] = (float)view->light_emission[k];
    }
    for (int i = 0; i < SHAPES; i++) {
        if (SHAPE(i)->eval == EVAL_LINEAR) {
            double height = height_of(SHAPE(i), view->light_position);
            f->height[i] = job->cameras[i].height;
            f->light_height[i] = (float)height;
            f->low[i] = is_low(height, &f->frame);
            f->any_low = f->any_low || f->low[i];
        }
        if (SHAPE(i)->share > 0.0f)
            set_mirror(i, f);
    }
    return true;
}
