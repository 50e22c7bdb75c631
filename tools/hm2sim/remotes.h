/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Smart-serial remotes of a simulated card: what the command line plugs, and what commands do to them. */
#ifndef HM2SIM_REMOTES_H
#define HM2SIM_REMOTES_H

#include "options.h"

int HM2_MUST_CHECK remotes_connect(struct sim_card *card, const struct card_options *options, uint64_t seed,
                                   struct hm2_diag *diag);
/* "PORT:CHANNEL", a verb and its arguments; count of them all. reply keeps what it is, or gets an answer or "error:
 * ...". */
void remotes_command(struct sim_card *card, const char *const *words, unsigned count, char *reply, size_t size);

#endif
