# Stepwise. Two commands do everything: `make study` and `make test`. `make help` explains the rest.
.DEFAULT_GOAL := help
include common/rules.mk
-include tests/tests.mk

PY := .venv/bin/python
ARGS ?=
PHASE ?= $(NAME)
# Ladder positions of the paper: phase0 is its baseline.
LADDER := baseline opt1 opt2 opt3 opt4 opt5_threads opt6_wide opt7_tiles opt8_streams opt9_convex opt10_scene opt11_ideal opt12_fused

# Found by their folders: make NAME measures one into the newest run and writes the report again.
EXPERIMENTS := $(patsubst scripts/study/experiments/%/experiment.py,%,$(wildcard scripts/study/experiments/*/experiment.py))
# What was given of them: make sweep PHASE="opt3 opt4" SCENE=scene0 N=360 LAUNCHES=6.
OPTIONS = $(if $(PHASE), --phase $(PHASE))$(if $(SCENE), --scene $(SCENE))$(if $(N), -n $(N))$(if $(LAUNCHES), --launches $(LAUNCHES))

.PHONY: fuzz help setup setup-test study demo test test-rest test-all report view web artifact try judge student-branch new-phase format clean phases enclosures phase0 phase1 phase2 phase3 phase4 phase5 phase6 phase7 phase8 phase9 phase10 phase11 phase12 $(EXPERIMENTS)

help: ## this list
	@sed -n "s/^\([a-z][^:=]*\):.*## \(.*\)/\1\t\2/p" Makefile | awk -F"\t" "{ split(\$$1, t, \" \"); printf \"  make %-10s %s\\n\", t[1], \$$2 }"
	@echo; echo "Experiments. make NAME measures one into the newest run and writes the report again."
	@echo "make NAME PHASE=opt4 SCENE=scene0 N=360 runs it alone, for that."
	@for name in $(EXPERIMENTS); do printf "  make %-10s %s\n" $$name "$$(sed -n '1s/^"""//;1s/"""$$//;1p' scripts/study/experiments/$$name/experiment.py)"; done

study: setup ## install what is needed, build, time, verify, count, write report/out/index.html (DEPTH=quick: 10 minutes; standard: 40 minutes; full: hours)
	@$(PY) scripts/stepwise study $(if $(DEPTH),--depth $(DEPTH)) $(if $(FULL),--depth full) $(ARGS)

demo: setup ## one picture by baseline and by PHASE=opt4 of SCENE=scene0, the time and the error between them (60 s)
	@$(PY) scripts/stepwise demo$(if $(PHASE), --phase $(PHASE))$(if $(SCENE), --scene $(SCENE)) $(ARGS)

test: setup-test ## install what is needed and run the tests that guard a change (6 minutes on 2 cores); PHASE=opt4: those of one phase
	@$(MAKE) --no-print-directory check

test-rest: setup-test ## the tests that `make test` leaves out
	@$(MAKE) --no-print-directory check-rest

test-all: setup-test ## every test there is
	@$(MAKE) --no-print-directory check-all

phase0 phase1 phase2 phase3 phase4 phase5 phase6 phase7 phase8 phase9 phase10 phase11 phase12: phase%: ## build the paper's baseline (phase0) … opt4 (phase4), and what stands for its opt5
	@$(MAKE) --no-print-directory phase-$(word $(shell expr $* + 1),$(LADDER))

phase-%: $(BUILD)/%/render ; @: ## build one phase, e.g. make phase-opt3

tree-%: ; @echo $(call tree_of,$*) ## where the whole source tree of one phase is, e.g. make tree-opt5_threads

phases: $(PHASES:%=$(BUILD)/%/render) ## build every phase

$(EXPERIMENTS): setup
	@$(PY) scripts/stepwise $(if $(strip $(OPTIONS)),$@$(OPTIONS),study --part $@) $(ARGS)

enclosures: setup-test ## truth's enclosures against exact roots, 100,000 random and adversarial rays per shape
	@STEPWISE_RAYS=100000 $(PY) -m pytest -q tests/study/truth/test_enclosures.py $(ARGS)

view: ## a window on SCENE=scene0 by PHASE=… (default: the ladder's last): walk about, compare phases, see their errors (docs/view.md)
	@scripts/setup.sh view
	@echo "view: building every phase: a few minutes the first time" && $(MAKE) --no-print-directory -sj$$(nproc) $(BUILD)/viewer
	@$(BUILD)/viewer $(SCENE) $(if $(PHASE),--phase $(PHASE)) $(ARGS)

web: ## one page that draws by the phases in a browser, from disk and offline: report/out/try.html (needs emscripten: web/web.mk)
	@$(MAKE) --no-print-directory -sj$$(nproc) -f web/web.mk

report: setup ## the page, tables and figures of the newest run again, from its files alone
	@$(PY) scripts/stepwise report $(ARGS)

report-pdf: setup ## the newest run as a paper of some ten pages (report/out/report.pdf); installs typst into build/pdf
	@$(PY) scripts/stepwise report-pdf $(ARGS)

artifact: setup ## build/stepwise-artifact.zip: the last commit for its evaluation, with a SHA-256 of each file (docs/artifact.md)
	@$(PY) scripts/stepwise artifact $(ARGS)

try: setup ## NAME=mine SCENE=scene0: a phase beside its parent, speed and error and what changed; WATCH=1: again at every save
	@$(PY) scripts/stepwise try $(or $(NAME),$(PHASE),$(error NAME= is missing))$(if $(SCENE), --scene $(SCENE))$(if $(N), -n $(N))$(if $(WATCH), --watch) $(ARGS)

judge: setup ## LAB=1 NAME=mine: is a lab of docs/labs solved, and a hint if not; of lab 3 SCENE=file.json
	@$(PY) scripts/stepwise judge $(or $(LAB),$(error LAB= is missing)) $(patsubst %,--phase %,$(or $(NAME),$(PHASE))) $(if $(SCENE),--file $(SCENE)) $(ARGS)

student-branch: setup ## a branch for students without the labs' solutions: BRANCH=student, LABS="1 13": those that are open (docs/labs/COURSE.md)
	@$(PY) scripts/stepwise student-branch $(if $(BRANCH),--branch $(BRANCH)) $(if $(LABS),--labs $(LABS)) $(ARGS)

new-phase: setup ## NAME=opt4b FROM=opt4: start a phase of your own, derived from FROM; WHOLE=1: with a copy of its files
	@$(PY) scripts/stepwise new-phase $(if $(NAME),--name $(NAME)) $(if $(FROM),--from $(FROM)) $(if $(WHOLE),--whole)

format: setup-test ## rewrite C and Python in the house style
	@$(PY) -c "import clang_format; clang_format.clang_format()" -i $(wildcard common/*.[ch] common/*/*.[ch] common/*/*/*.[ch] phases/*/*.[ch] phases/*/*/*.[ch] systems/*/*.[ch] systems/*/*/*.[ch] truth/*.[ch] truth/*/*.[ch] web/*.[ch] web/*/*.[ch] tests/*/*.[ch] tests/*/*/*.[ch])
	@.venv/bin/ruff format -q scripts tests common web && .venv/bin/ruff check -q --fix scripts tests common web

setup: ## install what `make study` needs: .venv and the packages that are missing
	@scripts/setup.sh study

setup-test: ## and what `make test` needs
	@scripts/setup.sh test

clean: ## remove what was built; results and .venv stay
	rm -rf build report/out
