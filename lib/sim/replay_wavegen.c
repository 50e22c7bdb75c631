/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Start of the wavegen recordings. Their tests do not begin at power-up: what the table held, how much of a pulse was
 * collected, and when the next step was due, stands in no event. Only the first pulses tell; a table of one value
 * explains them all, with the collected part and the time of the step to be found.
 */
#include "replay_trace.h"
#include "sim_card.h"

#define QUARTERS 4u /* of a pulse: the values of the recordings are multiples of one */
#define QUARTER  0x400u
#define VALUE    0x800u

int replay_wavegen_prepare(struct replay_run *const run)
{
    const uint16_t density = (uint16_t)(run->start % QUARTERS * QUARTER);
    if (run->start > 0)
        sim_wavegen_start(run->card, 0, VALUE, density, (uint8_t)(run->start / QUARTERS));
    return 0;
}
