/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What the files of the smart-serial model share. */
#ifndef SIM_SSERIAL_STATE_H
#define SIM_SSERIAL_STATE_H

#include "motor.h"
#include "sim_card.h"
#include "sserial.h"

#define SSERIAL_CHANNELS  8u
#define SSERIAL_MAX_PORTS 4u
#define SSERIAL_USERS     7u /* registers of SSerialB; SSerial has three */
#define SSERIAL_LOCALS    0x800u

/* Local faults and status (seed 003, "CS REGISTER AFTER START"). */
enum {
    SSERIAL_CRC = 0x01,
    SSERIAL_COOKIE = 0x02,
    SSERIAL_OVERRUN = 0x04,
    SSERIAL_TIMEOUT = 0x08,
    SSERIAL_EXTRA = 0x10,
    SSERIAL_BREAK = 0x20,
    SSERIAL_REMOTE_FAULT = 0x40,
    SSERIAL_TOO_MANY = 0x80,
};
#define SSERIAL_ERRORS 6u /* kinds that can be ordered: bits 5..0 */

enum {
    SSERIAL_STATUS_REMOTE_FAULT = 0x01,
    SSERIAL_STATUS_ERROR = 0x20,
    SSERIAL_STATUS_NO_ID = 0x40,
    SSERIAL_STATUS_NOT_READY = 0x80,
};

enum sserial_link { SSERIAL_STOPPED, SSERIAL_READY, SSERIAL_RUNNING, SSERIAL_SETUP, SSERIAL_FAILED };

struct sserial_channel {
    struct remote *remote;
    enum sim_cable cable;
    unsigned tx_io, rx_io; /* UINT_MAX: the firmware brings it to no pin, the remote sits at the module itself */
    unsigned ordered[SSERIAL_ERRORS];
    /* The firmware's side */
    enum sserial_link link;
    uint8_t faults, state, status, local; /* bytes 3..0 of the CS register */
    uint32_t user_in[SSERIAL_USERS];      /* as the host reads them */
    uint8_t errors;
    bool reached;    /* the message on its way comes to the remote */
    uint8_t pending; /* error of the message on its way: a local fault bit */
    uint8_t lbp_status;
    bool stale;    /* CS is reset when the next command comes */
    bool starting; /* by the START that is being carried out */
    /* The host's side */
    uint32_t cs_out, user_out[SSERIAL_USERS];
};

/* How the firmware takes commands. */
enum sserial_mode {
    SSERIAL_HELD,    /* in reset */
    SSERIAL_BOOTING, /* initialises */
    SSERIAL_IDLE,
    SSERIAL_BUSY,
    SSERIAL_SWALLOW, /* a STOP ALL came while it was busy: it stays, and the next other command is lost */
    SSERIAL_DEAF,    /* nothing is served any more */
};

struct sserial_port {
    enum sserial_mode mode;
    uint32_t command;
    uint8_t data, data_out; /* as the host reads it, as it wrote it */
    uint32_t running;       /* command being carried out */
    int64_t since, done;    /* ... from this edge on, and when it ends; also of the initialisation */
    int64_t aside;          /* SIM_NEVER, or when a STOP of channels, written meanwhile, is cleared */
    bool dropped;           /* initialising: the first command has been dropped */
    bool served;            /* a command since the initialisation */
    unsigned named;         /* channels of the last START */
    uint8_t result;         /* data register to come */
    uint8_t locals[SSERIAL_LOCALS];
    unsigned channel_count, users;
    struct sserial_channel channels[SSERIAL_CHANNELS];
};

#define SSERIAL_MAX_DRIVES 16u

struct sserial_drive {
    struct sim_drive drive;
    struct sim_motor motor;
};

struct sserial {
    unsigned count;
    struct sserial_port *ports;
    unsigned drive_count;
    struct sserial_drive drives[SSERIAL_MAX_DRIVES];
};

/* Local parameters of a channel (as recorded; baud and check: register map 3.8.2), and their values at first. */
#define SSERIAL_LOCAL_START  0x70u
#define SSERIAL_LOCAL_STRIDE 0x32u
enum {
    SSERIAL_LOCAL_CRC_COUNT = 0x14,
    SSERIAL_LOCAL_TIMEOUT_COUNT = 0x17,
    SSERIAL_LOCAL_ERROR_LIMIT = 0x1B,
    SSERIAL_LOCAL_CRC_CHECK = 0x1E,
    SSERIAL_LOCAL_TIMEOUT = 0x23,
    SSERIAL_LOCAL_GENERIC = 0x24,
    SSERIAL_LOCAL_BAUD = 0x2A,
    SSERIAL_LOCAL_IN_BYTES = 0x2E,
    SSERIAL_LOCAL_OUT_BYTES = 0x2F,
    SSERIAL_LOCAL_MEASURED = 0x30,
};
#define SSERIAL_BAUD        2500000u
#define SSERIAL_ERROR_LIMIT 20u
#define SSERIAL_TIMEOUT_2US 75u

static inline unsigned sserial_local(const unsigned channel, const unsigned parameter)
{
    return SSERIAL_LOCAL_START + channel * SSERIAL_LOCAL_STRIDE + parameter;
}

/* sserial_plug.c: the module that has this port, advanced to the card's present clk; *port becomes its instance. */
struct sim_module *sserial_module(struct sim_card *card, unsigned *port);

int64_t sserial_ns(const struct sim_module *m, int64_t clk);
/* Another output, or a fault: motors have run until this edge with what was there before. */
void sserial_turn(struct sim_module *m, int64_t clk);

/* sserial_channel.c. Mask: channels that a command is for. Each returns the clocks that it takes. */
void sserial_channels_reset(struct sserial_port *p);
int64_t sserial_start(struct sim_module *m, struct sserial_port *p, uint32_t command);
int64_t sserial_do_it(struct sim_module *m, struct sserial_port *p, unsigned mask);
/* START and DOIT end: registers get what the remotes said. */
void sserial_start_done(struct sim_module *m, struct sserial_port *p, int64_t clk);
void sserial_do_it_done(struct sim_module *m, struct sserial_port *p, int64_t clk);
void sserial_stop(struct sserial_port *p, unsigned mask);
void sserial_stop_all(struct sserial_port *p);
void sserial_freshen(struct sserial_port *p);
/* CS register of a channel, with the state it passes through during a START. */
uint32_t sserial_cs(const struct sserial_port *p, unsigned channel, int64_t clk);
/* The firmware has talked to remotes that wait for a first DOIT until this edge. */
void sserial_keep_alive(const struct sim_module *m, struct sserial_port *p, int64_t clk);
/* Watchdogs of the remotes: the first that will bite, and all that have until clk. */
int64_t sserial_next_bite(const struct sim_module *m, const struct sserial_port *p);
void sserial_bite(struct sim_module *m, struct sserial_port *p, int64_t clk);

#endif
