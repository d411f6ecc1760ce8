# build/ceilings: no phase, no library, the same code whatever the phases' flags are.
CEILINGS := common/ceilings
$(BUILD)/common/ceilings/%.o: $(CEILINGS)/%.c $(wildcard $(CEILINGS)/*.h) common/timing/timer.h $(CEILINGS)/ceilings.mk common/rules.mk $(BUILD)/common/toolchain
	@mkdir -p $(@D)
	$(CC) $(COMMON_CFLAGS) -c $< -o $@

$(BUILD)/ceilings: $(patsubst $(CEILINGS)/%.c,$(BUILD)/common/ceilings/%.o,$(wildcard $(CEILINGS)/*.c)) $(BUILD)/common/timing/timer.o
	$(CC) $(SANITIZERS) $^ -lm -o $@
