// Rays together: cones of neighbouring pixels and bundles of secondary rays, and which shapes they
// can meet. P. Hanrahan's and J. Amanatides's beams and cones (SIGGRAPH 1984) over a distance field,
// as J. C. Hart proposed (1996) and as rods of pixels do it (see NOTES.md): what is between two rays
// that stand |p − q| apart differs in distance by no more than that.
#ifndef OPT7_TILES_H
#define OPT7_TILES_H

#include "trace.h"

// A worker's memory, of the size that own_size() says.
struct own {
    struct approach *approach;   // of the rays being marched
    struct approach *eye;        // of the cones: origins at the camera
    real *distance;              // at the ends of a bundle's intervals
    mask *kept;                  // lanes whose cone can meet the shape
    int *lanes;                  // the same as bits
    int *tile, *mirror, *shadow; // indices of lists
};

size_t own_size(int shapes);
struct own own_of(void *memory, int shapes);

// The pixels of a block: a cone in each lane. |dir − axis| ≤ spread for each of its rays.
struct cones {
    struct vec axis;
    real spread;
    real start; // no ray of it is hit before; +inf: none is, up to the bounds
};

// Fills start and own->lanes: what a ray of the cone can hit between start and the bounds, and what is so
// near to such a place that the normal there asks for it.
void march_cones(struct place eye, mask active, struct cones *cones, const struct prepared *scene,
                 struct own *own);
struct list list_of_cone(int lane, const struct prepared *scene, struct own *own);

// What the rays of a packet can meet: a mask of places in the list for each interval of the way, which
// is cut by octaves; what is beyond the 31st place shares the last bit.
struct meeting {
    struct list list;
    __m256i places;  // lane 1 … 7: interval
    real per_length; // t·per_length < 1
};

// `length`: the furthest that a ray goes. UNION: the least of all distances is that of the list; HIT: so is
// the first hit.
enum meant { UNION, HIT };
struct meeting meet(struct place origin, struct vec direction, mask active, real length,
                    enum meant meant, const struct world *world, int *shapes);

// Places that matter to any lane that is not done.
static inline unsigned places_at(const struct meeting *meeting, real t, mask done) {
    __m256i octave = _mm256_srli_epi32(_mm256_castps_si256(t * meeting->per_length), 23);
    octave = _mm256_sub_epi32(octave, _mm256_set1_epi32(119));
    octave = _mm256_max_epi32(octave, _mm256_set1_epi32(1));
    octave = _mm256_min_epi32(octave, _mm256_set1_epi32(LANES - 1));
    __m256i places = _mm256_permutevar8x32_epi32(meeting->places, octave);
    places = _mm256_andnot_si256(_mm256_castps_si256(done), places);
    __m128i half =
        _mm_or_si128(_mm256_castsi256_si128(places), _mm256_extracti128_si256(places, 1));
    half = _mm_or_si128(half, _mm_shuffle_epi32(half, 0x4e));
    half = _mm_or_si128(half, _mm_shuffle_epi32(half, 0xb1));
    return (unsigned)_mm_cvtsi128_si32(half);
}

// As sdf() of the whole scene: what is left out is not the least there.
__attribute__((always_inline)) static inline real sdf_met(const struct approach *approach, real t,
                                                          const struct prepared *scene, mask done,
                                                          const struct meeting *meeting) {
    COUNT(sdf_met, call);
    real least = set(INFINITY);
    for (unsigned rest = places_at(meeting, t, done); rest; rest &= rest - 1) {
        int place = __builtin_ctz(rest), end = place < 31 ? place + 1 : meeting->list.count;
        for (; place < end; place++) {
            COUNT(sdf_met, shape);
            int i = meeting->list.shape[place];
            real distance = distance_to_shape(&approach[i], t, &scene->placed[i], done);
            least = least_of(distance, least);
        }
    }
    return least;
}

#endif
