/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Terminal names of daughter boards, and of cards with terminals of their own (flash tool reference 2.6; the 7I49 by
 * its manual). The 7I65 is missing: no public list of its terminals was found. Constant tables; nothing here allocates.
 */
#ifndef HM2_TERMINALS_H
#define HM2_TERMINALS_H

#include <stddef.h>

#include <hm2/err.h>

struct hm2_terminals {
    const char *name; /* "7I48"; of a card, one table a connector: "7I96_0" */
    size_t count;
    const char *const *terminals; /* by pin of the connector */
};

HM2_API const struct hm2_terminals *hm2_terminals_find(const char *name); /* in any case; NULL = unknown */
HM2_API const struct hm2_terminals *hm2_terminals_at(size_t index);       /* NULL behind the last */

#endif
