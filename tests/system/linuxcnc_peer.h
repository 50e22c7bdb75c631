/* SPDX-License-Identifier: GPL-2.0-or-later */
/* LinuxCNC as host of a component, through the scripts linuxcnc-peer and halrun-user: whether it can run here, what the
 * scripts are told, and what they answer. */
#ifndef TEST_LINUXCNC_PEER_H
#define TEST_LINUXCNC_PEER_H

#include "talk.h"

/* False, and the reason printed as a skip, where LinuxCNC cannot load what this build made. */
bool linuxcnc_loads_ours(void);

/* The scripts are told by their environment. */
void linuxcnc_tell(const char *name, const char *value);

/* True, and the script's reason printed as a skip, when it has ended because something is missing on this machine. */
bool linuxcnc_skipped(struct process *run);

/* Wait for the end of a script that was started. False when it was skipped; no end, or a bad one, fails the test. */
bool linuxcnc_ends_well(struct process *run, int limit_ms);

/* Run a script until its end; its HAL file says a line that begins with `start` when all is well, which *line (may be
 * NULL) points at. False when it was skipped; anything else fails the test, which says `what` then. */
bool linuxcnc_run_to(struct process *run, const char *const *argv, int limit_ms, const char *start, const char *what,
                     const char **line);

/* HAL commands for LinuxCNC, with a simulated card of this type at 192.168.1.121 (hm2sim's options, NULL-terminated).
 * What they write to PEER_OUT is in the folder `out` at the end. False when it was skipped. */
bool linuxcnc_talk(struct talk *talk, const char *out, const char *card, const char *const *options);

#endif
