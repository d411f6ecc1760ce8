# build/viewer: the window on all phases (phases.h says how they are linked). Without SDL2 it is built without a
# window and still renders scripts to files. No other target needs it.
#   make build/viewer VIEWER_PHASES="opt3 opt9_convex"   with these phases only
# Left out unless named: truth, which takes minutes for a frame.
VIEWER_PHASES ?= $(filter-out truth,$(PHASES))
VIEWER_SDL = $(shell pkg-config --exists sdl2 2>/dev/null && echo sdl2)
VIEWER_WINDOW = $(if $(VIEWER_SDL),$(filter-out %/no_window.c,$(wildcard common/viewer/window/*.c)),common/viewer/window/no_window.c)
VIEWER_SOURCES = $(filter-out %/entry.c,$(wildcard common/viewer/*.c common/viewer/picture/*.c)) $(VIEWER_WINDOW)
VIEWER_OBJECTS = $(patsubst %.c,$(BUILD)/%.o,$(VIEWER_SOURCES))

$(BUILD)/common/viewer_parts: FORCE
	$(write_line)
$(BUILD)/common/viewer_parts: LINE = $(VIEWER_PHASES) $(VIEWER_SDL)

$(BUILD)/%/viewer.o: common/viewer/entry.c common/viewer/phases.h $(BUILD)/%/phase.o $(BUILD)/%/variant.o $(COMMON_HEADERS) common/viewer/viewer.mk
	@$(CC) $(COMMON_CFLAGS) -I$(@D) -c $< -o $(@D)/viewer_entry.o
	@ld -r -o $@.tmp $(@D)/viewer_entry.o $(@D)/phase.o $(@D)/variant.o
	@objcopy --keep-global-symbol=none_is_kept $@.tmp $@ && rm -f $@.tmp

.PHONY: need-libpng
need-libpng:
	@pkg-config --exists libpng || { echo 'viewer: libpng-dev is missing; make view installs it' >&2; exit 1; }
$(BUILD)/common/viewer/picture/canvas.o: | need-libpng
$(patsubst %.c,$(BUILD)/%.o,$(wildcard common/viewer/*.c common/viewer/*/*.c)): $(wildcard common/viewer/*.h common/viewer/*/*.h)

# Its sources include the headers of both libraries.
$(BUILD)/common/viewer/%.o: COMMON_CFLAGS += $(shell pkg-config --cflags libpng $(VIEWER_SDL) 2>/dev/null)
$(BUILD)/viewer: $(VIEWER_PHASES:%=$(BUILD)/%/viewer.o) $$(VIEWER_OBJECTS) $(BUILD)/common/driver/errors.o $(SCENE_OBJECTS) $(BUILD)/common/viewer_parts
	$(CC) $(SANITIZERS) $(filter %.o,$^) $(LIBS) $(shell pkg-config --libs libpng $(VIEWER_SDL)) -ldl -o $@
