/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The elements of a transaction: names, types, places, scales. */
#ifndef MODBUS_ELEMENTS_H
#define MODBUS_ELEMENTS_H

#include <hm2/modbus.h>

#include "ini.h"

/* Fill tx->elements, element_count and words from PIN_NAMES or `count` (0 = NELEMENTS is not given), ELEMENT_TYPES and
 * INITIAL. Problems are told to ini. */
void elements_read(struct ini *ini, const char *section, unsigned count, struct hm2_modbus_transaction *tx);

#endif
