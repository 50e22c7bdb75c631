/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The cards that LinuxCNC or the flash tool know by name (hal-interface 1.3, flash tool reference 2.1). Of several rows
 * that fit, the one that compares most characters counts.
 */
#include <string.h>

#include <hm2/board.h>

#define EXACT 8u /* the terminating zeros take part, so that "7I96" is not "7I96S" */

static const struct hm2_board_type types[] = {
    {"7I80DB-16", 9, "7i80", 4, 17, {"J2", "J3", "J4", "J5"}, 4, {NULL}},
    {"7I80DB-25", 9, "7i80", 4, 17, {"J2", "J3", "J4", "J5"}, 4, {NULL}},
    {"7I80HD-16", 9, "7i80", 3, 24, {"P1", "P2", "P3"}, 4, {NULL}},
    {"7I80HD-25", 9, "7i80", 3, 24, {"P1", "P2", "P3"}, 4, {NULL}},
    {"7I80HDT", 7, "7i80", 3, 24, {"P1", "P2", "P3"}, 4, {NULL}},
    {"7I76E-16", 8, "7i76e", 3, 17, {"P1", "P2", "P3"}, 4, {NULL}},
    {"7I76EU", EXACT, "7i76e", 3, 17, {"P1", "P2", "P3"}, 4, {NULL}},
    {"7I92", 4, "7i92", 2, 17, {"P2", "P1"}, 4, {NULL}},
    {"7I93", 4, "7i93", 2, 24, {"P2", "P1"}, 4, {NULL}},
    {"7I94", EXACT, "7i94", 2, 21, {"Expansion+Serial 0..1", "Serial 1..7"}, 4, {"7I94_0", "7I94_1"}},
    {"7I94T", EXACT, "7i94", 2, 21, {"Expansion+Serial 0..1", "Serial 1..7"}, 4, {"7I94_0", "7I94_1"}},
    {"7I95", EXACT, "7i95", 2, 29, {"Step/DIR+Serial+Encoders", "I/O+Expansion"}, 4, {"7I95_0", "7I95_1"}},
    {"7I95T", EXACT, "7i95", 2, 29, {"Step/DIR+Serial+Encoders", "I/O+Expansion"}, 4, {"7I95_0", "7I95_1"}},
    {"7I96", EXACT, "7i96", 3, 17, {"TB3", "TB1/TB2", "P1"}, 4, {"7I96_0", "7I96_1", "7I96_2"}},
    {"7I96S", EXACT, "7i96s", 3, 17, {"TB3", "TB1/TB2", "P1"}, 4, {"7I96_0", "7I96_1", "7I96_2"}},
    {"7I97", EXACT, "7i97", 3, 17, {"TB1/TB2/TB3", "TB4/TB5", "P1"}, 4, {"7I97_0", "7I97_1", "7I97_2"}},
    {"7I97T", EXACT, "7i97", 3, 17, {"TB1/TB2/TB3", "TB4/TB5", "P1"}, 4, {"7I97_0", "7I97_1", "7I97_2"}},
    {"7I98", 4, "7i98", 3, 17, {"P1", "P2", "P3"}, 4, {NULL}},
    {"MC04", 4, "mc04", 2, 30, {"P1", "P2"}, 4, {NULL}},
    {"8CSS", 4, "8css", 2, 30, {"P1", "P2"}, 4, {NULL}},
    /* Third-party gateware with any ports; LinuxCNC knows its name, not its pins. */
    {"litehm2", 7, "lite", 0, 0, {"P1", "P2", "P3"}, 1, {NULL}},
    /* Any other card: ports from the IDROM, stem from the first four characters of its name. */
    {"", 0, "", 0, 0, {NULL}, 0, {NULL}},
};

#define TYPES (sizeof types / sizeof types[0])

const struct hm2_board_type *hm2_board_type_at(const size_t index)
{
    return index < TYPES ? types + index : NULL;
}

const struct hm2_board_type *hm2_board_type_find(const char *const name)
{
    const struct hm2_board_type *best = &types[TYPES - 1];
    for (size_t i = 0; i + 1 < TYPES; i++)
        if (types[i].compared > best->compared && strncmp(name, types[i].name, types[i].compared) == 0)
            best = &types[i];
    return best;
}
