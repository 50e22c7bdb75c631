/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * hm2sim for system tests: cards on loopback addresses of this test's own, commands while they run, and a look at
 * their registers and pads. Failures end the test through Check.
 */
#ifndef TEST_SIMULATOR_H
#define TEST_SIMULATOR_H

#include <stdint.h>

#include "process.h"

#define SIMULATOR_CARDS 4u

struct simulator {
    struct process process;
    char address[SIMULATOR_CARDS][16]; /* of each card; the port is the usual one */
    char control[64];                  /* socket for commands */
};

/* Start it and wait until it is ready. args (NULL-terminated, may be NULL) are options of hm2sim; every "--card TYPE"
 * gets an address. Without --card there is one 7I96S. */
void simulator_start(struct simulator *sim, const char *const *args);
void simulator_stop(struct simulator *sim);

/* The answer to a command (hm2sim(1)); static storage. */
const char *simulator_ask(const struct simulator *sim, const char *command);
/* A command whose answer must be "ok". */
void simulator_do(const struct simulator *sim, const char *command);
/* What the card drives on a pin: '0', '1' or 'z'. */
char simulator_pad(const struct simulator *sim, unsigned card, unsigned io);
/* A HostMot2 register, over UDP like any client. */
uint32_t simulator_read(const struct simulator *sim, unsigned card, unsigned address);

/* False, and the reason printed as a skip, where LinuxCNC's own driver cannot be judge: it gives up when one of the
 * thousands of replies of its set-up comes late, and a sanitizer makes a card late. */
bool simulator_suits_linuxcnc(void);

#endif
