#include <stdarg.h>
#include <stdio.h>

#include "viewer/viewer.h"

int viewer_error(int status, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    fputs("viewer: ", stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    return status;
}
