// The frame: memory, and OpenEXR files (by OpenEXR's C library).
#include "frame/frame.h"

#include <errno.h>
#include <math.h>
#include <openexr.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "frame/output.h"

enum { LARGE_PAGE = 1 << 21 };

#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/asan_interface.h>
#include <unistd.h>
// 4 GB before and behind a plane trap, where a wild index leads. A plane's last line of cache ends
// there, since stores of masked lanes are not checked; other stores may touch no byte beside it.
static void *allocate_aligned(size_t size) {
    size_t page = (size_t)sysconf(_SC_PAGESIZE), room = (size + page - 1) / page * page;
    size_t guard = (size_t)1 << 32;
    char *memory = mmap(NULL, 2 * guard + room, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED || mprotect(memory += guard, room, PROT_READ | PROT_WRITE) != 0)
        return NULL;
    char *plane = memory + room - (size + 63) / 64 * 64;
    __asan_poison_memory_region(memory, room);
    __asan_unpoison_memory_region(plane, size);
    return plane;
}
#else
// Aligned to a cache line, which is also the widest vector. Large blocks are aligned to huge pages,
// which cost fewer TLB misses.
static void *allocate_aligned(size_t size) {
    size_t unit = size < LARGE_PAGE ? 64 : LARGE_PAGE;
    size = (size + unit - 1) / unit * unit;
    void *memory = aligned_alloc(unit, size);
    if (memory && unit == LARGE_PAGE)
        (void)madvise(memory, size, MADV_HUGEPAGE); // without huge pages it has no effect
    return memory;
}
#endif

// Allocates a plane of NaN if it is wanted; clears `ok` if memory is short.
static float *plane(size_t samples, bool wanted, bool *ok) {
    if (!wanted)
        return NULL;
    float *memory = allocate_aligned(samples * sizeof(float));
    if (!memory) {
        *ok = false;
        return NULL;
    }
    for (size_t i = 0; i < samples; i++)
        memory[i] = NAN;
    return memory;
}

bool frame_create(struct frame *frame, int width, int height, bool aov, const char *const *names) {
    size_t pixels = (size_t)width * (size_t)height;
    bool ok = true;
    *frame = (struct frame){.width = width, .height = height};
    frame->rgb = plane(3 * pixels, true, &ok);
    frame->depth = plane(pixels, aov, &ok);
    frame->id = plane(pixels, aov, &ok);
    frame->normal = plane(3 * pixels, aov, &ok);
    frame->evals = plane(pixels, aov, &ok);
    frame->plane_names = names;
    for (int i = 0; aov && names && names[i] && i < FRAME_MAX_PLANES; i++)
        frame->planes[frame->plane_count++] = plane(pixels, true, &ok);
    if (!ok)
        frame_free(frame);
    return ok;
}

bool frame_create_display(struct frame *frame, int width, int height,
                          const struct presenter *presenter) {
    size_t samples = 3 * (size_t)width * (size_t)height;
    *frame = (struct frame){.width = width, .height = height};
    frame->presenter = presenter;
    frame->show = presenter_show;
    frame->shown = allocate_aligned(samples);
    for (size_t i = 0; frame->shown && i < samples; i++)
        frame->shown[i] = i % 2 ? 255 : 0; // colours of no scene, so that forgotten pixels show
    return frame->shown;
}

void frame_free(struct frame *frame) {
#ifndef __SANITIZE_ADDRESS__ // whose pages stay: nothing else comes to stand there
    free(frame->shown);
    free(frame->rgb);
    free(frame->depth);
    free(frame->id);
    free(frame->normal);
    free(frame->evals);
    for (int i = 0; i < frame->plane_count; i++)
        free(frame->planes[i]);
#endif
    *frame = (struct frame){0};
}

// Returns the mean of k × k clamped samples, NaN if one of them is not finite.
static float block_mean(const float *first, size_t row, int k) {
    double sum = 0;
    for (int y = 0; y < k; y++)
        for (int x = 0; x < k; x++) {
            double c = first[(size_t)y * row + 3 * (size_t)x];
            sum += isfinite(c) ? fmax(0, fmin(1, c)) : (double)NAN;
        }
    return (float)(sum / (k * k));
}

void frame_average(const struct frame *large, int k, struct frame *frame) {
    size_t row = 3 * (size_t)large->width;
    for (int y = 0; y < frame->height; y++)
        for (int x = 0; x < frame->width; x++)
            for (size_t c = 0; c < 3; c++)
                frame->rgb[3 * ((size_t)y * (size_t)frame->width + (size_t)x) + c] = block_mean(
                    large->rgb + (size_t)(y * k) * row + 3 * (size_t)(x * k) + c, row, k);
}

struct channel {
    const char *name; // EXR stores channels sorted by name
    const float *samples;
    int stride; // in floats
};

static void ignore_message(exr_const_context_t context, exr_result_t code, const char *message) {
    (void)context;
    (void)code;
    (void)message; // the caller reports the returned code in one line of its own
}

struct compressor {
    exr_result_t (*compress)(exr_encode_pipeline_t *encoder);
};

// Works around a fault of OpenEXR 3.1: a chunk whose compressed bytes have exactly the uncompressed size must
// be stored uncompressed, or no reader can read it. It happens with small pictures.
static exr_result_t compress_or_store(exr_encode_pipeline_t *encoder) {
    const struct compressor *original = encoder->encoding_user_data;
    exr_result_t result = original->compress(encoder);
    if (result == EXR_ERR_SUCCESS && encoder->compressed_bytes == encoder->packed_bytes)
        memcpy(encoder->compressed_buffer, encoder->packed_buffer, encoder->packed_bytes);
    return result;
}

// Compresses and writes the scan lines from row `y` on. `first`: sets the encoder up.
static exr_result_t write_chunk(exr_context_t context, int part, const struct frame *frame, int y,
                                const struct channel *channels, exr_encode_pipeline_t *encoder,
                                struct compressor *compressor, bool first) {
    exr_chunk_info_t chunk;
    exr_result_t result = exr_write_scanline_chunk_info(context, part, y, &chunk);
    if (result == EXR_ERR_SUCCESS)
        result = first ? exr_encoding_initialize(context, part, &chunk, encoder)
                       : exr_encoding_update(context, part, &chunk, encoder);
    if (result != EXR_ERR_SUCCESS)
        return result;
    for (int c = 0; c < encoder->channel_count; c++) {
        exr_coding_channel_info_t *info = &encoder->channels[c];
        for (const struct channel *from = channels; from->name; from++) {
            if (strcmp(from->name, info->channel_name) != 0)
                continue;
            const float *row =
                from->samples + (size_t)y * (size_t)frame->width * (size_t)from->stride;
            info->encode_from_ptr = (const uint8_t *)row;
            info->user_data_type = EXR_PIXEL_FLOAT;
            info->user_bytes_per_element = sizeof(float);
            info->user_pixel_stride = from->stride * (int)sizeof(float);
            info->user_line_stride = frame->width * from->stride * (int)sizeof(float);
        }
    }
    if (first) {
        result = exr_encoding_choose_default_routines(context, part, encoder);
        if (result == EXR_ERR_SUCCESS && encoder->compress_fn) {
            *compressor = (struct compressor){encoder->compress_fn};
            encoder->encoding_user_data = compressor;
            encoder->compress_fn = compress_or_store;
        }
    }
    return result == EXR_ERR_SUCCESS ? exr_encoding_run(context, part, encoder) : result;
}

static exr_result_t write_image(exr_context_t context, const struct frame *frame,
                                const struct channel *channels) {
    int part;
    exr_result_t result = exr_add_part(context, "stepwise", EXR_STORAGE_SCANLINE, &part);
    if (result == EXR_ERR_SUCCESS)
        result = exr_initialize_required_attr_simple(context, part, frame->width, frame->height,
                                                     EXR_COMPRESSION_ZIP);
    for (const struct channel *c = channels; c->name && result == EXR_ERR_SUCCESS; c++)
        result =
            exr_add_channel(context, part, c->name, EXR_PIXEL_FLOAT, EXR_PERCEPTUALLY_LINEAR, 1, 1);
    if (result == EXR_ERR_SUCCESS)
        result = exr_write_header(context);
    int32_t lines = 0;
    if (result == EXR_ERR_SUCCESS)
        result = exr_get_scanlines_per_chunk(context, part, &lines);
    exr_encode_pipeline_t encoder = EXR_ENCODE_PIPELINE_INITIALIZER;
    struct compressor compressor;
    bool started = false;
    for (int y = 0; y < frame->height && result == EXR_ERR_SUCCESS; y += lines) {
        result = write_chunk(context, part, frame, y, channels, &encoder, &compressor, !started);
        started = true;
    }
    if (started)
        exr_encoding_destroy(context, &encoder);
    return result;
}

bool frame_write_exr(const struct frame *frame, const char *path, char *error) {
    const float *normal = frame->normal ? frame->normal : frame->rgb; // avoids arithmetic on NULL
    struct channel channels[10 + FRAME_MAX_PLANES] = {
        {"B", frame->rgb + 2, 3}, {"G", frame->rgb + 1, 3},   {"N.x", normal, 3},
        {"N.y", normal + 1, 3},   {"N.z", normal + 2, 3},     {"R", frame->rgb, 3},
        {"Z", frame->depth, 1},   {"evals", frame->evals, 1}, {"id", frame->id, 1},
        {NULL, NULL, 0}};
    for (int i = 0; i < frame->plane_count; i++)
        channels[9 + i] = (struct channel){frame->plane_names[i], frame->planes[i], 1};
    if (!frame->depth)
        memcpy(channels, (struct channel[]){channels[0], channels[1], channels[5], {0}},
               4 * sizeof *channels);
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    setup.error_handler_fn = ignore_message;
    struct output output;
    if (!output_begin(&output, path, error))
        return false;
    exr_context_t context = NULL;
    errno = 0;
    exr_result_t result =
        exr_start_write(&context, output.temporary, EXR_WRITE_FILE_DIRECTLY, &setup);
    if (result == EXR_ERR_SUCCESS)
        result = write_image(context, frame, channels);
    int reason = errno;
    exr_result_t finished = context ? exr_finish(&context) : EXR_ERR_SUCCESS;
    if (result == EXR_ERR_SUCCESS)
        result = finished;
    return output_end(&output, result == EXR_ERR_SUCCESS,
                      reason ? strerror(reason) : exr_get_default_error_message(result), error);
}
