# C tests: one program build/tests/test_NAME per tests/c/FOLDER/test_NAME.c, linked to the scene, frame, timing and
# workers of common/. A first line `// flags: -mavx2` adds to the compiler's flags, those of -m on x86-64 alone. By hand, sanitised:
#   make SANITIZE=1 BUILD=build/asan c-tests && build/asan/tests/test_scene_values
C_TEST_SOURCES := $(wildcard tests/c/*/test_*.c)
C_TESTS := $(patsubst %.c,$(BUILD)/tests/%,$(notdir $(C_TEST_SOURCES)))

# Follows a program's own flags: compiles in half the time of -O2. Without expensive optimizations gcc leaves out
# vzeroupper, and every call of libm costs ten times as much. Under sanitizers it takes too much for uninitialized.
C_TESTS_SANITIZED := $(if $(SANITIZE),-O1$(if $(CLANG),, -fexpensive-optimizations -Wno-maybe-uninitialized))

.PHONY: c-tests
c-tests: $(C_TESTS)

# What these include of a phase.
$(BUILD)/tests/test_bvh: phases/opt9_convex/core/bvh.c
$(BUILD)/tests/test_active_set: phases/opt9_convex/shadow/active_set.c
$(BUILD)/tests/test_span_outlines $(BUILD)/tests/test_span_light $(BUILD)/tests/test_span_floats: $(wildcard phases/opt12_fused/spans/*.c)
$(BUILD)/tests/test_interval $(BUILD)/tests/test_group_fields $(BUILD)/tests/test_ball: $(wildcard truth/*.[ch] truth/*/*.[ch])

$(C_TESTS): $(BUILD)/tests/%: $$(wildcard tests/c/*/$$*.c) $(SCENE_OBJECTS) \
    $(wildcard tests/c/*.h tests/c/*/*.h common/*.h common/*/*.[ch] common/*/*/*.[ch] phases/*/*.h phases/*/*/*.h) tests/c/tests.mk
	@mkdir -p $(@D)
	$(CC) $(COMMON_CFLAGS) -I. $$(sed -n '1s|^// flags: ||p' $<$(if $(INTRINSICS), | sed 's|-m[^ ]*||g')) $(C_TESTS_SANITIZED) \
	    $< $(SCENE_OBJECTS) $(LIBS) -lcmocka -o $@
