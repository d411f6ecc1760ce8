# Stepwise. Two commands do everything: `make study` and `make test`. `make help` explains the rest.
.DEFAULT_GOAL := help
include common/rules.mk
-include tests/tests.mk

PY := .venv/bin/python
# The ladder: what is of family truth or systems is asked for by name.
PHASE ?= $(patsubst phases/%/phase.json,%,$(shell grep -L '"family": "\(truth\|systems\)"' phases/*/phase.json))
N ?= 360
VALIDATION_N ?= 90
ARGS ?=
# Ladder positions of the paper: phase0 is its baseline.
LADDER := baseline opt1 opt2 opt3 opt4 opt5_threads opt6_wide opt7_tiles opt8_streams opt9_convex opt10_scene

.PHONY: help setup setup-test study demo test verify accuracy sweep flops roofline hotspots report new-phase format clean phases phase0 phase1 phase2 phase3 phase4 phase5 phase6 phase7 phase8 phase9 phase10 truth enclosures stability pareto functions scaling views frames breakeven drjit toolchains systems original ideas

help: ## this list
	@sed -n "s/^\([a-z][^:=]*\):.*## \(.*\)/\1\t\2/p" Makefile | awk -F"\t" "{ split(\$$1, t, \" \"); printf \"  make %-10s %s\\n\", t[1], \$$2 }"

study: setup ## install what is needed, build, sweep, verify, count, write report/out/index.html (30 minutes on 2 quiet cores, 40 on busy ones; FULL=1: the paper's sweep, hours)
	@$(PY) scripts/stepwise study $(if $(FULL),--full) $(ARGS)

demo: setup ## one picture by baseline and by opt4, the time and the error between them (60 s)
	@$(PY) scripts/stepwise demo $(ARGS)

test: setup-test ## install what is needed and run every test (18 to 25 minutes on 2 cores)
	@$(MAKE) --no-print-directory check

phase0 phase1 phase2 phase3 phase4 phase5 phase6 phase7 phase8 phase9 phase10: phase%: ## build the paper's baseline (phase0) … opt4 (phase4), and what stands for its opt5
	@$(MAKE) --no-print-directory phase-$(word $(shell expr $* + 1),$(LADDER))

phase-%: $(BUILD)/%/render ; @: ## build one phase, e.g. make phase-opt3

tree-%: ; @echo $(call tree_of,$*) ## where the whole source tree of one phase is, e.g. make tree-opt5_threads

phases: $(PHASES:%=$(BUILD)/%/render) ## build every phase

SCENES_ASKED = $(if $(SCENE), --scene $(SCENE))

verify: setup ## pictures of PHASE=… and SCENE=… (default: all) against baseline's at N=360, judged by each phase's tolerance
	@$(PY) scripts/stepwise verify -n $(N) --phase $(filter-out baseline,$(PHASE))$(SCENES_ASKED) $(ARGS)

sweep: setup ## time PHASE=… on SCENE=… (default: all), e.g. make sweep PHASE=opt4 SCENE=scene0 N=360
	@$(PY) scripts/stepwise sweep -n $(N) --phase $(PHASE)$(SCENES_ASKED) $(ARGS)

flops: setup ## FLOPs (Table 1), declared costs held against the blocks that were executed; PHASE=…: of one phase
	@$(PY) $(if $(filter command,$(firstword $(origin PHASE))),scripts/stepwise flops --validate -n $(VALIDATION_N) --phase $(PHASE),scripts/stepwise study --part flops) $(ARGS)

roofline: setup ## ceilings of this machine, every phase below them (Tables 5 and 6, Fig. 6)
	@$(PY) scripts/stepwise study --part roofline $(ARGS)

hotspots: setup ## where the time goes (Tables 2, 3 and 4), and what single steps are worth
	@$(PY) scripts/stepwise study --part hotspots --part ablations $(ARGS)

ideas: setup ## what each idea of opt6 to opt9 gains and changes: taken out of its phase, timed beside it (10 minutes)
	@$(PY) scripts/stepwise study --part ideas $(ARGS)

truth: setup ## the exact pictures of SCENE=… (default: scene0) at N=360, in proved enclosures
	@$(PY) scripts/stepwise truth $(or $(SCENE),scene0) -n $(N) $(ARGS)

accuracy: setup ## every phase against truth: hits, distances, normals, shadows, colours; PHASE=…: of one phase
	@$(PY) $(if $(filter command,$(firstword $(origin PHASE))),scripts/stepwise accuracy -n $(N) --phase $(PHASE)$(SCENES_ASKED),scripts/stepwise study --part accuracy) $(ARGS)

enclosures: setup-test ## truth's enclosures against exact roots, 100,000 random and adversarial rays per shape
	@STEPWISE_RAYS=100000 $(PY) -m pytest -q tests/py/test_enclosures.py $(ARGS)

stability: setup ## hard cases: where each phase first fails, as its strength grows
	@$(PY) $(if $(filter command,$(firstword $(origin PHASE))),scripts/stepwise stability --phase $(PHASE),scripts/stepwise study --part stability) $(ARGS)

pareto: setup ## speed against error to truth: every scene and phase over hit distance, step cap and approximations (12 minutes)
	@$(PY) scripts/stepwise study --part pareto $(ARGS)

functions: setup ## roots, exp, log, pow, sin …: ns per element against ulp, every float tried
	@$(PY) scripts/stepwise study --part functions $(ARGS)

scaling: setup ## how time, evaluations and error grow with n, shapes, steps, bounces and threads; memory at 4K (10 minutes)
	@$(PY) scripts/stepwise study --part scaling $(ARGS)

views: setup ## every rung against its parent on views it was not tuned on: median, worst case, error (10 minutes)
	@$(PY) scripts/stepwise study --part views $(ARGS)

frames: setup ## frames a second on every core, gamma and 8 bits included, against 60 and 30 (5 minutes)
	@$(PY) scripts/stepwise study --part frames $(ARGS)

original: setup ## the paper's own program, fetched and timed beside baseline to opt4 at 1280x720 (15 minutes)
	@$(PY) scripts/stepwise original $(ARGS)

breakeven: setup ## after how many frames compiling a scene's kernel has paid (opt10_scene; a minute and a half)
	@$(PY) scripts/stepwise study --part breakeven $(ARGS)

drjit: setup ## our phases beside Dr.Jit (installed into build/drjit; needs LLVM 17 or newer), with the error of both (5 minutes)
	@$(PY) scripts/stepwise study --part drjit $(ARGS)

toolchains: setup ## every phase by every compiler and set of flags: time, pixels that change, error to truth
	@$(PY) scripts/stepwise study --part toolchains $(ARGS)

systems: setup ## what other articles built, beside the ladder: rod marching, packet ray tracing, rays in integers, CPU-RTRM's scene (12 minutes on 2 quiet cores with AVX-512, up to 40 on 2 busy ones without)
	@$(PY) scripts/stepwise study --part systems $(ARGS)

report: setup ## the page, tables and figures of the newest run again, from its files alone
	@$(PY) scripts/stepwise report $(ARGS)

new-phase: setup ## NAME=opt4b FROM=opt4: start a phase of your own, derived from FROM; WHOLE=1: with a copy of its files
	@$(PY) scripts/stepwise new-phase $(if $(NAME),--name $(NAME)) $(if $(FROM),--from $(FROM)) $(if $(WHOLE),--whole)

format: setup-test ## rewrite C and Python in the house style
	@.venv/bin/clang-format -i $(wildcard common/*.[ch] common/*/*.[ch] phases/*/*.[ch] phases/*/*/*.[ch] tests/*/*.[ch] tests/*/*/*.[ch])
	@.venv/bin/ruff format -q scripts tests common && .venv/bin/ruff check -q --fix scripts tests common

setup:
	@scripts/setup.sh study

setup-test:
	@scripts/setup.sh test

clean: ## remove what was built; results and .venv stay
	rm -rf build report/out
