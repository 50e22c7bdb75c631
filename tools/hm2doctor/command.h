/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Run a line of shell, waited for. */
#ifndef DOCTOR_COMMAND_H
#define DOCTOR_COMMAND_H

#include <stddef.h>

/* Exit status, 128 + signal, or -1 when it could not be started. With output, what it prints stands there, NUL
 * terminated and cut at cap, and its complaints are dropped; without, both go where this program's go. */
int command_run(const char *line, char *output, size_t cap);

#endif
