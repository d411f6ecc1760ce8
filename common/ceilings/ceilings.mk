# build/ceilings depends on no phase and no library. Its flags are the same for every phase's build.
CEILINGS := common/ceilings
$(BUILD)/common/ceilings/%.o: $(CEILINGS)/%.c $(wildcard $(CEILINGS)/*.h) common/timing/timer.h $(CEILINGS)/ceilings.mk common/rules.mk $(BUILD)/common/toolchain
	@mkdir -p $(@D)
	$(CC) $(COMMON_CFLAGS) -c $< -o $@

$(BUILD)/ceilings: $(patsubst $(CEILINGS)/%.c,$(BUILD)/common/ceilings/%.o,$(wildcard $(CEILINGS)/*.c)) $(BUILD)/common/timing/timer.o
	$(CC) $(SANITIZERS) $^ -lm -o $@
