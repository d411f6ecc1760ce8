# C tests: one program per tests/c/test_NAME.c, linked to all of common/. A first line `// flags: -mavx2` adds to
# the compiler's flags. By hand, sanitised:
#   make SANITIZE=1 BUILD=build/asan c-tests && build/asan/tests/test_scene
C_TESTS := $(patsubst tests/c/%.c,$(BUILD)/tests/%,$(wildcard tests/c/test_*.c))

.PHONY: c-tests
c-tests: $(C_TESTS)

# What these include of a phase.
$(BUILD)/tests/test_bvh: phases/opt9_convex/bvh/bvh.c
$(BUILD)/tests/test_active_set: phases/opt9_convex/shadow/active_set.c

$(BUILD)/tests/%: tests/c/%.c $(SCENE_OBJECTS) $(wildcard tests/c/*.h common/*.h common/*/*.[ch] phases/*/*.h) tests/c/tests.mk
	@mkdir -p $(@D)
	$(CC) $(COMMON_CFLAGS) $$(sed -n '1s|^// flags: ||p' $<) \
	    $< $(SCENE_OBJECTS) $(LIBS) -lcmocka -o $@
