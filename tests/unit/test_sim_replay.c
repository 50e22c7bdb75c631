/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Reader and player of trace folders. */
#include "unit.h"

#include <limits.h>

#include "replay_trace.h"

/* ---- tables
 * ---------------------------------------------------------------------------------------------------------- */

static int open_text(struct replay_csv *const csv, char *const text, struct hm2_diag *const diag)
{
    hm2_diag_clear(diag);
    return replay_csv_open(csv, "t.csv", text, strlen(text), diag);
}

static void quoted_fields_keep_commas_and_quotes(void **state)
{
    (void)state;
    char text[] = "test,description\nramp,\"0, then \"\"1\"\"\"\r\n\nlast,\n";
    struct replay_csv csv;
    struct hm2_diag diag;
    assert_int_equal(open_text(&csv, text, &diag), 0);
    assert_int_equal(csv.columns, 2);
    assert_int_equal(replay_csv_row(&csv, &diag), 1);
    assert_string_equal(csv.field[0], "ramp");
    assert_string_equal(csv.field[1], "0, then \"1\"");
    assert_int_equal(csv.line, 2);
    assert_int_equal(replay_csv_row(&csv, &diag), 1);
    assert_string_equal(csv.field[0], "last");
    assert_string_equal(csv.field[1], "");
    assert_int_equal(csv.line, 4);
    assert_int_equal(replay_csv_row(&csv, &diag), 0);
}

static void short_rows_are_filled_with_empty_fields(void **state)
{
    (void)state;
    char text[] = "a,b,c\n1\n";
    struct replay_csv csv;
    struct hm2_diag diag;
    assert_int_equal(open_text(&csv, text, &diag), 0);
    assert_int_equal(replay_csv_row(&csv, &diag), 1);
    assert_string_equal(csv.field[2], "");
}

static void a_broken_row_is_refused_with_its_line(void **state)
{
    (void)state;
    static const char *const rows[] = {"a,b\n1,2\n1,2,3\n", "a,b\n1,2\n\"open\n", "a,b\n1,2\n\"x\"y,2\n",
                                       "a,b\n1,2\n1\r2\n"};
    for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
        char text[64];
        snprintf(text, sizeof(text), "%s", rows[i]);
        struct replay_csv csv;
        struct hm2_diag diag;
        assert_int_equal(open_text(&csv, text, &diag), 0);
        assert_int_equal(replay_csv_row(&csv, &diag), 1);
        assert_int_equal(replay_csv_row(&csv, &diag), HM2_ERR_MALFORMED);
        assert_non_null(strstr(diag.text, "t.csv line 3"));
    }
}

static void a_header_with_too_many_columns_is_refused(void **state)
{
    (void)state;
    char text[200] = "c";
    for (unsigned i = 0; i < REPLAY_CSV_COLUMNS; i++)
        strcat(text, ",c");
    struct replay_csv csv;
    struct hm2_diag diag;
    assert_int_equal(open_text(&csv, text, &diag), HM2_ERR_MALFORMED);
}

static void numbers_are_whole_and_bounded(void **state)
{
    (void)state;
    int64_t value = 0;
    uint32_t hex = 0;
    assert_int_equal(replay_decimal("0", 10, &value), 0);
    assert_int_equal(replay_decimal("10", 10, &value), 0);
    assert_int_equal(value, 10);
    assert_int_equal(replay_decimal("11", 10, &value), HM2_ERR_RANGE);
    assert_int_equal(replay_decimal("99999999999999999999999", INT64_MAX, &value), HM2_ERR_RANGE);
    assert_int_equal(replay_decimal("-1", 10, &value), HM2_ERR_MALFORMED);
    assert_int_equal(replay_decimal("", 10, &value), HM2_ERR_MALFORMED);
    assert_int_equal(replay_decimal("1 ", 10, &value), HM2_ERR_MALFORMED);
    assert_int_equal(replay_hex32("FFFFFFFF", &hex), 0);
    assert_true(hex == UINT32_MAX);
    assert_int_equal(replay_hex32("100000000", &hex), HM2_ERR_RANGE);
    assert_int_equal(replay_hex32("00000000000012", &hex), 0);
    assert_int_equal(replay_hex32("0x1", &hex), HM2_ERR_MALFORMED);
    assert_int_equal(replay_hex32("", &hex), HM2_ERR_MALFORMED);
}

/* ---- traces
 * ---------------------------------------------------------------------------------------------------------- */

static int parse(struct replay_trace *const trace, const char *const tests, const char *const events,
                 struct hm2_diag *const diag)
{
    static char tests_text[1000], events_text[4000];
    hm2_diag_clear(diag);
    snprintf(tests_text, sizeof(tests_text), "%s", tests);
    snprintf(events_text, sizeof(events_text), "%s", events);
    return replay_trace_parse(trace, tests_text, strlen(tests_text), events_text, strlen(events_text), diag);
}

static void events_belong_to_their_tests_in_any_order_of_columns(void **state)
{
    (void)state;
    struct replay_trace trace;
    struct hm2_diag diag;
    assert_int_equal(parse(&trace, "test,description\na,first\nb,\n",
                           "value,clk,name,ev,extra,test\n1,3,A,I,x,b\n00000004/00003000,9,control,R,y,b\n"
                           "0,1,B,I,z,a\n",
                           &diag),
                     0);
    assert_int_equal(trace.test_count, 2);
    assert_int_equal(trace.event_count, 3);
    assert_int_equal(trace.tests[0].first, 2);
    assert_int_equal(trace.tests[0].count, 1);
    assert_int_equal(trace.tests[1].first, 0);
    assert_int_equal(trace.tests[1].count, 2);
    assert_int_equal(trace.events[1].at, 9);
    assert_int_equal(trace.events[1].kind, 'R');
    assert_false(trace.in_ns);
    replay_trace_free(&trace);
}

static void broken_traces_are_refused_with_file_and_line(void **state)
{
    (void)state;
    static const struct {
        const char *tests, *events, *message;
    } rows[] = {
        {"name\na\n", "test,clk,ev,name,value\n", "tests.csv line 1: no column \"test\""},
        {"test\na\n", "test,clk,ev,name\n", "events.csv line 1: no column \"value\""},
        {"test\na\n", "test,clk,ev,name,value\nb,1,R,x,0\n", "events.csv line 2: test \"b\""},
        {"test\na\n", "test,clk,ev,name,value\na,5,R,x,0\na,4,R,x,0\n", "events.csv line 3: time goes back"},
        {"test\na\n", "test,clk,ev,name,value\na,-5,R,x,0\n", "events.csv line 2: time"},
        {"test\na\n", "test,clk,ev,name,value\na,9999999999999,R,x,0\n", "events.csv line 2: time"},
        {"test\na\n", "test,clk,ev,name,value\na,5,X,x,0\n", "events.csv line 2: event kind"},
        {"test\na\nb\n", "test,clk,ev,name,value\na,5,R,x,0\nb,5,R,x,0\na,6,R,x,0\n", "in two pieces"},
        {"", "test,clk,ev,name,value\n", "tests.csv is empty"},
    };
    for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
        struct replay_trace trace;
        struct hm2_diag diag;
        assert_true(parse(&trace, rows[i].tests, rows[i].events, &diag) < 0);
        if (!strstr(diag.text, rows[i].message))
            fail_msg("row %zu: \"%s\" is not in: %s", i, rows[i].message, diag.text);
    }
}

static const struct replay_kind *kind_of(const char *const folder)
{
    for (unsigned i = 0; i < replay_kind_count; i++)
        if (strcmp(replay_kinds[i].folder, folder) == 0)
            return &replay_kinds[i];
    return NULL;
}

static void register_names_carry_an_instance_number(void **state)
{
    (void)state;
    const struct replay_kind *const encoder = kind_of("encoder");
    uint16_t address = 0;
    assert_true(replay_find_register(encoder, "control", &address));
    assert_int_equal(address, 0x3100);
    assert_true(replay_find_register(encoder, "control7", &address));
    assert_int_equal(address, 0x311C);
    assert_true(replay_find_register(encoder, "ddr2", &address));
    assert_int_equal(address, 0x1108);
    assert_true(replay_find_register(encoder, "0x7100", &address));
    assert_int_equal(address, 0x7100);
    assert_false(replay_find_register(encoder, "tsdiv1", &address));
    assert_false(replay_find_register(encoder, "control999", &address));
    assert_false(replay_find_register(encoder, "controls", &address));
    assert_true(replay_find_register(kind_of("hm2dpll"), "control1", &address));
    assert_int_equal(address, 0x7300);
}

static void signal_names_tell_inputs_from_outputs(void **state)
{
    (void)state;
    unsigned number = 99;
    const struct replay_signal *signal = replay_find_signal(kind_of("encoder"), "A", false, &number);
    assert_non_null(signal);
    assert_int_equal(number, 0);
    signal = replay_find_signal(kind_of("encoder"), "index3", false, &number);
    assert_non_null(signal);
    assert_int_equal(number, 3);
    assert_null(replay_find_signal(kind_of("encoder"), "A", true, &number));
    signal = replay_find_signal(kind_of("stepgen"), "out2", true, &number);
    assert_non_null(signal);
    assert_int_equal(signal->secondary_pin, 0x83);
    assert_int_equal(number, 0);
    signal = replay_find_signal(kind_of("watchdog"), "pin25", true, &number);
    assert_non_null(signal);
    assert_int_equal(signal->kind, REPLAY_PAD);
    assert_int_equal(number, 25);
}

static void every_folder_kind_has_its_firmware(void **state)
{
    (void)state;
    for (unsigned i = 0; i < replay_kind_count; i++) {
        struct hm2_image image;
        if (replay_kinds[i].no_events)
            continue;
        assert_true(replay_firmware(replay_kinds[i].firmware, &image));
        struct hm2_idrom idrom;
        struct hm2_diag diag;
        hm2_diag_clear(&diag);
        const int err = hm2_idrom_parse(&image, NULL, &idrom, &diag);
        if (err)
            fail_msg("%s: %s", replay_kinds[i].firmware, diag.text);
    }
    struct hm2_image image;
    assert_false(replay_firmware("NOSUCH", &image));
}

static int no_file(void *const context, const char *const name, char **const text, size_t *const len,
                   struct hm2_diag *const diag)
{
    (void)context;
    (void)name;
    (void)text;
    (void)len;
    (void)diag;
    return HM2_ERR_NOTFOUND;
}

static void an_unknown_folder_names_the_known_ones(void **state)
{
    (void)state;
    const struct replay_files files = {.load = no_file};
    const struct replay_options options = {0};
    struct replay_totals totals = {0};
    struct hm2_diag diag;
    hm2_diag_clear(&diag);
    assert_int_equal(replay_folder("nosuch", &files, &options, &totals, &diag), HM2_ERR_NOTFOUND);
    assert_non_null(strstr(diag.text, "stepgen"));
    assert_non_null(strstr(diag.text, "encoder_muxed"));
    hm2_diag_clear(&diag);
    assert_int_equal(replay_folder("encoder", &files, &options, &totals, &diag), HM2_ERR_NOTFOUND);
    assert_non_null(strstr(diag.text, "tests.csv"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(quoted_fields_keep_commas_and_quotes),
        cmocka_unit_test(short_rows_are_filled_with_empty_fields),
        cmocka_unit_test(a_broken_row_is_refused_with_its_line),
        cmocka_unit_test(a_header_with_too_many_columns_is_refused),
        cmocka_unit_test(numbers_are_whole_and_bounded),
        cmocka_unit_test(events_belong_to_their_tests_in_any_order_of_columns),
        cmocka_unit_test(broken_traces_are_refused_with_file_and_line),
        cmocka_unit_test(register_names_carry_an_instance_number),
        cmocka_unit_test(signal_names_tell_inputs_from_outputs),
        cmocka_unit_test(every_folder_kind_has_its_firmware),
        cmocka_unit_test(an_unknown_folder_names_the_known_ones),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
