// The driver's error messages, and the check that its output has arrived.
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "driver/driver.h"

int driver_complain(int status, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    fputs("render: ", stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    return status;
}

int driver_flush(void) {
    if (fflush(stdout) != 0 || ferror(stdout))
        return driver_complain(BAD_INPUT, "standard output cannot be written: %s", strerror(errno));
    return OK;
}
