// Hides the differences between Embree 3 and 4, which pass a query's context before and after the rays. Only
// Embree 3 has streams: plain arrays with many rays per call.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>

#if WITH_EMBREE >= 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

enum { STREAM = 256 }; // rays per call: as many as a tile of the phase `packets` has

#if WITH_EMBREE >= 4
struct query_arguments {
    struct RTCIntersectArguments nearest;
    struct RTCOccludedArguments any;
};

static inline void init_query(struct query_arguments *query_arguments, bool coherent) {
    rtcInitIntersectArguments(&query_arguments->nearest);
    rtcInitOccludedArguments(&query_arguments->any);
    query_arguments->nearest.flags = query_arguments->any.flags =
        coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
}

#define INTERSECT16(valid, scene, a, rays) rtcIntersect16(valid, scene, rays, &(a)->nearest)
#define OCCLUDED16(valid, scene, a, rays) rtcOccluded16(valid, scene, rays, &(a)->any)
#define INTERSECT1(scene, a, ray) rtcIntersect1(scene, ray, &(a)->nearest)
#define OCCLUDED1(scene, a, ray) rtcOccluded1(scene, ray, &(a)->any)

struct ray_stream {
    bool available; // always false
};

#define ray_stream_create(stream, device, room) true
#define ray_stream_put(...) ((void)0)
#define ray_stream_get(...) ((void)0)
#define ray_stream_trace(...) ((void)0)
#define ray_stream_free(...) ((void)0)
#else
struct query_arguments {
    struct RTCIntersectContext context;
};

static inline void init_query(struct query_arguments *query_arguments, bool coherent) {
    rtcInitIntersectContext(&query_arguments->context);
    query_arguments->context.flags =
        coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
}

#define INTERSECT16(valid, scene, a, rays) rtcIntersect16(valid, scene, &(a)->context, rays)
#define OCCLUDED16(valid, scene, a, rays) rtcOccluded16(valid, scene, &(a)->context, rays)
#define INTERSECT1(scene, a, ray) rtcIntersect1(scene, &(a)->context, ray)
#define OCCLUDED1(scene, a, ray) rtcOccluded1(scene, &(a)->context, ray)

struct ray_stream {
    bool available; // the library was built with streams
    float *reals;
    unsigned *words;
    struct RTCRayHitNp all; // arrays of `room` rays
};

static inline bool ray_stream_create(struct ray_stream *s, RTCDevice device, size_t room) {
    s->available = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_RAY_STREAM_SUPPORTED) != 0;
    if (!s->available)
        return true;
    s->reals = aligned_alloc(64, 14 * room * sizeof *s->reals);
    s->words = aligned_alloc(64, 6 * room * sizeof *s->words);
    if (!s->reals || !s->words)
        return false;
    float *f = s->reals;
    unsigned *w = s->words;
    size_t n = room;
    s->all = (struct RTCRayHitNp){
        .ray = {f, f + n, f + 2 * n, f + 3 * n, f + 4 * n, f + 5 * n, f + 6 * n, f + 7 * n,
                f + 8 * n, w, w + n, w + 2 * n},
        .hit = {f + 9 * n,
                f + 10 * n,
                f + 11 * n,
                f + 12 * n,
                f + 13 * n,
                w + 3 * n,
                w + 4 * n,
                {w + 5 * n}},
    };
    return true;
}

static inline void ray_stream_put(struct ray_stream *s, size_t i, const float at[6], float far) {
    struct RTCRayNp *r = &s->all.ray;
    r->org_x[i] = at[0];
    r->org_y[i] = at[1];
    r->org_z[i] = at[2];
    r->dir_x[i] = at[3];
    r->dir_y[i] = at[4];
    r->dir_z[i] = at[5];
    r->tnear[i] = r->time[i] = 0;
    r->tfar[i] = far;
    r->mask[i] = ~0u;
    r->flags[i] = r->id[i] = 0;
    s->all.hit.geomID[i] = s->all.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
}

static inline void ray_stream_get(const struct ray_stream *s, size_t i, float *t,
                                  unsigned *geometry, unsigned *primitive) {
    *t = s->all.ray.tfar[i];
    *geometry = s->all.hit.geomID[i];
    *primitive = s->all.hit.primID[i];
}

// The same arrays from ray `first` on.
static inline struct RTCRayHitNp ray_stream_from(const struct ray_stream *s, size_t first) {
    const struct RTCRayNp *r = &s->all.ray;
    const struct RTCHitNp *h = &s->all.hit;
    return (struct RTCRayHitNp){
        .ray = {r->org_x + first, r->org_y + first, r->org_z + first, r->tnear + first,
                r->dir_x + first, r->dir_y + first, r->dir_z + first, r->time + first,
                r->tfar + first, r->mask + first, r->id + first, r->flags + first},
        .hit = {h->Ng_x + first,
                h->Ng_y + first,
                h->Ng_z + first,
                h->u + first,
                h->v + first,
                h->primID + first,
                h->geomID + first,
                {h->instID[0] + first}},
    };
}

static inline void ray_stream_trace(const struct ray_stream *s, RTCScene scene,
                                    struct query_arguments *query_arguments, size_t count,
                                    bool any) {
    for (size_t i = 0; i < count; i += STREAM) {
        struct RTCRayHitNp rays = ray_stream_from(s, i);
        unsigned many = (unsigned)(count - i < STREAM ? count - i : STREAM);
        if (any)
            rtcOccludedNp(scene, &query_arguments->context, &rays.ray, many);
        else
            rtcIntersectNp(scene, &query_arguments->context, &rays, many);
    }
}

static inline void ray_stream_free(struct ray_stream *s) {
    free(s->reals);
    free(s->words);
}
#endif
