/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include <hm2/board.h>
#include <hm2/flash.h>
#include <hm2/terminals.h>

static const struct hm2_board_type *find(const char *const name)
{
    char padded[HM2_BOARD_NAME_BYTES + 1] = "";
    (void)snprintf(padded, sizeof padded, "%s", name);
    return hm2_board_type_find(padded);
}

static void cards_are_found_by_their_names(void **state)
{
    (void)state;
    static const struct {
        const char *name, *stem;
        unsigned ports, width;
    } rows[] = {
        {"7I80DB-16", "7i80", 4, 17}, {"7I80DB-25", "7i80", 4, 17}, {"7I80HD-16", "7i80", 3, 24},
        {"7I80HD-25", "7i80", 3, 24}, {"7I80HDT", "7i80", 3, 24},   {"7I76E-16", "7i76e", 3, 17},
        {"7I76EU", "7i76e", 3, 17},   {"7I92", "7i92", 2, 17},      {"7I92T", "7i92", 2, 17},
        {"7I93", "7i93", 2, 24},      {"7I94", "7i94", 2, 21},      {"7I94T", "7i94", 2, 21},
        {"7I95", "7i95", 2, 29},      {"7I95T", "7i95", 2, 29},     {"7I96", "7i96", 3, 17},
        {"7I96S", "7i96s", 3, 17},    {"7I97", "7i97", 3, 17},      {"7I97T", "7i97", 3, 17},
        {"7I98", "7i98", 3, 17},      {"MC04", "mc04", 2, 30},      {"8CSS", "8css", 2, 30},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct hm2_board_type *const type = find(rows[i].name);
        assert_string_equal(type->stem, rows[i].stem);
        assert_int_equal(type->io_ports, rows[i].ports);
        assert_int_equal(type->port_width, rows[i].width);
        assert_int_equal(type->leds, 4);
    }
}

static void names_that_only_begin_like_a_known_one_are_unknown(void **state)
{
    (void)state;
    static const char *const names[] = {"7I96X", "7I94TX", "7I97TT",  "7I76EUX",         "7I76E",
                                        "7I80",  "",       "LITEHM2", "0123456789abcdef"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        const struct hm2_board_type *const type = find(names[i]);
        assert_string_equal(type->name, "");
        assert_int_equal(type->io_ports, 0);
    }
}

/* Every port has a connector, and terminals, where there are some, for each of its pins. */
static void check_connector(const struct hm2_board_type *const type, const unsigned port)
{
    if (type->io_ports)
        assert_true(!type->connectors[port] == (port >= type->io_ports));
    if (!type->terminals[port])
        return;
    const struct hm2_terminals *const terminals = hm2_terminals_find(type->terminals[port]);
    assert_non_null(terminals);
    assert_int_equal(terminals->count, type->port_width);
    for (unsigned pin = 0; pin < type->port_width; pin++)
        assert_non_null(terminals->terminals[pin]);
}

static void every_row_is_reached_by_its_own_name(void **state)
{
    (void)state;
    size_t rows = 0;
    for (const struct hm2_board_type *type; (type = hm2_board_type_at(rows)) != NULL; rows++) {
        if (*type->name)
            assert_ptr_equal(find(type->name), type);
        else
            assert_null(hm2_board_type_at(rows + 1)); /* the catch-all is the last */
        for (unsigned port = 0; port < HM2_BOARD_CONNECTORS; port++)
            check_connector(type, port);
    }
    assert_int_equal(rows, 22);
}

static void terminals_of_the_7i96s_are_those_of_its_manual(void **state)
{
    (void)state;
    static const struct {
        unsigned port, pin;
        const char *name;
    } rows[] = {{0, 0, "TB3-1"},      {0, 11, "TB3-13,14"},    {1, 0, "TB1-2,3"},
                {1, 14, "TB2-18,19"}, {2, 0, "P1-01/DB25-01"}, {2, 16, "P1-25/DB25-13"}};
    const struct hm2_board_type *const type = find("7I96S");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        assert_string_equal(hm2_terminals_find(type->terminals[rows[i].port])->terminals[rows[i].pin], rows[i].name);
}

/* The other table of cards, of those that can be programmed: it has the boards, this one their ports in HAL. */
static void every_card_that_can_be_programmed_is_known(void **state)
{
    (void)state;
    size_t boards = 0;
    for (const struct flash_board *board; (board = flash_board_at(boards)) != NULL; boards++) {
        const struct hm2_board_type *const type = find(board->card_name);
        assert_string_not_equal(type->name, "");
        assert_int_equal(type->leds, board->leds);
        for (unsigned port = 0; port < board->io_ports; port++)
            assert_non_null(type->connectors[port]);
        if (type->io_ports) {
            assert_int_equal(type->io_ports, board->io_ports);
            assert_int_equal(type->port_width, board->port_width);
        }
    }
    assert_int_equal(boards, 20);
}

static void the_longest_name_that_fits_is_taken(void **state)
{
    (void)state;
    assert_string_equal(find("7I80HDT-X")->name, "7I80HDT");
    assert_string_equal(find("7I92T")->name, "7I92");
    assert_string_equal(find("7I96S")->name, "7I96S");
    assert_string_equal(find("litehm2")->stem, "lite");
    assert_int_equal(find("litehm2")->io_ports, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cards_are_found_by_their_names),
        cmocka_unit_test(names_that_only_begin_like_a_known_one_are_unknown),
        cmocka_unit_test(every_row_is_reached_by_its_own_name),
        cmocka_unit_test(terminals_of_the_7i96s_are_those_of_its_manual),
        cmocka_unit_test(every_card_that_can_be_programmed_is_known),
        cmocka_unit_test(the_longest_name_that_fits_is_taken),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
