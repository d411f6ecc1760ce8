# How a phase is built: the same recipe for all, flags from phases/NAME/phase.json.
#
#   build/NAME/render         the timing build           build/NAME@FROM/render   NAME's sources, FROM's flags
#   build/NAME/probe          distances at given points, for tests
#   build/NAME/render-count   calls times phases/NAME/costs.def, in the timed region (flops.h)
#   make CC=clang BUILD=build/clang SANITIZE=1 ...        other compilers, ASan and UBSan, in a folder of their own
CC ?= gcc
ifeq ($(origin CC),default)
CC := gcc
endif
BUILD ?= build
PYTHON3 ?= python3

WARNINGS := -Wall -Wextra -Wpedantic -Werror
, := ,
SANITIZERS := $(if $(SANITIZE),-fsanitize=address$(,)undefined -fno-sanitize-recover=all -fno-omit-frame-pointer -g)
COMMON_CFLAGS := -std=c11 -D_GNU_SOURCE -O2 $(WARNINGS) $(SANITIZERS) -Icommon
# Core alone would do, but its name differs between releases: the linker drops what is not needed.
LIBS = -Wl,--as-needed $(shell pkg-config --libs jansson OpenEXR) -lm
COMMON_INCLUDES = $(shell pkg-config --cflags jansson OpenEXR)
# In every object's prerequisites and in every record: another compiler or sanitizer builds anew.
TOOLCHAIN := $(shell $(CC) --version | head -n 1)
COMMON_OBJECTS := $(addprefix $(BUILD)/common/,scene.o frame.o timer.o)

PHASES := $(sort $(patsubst phases/%/phase.json,%,$(wildcard phases/*/phase.json)))
# opt2@opt4 names a variant: what is before the @ is built with the flags of what is behind it.
source_of = $(firstword $(subst @, ,$(1)))
flags_of = $(lastword $(subst @, ,$(1)))

.SECONDARY:
.SECONDEXPANSION:
.DELETE_ON_ERROR:

$(BUILD)/common/toolchain: FORCE
	@mkdir -p $(@D)
	@echo '$(TOOLCHAIN) $(SANITIZERS)' | cmp -s - $@ || echo '$(TOOLCHAIN) $(SANITIZERS)' >$@

$(BUILD)/common/%.o: common/%.c $(wildcard common/*.h) common/rules.mk $(BUILD)/common/toolchain
	$(CC) $(COMMON_CFLAGS) $(COMMON_INCLUDES) -c $< -o $@

# Re-made at every call, replaced only when phase.json says something new.
$(BUILD)/%/phase_info.h: FORCE
	@$(PYTHON3) common/phase_info.py $(call source_of,$*) $(call flags_of,$*) $(@D) '$(TOOLCHAIN)' '$(SANITIZERS)'
.PHONY: FORCE
FORCE:

$(BUILD)/%/driver.o: common/driver.c $(wildcard common/*.h) $(BUILD)/%/phase_info.h common/rules.mk
	$(CC) $(COMMON_CFLAGS) $(COMMON_INCLUDES) -I$(@D) -c $< -o $@

$(BUILD)/%/phase.o: $$(wildcard phases/$$(call source_of,$$*)/*.[ch]) $(wildcard common/*.h) $(BUILD)/%/phase_info.h common/rules.mk
	@rm -rf $(@D)/objects && mkdir -p $(@D)/objects
	@flags="$$(sed -n 's/^PHASE_CFLAGS := //p' $(@D)/flags.mk)"; \
	for source in $(filter %.c,$^); do \
	    set -- $(CC) -std=c11 -D_GNU_SOURCE $$flags $(WARNINGS) $(SANITIZERS) -Icommon -c $$source \
	        -o $(@D)/objects/$$(basename $$source .c).o; \
	    echo "$$@"; "$$@" || exit 1; \
	done
	@ld -r -o $@ $(@D)/objects/*.o

$(BUILD)/%/render: $(BUILD)/%/driver.o $(BUILD)/%/phase.o $(COMMON_OBJECTS)
	$(CC) $(SANITIZERS) $^ $(LIBS) -o $@

$(BUILD)/%/probe: $(BUILD)/common/probe.o $(BUILD)/%/phase.o $(COMMON_OBJECTS)
	$(CC) $(SANITIZERS) $^ $(LIBS) -o $@

# The counting build: the same sources with the macros of flops.h switched on.
$(BUILD)/%/count/driver.o: common/driver.c $(wildcard common/*.h) $(BUILD)/%/phase_info.h common/rules.mk
	@mkdir -p $(@D)
	$(CC) $(COMMON_CFLAGS) $(COMMON_INCLUDES) -DSTEPWISE_COUNT -I$(BUILD)/$* -c $< -o $@

$(BUILD)/%/count/flops.o: common/flops.c $$(wildcard phases/$$(call source_of,$$*)/costs.def) $(wildcard common/*.h) $(BUILD)/%/phase_info.h common/rules.mk
	@mkdir -p $(@D)
	@test -f phases/$(call source_of,$*)/costs.def || { echo "phases/$(call source_of,$*)/costs.def is missing: FLOPs per function, see common/flops.h" >&2; exit 1; }
	$(CC) $(COMMON_CFLAGS) $(COMMON_INCLUDES) -DSTEPWISE_COUNT -iquote phases/$(call source_of,$*) -I$(BUILD)/$* -c $< -o $@

$(BUILD)/%/count/phase.o: $(BUILD)/%/count/flops.o $$(wildcard phases/$$(call source_of,$$*)/*.[ch]) $(BUILD)/%/phase_info.h common/rules.mk
	@rm -rf $(@D)/objects && mkdir -p $(@D)/objects
	@flags="$$(sed -n 's/^PHASE_CFLAGS := //p' $(BUILD)/$*/flags.mk)"; \
	for source in $(filter %.c,$^); do \
	    set -- $(CC) -std=c11 -D_GNU_SOURCE $$flags $(WARNINGS) $(SANITIZERS) -Icommon -DSTEPWISE_COUNT \
	        -iquote phases/$(call source_of,$*) -c $$source -o $(@D)/objects/$$(basename $$source .c).o; \
	    echo "$$@"; "$$@" || exit 1; \
	done
	@ld -r -o $@ $(@D)/objects/*.o

$(BUILD)/%/render-count: $(BUILD)/%/count/driver.o $(BUILD)/%/count/phase.o $(BUILD)/%/count/flops.o $(BUILD)/common/tally.o $(COMMON_OBJECTS)
	$(CC) $(SANITIZERS) -Wl,--wrap=pthread_create $^ $(LIBS) -lpthread -o $@
