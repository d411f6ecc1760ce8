# How phases are built. All phases use the same rules; NAME's phase.json has the flags.
#
#   build/NAME/render         the timing build           build/NAME@FROM/render   NAME's sources, FROM's flags
#   build/NAME+PATCH/render   NAME with its ablations/PATCH.patch
#   build/NAME/source         the whole tree of a derived phase or of an ablation (make tree-NAME)
#   build/NAME/render-lines   the timing build with line tables;  render-calls: without inlining (for profiles)
#   build/NAME/render-count   counts calls and multiplies them by NAME's costs.def (counting/flops.h)
#   build/NAME/render-blocks  counts executions of each basic block (counting/blocks.c); render-blocks-calls: not inlined
#   build/NAME/probe          prints distances at given points, for tests (tools/probe.c)
#   build/NAME/read, count/read   compiles only for warnings: variants for other CPUs, the counting sources
#   build/NAME/syntax/read    parses every source and variant for warnings, and makes no code
#   build/truth/rays, build/packets/hits, build/ceilings, build/functions/bench   tools
#   make CC=clang BUILD=build/clang SANITIZE=1 ...   another compiler, with ASan and UBSan, in its own folder
#   make CC=aarch64-linux-gnu-gcc BUILD=build/arm64 ...  for aarch64, by a cross compiler (tests/arm64/libraries.sh)
#   make BUILD=build/tsan SANITIZE=thread ...        ThreadSanitizer
#   make BUILD=build/emulated EMULATE=1 ...          AVX-512 emulated by AVX2, for tests of pictures (tests/emulate)
#
# common/build/phase_info.py turns phase.json into flags.json and phase_info.h; common/build/compile.py compiles.
unexport CDPATH PYTHONPATH PYTHONHOME # of the user's shell: they lead cd and Python elsewhere
ifeq ($(origin CC),default)
CC := gcc
endif
CC := $(or $(strip $(CC)),gcc)
BUILD ?= build
PYTHON3 ?= $(firstword $(wildcard .venv/bin/python) python3)
PYTHON_ALONE := $(PYTHON3) -I -S# only the standard library, which starts faster

, := ,
WARNINGS := -Wall -Wextra -Wpedantic -Werror
# -g1: a sanitizer's report needs only line numbers.
SANITIZERS := $(if $(SANITIZE),-fsanitize=$(if $(filter thread,$(SANITIZE)),thread,address$(,)undefined$(,)float-cast-overflow -fno-sanitize-recover=all) -fno-omit-frame-pointer -g1)
# Follows a phase's own -O3. With -O1 less is optimized away before it is checked. -O0 compiles emulated code fastest.
SANITIZED := $(SANITIZERS)$(if $(SANITIZE), -O1)$(if $(EMULATE), -O0)
TOOLCHAIN := $(shell $(CC) --version 2>/dev/null | head -n 1)
CLANG := $(findstring clang,$(TOOLCHAIN))
MACHINE := $(shell $(CC) -dumpmachine 2>/dev/null)# e.g. x86_64-linux-gnu, aarch64-linux-gnu
CROSS := $(if $(filter $(shell uname -m 2>/dev/null)-%,$(MACHINE)),,$(MACHINE))
# What is written in intrinsics of x86 is built by way of SIMDe for other machines (package libsimde-dev).
INTRINSICS := $(if $(filter x86_64-%,$(MACHINE)),,common/simd/x86)
COMMON_CFLAGS = -std=c11 -D_GNU_SOURCE -O2 $(WARNINGS) $(SANITIZERS) -Icommon $(LIBRARY_INCLUDES)
LIBRARY_INCLUDES := $(shell pkg-config --cflags jansson OpenEXR 2>/dev/null) $(INTRINSICS:%=-I%)
LIBS := -Wl,--as-needed $(shell pkg-config --libs jansson OpenEXR 2>/dev/null) -lz -lpthread -lm
LINK = $(CC) $(SANITIZERS) $(filter %.o,$^) $(LIBS)
COMMON_HEADERS := $(filter-out common/viewer/%,$(wildcard common/*.h common/*/*.h)) # a change of the viewer's builds no phase again

EMULATION := $(if $(EMULATE),$(CURDIR)/tests/emulate)
SIMDE_INCLUDE ?= /usr/local/include /usr/include
# A checksum of the emulation's sources: another version compiles everything again.
EMULATED_BY := $(if $(EMULATE),$(shell { cat tests/emulate/immintrin.h; find -L $(firstword $(wildcard $(SIMDE_INCLUDE:%=%/simde)) /dev/null) -name '*.h' -printf '%P %T@ %s\n' | sort; } | cksum | tr ' ' -))
ifneq ($(EMULATE),)
ifeq ($(abspath $(BUILD)),$(CURDIR)/build)
$(error EMULATE=1 needs a folder of its own, e.g. BUILD=build/emulated)
endif
ifneq ($(filter %/render-count %/render-blocks %/render-blocks-calls %/render-lines %/render-calls,$(MAKECMDGOALS)),)
$(error emulated builds cannot count: their instructions are not the phase's)
endif
endif

# Where a phase's sources are: in its folder, or, for a derived phase and an ablation, in the tree that patches.py
# makes in build/NAME/source. The sources of NAME@FROM and NAME+PATCH are those of NAME.
FOLDERS := $(patsubst %/phase.json,%,$(wildcard phases/*/phase.json systems/*/phase.json truth/phase.json))
PHASES := $(sort $(notdir $(FOLDERS)))
DERIVES := $(shell grep -Ho '"derives": *"[A-Za-z0-9_]*"' $(FOLDERS:%=%/phase.json) | sed 's|\(.*/\)*\([^/]*\)/phase.json:[^:]*: *"\(.*\)"|\2:\3|')# child:parent
DERIVED := $(foreach d,$(DERIVES),$(firstword $(subst :, ,$d)))
folder_of = $(filter phases/$(1) systems/$(1) $(filter truth,$(1)),$(FOLDERS))
source_of = $(firstword $(subst @, ,$(1)))
flags_of = $(lastword $(subst @, ,$(1)))
has_made_tree = $(and $(or $(findstring +,$(1)),$(filter $(DERIVED),$(call source_of,$(1)))),$(if $(findstring /,$(1)),,yes))
tree_of = $(if $(call has_made_tree,$(1)),$(call make_tree,$(call source_of,$(1)),$(BUILD)/$(1)/source),$(call folder_of,$(call source_of,$(1))))
# Each run of make makes a tree once.
make_tree = $(or $(made-tree-$(2)),$(eval made-tree-$(2) := $(shell $(PYTHON_ALONE) scripts/study/core/patches.py $(1) $(2)))$(made-tree-$(2)),$(error $(1) cannot be made))
sources_of = $(foreach f,$(call tree_of,$(1)),$(wildcard $(f)/*.[ch] $(f)/*.def $(f)/*/*.[ch]))
phase_prerequisites = $$(call sources_of,$$*) $(COMMON_HEADERS) $(BUILD)/%/phase_info.h common/build/compile.py $(BUILD)/common/emulated_by

.SECONDARY:
.SECONDEXPANSION:
.DELETE_ON_ERROR:
.PHONY: FORCE
FORCE:

write_line = @mkdir -p $(@D); echo '$(LINE)' | cmp -s - $@ || echo '$(LINE)' >$@
# Files of one line. They are rewritten only if the line changes, and then everything that depends on them is rebuilt.
$(BUILD)/common/toolchain $(BUILD)/common/emulated_by $(BUILD)/common/with_embree: FORCE
	$(write_line)
$(BUILD)/common/toolchain: LINE = $(TOOLCHAIN) $(SANITIZERS)
$(BUILD)/common/emulated_by: LINE = $(EMULATED_BY)
$(BUILD)/common/with_embree: LINE = $(EMBREE)
# Embree's packages have no pkg-config file, so look in the compiler's folders. Embree 4 (Ubuntu 24.04, Debian 13) is
# preferred to Embree 3 (Debian 12).
EMBREE_INCLUDE ?= /usr/include /usr/local/include
EMBREE := $(if $(SANITIZE)$(CROSS),,$(firstword $(foreach v,4 3,$(wildcard $(EMBREE_INCLUDE:%=%/embree$(v)/rtcore.h)))))
EMBREE_VERSION := $(patsubst embree%,%,$(notdir $(patsubst %/,%,$(dir $(EMBREE)))))
$(BUILD)/common/tools/embree.o: COMMON_CFLAGS += $(if $(EMBREE),-DWITH_EMBREE=$(EMBREE_VERSION))
$(BUILD)/common/tools/embree.o: $(BUILD)/common/with_embree

$(BUILD)/common/%.o: common/%.c $(COMMON_HEADERS) common/rules.mk $(BUILD)/common/toolchain
	@mkdir -p $(@D)
	$(CC) $(COMMON_CFLAGS) -c $< -o $@

# Runs in every make; it writes only files whose text changes.
$(BUILD)/%/phase_info.h: FORCE
	@: $(call tree_of,$*)
	@$(PYTHON_ALONE) common/build/phase_info.py $(call source_of,$*) $(call flags_of,$*) $(@D) '$(TOOLCHAIN)' '$(SANITIZED)' '$(MACHINE)' '$(EMULATION)'

# --- The phase as one object. $(1): compile.py's command, $(2): more arguments.
only_supported = $(if $(or $(SANITIZERS),$(CLANG),$(findstring +,$*),$(filter-out $(BUILD)/$*,$(@D))),--here)
compile = @$(PYTHON_ALONE) common/build/compile.py $(1) $@ --build $(BUILD)/$* --tree $(call tree_of,$*) --include common $(INTRINSICS:%=--include %) \
    --cc '$(CC)' --toolchain '$(TOOLCHAIN) $(EMULATED_BY)' --flags '$(WARNINGS) $(SANITIZED)' --parsed $(BUILD)/common/parsed \
    $(only_supported) $(if $(findstring s,$(firstword -$(MAKEFLAGS))),--quiet) $(if $(SANITIZE),$(if $(EMULATE),,--sanitized)) $(2)
NOT_INLINED := -fno-inline -Dalways_inline=noinline -Wno-attributes $(if $(CLANG),,-Wno-maybe-uninitialized -fno-ipa-cp -fno-ipa-sra -fno-partial-inlining -fno-ipa-icf)

# A derived phase takes over what its parent's build made wherever nothing differs, and an ablation what its phase's
# made: so those are built first. A parent is not built for its child's sake alone: that compiles more.
ASKED := $(if $(filter phases %/viewer,$(MAKECMDGOALS)),$(PHASES:%=$(BUILD)/%/),$(filter-out %/read,$(MAKECMDGOALS:phase-%=$(BUILD)/%/)))
$(foreach d,$(DERIVES),$(foreach o,read syntax/read $(if $(findstring $(BUILD)/$(lastword $(subst :, ,$d))/,$(ASKED)),phase.o),\
    $(eval $(BUILD)/$(firstword $(subst :, ,$d))/$o: | $(BUILD)/$(lastword $(subst :, ,$d))/$o)))
$(foreach a,$(foreach f,$(FOLDERS),$(patsubst $f/ablations/%.patch,$(notdir $f)+%,$(wildcard $f/ablations/*.patch))),$(foreach o,phase.o count/phase.o,\
    $(eval $(BUILD)/$a/$o: | $(BUILD)/$(firstword $(subst +, ,$a))/$o)))
$(BUILD)/%/phase.o: $(phase_prerequisites)
	$(call compile,$(if $(SANITIZED),objects,assembly))
$(BUILD)/%/lines/phase.o: $(phase_prerequisites)
	$(call compile,objects,--more='-g')
$(BUILD)/%/calls/phase.o: $(phase_prerequisites)
	$(call compile,objects,--more='-g $(NOT_INLINED)')
# -O1 compiles a third faster, and counts are the same at every level (test_variants_built.py). local-exec: otherwise
# gcc 12 keeps an address of thread-local storage in a vector register, which ld cannot relax.
COUNTING := -DSTEPWISE_COUNT -ftls-model=local-exec
$(BUILD)/%/count/phase.o: $(BUILD)/%/count/flops.o $(phase_prerequisites)
	$(call compile,objects,--more='-O1 $(COUNTING)')
$(BUILD)/%/read: $(phase_prerequisites)
	$(call compile,read,--more='-O0 -S')
$(BUILD)/%/count/read: $(phase_prerequisites)
	$(call compile,read,$(if $(CLANG),--every) --more='-DSTEPWISE_COUNT $(if $(CLANG),-fsyntax-only,-O0 -S)')
$(BUILD)/%/syntax/read: $(phase_prerequisites)
	$(call compile,read,--every --more='-fsyntax-only')

# --- Programs. The objects that every render has besides its phase:
SCENE_OBJECTS := $(patsubst %.c,$(BUILD)/%.o,$(wildcard common/scene/*.c common/frame/*.c common/timing/*.c common/workers/*.c))
DRIVER_OBJECTS := $(patsubst %.c,$(BUILD)/%.o,$(filter-out common/driver/variant.c,$(wildcard common/driver/*.c)))
RENDER = $(BUILD)/%/variant.o $(DRIVER_OBJECTS) $(SCENE_OBJECTS)
COUNTER = $(BUILD)/%/variant.o $(BUILD)/common/counting/driver.o $(BUILD)/common/counting/tally.o \
    $(filter-out %/driver/driver.o,$(DRIVER_OBJECTS)) $(SCENE_OBJECTS)

# The only object of common/ that depends on the phase.
$(BUILD)/%/variant.o: common/driver/variant.c common/driver/variant.h $(BUILD)/%/phase_info.h common/rules.mk
	$(CC) $(COMMON_CFLAGS) -I$(@D) -c $< -o $@
$(BUILD)/common/counting/driver.o: common/driver/driver.c $(COMMON_HEADERS) common/rules.mk $(BUILD)/common/toolchain
	@mkdir -p $(@D)
	$(CC) $(COMMON_CFLAGS) -DSTEPWISE_COUNT -c $< -o $@
$(BUILD)/%/count/flops.o: common/counting/flops.c $(COMMON_HEADERS) $$(call sources_of,$$*) $(BUILD)/%/phase_info.h common/rules.mk
	@mkdir -p $(@D)
	@test -f $(call tree_of,$*)/costs.def || { echo "$(call tree_of,$*)/costs.def is missing: FLOPs per function, see common/counting/flops.h" >&2; exit 1; }
	$(CC) $(COMMON_CFLAGS) -DSTEPWISE_COUNT -iquote $(call tree_of,$*) -I$(BUILD)/$* -c $< -o $@

$(BUILD)/%/render: $(BUILD)/%/phase.o $(RENDER)
	$(LINK) -o $@
$(BUILD)/%/render-lines: $(BUILD)/%/lines/phase.o $(RENDER)
	$(LINK) -o $@
$(BUILD)/%/render-calls: $(BUILD)/%/calls/phase.o $(RENDER)
	$(LINK) -o $@
$(BUILD)/%/render-count: $(BUILD)/%/count/phase.o $(BUILD)/%/count/flops.o $(COUNTER)
	$(LINK) -Wl,--wrap=pthread_create -o $@
$(BUILD)/%/probe: $(BUILD)/common/tools/probe.o $(BUILD)/%/phase.o $(BUILD)/%/variant.o $(SCENE_OBJECTS)
	$(LINK) -o $@
$(BUILD)/common/tools/rays.o: common/tools/probe.c $(COMMON_HEADERS) common/rules.mk $(BUILD)/common/toolchain
	@mkdir -p $(@D)
	$(CC) $(COMMON_CFLAGS) -DRAYS -c $< -o $@
$(BUILD)/%/rays: $(BUILD)/common/tools/rays.o $(BUILD)/%/phase.o $(BUILD)/%/variant.o $(SCENE_OBJECTS)
	$(LINK) -o $@
$(BUILD)/%/hits: $(BUILD)/common/tools/hits.o $(BUILD)/common/tools/embree.o $(BUILD)/%/phase.o $(BUILD)/%/variant.o $(SCENE_OBJECTS)
	$(LINK) $(if $(EMBREE),-lembree$(EMBREE_VERSION)) -o $@

# --- Basic blocks: a counter in each block of the timing build's assembly, or of assembly without inlining.
INSTRUMENT = PYTHONPATH=scripts $(firstword $(wildcard .venv/bin/python) $(PYTHON3)) -m study.counting.assembly --cc '$(CC)'
INSTRUMENT_TOOLS := $(wildcard scripts/study/counting/assembly*.py) scripts/study/counting/decode.py
instrument = @$(INSTRUMENT) $(@D) $(@D)/assembly/*.s
$(BUILD)/%/blocks/phase.o: $(BUILD)/%/phase.o $(INSTRUMENT_TOOLS)
	$(call compile,copy)
	$(instrument)
	$(call compile,join,--objects=$(@D)/counted)
$(BUILD)/%/blocks-calls/phase.o: $(phase_prerequisites) $(INSTRUMENT_TOOLS)
	$(call compile,assembly,--more='-g0 $(NOT_INLINED)')
	$(instrument)
	$(call compile,join,--objects=$(@D)/counted)
$(BUILD)/%/blocks.o: common/counting/blocks.c $(COMMON_HEADERS) $(BUILD)/%/phase.o
	$(CC) $(COMMON_CFLAGS) -I$(@D) -c $< -o $@
$(BUILD)/%/render-blocks: $(BUILD)/%/blocks/phase.o $(BUILD)/%/blocks/blocks.o $(COUNTER)
	$(LINK) -Wl,--wrap=pthread_create -o $@
$(BUILD)/%/render-blocks-calls: $(BUILD)/%/blocks-calls/phase.o $(BUILD)/%/blocks-calls/blocks.o $(COUNTER)
	$(LINK) -Wl,--wrap=pthread_create -o $@

include common/tools/tools.mk common/ceilings/ceilings.mk common/functions/functions.mk common/viewer/viewer.mk
