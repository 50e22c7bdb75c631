/* SPDX-License-Identifier: GPL-2.0-or-later */
/* What a DBC file has, on standard output. */
#ifndef HM2CAN_LIST_H
#define HM2CAN_LIST_H

#include <hm2/can.h>

struct listing {
    const char *file;
    const struct hm2_dbc *dbc;
    const struct hm2_diag *diag; /* warnings, or why there is no dbc */
    int node;                    /* as of hm2_dbc_node(), negative for none */
    bool floats;
};

/* "FILE: 3 messages, ..." */
void list_summary(const struct listing *listing);
void list_text(const struct listing *listing);
/* One object. */
void list_json(const struct listing *listing);

#endif
