/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A smart-serial remote as its own processor sees it: memory with tables of contents, parameters, process data, faults
 * and watchdog (seed 003, "PROCESS DATA DISCOVERY", "LBP", "FIELD I/O WATCHDOG AND FAULTS"). How bytes come to it, by
 * the SSLBP firmware of a simulated card or by serial LBP, is its callers' affair, and so are time (nanoseconds of any
 * clock that does not go back) and baud rate.
 *
 * Nothing here allocates but remote_new(), and nothing is realtime safe in the strict sense. One thread at a time.
 */
#ifndef SIM_REMOTE_H
#define SIM_REMOTE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>
#include <hm2/sim.h>

#define REMOTE_MEMORY    0x1000u /* bytes; what is above reads 0 and takes no writes */
#define REMOTE_MAX_BYTES 32u     /* of process data each way, the byte of faults not counted */
#define REMOTE_COOKIE    0x5Au

/* The fault byte (seed 003, "CS REGISTER AFTER DOIT"). */
enum remote_fault {
    REMOTE_FAULT_WATCHDOG = 0x01,
    REMOTE_FAULT_NO_ENABLE = 0x02,
    REMOTE_FAULT_OVER_TEMPERATURE = 0x04,
    REMOTE_FAULT_OVER_CURRENT = 0x08,
    REMOTE_FAULT_OVER_VOLTAGE = 0x10,
    REMOTE_FAULT_UNDER_VOLTAGE = 0x20,
    REMOTE_FAULT_ILLEGAL_MODE = 0x40,
    REMOTE_FAULT_LBP = 0x80,
};

struct remote;

/* Names that remote_new() knows, NULL-terminated: one for each processor, so a 7I77 is two. */
const char *const *remote_names(void);

/* HM2_ERR_NOTFOUND (with a sentence), HM2_ERR_NOMEM. serial: number on the label, lower 24 bits of the unit number. */
int HM2_MUST_CHECK remote_new(struct remote **remote, const char *name, uint32_t serial, struct hm2_diag *diag);
void remote_free(struct remote *remote);
/* Power came back: working parameters as the non-volatile ones say, outputs off, watchdog fault set. remote_new() does
 * this, too, at time 0. */
void remote_power_up(struct remote *remote, int64_t now_ns);

/* ---- what LBP commands ask --------------------------------------------------------------------------------------- */

const char *remote_card_name(const struct remote *remote); /* four characters (LBP D0..D3) */
uint32_t remote_unit_number(const struct remote *remote);  /* RPC BC: so the recorded firmware asks, not BB */
uint32_t remote_baud(const struct remote *remote);         /* since power-up; 115200 with the set-up jumper */
/* Software mode (LBP E6 as recorded). One that it does not have is a fault and leaves the old one. */
void remote_set_mode(struct remote *remote, uint8_t mode);
/* RPC BB, for the mode that is set. Bytes of process data without the byte of faults. */
uint16_t remote_ptoc(const struct remote *remote);
uint16_t remote_gtoc(const struct remote *remote);
unsigned remote_in_bytes(const struct remote *remote);  /* to the host */
unsigned remote_out_bytes(const struct remote *remote); /* from the host */

uint8_t remote_faults(const struct remote *remote);
/* LBP E7: faults that last come again at once. */
void remote_clear_faults(struct remote *remote, uint8_t mask);
/* LBP EC: reads and writes then mean the EEPROM (1) or the flash (2); 0 ends that. */
void remote_set_nv_access(struct remote *remote, uint8_t memory);
/* A byte at an address. False: nothing is written there (LBP status "invalid write"). */
uint8_t remote_read(struct remote *remote, uint16_t address);
bool remote_write(struct remote *remote, uint16_t address, uint8_t value);

/* Any communication keeps the watchdog from biting; one that has bitten by then must have been told (remote_advance()).
 */
void remote_feed(struct remote *remote, int64_t now_ns);
/* RPC BD: out has remote_out_bytes(), in gets the fault byte and remote_in_bytes(). Inputs are sampled before the
 * outputs take their new values, as recorded. Feeds the watchdog. */
void remote_exchange(struct remote *remote, int64_t now_ns, const uint8_t *out, uint8_t *in);

/* ---- time -------------------------------------------------------------------------------------------------------- */

/* The watchdog bites when it is due by now. */
void remote_advance(struct remote *remote, int64_t now_ns);
/* When it will; INT64_MAX = it has, or is disabled. */
int64_t remote_bite_ns(const struct remote *remote);

/* ---- the world outside ------------------------------------------------------------------------------------------- */

/*
 * Fields by the names that discovery gives, in any case ("Input", "AnalogIn0", "FieldVoltage", "Enc0"): what the world
 * does to an input, and what an output does to the world, which is 0 while there is a fault. Numbers are in the unit of
 * the field; bits, booleans and encoders are raw. NOTFOUND for a name that it does not have, RANGE for a number that
 * the field cannot hold (nothing changes then).
 */
int HM2_MUST_CHECK remote_set(struct remote *remote, const char *field, double value);
int HM2_MUST_CHECK remote_get(struct remote *remote, const char *field, double *value);
/* The speed that a drive at a numeric output is told, as part of full scale, -1 to 1; 0 while its enable is off. */
int HM2_MUST_CHECK remote_speed(const struct remote *remote, const char *output, double *speed);
/* Terminal of a field output: high or floating, of sinking cards low or floating. SIM_FLOAT when there is none. */
enum sim_level remote_terminal(struct remote *remote, unsigned output);
/* Outputs (bits) that are shorted: they trip as soon as they are on. */
void remote_short(struct remote *remote, uint32_t outputs);
/* The set-up jumper (seed 003, "SETUP/OPERATE MODE"); off at first. */
void remote_set_jumper(struct remote *remote, bool setup);
/* Faults of other causes, as long as the cause lasts. */
void remote_hold_faults(struct remote *remote, uint8_t faults);

#endif
