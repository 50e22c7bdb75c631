/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A simulated card that is programmed again and again from the same state, in virtual time, while the power goes or the
 * network is bad, and what must hold then: it starts the old, the new or the fallback image, whole, and a second run
 * brings it to what was wanted.
 */
#ifndef FLASH_TORTURE_H
#define FLASH_TORTURE_H

#include <hm2/flash.h>
#include <hm2/sim_flash.h>

enum torture_kind {
    TORTURE_WRITE,
    TORTURE_WRITE_FALLBACK,
    TORTURE_RESTORE,
    TORTURE_VERIFY,       /* of the user image that is there */
    TORTURE_VERIFY_OTHER, /* of one that is not: HM2_ERR_MISMATCH */
    TORTURE_BACKUP,
};

struct torture_setup {
    enum torture_kind kind;
    const char *profile;
    size_t late_bytes; /* of the images differ from those that are there, 0 = everything does */
    size_t bytes;      /* of an image, about; 0 = as real ones */
    uint8_t flash_id;  /* of the chip; 0 = as delivered */
};

#define TORTURE_ERASES 8u

/* A sector erase of an undisturbed run. */
struct torture_erase {
    uint64_t operation, datagram; /* its numbers, from 1 */
};

struct torture {
    struct torture_setup setup;
    struct sim_card *sim;
    struct sim_net *net;
    struct link *link;                       /* that the command uses: the net's, or one of the test's above it */
    uint8_t *flash, *before, *wanted, *dump; /* whole chips */
    size_t size;
    uint8_t *file; /* that is written */
    struct flash_image image;
    uint32_t filler_at; /* behind the image to the end of its page: no part of it; 0 = none */
    struct flash_options options;
    struct hm2_diag diag;
    /* Of an undisturbed run: */
    int result;
    uint64_t operations, datagrams; /* datagrams that the card took */
    uint64_t erases_seen;           /* so far, of the chip */
    struct torture_erase erase[TORTURE_ERASES];
    unsigned erase_count;
};

/* FLASH_TORTURE=N makes N times as many runs; 1 by default. */
unsigned torture_factor(void);

struct torture *torture_new(const struct torture_setup *setup);
void torture_free(struct torture *torture);

/* Find out again what an undisturbed run does, which the link and the chip's times change. */
void torture_undisturbed(struct torture *torture);

/* As at the beginning, without faults. */
void torture_reset(struct torture *torture);
/* The command, from identification on; its result, HM2_ERR_MISMATCH when what was read is not what it should be. */
int torture_run(struct torture *torture);
/* Whatever is on its way arrives. */
void torture_settle(struct torture *torture);
/* Off and on, faults mended. */
void torture_power_up(struct torture *torture);
/* Fails the test when the card would not start, or holds anything but images that it had or was to get. */
void torture_check_starts(const struct torture *torture, const char *what, uint64_t number);
/* Fails the test when the flash does not hold what was wanted. */
void torture_check_wanted(const struct torture *torture, const char *what, uint64_t number);

#endif
