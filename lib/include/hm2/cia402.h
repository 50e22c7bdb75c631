/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A drive by its CANopen profile CiA 402 (IEC 61800-7-201), as the machine that commands it sees it: what the words
 * that go to and fro in process data mean, and which come next. No bus in it: the words come from anywhere.
 *
 * Pure arithmetic on the caller's memory, realtime safe. States, masks and commands are the profile's (sections "state
 * machine", "controlword", "statusword", "homing mode").
 */
#ifndef HM2_CIA402_H
#define HM2_CIA402_H

#include <stdbool.h>
#include <stdint.h>

#include <hm2/err.h>

enum hm2_cia402_state {
    HM2_CIA402_NOT_READY,
    HM2_CIA402_SWITCH_ON_DISABLED,
    HM2_CIA402_READY_TO_SWITCH_ON,
    HM2_CIA402_SWITCHED_ON,
    HM2_CIA402_OPERATION_ENABLED,
    HM2_CIA402_QUICK_STOP_ACTIVE,
    HM2_CIA402_FAULT_REACTION_ACTIVE,
    HM2_CIA402_FAULT,
    HM2_CIA402_UNKNOWN /* bits that stand for no state */
};

/* Modes of operation (object 6060h) that are commanded here. */
#define HM2_CIA402_PROFILE_VELOCITY 3
#define HM2_CIA402_HOMING           6
#define HM2_CIA402_CYCLIC_POSITION  8
#define HM2_CIA402_CYCLIC_VELOCITY  9

/* How long the command that resets a fault is held: longer than process data take to reach a drive. */
#define HM2_CIA402_RESET_NS INT64_C(100000000)

struct hm2_cia402_in {
    bool online;     /* what follows is the drive's, and new */
    bool enable;     /* a rising edge switches the drive on, 0 switches it off */
    bool quick_stop; /* stop along the drive's quick-stop ramp */
    bool reset;      /* a rising edge resets a fault */
    bool home;       /* while 1, in homing mode */
    uint16_t statusword;
    int32_t mode;       /* what is wanted while not homing */
    int32_t mode_shown; /* by the drive (6061h) */
    double position;    /* actual; units are the caller's */
    double position_command, velocity_command;
};

struct hm2_cia402_out {
    enum hm2_cia402_state state;
    uint16_t controlword;
    int32_t mode;
    double position_target; /* the actual position whenever the drive does not follow the command */
    double velocity_target; /* 0 whenever it does not */
    bool enabled;           /* operation enabled, as was asked for */
    bool fault;             /* of the drive; or it is not enabled although that is asked for, and enable must go to 0 */
    bool homing, homed, homing_error;
};

/* One drive; zero it at first. */
struct hm2_cia402 {
    bool enable_before, reset_before;
    bool wanted;  /* enable, since its edge, and nothing came between */
    bool tripped; /* something did */
    bool enabled_before;
    bool resetting;
    int64_t reset_ns;
    bool home_seen_moving, homed;
};

HM2_API enum hm2_cia402_state hm2_cia402_state(uint16_t statusword);

/* Nothing is enabled again by itself: after a fault, a quick stop, a drive that left "operation enabled" or that was
 * not online, enable must fall and rise. Until it falls, a drive that stops or is not online is told to do a quick
 * stop; then, to switch off. The first command after that starts from where the drive is. Commands that are no number
 * count as the actual position and as no velocity. now_ns is any clock that goes on steadily. */
HM2_API void hm2_cia402_step(struct hm2_cia402 *drive, const struct hm2_cia402_in *in, int64_t now_ns,
                             struct hm2_cia402_out *out);

#endif
