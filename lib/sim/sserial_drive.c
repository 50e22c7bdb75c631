/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Motors whose drives take their speed from an analog output of a remote. */
#include "sim_qcounter.h"
#include "sserial_state.h"

#define UNIT_SHIFT 8u /* a follower's unit: drive, and the module's place in tags */

static const uint8_t tags[] = {HM2_GTAG_SSERIAL, HM2_GTAG_SSERIALB};

static double speed_wanted(const struct sserial *const s, const struct sim_drive *const d)
{
    double speed = 0;
    (void)!remote_speed(s->ports[d->port].channels[d->channel].remote, d->output, &speed); /* tried when it was made */
    return speed;
}

void sserial_turn(struct sim_module *const m, const int64_t clk)
{
    struct sserial *const s = m->state;
    for (unsigned i = 0; i < s->drive_count; i++) {
        struct sserial_drive *const d = &s->drives[i];
        sim_motor_turn(&d->motor, speed_wanted(s, &d->drive), clk, sim_clock_low_hz(m->card));
    }
}

/* For sim_follow. */
static int64_t position(struct sim_card *const card, const unsigned unit)
{
    struct sim_module *const m = sim_find(card, tags[unit >> UNIT_SHIFT]);
    if (!m)
        return 0;
    sserial_turn(m, m->clk);
    const struct sserial *const s = m->state;
    return sim_motor_position(&s->drives[unit & 0xFFu].motor);
}

int sim_card_drive_motor(struct sim_card *const card, const unsigned encoder, const struct sim_drive *const drive)
{
    struct sim_drive local = *drive;
    double unused;
    struct sim_module *const m = sserial_module(card, &local.port);
    const struct remote *const r = sim_sserial_remote(card, drive->port, drive->channel);
    if (!m || !r || remote_speed(r, drive->output, &unused))
        return HM2_ERR_NOTFOUND;
    if (!sim_motor_possible(drive->time_constant_s))
        return HM2_ERR_RANGE;
    struct sserial *const s = m->state;
    if (s->drive_count == SSERIAL_MAX_DRIVES)
        return HM2_ERR_NOSPACE;
    const unsigned place = m->md.gtag == tags[0] ? 0 : 1;
    s->drives[s->drive_count] =
        (struct sserial_drive){.drive = local, .motor = {.time_constant_s = drive->time_constant_s, .at = m->clk}};
    const struct sim_follow follow = {position, .unit = place << UNIT_SHIFT | s->drive_count,
                                      .num = drive->counts_per_s, .den = 1, .keeps = true};
    const int err = sim_qc_follow(card, encoder, &follow);
    if (!err)
        s->drive_count++;
    return err;
}
