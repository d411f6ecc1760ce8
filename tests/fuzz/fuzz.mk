# Fuzzing by libFuzzer (clang), with ASan and UBSan: make fuzz MINUTES=10 runs each harness of this folder in turn, on
# every core; FUZZ=scene runs one. What a harness finds is in build/fuzz/NAME.found, and the run fails.
# tests/py/test_fuzz.py runs each for some seconds.
FUZZERS := $(patsubst tests/fuzz/%.c,%,$(wildcard tests/fuzz/*.c))
FUZZ ?= $(FUZZERS)
FUZZ_CC ?= clang
MINUTES ?= 1
FUZZ_FLAGS := -std=c11 -D_GNU_SOURCE -O1 -g $(WARNINGS) -fsanitize=fuzzer,address,undefined,float-cast-overflow -fno-sanitize-recover=all
FUZZ_OPTIONS = -fork=$$(nproc) -max_total_time=$$((60 * $(MINUTES))) -timeout=10 -rss_limit_mb=2048 -max_len=1200
# A small quarantine and no allocation stacks: four times as many runs in a second.
FUZZ_ASAN := malloc_context_size=0:quarantine_size_mb=1

.PHONY: fuzzers
fuzzers: $(FUZZERS:%=$(BUILD)/fuzz/%)

$(BUILD)/fuzz/scene $(BUILD)/fuzz/path: FUZZED := $(wildcard common/scene/*.c)
$(BUILD)/fuzz/cache: FUZZED := phases/opt10_scene/kernel/cache.c
$(BUILD)/fuzz/%: tests/fuzz/%.c tests/fuzz/fuzz.mk $(wildcard common/scene/*.[ch] phases/opt10_scene/kernel/*.[ch])
	@command -v $(FUZZ_CC) >/dev/null || { echo "fuzzing needs clang: apt install clang" >&2; exit 1; }
	@mkdir -p $(@D)
	$(FUZZ_CC) $(FUZZ_FLAGS) -Icommon -iquote $(call tree_of,opt10_scene) $(LIBRARY_INCLUDES) $< $(FUZZED) $(LIBS) -o $@

fuzz: setup-test fuzzers ## fuzz the scene loader, paths and the kernel cache, MINUTES=1 each; FUZZ=scene: one of them
	@$(PYTHON3) tests/fuzz/seeds.py $(BUILD)/fuzz/seeds
	@for name in $(FUZZ); do \
	    mkdir -p $(BUILD)/fuzz/$$name.corpus $(BUILD)/fuzz/$$name.found; more=; \
	    if [ $$name = scene ]; then more="-dict=tests/fuzz/scene.dict $(BUILD)/fuzz/seeds"; fi; \
	    echo "fuzzing $$name for $(MINUTES) min"; \
	    ASAN_OPTIONS=$(FUZZ_ASAN) $(BUILD)/fuzz/$$name $(FUZZ_OPTIONS) -artifact_prefix=$(BUILD)/fuzz/$$name.found/ \
	        $(BUILD)/fuzz/$$name.corpus $$more >$(BUILD)/fuzz/$$name.log 2>&1 \
	        || { tail -n 40 $(BUILD)/fuzz/$$name.log; exit 1; }; \
	    grep '^#[0-9]' $(BUILD)/fuzz/$$name.log | tail -n 1; \
	done
