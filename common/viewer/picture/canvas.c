// The canvas: scaled pictures, text, PNG files.
#include <errno.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scene/scene.h"
#include "viewer/picture/picture.h"

void canvas_scale(struct canvas *canvas, const uint8_t *rgb8, int width, int height, int from,
                  int to) {
    for (int y = 0; y < canvas->height; y++) {
        uint32_t *out = canvas->pixels + (size_t)y * (size_t)canvas->width;
        if (from >= to)
            return;
        if (y > 0 && (long)y * height / canvas->height == (long)(y - 1) * height / canvas->height) {
            memcpy(out + from, out + from - canvas->width, (size_t)(to - from) * sizeof *out);
            continue;
        }
        const uint8_t *row = rgb8 + 3 * (size_t)width * (size_t)((long)y * height / canvas->height);
        // Equals x * width / canvas->width, without a division for each pixel.
        long at = (long)from * width;
        long pixel = at / canvas->width, rest = at % canvas->width;
        for (int x = from; x < to; x++) {
            const uint8_t *in = row + 3 * pixel;
            out[x] = (uint32_t)in[0] << 16 | (uint32_t)in[1] << 8 | in[2];
            for (rest += width; rest >= canvas->width; rest -= canvas->width)
                pixel++;
        }
    }
}

static void dot(struct canvas *canvas, int x, int y, int size, uint32_t colour) {
    for (int j = y; j < y + size; j++)
        for (int i = x; i < x + size; i++)
            if (i >= 0 && j >= 0 && i < canvas->width && j < canvas->height)
                canvas->pixels[(size_t)j * (size_t)canvas->width + (size_t)i] = colour;
}

void canvas_text(struct canvas *canvas, int x, int y, int scale, uint32_t colour,
                 const char *text) {
    int left = x;
    for (; *text; text++, x += 6 * scale) {
        if (*text == '\n') {
            x = left - 6 * scale;
            y += FONT_LINE * scale;
            continue;
        }
        for (int column = 0; column < 5; column++)
            for (int row = 0; row < 8; row++)
                if (font_column(*text, column) >> row & 1)
                    dot(canvas, x + column * scale, y + row * scale, scale, colour);
    }
}

void canvas_shade(struct canvas *canvas, int x, int y, int width, int height) {
    for (int j = y < 0 ? 0 : y; j < y + height && j < canvas->height; j++)
        for (int i = x < 0 ? 0 : x; i < x + width && i < canvas->width; i++) {
            uint32_t *pixel = &canvas->pixels[(size_t)j * (size_t)canvas->width + (size_t)i];
            *pixel = *pixel >> 2 & 0x3f3f3f;
        }
}

bool canvas_write_png(const struct canvas *canvas, const char *path, char *error) {
    size_t pixels = (size_t)canvas->width * (size_t)canvas->height;
    uint8_t *bytes = malloc(3 * pixels);
    for (size_t i = 0; bytes && i < pixels; i++) {
        bytes[3 * i] = (uint8_t)(canvas->pixels[i] >> 16);
        bytes[3 * i + 1] = (uint8_t)(canvas->pixels[i] >> 8);
        bytes[3 * i + 2] = (uint8_t)canvas->pixels[i];
    }
    png_image image = {.version = PNG_IMAGE_VERSION,
                       .width = (png_uint_32)canvas->width,
                       .height = (png_uint_32)canvas->height,
                       .format = PNG_FORMAT_RGB,
                       .flags = PNG_IMAGE_FLAG_FAST};
    errno = 0;
    bool written = bytes && png_image_write_to_file(&image, path, 0, bytes, 0, NULL);
    if (!written)
        snprintf(error, SCENE_ERROR_SIZE, "%.300s: cannot be written: %s", path,
                 errno   ? strerror(errno)
                 : bytes ? image.message
                         : "out of memory");
    free(bytes);
    return written;
}
