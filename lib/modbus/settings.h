/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The keys of a [TRANSACTION_NN] section as they stand in the file, before anything is made of them. */
#ifndef MODBUS_SETTINGS_H
#define MODBUS_SETTINGS_H

#include <hm2/modbus.h>

#include "ini.h"

enum { LINK_TCP, LINK_SERIAL };

#define NOT_GIVEN (-1.0)

/* Numbers and the values of words alike are doubles, so that one table reads them all. */
struct settings {
    double link_type, port, baud, data_bits, parity, stop_bits, rs485, rts, delay_ms;
    double unit, rate_hz, response_timeout_ms, byte_timeout_ms, debug;
    double retries, low_word_first, on_change, refresh_s;
    char host[64], device[128];
    /* Not taken over from the section before. */
    double first, count, function, enable_pin;
    char name[HM2_MODBUS_NAME_SIZE];
};

/* Values of transaction `number`: what the section says, else what the one before it had where the link is of the same
 * type, else the default. Problems are told to ini. */
void settings_read(struct ini *ini, const char *section, unsigned number, const struct settings *before,
                   struct settings *settings);

#endif
