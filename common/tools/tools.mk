# Programs and libraries that belong to no phase.

# Steps a program (scripts/study/counting/ptrace.py).
$(BUILD)/common/stepper: common/counting/stepper.c common/tools/tools.mk common/rules.mk $(BUILD)/common/toolchain
	$(CC) -std=c11 -D_GNU_SOURCE -O2 $(WARNINGS) $< -o $@

# Launches any program and measures it (scripts/study/measuring/launcher.py).
$(BUILD)/launch: common/tools/launch.c common/tools/tools.mk common/rules.mk $(BUILD)/common/toolchain
	$(CC) -std=c11 -D_GNU_SOURCE -O2 $(WARNINGS) $(SANITIZERS) $< -o $@

# A program whose counts are known (tests/calibration), plain and with counted blocks.
CALIBRATION_CFLAGS := -std=c11 -D_GNU_SOURCE -O2 $(WARNINGS) -Icommon
$(BUILD)/calibration/calibrate: tests/calibration/calibrate.c common/rules.mk $(BUILD)/common/toolchain
	@mkdir -p $(@D)
	$(CC) $(CALIBRATION_CFLAGS) $< -lpthread -o $@

$(BUILD)/calibration/blocks/phase.o: tests/calibration/calibrate.c $(COMMON_HEADERS) common/rules.mk $(INSTRUMENT_TOOLS) $(BUILD)/common/toolchain
	@rm -rf $(@D) && mkdir -p $(@D)/assembly
	$(CC) $(CALIBRATION_CFLAGS) $(LIBRARY_INCLUDES) -DSTEPWISE_COUNT -S $< -o $(@D)/assembly/calibrate.s
	$(instrument)
	@ld -r -o $@ $(@D)/counted/*.o

$(BUILD)/calibration/calibrate-blocks: $(BUILD)/calibration/blocks/phase.o $(BUILD)/calibration/blocks/blocks.o $(BUILD)/common/counting/tally.o
	$(LINK) -Wl,--wrap=pthread_create -o $@
