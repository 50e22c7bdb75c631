/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The pins of a card with their terminals and owners, as printed at load. */
#include <stdio.h>

#include <hm2/terminals.h>

#include "board_private.h"

_Static_assert(HM2_CFG_CONNECTORS == HM2_BOARD_CONNECTORS, "each connector can have a daughter board");

/* Its name stands before the terminal, as one board may be there twice. */
static void terminal(const struct hm2_board *const board, const unsigned io, char *const text, const size_t size)
{
    const struct hm2_board_type *const type = &board->type;
    const unsigned width = board->idrom.port_width;
    const unsigned port = width ? io / width : 0;
    const unsigned pin = width ? io % width : 0;
    const bool known = port < HM2_BOARD_CONNECTORS;
    const char *const connector = known && type->connectors[port] ? type->connectors[port] : "??";
    const char *const daughter = known ? board->config.dbname[port] : NULL;
    const char *const name = daughter ? daughter : known ? type->terminals[port] : NULL;
    const struct hm2_terminals *const terminals = name ? hm2_terminals_find(name) : NULL;
    if (!terminals || pin >= terminals->count)
        (void)snprintf(text, size, "%s-%02u", connector, hm2_connector_pin(width, io));
    else if (daughter)
        (void)snprintf(text, size, "%s -> %s %s", connector, daughter, terminals->terminals[pin]);
    else
        (void)snprintf(text, size, "%s", terminals->terminals[pin]);
}

static int describe(const struct hm2_board *const board, const unsigned io, char *const text, const size_t size)
{
    const struct hm2_pin *const pin = &board->pins[io];
    const struct hm2_pd *const pd = &pin->pd;
    char place[64], function[32];
    terminal(board, io, place, sizeof place);
    if (!pin->owner)
        return snprintf(text, size, "IO Pin %03u (%s): IOPort\n", io, place);
    const char *const name = hm2_pin_function(pd, function, sizeof function);
    const char *const direction = pd->secondary_pin & HM2_PIN_OUTPUT ? "Output" : "Input";
    if (pd->secondary_unit & HM2_UNIT_GLOBAL)
        return snprintf(text, size, "IO Pin %03u (%s): %s (all), pin %s (%s)\n", io, place,
                        hm2_tag_name(pd->secondary_tag), name, direction);
    return snprintf(text, size, "IO Pin %03u (%s): %s #%u, pin %s (%s)\n", io, place, hm2_tag_name(pd->secondary_tag),
                    pd->secondary_unit, name, direction);
}

size_t hm2_board_describe_pins(const struct hm2_board *const board, char *const text, const size_t size)
{
    size_t used = 0;
    if (size > 0)
        text[0] = '\0';
    for (unsigned io = 0; io < board->idrom.pin_count; io++) {
        const int len = used < size ? describe(board, io, text + used, size - used) : describe(board, io, NULL, 0);
        used += len > 0 ? (size_t)len : 0;
    }
    return used;
}

struct hm2_plan_sizes hm2_board_sizes(const struct hm2_board *const board)
{
    return hm2_plan_sizes(board->plan);
}
