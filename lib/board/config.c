/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The config= string (hal-interface 1.2). */
#include <hm2/config.h>

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include <hm2/terminals.h>

#include "absenc_format.h"

#define SPACES    " \t\n\r\v\f"
#define SHOWN     60 /* characters of a token that a sentence quotes */
#define MAX_TOKEN 256u
#define MAX_COUNT 1000     /* more than any firmware can hold: instances are a byte, resolvers come in sixes */
#define MAX_BAUD  10000000 /* of smart serial */
#define MAX_TIMER 4        /* of the DPLL */
#define MAX_WIDTH 8        /* stepgen pins (hal-interface 1.2) */

static const char *const count_keys[HM2_CFG_COUNTS] = {
    [HM2_CFG_ENCODERS] = "num_encoders", [HM2_CFG_RESOLVERS] = "num_resolvers", [HM2_CFG_PWMGENS] = "num_pwmgens",
    [HM2_CFG_3PWMGENS] = "num_3pwmgens", [HM2_CFG_RCPWMGENS] = "num_rcpwmgens", [HM2_CFG_STEPGENS] = "num_stepgens",
    [HM2_CFG_INMUXS] = "num_inmuxs",     [HM2_CFG_INMS] = "num_inms",           [HM2_CFG_OUTMS] = "num_outms",
    [HM2_CFG_SSRS] = "num_ssrs",         [HM2_CFG_ONESHOTS] = "num_oneshots",   [HM2_CFG_PERIODMS] = "num_periodms",
    [HM2_CFG_XY2MODS] = "num_xy2mods",   [HM2_CFG_BSPIS] = "num_bspis",         [HM2_CFG_UARTS] = "num_uarts",
    [HM2_CFG_PKTUARTS] = "num_pktuarts", [HM2_CFG_LEDS] = "num_leds",           [HM2_CFG_DPLLS] = "num_dplls",
};

const char *hm2_config_key(const enum hm2_config_count which)
{
    return (unsigned)which < HM2_CFG_COUNTS ? count_keys[which] : "";
}

/* Mode 0 for the channels that the text leaves open. */
static void set_modes(char modes[HM2_CFG_SSERIAL_CHANNELS], const char *text)
{
    for (unsigned i = 0; i < HM2_CFG_SSERIAL_CHANNELS; i++)
        modes[i] = *text ? *text++ : '0';
}

void hm2_config_default(struct hm2_config *const config)
{
    memset(config, 0, sizeof *config);
    for (unsigned i = 0; i < HM2_CFG_COUNTS; i++)
        config->count[i] = HM2_CFG_ALL;
    config->stepgen_width = 2;
    config->sserial_baudrate = -1;
    for (unsigned i = 0; i < HM2_CFG_SSERIAL_PORTS; i++)
        set_modes(config->sserial_mode[i], "");
}

unsigned hm2_config_sserial_ports(const struct hm2_config *const config, const unsigned available)
{
    if (!config->sserial_given)
        return available;
    unsigned ports = 0;
    for (unsigned i = 0; i < HM2_CFG_SSERIAL_PORTS; i++)
        if (config->sserial_port_used[i])
            ports = i + 1;
    return ports < available ? ports : available;
}

/* ---- values ------------------------------------------------------------------------------------------------------ */

struct scan {
    struct hm2_config *config;
    struct hm2_diag *diag;
    const char *token; /* NUL terminated, for sentences */
    int err;
};

#define REFUSE(scan, ...) ((scan)->err = hm2_diag_add((scan)->diag, HM2_ERR_INVALID, __VA_ARGS__))

/* Like C's strtol with base 0: 0x10 is 16, 010 is 8, as in LinuxCNC. */
static bool take_number(struct scan *const scan, const char *const value, const long min, const long max,
                        long *const number)
{
    char *end;
    errno = 0;
    *number = strtol(value, &end, 0);
    if (errno == 0 && end != value && *end == '\0' && strchr(SPACES, *value) == NULL && *number >= min &&
        *number <= max)
        return true;
    REFUSE(scan, "config: \"%.*s\": a whole number from %ld to %ld is expected after \"=\", \"%.*s\" found", SHOWN,
           scan->token, min, max, SHOWN, value);
    return false;
}

static void take_count(struct scan *const scan, const unsigned which, const char *const value)
{
    long number;
    if (take_number(scan, value, HM2_CFG_ALL, MAX_COUNT, &number))
        scan->config->count[which] = (int)number;
}

static void take_width(struct scan *const scan, const unsigned unused, const char *const value)
{
    (void)unused;
    long number;
    if (take_number(scan, value, 1, MAX_WIDTH, &number))
        scan->config->stepgen_width = (unsigned)number;
}

static void take_raw(struct scan *const scan, const unsigned unused, const char *const value)
{
    (void)unused;
    (void)value;
    scan->config->enable_raw = true;
}

static void take_nothing(struct scan *const scan, const unsigned unused, const char *const value)
{
    (void)scan;
    (void)unused;
    (void)value;
}

/* ---- sserial_port_P=CCCCCCCC ------------------------------------------------------------------------------------- */

static void take_sserial(struct scan *const scan, const unsigned port, const char *const value)
{
    struct hm2_config *const config = scan->config;
    const size_t len = strlen(value);
    if (len == 0 || len > HM2_CFG_SSERIAL_CHANNELS || strspn(value, "0123456789x") != len) {
        REFUSE(
            scan,
            "config: \"%.*s\": 1 to %u characters are expected after \"=\", one per channel: a digit for the mode of "
            "the remote or x for a channel that is not used",
            SHOWN, scan->token, HM2_CFG_SSERIAL_CHANNELS);
        return;
    }
    config->sserial_given = config->sserial_port_given[port] = true;
    set_modes(config->sserial_mode[port], value);
    config->sserial_named[port] = (uint8_t)len;
    config->sserial_port_used[port] = strspn(value, "x") != len;
}

static void take_baudrate(struct scan *const scan, const unsigned unused, const char *const value)
{
    (void)unused;
    long number;
    if (take_number(scan, value, -1, MAX_BAUD, &number))
        scan->config->sserial_baudrate = (int)number;
}

static void take_serial_numbers(struct scan *const scan, const unsigned unused, const char *const value)
{
    (void)unused;
    (void)value;
    scan->config->use_serial_numbers = true;
}

static void take_adaptive(struct scan *const scan, const unsigned unused, const char *const value)
{
    (void)unused;
    (void)value;
    scan->config->adaptive_timeout = true;
}

static void take_second_request(struct scan *const scan, const unsigned unused, const char *const value)
{
    (void)unused;
    (void)value;
    scan->config->adaptive_timeout = scan->config->second_request = true;
}

static void take_pipelined(struct scan *const scan, const unsigned unused, const char *const value)
{
    (void)unused;
    long number;
    if (take_number(scan, value, 0, MAX_TIMER, &number))
        scan->config->pipelined = (unsigned)number;
}

/* Connectors count from 1, as for the flash tools. */
static void take_dbname(struct scan *const scan, const unsigned connector, const char *const value)
{
    const struct hm2_terminals *const terminals = hm2_terminals_find(value);
    if (connector == 0)
        REFUSE(scan, "config: \"%.*s\": connectors count from 1", SHOWN, scan->token);
    else if (!terminals)
        REFUSE(scan,
               "config: \"%.*s\": the terminals of a daughter board \"%.*s\" are not known; hm2flash --dbname1 with an "
               "unknown name lists the boards",
               SHOWN, scan->token, SHOWN, value);
    else
        scan->config->dbname[connector - 1] = terminals->name;
}

/* ---- ssi_chan_N=FORMAT and its kin ---------------------------------------------------------------------------------
 */

static void take_format(struct scan *const scan, char *const format, const char *const value, const bool builtin)
{
    const size_t len = strlen(value);
    if (len < HM2_CFG_FORMAT_SIZE && hm2_absenc_format_bits(builtin ? hm2_absenc_expand(value) : value) > 0) {
        memcpy(format, value, len + 1);
        return;
    }
    REFUSE(scan,
           "config: \"%.*s\": fields name%%<length><modifiers><type> are expected after \"=\", with lengths from 1 to "
           "%u and at most %u bits in all%s",
           SHOWN, scan->token, HM2_ABSENC_FIELD_BITS, HM2_ABSENC_BITS, builtin ? ", or " HM2_ABSENC_AA64 : "");
}

static void take_ssi(struct scan *const scan, const unsigned channel, const char *const value)
{
    take_format(scan, scan->config->ssi_format[channel], value, false);
}

static void take_biss(struct scan *const scan, const unsigned channel, const char *const value)
{
    take_format(scan, scan->config->biss_format[channel], value, false);
}

static void take_fanuc(struct scan *const scan, const unsigned channel, const char *const value)
{
    take_format(scan, scan->config->fanuc_format[channel], value, true);
}

/* ---- keys ----------------------------------------------------------------------------------------------------------
 */

struct key {
    const char *name;
    unsigned numbers; /* how many numbers may follow the name: key_0 .. key_{numbers-1}; 0 = none follows */
    bool has_value;
    void (*take)(struct scan *scan, unsigned number, const char *value);
};

static const struct key keys[] = {
    {"stepgen_width", 0, true, take_width},
    {"enable_raw", 0, false, take_raw},
    {"firmware", 0, true, take_nothing}, /* Ethernet cards boot from flash */
    {"sserial_baudrate", 0, true, take_baudrate},
    {"use_serial_numbers", 0, false, take_serial_numbers},
    {"pipelined", 0, true, take_pipelined},
    {"adaptive_timeout", 0, false, take_adaptive},
    {"second_request", 0, false, take_second_request},
    {"dbname", HM2_CFG_CONNECTORS + 1u, true, take_dbname},
    {"sserial_port_", HM2_CFG_SSERIAL_PORTS, true, take_sserial},
    {"ssi_chan_", HM2_CFG_CHANNELS, true, take_ssi},
    {"biss_chan_", HM2_CFG_CHANNELS, true, take_biss},
    {"fanuc_chan_", HM2_CFG_CHANNELS, true, take_fanuc},
};

/* The number behind a key's name: decimal digits up to the end. */
static bool key_number(const struct key *const key, const char *digits, unsigned *const number)
{
    const size_t len = strlen(digits);
    *number = 0;
    if (len == 0 || len > 3 || strspn(digits, "0123456789") != len)
        return false;
    for (; *digits; digits++)
        *number = *number * 10u + (unsigned)(*digits - '0');
    return *number < key->numbers;
}

static void take_key(struct scan *const scan, const struct key *const key, const char *const rest,
                     const char *const value)
{
    unsigned number = 0;
    if (key->numbers > 0 && !key_number(key, rest, &number))
        REFUSE(scan, "config: \"%.*s\": a number from 0 to %u is expected after \"%s\", \"%.*s\" found", SHOWN,
               scan->token, key->numbers - 1u, key->name, SHOWN, rest);
    else if (key->has_value != (value != NULL))
        REFUSE(scan, "config: \"%.*s\": %s", SHOWN, scan->token,
               key->has_value ? "\"=\" and a value are expected" : "no value is expected");
    else
        key->take(scan, number, value);
}

/* value is NULL when there was no "=". */
static void take_token(struct scan *const scan, const char *const name, const char *const value)
{
    for (unsigned i = 0; i < HM2_CFG_COUNTS; i++) {
        if (strcmp(name, count_keys[i]) != 0)
            continue;
        take_count(scan, i, value ? value : "");
        return;
    }
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++) {
        const size_t len = strlen(keys[i].name);
        if (strncmp(name, keys[i].name, len) != 0 || (keys[i].numbers == 0 && name[len] != '\0'))
            continue;
        take_key(scan, keys + i, name + len, value);
        return;
    }
    REFUSE(scan,
           "config: \"%.*s\" is not known; expected num_<modules>=N, stepgen_width=N, enable_raw, sserial_port_P=..., "
           "ssi_chan_N=..., biss_chan_N=... or fanuc_chan_N=...",
           SHOWN, scan->token);
}

static void scan_token(struct scan *const scan, const char *const text, const size_t len)
{
    char token[MAX_TOKEN], name[MAX_TOKEN];
    if (len >= sizeof token) {
        REFUSE(scan, "config: \"%.*s...\" has %zu characters, at most %u are expected", SHOWN, text, len,
               MAX_TOKEN - 1u);
        return;
    }
    memcpy(token, text, len);
    token[len] = '\0';
    memcpy(name, token, len + 1);
    char *const equals = strchr(name, '=');
    if (equals)
        *equals = '\0';
    scan->token = token;
    take_token(scan, name, equals ? equals + 1 : NULL);
    scan->token = NULL;
}

int hm2_config_parse(const char *text, struct hm2_config *const config, struct hm2_diag *const diag)
{
    struct scan scan = {.config = config, .diag = diag};
    hm2_config_default(config);
    if (!text)
        return 0;
    for (text += strspn(text, SPACES); *text; text += strspn(text, SPACES)) {
        const size_t len = strcspn(text, SPACES);
        scan_token(&scan, text, len);
        text += len;
    }
    return scan.err;
}
