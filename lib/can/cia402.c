/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A drive by its profile CiA 402. */
#include <hm2/cia402.h>

/* ---- what the words mean ------------------------------------------------------------------------------------------
 */

static const struct {
    uint16_t mask, bits;
    enum hm2_cia402_state state;
} states[] = {
    {0x4F, 0x00, HM2_CIA402_NOT_READY},
    {0x4F, 0x40, HM2_CIA402_SWITCH_ON_DISABLED},
    {0x6F, 0x21, HM2_CIA402_READY_TO_SWITCH_ON},
    {0x6F, 0x23, HM2_CIA402_SWITCHED_ON},
    {0x6F, 0x27, HM2_CIA402_OPERATION_ENABLED},
    {0x6F, 0x07, HM2_CIA402_QUICK_STOP_ACTIVE},
    {0x4F, 0x0F, HM2_CIA402_FAULT_REACTION_ACTIVE},
    {0x4F, 0x08, HM2_CIA402_FAULT},
};

enum hm2_cia402_state hm2_cia402_state(const uint16_t statusword)
{
    for (unsigned i = 0; i < sizeof states / sizeof states[0]; i++)
        if ((statusword & states[i].mask) == states[i].bits)
            return states[i].state;
    return HM2_CIA402_UNKNOWN;
}

#define DISABLE_VOLTAGE  0x00u
#define QUICK_STOP       0x02u
#define SHUTDOWN         0x06u
#define SWITCH_ON        0x07u /* "disable operation" where it is enabled */
#define ENABLE_OPERATION 0x0Fu
#define START_HOMING     0x10u
#define RESET_FAULT      0x80u

#define TARGET_REACHED  0x0400u
#define HOMING_ATTAINED 0x1000u
#define HOMING_ERROR    0x2000u
#define HOMING_DONE     (TARGET_REACHED | HOMING_ATTAINED)

/* The way up, and the way down as far as "ready to switch on". States without a line: no voltage. */
static const uint8_t commands[HM2_CIA402_UNKNOWN + 1][2] = {
    [HM2_CIA402_SWITCH_ON_DISABLED] = {DISABLE_VOLTAGE, SHUTDOWN},
    [HM2_CIA402_READY_TO_SWITCH_ON] = {SHUTDOWN, SWITCH_ON},
    [HM2_CIA402_SWITCHED_ON] = {SHUTDOWN, ENABLE_OPERATION},
    [HM2_CIA402_OPERATION_ENABLED] = {SWITCH_ON, ENABLE_OPERATION},
};

/* ---- what is wanted -----------------------------------------------------------------------------------------------
 */

static bool is_faulty(const enum hm2_cia402_state state)
{
    return state == HM2_CIA402_FAULT || state == HM2_CIA402_FAULT_REACTION_ACTIVE;
}

static void decide(struct hm2_cia402 *const drive, const struct hm2_cia402_in *const in,
                   const enum hm2_cia402_state state)
{
    const bool left = drive->enabled_before && state != HM2_CIA402_OPERATION_ENABLED;
    if (in->enable && !drive->enable_before)
        drive->wanted = true;
    if (!in->enable)
        drive->wanted = drive->tripped = false;
    else if (!in->online || in->quick_stop || left || is_faulty(state)) {
        drive->tripped = true;
        drive->wanted = false;
    }
    drive->enable_before = in->enable;
}

static bool resets(struct hm2_cia402 *const drive, const struct hm2_cia402_in *const in,
                   const enum hm2_cia402_state state, const int64_t now_ns)
{
    if (in->reset && !drive->reset_before) {
        drive->resetting = true;
        drive->reset_ns = now_ns;
    }
    drive->reset_before = in->reset;
    if (state != HM2_CIA402_FAULT || now_ns - drive->reset_ns >= HM2_CIA402_RESET_NS)
        drive->resetting = false;
    return drive->resetting;
}

/* What cannot be heard may hear: it shall not coast, but stop along its ramp, and may end that by itself. */
static uint16_t command(const struct hm2_cia402 *const drive, const struct hm2_cia402_in *const in,
                        const enum hm2_cia402_state state)
{
    if (!in->online || state == HM2_CIA402_QUICK_STOP_ACTIVE)
        return in->quick_stop || drive->tripped ? QUICK_STOP : DISABLE_VOLTAGE;
    if (in->quick_stop && state == HM2_CIA402_OPERATION_ENABLED)
        return QUICK_STOP;
    return commands[state][drive->wanted];
}

/* ---- moves --------------------------------------------------------------------------------------------------------
 */

/* "Attained" of an earlier run must not count: it counts when the drive has shown that it is on its way. */
static void home(struct hm2_cia402 *const drive, const struct hm2_cia402_in *const in, struct hm2_cia402_out *const out)
{
    if (!in->home || !out->enabled || in->mode_shown != HM2_CIA402_HOMING) {
        drive->home_seen_moving = false;
        if (in->home || !in->online)
            drive->homed = false;
        return;
    }
    const uint16_t bits = in->statusword & (HOMING_DONE | HOMING_ERROR);
    out->controlword |= START_HOMING;
    drive->home_seen_moving = drive->home_seen_moving || (bits & HOMING_DONE) != HOMING_DONE;
    out->homing_error = (bits & HOMING_ERROR) != 0;
    drive->homed = drive->home_seen_moving && bits == HOMING_DONE;
    out->homing = !drive->homed && !out->homing_error;
}

static bool is_number(const double value)
{
    return value - value == 0.0;
}

static void aim(const struct hm2_cia402_in *const in, struct hm2_cia402_out *const out)
{
    const bool follows = out->enabled && !in->home && in->mode_shown == in->mode;
    const bool positions = in->mode == HM2_CIA402_CYCLIC_POSITION;
    const bool turns = in->mode == HM2_CIA402_CYCLIC_VELOCITY || in->mode == HM2_CIA402_PROFILE_VELOCITY;
    if (follows && positions && is_number(in->position_command))
        out->position_target = in->position_command;
    if (follows && turns && is_number(in->velocity_command))
        out->velocity_target = in->velocity_command;
}

void hm2_cia402_step(struct hm2_cia402 *const drive, const struct hm2_cia402_in *const in, const int64_t now_ns,
                     struct hm2_cia402_out *const out)
{
    const enum hm2_cia402_state state = in->online ? hm2_cia402_state(in->statusword) : HM2_CIA402_UNKNOWN;
    decide(drive, in, state);
    *out = (struct hm2_cia402_out){.state = state,
                                   .controlword = command(drive, in, state),
                                   .mode = in->home ? HM2_CIA402_HOMING : in->mode,
                                   .position_target = in->position,
                                   .enabled = drive->wanted && state == HM2_CIA402_OPERATION_ENABLED,
                                   .fault = is_faulty(state) || drive->tripped};
    if (resets(drive, in, state, now_ns))
        out->controlword = RESET_FAULT;
    home(drive, in, out);
    aim(in, out);
    out->homed = drive->homed;
    drive->enabled_before = out->enabled;
}
