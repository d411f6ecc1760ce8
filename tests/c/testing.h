// cmocka with what it needs. TEST(name) { … } defines and registers a test, RUN_TESTS(set_up, tear_down) is main.
#pragma once

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

// Rounds of a test that takes seconds: a tenth of them on aarch64, which is emulated (tests/arm64).
#ifdef __aarch64__
#define MANY(rounds) ((rounds) / 10)
#else
#define MANY(rounds) (rounds)
#endif

#define LENGTH(array) (sizeof(array) / sizeof *(array))

static struct CMUnitTest registered[16];
static size_t registered_count;

#define TEST(name)                                                                                 \
    static void name(void **state);                                                                \
    __attribute__((constructor)) static void register_##name(void) {                               \
        registered[registered_count++] = (struct CMUnitTest)cmocka_unit_test(name);                \
    }                                                                                              \
    static void name(__attribute__((unused)) void **state)

#define RUN_TESTS(set_up, tear_down)                                                               \
    int main(void) {                                                                               \
        return cmocka_run_group_tests(registered, set_up, tear_down);                              \
    }
