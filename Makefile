# SPDX-License-Identifier: GPL-2.0-or-later
# libhm2: one Makefile for everything. `make help` lists the targets. Works without ./configure, with defaults.

BUILDDIR ?= build
-include config.mk

VERSION := 0.1.0
SOVERSION := 0

prefix ?= /usr/local
exec_prefix ?= $(prefix)
bindir ?= $(exec_prefix)/bin
libdir ?= $(exec_prefix)/lib
includedir ?= $(prefix)/include
mandir ?= $(prefix)/share/man
datadir ?= $(prefix)/share
INSTALL ?= install

CC ?= cc
AR ?= ar
NM ?= nm
CFLAGS ?= -O2 -g
PKG_CONFIG ?= pkg-config
FUZZ_CC ?= clang
FUZZ_SECONDS ?= 20

# Our own builds treat warnings as errors; a release must build with next year's compiler: make WERROR=
WERROR ?= -Werror
WARNINGS := -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wvla -Wswitch-enum -Wmissing-prototypes \
	-Wstrict-prototypes -Wcast-qual -Wwrite-strings -Wundef $(WERROR)
ALL_CFLAGS = -std=c11 -D_GNU_SOURCE -fPIC -fvisibility=$(VISIBILITY) -ffp-contract=off $(WARNINGS) $(CPPFLAGS) $(CFLAGS) \
	$(SANITIZE)
VISIBILITY := hidden
ALL_CPPFLAGS := -Ilib/include
DEPFLAGS = -MMD -MP
SRCDIR := $(patsubst %/,%,$(dir $(abspath $(lastword $(MAKEFILE_LIST)))))

V ?= 0
ifeq ($(V),0)
say = @printf '  %-8s %s\n' $(1) '$(2)';
else
say =
endif

# ---- sources: a new file in its folder is part of the build -----------------------------------------------------

LIB_DIRS := core link lbp16 hostmot2 module sslbp board motion ppmc flash lbp can modbus
LIB_SRC := $(sort $(foreach d,$(LIB_DIRS),$(wildcard lib/$(d)/*.c)))
SIM_SRC := $(sort $(wildcard lib/sim/*.c))
HOST_SRC := $(sort $(wildcard lib/halhost/*.c))
TOOLS := $(sort $(notdir $(patsubst %/,%,$(dir $(wildcard tools/*/main.c)))))
COMPONENT_COMMON := $(sort $(wildcard components/common/*.c))
COMPONENTS := $(sort $(notdir $(patsubst %/,%,$(dir $(wildcard components/*/main.c)))))
TEST_COMPONENTS := $(sort $(patsubst tests/components/%.c,%,$(wildcard tests/components/*.c)))
UNIT_TESTS := $(sort $(patsubst tests/unit/%.c,%,$(wildcard tests/unit/test_*.c)))
SYSTEM_TESTS := $(sort $(patsubst tests/system/%.c,%,$(wildcard tests/system/check_*.c)))
FUZZERS := $(sort $(patsubst tests/fuzz/%.c,%,$(wildcard tests/fuzz/fuzz_*.c)))
BENCHES := $(sort $(patsubst tests/bench/%.c,%,$(wildcard tests/bench/bench_*.c)))
UNIT_HELPERS := $(sort $(filter-out tests/unit/test_%.c,$(wildcard tests/unit/*.c)))
BENCH_HELPERS := $(sort $(filter-out tests/bench/bench_%.c,$(wildcard tests/bench/*.c)))
SYSTEM_HELPERS := $(sort $(filter-out tests/system/check_%.c,$(wildcard tests/system/*.c)))
ALL_SRC := $(LIB_SRC) $(SIM_SRC) $(HOST_SRC) $(sort $(wildcard tools/*/*.c components/*/*.c tests/*/*.c tests/system/*/*.c))
MAN_PAGES = $(sort $(wildcard man/*.[0-9])) $(BUILDDIR)/man/hm2_lbp16.9

# hm2host's prompt is better with libedit, and works without.
EDIT_CFLAGS ?= $(shell $(PKG_CONFIG) --cflags libedit 2>/dev/null)
EDIT_LIBS ?= $(shell $(PKG_CONFIG) --libs libedit 2>/dev/null)

# Rules that keep other programs off the cards' interfaces; without it the component says that there are none.
NFT_LIBS ?= $(shell $(PKG_CONFIG) --libs libnftables 2>/dev/null)
LIBS_hm2_lbp16 := $(NFT_LIBS)

# State and restart of CAN controllers; without it the component carries frames all the same.
SOCKETCAN_LIBS ?= $(if $(wildcard /usr/include/libsocketcan.h),-lsocketcan)
LIBS_can_io := $(SOCKETCAN_LIBS)
# modbus_io is built where libmodbus is.
MODBUS_LIBS ?= $(shell $(PKG_CONFIG) --libs libmodbus 2>/dev/null)
LIBS_modbus_io := $(MODBUS_LIBS)
# hm2_mb2hal, a program for LinuxCNC's HAL, is built where its library for programs is, too.
LINUXCNC_HAL_LIBS ?= $(if $(findstring /,$(shell $(CC) -print-file-name=liblinuxcnchal.so 2>/dev/null)),-llinuxcnchal)
LINUXCNC_PROGRAMS := $(if $(strip $(LINUXCNC_HAL_LIBS)),$(if $(strip $(MODBUS_LIBS)),$(BUILDDIR)/linuxcnc/hm2_mb2hal))
ifeq ($(strip $(MODBUS_LIBS)),)
COMPONENTS := $(filter-out modbus_io,$(COMPONENTS))
SYSTEM_TESTS := $(filter-out check_modbus_io check_modbus_cycle check_modbus_rtu check_vfd_spindle,$(SYSTEM_TESTS))
endif

obj = $(patsubst %.c,$(BUILDDIR)/obj/%.o,$(1))
LIB_OBJ := $(call obj,$(LIB_SRC))
SIM_OBJ := $(call obj,$(SIM_SRC))
HOST_OBJ := $(call obj,$(HOST_SRC))

LIB_A := $(BUILDDIR)/libhm2.a
LIB_SO := $(BUILDDIR)/libhm2.so.$(SOVERSION)
SIM_A := $(BUILDDIR)/libhm2sim.a
HOST_A := $(BUILDDIR)/libhalhost.a
PROGRAMS := $(addprefix $(BUILDDIR)/,$(TOOLS))
COMPONENT_SO := $(patsubst %,$(BUILDDIR)/components/%.so,$(COMPONENTS))
TEST_COMPONENT_SO := $(patsubst %,$(BUILDDIR)/test-components/%.so,$(TEST_COMPONENTS))
UNIT_BIN := $(addprefix $(BUILDDIR)/unit/,$(UNIT_TESTS))
SYSTEM_BIN := $(addprefix $(BUILDDIR)/system/,$(SYSTEM_TESTS))
FUZZ_BIN := $(addprefix $(BUILDDIR)/fuzz/,$(FUZZERS))
BENCH_BIN := $(addprefix $(BUILDDIR)/bench/,$(BENCHES))

.PHONY: all help check check-unit check-system bench fuzz lint install uninstall linuxcnc install-linuxcnc \
	uninstall-linuxcnc dist clean format
.DEFAULT_GOAL := all
.SECONDARY:
.DELETE_ON_ERROR:

all: $(LIB_A) $(LIB_SO) $(SIM_A) $(PROGRAMS) $(COMPONENT_SO) $(BUILDDIR)/libhm2.pc $(BUILDDIR)/man/hm2_lbp16.9 ## build libraries, programs, components

help: ## this list
	@echo 'make [TARGET] [BUILDDIR=build] [CC=gcc] [SANITIZE=-fsanitize=address,undefined] [V=1]'
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  \1\t\2/p' Makefile | expand -t 22

# ---- libraries ----------------------------------------------------------------------------------------------------

# The flags of a folder hold for its objects (.o) and for the checks of its sources (.lint).
$(BUILDDIR)/obj/lib/board/%: EXTRA_CPPFLAGS := -Ilib/module
$(BUILDDIR)/obj/lib/sim/%: EXTRA_CPPFLAGS := -Ilib/sim
$(BUILDDIR)/obj/lib/halhost/%: EXTRA_CPPFLAGS := -Ilib/halhost -Ilib/halhost/include
$(BUILDDIR)/obj/components/%: EXTRA_CPPFLAGS := -Icomponents -Ilib/halhost/include -DRTAPI -D__MODULE__
$(BUILDDIR)/obj/components/hm2_lbp16/% $(BUILDDIR)/obj/linuxcnc/components/hm2_lbp16/%: override CPPFLAGS += $(if $(NFT_LIBS),-DHM2_HAVE_NFTABLES)
$(BUILDDIR)/obj/components/can_io/% $(BUILDDIR)/obj/linuxcnc/components/can_io/%: override CPPFLAGS += $(if $(SOCKETCAN_LIBS),-DHM2_HAVE_SOCKETCAN)
$(BUILDDIR)/obj/tests/components/%: EXTRA_CPPFLAGS := -Icomponents -Ilib/halhost/include -DRTAPI -D__MODULE__
# What a component exports is said by its EXPORT_SYMBOL()s and done by the linker (see component_link).
$(BUILDDIR)/obj/components/% $(BUILDDIR)/obj/tests/components/%: VISIBILITY := default
$(BUILDDIR)/obj/tools/%: EXTRA_CPPFLAGS := -Ilib/sim -Ilib/halhost -Ilib/halhost/include -DHM2_VERSION='"$(VERSION)"' \
	-DHM2_SOURCE_DIR='"$(SRCDIR)"' -DHM2_COMPONENT_DIR='"$(libdir)/hm2/components"' $(EDIT_CFLAGS) $(if $(EDIT_LIBS),-DHM2_HAVE_LIBEDIT)
$(BUILDDIR)/obj/tests/%: EXTRA_CPPFLAGS := -Ilib/sim -Ilib/halhost -Ilib/halhost/include -Ilib/board -Ilib/module \
	-Ilib/hostmot2 -DTEST_DATA='"$(SRCDIR)/tests/data"' -DTEST_BUILD='"$(abspath $(BUILDDIR))"' \
	-DTEST_SOURCE='"$(SRCDIR)"'

# With another compiler or other flags everything is made anew: a folder never holds a mixture.
FLAGS := $(BUILDDIR)/flags
flags_text = $(subst ','\'',$(CC) $(ALL_CPPFLAGS) $(ALL_CFLAGS) $(LDFLAGS) $(EDIT_CFLAGS) $(EDIT_LIBS) $(NFT_LIBS) $(SOCKETCAN_LIBS))
$(FLAGS): FORCE
	@mkdir -p $(@D); echo '$(flags_text)' | cmp -s - $@ || echo '$(flags_text)' > $@
.PHONY: FORCE
FORCE:

$(BUILDDIR)/obj/%.o: %.c $(FLAGS)
	@mkdir -p $(@D)
	$(call say,CC,$<)$(CC) $(ALL_CPPFLAGS) $(EXTRA_CPPFLAGS) $(ALL_CFLAGS) $(DEPFLAGS) -c -o $@ $<

$(LIB_A): $(LIB_OBJ)
$(SIM_A): $(SIM_OBJ)
$(HOST_A): $(HOST_OBJ)
%.a:
	$(call say,AR,$@)rm -f $@ && $(AR) rcs $@ $^

# Everything it uses is in itself and in the libraries named; a sanitizer's run-time library comes with the program.
comma := ,
$(LIB_SO): $(LIB_OBJ) lib/libhm2.map
	$(call say,LD,$@)$(CC) $(ALL_CFLAGS) $(LDFLAGS) -shared -Wl,-soname,libhm2.so.$(SOVERSION) \
		-Wl,--version-script,lib/libhm2.map $(if $(SANITIZE),,-Wl$(comma)-z$(comma)defs) -o $@ $(LIB_OBJ) -lm -lpthread
	@ln -sf $(@F) $(BUILDDIR)/libhm2.so

# What has a folder of the installation in it is made anew when the folder changes ("make", then "make install prefix=").
PATHS := $(BUILDDIR)/paths
$(PATHS): FORCE
	@mkdir -p $(@D); echo '$(prefix) $(libdir) $(includedir)' | cmp -s - $@ || echo '$(prefix) $(libdir) $(includedir)' > $@
$(call obj,tools/hm2host/main.c): $(PATHS)

$(BUILDDIR)/libhm2.pc: lib/libhm2.pc.in Makefile $(PATHS)
	@mkdir -p $(@D)
	$(call say,GEN,$@)sed -e 's|@prefix@|$(prefix)|' -e 's|@libdir@|$(libdir)|' -e 's|@includedir@|$(includedir)|' \
		-e 's|@version@|$(VERSION)|' $< > $@

# ---- programs and components --------------------------------------------------------------------------------------

define tool_rule
$(BUILDDIR)/$(1): $(call obj,$(wildcard tools/$(1)/*.c tools/common/*.c)) $$(if $$(filter hm2host,$(1)),$(HOST_A)) $(SIM_A) $(LIB_A)
	@mkdir -p $$(@D)
	$$(call say,LD,$$@)$$(CC) $$(ALL_CFLAGS) $$(LDFLAGS) -o $$@ $$(filter %.o,$$^) $$(TOOL_LIBS) -lm -lpthread
endef
$(foreach t,$(TOOLS),$(eval $(call tool_rule,$(t))))
$(BUILDDIR)/%: TOOL_LIBS = $(SIM_A) $(LIB_A)
# The host exports its HAL and RTAPI calls to the modules it loads, so every object of it must be linked in.
# Its threads must not look up symbols in their first cycles.
$(BUILDDIR)/hm2host: TOOL_LIBS = -Wl,-z,now -Wl,--whole-archive $(HOST_A) -Wl,--no-whole-archive $(LIB_A) -rdynamic -ldl $(EDIT_LIBS)

# Hashes of image files and dumps.
MD_LIBS ?= -lmd
$(BUILDDIR)/hm2flash: TOOL_LIBS = $(LIB_A) $(MD_LIBS)

# A module of LinuxCNC's kind: exactly the names marked with EXPORT_SYMBOL() are global, everything else is local.
define component_link
	@mkdir -p $(@D)
	@{ echo '{ global:'; $(NM) $(filter %.o,$^) | sed -n 's/.* rtapi_exported_\(.*\)/\1;/p'; \
		echo 'local: *; };'; } >$@.map
	$(call say,LD,$@)$(CC) $(ALL_CFLAGS) $(LDFLAGS) -shared -Wl,--exclude-libs,ALL -Wl,--version-script,$@.map -o $@ \
		$(filter %.o,$^) $(LIB_A) $(LIBS_$(basename $(@F))) -lm -lpthread
endef

define component_rule
$(BUILDDIR)/components/$(1).so: $(call obj,$(wildcard components/$(1)/*.c) $(COMPONENT_COMMON)) $(LIB_A)
	$$(component_link)
endef
$(foreach c,$(COMPONENTS),$(eval $(call component_rule,$(c))))

$(BUILDDIR)/test-components/%.so: $(BUILDDIR)/obj/tests/components/%.o $(call obj,$(COMPONENT_COMMON)) $(LIB_A)
	$(component_link)

# ---- LinuxCNC: the same sources against its own headers, into its own module folder --------------------------------

# What its tools report (scripts/linuxcnc-dev), asked only by the rules that need it, once.
halcompile = $(or $(HALCOMPILE),halcompile)
linuxcnc_dev = $(or $(shell HALCOMPILE='$(halcompile)' $(SRCDIR)/scripts/linuxcnc-dev $(1)), \
	$(error cannot build for LinuxCNC, for the reason above))
LINUXCNC_FLAGS = $(eval LINUXCNC_FLAGS := $$(call linuxcnc_dev,flags))$(LINUXCNC_FLAGS)
LINUXCNC_FOLDER = $(eval LINUXCNC_FOLDER := $$(or $$(LINUXCNC_MODULES),$$(call linuxcnc_dev,modules)))$(LINUXCNC_FOLDER)
LINUXCNC_SO := $(patsubst %,$(BUILDDIR)/linuxcnc/%.so,$(COMPONENTS))

# LinuxCNC's headers are not clean for -Wpedantic and lack prototypes, in macros that expand here.
$(BUILDDIR)/obj/linuxcnc/%.o: %.c $(FLAGS)
	@mkdir -p $(@D)
	$(call say,CC,$< (LinuxCNC))$(CC) $(ALL_CPPFLAGS) -Icomponents $(LINUXCNC_FLAGS) \
		$(filter-out -Wpedantic -Wmissing-prototypes,$(ALL_CFLAGS)) $(DEPFLAGS) -c -o $@ $<
$(BUILDDIR)/obj/linuxcnc/%.o: VISIBILITY := default
# Its headers count, too: another LinuxCNC needs another build.
$(BUILDDIR)/obj/linuxcnc/%.o: DEPFLAGS := -MD -MP

define linuxcnc_rule
$(BUILDDIR)/linuxcnc/$(1).so: $(patsubst %.c,$(BUILDDIR)/obj/linuxcnc/%.o,$(wildcard components/$(1)/*.c) $(COMPONENT_COMMON)) $(LIB_A)
	$$(component_link)
endef
$(foreach c,$(COMPONENTS),$(eval $(call linuxcnc_rule,$(c))))

# The sources of modbus_io, all but its main, as a program: RTAPI's side for programs is called ULAPI.
MB2HAL_SRC := $(filter-out %/main.c,$(wildcard components/modbus_io/*.c)) $(COMPONENT_COMMON) \
	$(wildcard components/modbus_io/userspace/*.c)
MB2HAL_OBJ := $(patsubst %.c,$(BUILDDIR)/obj/linuxcnc-user/%.o,$(MB2HAL_SRC))
$(BUILDDIR)/obj/linuxcnc-user/%.o: %.c $(FLAGS)
	@mkdir -p $(@D)
	$(call say,CC,$< (LinuxCNC program))$(CC) $(ALL_CPPFLAGS) -Icomponents -DHM2_VERSION='"$(VERSION)"' -DULAPI \
		$(filter-out -DRTAPI -Drealtime -D__MODULE__,$(LINUXCNC_FLAGS)) \
		$(filter-out -Wpedantic -Wmissing-prototypes,$(ALL_CFLAGS)) -MD -MP -c -o $@ $<
$(BUILDDIR)/linuxcnc/hm2_mb2hal: $(MB2HAL_OBJ) $(LIB_A)
	@mkdir -p $(@D)
	$(call say,LD,$@)$(CC) $(ALL_CFLAGS) $(LDFLAGS) -o $@ $^ $(MODBUS_LIBS) $(LINUXCNC_HAL_LIBS) -lm -lpthread

linuxcnc: $(LINUXCNC_SO) $(LINUXCNC_PROGRAMS) ## build the components for the LinuxCNC that is installed

# The page lists the points from the tables that create them.
$(BUILDDIR)/man/%: man/%.in $(BUILDDIR)/hm2points
	@mkdir -p $(@D)
	$(call say,GEN,$@)$(BUILDDIR)/hm2points --mdoc > $@.points && \
		sed -e '/@POINTS@/{r $@.points' -e 'd}' $< > $@ && rm $@.points

# ---- tests --------------------------------------------------------------------------------------------------------

CMOCKA_LIBS ?= -lcmocka
CHECK_LIBS ?= $(shell $(PKG_CONFIG) --libs check 2>/dev/null || echo -lcheck)

$(BUILDDIR)/unit/%: $(BUILDDIR)/obj/tests/unit/%.o $(call obj,$(UNIT_HELPERS)) $(SIM_A) $(LIB_A) $(HOST_A)
	@mkdir -p $(@D)
	$(call say,LD,$@)$(CC) $(ALL_CFLAGS) $(LDFLAGS) -o $@ $(filter %.o,$^) $(SIM_A) $(HOST_A) $(LIB_A) \
		$(CMOCKA_LIBS) -lm -lpthread -ldl
$(BUILDDIR)/unit/test_example: $(call obj,$(wildcard tests/example/*.c))
$(BUILDDIR)/unit/test_doctor: $(call obj,$(addprefix tools/hm2doctor/,findings.c measure.c rounds.c))

$(BUILDDIR)/system/%: $(BUILDDIR)/obj/tests/system/%.o $(call obj,$(SYSTEM_HELPERS)) $(SIM_A) $(LIB_A)
	@mkdir -p $(@D)
	$(call say,LD,$@)$(CC) $(ALL_CFLAGS) $(LDFLAGS) -o $@ $(filter %.o,$^) $(SIM_A) $(LIB_A) $(CHECK_LIBS) $(SYSTEM_LIBS) \
		-lm -lpthread
$(BUILDDIR)/system/check_modbus_io: SYSTEM_LIBS := $(MODBUS_LIBS)

# These count calls of the C library in their process; one has the insides of modbus_io there, and RTAPI's messages.
$(BUILDDIR)/system/check_modbus_cycle: $(call obj,$(addprefix components/modbus_io/,engine.c instance.c pins.c) \
	components/common/messenger.c) $(HOST_A)
$(BUILDDIR)/system/check_modbus_cycle: SYSTEM_LIBS := $(HOST_A) $(LIB_A) $(MODBUS_LIBS)
$(BUILDDIR)/system/check_modbus_cycle $(BUILDDIR)/system/check_cyclic_libc: $(call obj,$(wildcard tests/system/libc/*.c))

# These run drivers in their process, which find HAL, RTAPI and the C library's sockets there.
$(BUILDDIR)/system/check_dropin_behaviour $(BUILDDIR)/system/check_dropin_loads $(BUILDDIR)/system/check_dropin_ppmc: \
$(BUILDDIR)/system/%: $(BUILDDIR)/obj/tests/system/%.o $(call obj,$(SYSTEM_HELPERS) \
	$(wildcard tests/system/dropin/*.c)) $(SIM_A) $(HOST_A) $(LIB_A) | $(COMPONENT_SO)
	@mkdir -p $(@D)
	$(call say,LD,$@)$(CC) $(ALL_CFLAGS) $(LDFLAGS) -o $@ $(filter %.o,$^) $(SIM_A) -Wl,--whole-archive $(HOST_A) \
		-Wl,--no-whole-archive $(LIB_A) $(CHECK_LIBS) -rdynamic -lm -lpthread -ldl

$(BUILDDIR)/bench/%: $(BUILDDIR)/obj/tests/bench/%.o $(call obj,$(BENCH_HELPERS)) $(HOST_A) $(SIM_A) $(LIB_A)
	@mkdir -p $(@D)
	$(call say,LD,$@)$(CC) $(ALL_CFLAGS) $(LDFLAGS) -o $@ $(filter %.o,$^) -Wl,--whole-archive $(HOST_A) \
		-Wl,--no-whole-archive $(SIM_A) $(LIB_A) -rdynamic -lm -lpthread -ldl

# Some of them load components into LinuxCNC, and skip that where it is not installed.
$(SYSTEM_BIN): | $(if $(shell command -v $(halcompile)),$(LINUXCNC_SO) $(LINUXCNC_PROGRAMS))
# These load the test components.
$(BUILDDIR)/unit/test_halhost $(BUILDDIR)/system/check_hm2host: | $(TEST_COMPONENT_SO)

check: all $(UNIT_BIN) $(SYSTEM_BIN) ## run all tests; ends with "N passed, N failed, N skipped"
	@scripts/run-tests $(BUILDDIR) unit $(UNIT_BIN)
	@scripts/run-tests $(BUILDDIR) system $(SYSTEM_BIN)
	@scripts/run-tests --summary $(BUILDDIR)

check-unit: $(UNIT_BIN) all
	@scripts/run-tests $(BUILDDIR) unit $(UNIT_BIN)

check-system: all $(SYSTEM_BIN)
	@scripts/run-tests $(BUILDDIR) system $(SYSTEM_BIN)

bench: all $(BENCH_BIN) $(BUILDDIR)/unit/test_pipeline ## compare with the peers, as ratios, in one run
	@tests/bench/run $(BUILDDIR)
	@tests/bench/modules $(BUILDDIR)
	@tests/bench/flash $(BUILDDIR)

fuzz: ## run every fuzz harness for FUZZ_SECONDS
	@$(MAKE) --no-print-directory BUILDDIR=$(BUILDDIR)/fuzz-objects CC=$(FUZZ_CC) \
		SANITIZE='-fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=all' FUZZING=1 fuzz-binaries
	@scripts/run-fuzz $(BUILDDIR)/fuzz-objects/fuzz $(FUZZ_SECONDS)

.PHONY: fuzz-binaries
fuzz-binaries: $(FUZZ_BIN)
$(BUILDDIR)/fuzz/%: $(BUILDDIR)/obj/tests/fuzz/%.o $(SIM_A) $(HOST_A) $(LIB_A)
	@mkdir -p $(@D)
	$(call say,LD,$@)$(CC) $(ALL_CFLAGS) $(LDFLAGS) -fsanitize=fuzzer -o $@ $< $(SIM_A) $(HOST_A) $(LIB_A) -lm \
		-lpthread -ldl

lint: all ## formatting, clang-tidy, cppcheck, man pages, shell, exported symbols
	@scripts/lint $(BUILDDIR)

# clang-tidy and cppcheck with the flags of the build, one source at a time: only what changed since it was last found
# clean. (One at a time also because clang-tidy 14's va_list check errs from the second file of a run on.)
CPPCHECK_FLAGS := --quiet --error-exitcode=1 --std=c11 --enable=warning,performance,portability --inline-suppr \
	--suppress=missingIncludeSystem --library=tests/cppcheck.cfg
.PHONY: lint-sources lint-libraries
lint-sources: $(patsubst %.c,$(BUILDDIR)/obj/%.lint,$(ALL_SRC))
$(BUILDDIR)/obj/%.lint: %.c $(BUILDDIR)/obj/%.o .clang-tidy tests/.clang-tidy tests/cppcheck.cfg
	@clang-tidy --quiet $< -- $(ALL_CPPFLAGS) $(EXTRA_CPPFLAGS) -std=c11 -D_GNU_SOURCE $(WARNINGS) $(CPPFLAGS) 2>$@.log || \
		{ cat $@.log; exit 1; }
	@cppcheck $(CPPCHECK_FLAGS) $(ALL_CPPFLAGS) $(EXTRA_CPPFLAGS) -D_GNU_SOURCE $(CPPFLAGS) $<
	@touch $@

format: ## rewrite sources in the house format
	clang-format -i $$(git ls-files '*.c' '*.h')

# ---- installation -------------------------------------------------------------------------------------------------

install: all ## install below DESTDIR/prefix
	$(INSTALL) -d $(DESTDIR)$(bindir) $(DESTDIR)$(libdir)/pkgconfig $(DESTDIR)$(libdir)/hm2/components \
		$(DESTDIR)$(includedir)/hm2
	$(INSTALL) -m 755 $(PROGRAMS) $(DESTDIR)$(bindir)
	$(INSTALL) -m 644 $(LIB_A) $(SIM_A) $(DESTDIR)$(libdir)
	$(INSTALL) -m 755 $(LIB_SO) $(DESTDIR)$(libdir)
	ln -sf libhm2.so.$(SOVERSION) $(DESTDIR)$(libdir)/libhm2.so
	$(INSTALL) -m 644 $(BUILDDIR)/libhm2.pc $(DESTDIR)$(libdir)/pkgconfig
	$(INSTALL) -m 644 lib/include/hm2/*.h $(DESTDIR)$(includedir)/hm2
	$(INSTALL) -d $(DESTDIR)$(includedir)/hm2host
	$(INSTALL) -m 644 lib/halhost/include/*.h $(DESTDIR)$(includedir)/hm2host
	$(INSTALL) -m 755 $(COMPONENT_SO) $(DESTDIR)$(libdir)/hm2/components
	for page in $(MAN_PAGES); do s=$${page##*.}; $(INSTALL) -d $(DESTDIR)$(mandir)/man$$s && \
		$(INSTALL) -m 644 $$page $(DESTDIR)$(mandir)/man$$s || exit 1; done

uninstall: ## remove what install put there
	rm -f $(addprefix $(DESTDIR)$(bindir)/,$(TOOLS)) $(DESTDIR)$(libdir)/libhm2.a $(DESTDIR)$(libdir)/libhm2sim.a \
		$(DESTDIR)$(libdir)/libhm2.so $(DESTDIR)$(libdir)/libhm2.so.$(SOVERSION) \
		$(DESTDIR)$(libdir)/pkgconfig/libhm2.pc
	rm -rf $(DESTDIR)$(includedir)/hm2 $(DESTDIR)$(includedir)/hm2host $(DESTDIR)$(libdir)/hm2
	for page in $(MAN_PAGES); do rm -f $(DESTDIR)$(mandir)/man$${page##*.}/$${page##*/}; done

install-linuxcnc: linuxcnc ## install the components where LinuxCNC loads them from, below DESTDIR
	$(INSTALL) -d $(DESTDIR)$(LINUXCNC_FOLDER)
	$(INSTALL) -m 644 $(LINUXCNC_SO) $(DESTDIR)$(LINUXCNC_FOLDER)
	$(if $(LINUXCNC_PROGRAMS),$(INSTALL) -d $(DESTDIR)$(bindir) && $(INSTALL) -m 755 $(LINUXCNC_PROGRAMS) $(DESTDIR)$(bindir))

uninstall-linuxcnc: ## remove what install-linuxcnc put there
	rm -f $(addprefix $(DESTDIR)$(LINUXCNC_FOLDER)/,$(notdir $(LINUXCNC_SO))) \
		$(addprefix $(DESTDIR)$(bindir)/,$(notdir $(LINUXCNC_PROGRAMS)))

dist: ## source archive of the committed tree
	@mkdir -p $(BUILDDIR)
	git archive --prefix=libhm2-$(VERSION)/ -o $(BUILDDIR)/libhm2-$(VERSION).tar.gz HEAD

clean: ## remove the build folder
	rm -rf $(BUILDDIR)

-include $(patsubst %.o,%.d,$(LIB_OBJ) $(SIM_OBJ) $(HOST_OBJ) \
	$(call obj,$(wildcard tools/*/*.c components/*/*.c tests/*/*.c tests/system/dropin/*.c tests/system/libc/*.c)) $(patsubst %.c,$(BUILDDIR)/obj/linuxcnc/%.o, \
	$(wildcard components/*/*.c)) $(MB2HAL_OBJ))
