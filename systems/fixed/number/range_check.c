// Checks that a scene fits the number format, before anything is rendered: the factors of products have 32 bits, and
// the article's roots have ranges. Shapes are taken wherever their paths lead.
// The article: N. L. Corneliusen, "Integer Raytracing on Mellanox TILE-Gx" (2017).
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "number/format.h"
#include "path_distance.h"
#include "scene/scene.h"

// The largest and smallest lengths that occur in a scene, in scene units.
struct extent {
    double lengths; // between any two points that are subtracted
    double radius_most, radius_least, reach;
    double light;               // from the light to the furthest surface
    double camera;              // from the camera to the furthest centre
    double across;              // between the furthest two surfaces, and a ray's start off them
    int nearest;                // the shape that the light comes nearest to
    double near;                // from its surface to the light
    int brightest;              // the shape that the light makes brightest
    double bright, bright_from; // how bright, and at which distance of the light
};

static double norm(const double a[3]) {
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
}

// Notes how bright the light can make a shape, and the factors on the way there: ambient 0.01, highlight 0.2 (shade.h).
// The nearest side may be in the dark: then a scene is refused that could be drawn.
static void measure_light(struct extent *e, int i, const struct model *model,
                          const struct view *view) {
    const struct shape *shape = &model->shapes[i];
    const double *color = model->materials[shape->material].color, *emission = view->light_emission;
    double radius = shape->sphere.radius, most = fmax(emission[0], fmax(emission[1], emission[2]));
    struct distance_range light = path_distance(shape, view->light_position);
    if (!(most > 0) || light.furthest < radius) // always inside of the sphere: its surface is unlit
        return;
    double near = fmax(light.nearest - radius, 0), reach = most / near;
    double colour = fmax(color[0], fmax(color[1], color[2]));
    double bright = fmax(0.01 * colour + reach * (colour + 0.2), reach);
    if (near < e->near) {
        e->near = near;
        e->nearest = i;
    }
    if (bright > e->bright) {
        e->bright = bright;
        e->bright_from = near;
        e->brightest = i;
    }
}

static struct extent measure(const struct model *model, const struct view *view) {
    struct extent e = {.radius_least = INFINITY, .near = INFINITY};
    const double origin[3] = {0};
    double centre = 0;
    for (int i = 0; i < model->shape_count; i++) {
        const struct shape *shape = &model->shapes[i];
        double radius = shape->sphere.radius, far = path_distance(shape, origin).furthest;
        e.radius_most = fmax(e.radius_most, radius);
        e.radius_least = fmin(e.radius_least, radius);
        centre = fmax(centre, far);
        e.reach = fmax(e.reach, far + radius);
        measure_light(&e, i, model, view);
    }
    e.light = norm(view->light_position) + e.reach;
    e.camera = norm(view->position) + centre;
    e.across = e.reach + centre + model->march.surface_offset;
    e.lengths = fmax(e.light, fmax(e.camera, e.across));
    return e;
}

// Returns the largest number that is not a length, and its name in `what`.
static double largest_colour(const struct model *model, const struct view *view, double unit,
                             const char **what) {
    double most = 0;
    *what = "nothing";
    for (int k = 0; k < 3; k++) {
        if (view->light_emission[k] / unit > most) {
            most = view->light_emission[k] / unit;
            *what = "the light's emission (in units of length, for it falls off with it)";
        }
        if (model->background[k] > most) {
            most = model->background[k];
            *what = "the background's colour";
        }
    }
    for (int i = 0; i < model->material_count; i++)
        for (int k = 0; k < 3; k++)
            if (model->materials[i].color[k] + 0.2 > most) {
                most = model->materials[i].color[k] + 0.2;
                *what = "a material's colour with the highlight's 0.2";
            }
    return most;
}

// Bits before the point of numbers up to a; at least 1.
static int whole_bits(double a) {
    int exponent;
    frexp(a, &exponent);
    return exponent > 1 ? exponent : 1;
}

static bool article_fits(const struct extent *e, struct format *f, char error[512]) {
    double unit = ldexp(1, f->unit), square = e->lengths / unit * (e->lengths / unit);
    double radius = e->radius_most / unit, smallest = e->radius_least / unit;
    f->sqrt_whole_bits = 23 - f->bits;
    // the camera's directions, scaled to be shorter than 4 (direction_shift), are normalised by it too
    f->rsqrt_whole_bits = whole_bits(fmax(square, 16) * 1.01);
    if (f->sqrt_whole_bits < 1) {
        snprintf(
            error, 512,
            "%d bits of fraction: the article's root is of 23 bits, of which 22 may be fraction "
            "(STEPWISE_FIXED: fewer bits or roots=2)",
            f->bits);
        return false;
    }
    if (!(radius * radius < 0.9 * ldexp(1, f->sqrt_whole_bits))) {
        snprintf(
            error, 512,
            "a radius of %g: the article's root of %d bits of fraction takes squares of less than "
            "%g units (STEPWISE_FIXED: fewer bits, a larger unit or roots=2)",
            e->radius_most, f->bits, 0.9 * ldexp(1, f->sqrt_whole_bits));
        return false;
    }
    if (f->rsqrt_whole_bits > 31 - f->bits) {
        snprintf(
            error, 512,
            "lengths of up to %g: the article's 1/root of %d bits of fraction takes squares of "
            "less than %g units, theirs are up to %g (STEPWISE_FIXED: fewer bits, a larger unit "
            "or roots=2)",
            e->lengths, f->bits, ldexp(1, 31 - f->bits), square);
        return false;
    }
    int down = f->bits - (23 - f->rsqrt_whole_bits);
    f->rsqrt_shift_right = down > 0 ? down : 0;
    f->rsqrt_shift_left = down < 0 ? -down : 0;
    // (1/√a)², a few percent too large, is a factor: below 2^(31 − bits)
    double least = 1.25 * fmax(ldexp(1, f->bits - 31), ldexp(1, -2 * f->rsqrt_whole_bits));
    // Half of a smaller one loses more than a percent, or a float's 23 bits have lost too much of it.
    least = fmax(least, fmax(ldexp(64, -f->bits), ldexp(16, f->rsqrt_whole_bits - 23)));
    f->rsqrt_least = (int64_t)ceil(ldexp(least, f->bits));
    if (!(smallest * smallest > least)) {
        snprintf(
            error, 512,
            "a radius of %g: the article's 1/root of %d bits of fraction takes squares of more "
            "than %g units (STEPWISE_FIXED: other bits, a smaller unit or roots=2)",
            e->radius_least, f->bits, least);
        return false;
    }
    // A nearer light gets the 1/root of `least`. Hits may lie 0.0607 of half a chord in front of the sphere.
    double drawn = e->near - 0.0607 * e->radius_most;
    if (!(drawn / unit > sqrt(least))) {
        snprintf(
            error, 512,
            "the light comes within %g of shapes[%d], or %g of where the article's root may draw "
            "it, and its 1/root of %d bits of fraction takes more than %g (STEPWISE_FIXED: other "
            "bits, a smaller unit or roots=2)",
            e->near, e->nearest, fmax(drawn, 0), f->bits, sqrt(least) * unit);
        return false;
    }
    return true;
}

bool directions_fit(const struct format *f, const struct view *view, double aspect,
                    char error[512]) {
    double shortest = ldexp(1, -2 * direction_shift(view, aspect));
    // Rounding may take nine last bits off a square.
    double least = ldexp((double)f->rsqrt_least + 10, -f->bits);
    if (f->newton_steps > 0 || shortest > least)
        return true;
    snprintf(
        error, 512,
        "directions to the pixels of a picture %.3g times as wide as high: their squares, of "
        "less than 16, are down to %g, and the article's 1/root of %d bits of fraction takes "
        "more than %g (a narrower view, or STEPWISE_FIXED: other bits, a larger unit or roots=2)",
        aspect, shortest, f->bits, least);
    return false;
}

// A distance to the light of less than 64 last bits would be rounding, and no product may exceed `most`.
static bool light_fits(const struct extent *e, const struct format *f, double most,
                       char error[512]) {
    double last = ldexp(1, f->unit - f->bits);
    if (!(e->near >= 64 * last)) {
        snprintf(error, 512,
                 "the light comes within %g of shapes[%d], which is less than 64 of the smallest "
                 "numbers, %g, that %d bits of fraction hold (a light further away, or "
                 "STEPWISE_FIXED: more bits)",
                 e->near, e->nearest, last, f->bits);
        return false;
    }
    if (!(e->bright < most)) {
        snprintf(error, 512,
                 "the light comes within %g of shapes[%d], which may be %g bright there; %d bits "
                 "of fraction leave room for less than %g (STEPWISE_FIXED: fewer bits)",
                 e->bright_from, e->brightest, e->bright, f->bits, most);
        return false;
    }
    return true;
}

// Whether all numbers fit the format f, in its unit.
static bool fits(const struct model *model, const struct view *view, const struct extent *e,
                 struct format *f, char error[512]) {
    double unit = ldexp(1, f->unit), most = ldexp(1, 31 - f->bits) * (1 - 0x1p-6);
    const char *what;
    double colour = largest_colour(model, view, unit, &what);
    const char *longest = e->lengths == e->light    ? "the light and a surface may be"
                          : e->lengths == e->camera ? "the camera and a shape may be"
                                                    : "two surfaces, with surface_offset, may be";
    if (!(e->lengths / unit < most)) {
        snprintf(
            error, 512,
            "%s %g apart; %d bits of fraction leave room for less than %g (STEPWISE_FIXED: fewer "
            "bits, a larger unit or unit=auto)",
            longest, e->lengths, f->bits, most * unit);
        return false;
    }
    if (!(colour < most)) {
        snprintf(error, 512,
                 "%s is %g; %d bits of fraction leave room for less than %g (STEPWISE_FIXED: fewer "
                 "bits)",
                 what, colour, f->bits, most);
        return false;
    }
    if (!light_fits(e, f, most, error))
        return false;
    if (!(ldexp(e->radius_least / unit, f->bits) >= 2)) {
        snprintf(error, 512,
                 "a radius of %g is less than two of the smallest numbers, %g, that %d bits of "
                 "fraction hold (STEPWISE_FIXED: more bits)",
                 e->radius_least, ldexp(unit, -f->bits), f->bits);
        return false;
    }
    return f->newton_steps > 0 || article_fits(e, f, error);
}

bool format_fit(const struct settings *settings, const struct model *model, const struct view *view,
                struct format *f, char error[512]) {
    struct extent extent = measure(model, view);
    int unit = settings->unit < 0 ? 0 : settings->unit, last = settings->unit < 0 ? 10 : unit;
    char why[512] = "";
    for (; unit <= last; unit++) {
        *f = format_make(settings, unit);
        if (fits(model, view, &extent, f, error))
            return true;
        // For unit=auto, the error of the first unit that the lengths fit in says most.
        if (!*why && ldexp(extent.lengths, -unit) < ldexp(1, 31 - f->bits))
            memcpy(why, error, sizeof why);
    }
    if (*why)
        memcpy(error, why, sizeof why);
    return false;
}
