# Everything starts from a clone: each target first makes or mends .venv (see .ci/setup.sh).
#   make PYTHON=python3.12 …   uses another interpreter
#   make test ARGS='-k field'  hands arguments to pytest
PYTHON ?= python3
BIN := .venv/bin
ARGS ?=

export PYTHON

.DEFAULT_GOAL := help
.PHONY: help setup setup-all run test lint format bench corpus fuzz samples clean

help:
	@echo "make run     open the window with a demo; without a display make a picture in out/"
	@echo "make test    run the whole test suite (GUI tests under Xvfb)"
	@echo "make lint    ruff and mypy"
	@echo "make format  let ruff lay out the code"
	@echo "make bench   run time and error of each phase, against the paper's way"
	@echo "make corpus  every mesh of ../shared/data: a valid result or a named error; painting on all"
	@echo "make fuzz    damaged sample files of every kind: a sample or a named error"
	@echo "make samples bake the shipped samples anew from their recipes"
	@echo "make setup   only install what is needed, into .venv"
	@echo "make clean   remove .venv, caches and out/"

setup:
	@bash .ci/setup.sh

setup-all:
	@bash .ci/setup.sh window

run: setup
	@bash .ci/demo.sh

test: setup-all
	$(BIN)/python -m pytest $(ARGS)

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: setup
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: setup
	$(BIN)/patina bench dense $(ARGS)
	$(BIN)/patina bench quilt $(ARGS)
	$(BIN)/patina bench peers $(ARGS)
	$(BIN)/patina bench bake $(ARGS)
	$(BIN)/patina bench factorize $(ARGS)
	$(BIN)/patina bench harmonics $(ARGS)
	$(BIN)/patina bench interpolation $(ARGS)

corpus: setup
	$(BIN)/python tests/corpus.py $(ARGS)
	$(BIN)/python tests/paint_corpus.py

fuzz: setup
	$(BIN)/python tests/fuzz.py $(ARGS)

samples: setup
	$(BIN)/python -m resources.recipes $(ARGS)

clean:
	rm -rf .venv .pytest_cache .mypy_cache .ruff_cache .hypothesis build out *.egg-info
