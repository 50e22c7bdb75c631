/* SPDX-License-Identifier: GPL-2.0-or-later */
#ifndef HM2PPMCSIM_COMMANDS_H
#define HM2PPMCSIM_COMMANDS_H

#include <stdbool.h>
#include <stddef.h>

#include <hm2/sim_ppmc.h>

/* Carry out one line, from the command line or from standard input: "rate 2.0 1000". Writes the answer, "ok" or what
 * was asked for or "error: ...", and returns false after an error. */
bool command_run(struct sim_ppmc *bus, const char *line, char *answer, size_t size);

#endif
