/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The configuration flash of simulated cards: how long it takes, how it fails, when the power goes, and which image the
 * FPGA would start from it; image files to put there.
 *
 * Chip: M25P16 command set, NOR semantics (programming clears bits, erasing a sector sets them; a page wraps at its
 * end). Boot rule: seeds 000 and 001, "FALLBACK" and "RECONFIGURATION"; flash tool reference 3.8 and 3.13. Where the
 * sources are silent the model takes the harsh side: a Xilinx card without a boot block starts nothing.
 */
#ifndef HM2_SIM_FLASH_H
#define HM2_SIM_FLASH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>
#include <hm2/sim.h>

/* ---- times ------------------------------------------------------------------------------------------------------ */

struct sim_flash_times {
    const char *name;
    int64_t program_ns, erase_ns; /* of a page, of a sector */
};

/* "none", "m25p16", "m25p16-max", "w25q16", "w25q16-max" (flash tool reference 4.3); NULL = unknown name. */
HM2_API const struct sim_flash_times *sim_flash_times_of(const char *name);
/* A new card's chip takes no time. */
HM2_API void sim_card_flash_times(struct sim_card *card, const struct sim_flash_times *times);

/* ---- memory, power, boot ---------------------------------------------------------------------------------------- */

/* Let the chip keep its bytes in the caller's memory, of exactly its size, which must outlive the card. The card has
 * started from what is there, if it does. HM2_ERR_RANGE for another size. */
HM2_API int HM2_MUST_CHECK sim_card_flash_memory(struct sim_card *card, uint8_t *bytes, size_t size);

enum sim_boot {
    SIM_BOOT_NOTHING,     /* no image: the card is deaf; only JTAG helps */
    SIM_BOOT_USER,        /* the image of the user area */
    SIM_BOOT_FALLBACK,    /* that of the fallback area */
    SIM_BOOT_OTHER_BOARD, /* an image that loads, made for another board: as deaf */
};

/* What would start at power-up with the flash as it is, and what runs now (NOTHING also while there is no power). */
HM2_API enum sim_boot sim_card_would_boot(const struct sim_card *card);
HM2_API enum sim_boot sim_card_running(const struct sim_card *card);
HM2_API const char *sim_boot_name(enum sim_boot boot);

/* No power until sim_card_power_cycle(). */
HM2_API void sim_card_power_off(struct sim_card *card);
/* Address jumpers, 0 to 3 (flash tool reference 2.4), read when the card starts. 3 makes Efinix cards start the
 * fallback image. The card keeps its address: the network around it is the caller's. */
HM2_API void sim_card_jumpers(struct sim_card *card, unsigned jumpers);
/* Start images, too, that are complete but carry a check sum that is not the simulation's: those of real cards, whose
 * own check sums are not computed here. Off in a new card. */
HM2_API void sim_card_trust_images(struct sim_card *card, bool trust);

/* ---- faults ----------------------------------------------------------------------------------------------------- */

#define SIM_FLASH_BAD_BITS 16u

/* Bits of one byte that are not cleared by the next so many programs, or not set by so many erases. */
struct sim_flash_bad {
    uint32_t address;
    uint8_t mask;
    unsigned programs, erases; /* UINT_MAX = for ever */
};

struct sim_flash_faults {
    /* Operations (page programs and sector erases that the chip accepts) are counted from 1 since this was set. */
    uint64_t stuck_at;  /* this one never ends: the card is deaf until it is switched off and on. 0 = none */
    uint64_t cut_at;    /* the power goes during this one. 0 = none */
    unsigned cut_bytes; /* of the page programmed before, or 1/256 parts of the erase done before */
    uint64_t seed;      /* of the bits that a cut leaves in between */
    unsigned bad_count;
    struct sim_flash_bad bad[SIM_FLASH_BAD_BITS];
};

HM2_API void sim_card_flash_faults(struct sim_card *card, const struct sim_flash_faults *faults);

struct sim_flash_counts {
    uint64_t operations;       /* since the faults were set, as they count */
    uint64_t programs, erases; /* since the card was made */
    uint64_t sector0_erases;
    uint32_t last_erase; /* address */
};
HM2_API struct sim_flash_counts sim_card_flash_counts(const struct sim_card *card);

/* ---- image files ------------------------------------------------------------------------------------------------ */

enum sim_area { SIM_AREA_USER, SIM_AREA_FALLBACK };

/* What is wrong with the packets of a Xilinx image. */
enum sim_file_fault {
    SIM_FILE_MULTIBOOT = 1,
    SIM_FILE_NO_RESET_ON_ERROR = 2,
    SIM_FILE_NO_CRC = 4,
    SIM_FILE_NO_SYNC = 8, /* Efinix, too */
};

/* An image file with the header of a real one and a body of our own. Fields left 0 or NULL are right for the board. */
struct sim_flash_file {
    const char *profile; /* of the card that it is for */
    enum sim_area area;
    uint64_t seed;       /* of the body */
    uint64_t late_seed;  /* of its last late_bytes, when these are not 0 */
    size_t late_bytes;   /* the check sum stands behind them */
    size_t bytes;        /* of the payload, about (Xilinx); of the file (Efinix). 0 = as real ones */
    const char *part;    /* key b, or Device */
    const char *design;  /* key a */
    const char *project; /* Efinix */
    const char *series, *mode, *width, *padded_bits;
    const char *board; /* that the body is made for: the card's own name */
    uint32_t idcode;
    unsigned faults; /* enum sim_file_fault */
};

#define SIM_FLASH_FILE_BYTES 1048576u
/* Returns its length; 0 when the profile is unknown or it is longer than capacity. */
HM2_API size_t sim_flash_file(const struct sim_flash_file *file, uint8_t *out, size_t capacity);
/* Put such an image into the card's flash, as a programmer that pads with 0xFF would. 0 = it does not fit. */
HM2_API size_t sim_card_install(struct sim_card *card, const struct sim_flash_file *file);

#endif
