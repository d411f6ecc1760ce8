# C tests: one program per tests/c/test_NAME.c, linked to all of common/. A first line `// flags: -mavx2` adds to
# the compiler's flags. By hand, sanitised:
#   make SANITIZE=1 BUILD=build/asan c-tests && build/asan/tests/test_scene
C_TESTS := $(patsubst tests/c/%.c,$(BUILD)/tests/%,$(wildcard tests/c/test_*.c))

.PHONY: c-tests
c-tests: $(C_TESTS)

# What these include of a phase.
$(BUILD)/tests/test_tree: phases/opt9_convex/tree.c
$(BUILD)/tests/test_vicinity: phases/opt9_convex/vicinity.c

$(BUILD)/tests/%: tests/c/%.c $(COMMON_OBJECTS) $(wildcard tests/c/*.h common/*.h common/ceilings/*.[ch] common/functions/*.[ch] common/simd/*.h phases/*/*.h) tests/c/tests.mk
	@mkdir -p $(@D)
	$(CC) $(COMMON_CFLAGS) $$(sed -n '1s|^// flags: ||p' $<) $(COMMON_INCLUDES) \
	    $< $(COMMON_OBJECTS) $(LIBS) -lcmocka -o $@
