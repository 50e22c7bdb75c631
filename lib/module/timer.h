/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Selection of the DPLL timer that a module goes by. Private to lib/module. */
#ifndef HM2_MODULE_TIMER_H
#define HM2_MODULE_TIMER_H

#include <hm2/module.h>

/* A pin of a module that selects a timer, and its register. */
struct hm2_timer {
    hm2_s32_t *number; /* NULL without a DPLL: then there is no pin */
    const char *name;  /* of that pin; NULL: timer-number */
    int32_t seen;
    bool present; /* the card has the register; without it the pin has no effect */
    struct hm2_section section;
};

/* Word of a DPLL select register (register map 3.4, 3.5: [15] enable, [14:12] timer): -1 = no latching, 0 = the
 * reference, 1 to 4 = that timer. A number outside becomes 0 (hal-interface 2.7). Realtime safe. */
uint32_t hm2_timer_select(int32_t number);

/* True when the select register reg of md, one of those behind the last that the descriptor declares, is not a register
 * of another module. Only the newer address map has select registers; on the older one 0x3500 is the count of the muxed
 * encoders, where a write clears a count (register map 2.2, 3.5.6). */
bool hm2_timer_page_free(const struct hm2_idrom *idrom, const struct hm2_md *md, unsigned reg);

/* Register the section for select register reg of the module. Set-up time only. */
int HM2_MUST_CHECK hm2_timer_add(struct hm2_timer *timer, const struct hm2_module *module, struct hm2_setup *setup,
                                 unsigned reg);

/* Hand a changed pin to the plan; a number outside -1 to 4 is rewritten. Realtime safe. */
HM2_RARE void hm2_timer_change(struct hm2_timer *timer, const struct hm2_module *module);
static inline void hm2_timer_pack(struct hm2_timer *const timer, const struct hm2_module *const module)
{
    if (timer->number && *timer->number != timer->seen)
        hm2_timer_change(timer, module);
}

#endif
