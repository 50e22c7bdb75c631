/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A driver with a simulated card, both in this process and in virtual time: loaded into the small HAL host, its
 * functions called one by one, its points read and set by name, its register writes seen at the card's door.
 * One at a time; a process runs one driver in its life, as drivers keep state of their own.
 */
#ifndef TEST_DROPIN_DRIVER_H
#define TEST_DROPIN_DRIVER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/sim.h>

#define DRIVER_PERIOD_NS 1000000
#define DRIVER_MODULES   "/usr/lib/linuxcnc/modules"

enum driver_kind { DRIVER_LINUXCNC, DRIVER_OURS };

struct driver_point {
    const char *name; /* behind the card's prefix; whole when it is one of a 7I65 (mesa-7i65.0.*), or of the world
                         outside (7i65.volts.0 to 7, 7i65.enables: what has arrived at a 7I65) */
    int type;         /* hal_type_t */
    bool settable;    /* an input pin, or a parameter that may be written */
    volatile void *value;
};

struct driver {
    enum driver_kind kind;
    const char *parameter; /* of the module, besides board_ip and config: "debug=1"; or NULL */
    char prefix[32];       /* "hm2_7i96s.0." */
    const char *firmware;  /* of the card instead of the usual one: a file of tests/data; or NULL */
    enum sim_sources sources;
    const char *remote; /* daughter card at channel 0 of the first smart-serial port ("7i77"), or NULL */
    bool has_7i65;      /* at the card's first buffered SPI port, and its component is loaded, too */
    bool paced;         /* its processor takes its time, so that what is read depends on the place in the packet */
    struct sim_card *card;
    struct sim_net *net;
    struct sim_7i65 *servo; /* NULL without */
    double servo_volts[SIM_7I65_CHANNELS];
    uint32_t servo_enables;
    int64_t start_ns; /* of cycle 0 */
    unsigned cycle;
    struct driver_point *points;
    size_t point_count;
    /* Datagrams to the card are lost while set: those that read() sends, or those that write() sends. */
    bool lose_requests, lose_writes, in_write;
    /* Called for every register write that reaches the card; may be NULL. */
    void (*on_write)(void *context, uint16_t address, uint32_t value);
    void *context;
    char *messages; /* what driver and host say, NUL terminated */
    size_t messages_size;
};

/* Whether LinuxCNC's driver is installed. */
bool driver_available(enum driver_kind kind);
/* The files of a driver, NULL-terminated: full paths, in static storage. */
const char *const *driver_files(enum driver_kind kind);
/* Load. kind, parameter, firmware, sources, remote, has_7i65, paced, messages and on_write are set by the caller. False
 * when the load failed: the messages say why.
 */
bool driver_load(struct driver *driver, const char *card, const char *config);
void driver_unload(struct driver *driver);

/* Time passes to 100 us before the cycle: what happens to the card now is over when it begins. */
void driver_begin_cycle(struct driver *driver);
/* The functions of a cycle, at their times: read at its beginning, write when 40 % of the period are over. */
void driver_read(struct driver *driver);
void driver_write(struct driver *driver);

/* NULL when there is no such point. */
const struct driver_point *driver_find(const struct driver *driver, const char *name);
double driver_value(const struct driver_point *point);
void driver_set(const struct driver_point *point, double value);

#endif
