# Fuzzing by libFuzzer (clang), with ASan and UBSan: make fuzz MINUTES=10 runs each harness of this folder in turn, on
# every core; FUZZ=scene runs one. What a harness finds is in build/fuzz/NAME.found, and the run fails.
# tests/common/test_fuzz.py runs each for some seconds.
FUZZERS := $(patsubst tests/fuzz/%.c,%,$(wildcard tests/fuzz/*.c))
FUZZ ?= $(FUZZERS)
FUZZ_CC ?= clang
MINUTES ?= 1
FUZZ_FLAGS := -std=c11 -D_GNU_SOURCE -O1 -g $(WARNINGS) -fsanitize=fuzzer,address,undefined,float-cast-overflow -fno-sanitize-recover=all
FUZZ_OPTIONS = -jobs=$$(nproc) -workers=$$(nproc) -max_total_time=$$((60 * $(MINUTES))) -timeout=10 -rss_limit_mb=2048 -max_len=1200 -print_final_stats=1
# Small quarantines, still larger than what one input allocates, stay in the processor's caches; no allocation stacks.
FUZZ_ASAN := malloc_context_size=0:quarantine_size_mb=1:thread_local_quarantine_size_kb=64
FUZZ_SUM := /_executed_units/ { runs += $$2 } /exec_per_sec/ { rate += $$2 } match($$0, /cov: [0-9]+/) { now = substr($$0, RSTART + 5, RLENGTH - 5) + 0; if (now > edges) edges = now } \
    END { print runs " executions, " rate " a second, " edges " edges, no finding" }

.PHONY: fuzzers
fuzzers: $(FUZZERS:%=$(BUILD)/fuzz/%)

$(BUILD)/fuzz/scene: FUZZ_FLAGS += -Wl,--wrap=fopen
$(BUILD)/fuzz/scene $(BUILD)/fuzz/path: FUZZED := $(wildcard common/scene/*.c)
$(BUILD)/fuzz/cache: FUZZED := phases/opt10_scene/kernel/cache.c
$(BUILD)/fuzz/%: tests/fuzz/%.c tests/fuzz/fuzz.mk $(wildcard common/scene/*.[ch] phases/opt10_scene/kernel/*.[ch])
	@command -v $(FUZZ_CC) >/dev/null || { echo "fuzzing needs clang: apt install clang" >&2; exit 1; }
	@mkdir -p $(@D)
	$(FUZZ_CC) $(FUZZ_FLAGS) -Icommon -iquote $(call tree_of,opt10_scene) $(LIBRARY_INCLUDES) $< $(FUZZED) $(LIBS) -o $@

fuzz: setup-test fuzzers ## fuzz the scene loader, paths and the kernel cache, MINUTES=1 each; FUZZ=scene: one of them
	@$(PYTHON3) tests/fuzz/seeds.py $(BUILD)/fuzz/seeds
	@here=$$PWD; export ASAN_OPTIONS=$(FUZZ_ASAN); for name in $(FUZZ); do \
	    mkdir -p $(BUILD)/fuzz/$$name.run/corpus $(BUILD)/fuzz/$$name.run/smallest $(BUILD)/fuzz/$$name.found; more=; dictionary=; \
	    if [ $$name = scene ]; then more=../seeds; dictionary="-dict=$$here/tests/fuzz/scene.dict"; fi; \
	    echo "fuzzing $$name for $(MINUTES) min"; cd $(BUILD)/fuzz/$$name.run; rm -f fuzz-*.log; \
	    { ../$$name -merge=1 -max_len=1200 smallest corpus $$more && rm -r corpus && mv smallest corpus && \
	      ../$$name $(FUZZ_OPTIONS) -artifact_prefix=../$$name.found/ $$dictionary corpus; } >log 2>&1 \
	        || { tail -n 40 log; exit 1; }; \
	    awk '$(FUZZ_SUM)' fuzz-*.log; cd "$$here"; \
	done
