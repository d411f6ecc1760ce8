// Exit statuses of the driver, and its error messages.
#pragma once

enum status { OK = 0, BAD_INPUT = 2, NO_ISA = 3, UNSUPPORTED = 4, NO_MEMORY = 5 };

// Prints "render: " and the message as one line on standard error. Returns `status`, so that a
// caller can write `return driver_error(...)`.
int driver_error(int status, const char *format, ...) __attribute__((format(printf, 2, 3)));

// Flushes standard output. Returns OK, or BAD_INPUT after printing an error if any earlier output
// could not be written.
int driver_flush(void);
