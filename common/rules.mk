# How a phase is built: the same recipe for all, flags from phases/NAME/phase.json.
#
#   build/NAME/render         the timing build           build/NAME@FROM/render   NAME's sources, FROM's flags
#   build/NAME+PATCH/render   NAME with phases/NAME/ablations/PATCH.patch
#   build/NAME/render-lines   the same code with line tables, of the variants that this CPU runs; render-calls: without inlining, for profiles
#   build/NAME/render-count   calls times phases/NAME/costs.def, in the timed region (flops.h)
#   build/NAME/read           nothing: warnings of the variants that clang does not build here; count/read: the counting sources'
#   build/NAME/render-blocks  executions of every basic block; render-blocks-calls: without inlining (blocks.c)
#   build/NAME/probe          distances at given points, for tests
#   build/NAME/render-ftz     the same objects, started with denormals flushed to zero, for hard case 19
#   build/truth/rays          proved first hits of given rays, for tests
#   build/packets/hits        what given rays meet, timed, beside Embree where it is (hits.c)
#   build/ceilings            what one core can do at best (common/ceilings)
#   build/common/qemu_plugin.so  counts what runs under QEMU (qemu_plugin.c)
#   build/calibration/calibrate  known work, to check what counts; calibrate-blocks: with counted blocks
#   make CC=clang BUILD=build/clang SANITIZE=1 ...        other compilers, ASan and UBSan, in a folder of their own
#   make BUILD=build/tsan SANITIZE=thread ...             ThreadSanitizer, for the phases with threads
#   make BUILD=build/emulated EMULATE=1 ...               AVX-512 variants emulated by AVX2, for tests (tests/emulate)
CC ?= gcc
ifeq ($(origin CC),default)
CC := gcc
endif
BUILD ?= build
# Standard library alone, without what a site adds at each start: it runs hundreds of times.
PYTHON3 ?= $(firstword $(wildcard .venv/bin/python) python3)

WARNINGS := -Wall -Wextra -Wpedantic -Werror
, := ,
# -g1: lines are what a report needs; all of -g doubles the compilation of a sanitized phase.
SANITIZERS := $(if $(SANITIZE),-fsanitize=$(if $(filter thread,$(SANITIZE)),thread,address$(,)undefined -fno-sanitize-recover=all) -fno-omit-frame-pointer -g1)
# Of a phase, behind its own -O3: what is not optimized away is checked, and it compiles in half the time;
# what is emulated in a third of it without any optimization, and draws small pictures.
SANITIZED := $(SANITIZERS)$(if $(SANITIZE), -O1)$(if $(EMULATE), -O0)
COMMON_CFLAGS := -std=c11 -D_GNU_SOURCE -O2 $(WARNINGS) $(SANITIZERS) -Icommon
# Core alone would do, but its name differs between releases: the linker drops what is not needed.
LIBS = -Wl,--as-needed $(shell pkg-config --libs jansson OpenEXR) -lpthread -lm
COMMON_INCLUDES = $(shell pkg-config --cflags jansson OpenEXR)
# For pictures alone: what is emulated is neither counted nor timed, and stands in no folder that a script takes.
EMULATION := $(if $(EMULATE),$(CURDIR)/tests/emulate)
# By which headers: the shim and all of SIMDe's, where the compiler looks for them. Their ages say nothing to make: those
# of a package are of the day that it was built.
SIMDE_INCLUDE ?= /usr/local/include /usr/include
EMULATED_BY := $(if $(EMULATE),$(shell { cat tests/emulate/immintrin.h; find -L $(firstword $(wildcard $(SIMDE_INCLUDE:%=%/simde)) /dev/null) -name '*.h' -printf '%P %T@ %s\n' | sort; } | cksum | tr ' ' -))
ifneq ($(EMULATE),)
ifeq ($(abspath $(BUILD)),$(CURDIR)/build)
$(error EMULATE=1 needs a folder of its own, e.g. BUILD=build/emulated)
endif
ifneq ($(filter %/render-count %/render-blocks %/render-blocks-calls %/render-lines %/render-calls,$(MAKECMDGOALS)),)
$(error what is emulated is not counted: the instructions are not the phase's)
endif
endif
# In every object's prerequisites and in every record: another compiler or sanitizer builds anew.
TOOLCHAIN := $(shell $(CC) --version | head -n 1)
CLANG := $(findstring clang,$(TOOLCHAIN))
COMMON_OBJECTS := $(addprefix $(BUILD)/common/,scene.o scene_hash.o scene_path.o scene_reader.o scene_shapes.o frame.o present.o timer.o workers/workers.o)
# Of every render; driver.o alone is told what the phase is.
DRIVER_OBJECTS := $(addprefix $(BUILD)/common/,driver_conditions.o driver_options.o driver_phases.o driver_record.o)

PHASES := $(sort $(patsubst phases/%/phase.json,%,$(wildcard phases/*/phase.json)))
# opt2@opt4 names a variant: what is before the @ is built with the flags of what is behind it.
source_of = $(firstword $(subst @, ,$(1)))
flags_of = $(lastword $(subst @, ,$(1)))
# Where its sources are. opt1+arrays names an ablation, opt1 with phases/opt1/ablations/arrays.patch applied:
# its tree is made as soon as make asks for it. (A stem with a / is another rule's, which make tries too.)
DERIVED := $(patsubst phases/%/phase.json,%,$(shell grep -l '"derives"' phases/*/phase.json))
folder_of = $(if $(and $(or $(findstring +,$(1)),$(filter $(DERIVED),$(call source_of,$(1)))),$(if $(findstring /,$(1)),,here)),$(call patched,$(call source_of,$(1)),$(BUILD)/$(1)/source),phases/$(call source_of,$(1)))
# All of a phase's sources: its folder's and those of the folders in it; and the headers that phases share.
sources_of = $(foreach f,$(call folder_of,$(1)),$(wildcard $(f)/*.[ch] $(f)/*/*.[ch])) $(wildcard common/simd/*.h common/workers/*.h)
# Made once by each make: its rules ask for it a dozen times.
patched = $(or $(patched-$(2)),$(eval patched-$(2) := $(shell $(PYTHON3) -I -S scripts/study/patches.py $(1) $(2)))$(patched-$(2)),$(error $(1) cannot be made))

.SECONDARY:
.SECONDEXPANSION:
.DELETE_ON_ERROR:

$(BUILD)/common/toolchain: FORCE
	@mkdir -p $(@D)
	@echo '$(TOOLCHAIN) $(SANITIZERS)' | cmp -s - $@ || echo '$(TOOLCHAIN) $(SANITIZERS)' >$@

$(BUILD)/common/emulated_by: FORCE
	@mkdir -p $(@D)
	@echo '$(EMULATED_BY)' | cmp -s - $@ || echo '$(EMULATED_BY)' >$@

$(BUILD)/common/%.o: common/%.c $(wildcard common/*.h common/workers/*.h) common/rules.mk $(BUILD)/common/toolchain
	@mkdir -p $(@D)
	$(CC) $(COMMON_CFLAGS) $(COMMON_INCLUDES) -c $< -o $@

# Re-made at every call, replaced only when phase.json says something new.
$(BUILD)/%/phase_info.h: FORCE
	@: $(call folder_of,$*)
	@$(PYTHON3) -I -S common/phase_info.py $(call source_of,$*) $(call flags_of,$*) $(@D) '$(TOOLCHAIN)' '$(SANITIZED)' '$(EMULATION)'
.PHONY: FORCE
FORCE:

$(BUILD)/%/driver.o: common/driver.c $(wildcard common/*.h) $(BUILD)/%/phase_info.h common/rules.mk
	$(CC) $(COMMON_CFLAGS) $(COMMON_INCLUDES) -I$(@D) -c $< -o $@

# What flags.mk says (common/phase_info.py). $(1): its variable.
flags_mk = sed -n 's/^$(1) := //p' $(BUILD)/$*/flags.mk
# Which variants: what gcc times has all of them; what is sanitized, counted, profiled, by clang, patched or built otherwise
# has those that this CPU runs (no other is ever called): half of the compiler's work on a CPU without AVX-512. Sources that
# are only read: the others; of counting sources (count/read) clang reads all, and what gcc counts it has compiled.
variants_mk = $(call flags_mk,PHASE_VARIANTS$(if $(filter %/read,$@),$(if $(and $(CLANG),$(filter %/count/read,$@)),,_REST),$(if $(or $(SANITIZERS),$(CLANG),$(findstring +,$*),$(filter-out $(BUILD)/$*,$(@D))),_HERE)))
# Each of a phase's sources with its flags, those of "each_variant" once for each variant, as NAME-VARIANT.
# $(1): more flags, with -c or -S; $(2): folder/ and $(3): ending of what is made. Intrinsics are parsed once for all
# that is compiled alike (the objects are the same): .2 of the .5 s of each source, two thousand times in the tests.
# The header goes before each variant's sources, and before all of a phase without variants that includes it.
# Sanitized, variants have -Og, a third less to compile than -O1 and as fast; what is built once would run 1.3 to 2 times
# as long.
define compile_each
@flags="$$($(call flags_mk,PHASE_CFLAGS))"; variants="$$($(variants_mk))"; \
each=" $$($(call flags_mk,PHASE_EACH_VARIANT)) "; simd=; \
test -n "$${each#  }" || ! grep -qs '<immintrin.h>' $(filter $(call folder_of,$*)/%,$^) || simd=1; \
for source in $(filter %.c,$^); do \
    case "$$each" in *" $$(basename $$source) "*) versions="$$variants";; *) versions=$(if $(filter %/read,$@),$(if $(and $(CLANG),$(filter %/count/read,$@)),-),-);; esac; \
    for version in $$versions; do \
        made=$$(basename $$source .c); own=; with=$$simd; less=; parsed=; \
        test $$version = - || { made=$$made-$$version; own="$$(sed -n "s/^PHASE_$$version := //p" $(BUILD)/$*/flags.mk)"; \
            with=1; less=$(if $(SANITIZE),$(if $(EMULATE),,-Og)); }; \
        set -- $(CC) -std=c11 -D_GNU_SOURCE $$flags $$own $(WARNINGS) $(SANITIZED) $$less -Icommon -iquote $(call folder_of,$*); \
        test -z "$$with" || { $(parse_once); }; \
        set -- "$$@" -iquote $(BUILD)/$* $${parsed:+-include "$$parsed"} $(1) $$source -o $(2)$$made.$(3); \
        echo "$$@"; "$$@" || exit 1; \
    done; \
done
endef
# $parsed: a header with the intrinsics, parsed for the compiler's words $@ and those of $(1), but for the macros of
# phases and their folders. Made once for all phases; two jobs may make it at once, and the header stays as it is.
PARSED := $(BUILD)/common/parsed
# What it is parsed from, as an upgrade of either changes it: clang refuses a header that is older, gcc would go on.
HEADERS_ARE = $(shell stat -L -c '%Y %s' /usr/include/stdlib.h "$$($(CC) -print-file-name=include/immintrin.h)" 2>/dev/null)
parse_once = set -f; words="$$(echo "$$* $(filter-out -c -S -fsyntax-only,$(1))" | sed 's/-iquote [^ ]*//g; s/-D\(LANES=\|VARIANT\|STEPWISE_\)[^ ]*//g')"; \
parsed=$(PARSED)/$$(echo "$(HEADERS_ARE) $(TOOLCHAIN)$(EMULATED_BY:%= %) $$words" | cksum | tr ' ' -).h; \
test -e "$$parsed.gch" || { mkdir -p $(PARSED); echo '\#include <immintrin.h>' >"$$parsed.$$$$"; \
    ln "$$parsed.$$$$" "$$parsed" 2>/dev/null; rm "$$parsed.$$$$"; \
    $$words -x c-header "$$parsed" -o "$$parsed.$$$$" && mv "$$parsed.$$$$" "$$parsed.gch" || exit 1; }; set +f
# The objects of a folder $(1) as one. A variant's names are its own, but for its VARIANT_…: the sources need
# no other names for each. The names of a variant that is left out stand for an instruction that traps.
define join_objects
@made="$$($(variants_mk))"; for variant in $$made; do \
    ld -r -o $(1)/$$variant.o $(1)/*-$$variant.o && rm $(1)/*-$$variant.o && \
    objcopy -w --keep-global-symbol="$${variant}_*" $(1)/$$variant.o || exit 1; \
done; \
ld -r -o $@ $(1)/*.o || exit 1; \
for variant in $$($(call flags_mk,PHASE_VARIANTS)); do \
    case " $$made " in *" $$variant "*) continue;; esac; \
    { echo '.section .note.GNU-stack,"",@progbits'; echo .text; \
        nm -u $@ | sed -n "s/^ *U \($${variant}_.*\)/.globl \1\n\1: ud2/p"; } >$(@D)/without.s && \
    $(CC) -c $(@D)/without.s -o $(@D)/without.o && \
    ld -r -o $(@D)/joined.o $@ $(@D)/without.o && mv $(@D)/joined.o $@ || exit 1; \
done
endef
# A phase as one object. $(1): more compiler flags
define compile_recipe
@rm -rf $(@D)/objects $(@D)/assembly && mkdir -p $(@D)/objects
$(call compile_each,$(1) -c,$(@D)/objects/,o)
$(call join_objects,$(@D)/objects)
endef
# The same by way of the assembly, which gcc makes anyway: it stays, for blocks are counted in it.
define assemble_recipe
@rm -rf $(@D)/objects $(@D)/assembly && mkdir -p $(@D)/objects $(@D)/assembly
$(call compile_each,-S,$(@D)/assembly/,s)
@for made in $(@D)/assembly/*.s; do $(CC) -c "$$made" -o "$(@D)/objects/$$(basename "$$made" .s).o" || exit 1; done
$(call join_objects,$(@D)/objects)
endef

# Which of its variants this CPU runs (variant.h).
$(BUILD)/%/variant.o: common/variant.c common/variant.h $(BUILD)/%/phase_info.h common/rules.mk
	$(CC) $(COMMON_CFLAGS) -I$(@D) -c $< -o $@

$(BUILD)/%/phase.o: $$(call sources_of,$$*) $(wildcard common/*.h) $(BUILD)/%/phase_info.h common/rules.mk $(if $(EMULATE),$(BUILD)/common/emulated_by)
	$(if $(SANITIZED),$(call compile_recipe,),$(call assemble_recipe))

$(BUILD)/%/render: $(BUILD)/%/driver.o $(BUILD)/%/phase.o $(BUILD)/%/variant.o $(DRIVER_OBJECTS) $(COMMON_OBJECTS)
	$(CC) $(SANITIZERS) $^ $(LIBS) -o $@

# gcc's start-up code for -ffast-math has the CPU flush denormals to zero; the objects are the same (hard cases).
$(BUILD)/%/render-ftz: $(BUILD)/%/driver.o $(BUILD)/%/phase.o $(BUILD)/%/variant.o $(DRIVER_OBJECTS) $(COMMON_OBJECTS)
	$(CC) $(SANITIZERS) -ffast-math $^ $(LIBS) -o $@

$(BUILD)/%/probe: $(BUILD)/common/probe.o $(BUILD)/%/phase.o $(BUILD)/%/variant.o $(COMMON_OBJECTS)
	$(CC) $(SANITIZERS) $^ $(LIBS) -o $@

# First hits of given rays in proved enclosures, for tests: phases of family truth only (phase.h).
$(BUILD)/%/rays: $(BUILD)/common/rays.o $(BUILD)/%/phase.o $(BUILD)/%/variant.o $(COMMON_OBJECTS)
	$(CC) $(SANITIZERS) $^ $(LIBS) -o $@

# What given rays meet, and the time of it: phases of closed forms only (phase.h). Embree where its header is; installed
# later it builds anew. Debian's and Ubuntu's packages have no file for pkg-config, and CMake, which they have files for,
# is nothing else's need here: header and library are where the compiler looks for both. 4 (Ubuntu 24.04, Debian 13)
# goes before 3 (Debian 12).
EMBREE_INCLUDE ?= /usr/include /usr/local/include
EMBREE := $(if $(SANITIZE),,$(firstword $(foreach v,4 3,$(wildcard $(EMBREE_INCLUDE:%=%/embree$(v)/rtcore.h)))))
EMBREE_VERSION := $(patsubst embree%,%,$(notdir $(patsubst %/,%,$(dir $(EMBREE)))))
$(BUILD)/common/with_embree: FORCE
	@mkdir -p $(@D)
	@echo '$(EMBREE)' | cmp -s - $@ || echo '$(EMBREE)' >$@

$(BUILD)/common/embree.o: COMMON_CFLAGS += $(if $(EMBREE),-DWITH_EMBREE=$(EMBREE_VERSION))
$(BUILD)/common/embree.o: $(BUILD)/common/with_embree

$(BUILD)/%/hits.o: common/hits.c $(wildcard common/*.h) $(BUILD)/%/phase_info.h common/rules.mk
	$(CC) $(COMMON_CFLAGS) $(COMMON_INCLUDES) -I$(@D) -c $< -o $@

$(BUILD)/%/hits: $(BUILD)/%/hits.o $(BUILD)/common/embree.o $(BUILD)/%/phase.o $(BUILD)/%/variant.o $(COMMON_OBJECTS)
	$(CC) $(SANITIZERS) $^ $(LIBS) $(if $(EMBREE),-lembree$(EMBREE_VERSION)) -o $@

# The counting build: the same sources with the macros of flops.h switched on.
$(BUILD)/%/count/driver.o: common/driver.c $(wildcard common/*.h) $(BUILD)/%/phase_info.h common/rules.mk
	@mkdir -p $(@D)
	$(CC) $(COMMON_CFLAGS) $(COMMON_INCLUDES) -DSTEPWISE_COUNT -I$(BUILD)/$* -c $< -o $@

$(BUILD)/%/count/flops.o: common/flops.c $$(wildcard $$(call folder_of,$$*)/costs.def) $(wildcard common/*.h) $(BUILD)/%/phase_info.h common/rules.mk
	@mkdir -p $(@D)
	@test -f $(call folder_of,$*)/costs.def || { echo "$(call folder_of,$*)/costs.def is missing: FLOPs per function, see common/flops.h" >&2; exit 1; }
	$(CC) $(COMMON_CFLAGS) $(COMMON_INCLUDES) -DSTEPWISE_COUNT -iquote $(call folder_of,$*) -I$(BUILD)/$* -c $< -o $@

# -O1: counts are of what the source says, as no phase's flags change its arithmetic (-ffp-contract=off); a third less to compile (tests/py/test_variants_built.py has both).
# local-exec: gcc 12 keeps an address of thread-local storage in a vector register, which ld cannot relax.
$(BUILD)/%/count/phase.o: $(BUILD)/%/count/flops.o $$(call sources_of,$$*) $(BUILD)/%/phase_info.h common/rules.mk
	$(call compile_recipe,-O1 -DSTEPWISE_COUNT -ftls-model=local-exec -iquote $(call folder_of,$*))

# Sources read for the compiler's warnings alone. What clang would build of variants that this CPU does not run: all of
# its work but the optimizer's, which warns of nothing that is asked here (no pragmas), and no program lacks it. The
# counting sources: clang has all of its warnings (not the errors of making code) without compiling, gcc has not. What
# gcc's optimizer tells besides (no value yet, bounds, overflows) it tells of the timing build, and at -O1 of the counting.
$(BUILD)/%/read: $$(call sources_of,$$*) $(wildcard common/*.h) $(BUILD)/%/phase_info.h common/rules.mk
	@rm -f $(@D)/read-*
	$(call compile_each,-O0 -S,$(@D)/read-,s)
	@rm -f $(@D)/read-*
	@touch $@

$(BUILD)/%/count/read: $$(call sources_of,$$*) $$(wildcard $$(call folder_of,$$*)/costs.def) $(wildcard common/*.h) $(BUILD)/%/phase_info.h common/rules.mk
	@mkdir -p $(@D) && rm -f $(@D)/read-*
	$(call compile_each,-DSTEPWISE_COUNT -iquote $(call folder_of,$*) $(if $(CLANG),-fsyntax-only,-O0 -S),$(@D)/read-,s)
	@rm -f $(@D)/read-*
	@touch $@

$(BUILD)/%/render-count: $(BUILD)/%/count/driver.o $(BUILD)/%/count/phase.o $(BUILD)/%/variant.o $(BUILD)/%/count/flops.o $(BUILD)/common/tally.o $(DRIVER_OBJECTS) $(COMMON_OBJECTS)
	$(CC) $(SANITIZERS) -Wl,--wrap=pthread_create $^ $(LIBS) -lpthread -o $@

# The shipped code's functions, kept as functions, for profiles by name: the same sources, nothing inlined,
# cloned or merged. immintrin.h writes __always_inline__, so its intrinsics stay instructions.
CALLS_CFLAGS := -g -fno-inline -Dalways_inline=noinline -Wno-attributes \
    $(if $(findstring clang,$(TOOLCHAIN)),,-fno-ipa-cp -fno-ipa-sra -fno-partial-inlining -fno-ipa-icf)
$(BUILD)/%/calls/phase.o: $$(call sources_of,$$*) $(wildcard common/*.h) $(BUILD)/%/phase_info.h common/rules.mk
	$(call compile_recipe,$(CALLS_CFLAGS))

$(BUILD)/%/render-calls: $(BUILD)/%/driver.o $(BUILD)/%/calls/phase.o $(BUILD)/%/variant.o $(DRIVER_OBJECTS) $(COMMON_OBJECTS)
	$(CC) $(SANITIZERS) $^ $(LIBS) -o $@

# The shipped code with line tables: not an instruction differs (tests/py/test_hotspots.py), and inlined code
# can be told by the function it is from.
$(BUILD)/%/lines/phase.o: $$(call sources_of,$$*) $(wildcard common/*.h) $(BUILD)/%/phase_info.h common/rules.mk
	$(call compile_recipe,-g)

$(BUILD)/%/render-lines: $(BUILD)/%/driver.o $(BUILD)/%/lines/phase.o $(BUILD)/%/variant.o $(DRIVER_OBJECTS) $(COMMON_OBJECTS)
	$(CC) $(SANITIZERS) $^ $(LIBS) -o $@

# Counts what a program does under qemu-x86_64 (scripts/study/qemu.py). Loaded by QEMU: no sanitizers.
$(BUILD)/common/qemu_plugin.so: common/qemu_plugin.c common/rules.mk $(BUILD)/common/toolchain
	$(CC) -std=c11 -D_GNU_SOURCE -O2 $(WARNINGS) -fPIC -fvisibility=hidden -shared $< -o $@

# Tables of the CPU's approximate reciprocal roots (hard case 20).
$(BUILD)/rsqrt: $(BUILD)/common/rsqrt.o
	$(CC) $(SANITIZERS) $^ -lm -o $@

# Executions of every basic block (scripts/study/assembly.py, common/blocks.c): the shipped code, and the same
# source with its functions kept. The driver is the counting build's; table.json says what was counted.
BLOCKS_PYTHON = PYTHONPATH=scripts $(firstword $(wildcard .venv/bin/python) $(PYTHON3)) -m study.assembly
BLOCKS_TOOLS := $(wildcard scripts/study/assembly*.py) scripts/study/decode.py
# What stands in $(@D): assembly.
define blocks_recipe
@$(BLOCKS_PYTHON) --cc '$(CC)' $(@D) $(@D)/*.s
$(call join_objects,$(@D)/counted)
endef

# The assembly that the timing build was made from, of the variants that this CPU runs.
$(BUILD)/%/blocks/phase.o: $(BUILD)/%/phase.o $(BLOCKS_TOOLS)
	@rm -rf $(@D) && mkdir -p $(@D) && cp $(BUILD)/$*/assembly/*.s $(@D)
	@for variant in $$($(call flags_mk,PHASE_VARIANTS_REST)); do rm -f $(@D)/*-$$variant.s; done
	$(blocks_recipe)

$(BUILD)/%/blocks-calls/phase.o: $$(call sources_of,$$*) $(wildcard common/*.h) $(BUILD)/%/phase_info.h common/rules.mk $(BLOCKS_TOOLS)
	@rm -rf $(@D) && mkdir -p $(@D)
	$(call compile_each,$(CALLS_CFLAGS) -g0 -S,$(@D)/,s)
	$(blocks_recipe)

$(BUILD)/%/blocks.o: common/blocks.c common/count.h $(BUILD)/%/phase.o
	$(CC) $(COMMON_CFLAGS) $(COMMON_INCLUDES) -I$(@D) -c $< -o $@

BLOCKS_LINK = $(CC) $(SANITIZERS) -Wl,--wrap=pthread_create $^ $(LIBS) -lpthread -o $@
$(BUILD)/%/render-blocks: $(BUILD)/%/count/driver.o $(BUILD)/%/blocks/phase.o $(BUILD)/%/blocks/blocks.o $(BUILD)/%/variant.o $(BUILD)/common/tally.o $(DRIVER_OBJECTS) $(COMMON_OBJECTS)
	$(BLOCKS_LINK)

$(BUILD)/%/render-blocks-calls: $(BUILD)/%/count/driver.o $(BUILD)/%/blocks-calls/phase.o $(BUILD)/%/blocks-calls/blocks.o $(BUILD)/%/variant.o $(BUILD)/common/tally.o $(DRIVER_OBJECTS) $(COMMON_OBJECTS)
	$(BLOCKS_LINK)

# Known work (tests/calibration): plain, and with counted blocks.
CALIBRATION_CFLAGS := -std=c11 -D_GNU_SOURCE -O2 $(WARNINGS) -Icommon
$(BUILD)/calibration/calibrate: tests/calibration/calibrate.c common/rules.mk $(BUILD)/common/toolchain
	@mkdir -p $(@D)
	$(CC) $(CALIBRATION_CFLAGS) $< -lpthread -o $@

$(BUILD)/calibration/blocks/phase.o: tests/calibration/calibrate.c common/count.h common/rules.mk $(BLOCKS_TOOLS) $(BUILD)/common/toolchain
	@rm -rf $(@D) && mkdir -p $(@D)
	$(CC) $(CALIBRATION_CFLAGS) $(COMMON_INCLUDES) -DSTEPWISE_COUNT -S $< -o $(@D)/calibrate.s
	@$(BLOCKS_PYTHON) --cc '$(CC)' $(@D) $(@D)/calibrate.s
	@ld -r -o $@ $(@D)/counted/*.o

$(BUILD)/calibration/calibrate-blocks: $(BUILD)/calibration/blocks/phase.o $(BUILD)/calibration/blocks/blocks.o $(BUILD)/common/tally.o
	$(BLOCKS_LINK)

include common/ceilings/ceilings.mk
include common/functions/functions.mk
