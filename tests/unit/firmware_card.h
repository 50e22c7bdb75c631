/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A simulated card by itself, without a board, with firmware of the test data. */
#ifndef FIRMWARE_CARD_H
#define FIRMWARE_CARD_H

#include <hm2/sim.h>

/* A 7I93 with the firmware of a recording (its name for replay_firmware()); NULL = a 7I96S with the image that was
 * dumped. Fails the running test when it does not work. */
struct sim_card *firmware_card(const char *firmware);

#endif
