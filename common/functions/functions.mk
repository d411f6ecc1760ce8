# build/functions/bench (scripts/functions.py): every file for the instruction set in its name, called only where
# the CPU has it. MPFR is the truth of the double entries where its header is; libmvec and SLEEF are found at run time.
FUNCTIONS := common/functions
FUNCTIONS_OBJECTS := $(patsubst $(FUNCTIONS)/%.c,$(BUILD)/functions/%.o,$(wildcard $(FUNCTIONS)/*.c))
FUNCTIONS_MPFR := $(if $(wildcard /usr/include/mpfr.h /usr/local/include/mpfr.h),-lmpfr -lgmp)
# No automatic vectors: scalar code stays scalar, and vectors are as wide as written. libm's sqrt is an instruction.
FUNCTIONS_KERNEL := -O3 -ffp-contract=off -fno-math-errno -fno-tree-vectorize -fno-tree-slp-vectorize
functions_flags = $(if $(findstring avx512,$(1)),-mavx512f -mavx512dq -mfma,$(if $(findstring avx2,$(1)),-mavx2 -mfma,$(if $(findstring sse,$(1)),-msse4.1)))

# MPFR installed later builds anew.
$(BUILD)/functions/mpfr: LINE = $(FUNCTIONS_MPFR)
$(BUILD)/functions/mpfr: FORCE
	$(write_line)

$(BUILD)/functions/%.o: $(FUNCTIONS)/%.c $(wildcard $(FUNCTIONS)/*.h) common/timing/timer.h $(FUNCTIONS)/functions.mk $(BUILD)/common/toolchain $(BUILD)/functions/mpfr
	@mkdir -p $(@D)
	$(CC) -std=c11 -D_GNU_SOURCE -Icommon $(WARNINGS) $(SANITIZERS) $(if $(FUNCTIONS_MPFR),-DWITH_MPFR) \
	    $(if $(filter wide_% scalar_%,$*),$(FUNCTIONS_KERNEL),-O3 -fno-trapping-math) $(call functions_flags,$*) -c $< -o $@

$(BUILD)/functions/bench: $(FUNCTIONS_OBJECTS) $(BUILD)/common/timing/timer.o
	$(CC) $(SANITIZERS) $^ $(FUNCTIONS_MPFR) -lm -ldl -lpthread -o $@
