/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Commands while hm2sim runs, one a datagram, on a Unix socket. The man page hm2sim(1) lists them. */
#ifndef HM2SIM_CONTROL_H
#define HM2SIM_CONTROL_H

#include "station.h"

#define CONTROL_REPLY_SIZE 4096u

/* Carry out a command; reply gets "ok", what was asked for, or "error: ...". True when the program shall end. */
bool control_command(char *command, struct station *stations, unsigned count, int64_t now_ns,
                     char reply[CONTROL_REPLY_SIZE]);

/* Socket at path (a socket that is left there is replaced). */
int HM2_MUST_CHECK control_open(const char *path, int *fd, struct hm2_diag *diag);
/* Take one datagram and answer it, when its sender can be answered. True when the program shall end. */
bool control_receive(int fd, struct station *stations, unsigned count, int64_t now_ns);

#endif
