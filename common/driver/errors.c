// See errors.h.
#include "driver/errors.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

int program_error(const char *program, int status, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    fprintf(stderr, "%s: ", program);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    return status;
}

int driver_flush(void) {
    if (fflush(stdout) != 0 || ferror(stdout))
        return driver_error(BAD_INPUT, "standard output cannot be written: %s", strerror(errno));
    return OK;
}
