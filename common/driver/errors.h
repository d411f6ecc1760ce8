// Exit statuses of the driver and of the viewer, and their error messages.
#pragma once

enum status { OK = 0, BAD_INPUT = 2, NO_ISA = 3, UNSUPPORTED = 4, NO_MEMORY = 5 };

// Prints the program's name and the message as one line on standard error. Returns `status`, so that a
// caller can write `return driver_error(...)`.
int program_error(const char *program, int status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
#define driver_error(...) program_error("render", __VA_ARGS__)

// Flushes standard output. Returns OK, or BAD_INPUT after printing an error if any earlier output
// could not be written.
int driver_flush(void);
