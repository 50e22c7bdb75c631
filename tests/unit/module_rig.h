/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A bench for modules: firmware images made in memory, a register file behind the transfer plan, a plain binder, and
 * cycles in virtual time. No board and no link: the rig answers the plan's datagrams itself.
 *
 * What a module writes lands in `written`, what it reads comes from `readable`; both are by register address, and
 * neither changes the other (many registers read something else than what was written). With `card` set, registers are
 * those of that simulated card instead, at clock `clk`, which rig_cycle() lets run by one period.
 *
 *     struct module_rig *rig = rig_new(rig_image_7i96s(), "num_leds=2");
 *     rig_add(rig, &hm2_watchdog_type);
 *     rig_start(rig);
 *     rig_set(rig, "watchdog.timeout_ns", 1e6);
 *     rig_cycle(rig);
 *     assert_int_equal(rig_written(rig, 0x0C00), 99999);
 *     rig_free(rig);
 */
#ifndef MODULE_RIG_H
#define MODULE_RIG_H

#include <hm2/module.h>
#include <hm2/sim.h>

#define RIG_MODULES   32u
#define RIG_LOG       512u
#define RIG_PREFIX    "hm2_rig.0"
#define RIG_PERIOD_NS 1000000

/* ---- images ----------------------------------------------------------------------------------------------------- */

struct rig_header {
    uint32_t type, offset_modules, offset_pins;
    const char *board_name; /* 8 characters */
    uint32_t fpga_size, fpga_pins, io_ports, port_width, clock_low_hz, clock_high_hz;
    uint32_t instance_stride_1; /* 64 but for UARTs */
};

/* The twelve bytes of a module descriptor. */
struct rig_md {
    uint8_t gtag, version, clock_tag, instances;
    uint16_t base;
    uint8_t registers, strides;
    uint32_t multiple;
};

/* Fill an image. pins has pin_count words; the rest up to io_ports * port_width are plain I/O (0x03000000). */
void rig_compose(struct hm2_image *image, const struct rig_header *header, const struct rig_md *modules,
                 size_t module_count, const uint32_t *pins, size_t pin_count);
/* 7I96S, standard firmware (register map 5.4). */
const struct hm2_image *rig_image_7i96s(void);
/* 7I93 with SVST8_4IM2 cut to 48 pins, new map with DPLL (register map 5.1 and 5.2.1). */
const struct hm2_image *rig_image_7i93(void);
/* The 7I96S header (3 ports of 17, clocks 100 and 200 MHz) with other modules and pins. */
const struct hm2_image *rig_image_with(const struct rig_md *modules, size_t module_count, const uint32_t *pins,
                                       size_t pin_count);

/* ---- rig -------------------------------------------------------------------------------------------------------- */

struct rig_write {
    uint16_t address;
    uint32_t value;
};

struct module_rig {
    struct hm2_idrom idrom;
    struct hm2_config config;
    struct hm2_diag diag;
    struct hm2_plain_binder *plain;
    struct hm2_plan *plan;
    struct hm2_pin pins[HM2_MAX_PINS];
    struct hm2_setup setup;
    unsigned count;
    struct hm2_module modules[RIG_MODULES];
    uint32_t noticed[RIG_MODULES][HM2_NOTICES];
    struct hm2_cycle cycle;
    struct sim_card *card; /* or NULL; the test's own */
    int64_t clk;
    int64_t read_clk; /* clocks that each read of a register takes */
    /* the "card" otherwise */
    uint32_t readable[0x4000], written[0x4000]; /* [address / 4] */
    uint16_t timer[LBP16_TIMER_BYTES / 2];      /* space 4: plain memory */
    uint16_t rx_udp;
    struct rig_write log[RIG_LOG]; /* register writes of the last write datagram, in order */
    unsigned logged;
    bool lose_writes; /* write datagrams vanish */
    int peek_error;   /* what peek and poke return */
};

/* config as in config=; the image must be good. 4 LEDs on the board. */
struct module_rig *rig_new(const struct hm2_image *image, const char *config);
void rig_free(struct module_rig *rig);
/* Set a module up as a board does; the number of instances follows the config. Returns what setup() returned. */
int rig_try_add(struct module_rig *rig, const struct hm2_module_type *type);
/* The same, and it must succeed. */
struct hm2_module *rig_add(struct module_rig *rig, const struct hm2_module_type *type);
/* Every type of hm2_module_types that the image has (and raw when asked for), in the order of a board. */
void rig_add_all(struct module_rig *rig);
/* Freeze the plan, send the set-up of load time, read once and start the modules. */
void rig_start(struct module_rig *rig);
/* One request, reply, unpack; one pack and write. rig_cycle() does both and lets a period pass. */
void rig_read(struct module_rig *rig);
void rig_write_out(struct module_rig *rig);
void rig_cycle(struct module_rig *rig);
void rig_cycles(struct module_rig *rig, unsigned count);
void rig_set_period(struct module_rig *rig, int64_t period_ns);

uint32_t rig_written(const struct module_rig *rig, uint16_t address);
void rig_put(struct module_rig *rig, uint16_t address, uint32_t value);
/* Did the last write datagram write this register, and where in its order (0..)? -1 = no. The last one counts. */
int rig_position(const struct module_rig *rig, uint16_t address);
bool rig_wrote(const struct module_rig *rig, uint16_t address);

/* Points by name without the board's prefix; an unknown name fails the test. */
double rig_get(const struct module_rig *rig, const char *name);
void rig_set(struct module_rig *rig, const char *name, double value);
bool rig_has(const struct module_rig *rig, const char *name);
const struct hm2_plain_object *rig_object(const struct module_rig *rig, const char *name);

#endif
