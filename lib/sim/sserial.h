/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Smart-serial ports of a simulated card, and what is plugged into them. Ports count from 0 over all instances of the
 * module; channels are those of a port. Every call acts at the card's present clk.
 */
#ifndef SIM_SSERIAL_H
#define SIM_SSERIAL_H

#include "remote.h"

/* What can be plugged, NULL-terminated: daughter cards of one processor or, as a 7I77, of two in a row. */
const char *const *sim_sserial_cards(void);
/* Plug a daughter card, or a single processor (remote_names()), from this channel on. serial: number on its label.
 * NOTFOUND: no such card, port or channel; STATE: something is plugged there. */
int HM2_MUST_CHECK sim_sserial_plug(struct sim_card *card, unsigned port, unsigned channel, const char *name,
                                    uint32_t serial, struct hm2_diag *diag);
/* The remote at a channel, its time as far as the card's; NULL when there is none. Owned by the card. */
struct remote *sim_sserial_remote(struct sim_card *card, unsigned port, unsigned channel);
/* The cable of a channel: as it should be, with the line from the remote broken, or pulled. */
enum sim_cable { SIM_CABLE_IN, SIM_CABLE_ONE_WAY, SIM_CABLE_OUT };
int HM2_MUST_CHECK sim_sserial_cable(struct sim_card *card, unsigned port, unsigned channel, enum sim_cable cable);
/* The remote loses its power for a moment. */
int HM2_MUST_CHECK sim_sserial_power_cycle(struct sim_card *card, unsigned port, unsigned channel);

/* Errors to come on a channel's line, in the answers to the next `count` messages: "crc", "cookie" (seen when a port
 * starts), "overrun", "timeout", "extra", "break". INVALID for another name. */
int HM2_MUST_CHECK sim_sserial_error(struct sim_card *card, unsigned port, unsigned channel, const char *error,
                                     unsigned count);

/*
 * A drive and motor at an analog output of a remote, with an encoder of the card (plain or multiplexed) on the shaft.
 * Speed goes to counts_per_s at full output with a time constant, and to 0 while the enable output of the drive is off
 * or the remote has a fault.
 */
struct sim_drive {
    unsigned port, channel;
    const char *output;     /* field of the remote, such as "AnalogOut0". Kept: must outlive the card */
    int32_t counts_per_s;   /* at full output; negative turns it round */
    double time_constant_s; /* of its inertia; 0 = none */
};

int HM2_MUST_CHECK sim_card_drive_motor(struct sim_card *card, unsigned encoder, const struct sim_drive *drive);

#endif
