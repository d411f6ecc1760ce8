// See output.h. Then the 8-bit pictures: PNG (ISO/IEC 15948), compressed by zlib, and PPM.
#include "frame/output.h"

#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include "frame/frame.h"

static char unfinished[4096]; // the temporary name, for the signal handler
static const int SIGNALS[OUTPUT_SIGNALS] = {SIGINT, SIGTERM, SIGHUP};

static void remove_unfinished(int number) {
    unlink(unfinished);
    raise(number); // ends the program: SA_RESETHAND has restored the default
}

static bool unwritable(const char *path, const char *reason, char *error) {
    snprintf(error, OUTPUT_ERROR, "%.300s: cannot be written: %s", path, reason);
    return false;
}

bool output_begin(struct output *output, const char *path, char *error) {
    output->path = path;
    int length =
        snprintf(output->temporary, sizeof output->temporary, "%s.%ld.tmp", path, (long)getpid());
    if (!(length > 0 && length < (int)sizeof output->temporary)) {
        snprintf(error, OUTPUT_ERROR, "the output's path is longer than 4,000 characters");
        return false;
    }
    memcpy(unfinished, output->temporary, sizeof unfinished);
    struct sigaction action = {.sa_handler = remove_unfinished, .sa_flags = (int)SA_RESETHAND};
    sigemptyset(&action.sa_mask);
    for (int i = 0; i < OUTPUT_SIGNALS; i++)
        if (sigaction(SIGNALS[i], NULL, &output->before[i]) == 0 &&
            output->before[i].sa_handler == SIG_DFL)
            sigaction(SIGNALS[i], &action, NULL); // an ignored signal (nohup) stays ignored
    return true;
}

static void end_signals(const struct output *output) {
    for (int i = 0; i < OUTPUT_SIGNALS; i++)
        sigaction(SIGNALS[i], &output->before[i], NULL);
}

bool output_end(struct output *output, bool written, const char *reason, char *error) {
    bool done = written && rename(output->temporary, output->path) == 0;
    if (!done) {
        if (written)
            reason = strerror(errno);
        unwritable(output->path, reason, error);
        unlink(output->temporary);
    }
    end_signals(output);
    return done;
}

bool frame_writable(const char *path, char *error) {
    struct output output;
    if (!output_begin(&output, path, error))
        return false;
    FILE *probe = fopen(output.temporary, "wb");
    int reason = errno;
    if (probe) {
        fclose(probe);
        unlink(output.temporary);
    }
    end_signals(&output);
    if (!probe)
        return unwritable(path, strerror(reason), error);
    struct stat existing;
    if (stat(path, &existing) == 0 && !S_ISREG(existing.st_mode))
        return unwritable(path, "it exists and is no regular file", error);
    return true;
}

typedef bool write_pixels(FILE *file, int width, int height, const uint8_t *rgb8);

static bool write_8_bits(write_pixels *write, int width, int height, const uint8_t *rgb8,
                         const char *path, char *error) {
    struct output output;
    if (!output_begin(&output, path, error))
        return false;
    FILE *file = fopen(output.temporary, "wb");
    bool written = file && write(file, width, height, rgb8);
    int reason = errno;
    if (file && fclose(file) != 0 && written) {
        written = false;
        reason = errno;
    }
    return output_end(&output, written, strerror(reason), error);
}

static bool write_ppm(FILE *file, int width, int height, const uint8_t *rgb8) {
    size_t samples = 3 * (size_t)width * (size_t)height;
    return fprintf(file, "P6\n%d %d\n255\n", width, height) > 0 &&
           fwrite(rgb8, 1, samples, file) == samples;
}

static void big_endian(uint8_t to[4], uint32_t number) {
    for (int i = 0; i < 4; i++)
        to[i] = (uint8_t)(number >> (24 - 8 * i));
}

// Writes a chunk: its length, type and data, and the checksum of the latter two.
static bool write_chunk(FILE *file, const char *type, const uint8_t *data, uint32_t size) {
    uint8_t head[8], check[4];
    big_endian(head, size);
    memcpy(head + 4, type, 4);
    big_endian(check, (uint32_t)crc32(crc32(0, head + 4, 4), data, size));
    return fwrite(head, 1, 8, file) == 8 && fwrite(data, 1, size, file) == size &&
           fwrite(check, 1, 4, file) == 4;
}

// Compresses `size` bytes more, and writes what is ready as IDAT chunks.
static bool write_idat(FILE *file, z_stream *stream, uint8_t *bytes, size_t size, int flush) {
    uint8_t ready[1 << 14];
    stream->next_in = bytes;
    stream->avail_in = (uInt)size;
    do {
        stream->next_out = ready;
        stream->avail_out = sizeof ready;
        if (deflate(stream, flush) == Z_STREAM_ERROR)
            return false;
        uint32_t count = (uint32_t)(sizeof ready - stream->avail_out);
        if (count && !write_chunk(file, "IDAT", ready, count))
            return false;
    } while (stream->avail_out == 0);
    return true;
}

static bool write_png(FILE *file, int width, int height, const uint8_t *rgb8) {
    uint8_t about[13] = {[8] = 8, [9] = 2}; // 8 bits, RGB
    big_endian(about, (uint32_t)width);
    big_endian(about + 4, (uint32_t)height);
    size_t row = 3 * (size_t)width;
    uint8_t *line = malloc(row + 1);
    z_stream stream = {0};
    bool written = line && deflateInit(&stream, Z_DEFAULT_COMPRESSION) == Z_OK;
    if (!written)
        errno = ENOMEM;
    written = written && fwrite("\x89PNG\r\n\x1a\n", 1, 8, file) == 8 &&
              write_chunk(file, "IHDR", about, 13);
    for (int y = 0; y < height && written; y++) {
        const uint8_t *from = rgb8 + (size_t)y * row;
        line[0] = 1; // the filter Sub: differences to the pixel at the left
        for (size_t i = 0; i < row; i++)
            line[i + 1] = (uint8_t)(from[i] - (i < 3 ? 0 : from[i - 3]));
        written = write_idat(file, &stream, line, row + 1, Z_NO_FLUSH);
    }
    written = written && write_idat(file, &stream, NULL, 0, Z_FINISH) &&
              write_chunk(file, "IEND", about, 0);
    deflateEnd(&stream);
    free(line);
    return written;
}

bool frame_write_ppm(int width, int height, const uint8_t *rgb8, const char *path, char *error) {
    return write_8_bits(write_ppm, width, height, rgb8, path, error);
}

bool frame_write_png(int width, int height, const uint8_t *rgb8, const char *path, char *error) {
    return write_8_bits(write_png, width, height, rgb8, path, error);
}
