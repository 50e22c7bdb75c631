/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Binding of a module's point groups. Private to lib/module. */
#ifndef HM2_MODULE_BIND_H
#define HM2_MODULE_BIND_H

#include <hm2/module.h>

/* One row of a module's list of groups. */
#define HM2_GROUP(where, table, when)                                                                        \
    {                                                                                                        \
        .prefix = (where), .points = (table), .count = sizeof(table) / sizeof(table)[0], .condition = (when) \
    }

/* Create the points of a documented group for the struct at base. The group's prefix ("stepgen.##") is put behind the
 * board's, and the run of '#' in it is replaced by index. Set-up time only. */
int HM2_MUST_CHECK hm2_bind_group(const struct hm2_setup *setup, const struct hm2_point_group *group, void *base,
                                  unsigned index);

/* The same where the names of the rows have an index of their own ("ssr.##" with "out-##"): unit goes into the prefix,
 * item into the names. */
int HM2_MUST_CHECK hm2_bind_item(const struct hm2_setup *setup, const struct hm2_point_group *group, void *base,
                                 unsigned unit, unsigned item);

/* Zeroed memory from the host, or NULL with the reason in the set-up's diag. */
void *hm2_setup_alloc(const struct hm2_setup *setup, size_t size);
/* HM2_ERR_MISMATCH, and a diagnosis, for more instances than a register page has words; what: their name, plural. */
int hm2_check_page(const struct hm2_module *module, const struct hm2_setup *setup, const char *what);

#endif
