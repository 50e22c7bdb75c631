/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Smart serial (SSLBP): the port of an FPGA card and the remotes behind it.
 *
 * Three layers, none of which knows how registers are reached:
 *
 *   port      set-up time, blocking with limits: reset, local parameters, START, remote reads and writes, discovery
 *   process   bits of the interface registers to values and back; realtime safe
 *   engine    the cycle: a state machine that is fed with the registers of each reply and says what to write; one step
 *             a cycle, realtime safe
 *
 * Sources: seed 003 (chapter SSLBP), hal-interface 4, register map 3.8 and the traces in tests/data/sslbp.
 */
#ifndef HM2_SSLBP_H
#define HM2_SSLBP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>

#define SSLBP_CHANNELS   8u
#define SSLBP_USER_WORDS 7u /* interface registers of a channel: 3, or 7 of module SSerialB */

/* Command register (seed 003, "COMMAND REGISTER"). */
#define SSLBP_IGNORE      0x80000000u /* the card ignores the write ("COMMAND REGISTER WRITE IGNORE") */
#define SSLBP_LOCAL_WRITE 0xA000u
#define SSLBP_RESET       0x4000u /* of the port's processor (register map 3.8.2) ... */
#define SSLBP_RELEASE     0x0001u /* ... and the end of it */
#define SSLBP_LOCAL_READ  0x2000u
#define SSLBP_DOIT        0x1000u
#define SSLBP_START_SETUP 0x0F00u
#define SSLBP_START       0x0900u
#define SSLBP_STOP        0x0800u /* with a channel mask; 0 = STOP ALL */

/* ---- CS register ------------------------------------------------------------------------------------------------ */

/* Seed 003, "CS REGISTER AFTER START" and "AFTER DOIT". */
enum sslbp_local_fault {
    SSLBP_CRC = 0x01,
    SSLBP_COOKIE = 0x02,
    SSLBP_OVERRUN = 0x04,
    SSLBP_TIMEOUT = 0x08,
    SSLBP_EXTRA = 0x10,
    SSLBP_BREAK = 0x20,
    SSLBP_FAULT = 0x40,
    SSLBP_TOO_MANY = 0x80,
};
enum sslbp_state_bit { SSLBP_HAS_FAULT = 0x01, SSLBP_COM_ERROR = 0x20, SSLBP_NO_REMOTE = 0x40, SSLBP_NOT_READY = 0x80 };
enum sslbp_remote_fault {
    SSLBP_WATCHDOG = 0x01,
    SSLBP_NO_ENABLE = 0x02,
    SSLBP_OVER_TEMP = 0x04,
    SSLBP_OVER_CURRENT = 0x08,
    SSLBP_HIGH_VOLTAGE = 0x10,
    SSLBP_LOW_VOLTAGE = 0x20,
    SSLBP_ILLEGAL_MODE = 0x40,
    SSLBP_LBP_COM = 0x80,
};

struct sslbp_status {
    uint8_t local;  /* enum sslbp_local_fault as they stand, old ones too */
    uint8_t live;   /* those of them that tell about the last transfer */
    uint8_t status; /* enum sslbp_state_bit */
    uint8_t state;  /* of the channel's state machine, for debugging */
    uint8_t remote; /* enum sslbp_remote_fault; 0 when the register does not hold them */
};

/* Take a CS register apart. Local faults are sticky: bits 0 to 5 mean something only while the status says
 * communication error, bits 6 and 7 never do by themselves (hal-interface 4.1). The remote's faults count only while
 * the status says so, and before the first DOIT only from firmware 29 on. Realtime safe. */
HM2_API struct sslbp_status sslbp_status(uint32_t cs, unsigned minor, bool after_doit);
/* "time-out, too many errors; no remote answers; remote: watchdog" or "no fault". Returns text. */
HM2_API const char *sslbp_status_text(const struct sslbp_status *status, char *text, size_t size);

/* ---- port: set-up time ------------------------------------------------------------------------------------------ */

/* How registers are reached. Every call of read or write is confirmed, 0 or negative enum hm2_err. */
struct sslbp_bus {
    void *access;
    int (*read)(void *access, uint16_t address, unsigned words, uint32_t *values);
    int (*write)(void *access, uint16_t address, unsigned words, const uint32_t *values);
    int64_t (*now_ns)(void *access);
};

struct sslbp_port {
    struct sslbp_bus bus;
    const char *name; /* for messages: "hm2_7i96s.0: smart-serial port 0" */
    struct hm2_diag *diag;
    uint16_t command, data, cs, user[SSLBP_USER_WORDS]; /* addresses; those of channel c are 4 * c further */
    unsigned users;                                     /* interface registers of a channel */
    /* filled by sslbp_port_open() */
    uint8_t major, minor, channels;
};

struct hm2_md;

/* Addresses of an instance of the module (register map 3.8.1). */
HM2_API void sslbp_port_place(struct sslbp_port *port, const struct hm2_md *md, unsigned instance);
/* Reset the port, wait for its firmware and check that it is SSLBP. HM2_ERR_MISMATCH for anything else,
 * HM2_ERR_TIMEOUT when the firmware does not start; diag tells. */
HM2_API int HM2_MUST_CHECK sslbp_port_open(struct sslbp_port *port);
/* One command: wait until the register is clear, write it, wait until the firmware has cleared it; *data receives the
 * data register (may be NULL). A STOP ALL is written at once. */
HM2_API int HM2_MUST_CHECK sslbp_port_command(const struct sslbp_port *port, uint32_t command, int64_t limit_ns,
                                              uint32_t *data);
HM2_API int HM2_MUST_CHECK sslbp_local_read(const struct sslbp_port *port, uint16_t address, uint8_t *value);
HM2_API int HM2_MUST_CHECK sslbp_local_write(const struct sslbp_port *port, uint16_t address, uint8_t value);
/* Give every channel another baud rate; only firmware 34 and above can (HM2_ERR_UNSUPPORTED). */
HM2_API int HM2_MUST_CHECK sslbp_port_baud(const struct sslbp_port *port, uint32_t baud);
HM2_API int HM2_MUST_CHECK sslbp_port_stop(const struct sslbp_port *port);
/* STOP ALL, the remotes' modes, START (or set-up START) of the channels in mask. *failed receives the channels that
 * did not start. */
HM2_API int HM2_MUST_CHECK sslbp_port_start(const struct sslbp_port *port, unsigned mask, bool setup,
                                            const uint8_t modes[SSLBP_CHANNELS], unsigned *failed);
HM2_API int HM2_MUST_CHECK sslbp_port_cs(const struct sslbp_port *port, unsigned channel, uint32_t *cs);

/* What START tells about a remote (seed 003, "INTERFACE AND CS REGISTER DATA AT START"). */
struct sslbp_identity {
    uint32_t unit;
    uint32_t name;       /* four characters, the first in bits 7..0 */
    uint16_t ptoc, gtoc; /* 0 = cannot be discovered */
};

HM2_API int HM2_MUST_CHECK sslbp_identify(const struct sslbp_port *port, unsigned channel,
                                          struct sslbp_identity *identity);
/* The name as HAL shows it ("7i77"): second character in lower case, blanks at the end cut, everything that is neither
 * letter nor digit replaced by '-'. */
HM2_API void sslbp_card_name(const struct sslbp_identity *identity, char name[5]);

/* Read or write 1, 2, 4 or 8 bytes of a remote in set-up mode (seed 003, "REMOTE READ EXAMPLE"). */
HM2_API int HM2_MUST_CHECK sslbp_remote_read(const struct sslbp_port *port, unsigned channel, uint16_t address,
                                             unsigned bytes, uint64_t *value);
HM2_API int HM2_MUST_CHECK sslbp_remote_write(const struct sslbp_port *port, unsigned channel, uint16_t address,
                                              unsigned bytes, uint64_t value);
/* What reads and writes mean from now on: 1 non-volatile parameters, 2 flash, 0 neither (register map 3.8.6). */
HM2_API int HM2_MUST_CHECK sslbp_select_memory(const struct sslbp_port *port, unsigned channel, uint8_t memory);
/* A local LBP read, such as DF for the cookie. */
HM2_API int HM2_MUST_CHECK sslbp_remote_local(const struct sslbp_port *port, unsigned channel, uint8_t code,
                                              uint8_t *value);

/* ---- tables of a remote ----------------------------------------------------------------------------------------- */

enum sslbp_type {
    SSLBP_PAD = 0x00,
    SSLBP_BITS = 0x01,
    SSLBP_UNSIGNED = 0x02,
    SSLBP_SIGNED = 0x03,
    SSLBP_NV_UNSIGNED = 0x04,
    SSLBP_NV_SIGNED = 0x05,
    SSLBP_STREAM = 0x06,
    SSLBP_BOOLEAN = 0x07,
    SSLBP_ENCODER = 0x08,
    SSLBP_FLOAT = 0x10,
    SSLBP_NV_FLOAT = 0x11,
    SSLBP_ENCODER_H = 0x18, /* upper part of a counter whose lower part is the ENCODER_L field before it */
    SSLBP_ENCODER_L = 0x28,
};
enum sslbp_direction { SSLBP_INPUT = 0x00, SSLBP_BOTH = 0x40, SSLBP_OUTPUT = 0x80 };

#define SSLBP_TEXT_SIZE   49u /* 48 characters (hal-interface 4.4) */
#define SSLBP_PROCESS_MAX 96u
#define SSLBP_GLOBAL_MAX  96u
#define SSLBP_MODE_MAX    16u

/* Process data descriptor, record 0xA0 (seed 003, "PROCESS DATA DESCRIPTOR"). */
struct sslbp_field {
    uint8_t bits, type, direction; /* enum sslbp_type, enum sslbp_direction */
    double min, max;               /* finite, and not equal: 0 and 1 are put in their place */
    uint16_t address;
    char unit[SSLBP_TEXT_SIZE], name[SSLBP_TEXT_SIZE]; /* lower case; fit for HAL names */
};

/* Mode descriptor, record 0xB0. */
struct sslbp_mode {
    uint8_t index, kind; /* kind 0 = hardware, 1 = software */
    char name[SSLBP_TEXT_SIZE];
};

struct sslbp_tables {
    unsigned process_count, global_count, mode_count;
    unsigned in_bits, out_bits; /* of the process data */
    struct sslbp_field process[SSLBP_PROCESS_MAX];
    struct sslbp_field global[SSLBP_GLOBAL_MAX]; /* without those that are process data too */
    struct sslbp_mode mode[SSLBP_MODE_MAX];
};

/* Memory of a remote: read 1, 2 or 4 bytes, little endian. */
struct sslbp_memory {
    void *access;
    int (*read)(void *access, uint16_t address, unsigned bytes, uint32_t *value);
};

/* Follow both tables of contents. user_bits is what the interface registers hold in each direction. HM2_ERR_MALFORMED
 * with the place in diag for records that make no sense; name is the remote's, for messages. */
HM2_API int HM2_MUST_CHECK sslbp_read_tables(const struct sslbp_memory *memory, const struct sslbp_identity *identity,
                                             unsigned user_bits, const char *name, struct sslbp_tables *tables,
                                             struct hm2_diag *diag);
/* The same for a remote of a port in set-up mode. */
HM2_API int HM2_MUST_CHECK sslbp_discover(const struct sslbp_port *port, unsigned channel,
                                          const struct sslbp_identity *identity, const char *name,
                                          struct sslbp_tables *tables);
/* What a remote of a port in set-up mode says of itself, for lists that people read: all records of its global table in
 * their order, in tables->global and tables->mode, with texts as the remote has them (what cannot be printed becomes
 * "?"). Nothing is checked beyond the limits of the tables: bits may be 0 to 255, type anything. */
HM2_API int HM2_MUST_CHECK sslbp_list(const struct sslbp_port *port, unsigned channel,
                                      const struct sslbp_identity *identity, const char *name,
                                      struct sslbp_tables *tables);
HM2_API int HM2_MUST_CHECK sslbp_read_list(const struct sslbp_memory *memory, const struct sslbp_identity *identity,
                                           const char *name, struct sslbp_tables *tables, struct hm2_diag *diag);
/* Bytes that a parameter occupies: 1, 2, 4 or 8. Realtime safe. */
HM2_API unsigned sslbp_field_bytes(const struct sslbp_field *field);
HM2_API bool sslbp_is_nonvolatile(const struct sslbp_field *field);
HM2_API bool sslbp_is_signed(const struct sslbp_field *field);

/* ---- process data ----------------------------------------------------------------------------------------------- */

/* bits (1..64) of words from bit at on, and back. Words beyond are never touched: at + bits <= 32 * words. Realtime
 * safe, as all below. */
HM2_API uint64_t sslbp_get_bits(const uint32_t *words, unsigned at, unsigned bits);
HM2_API void sslbp_put_bits(uint32_t *words, unsigned at, unsigned bits, uint64_t value);
/* The lowest bits (1..64) as a two's complement number. */
HM2_API int64_t sslbp_sign_extend(uint64_t raw, unsigned bits);

/* Full scale is max, as LinuxCNC scales; the manual's formula, which adds min, gives the same for min = 0
 * (hal-interface 2.19). What cannot be converted (NaN, a scale of 0) becomes 0. */
HM2_API double sslbp_from_unsigned(uint64_t raw, unsigned bits, double full_scale);
HM2_API double sslbp_from_signed(uint64_t raw, unsigned bits, double full_scale);
HM2_API uint64_t sslbp_to_unsigned(double value, unsigned bits, double full_scale);
HM2_API uint64_t sslbp_to_signed(double value, unsigned bits, double full_scale);
/* bits is 32 or 64. */
HM2_API double sslbp_from_float(uint64_t raw, unsigned bits);
HM2_API uint64_t sslbp_to_float(double value, unsigned bits);

/* ---- engine: the cycle ------------------------------------------------------------------------------------------ */

/* As pin port_state shows them (hal-interface 2.19). */
enum sslbp_port_state {
    SSLBP_IDLE = 0,
    SSLBP_STARTING = 2,
    SSLBP_RUNNING = 3,
    SSLBP_STOPPING = 4,
    SSLBP_WAITS_FOR_STOP = 5,
    SSLBP_ERROR = 10,
};

/* What happened to a channel, until sslbp_engine_take() is called again. */
enum sslbp_event {
    SSLBP_EVENT_NONE,
    SSLBP_EVENT_LOST,        /* too many failed transfers: the remote is stopped */
    SSLBP_EVENT_NOT_STARTED, /* START failed on it */
    SSLBP_EVENT_OTHER,       /* another remote than at load answers; it is not driven */
    SSLBP_EVENT_BACK,        /* it answers again and is driven again */
};

/* Facts of a reply and wishes of the host. */
struct sslbp_reply {
    uint32_t command, data;
    const uint32_t *cs;        /* [SSLBP_CHANNELS], by channel */
    const uint32_t (*user)[3]; /* [SSLBP_CHANNELS]: interface registers 0..2 */
    bool write_lost;           /* the card did not carry out our last write */
    bool early;                /* read in the packet of our last write (a turn): what it started may not be over */
    bool in_order;             /* of these: our write before it was the last one that the card had carried out */
    int64_t now_ns;            /* when the request was sent; early: when the registers were read */
};

struct sslbp_wish {
    bool run;
    bool hold; /* the card's outputs are off (watchdog, restart): nothing is sent, and everything starts anew after */
    bool restart; /* restart by itself */
    uint32_t fault_inc, fault_dec, fault_lim;
    int64_t now_ns;
};

/* A parameter to write in set-up mode. */
struct sslbp_job {
    uint8_t channel, bytes;
    bool nonvolatile;
    uint16_t address;
    uint64_t value;
};

enum sslbp_job_state { SSLBP_JOB_NONE, SSLBP_JOB_WAITS, SSLBP_JOB_DONE, SSLBP_JOB_FAILED };

struct sslbp_channel {
    struct sslbp_identity identity; /* at load */
    uint8_t mode;
    bool started;    /* by the last START, as the same remote */
    bool lost;       /* stopped because of failures */
    bool failing;    /* its last transfer failed */
    uint32_t bucket; /* of failures */
    uint32_t good;   /* transfers in succession that it answered */
    uint32_t errors; /* failed transfers since load */
    uint32_t cs;     /* last read after a command */
    enum sslbp_event event;
};

enum sslbp_step {
    SSLBP_STEP_OFF,     /* run = 0 or on hold */
    SSLBP_STEP_SCAN,    /* idle, the host looks for parameters to write */
    SSLBP_STEP_RESET,   /* of a port whose command register is stuck */
    SSLBP_STEP_RELEASE, /* end of the reset */
    SSLBP_STEP_HALT,    /* STOP ALL before a START */
    SSLBP_STEP_START,
    SSLBP_STEP_RUN,
    SSLBP_STEP_STOP, /* run went to 0, or too many failures */
    SSLBP_STEP_FAILED,
    SSLBP_STEP_JOB_HALT,
    SSLBP_STEP_JOB_START,
    SSLBP_STEP_JOB_OPEN,
    SSLBP_STEP_JOB_WRITE,
    SSLBP_STEP_JOB_CLOSE,
    SSLBP_STEP_JOB_END, /* STOP ALL */
    SSLBP_STEPS
};

/* What is known of the write with the last command: it was the last one, one or more followed and no reply came, or a
 * reply has told. */
enum sslbp_age { SSLBP_AGE_LAST, SSLBP_AGE_SECOND, SSLBP_AGE_UNKNOWN, SSLBP_AGE_KNOWN };

struct sslbp_engine {
    /* set by the owner */
    uint8_t mask; /* channels with a remote */
    uint8_t minor;
    struct sslbp_channel channel[SSLBP_CHANNELS];
    /* inside */
    enum sslbp_step step;
    bool after_stop_failed; /* a STOP leads to SSLBP_STEP_FAILED */
    bool fresh;             /* a reply was taken since the last write */
    bool clear;             /* it showed a clear command register */
    bool unfinished;        /* it was early, and the DOIT of its own packet under way: no failure */
    bool sent;              /* the command of this step is with the card */
    uint8_t age;            /* enum sslbp_age */
    bool scanned;           /* no parameter is left to write */
    bool held;
    uint8_t exchanged; /* channels of the DOIT that is under way */
    int64_t sent_ns, since_ns, retry_ns, backoff_ns;
    uint32_t bucket; /* of DOITs that were not finished in time */
    struct sslbp_job job;
    enum sslbp_job_state job_state;
    /* for pins */
    uint32_t skipped, restarts;
    int64_t doit_ns; /* from the write to the first request that found the last DOIT finished */
    int64_t left_ns; /* of the time a command may take */
};

/* What to write in this cycle. */
struct sslbp_orders {
    uint32_t command; /* complete; bit 31 set when nothing must happen */
    uint8_t outputs;  /* channels whose outputs are to be packed anew; the words of others stay as they are ... */
    uint8_t silent;   /* ... but for these, whose words become 0 */
    bool job;         /* CS and interface registers 0 and 1 of job_channel are job_cs and job_value in this write */
    uint8_t job_channel;
    uint32_t job_cs;
    uint64_t job_value;
};

/* Zero, with the owner's members set by the caller afterwards. */
HM2_API void sslbp_engine_init(struct sslbp_engine *engine);
/* A fresh reply. Returns the channels whose inputs are new: nothing else may be shown as such. */
HM2_API unsigned sslbp_engine_take(struct sslbp_engine *engine, const struct sslbp_reply *reply,
                                   const struct sslbp_wish *wish);
/* Once a cycle, before the write is packed. */
HM2_API struct sslbp_orders sslbp_engine_next(struct sslbp_engine *engine, const struct sslbp_wish *wish);
/* The card has lost its state: start from the beginning. */
HM2_API void sslbp_engine_restart(struct sslbp_engine *engine);
HM2_API enum sslbp_port_state sslbp_engine_state(const struct sslbp_engine *engine);
/* In SSLBP_STEP_SCAN: write a parameter, or end the scan. job_state tells how it went. */
HM2_API void sslbp_engine_job(struct sslbp_engine *engine, const struct sslbp_job *job);
HM2_API void sslbp_engine_scanned(struct sslbp_engine *engine);
/* What pin fault-count shows: the fullest of all buckets. */
HM2_API uint32_t sslbp_engine_faults(const struct sslbp_engine *engine);

#endif
