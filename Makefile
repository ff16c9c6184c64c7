# The commands that people and CI type; "make" lists them. CMake does the building (CMakePresets.json).
#
# JOBS    parallel compilers and tests; all cores
# PRESET  what build, demo and test use. "ci" stops on warnings, and knows those of g++ 12; with
#         another compiler: make demo PRESET=release. Both build in build/release.
# PORT    serial port of the LED board, for flash
# BOOT_BAUD  of its bootloader: 57600 for a Nano with the old one
# LIGHTS  of the firmware that flash uploads: 14, or 16 without flash sync and shutter
# SECONDS  how long fuzz runs each target
# ROUNDS   of inputs, for each of the nine readers
# LABEL   which tests "make test" builds and runs: all, or "release", those that depend on
#         optimisation, SIMD or exact bits, or run the programs
# KILLS   for kills: system calls of each program at which it is killed; 0: all
# SEEDS   for asan: few, or all of the tests that average over random draws
# SINCE   a commit: tidy looks at the modules that differ from it; all modules if empty
JOBS ?= $(shell nproc)
PRESET ?= ci
PORT ?= /dev/ttyACM0
BOOT_BAUD ?= 115200
LIGHTS ?= 14
IMAGE_14 = sateen-controller.hex
IMAGE_16 = sateen-controller-16.hex
SECONDS ?= 60
ROUNDS ?= 7000
LABEL ?=
KILLS ?= 60
SEEDS ?= few
SINCE ?=
SCENES = twill-ring10 knit linen-three-rings satin-ggx knit-gloss black-velvet rib-shadows
CTEST = ctest --output-on-failure --no-tests=error -j$(JOBS)
# Tracked files and new ones that are not ignored.
OUR_SOURCES = git ls-files -z --cached --others --exclude-standard '*.h' '*.cc' '*.c'

.DEFAULT_GOAL := help
.PHONY: help setup demo programs build test bench accuracy firmware flash fuzz inputs hostile mutants kills format format-check tidy asan tsan diagrams nightly clean

help:  ## This list
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 16

setup:  ## Install the Debian packages that are missing (packages.txt)
	@tools/setup

demo: programs  ## Capture, calibrate and solve on the virtual rig, compare with the truth
	@samples/demo.sh

build: setup  ## Build everything into build/release
	@cmake --preset $(PRESET) --log-level=WARNING
	@cmake --build --preset $(PRESET) -j$(JOBS)

programs: setup  ## Build what people run, without tests and benchmarks
	@cmake --preset $(PRESET) --log-level=WARNING
	@cmake --build --preset $(PRESET) -j$(JOBS) --target sateen sateen-virtual-rig \
	    sateen-camera-worker sateen-virtual-port sateen_firmware

test: setup  ## Build and run all tests
	@cmake --preset $(PRESET) --log-level=WARNING
	@cmake --build --preset $(PRESET) -j$(JOBS) --target sateen_$(LABEL:%=%_)tests
	@$(CTEST) --test-dir build/release $(LABEL:%=-L '^%$$')

bench: build  ## Speed against error of the whole solve, then the micro-benchmarks
	@build/release/bin/sateen bench solve
	@for program in build/release/bin/*_bench; do echo "== $$program"; $$program || exit 1; done

accuracy: programs  ## Write docs/accuracy.md and its plot anew; with the public data sets: SATEEN_DATA=FOLDER
	@build/release/bin/sateen bench accuracy $(SCENES:%=--scene samples/scenes/%.json) \
	    --markdown docs/accuracy.md --plot docs/images/accuracy.svg

firmware: setup  ## The LED board's firmware: build/firmware/sateen-controller.hex, -16.hex
	@cmake -S firmware -B build/firmware --toolchain $(CURDIR)/firmware/avr.cmake -G Ninja --log-level=WARNING
	@cmake --build build/firmware

flash: firmware  ## Upload it to an Arduino Uno or Nano: make flash PORT=/dev/ttyACM0
	@test -n '$(IMAGE_$(LIGHTS))' || { echo 'LIGHTS=$(LIGHTS): 14 or 16' >&2; exit 2; }
	@avrdude -p atmega328p -c arduino -P $(PORT) -b $(BOOT_BAUD) -D \
	    -U flash:w:build/firmware/$(IMAGE_$(LIGHTS)):i

fuzz: setup  ## libFuzzer with the address sanitizer over each target of fuzz/
	@cmake --preset fuzz --log-level=WARNING
	@cmake --build --preset fuzz -j$(JOBS)
	@for target in build/fuzz/bin/sateen_fuzz_*; do name=$${target##*sateen_fuzz_}; \
	    mkdir -p build/fuzz/found/$$name; echo "== $$name"; \
	    $$target -max_total_time=$(SECONDS) -print_final_stats=1 \
	        build/fuzz/found/$$name fuzz/corpus/$$name || exit 1; done

inputs: setup  ## Feed every reader ROUNDS mutated inputs, each within 10 s and 2 GB
	@cmake --preset $(PRESET) --log-level=WARNING
	@cmake --build --preset $(PRESET) -j$(JOBS) --target sateen_fuzz_inputs
	@for program in build/release/bin/sateen_fuzz_*_corpus; do \
	    name=$${program##*sateen_fuzz_}; name=$${name%_corpus}; printf '%s: ' $$name; \
	    $$program fuzz/corpus/$$name $(ROUNDS) || exit 1; done

hostile: programs  ## Special files and unfolding files in place of every input of the program
	@tests/hostile/special_files.py build/release/bin/sateen --all
	@tests/hostile/bombs.py build/release/bin/sateen

mutants: setup  ## Break the code in each way of tests/mutants; see a test fail. WORD=..., a list or part of a name
	@tools/mutants -j$(JOBS) $(WORD)

format: setup  ## Format all sources in place
	@$(OUR_SOURCES) | xargs -0r clang-format -i

format-check: setup  ## Fail where a source is not formatted
	@$(OUR_SOURCES) | xargs -0r clang-format --dry-run -Werror

tidy: setup  ## clang-tidy over the libraries and the program
	@cmake --preset tidy --log-level=WARNING
	@tools/tidy build/tidy $(JOBS) $(SINCE)

asan: setup  ## Build all, and run all tests under the address and undefined-behaviour sanitizers
	@cmake --preset asan --log-level=WARNING
	@cmake --build --preset asan -j$(JOBS)
	@SATEEN_SEEDS=$(SEEDS) UBSAN_OPTIONS=print_stacktrace=1 LSAN_OPTIONS="suppressions=$(CURDIR)/tests/lsan.supp:print_suppressions=0" \
	    $(CTEST) --test-dir build/asan

# The daemon and the capture have threads of their own. The system's oneTBB, on which a solve runs,
# is not instrumented: some runs of `make tsan TSAN=solver` report how it hands over work.
TSAN ?= daemon capture
tsan: setup  ## The tests of the daemon and the capture under the thread sanitizer
	@cmake --preset tsan --log-level=WARNING
	@cmake --build --preset tsan -j$(JOBS) --target $(TSAN:%=sateen_%_test)
	@for module in $(TSAN); do \
	    TSAN_OPTIONS="suppressions=$(CURDIR)/tests/tsan.supp" $(CTEST) --test-dir build/tsan \
	        -R "(^|/)$$module/" -E solve_job || exit 1; done

kills: setup  ## kill -9 capture, resume, solve, simulate and calibrate at KILLS system calls each; 0: at every one
	@cmake --preset $(PRESET) --log-level=WARNING
	@cmake --build --preset $(PRESET) -j$(JOBS) --target sateen_virtual_rig_test
	@SATEEN_KILLS=$(KILLS) build/release/bin/sateen_virtual_rig_test --gtest_filter='ProgramKill.*'

nightly: setup  ## All that there is: every test with all seeds, tidy, benches, fuzz, threads, mutants
	@.ci/run nightly

diagrams:  ## Draw the pictures of docs/architecture.md anew; needs graphviz
	@for name in house flows; do dot -Tsvg docs/images/$$name.dot -o docs/images/$$name.svg || exit 1; done

clean:  ## Remove build/
	@rm -rf build
