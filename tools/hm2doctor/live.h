/* SPDX-License-Identifier: GPL-2.0-or-later */
/* What no file of a running computer holds: questions to the kernel. */
#ifndef DOCTOR_LIVE_H
#define DOCTOR_LIVE_H

#include <stdbool.h>
#include <stddef.h>

/* Answers in lines "name value":
 *   ethtool/INTERFACE   driver, rx-usecs, tx-usecs, adaptive-rx, eee, gro, lro, channels
 *   limits              rtprio and memlock of this process, soft limits; -1 = unlimited
 *   firewall            what "nft list ruleset" prints
 *   traffic/INTERFACE   packets: those of a second, in both directions, in which this program sends nothing
 *   arp/INTERFACE/ADDRESS  reply: the MAC address of each device that answers to a question for the address
 * False when there is no answer. */
bool live_ask(const char *question, char *text, size_t cap);

#endif
