/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The config= string of a card: LinuxCNC's grammar (hal-interface 1.2), one table of keys.
 */
#ifndef HM2_CONFIG_H
#define HM2_CONFIG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>

enum hm2_config_count {
    HM2_CFG_ENCODERS,
    HM2_CFG_RESOLVERS,
    HM2_CFG_PWMGENS,
    HM2_CFG_3PWMGENS,
    HM2_CFG_RCPWMGENS,
    HM2_CFG_STEPGENS,
    HM2_CFG_INMUXS,
    HM2_CFG_INMS,
    HM2_CFG_OUTMS,
    HM2_CFG_SSRS,
    HM2_CFG_ONESHOTS,
    HM2_CFG_PERIODMS,
    HM2_CFG_XY2MODS,
    HM2_CFG_BSPIS,
    HM2_CFG_UARTS,
    HM2_CFG_PKTUARTS,
    HM2_CFG_LEDS,
    HM2_CFG_DPLLS,
    HM2_CFG_COUNTS
};

#define HM2_CFG_ALL              (-1) /* not given: take everything the firmware has */
#define HM2_CFG_SSERIAL_PORTS    4u
#define HM2_CFG_SSERIAL_CHANNELS 8u
#define HM2_CFG_CHANNELS         32u
#define HM2_CFG_FORMAT_SIZE      128u
#define HM2_CFG_CONNECTORS       4u

struct hm2_config {
    int count[HM2_CFG_COUNTS]; /* HM2_CFG_ALL or 0.. */
    unsigned stepgen_width;    /* 1..8, default 2 */
    bool enable_raw;
    bool sserial_given;                                                 /* any sserial_port_ token seen */
    char sserial_mode[HM2_CFG_SSERIAL_PORTS][HM2_CFG_SSERIAL_CHANNELS]; /* '0'..'9', 'x', default '0' */
    bool sserial_port_given[HM2_CFG_SSERIAL_PORTS];
    bool sserial_port_used[HM2_CFG_SSERIAL_PORTS]; /* a token with at least one digit was seen */
    uint8_t sserial_named[HM2_CFG_SSERIAL_PORTS];  /* channels that the token names; the rest have their default */
    int sserial_baudrate;                          /* -1 = as the firmware has it */
    bool use_serial_numbers;                       /* names of smart-serial remotes by unit number */
    unsigned pipelined;                            /* DPLL timer of the pipelined cycle, 1..4; 0 = plain cycles */
    bool adaptive_timeout;                         /* replies are given up when they are later than usual */
    bool second_request;                           /* and are then asked for once more; implies adaptive_timeout */
    const char *dbname[HM2_CFG_CONNECTORS];        /* daughter boards as hm2_terminals_find() has them, or NULL */
    char ssi_format[HM2_CFG_CHANNELS][HM2_CFG_FORMAT_SIZE];
    char biss_format[HM2_CFG_CHANNELS][HM2_CFG_FORMAT_SIZE];
    char fanuc_format[HM2_CFG_CHANNELS][HM2_CFG_FORMAT_SIZE];
};

/* Set everything to what an empty string means. */
HM2_API void hm2_config_default(struct hm2_config *config);
/* text may be NULL or empty. Unlike LinuxCNC, trailing garbage, negative counts (but -1 = all) and unknown characters
 * are refused; every problem of the string is reported, with the token. A key given twice counts as given last.
 * Returns 0 or HM2_ERR_INVALID; *config is then not to be used. */
HM2_API int HM2_MUST_CHECK hm2_config_parse(const char *text, struct hm2_config *config, struct hm2_diag *diag);
/* Key of a count as the user writes it ("num_stepgens"). */
HM2_API const char *hm2_config_key(enum hm2_config_count which);
/* Smart-serial ports to use out of those the firmware has: all without a sserial_port_ token; otherwise up to the
 * highest port whose token has a digit, so that "sserial_port_0=xxxxxxxx" alone means none (hal-interface 1.2). */
HM2_API unsigned hm2_config_sserial_ports(const struct hm2_config *config, unsigned available);

#endif
