// How far apart the nodes of a row's polynomials may be: the error of interpolation is bounded by the size of the light
// near the row in the complex plane (A. Cauchy's estimate of derivatives; PROOFS.md, 10.). Along a row everything is a
// product of powers of a few vectors that are linear in the column.
#include <math.h>

#include "spans/regions.h"
#include "spans/spans.h"
#include "types/known_scene.h"

// A vector at + x·along. Its length is least, `least`, at a place whose distance to the complex zeros is `apart`.
struct linear {
    double at[3], along[3], rate, least, apart;
};

static inline struct linear linear_of(const double at[3], const double along[3]) {
    struct linear v;
    for (int k = 0; k < 3; k++) {
        v.at[k] = at[k];
        v.along[k] = along[k];
    }
    double square = fmax(span_dot(along, along), 1e-30), cross = span_dot(at, along);
    v.rate = sqrt(square);
    v.least = sqrt(fmax(span_dot(at, at) - cross * cross / square, 0));
    v.apart = v.least / v.rate;
    return v;
}

static inline double length_at(const struct linear *v, double x) {
    double p[3];
    span_along(v->at, v->along, x, p);
    return sqrt(span_dot(p, p));
}

static inline double whole_power(double a, int n) {
    double power = 1;
    for (; n > 0; n >>= 1, a *= a)
        power *= n & 1 ? a : 1;
    return power;
}

// The light of a plane along a row from column x = low to high, nodes included. fall, point, light: at slope times the
// place, see row_of(); times[3]: the highlight's numerator, a quadratic.
struct row_light {
    double low, high, fall[2], least_fall, most_fall, light_height, fog, strength, shine, bright,
        dim;
    struct linear look, point, light;
    double times[3];
};

// The slope s of a ray on its way down is linear in x, and so are s·p, p the point of the plane, and s·(light − p).
static struct row_light row_of(const struct fused_frame *frame, const struct plane_seen *plane,
                               const struct primitive *s, double y, double low, double high) {
    struct row_light r = {
        .low = low, .high = high, .light_height = plane->light_height, .fog = frame->fog};
    double look[3], point[2][3], light[2][3];
    span_along(frame->axis[2], frame->axis[1], y, look);
    r.fall[0] = plane->fall[2] + y * plane->fall[1];
    r.fall[1] = plane->fall[0];
    r.least_fall = r.fall[0] + fmin(r.fall[1] * low, r.fall[1] * high);
    r.most_fall = r.fall[0] + fmax(r.fall[1] * low, r.fall[1] * high);
    for (int a = 0; a < 3; a++)
        for (int k = 0; k < 2; k++) {
            double d = k ? frame->axis[0][a] : look[a];
            point[k][a] = frame->eye[a] * r.fall[k] + plane->height * d;
            light[k][a] = frame->light[a] * r.fall[k] - point[k][a];
        }
    r.look = linear_of(look, frame->axis[0]);
    r.point = linear_of(point[0], point[1]);
    r.light = linear_of(light[0], light[1]);
    r.times[0] = 2 * plane->light_height * r.fall[0] * r.fall[0] + span_dot(light[0], look);
    r.times[1] = 4 * plane->light_height * r.fall[0] * r.fall[1] + span_dot(light[1], look) +
                 span_dot(light[0], frame->axis[0]);
    r.times[2] =
        2 * plane->light_height * r.fall[1] * r.fall[1] + span_dot(light[1], frame->axis[0]);
    r.strength = 1 / frame->slope;
    r.shine = s->shininess;
    for (int k = 0; k < 3; k++)
        r.bright = fmax(r.bright, frame->emission[k] * fmax(1, s->color[k]));
    r.dim = 0.01 * fmax(fmax(1, s->color[0]), fmax(s->color[1], s->color[2]));
    return r;
}

// The highlight's least and greatest cosine on the row, times the lengths that it is divided by.
static inline double most_times(const struct row_light *r, double sign) {
    const double *q = r->times;
    double most = sign * (q[0] + (q[1] + q[2] * r->low) * r->low);
    most = fmax(most, sign * (q[0] + (q[1] + q[2] * r->high) * r->high));
    double turn = q[2] != 0 ? -q[1] / (2 * q[2]) : r->low;
    return turn > r->low && turn < r->high ? fmax(most, sign * (q[0] + 0.5 * q[1] * turn)) : most;
}

// The size of the highlight near the row, divided by that of the rest. Where its cosine is negative it is 0, with six
// derivatives if the power is whole and 7 or more.
static double shine_size(const struct row_light *r, double radius, double over) {
    double up = most_times(r, 1), down = most_times(r, -1);
    if (up <= 0)
        return 0;
    double edge = fmax(fabs(r->low), fabs(r->high)), grow = fabs(r->times[1]);
    grow = radius * (grow + fabs(r->times[2]) * (2 * edge + radius));
    int n = (int)fmin(r->shine, 1e6);
    if (down + grow >= 0 && (n < 7 || n != r->shine))
        return INFINITY;
    double cosine = (up + grow) * over;
    return whole_power(cosine, n) * fmax(cosine, 1);
}

// Returns a bound of the error of interpolation, in colours, for nodes at distance 1; it grows with the sixth power of
// that. From discs of this radius about the row.
static double error_of(const struct row_light *r, double radius) {
    double aside = radius / r->light.apart, bend = radius / r->point.apart;
    double sway = radius * fabs(r->fall[1]) / r->least_fall;
    if (!(aside < 0.9) || !(bend <= 0.5) || !(sway <= 0.1) || !(radius <= 0.5 * r->look.apart))
        return INFINITY;
    double most_fall = r->most_fall + radius * fabs(r->fall[1]);
    double least_light = r->light.least * sqrt(1 - aside * aside), per = most_fall / least_light;
    double far = fmax(length_at(&r->point, r->low), length_at(&r->point, r->high));
    far = (far + radius * r->point.rate) / (r->least_fall * (1 - sway));
    double fogged = fmin(2, r->fog * far * far * far); // what the fog takes
    // Without fog, light is a product of powers: its sixth coefficient is 84 times the nearest zero's, or less.
    double facing = r->light_height * per, diffuse = facing * per, clear = fmax(aside, sway);
    clear = 84 * clear * clear * clear * clear * clear * clear;
    double shine =
        0.2 * per * shine_size(r, radius, 1 / (least_light * r->look.least * sqrt(0.75)));
    double sum = diffuse * fmin(1, fogged + clear) + shine;
    double tall = fmax(length_at(&r->light, r->low), length_at(&r->light, r->high));
    if (r->light_height * r->least_fall <
        1.001 * tall / r->strength) // else the plane cannot darken itself
        sum += (diffuse + shine) * r->strength * facing * fmin(1, clear);
    double third = radius * radius * radius;
    return 3.516 * (r->bright * sum + r->dim * fmin(1, fogged)) / (third * third);
}

// The greatest spacing of nodes, in pixels of this width, whose error is below `most`: 64, 32 or 16; or 8, too little.
static inline int widest_spacing(double error, double pixel, double most) {
    int spacing = 64;
    for (; spacing >= 16; spacing /= 2) {
        double third = pixel * spacing * pixel * spacing * pixel * spacing;
        if (error * third * third < most)
            break;
    }
    return spacing;
}

KERNEL_SHARED int fused_spacing(const struct fused_frame *frame, int plane, int y0, int rows,
                                int x0, int x1, double most) {
    struct plane_seen seen = plane_from(frame, plane, frame->eye);
    double pixel = 2 * frame->per_pixel, middle = 0.5 * frame->width;
    int spacing = 64;
    for (int r = 0; r < rows; r++) {
        double y = (frame->height - 1 - 2 * (y0 + r)) * frame->per_pixel;
        double low = pixel * (x0 - middle - 3 * spacing),
               high = pixel * (x1 - middle + 3 * spacing);
        struct row_light light = row_of(frame, &seen, &frame->shape[plane], y, low, high);
        if (!(light.least_fall > 0) || !(seen.light_height > 0))
            return 0;
        double radius = fmin(0.5 * light.point.apart, 0.5 * light.look.apart);
        radius = fmin(radius, 0.6 * light.light.apart);
        radius = fmin(radius, 0.1 * light.least_fall / fmax(fabs(light.fall[1]), 1e-30));
        int best = widest_spacing(error_of(&light, radius), pixel, most);
        if (best < spacing) {
            int other = widest_spacing(error_of(&light, 0.5 * radius), pixel, most);
            best = best > other ? best : other;
        }
        spacing = best < spacing ? best : spacing;
    }
    return spacing >= 16 ? spacing : 0;
}
