/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The cards that LinuxCNC knows by name (hal-interface 1.3), in the order in which they are tried: where one name is
 * the beginning of another, the longer one comes first or all 8 characters, zeros included, are compared.
 */
#include <string.h>

#include <hm2/board.h>

#define EXACT 8u /* the terminating zeros take part, so that "7I96" is not "7I96S" */

/* 7I96 and 7I96S (hal-interface 1.3, register map 5.4). */
static const char *const terminals_7i96[] = {
    "TB3-1",         "TB3-2",        "TB3-3",   "TB3-4",     "TB3-5",     "TB3-6",     "TB3-7",     "TB3-8",
    "TB3-9",         "TB3-10",       "TB3-11",  "TB3-13/14", "TB3-15/16", "TB3-17/18", "TB3-19/20", "TB3-21/22",
    "TB3-23/24",     "TB1-2/3",      "TB1-4/5", "TB1-8/9",   "TB1-10/11", "TB1-14/15", "TB1-16/17", "TB1-20/21",
    "TB1-22/23",     "TB2-2/3",      "TB2-4/5", "TB2-7/8",   "TB2-10/11", "TB2-13/14", "TB2-16/17", "TB2-18/19",
    "internal TXEn", "internal SSR", "P1-1",    "P1-14",     "P1-2",      "P1-15",     "P1-3",      "P1-16",
    "P1-4",          "P1-17",        "P1-5",    "P1-6",      "P1-7",      "P1-8",      "P1-9",      "P1-10",
    "P1-11",         "P1-12",        "P1-13",
};

static const struct hm2_board_type types[] = {
    {"7I80DB-16", 9, "7i80", 4, 17, {"J2", "J3", "J4", "J5"}, 4, NULL},
    {"7I80DB-25", 9, "7i80", 4, 17, {"J2", "J3", "J4", "J5"}, 4, NULL},
    {"7I80HD-16", 9, "7i80", 3, 24, {"P1", "P2", "P3"}, 4, NULL},
    {"7I80HD-25", 9, "7i80", 3, 24, {"P1", "P2", "P3"}, 4, NULL},
    {"7I80HDT", 7, "7i80", 3, 24, {"P1", "P2", "P3"}, 4, NULL},
    {"7I76E-16", 8, "7i76e", 3, 17, {"P1", "P2", "P3"}, 4, NULL},
    {"7I76EU", EXACT, "7i76e", 3, 17, {"P1", "P2", "P3"}, 4, NULL},
    {"7I92", 4, "7i92", 2, 17, {"P2", "P1"}, 4, NULL},
    {"7I93", 4, "7i93", 2, 24, {"P2", "P1"}, 4, NULL},
    {"7I94", EXACT, "7i94", 2, 21, {NULL}, 4, NULL},
    {"7I94T", EXACT, "7i94", 2, 21, {NULL}, 4, NULL},
    {"7I95", EXACT, "7i95", 2, 29, {NULL}, 4, NULL},
    {"7I95T", EXACT, "7i95", 2, 29, {NULL}, 4, NULL},
    {"7I96", EXACT, "7i96", 3, 17, {"TB3", "TB1/TB2", "P1"}, 4, terminals_7i96},
    {"7I96S", EXACT, "7i96s", 3, 17, {"TB3", "TB1/TB2", "P1"}, 4, terminals_7i96},
    {"7I97", EXACT, "7i97", 3, 17, {NULL}, 4, NULL},
    {"7I97T", EXACT, "7i97", 3, 17, {NULL}, 4, NULL},
    {"7I98", 4, "7i98", 3, 17, {"P1", "P2", "P3"}, 4, NULL},
    {"MC04", 4, "mc04", 2, 30, {NULL}, 4, NULL},
    {"8CSS", 4, "8css", 2, 30, {NULL}, 4, NULL},
    /* Any other card: ports from the IDROM, stem from the first four characters of its name. */
    {"", 0, "", 0, 0, {NULL}, 0, NULL},
};

#define TYPES (sizeof types / sizeof types[0])

_Static_assert(sizeof terminals_7i96 / sizeof terminals_7i96[0] == 3 * 17, "one terminal per I/O");

const struct hm2_board_type *hm2_board_type_at(const size_t index)
{
    return index < TYPES ? types + index : NULL;
}

const struct hm2_board_type *hm2_board_type_find(const char *const name)
{
    size_t i = 0;
    while (i + 1 < TYPES && strncmp(name, types[i].name, types[i].compared) != 0)
        i++;
    return types + i;
}
