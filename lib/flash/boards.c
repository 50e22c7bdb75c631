/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Cards and chips (flash tool reference 2.1, 2.2, 4.3). */
#include <string.h>
#include <strings.h>

#include <hm2/flash.h>

/* IDROM field "FPGA size" of the Trion cards, which the image files of Xilinx cards can never show (2.1, notes). */
#define T20_KGATES 20u

#define SLX9  "6slx9tqg144", FLASH_XILINX, 0x04001093, 0
#define SLX16 "6slx16ftg256", FLASH_XILINX, 0x04002093, 0
#define SLX25 "6slx25ftg256", FLASH_XILINX, 0x04004093, 0
#define T20   "T20F256", FLASH_EFINIX, 0, T20_KGATES
#define ON_CARD               \
    {                         \
        "on-card", "P1", "P2" \
    }
#define HEADERS_DB             \
    {                          \
        "J2", "J3", "J4", "J5" \
    }
#define P1_TO_P3         \
    {                    \
        "P1", "P2", "P3" \
    }
#define P2_P1      \
    {              \
        "P2", "P1" \
    }
#define NAMES_7I94                            \
    {"Expansion+Serial 0..1", "Serial 1..7"}, \
    {                                         \
        "7I94_0", "7I94_1"                    \
    }
#define NAMES_7I95                                 \
    {"Step/DIR+Serial+Encoders", "I/O+Expansion"}, \
    {                                              \
        "7I95_0", "7I95_1"                         \
    }
#define NAMES_7I96                   \
    {"TB3", "TB1/TB2", "P1"},        \
    {                                \
        "7I96_0", "7I96_1", "7I96_2" \
    }
#define NAMES_7I97                    \
    {"TB1/TB2/TB3", "TB4/TB5", "P1"}, \
    {                                 \
        "7I97_0", "7I97_1", "7I97_2"  \
    }

static const struct flash_board boards[] = {
    {"7I76E", "7I76E-16", SLX16, 3, 17, ON_CARD, {NULL, "7I76"}, 4, false, "W9"},
    {"7I76EU", "7I76EU", T20, 3, 17, ON_CARD, {NULL, "7I76"}, 4, false, "W7"},
    {"7I80DB-16", "7I80DB-16", SLX16, 4, 17, HEADERS_DB, {NULL}, 4, false, NULL},
    {"7I80DB-25", "7I80DB-25", SLX25, 4, 17, HEADERS_DB, {NULL}, 4, false, NULL},
    {"7I80HD-16", "7I80HD-16", SLX16, 3, 24, P1_TO_P3, {NULL}, 4, false, NULL},
    {"7I80HD-25", "7I80HD-25", SLX25, 3, 24, P1_TO_P3, {NULL}, 4, false, NULL},
    {"7I80HDT", "7I80HDT", T20, 3, 24, P1_TO_P3, {NULL}, 4, false, NULL},
    {"7I92", "7I92", SLX9, 2, 17, P2_P1, {NULL}, 4, false, NULL},
    {"7I92T", "7I92T", T20, 2, 17, P2_P1, {NULL}, 4, false, NULL},
    {"7I93", "7I93", SLX9, 2, 24, P2_P1, {NULL}, 4, false, NULL},
    {"7I94", "7I94", SLX9, 2, 21, NAMES_7I94, 4, false, NULL},
    {"7I94T", "7I94T", T20, 2, 21, NAMES_7I94, 4, false, NULL},
    {"7I95", "7I95", SLX9, 2, 29, NAMES_7I95, 4, false, NULL},
    {"7I95T", "7I95T", T20, 2, 29, NAMES_7I95, 4, false, NULL},
    {"7I96", "7I96", SLX9, 3, 17, NAMES_7I96, 4, false, NULL},
    {"7I96S", "7I96S", T20, 3, 17, NAMES_7I96, 4, false, NULL},
    {"7I97", "7I97", SLX9, 3, 17, NAMES_7I97, 4, false, NULL},
    {"7I97T", "7I97T", T20, 3, 17, NAMES_7I97, 4, false, NULL},
    {"7I98", "7I98", SLX9, 3, 17, P1_TO_P3, {NULL}, 4, false, NULL},
    {"LITEHM2", "litehm2", SLX16, 3, 24, P1_TO_P3, {NULL}, 1, true, NULL},
};

#define BOARDS (sizeof boards / sizeof boards[0])
_Static_assert(BOARDS == 20, "all Ethernet boards of the reference");

const struct flash_board *flash_board_at(const size_t index)
{
    return index < BOARDS ? &boards[index] : NULL;
}

const struct flash_board *flash_board_of_card(const char *const card_name)
{
    for (size_t i = 0; i < BOARDS; i++)
        if ((boards[i].any_case ? strcasecmp : strcmp)(card_name, boards[i].card_name) == 0)
            return &boards[i];
    return NULL;
}

const struct flash_board *flash_board_named(const char *const text)
{
    const struct flash_board *best = NULL;
    size_t longest = 0;
    for (size_t i = 0; i < BOARDS; i++) {
        const size_t len = strlen(boards[i].device);
        if (len > longest && strncasecmp(text, boards[i].device, len) == 0) {
            best = &boards[i];
            longest = len;
        }
    }
    return best;
}

/* Times of the M25P family, the slower one of those in use; 1 to 4 Mbit are as fast as 16. */
#define TIMES 640, 5000, 600, 3000

static const struct flash_chip chips[] = {
    {0x10, "1Mb", 131072, FLASH_SECTOR_BYTES, FLASH_PAGE_BYTES, TIMES},
    {0x11, "2Mb", 262144, FLASH_SECTOR_BYTES, FLASH_PAGE_BYTES, TIMES},
    {0x12, "4Mb", 524288, FLASH_SECTOR_BYTES, FLASH_PAGE_BYTES, TIMES},
    {0x13, "8Mb", 1048576, FLASH_SECTOR_BYTES, FLASH_PAGE_BYTES, TIMES},
    {0x14, "16Mb", 2097152, FLASH_SECTOR_BYTES, FLASH_PAGE_BYTES, TIMES},
    {0x15, "32Mb", 4194304, FLASH_SECTOR_BYTES, FLASH_PAGE_BYTES, TIMES},
};

#define CHIPS (sizeof chips / sizeof chips[0])

const struct flash_chip *flash_chip_at(const size_t index)
{
    return index < CHIPS ? &chips[index] : NULL;
}

const struct flash_chip *flash_chip_of_id(const uint8_t id)
{
    for (size_t i = 0; i < CHIPS; i++)
        if (chips[i].id == id)
            return &chips[i];
    return NULL;
}

struct flash_range flash_area_range(const enum flash_family family, const struct flash_chip *const chip,
                                    const enum flash_area area)
{
    const uint32_t half = chip->bytes / 2;
    const uint32_t boot = family == FLASH_XILINX ? chip->sector_bytes : 0;
    if (area == FLASH_USER)
        return (struct flash_range){half, half};
    return (struct flash_range){boot, half - boot};
}
