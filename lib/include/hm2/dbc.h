/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * DBC files: what messages a CAN network carries, and which signals lie where in them.
 *
 * The file's text is handed in; nothing here opens files. What is read: BU_, BO_ and SG_, BO_TX_BU_, VAL_,
 * SIG_VALTYPE_, SG_MUL_VAL_ (extended multiplexing), and of BA_DEF_, BA_DEF_DEF_ and BA_ the attributes
 *   VFrameFormat     of a message: the CAN FD formats (StandardCAN_FD, ExtendedCAN_FD)
 *   GenMsgCycleTime  of a message, in ms
 *   GenMsgSendType   of a message: cyclic, or on change ("OnChange", "OnWrite", "Spontaneous", with or without
 * repetition) GenSigStartValue of a signal: its raw value before anybody wrote it Everything else is read over. The
 * facts are those that Vector's format description gives and that cantools agrees with in the tests: Intel signals
 * count start from the least significant bit, Motorola signals start at their most significant bit; bit 31 of an
 * identifier marks an extended one, and 0xC0000000 is the identifier of the message without a home, whose signals
 * belong nowhere and which is left out.
 *
 * Reading allocates; the other functions do not and are realtime safe.
 */
#ifndef HM2_DBC_H
#define HM2_DBC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>

#define HM2_CAN_MAX_BYTES 64u /* of a CAN FD frame; 8 of a classic one */

/* Limits of a file; a larger one is HM2_ERR_NOSPACE. */
#define HM2_DBC_MAX_TEXT        (4u << 20)
#define HM2_DBC_MAX_NODES       256u
#define HM2_DBC_MAX_MESSAGES    2048u
#define HM2_DBC_MAX_SIGNALS     32768u
#define HM2_DBC_MAX_PER_MESSAGE 1024u /* signals */
#define HM2_DBC_MAX_VALUES      131072u
#define HM2_DBC_MAX_MUX         32768u /* ranges of multiplexor values */
#define HM2_DBC_MAX_MUX_DEPTH   8u     /* multiplexors above a signal */
#define HM2_DBC_NO_SIGNAL       UINT32_MAX
/* Receivers of a signal, as a set of nodes. The file's Vector__XXX (anybody) has the bit above the nodes. */
#define HM2_DBC_SET_WORDS (HM2_DBC_MAX_NODES / 32u + 1u)
#define HM2_DBC_ANYBODY   HM2_DBC_MAX_NODES

enum hm2_dbc_kind { HM2_DBC_UNSIGNED, HM2_DBC_SIGNED, HM2_DBC_FLOAT32, HM2_DBC_FLOAT64 };

struct hm2_dbc_signal {
    const char *name;
    const char *unit;
    uint16_t start; /* as in the file */
    uint16_t bits;  /* 1..64 */
    bool big_endian;
    enum hm2_dbc_kind kind;
    double scale, offset; /* physical = raw * scale + offset; scale is not 0 */
    double min, max;      /* physical; equal = none given */
    double start_value;   /* physical, before anybody wrote it */
    bool is_multiplexor;
    uint32_t multiplexor; /* index of the signal that says when this one is there; HM2_DBC_NO_SIGNAL = always */
    uint32_t first_mux, mux_count; /* of dbc->mux: values of the multiplexor */
    uint32_t first_value, values;  /* of dbc->values */
    uint32_t receivers;            /* index of dbc->sets */
    unsigned line;
};

struct hm2_dbc_mux {
    uint64_t first, last; /* raw, inclusive */
};

struct hm2_dbc_value {
    int64_t raw;
    const char *text;
};

struct hm2_dbc_message {
    const char *name;
    uint32_t id; /* 11 or 29 bits */
    bool extended, fd, on_change;
    uint8_t bytes;                       /* 0..8, or a length of CAN FD */
    uint32_t senders;                    /* index of dbc->sets: the one of BO_, and those of BO_TX_BU_ */
    uint32_t cycle_ms;                   /* 0 = not given */
    uint32_t first_signal, signal_count; /* of dbc->signals */
    unsigned line;
};

struct hm2_dbc {
    const char *nodes[HM2_DBC_MAX_NODES];
    uint32_t node_count;
    struct hm2_dbc_message *messages;
    uint32_t message_count;
    struct hm2_dbc_signal *signals;
    uint32_t signal_count;
    struct hm2_dbc_mux *mux;
    uint32_t mux_count;
    struct hm2_dbc_value *values;
    uint32_t value_count;
    uint32_t (*sets)[HM2_DBC_SET_WORDS];
    uint32_t set_count;
    char *strings; /* all names and texts */
};

/* Read a file's text. name is the file's name in sentences ("name:line: ..."). All problems that can be told apart are
 * collected in diag. On success *dbc is the caller's, to be freed. HM2_ERR_MALFORMED (syntax), HM2_ERR_RANGE (a number
 * that cannot be, a signal outside its message), HM2_ERR_INVALID (a name twice, an unknown name), HM2_ERR_NOSPACE,
 * HM2_ERR_NOMEM. Warnings: signals of a message that overlap. */
HM2_API int HM2_MUST_CHECK hm2_dbc_read(const char *text, size_t len, const char *name, struct hm2_dbc **dbc,
                                        struct hm2_diag *diag);
HM2_API void hm2_dbc_free(struct hm2_dbc *dbc);

/* Index of a node, HM2_DBC_ANYBODY for "Vector__XXX", or HM2_ERR_NOTFOUND. */
HM2_API int hm2_dbc_node(const struct hm2_dbc *dbc, const char *name);
/* Whether a node (or HM2_DBC_ANYBODY) belongs to a set. */
HM2_API bool hm2_dbc_has(const struct hm2_dbc *dbc, uint32_t set, unsigned node);
/* Whether there are frames of this length: 0 to 8, and with CAN FD 12, 16, 20, 24, 32, 48, 64. */
HM2_API bool hm2_can_length_exists(unsigned bytes, bool fd);

/* ---- signals in a frame; data has the length of the message ---------------------------------------------------------
 */

/* Bytes of a frame that the signal reaches into (1..64), or more than 64 when it leaves every frame. */
HM2_API unsigned hm2_dbc_signal_bytes(const struct hm2_dbc_signal *signal);
/* The bits of the signal, without sign extension. */
HM2_API uint64_t hm2_dbc_raw(const struct hm2_dbc_signal *signal, const uint8_t *data);
HM2_API void hm2_dbc_put_raw(const struct hm2_dbc_signal *signal, uint8_t *data, uint64_t raw);
/* Physical value. A float signal may bring NaN or an infinity. Integers above 2^53 are rounded, as doubles are. */
HM2_API double hm2_dbc_value(const struct hm2_dbc_signal *signal, const uint8_t *data);
/* Store a physical value, rounded to the nearest raw one; what is outside [min|max] or outside the bits becomes the
 * nearest that is not. False when value is NaN: data is left alone. */
HM2_API bool hm2_dbc_put_value(const struct hm2_dbc_signal *signal, uint8_t *data, double value);
/* Whether the signal is in this frame: its multiplexor, and those above it, have the right values. */
HM2_API bool hm2_dbc_present(const struct hm2_dbc *dbc, const struct hm2_dbc_signal *signal, const uint8_t *data);
/* Smallest and largest physical value that the bits can hold; for float signals those of the type. */
HM2_API void hm2_dbc_range(const struct hm2_dbc_signal *signal, double *low, double *high);

#endif
