/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "timer.h"

#define SELECT_ENABLE 0x8000u
#define SELECT_SHIFT  12
#define TIMERS        4
#define PAGE_MASK     0xFF00u /* address bits 15:8 select the register (register map 1.1) */

static bool valid(const int32_t number)
{
    return number >= -1 && number <= TIMERS;
}

uint32_t hm2_timer_select(const int32_t number)
{
    if (number == -1)
        return 0;
    return SELECT_ENABLE | (valid(number) ? (uint32_t)number << SELECT_SHIFT : 0);
}

bool hm2_timer_page_free(const struct hm2_idrom *const idrom, const struct hm2_md *const md, const unsigned reg)
{
    const uint16_t page = hm2_md_address(md, reg, 0) & PAGE_MASK;
    for (unsigned m = 0; m < idrom->module_count; m++) {
        const struct hm2_md *const other = &idrom->modules[m];
        /* A module without an address, like the select pins of the muxed encoders, occupies nothing. */
        if (other->base == md->base || other->base == 0)
            continue;
        for (unsigned r = 0; r < other->registers; r++)
            if ((hm2_md_address(other, r, 0) & PAGE_MASK) == page)
                return false;
    }
    return true;
}

int hm2_timer_add(struct hm2_timer *const timer, const struct hm2_module *const module, struct hm2_setup *const setup,
                  const unsigned reg)
{
    timer->seen = -1;
    timer->present = true;
    return hm2_plan_add_setup(setup->plan, &timer->section, HM2_RANK_NORMAL, hm2_md_address(module->md, reg, 0), 1, 0,
                              setup->diag);
}

void hm2_timer_change(struct hm2_timer *const timer, const struct hm2_module *const module)
{
    if (!valid(*timer->number)) {
        hm2_notice_point(module, HM2_NOTICE_VALUE_CLAMPED, timer->name ? timer->name : "timer-number", HM2_NO_INSTANCE,
                         *timer->number);
        *timer->number = 0;
    }
    timer->seen = *timer->number;
    if (timer->present)
        hm2_section_set(&timer->section, 0, hm2_timer_select(timer->seen));
}
