/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* What a board asks of its DPLL for the pipelined cycle. Realtime safe. */
#ifndef HM2_MODULE_DPLL_H
#define HM2_MODULE_DPLL_H

#include <hm2/module.h>

/* How long behind the loop's reference timer 1..4 fires; 0 for a value that is no number, and without a DPLL. */
int64_t hm2_dpll_timer_ns(const struct hm2_module *module, unsigned timer);
/* At load: let it be at least this when nobody sets it. */
void hm2_dpll_offer_timer_ns(const struct hm2_module *module, unsigned timer, int64_t ns);
/* With the next write the loop begins anew: its reference is when that write arrives. */
void hm2_dpll_align(struct hm2_module *module);

#endif
