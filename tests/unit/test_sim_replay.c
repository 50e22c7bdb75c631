/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Reader and player of trace folders. */
#include "unit.h"

#include <limits.h>

#include "replay_trace.h"
#include "trace_folder.h"

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
        memcpy(text + 1 + 2 * (size_t)i, ",c", 3);
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

/* ---- differences are found
 * ------------------------------------------------------------------------------------------------ */

struct memory_file {
    const char *name, *text;
};

struct memory_folder {
    const struct memory_file *files;
    char first_difference[256];
};

static int load_memory(void *const context, const char *const name, char **const text, size_t *const len,
                       struct hm2_diag *const diag)
{
    (void)diag;
    const struct memory_folder *const folder = context;
    for (const struct memory_file *f = folder->files; f->name; f++) {
        if (strcmp(f->name, name) != 0)
            continue;
        *len = strlen(f->text);
        *text = malloc(*len + 1);
        assert_non_null(*text);
        memcpy(*text, f->text, *len + 1);
        return 0;
    }
    return HM2_ERR_NOTFOUND;
}

static bool list_memory(void *const context, const size_t index, char *const name, const size_t size)
{
    const struct memory_folder *const folder = context;
    size_t count = 0;
    while (folder->files[count].name)
        count++;
    if (index >= count)
        return false;
    snprintf(name, size, "%s", folder->files[index].name);
    return true;
}

static void keep_difference(void *const context, const char *const test, const bool passed,
                            const char *const difference)
{
    struct memory_folder *const folder = context;
    (void)test;
    if (!passed && !folder->first_difference[0])
        snprintf(folder->first_difference, sizeof(folder->first_difference), "%s", difference);
}

static struct replay_totals replay_memory(const char *const kind, struct memory_folder *const folder)
{
    const struct replay_files files = {.load = load_memory, .list = list_memory, .context = folder};
    const struct replay_options options = {.on_result = keep_difference, .context = folder};
    struct replay_totals totals = {0};
    struct hm2_diag diag = {0};
    if (replay_folder(kind, &files, &options, &totals, &diag))
        fail_msg("%s", diag.text);
    return totals;
}

/* One test of a kind with these events: NULL when it passes, else it fails with this difference. */
static void check_events(const char *const kind, const char *const header, const char *const events,
                         const char *const difference)
{
    char text[8000];
    snprintf(text, sizeof(text), "%s\n%s", header, events);
    const struct memory_file files[] = {{"tests.csv", "test,description\nt,\n"}, {"events.csv", text}, {NULL, NULL}};
    struct memory_folder folder = {.files = files};
    const struct replay_totals totals = replay_memory(kind, &folder);
    assert_int_equal(totals.passed + totals.failed, 1);
    if (difference && !strstr(folder.first_difference, difference))
        fail_msg("expected \"%s\", got \"%s\"", difference, folder.first_difference);
    if (!difference && totals.failed)
        fail_msg("%s", folder.first_difference);
}

#define CLK_EVENTS "test,clk,ev,name,value"
#define NS_EVENTS  "test,ns,ev,name,value"

static void a_wrong_value_or_mask_of_a_read_is_found(void **state)
{
    (void)state;
    check_events("encoder", CLK_EVENTS, "t,30,R,control,00000004/00003000\n", NULL);
    check_events("encoder", CLK_EVENTS, "t,30,R,control,00000005/00003000\n",
                 "clk 30: control expected 00000005/00003000 (line 2), got 00000004/00003000");
    check_events("encoder", CLK_EVENTS, "t,30,R,control,00000004\n", "clk 30: control expected 00000004 (line 2)");
    check_events("encoder", CLK_EVENTS, "t,30,R,control7,00000004/00003000\nt,31,R,0x311C,00000004/00003000\n", NULL);
    check_events("encoder", CLK_EVENTS, "t,30,R,control8,00000000/FFFFFFFF\n", NULL);
}

static void missing_extra_and_mistimed_edges_are_found(void **state)
{
    (void)state;
    const char *const start = "t,95,E,A,Z\nt,95,E,A,0\nt,125,W,pwmrate,0000FFFF\nt,155,W,mode,00000000\n"
                              "t,185,W,value,00640000\n";
    static const struct {
        const char *edges, *difference;
    } rows[] = {
        {"t,202,E,A,1\nt,657,E,A,0\nt,705,R,enable,00000000\n", NULL},
        {"t,202,E,A,1\nt,705,R,enable,00000000\n", "ns 657: A expected no further edge, got 0"},
        {"t,202,E,A,1\nt,652,E,A,0\nt,705,R,enable,00000000\n", "ns 657: A expected 0 at 652 (line 8), got 0"},
        {"t,197,E,A,1\nt,657,E,A,0\n", "ns 202: A expected 1 at 197 (line 7), got 1"},
        {"t,202,E,A,1\nt,400,E,A,0\nt,410,E,A,1\nt,657,E,A,0\n", "A expected 0 at 400"},
        {"t,202,E,A,1\nt,657,E,A,0\nt,690,E,A,1\nt,705,R,enable,00000000\n",
         "ns 690: A expected 1 (line 9), got no edge up to 705"},
    };
    for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
        char events[600];
        snprintf(events, sizeof(events), "%s%s", start, rows[i].edges);
        check_events("pwmgen", NS_EVENTS, events, rows[i].difference);
    }
    check_events("pwmgen", NS_EVENTS, "t,95,E,A,1\nt,125,W,pwmrate,0000FFFF\n", "ns 95: A expected 1, got 0");
}

static void a_wrong_level_in_a_vector_is_found(void **state)
{
    (void)state;
    check_events("ioport", CLK_EVENTS, "t,6,N,leds,1111\nt,9,W,led,80000000\nt,9,N,leds,1110\n", NULL);
    check_events("ioport", CLK_EVENTS, "t,6,N,leds,1111\nt,9,W,led,80000000\nt,9,N,leds,1100\n",
                 "clk 9: leds[2] expected 0 (line 4), got 1");
    check_events("ioport", CLK_EVENTS, "t,6,W,ddr0,00000002\nt,6,I,pins,H0HH\n", NULL);
    check_events("ioport", CLK_EVENTS, "t,6,W,ddr0,00000002\nt,6,I,pins,HHHH\n", "clk 6: pins[1] expected H");
}

static void a_test_without_events_fails(void **state)
{
    (void)state;
    check_events("encoder", CLK_EVENTS, "", "no events of this test");
}

#define MEASURE                                                                                                      \
    "kind,mode_reg,width_bits,symmetric,outmode,value_reg,pwmrate,pdmrate,A_state,A_period_hclk,A_high_hclk,A_high_" \
    "sum,B_"                                                                                                         \
    "state,B_period_hclk,B_high_hclk,B_high_sum\n"

static void a_wrong_measurement_is_found(void **state)
{
    (void)state;
    static const struct {
        const char *row;
        bool passes;
    } rows[] = {
        {"pwm,01,10,0,0,01550000,FFFF,FFFF,pulses,1024,341,,const0,,,", true},
        {"pwm,01,10,0,0,01550000,FFFF,FFFF,pulses,1024,340,,const0,,,", false},
        {"pwm,01,10,0,0,01550000,FFFF,FFFF,pulses,1023,341,,const0,,,", false},
        {"pwm,01,10,0,0,01550000,FFFF,FFFF,const0,,,,const0,,,", false},
        {"pwm,01,10,0,0,01550000,FFFF,FFFF,pulses,1024,341,,const1,,,", false},
        {"pwm,01,10,0,0,00000000,FFFF,FFFF,pulses,,,,const0,,,", false},
        {"pdm,1B,12,0,3,0FA00000,FFFF,1234,pulses,590;591;604;605,576;577;590;591,16989/17397,const0,,,", true},
        {"pdm,1B,12,0,3,0FA00000,FFFF,1234,pulses,590;591;604;605,576;577;590;591,16950/17397,const0,,,", false},
        {"pdm,1B,12,0,3,0FA00000,FFFF,1234,pulses,590;591;604;606,576;577;590;591,,const0,,,", false},
    };
    for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
        char measure[1000];
        snprintf(measure, sizeof(measure), "%s%s\n", MEASURE, rows[i].row);
        const struct memory_file files[] = {{"tests.csv", "test,description\n"},
                                            {"events.csv", NS_EVENTS "\n"},
                                            {"measure.csv", measure},
                                            {NULL, NULL}};
        struct memory_folder folder = {.files = files};
        const struct replay_totals totals = replay_memory("pwmgen", &folder);
        if (totals.passed != rows[i].passes || totals.failed == rows[i].passes)
            fail_msg("row %zu: %s", i, folder.first_difference);
    }
}

static void a_wrong_reply_is_found(void **state)
{
    (void)state;
    static const struct {
        const char *row, *difference;
    } rows[] = {
        {"0,udp,cookie,01420001,fecaaa55,11.7,27181", NULL},
        {"0,udp,cookie,01420001,fecaaa54,11.7,27181", "reply byte 3 expected 54, got 55"},
        {"0,udp,cookie,01420001,fecaaa,11.7,27181", "reply expected 3 bytes, got 4"},
        {"0,udp,cookie,01420001,fecaaa55,25.0,27181", "reply expected after 25.00 us"},
        {"0,udp,cookie,01420001,fecaaa55,11.7,27182", "reply port expected 27182, got 27181"},
        {"0,udp,\"source port 5000\",01420001,fecaaa55,11.7,5000", NULL},
        {"0,udp,destination port 27182: ignored,01420001,,,", NULL},
        {"0,udp,destination port 27182: ignored,01420001,fecaaa55,11.7,27181", "reply expected 4 bytes, got 0"},
    };
    for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
        char exchanges[400];
        snprintf(exchanges, sizeof(exchanges), "n,kind,description,request_hex,reply_hex,reply_us,reply_dst_port\n%s\n",
                 rows[i].row);
        const struct memory_file files[] = {{"exchanges.csv", exchanges}, {NULL, NULL}};
        struct memory_folder folder = {.files = files};
        const struct replay_totals totals = replay_memory("lbp16", &folder);
        assert_int_equal(totals.passed + totals.failed, 1);
        if (rows[i].difference ? !strstr(folder.first_difference, rows[i].difference) : totals.failed != 0)
            fail_msg("row %zu: \"%s\"", i, folder.first_difference);
    }
}

static void bytes_of_the_epp_bus_are_compared_and_checked(void **state)
{
    (void)state;
    static const struct {
        const char *row, *difference;
        unsigned failed;
    } rows[] = {
        {"a,0,R,0100,FE CA AA 55", "", 0},
        {"a,0,R,7800,00 00 XX XX", "", 0},
        {"a,0,R,0100,FE CA AB 55", "access 0, address 0102: expected AB, got AA", 1},
        {"a,0,R,7800,00 00 00 XX", "access 0, address 7802: expected 00, got XX", 1},
    };
    static const char *const broken[] = {"a,0,R,0100,FE CA A", "a,0,R,0100,FECA", "a,0,W,0100,XX", "a,0,R,10000,00",
                                         "a,0,Q,0100,00"};
    char events[200];
    const struct memory_file files[] = {{"events.csv", events}, {NULL, NULL}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        snprintf(events, sizeof events, "test,seq,ev,addr,bytes\n%s\n", rows[i].row);
        struct memory_folder folder = {.files = files};
        const struct replay_totals totals = replay_memory("tram", &folder);
        assert_int_equal(totals.failed, rows[i].failed);
        assert_int_equal(totals.passed, 1 - rows[i].failed);
        assert_string_equal(folder.first_difference, rows[i].difference);
    }
    for (size_t i = 0; i < sizeof broken / sizeof broken[0]; i++) {
        snprintf(events, sizeof events, "test,seq,ev,addr,bytes\n%s\n", broken[i]);
        struct memory_folder folder = {.files = files};
        const struct replay_files from = {.load = load_memory, .list = list_memory, .context = &folder};
        const struct replay_options options = {0};
        struct replay_totals totals = {0};
        struct hm2_diag diag = {0};
        assert_int_equal(replay_folder("tram", &from, &options, &totals, &diag), HM2_ERR_MALFORMED);
        assert_non_null(strstr(diag.text, "events.csv line 2: expected "));
    }
}

static void a_dump_and_its_index_must_agree(void **state)
{
    (void)state;
    struct hm2_image image;
    char dump[6000] = "0100 55AACAFE\n0104 54534F48\n0108 32544F4D\n010C 00000400\n";
    assert_true(replay_firmware("JUSTIO_72", &image));
    for (unsigned i = 0; i < HM2_IDROM_WORDS; i++)
        if (image.rom[i])
            snprintf(dump + strlen(dump), sizeof(dump) - strlen(dump), "%04X %08X\n", 0x400 + 4 * i,
                     (unsigned)image.rom[i]);
    static const struct {
        const char *row, *difference;
    } rows[] = {
        {"a.hex,i80,7I80,3,72,100000000,200000000,watchdog:1 ioport:3 led:1", NULL},
        {"a.hex,i80,7I81,3,72,100000000,200000000,watchdog:1 ioport:3 led:1", "board name expected 7I81, got 7I80"},
        {"a.hex,i80,7I80,2,72,100000000,200000000,watchdog:1 ioport:3 led:1", "IO ports expected 2, got 3"},
        {"a.hex,i80,7I80,3,72,100000000,200000001,watchdog:1 ioport:3 led:1", "clock high expected 200000001"},
        {"a.hex,i80,7I80,3,72,100000000,200000000,watchdog:1 ioport:3v2 led:1", "modules expected"},
        {"b.hex,i80,7I80,3,72,100000000,200000000,watchdog:1 ioport:3 led:1", "names a file that is not there"},
    };
    for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
        char index[300];
        snprintf(index, sizeof(index),
                 "file,card,board,ioports,iowidth,clocklow_hz,clockhigh_hz,modules(tag:instances[vVersion])\n%s\n",
                 rows[i].row);
        const struct memory_file files[] = {{"index.csv", index}, {"a.hex", dump}, {NULL, NULL}};
        struct memory_folder folder = {.files = files};
        const struct replay_totals totals = replay_memory("idrom", &folder);
        if (rows[i].difference ? !strstr(folder.first_difference, rows[i].difference) : totals.failed != 0)
            fail_msg("row %zu: \"%s\"", i, folder.first_difference);
        if (rows[i].row[0] == 'b')
            assert_int_equal(totals.failed, 2); /* a.hex is not in the index */
    }
}

/* ---- recordings without inputs
 * ----------------------------------------------------------------------------------------------- */

/* A bench as the recorded one: it does something to the encoders, waits, and reads count and control of both. */
struct bench {
    struct sim_card *card;
    int64_t clk;
    unsigned position[2];
    char events[6000];
};

static void bench_note(struct bench *const b, const char kind, const char *const name, const unsigned encoder,
                       const uint32_t value, const uint32_t mask)
{
    const size_t used = strlen(b->events);
    char number[4] = "";
    if (encoder < 2)
        snprintf(number, sizeof(number), "%u", encoder);
    char mask_text[16] = "";
    if (mask)
        snprintf(mask_text, sizeof(mask_text), "/%08X", (unsigned)mask);
    snprintf(b->events + used, sizeof(b->events) - used, "t,%lld,%c,%s%s,%08X%s\n", (long long)b->clk, kind, name,
             number, (unsigned)value, mask_text);
}

static void bench_write(struct bench *const b, const char *const name, const unsigned encoder, const uint16_t address,
                        const uint32_t value)
{
    b->clk += 3;
    sim_card_write(b->card, b->clk, address, value);
    bench_note(b, 'W', name, encoder, value, 0);
}

static void bench_read(struct bench *const b)
{
    for (unsigned reg = 0; reg < 2; reg++)
        for (unsigned e = 0; e < 2; e++) {
            b->clk += 3;
            uint32_t undriven = 0;
            const uint16_t address = (uint16_t)(0x3500 + 0x100 * reg + 4 * e);
            const uint32_t value = sim_card_read(b->card, b->clk, address, &undriven) & ~undriven;
            bench_note(b, 'R', reg ? "control" : "count", e, value, undriven);
        }
}

static void bench_input(struct bench *const b, const unsigned encoder, const uint8_t pin, const bool level)
{
    assert_int_equal(
        sim_card_drive_input(b->card, b->clk, HM2_GTAG_MUXED_ENCODER, encoder, pin, level ? SIM_HIGH : SIM_LOW), 0);
}

static void bench_turn(struct bench *const b, const unsigned encoder, const int edges, const int64_t clk_per_edge)
{
    for (int i = 0; i < abs(edges); i++, b->clk += clk_per_edge) {
        b->position[encoder] += edges > 0 ? 1u : 3u;
        bench_input(b, encoder, 0x41, (b->position[encoder] + 1) & 2u);
        bench_input(b, encoder, 0x42, b->position[encoder] & 2u);
    }
}

static void record_without_inputs(struct bench *const b, const uint32_t control, const uint32_t tsdiv,
                                  const int64_t clk_per_edge)
{
    struct hm2_image image;
    assert_true(replay_firmware("SV6_7I48_48", &image));
    const struct sim_card_options options = {.profile = "7i93", .image = &image};
    assert_int_equal(sim_card_new(&b->card, &options, NULL), 0);
    for (unsigned e = 0; e < 8; e++)
        for (uint8_t pin = 0x41; pin <= 0x43; pin++)
            assert_int_equal(sim_card_drive_input(b->card, -1, HM2_GTAG_MUXED_ENCODER, e, pin, SIM_LOW), 0);
    b->clk = 6;
    bench_write(b, "tsdiv", 9, 0x3700, tsdiv);
    b->clk = 300;
    for (unsigned e = 0; e < 2; e++)
        bench_write(b, "control", e, (uint16_t)(0x3600 + 4 * e), control);
    b->clk += 300;
    bench_turn(b, 0, 5, clk_per_edge);
    bench_turn(b, 1, -3, clk_per_edge);
    b->clk += 500;
    bench_read(b);
    for (unsigned e = 0; e < 2; e++) {
        bench_input(b, e, 0x43, true);
        b->clk += 600;
        bench_read(b);
        bench_input(b, e, 0x43, false);
        b->clk += 600;
        bench_read(b);
    }
    bench_turn(b, 0, 4, clk_per_edge);
    b->clk += 500;
    bench_read(b);
    sim_card_free(b->card);
}

static void inputs_that_were_not_recorded_follow_from_the_reads(void **state)
{
    (void)state;
    static const uint32_t controls[] = {0x0000, 0x0018, 0x0010, 0x0028, 0x0038, 0x0058, 0x0068, 0x0078, 0x0030, 0x0818};
    static const uint32_t dividers[] = {0, 1, 8, 48, 0x8000};
    for (size_t i = 0; i < sizeof(controls) / sizeof(controls[0]); i++)
        for (size_t d = 0; d < sizeof(dividers) / sizeof(dividers[0]); d++) {
            static struct bench b;
            memset(&b, 0, sizeof(b));
            record_without_inputs(&b, controls[i], dividers[d], controls[i] & 0x800u ? 500 : 150);
            check_events("encoder_muxed", CLK_EVENTS, b.events, NULL);
        }
}

static void the_recorded_session_and_dumps_are_matched(void **state)
{
    (void)state;
    struct replay_totals totals = replay_data("lbp16");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 102);
    totals = replay_data("tram");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 8);
    totals = replay_data("idrom");
    assert_int_equal(totals.failed, 0);
    assert_int_equal(totals.passed, 218);
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
        cmocka_unit_test(a_wrong_value_or_mask_of_a_read_is_found),
        cmocka_unit_test(missing_extra_and_mistimed_edges_are_found),
        cmocka_unit_test(a_wrong_level_in_a_vector_is_found),
        cmocka_unit_test(a_test_without_events_fails),
        cmocka_unit_test(a_wrong_measurement_is_found),
        cmocka_unit_test(a_wrong_reply_is_found),
        cmocka_unit_test(bytes_of_the_epp_bus_are_compared_and_checked),
        cmocka_unit_test(a_dump_and_its_index_must_agree),
        cmocka_unit_test(inputs_that_were_not_recorded_follow_from_the_reads),
        cmocka_unit_test(the_recorded_session_and_dumps_are_matched),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
