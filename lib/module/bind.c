/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "bind.h"

#include <stdio.h>
#include <string.h>

#define PAGE_WORDS 64u /* 100h bytes of address space a register kind */

int hm2_bind_item(const struct hm2_setup *const setup, const struct hm2_point_group *const group, void *const base,
                  const unsigned unit, const unsigned item)
{
    const size_t plain = strcspn(group->prefix, "#");
    const size_t hashes = strspn(group->prefix + plain, "#");
    char prefix[HM2_NAME_SIZE];
    int len = snprintf(prefix, sizeof prefix, "%s.%.*s", setup->prefix, (int)plain, group->prefix);
    if (hashes && len >= 0 && (size_t)len < sizeof prefix)
        len += snprintf(prefix + len, sizeof prefix - (size_t)len, "%0*u%s", (int)hashes, unit,
                        group->prefix + plain + hashes);
    if (len < 0 || (size_t)len >= sizeof prefix)
        return hm2_diag_add(setup->diag, HM2_ERR_NOSPACE, "the name %s... is longer than %u characters", prefix,
                            HM2_NAME_SIZE - 1);
    return hm2_bind_points(setup->binder, group->points, group->count, base, prefix, item, setup->diag);
}

int hm2_bind_group(const struct hm2_setup *const setup, const struct hm2_point_group *const group, void *const base,
                   const unsigned index)
{
    return hm2_bind_item(setup, group, base, index, index);
}

void *hm2_setup_alloc(const struct hm2_setup *const setup, const size_t size)
{
    void *const memory = setup->binder->alloc(setup->binder, size);
    if (!memory)
        (void)hm2_diag_add(setup->diag, HM2_ERR_NOMEM, "%s: the host has no memory left for %zu bytes of module data",
                           setup->prefix, size);
    return memory;
}

int hm2_check_page(const struct hm2_module *const module, const struct hm2_setup *const setup, const char *const what)
{
    if (module->instances <= PAGE_WORDS)
        return 0;
    return hm2_diag_add(setup->diag, HM2_ERR_MISMATCH, "%s: the firmware has %u %s; a register page holds at most %u",
                        setup->prefix, module->instances, what, PAGE_WORDS);
}
