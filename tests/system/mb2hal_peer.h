/* SPDX-License-Identifier: GPL-2.0-or-later */
/* LinuxCNC's mb2hal, or a program that takes its place, under halrun, and its pins next to those of modbus_io. */
#ifndef TEST_MB2HAL_PEER_H
#define TEST_MB2HAL_PEER_H

#include "process.h"

struct mb2hal_pin {
    const char *name, *value; /* as halcmd getp prints it */
};

/* Start halrun with a command that loads ("loadusr -W mb2hal"), its file, `config` in `folder`, and more commands.
 * False when this machine cannot run it: what it printed says why. `until` ends with a pin without a name. */
bool mb2hal_start(struct process *halrun, const char *folder, const char *load, const char *config,
                  const char *commands, const struct mb2hal_pin *until);
/* Wait until all pins of `until` have had their value; the output then lists all pins. */
void mb2hal_finish(struct process *halrun, const char *folder);

/* How many of mb2hal's pins in this output are not in the other one, with type, direction and value; prints which.
 * Counters of errors count without their value. */
unsigned mb2hal_missing(const char *pins, const char *among);

#endif
