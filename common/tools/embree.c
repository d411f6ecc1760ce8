// Traces rays with Embree (see embree.h): single-threaded, with its best build quality, and with
// denormals as zeros, as its manual recommends. Spheres are RTC_GEOMETRY_TYPE_SPHERE_POINT.
#include "tools/embree.h"

#ifdef __x86_64__
#include <immintrin.h>
#endif
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "timing/timer.h"

#ifdef WITH_EMBREE
#include "tools/embree_versions.h"

// Rays converted to Embree's form at a time: few enough to be still in the cache when traced.
enum { CHUNK = 1024 };
#ifdef __x86_64__
enum { DENORMALS_ARE_ZEROS = 0x8040 }; // MXCSR: flush to zero, and denormals are zero

static uint64_t float_control(void) {
    return _mm_getcsr();
}

static void set_float_control(uint64_t bits) {
    _mm_setcsr((unsigned)bits);
}
#else
enum { DENORMALS_ARE_ZEROS = 1 << 24 }; // FPCR.FZ, for both

static uint64_t float_control(void) {
    uint64_t bits;
    __asm__ volatile("mrs %0, fpcr" : "=r"(bits));
    return bits;
}

static void set_float_control(uint64_t bits) {
    __asm__ volatile("msr fpcr, %0" ::"r"(bits));
}
#endif

struct embree {
    RTCDevice device;
    RTCScene scene;
    bool coherent;
    char version[80];
    struct RTCRayHit16 *packets;
    struct RTCRayHit *single;
    struct ray_stream stream;
    int *shape_of; // index of each sphere of geometry 0, then of plane i, geometry 1 + i
    int spheres;
};

const char *embree_version(const struct embree *embree) {
    return embree->version;
}

bool embree_has_streams(const struct embree *embree) {
    return embree->stream.available;
}

// Asks the library for its version.
static void read_version(struct embree *b) {
    int version = (int)rtcGetDeviceProperty(b->device, RTC_DEVICE_PROPERTY_VERSION);
    bool native = rtcGetDeviceProperty(b->device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0;
    snprintf(b->version, sizeof b->version, "Embree %d.%d.%d, packets of 16 %s", version / 10000,
             version / 100 % 100, version % 100, native ? "native" : "emulated");
}

static bool add_spheres(struct embree *b, const struct model *model) {
    for (int i = 0; i < model->shape_count; i++)
        b->spheres += model->shapes[i].type == SHAPE_SPHERE;
    if (b->spheres == 0)
        return true;
    RTCGeometry geometry = rtcNewGeometry(b->device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
    float *at = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 16,
                                        (size_t)b->spheres);
    int next = 0;
    for (int i = 0; i < model->shape_count && at; i++) {
        const struct shape *s = &model->shapes[i];
        if (s->type != SHAPE_SPHERE)
            continue;
        for (int k = 0; k < 3; k++)
            at[4 * next + k] = (float)s->position[k];
        at[4 * next + 3] = (float)s->sphere.radius;
        b->shape_of[next++] = i;
    }
    rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_HIGH);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(b->scene, geometry, 0);
    rtcReleaseGeometry(geometry);
    return at != NULL;
}

// Adds plane `number` as a square. Its normal has unit length, and the shape is not rotated.
static bool add_plane(struct embree *b, const struct model *model, int index, int number) {
    const struct shape *s = &model->shapes[index];
    const double *n = s->plane.normal;
    int least = fabs(n[0]) < fabs(n[1]) ? 0 : 1;
    least = fabs(n[2]) < fabs(n[least]) ? 2 : least;
    double axis[3] = {least == 0, least == 1, least == 2}, u[3], v[3], length = 0, offset;
    for (int k = 0; k < 3; k++)
        u[k] = axis[(k + 1) % 3] * n[(k + 2) % 3] - axis[(k + 2) % 3] * n[(k + 1) % 3];
    for (int k = 0; k < 3; k++)
        length += u[k] * u[k];
    for (int k = 0; k < 3; k++)
        u[k] /= sqrt(length);
    for (int k = 0; k < 3; k++)
        v[k] = n[(k + 1) % 3] * u[(k + 2) % 3] - n[(k + 2) % 3] * u[(k + 1) % 3];
    offset =
        s->plane.offset + n[0] * s->position[0] + n[1] * s->position[1] + n[2] * s->position[2];
    RTCGeometry geometry = rtcNewGeometry(b->device, RTC_GEOMETRY_TYPE_QUAD);
    float *at =
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 4);
    unsigned *corner =
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4, 16, 1);
    static const int side[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    for (int i = 0; i < 4 && at && corner; i++) {
        corner[i] = (unsigned)i;
        for (int k = 0; k < 3; k++)
            at[3 * i + k] = (float)(n[k] * offset + 4 * model->march.bounds_radius *
                                                        (side[i][0] * u[k] + side[i][1] * v[k]));
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(b->scene, geometry, (unsigned)(1 + number));
    rtcReleaseGeometry(geometry);
    b->shape_of[b->spheres + number] = index;
    return at && corner;
}

// Returns why Embree cannot have this scene, NULL if it can.
static const char *unsupported_scene(const struct model *model) {
    if (model->features.rotation || model->features.repetition)
        return "not compared: the scene has rotations or repetitions";
    for (int i = 0; i < model->shape_count; i++)
        if (model->shapes[i].type != SHAPE_SPHERE && model->shapes[i].type != SHAPE_PLANE)
            return "not compared: the scene has shapes other than spheres and planes";
    return NULL;
}

static void put_single(struct RTCRayHit *r, const float at[6], float far) {
    r->ray = (struct RTCRay){at[0], at[1], at[2], 0, at[3], at[4], at[5], 0, far, ~0u, 0, 0};
    r->hit.geomID = r->hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
}

static void put_lane(struct RTCRayHit16 *r, size_t lane, const float at[6], float far) {
    r->ray.org_x[lane] = at[0];
    r->ray.org_y[lane] = at[1];
    r->ray.org_z[lane] = at[2];
    r->ray.dir_x[lane] = at[3];
    r->ray.dir_y[lane] = at[4];
    r->ray.dir_z[lane] = at[5];
    r->ray.tnear[lane] = r->ray.time[lane] = 0;
    r->ray.tfar[lane] = far;
    r->ray.mask[lane] = ~0u;
    r->ray.flags[lane] = r->ray.id[lane] = 0;
    r->hit.geomID[lane] = r->hit.instID[0][lane] = RTC_INVALID_GEOMETRY_ID;
}

// Converts rays first … first + CHUNK − 1 to Embree's form. Rays after the last one hit nothing.
static void put_rays(struct embree *b, const struct ray_arrays *rays, size_t first, bool any,
                     enum embree_mode mode) {
    for (size_t i = 0; i < CHUNK; i++) {
        bool available = first + i < rays->count;
        float far = !available ? -1.0f : any ? rays->far[first + i] : INFINITY;
        float at[6];
        for (int k = 0; k < 3; k++) {
            at[k] = available ? rays->origin[k][first + i] : 0;
            at[3 + k] = available ? rays->direction[k][first + i] : 1;
        }
        if (mode == EMBREE_SINGLE)
            put_single(&b->single[i], at, far);
        else if (mode == EMBREE_PACKETS)
            put_lane(&b->packets[i / 16], i % 16, at, far);
        else
            ray_stream_put(&b->stream, i, at, far);
    }
}

// Converts the hits of the same rays back.
static void get_hits(const struct embree *b, struct ray_arrays *rays, size_t first, bool any,
                     enum embree_mode mode) {
    for (size_t i = 0; i < CHUNK && first + i < rays->count; i++) {
        const struct RTCRayHit16 *r = &b->packets[i / 16];
        size_t lane = i % 16;
        float t = mode == EMBREE_PACKETS ? r->ray.tfar[lane] : b->single[i].ray.tfar;
        unsigned geometry = mode == EMBREE_PACKETS ? r->hit.geomID[lane] : b->single[i].hit.geomID;
        unsigned primitive = mode == EMBREE_PACKETS ? r->hit.primID[lane] : b->single[i].hit.primID;
        if (mode == EMBREE_STREAM)
            ray_stream_get(&b->stream, i, &t, &geometry, &primitive);
        bool met = geometry != RTC_INVALID_GEOMETRY_ID;
        rays->t[1][first + i] = t;
        rays->shape[1][first + i] =
            any    ? 0
            : !met ? -1
                   : (float)b->shape_of[geometry ? (unsigned)b->spheres + geometry - 1 : primitive];
    }
}

struct embree *embree_create(const struct model *model, bool coherent, const char **reason) {
    if ((*reason = unsupported_scene(model)))
        return NULL;
    *reason = "not compared: Embree cannot be started, or memory is short";
    struct embree *b = calloc(1, sizeof *b);
    if (!b)
        return NULL;
    b->coherent = coherent;
    b->shape_of = calloc((size_t)model->shape_count, sizeof *b->shape_of);
    b->packets = aligned_alloc(64, CHUNK / 16 * sizeof *b->packets);
    b->single = aligned_alloc(64, CHUNK * sizeof *b->single);
    if (b->single)
        memset(b->single, 0, CHUNK * sizeof *b->single);
    b->device = rtcNewDevice("threads=1");
    bool made = b->shape_of && b->packets && b->single && b->device &&
                ray_stream_create(&b->stream, b->device, CHUNK);
    if (made) {
        b->scene = rtcNewScene(b->device);
        rtcSetSceneBuildQuality(b->scene, RTC_BUILD_QUALITY_HIGH);
        made = add_spheres(b, model);
        for (int i = 0, planes = 0; i < model->shape_count && made; i++)
            if (model->shapes[i].type == SHAPE_PLANE)
                made = add_plane(b, model, i, planes++);
        rtcCommitScene(b->scene);
        read_version(b);
        if (rtcGetDeviceError(b->device) != RTC_ERROR_NONE) {
            *reason = "not compared: Embree cannot have this scene";
            made = false;
        }
    }
    if (made)
        return b;
    embree_destroy(b);
    return NULL;
}

static void trace_chunk(struct embree *b, struct query_arguments *query_arguments, size_t count,
                        bool any, enum embree_mode mode) {
    static const _Alignas(64) int valid[16] = {-1, -1, -1, -1, -1, -1, -1, -1,
                                               -1, -1, -1, -1, -1, -1, -1, -1};
    bool packets = mode == EMBREE_PACKETS;
    if (mode == EMBREE_STREAM) {
        ray_stream_trace(&b->stream, b->scene, query_arguments, count, any);
        return;
    }
    for (size_t i = 0; i < (packets ? (count + 15) / 16 : count); i++) {
        if (packets && any)
            OCCLUDED16(valid, b->scene, query_arguments, (struct RTCRay16 *)&b->packets[i].ray);
        else if (packets)
            INTERSECT16(valid, b->scene, query_arguments, &b->packets[i]);
        else if (any)
            OCCLUDED1(b->scene, query_arguments, &b->single[i].ray);
        else
            INTERSECT1(b->scene, query_arguments, &b->single[i]);
    }
}

uint64_t embree_trace(struct embree *b, struct ray_arrays *rays, bool any, enum embree_mode mode) {
    struct query_arguments query_arguments;
    init_query(&query_arguments, b->coherent);
    uint64_t before = float_control(), elapsed = 0;
    for (size_t first = 0; first < rays->count; first += CHUNK) {
        size_t left = rays->count - first;
        put_rays(b, rays, first, any, mode);
        set_float_control(before | DENORMALS_ARE_ZEROS);
        uint64_t begin = timer_ns();
        trace_chunk(b, &query_arguments, left < CHUNK ? left : CHUNK, any, mode);
        elapsed += timer_ns() - begin;
        set_float_control(before);
        get_hits(b, rays, first, any, mode);
    }
    return elapsed;
}

void embree_destroy(struct embree *b) {
    if (!b)
        return;
    if (b->scene)
        rtcReleaseScene(b->scene);
    if (b->device)
        rtcReleaseDevice(b->device);
    free(b->shape_of);
    free(b->packets);
    free(b->single);
    ray_stream_free(&b->stream);
    free(b);
}

#else

struct embree *embree_create(const struct model *model, bool coherent, const char **reason) {
    (void)model, (void)coherent;
    *reason = "not compared: built without Embree (libembree-dev)";
    return NULL;
}

const char *embree_version(const struct embree *b) {
    (void)b;
    return "";
}

bool embree_has_streams(const struct embree *b) {
    (void)b;
    return false;
}

uint64_t embree_trace(struct embree *b, struct ray_arrays *rays, bool any, enum embree_mode mode) {
    (void)b, (void)rays, (void)any, (void)mode;
    return 0;
}

void embree_destroy(struct embree *b) {
    (void)b;
}

#endif
