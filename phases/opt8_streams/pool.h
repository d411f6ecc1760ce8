// Where Mandelbulbs are, some rays take a thousand steps and most a few dozen: lanes whose ray has ended are filled
// again from the rays that wait, so that the lanes of a packet are rays of different age. No lane's result depends on
// its neighbours, so that it is to the bit that of a packet which waits for its last ray.
#ifndef OPT8_POOL_H
#define OPT8_POOL_H

#include "umbra.h"

enum { REFILL = TOGETHER / 16 }; // lanes that have ended

// What the lanes of a packet have, but for what is in the group.
struct pool {
    struct shade shade; // camera rays have its exit alone
    real evals, length, end; // POOL_REALS from the beginning to here
    int ray[LANES];
};
enum { POOL_REALS = 7, APPROACH_REALS = 8 };

// Packets of rays that are made ready one by one, and go lane by lane to where one is free.
struct stream {
    int next, count; // of the packets that wait
    struct pool pool[GROUP], ready;
    struct beam beam; // of the one that is ready
    real t;
    unsigned waiting; // its lanes that have not gone
    bool shadows;     // else camera rays
};

// Makes packet `number` ready.
void ready_shadow(struct stream *stream, int number, struct world *world);
void ready_gaze(struct stream *stream, int number, struct world *world);

static inline void copy_reals(void *to, int here, const void *from, int there, int count) {
    for (int i = 0; i < count; i++)
        ((float *)to)[i * LANES + here] = ((const float *)from)[i * LANES + there];
}

static inline void copy_lane(struct stream *stream, int k, int here, struct world *world) {
    struct group *group = &world->group;
    int there = __builtin_ctz(stream->waiting), shapes = world->scene->model.shape_count;
    stream->waiting &= stream->waiting - 1;
    copy_reals(&stream->pool[k], here, &stream->ready, there, POOL_REALS);
    copy_reals(&group->t[k], here, &stream->t, there, 1);
    for (int i = 0; i < shapes; i++) {
        copy_reals(&group->beam[k].approach[i], here, &stream->beam.approach[i], there,
                   APPROACH_REALS);
        ((float *)&group->beam[k].wake[i * GROUP])[here] = -INFINITY;
    }
    ((float *)&group->high[k])[here] = INFINITY;
    stream->pool[k].ray[here] = stream->ready.ray[there];
}

// Lanes that are free get a ray, as long as there is one. How many lanes have one.
static inline int refill(struct stream *stream, struct world *world) {
    struct group *group = &world->group;
    int live = 0;
    group->count = 0;
    for (int k = 0; k < GROUP; k++) {
        unsigned all = (1u << LANES) - 1, lanes = bits(group->live[k]);
        for (unsigned ended = ~lanes & all; ended; ended &= ended - 1) {
            while (!stream->waiting && stream->next < stream->count) {
                int number = stream->next++;
                if (stream->shadows)
                    ready_shadow(stream, number, world);
                else
                    ready_gaze(stream, number, world);
            }
            if (!stream->waiting)
                break;
            copy_lane(stream, k, __builtin_ctz(ended), world);
            lanes |= ended & -ended;
        }
        group->live[k] = lanes_of(lanes);
        if (lanes)
            group->list[group->count++] = k;
        live += __builtin_popcount(lanes);
    }
    return live;
}

// Nothing is under way.
static inline void stream_begin(struct stream *stream, int packets, bool shadows,
                                struct world *world) {
    struct group *group = &world->group;
    *stream = (struct stream){.count = packets, .shadows = shadows};
    for (int k = 0; k < GROUP; k++) {
        group->live[k] = no_lane();
        group->t[k] = set(0.0f);
        group->high[k] = set(-INFINITY);
        group->beam[k].list = world->scene->all;
    }
}

// So many lanes may still be at work when the next rays are asked for.
static inline int enough(const struct stream *stream, int live) {
    return stream->waiting || stream->next < stream->count ? live - REFILL : 0;
}

#endif
