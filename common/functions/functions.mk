# build/functions/bench (scripts/stepwise functions). scalar_kernels.c is compiled for float and for double,
# vector_kernels.c for both at each vector width. The bench calls an object's functions only if the
# CPU has its instruction set. libmvec and SLEEF are loaded at run time. MPFR, if its header is
# installed, gives the exact values of the double functions.
FUNCTIONS := common/functions
FUNCTIONS_MPFR := $(if $(CROSS),,$(if $(wildcard /usr/include/mpfr.h /usr/local/include/mpfr.h),-lmpfr -lgmp))
FUNCTIONS_NEEDED = $(wildcard $(FUNCTIONS)/*.h) common/timing/timer.h $(FUNCTIONS)/functions.mk $(BUILD)/common/toolchain $(BUILD)/functions/mpfr
FUNCTIONS_CC = $(CC) -std=c11 -D_GNU_SOURCE -Icommon $(WARNINGS) $(SANITIZERS) $(if $(FUNCTIONS_MPFR),-DWITH_MPFR)

# Instruction set and vector width of each group of kernels. On aarch64 `sse` is NEON, by SIMDe, and there are no wider ones.
FUNCTIONS_GROUPS := sse $(if $(INTRINSICS),,avx2 avx512)
FUNCTIONS_ISA_scalar := $(INTRINSICS:%=-I%)
FUNCTIONS_ISA_sse := -DBITS=128 $(if $(INTRINSICS),$(INTRINSICS:%=-I%),-msse4.1)
FUNCTIONS_ISA_avx2 := -DBITS=256 -mavx2 -mfma
FUNCTIONS_ISA_avx512 := -DBITS=512 -mavx512f -mavx512dq -mfma
FUNCTIONS_SCALAR := $(foreach type,float double,$(BUILD)/functions/scalar_$(type).o)
FUNCTIONS_VECTOR := $(foreach isa,$(FUNCTIONS_GROUPS),$(foreach type,float double,$(BUILD)/functions/$(isa)_$(type).o))
FUNCTIONS_PARTS := $(patsubst $(FUNCTIONS)/%.c,$(BUILD)/functions/%.o,$(filter-out %_kernels.c,$(wildcard $(FUNCTIONS)/*.c)))

# No automatic vectorization: scalar code stays scalar, vectors are as wide as written. Without errno
# the compiler turns libm's sqrt into an instruction.
FUNCTIONS_KERNEL_CFLAGS := -O3 -ffp-contract=off -fno-math-errno -fno-tree-vectorize -fno-tree-slp-vectorize
functions_isa = $(FUNCTIONS_ISA_$(firstword $(subst _, ,$(@F))))
compile_functions_kernel = $(FUNCTIONS_CC) $(FUNCTIONS_KERNEL_CFLAGS) $(functions_isa) -DDOUBLE=$(if $(findstring double,$(@F)),1,0) -c $< -o $@

# Everything is compiled again when MPFR is installed or removed.
$(BUILD)/functions/mpfr: LINE = $(FUNCTIONS_MPFR)
$(BUILD)/functions/mpfr: FORCE
	$(write_line)

$(FUNCTIONS_SCALAR): $(FUNCTIONS)/scalar_kernels.c $(FUNCTIONS_NEEDED)
	@mkdir -p $(@D)
	$(compile_functions_kernel)
$(FUNCTIONS_VECTOR): $(FUNCTIONS)/vector_kernels.c $(FUNCTIONS_NEEDED)
	@mkdir -p $(@D)
	$(compile_functions_kernel)
$(FUNCTIONS_PARTS): $(BUILD)/functions/%.o: $(FUNCTIONS)/%.c $(FUNCTIONS_NEEDED)
	@mkdir -p $(@D)
	$(FUNCTIONS_CC) -O3 -fno-trapping-math -c $< -o $@

$(BUILD)/functions/bench: $(FUNCTIONS_PARTS) $(FUNCTIONS_SCALAR) $(FUNCTIONS_VECTOR) $(BUILD)/common/timing/timer.o $(BUILD)/common/workers/workers.o $(BUILD)/common/workers/cpus.o
	$(CC) $(SANITIZERS) $^ $(FUNCTIONS_MPFR) -lm -ldl -lpthread -o $@
