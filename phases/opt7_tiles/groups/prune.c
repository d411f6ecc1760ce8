// The part of a group's program that a bundle of rays needs: W. Barbier et al., "Lipschitz pruning: hierarchical
// simplification of primitive-based SDFs" (Computer Graphics Forum 44, 2025). The bundle's tube is cut into as many
// pieces as there are lanes. In a ball of radius R a child's field is within L·R of that at the centre. A union's child
// that is above the least upper bound by more than the blend's k has no part there: PROOFS.md, 9.
#include "groups/choice.h"
#include "groups/field.h"

#include <string.h>

// A piece of the bundle's tube in each lane: a ball around `centre`.
struct pieces {
    struct vec centre;
    vfloat radius, ahead; // ahead: how far the rays may go on from where they are
};

static vfloat widest(vfloat a) {
    return v_max_of_lanes(a);
}

static vfloat first_lane(vfloat a, unsigned lanes) {
    float lane[LANES];
    v_store(a, lane);
    return v_splat(lane[__builtin_ctz(lanes)]);
}

// The rays in the group's frame.
struct bundle {
    struct vec at[GROUP], direction[GROUP];
    const vmask *live;
    int count;
};

// Returns the middle of the range of one coordinate over all live rays.
static vfloat middle_of(const struct bundle *b, size_t part) {
    vfloat most = v_splat(-INFINITY), minus = most;
    for (int k = 0; k < b->count; k++) {
        vfloat x = *(const vfloat *)((const char *)&b->at[k] + part);
        most = v_select(b->live[k], v_max(x, most), most);
        minus = v_select(b->live[k], v_max(v_splat(0.0f) - x, minus), minus);
    }
    return v_splat(0.5f) * (widest(most) - widest(minus));
}

// Cuts the tube of the rays into pieces. It is as long as the rays are far from the group's sphere, and longer by half
// of the sphere's radius and by some of its own widths. Its axis has the direction of one ray.
__attribute__((noinline)) static struct pieces pieces_of(const struct bundle *b,
                                                         const struct program *program) {
    vfloat zero = v_splat(0.0f), least = v_splat(INFINITY), off = zero, turn = zero, gap = least;
    vfloat most = v_splat(-INFINITY);
    unsigned lanes = v_mask_bits(b->live[0]);
    struct vec d = b->direction[0];
    struct vec axis = {first_lane(d.x, lanes), first_lane(d.y, lanes), first_lane(d.z, lanes)};
    struct vec from = {middle_of(b, offsetof(struct vec, x)), middle_of(b, offsetof(struct vec, y)),
                       middle_of(b, offsetof(struct vec, z))};
    for (int k = 0; k < b->count; k++) {
        struct vec to = vec_sub(b->at[k], from), aside = vec_sub(b->direction[k], axis);
        vfloat along = vec_dot(to, axis);
        vfloat across = v_nmadd(along, along, vec_dot(to, to));
        vfloat far = vec_norm(vec_sub(b->at[k], vec_set(program->centre)));
        off = v_select(b->live[k], v_max(across, off), off);
        turn = v_select(b->live[k], v_max(vec_dot(aside, aside), turn), turn);
        most = v_select(b->live[k], v_max(along, most), most);
        least = v_select(b->live[k], v_min(along, least), least);
        gap = v_select(b->live[k], v_min(far, gap), gap);
    }
    bool bounded = program->radius < INFINITY;
    vfloat radius = v_splat(bounded ? program->radius : 1.0f), half = v_splat(0.5f);
    gap = bounded ? v_max(v_splat(v_reduce_min(gap)) - radius, zero) : zero;
    off = v_sqrt(v_max(widest(off), zero));
    turn = v_sqrt(widest(turn));
    vfloat ahead = v_madd(v_splat(2.0f), gap, v_madd(v_splat(LANES), off, half * radius));
    vfloat wide = v_madd(turn, ahead, off);
    vfloat begin = v_nmadd(turn, ahead, v_splat(v_reduce_min(least)));
    vfloat length = (widest(most) + ahead - begin) * v_splat(1.0f / LANES);
    struct vec centre = vec_along(from, axis, v_madd(v_iota() + half, length, begin));
    vfloat r = v_sqrt(v_madd(half * length, half * length, wide * wide));
    r = v_madd(r, v_splat(1.0f + 0x1p-10f), v_splat(program->beside + program->error));
    return (struct pieces){centre, r, ahead};
}

// A search in work. Arrays have an element for each step.
struct search {
    const struct program *whole;
    vfloat radius;
    vfloat *
        value; // at the centres of the pieces: of the field that a step leaves on the stack; +∞: not needed
    int *begin;       // the first step of the same field
    bool *alive;      // whether the step has a part in some piece. Then its value must hold in all
    short *kept;      // of a fold: how many of its distances
    bool *first_kept; // of a fold
};

// Returns the least upper bound of a union by its clusters alone: `cluster` is the first. A cluster's sphere holds a
// point of a solid, from where the field grows by no more than the path.
static vfloat bound_of_clusters(const struct search *s, const struct cluster *cluster,
                                struct vec p) {
    vfloat least = v_splat(INFINITY);
    for (int i = 0; i < cluster->left; i++) {
        vfloat far = vec_norm(vec_sub(p, vec_set(cluster[i].centre)));
        least = v_min(far + v_splat(cluster[i].radius), least);
    }
    return least + s->radius;
}

// Whether a cluster has no part in any piece of a union whose least upper bound is `least`.
static bool misses_cluster(const struct search *s, const struct cluster *c, struct vec p,
                           vfloat least) {
    vfloat far = vec_norm(vec_sub(p, vec_set(c->centre))) - v_splat(c->radius);
    vfloat lower = far * v_splat(c->growth * (1 - 1e-5f)) - s->radius;
    return v_all(v_cmp_gt(v_min(lower, far), least));
}

// Sets the values of the shapes of a cluster, and lowers the least upper bound of their union by them.
__attribute__((noinline)) static void value_cluster(struct search *s, int at, float blend,
                                                    const struct vec *p, vfloat *least) {
    const struct step *step = &s->whole->steps[at];
    const struct cluster *c = &s->whole->clusters[step->node];
    if (step->first)
        *least = bound_of_clusters(s, c, *p);
    bool misses = misses_cluster(s, c, *p, *least + v_splat(blend));
    for (int i = at + 1; i <= at + step->count; i++) {
        s->begin[i] = i;
        s->alive[i] = false;
        s->value[i] = v_splat(INFINITY);
        if (misses)
            continue;
        const struct step *shape = &s->whole->steps[i];
        COUNT(group_shape, call);
        shape_distances(shape, &s->whole->nodes[shape->node], p, 1, &s->value[i]);
        *least = v_min(s->value[i] + s->radius, *least);
    }
}

// Returns the blend of the union whose shapes begin with a cluster.
static float blend_of_clusters(const struct program *program, int at) {
    while (program->steps[at].kind != STEP_FOLD)
        at++;
    return program->nodes[program->steps[at].node].blend;
}

// Sets the value of a fold, from those of its children: the last `count` fields.
static void value_fold(struct search *s, int at, const int *fields) {
    const struct step *step = &s->whole->steps[at];
    s->begin[at] = s->begin[fields[0]];
    if (at + 1 == s->whole->length) // nobody asks for the root's
        return;
    vfloat d[step->count];
    for (int i = 0; i < step->count; i++)
        d[i] = s->value[fields[i]];
    s->value[at] = folded_distance(step, &s->whole->nodes[step->node], 1, d);
}

// Sets all values, and that no step is alive.
static void value_steps(struct search *s, const struct vec *centre) {
    const struct program *whole = s->whole;
    int fields[whole->values], count = 0, enters[whole->points + 1];
    struct vec points[whole->points + 1], *p = points;
    vfloat least = v_splat(INFINITY);
    float blend = 0;
    points[0] = *centre;
    for (int i = 0; i < whole->length; i++) {
        const struct step *step = &whole->steps[i];
        const struct group_node *n = &whole->nodes[step->node];
        s->begin[i] = i;
        s->alive[i] = false;
        s->kept[i] = 0;
        switch (step->kind) {
        case STEP_CLUSTER:
            blend = step->first ? blend_of_clusters(whole, i) : blend;
            value_cluster(s, i, blend, p, &least);
            for (int k = 0; k < step->count; k++)
                fields[count++] = ++i;
            break;
        case STEP_SHAPE:
            COUNT(group_shape, call);
            shape_distances(step, n, p, 1, &s->value[i]);
            fields[count++] = i;
            break;
        case STEP_ENTER:
            enters[p - points] = i;
            enter_node(n, p, p + 1);
            p++;
            break;
        case STEP_FOLD:
            count -= step->count;
            value_fold(s, i, fields + count);
            fields[count++] = i;
            break;
        default:
            p--;
            s->begin[i] = enters[p - points];
            s->value[i] = leave_node(n, p, s->value[i - 1]);
            fields[count - 1] = i;
            break;
        }
    }
}

// Returns the step that leaves the field before the one that begins at `begin`.
static int field_before(const struct program *program, int begin) {
    int i = begin - 1;
    while (i > 0 && program->steps[i].kind == STEP_CLUSTER)
        i--;
    return i;
}

// Sets which children of a fold have a part in some piece.
static void prune_fold(struct search *s, int at) {
    const struct program *whole = s->whole;
    const struct step *step = &whole->steps[at];
    const struct group_node *n = &whole->nodes[step->node];
    vfloat least = v_splat(INFINITY), blend = v_splat(n->blend);
    bool bent = n->bent || n->twist != 0 || n->shape.repeated;
    for (int i = step->count - 1, c = at - 1; i >= 0 && !bent;
         i--, c = field_before(whole, s->begin[c])) {
        const struct group_node *child = &whole->nodes[whole->steps[c].node];
        vfloat value = negated_if(is_negated(step, n, i), s->value[c]);
        if (!child->jumps)
            least = v_min(v_madd(v_splat(child->lipschitz), s->radius, value), least);
    }
    for (int i = step->count - 1, c = at - 1; i >= 0; i--, c = field_before(whole, s->begin[c])) {
        const struct group_node *child = &whole->nodes[whole->steps[c].node];
        vfloat value = negated_if(is_negated(step, n, i), s->value[c]);
        vfloat lower = v_nmadd(v_splat(child->lipschitz), s->radius, value);
        s->alive[c] = bent || child->jumps || !v_all(v_cmp_gt(lower, least + blend));
        s->kept[at] = (short)(s->kept[at] + s->alive[c]);
        s->first_kept[at] = i == 0 && s->alive[c];
    }
}

// Writes the steps that have a part somewhere. A fold of one distance is none, unless it changes its sign.
static void write_part(const struct search *s, struct region *r) {
    const struct program *whole = s->whole;
    struct program *part = r->program;
    *part = *whole;
    part->steps = r->steps;
    part->length = part->shapes = 0;
    int values = 0;
    part->values = 1;
    for (int i = 0; i < whole->length; i++) {
        struct step step = whole->steps[i];
        if (step.kind == STEP_CLUSTER || !s->alive[i])
            continue;
        if (step.kind == STEP_FOLD) {
            enum operation operation = whole->nodes[step.node].operation;
            step.count = s->kept[i];
            step.first = s->first_kept[i];
            if (step.count == 1 && (operation != NODE_DIFFERENCE || step.first))
                continue;
            values -= step.count - 1;
        } else if (step.kind == STEP_SHAPE) {
            part->shapes++;
            part->values = ++values > part->values ? values : part->values;
        }
        r->steps[part->length++] = step;
    }
}

void prune_program(const struct local_ray *const *rays, const vfloat *t, const vmask *live,
                   int count, const struct primitive *primitive) {
    const struct program *whole = primitive->program;
    struct bundle b = {.live = live, .count = count};
    for (int k = 0; k < count; k++) {
        b.at[k] = vec_along(rays[k]->origin, rays[k]->direction, t[k]);
        b.direction[k] = rays[k]->direction;
    }
    struct pieces pieces = pieces_of(&b, whole);
    size_t steps = (size_t)whole->length;
    vfloat value[steps];
    bool alive[steps];
    int begin[steps];
    short kept[steps];
    bool first_kept[steps];
    struct search s = {whole, pieces.radius, value, begin, alive, kept, first_kept};
    ACTIVE(LANES);
    COUNT(prune_group, call);
    value_steps(&s, &pieces.centre);
    for (int i = whole->length - 1; i >= 0; i--) {
        alive[i] = alive[i] || i == whole->length - 1;
        if (alive[i] && whole->steps[i].kind == STEP_FOLD)
            prune_fold(&s, i);
        else if (alive[i] && whole->steps[i].kind == STEP_LEAVE)
            alive[i - 1] = alive[begin[i]] = alive[i];
    }
    struct region *owner = rays[0]->region;
    write_part(&s, owner);
    owner->owned++;
    for (int k = 0; k < count; k++) {
        rays[k]->region->until = v_select(live[k], t[k] + pieces.ahead, v_splat(-INFINITY));
        rays[k]->region->owner = owner;
        rays[k]->region->serial = owner->owned;
    }
}

// Returns the size of a region for a group with so many nodes.
static size_t region_size(int nodes) {
    return (sizeof(struct region) + sizeof(struct program) +
            most_steps((size_t)nodes) * sizeof(struct step) + 63) /
           64 * 64;
}

size_t regions_size(const struct model *model, int packets) {
    size_t size = 0;
    for (int i = 0; i < model->shape_count; i++)
        if (model->shapes[i].type == SHAPE_GROUP) {
            int root = model->shapes[i].group.root;
            size += (size_t)packets * region_size(model->nodes[root].end - root);
        }
    return size;
}

void place_regions(void *memory, const struct model *model, struct local_ray *const *local,
                   int packets) {
    char *next = memory;
    for (int i = 0; i < model->shape_count; i++) {
        if (model->shapes[i].type != SHAPE_GROUP)
            continue;
        int root = model->shapes[i].group.root;
        for (int k = 0; k < packets; k++) {
            struct region *r = local[k][i].region = (struct region *)next;
            *r = (struct region){.until = v_splat(-INFINITY), .owner = r};
            r->program = (struct program *)(r + 1);
            r->steps = (struct step *)(r->program + 1);
            next += region_size(model->nodes[root].end - root);
        }
    }
}
