# report/out/try.html: phases as WebAssembly modules in one page (make web, which runs make -f web/web.mk).
#
# Needs Debian's packages emscripten (3.1.6 or later), node-acorn and libsimde-dev. jansson is compiled from its Debian
# source, which apt-get fetches into build/web without root; JANSSON=FOLDER names its folder src if you have it.
CC := emcc
BUILD := build/web
WEB_PHASES ?= baseline opt1 opt2 opt6_wide opt7_tiles opt8_streams opt9_convex opt11_ideal
PAGE ?= report/out/try.html
.DEFAULT_GOAL := $(PAGE)
WEB_LACKS := $(if $(shell command -v emcc),,emscripten) $(if $(wildcard /usr/share/nodejs/acorn /usr/lib/nodejs/acorn),,node-acorn) \
    $(if $(wildcard /usr/include/simde/x86/avx2.h),,libsimde-dev)
ifneq ($(strip $(WEB_LACKS)),)
$(error make web needs what is not here: sudo apt-get install $(strip $(WEB_LACKS)))
endif
include common/rules.mk

ifneq ($(shell command -v ccache),)
export EM_COMPILER_WRAPPER := ccache
endif
# no-stack-coloring: LLVM 14 moves a load that is splatted behind a store to the same place of the stack (see immintrin.h).
# fopen: the scene is in memory. Threads are not used, so that the one function of theirs that musl lacks does nothing.
WEB_FLAGS := -std=c11 -D_GNU_SOURCE -O3 -ffp-contract=off -msimd128 -Icommon -Iweb/include -I$(BUILD)/include -I$(BUILD)/jansson \
    -mllvm -no-stack-coloring -DLANES=8 '-DVARIANT(a)=lanes8_\#\#a' -Dfopen=web_open '-Dpthread_attr_setaffinity_np(a,b,c)=0' -Werror
WEB_COMMON := $(wildcard common/scene/*.c common/workers/*.c) common/frame/present.c common/viewer/camera.c common/viewer/window/pace.c
WEB_LINK := -s STANDALONE_WASM --no-entry -s ALLOW_MEMORY_GROWTH -s INITIAL_MEMORY=16MB -s TOTAL_STACK=4MB \
    -s ERROR_ON_UNDEFINED_SYMBOLS=0 -s WARN_ON_UNDEFINED_SYMBOLS=0# 16 lanes, pinning: never called
# The lists of sources of the archives that this machine's packages come from.
APT := apt-get -qq -o Dir::Etc::sourcelist=/dev/null -o Dir::Etc::sourceparts=$(CURDIR)/$(BUILD)/apt/from -o Dir::State::lists=$(CURDIR)/$(BUILD)/apt

$(BUILD)/jansson/jansson_config.h: web/web.mk
	@mkdir -p $(@D) $(BUILD)/apt/from $(BUILD)/apt/partial $(BUILD)/include
	@ln -sfn /usr/include/simde $(BUILD)/include/simde
	@for f in $(wildcard /etc/apt/sources.list.d/debian.sources /etc/apt/sources.list.d/ubuntu.sources /etc/apt/sources.list); do \
	    sed 's/^Types:.*/Types: deb-src/; s/^deb /deb-src /' $$f >$(BUILD)/apt/from/$${f##*/}; done
	@$(if $(JANSSON),cp $(JANSSON)/* $(@D)/,{ $(APT) update && cd $(BUILD)/apt && $(APT) source --download-only jansson && \
	    tar xf jansson_*.orig.tar.* --strip-components=2 -C ../jansson --wildcards '*/src/*'; } >$(BUILD)/apt/log 2>&1) || \
	    { echo 'make web: the source of jansson cannot be fetched (log: $(BUILD)/apt/log); JANSSON=FOLDER names its folder src' >&2; exit 1; }
	@: >$(@D)/jansson_private_config.h
	@sed 's/@json_inline@/inline/; s/@json_have_localeconv@/0/; s/@[a-z_]*@/1/' $@.in >$@

$(BUILD)/common.o: $(WEB_COMMON) $(COMMON_HEADERS) $(wildcard common/viewer/*.h common/viewer/window/*.h) $(BUILD)/jansson/jansson_config.h
	@echo "make web: what all phases share" && emcc $(WEB_FLAGS) -w -DHAVE_STDINT_H -r -o $@ $(WEB_COMMON) $(BUILD)/jansson/*.c

# A phase whole: all its sources but a compiler's of scenes.
$(BUILD)/%/module.wasm: web/module.c web/include/immintrin.h $(BUILD)/common.o $(phase_prerequisites)
	@echo "make web: $*" && emcc $(WEB_FLAGS) $(WEB_LINK) -iquote $(call tree_of,$*) -iquote $(@D) -o $@ web/module.c \
	    $(filter-out %/kernel/cache.c %/kernel/compile.c %/kernel/generate.c %/kernel/load.c,$(filter %.c,$(call sources_of,$*))) $(BUILD)/common.o

$(PAGE): web/build.py web/page.html web/page.css web/page.js web/worker.js $(WEB_PHASES:%=$(BUILD)/%/module.wasm) $(wildcard common/scenes/*.json common/scenes/*/*.json)
	@mkdir -p $(@D)
	@$(PYTHON_ALONE) web/build.py $(BUILD) $@ $(WEB_PHASES)
