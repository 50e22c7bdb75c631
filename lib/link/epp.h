/* SPDX-License-Identifier: LGPL-2.1-or-later */
#ifndef LINK_EPP_H
#define LINK_EPP_H

#include <hm2/epp.h>

static inline bool epp_is_read(const enum epp_kind kind)
{
    return kind == EPP_ADDRESS_READ || kind == EPP_DATA_READ;
}

static inline bool epp_is_address(const enum epp_kind kind)
{
    return kind == EPP_ADDRESS_WRITE || kind == EPP_ADDRESS_READ;
}

/* CLOCK_MONOTONIC, for the operation of that name. */
int64_t epp_monotonic_ns(struct epp *epp);

#endif
