# The front of the house: what each target does stands in scripts/ and in CMakePresets.json.
# `make` alone lists the targets.
JOBS ?= $(shell nproc)
BUILD := env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL cmake --build
CTEST := ctest -j $(JOBS) --timeout 1800 --output-on-failure --no-tests=error --test-dir

.PHONY: help deps build demo test asan check matrix bench results soak fuzz format tidy clean

help: ## this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-8s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

deps: ## install what is missing (Debian); silent when nothing is
	@scripts/deps build

build: deps ## the program and the tests: build/release/umbrage
	@cmake --preset release >/dev/null
	@$(BUILD) build/release -j $(JOBS)

demo: build ## cull a real level and a city, check them against exact visibility, paint pictures
	@scripts/deps demo
	@scripts/demo

test: check build ## all tests: optimised build, then the small sets with sanitizers
	$(CTEST) build/release
	@$(MAKE) --no-print-directory asan

asan: deps ## the small test sets with AddressSanitizer and UndefinedBehaviorSanitizer
	@cmake --preset asan >/dev/null
	@$(BUILD) build/asan -j $(JOBS)
	UMBRAGE_TEST_SIZE=$${UMBRAGE_TEST_SIZE:-small} $(CTEST) build/asan

check: deps ## layers, exports, headers, package and words
	@scripts/check-layers
	@scripts/check-headers
	@scripts/check-exports
	@scripts/check-package
	@scripts/check-words

matrix: build ## Clang, ThreadSanitizer, scalar-only, -O0, -O3: tests, and equal answers everywhere
	@scripts/deps build matrix
	@scripts/matrix

bench: deps ## measure whole frames beside rivals and exact answers (BENCH=--quick: the short one)
	@cmake --preset bench >/dev/null
	@$(BUILD) build/bench -j $(JOBS) --target compare --target bench_boxes
	@scripts/bench $(BENCH)

results: deps ## docs/results/compare.md and its plots, by a full bench
	@$(MAKE) --no-print-directory bench BENCH=--docs

soak: build ## the long run: a thousand million object-view pairs against the oracle
	@scripts/soak

fuzz: deps ## fuzz every reader: FUZZ_SECONDS (60) each
	@scripts/deps build matrix
	@cmake --preset fuzz >/dev/null
	@$(BUILD) build/fuzz -j $(JOBS)
	@scripts/fuzz

format: ## lay out the sources as .clang-format says
	@scripts/deps matrix
	@git ls-files '*.c' '*.h' | xargs clang-format -i

tidy: deps ## clang-tidy over the sources
	@scripts/deps build matrix
	@cmake --preset clang >/dev/null
	@git ls-files 'src/*.c' 'tools/*.c' 'examples/*.c' | xargs -n 1 -P $(JOBS) clang-tidy --quiet -p build/clang 2>/dev/null

clean: ## remove everything that was built or made
	rm -rf build out
