/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Messages of a DBC file on a bus that is played here, in virtual time. */
#include "unit.h"

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>

#include <hm2/can.h>

#define MS     INT64_C(1000000)
#define FRAMES 512u

/* ---- a bus of this test
 * ----------------------------------------------------------------------------------------------- */

static struct {
    struct hm2_can_bus base;
    struct hm2_can_frame in[FRAMES], out[FRAMES];
    unsigned in_count, in_taken, out_count, refused;
    int receive_result, send_result;
    bool closed;
} bus;

static int play_receive(struct hm2_can_bus *const base, struct hm2_can_frame *const frames, const unsigned max)
{
    (void)base;
    unsigned count = 0;
    if (bus.receive_result)
        return bus.receive_result;
    for (; count < max && bus.in_taken < bus.in_count; count++)
        frames[count] = bus.in[bus.in_taken++];
    return (int)count;
}

static int play_send(struct hm2_can_bus *const base, const struct hm2_can_frame *const frame)
{
    (void)base;
    if (bus.send_result) {
        bus.refused++;
        return bus.send_result;
    }
    assert_true(bus.out_count < FRAMES);
    bus.out[bus.out_count++] = *frame;
    return 0;
}

static void play_close(struct hm2_can_bus *const base)
{
    (void)base;
    bus.closed = true;
}

static const struct hm2_can_bus_ops play = {play_receive, play_send, play_close};

static void comes(const uint32_t id, const char *const bytes, const unsigned count)
{
    struct hm2_can_frame *const frame = &bus.in[bus.in_count++];
    assert_true(bus.in_count <= FRAMES);
    *frame = (struct hm2_can_frame){.id = id, .bytes = (uint8_t)count};
    memcpy(frame->data, bytes, count);
}

/* ---- a drive
 * ---------------------------------------------------------------------------------------------------------- */

static const char file[] = "BU_: HOST DRIVE OTHER\n"
                           "BO_ 16 Command: 8 HOST\n"
                           " SG_ control : 0|16@1+ (1,0) [0|0] \"\" DRIVE\n"
                           " SG_ target : 16|32@1- (0.001,0) [-100|100] \"mm\" DRIVE\n"
                           " SG_ brake : 48|1@1+ (1,0) [0|1] \"\" DRIVE\n"
                           "BO_ 17 Change: 2 HOST\n"
                           " SG_ level : 7|16@0- (1,0) [0|0] \"\" DRIVE\n"
                           "BO_ 128 Sync: 0 HOST\n"
                           "BO_ 32 Status: 4 DRIVE\n"
                           " SG_ word : 0|16@1+ (1,0) [0|0] \"\" HOST\n"
                           " SG_ current : 16|16@1- (0.1,0) [0|0] \"A\" HOST\n"
                           "BO_ 33 Paged: 4 DRIVE\n"
                           " SG_ page M : 0|8@1+ (1,0) [0|0] \"\" HOST\n"
                           " SG_ temp m0 : 8|8@1- (1,-40) [0|0] \"\" HOST\n"
                           " SG_ volt m1 : 8|16@1+ (1,0) [0|0] \"\" HOST\n"
                           "BO_ 2147483682 Foreign: 4 DRIVE\n"
                           " SG_ secret : 0|8@1+ (1,0) [0|0] \"\" OTHER\n"
                           "BO_ 34 Real: 4 DRIVE\n"
                           " SG_ real : 0|32@1- (1,0) [0|0] \"\" HOST\n"
                           "BA_ \"GenMsgCycleTime\" BO_ 16 10;\n"
                           "BA_ \"GenMsgCycleTime\" BO_ 32 5;\n"
                           "BA_DEF_ BO_ \"GenMsgSendType\" ENUM \"cyclic\",\"OnChange\";\n"
                           "BA_ \"GenMsgSendType\" BO_ 17 1;\n"
                           "BA_ \"GenSigStartValue\" SG_ 16 target 5000;\n"
                           "SIG_VALTYPE_ 34 real : 1;\n";

static struct hm2_dbc *dbc;
static struct hm2_can *can;
static struct hm2_plain_binder *plain;
static int64_t now_ns;

static void start_with(const struct hm2_can_options *const options)
{
    struct hm2_diag diag = {0};
    memset(&bus, 0, sizeof bus);
    bus.base.ops = &play;
    now_ns = 1000 * MS;
    plain = hm2_plain_binder_new();
    assert_non_null(plain);
    if (hm2_dbc_read(file, strlen(file), "drive.dbc", &dbc, &diag) || hm2_can_new(dbc, options, &can, &diag) ||
        hm2_can_setup(can, &bus.base, hm2_plain_binder(plain), &diag))
        fail_msg("%s", diag.text);
}

static int start(void **state)
{
    (void)state;
    start_with(&(struct hm2_can_options){.prefix = "can.0", .node = "HOST"});
    return 0;
}

static int stop(void **state)
{
    (void)state;
    hm2_can_free(can);
    hm2_dbc_free(dbc);
    hm2_plain_binder_free(plain);
    assert_true(bus.closed);
    return 0;
}

static double get(const char *const name)
{
    char full[HM2_NAME_SIZE];
    int err;
    (void)snprintf(full, sizeof full, "can.0.%s", name);
    const double value = hm2_plain_get(plain, full, &err);
    if (err)
        fail_msg("no %s", full);
    return value;
}

static void set(const char *const name, const double value)
{
    char full[HM2_NAME_SIZE];
    (void)snprintf(full, sizeof full, "can.0.%s", name);
    assert_int_equal(hm2_plain_set(plain, full, value), 0);
}

static void expect(const char *const name, const double value)
{
    if (fabs(get(name) - value) > 1e-9)
        fail_msg("%s is %.10g, expected %.10g", name, get(name), value);
}

static void cycle(void)
{
    hm2_can_read(can, now_ns);
    hm2_can_write(can, now_ns);
    now_ns += MS;
}

static unsigned sent(const uint32_t id)
{
    unsigned count = 0;
    for (unsigned i = 0; i < bus.out_count; i++)
        count += bus.out[i].id == id;
    return count;
}

/* ---- which messages and pins
 * ------------------------------------------------------------------------------------------ */

static const struct hm2_point *point(const char *const name)
{
    const struct hm2_plain_object *const object = hm2_plain_find(plain, name);
    return object ? object->point : NULL;
}

static void a_node_has_the_messages_that_are_its_own(void **state)
{
    (void)state;
    struct hm2_can_filter filters[8];
    assert_int_equal(point("can.0.Command.control")->type, HM2_U32);
    assert_int_equal(point("can.0.Command.control")->dir, HM2_PIN_IN);
    assert_int_equal(point("can.0.Command.target")->type, HM2_FLOAT);
    assert_int_equal(point("can.0.Command.brake")->type, HM2_BIT);
    assert_int_equal(point("can.0.Change.level")->type, HM2_S32);
    assert_int_equal(point("can.0.Status.word")->dir, HM2_PIN_OUT);
    assert_int_equal(point("can.0.Paged.temp")->type, HM2_S32);
    assert_null(point("can.0.Foreign.secret"));
    expect("Command.target", 5);
    expect("Command.tx-period-ms", 10);
    expect("Status.rx-timeout-ms", 15);
    expect("Change.tx-on-change", 1);
    assert_int_equal(hm2_can_filters(can, filters, 8), 3);
    assert_int_equal(filters[0].id, 32);
    assert_int_equal(filters[2].id, 34);
    assert_false(hm2_can_needs_fd(can));
}

static void without_a_node_everything_is_received(void **state)
{
    (void)state;
    start_with(&(struct hm2_can_options){.prefix = "can.0", .floats = true});
    assert_int_equal(point("can.0.Command.control")->type, HM2_FLOAT);
    assert_int_equal(point("can.0.Command.control")->dir, HM2_PIN_OUT);
    assert_int_equal(point("can.0.Command.brake")->type, HM2_BIT);
    assert_non_null(point("can.0.Foreign.secret"));
    for (unsigned i = 0; i < 100; i++)
        cycle();
    assert_int_equal(bus.out_count, 0);
    (void)stop(NULL);
}

static void an_unknown_node_is_refused_with_those_there_are(void **state)
{
    (void)state;
    struct hm2_diag diag = {0};
    assert_int_equal(hm2_dbc_read(file, strlen(file), "drive.dbc", &dbc, &diag), 0);
    const struct hm2_can_options wrong = {.prefix = "can.0", .node = "MASTER"};
    assert_int_equal(hm2_can_new(dbc, &wrong, &can, &diag), HM2_ERR_NOTFOUND);
    assert_non_null(strstr(diag.text, "no node \"MASTER\"; it has: HOST, DRIVE, OTHER"));
    hm2_dbc_free(dbc);
}

/* ---- receiving
 * -------------------------------------------------------------------------------------------------------- */

static void the_newest_frame_is_on_the_pins(void **state)
{
    (void)state;
    comes(32, "\x01\x00\x00\x00", 4);
    comes(32, "\x37\x12\xFE\xFF", 4);
    cycle();
    expect("Status.word", 0x1237);
    expect("Status.current", -0.2);
    expect("Status.rx-count", 2);
    expect("frames-received", 2);
}

static void every_page_of_a_multiplexed_message_arrives(void **state)
{
    (void)state;
    comes(33, "\x00\x14\x00\x00", 4);
    comes(33, "\x01\xE8\x03\x00", 4);
    comes(33, "\x07\xFF\xFF\x00", 4); /* selects nothing */
    cycle();
    expect("Paged.page", 7);
    expect("Paged.temp", -20);
    expect("Paged.volt", 1000);
}

static void a_short_frame_and_a_float_that_is_none_are_dropped(void **state)
{
    (void)state;
    comes(32, "\x37\x12\x05\x00", 4);
    comes(34, "\x00\x00\x80\x3F", 4);
    cycle();
    comes(32, "\xFF\xFF", 2);
    comes(34, "\x00\x00\xC0\x7F", 4);
    cycle();
    expect("Status.word", 0x1237);
    expect("Real.real", 1);
    expect("frames-malformed", 2);
    expect("Status.rx-count", 1);
}

static void age_and_time_out_tell_what_is_old(void **state)
{
    (void)state;
    cycle();
    expect("Status.rx-timed-out", 1); /* nothing yet */
    comes(32, "\x01\x00\x00\x00", 4);
    cycle();
    expect("Status.rx-timed-out", 0);
    expect("Status.rx-age", 0);
    for (unsigned i = 0; i < 15; i++)
        cycle();
    expect("Status.rx-age", 0.015);
    expect("Status.rx-timed-out", 0);
    cycle();
    expect("Status.rx-timed-out", 1);
    expect("Status.word", 1);
    comes(32, "\x02\x00\x00\x00", 4);
    cycle();
    expect("Status.rx-timed-out", 0);
}

static void a_flood_is_worked_off_in_bounded_cycles(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 400; i++)
        comes(32, (const char[]){(char)i, (char)(i >> 8), 0, 0}, 4);
    cycle();
    assert_int_equal(bus.in_taken, HM2_CAN_FRAMES_PER_CYCLE);
    expect("full-cycles", 1);
    cycle();
    expect("Status.word", 399);
    expect("full-cycles", 1);
}

static void the_interval_is_that_of_the_time_stamps(void **state)
{
    (void)state;
    comes(32, "\x01\x00\x00\x00", 4);
    comes(32, "\x01\x00\x00\x00", 4);
    bus.in[0].stamp_ns = 5000;
    bus.in[1].stamp_ns = 2505000;
    bus.in[1].hardware_stamp = true;
    cycle();
    expect("Status.rx-interval", 0.0025);
    expect("hardware-stamps", 1);
}

static void a_message_can_be_asked_for(void **state)
{
    (void)state;
    set("Status.rx-request", 1);
    cycle();
    assert_int_equal(sent(32), 1);
    for (unsigned i = 0; i < bus.out_count; i++)
        assert_int_equal(bus.out[i].remote, bus.out[i].id == 32);
    expect("Status.rx-request", 0);
    set("Status.rx-request-period-ms", 10);
    for (unsigned i = 0; i < 30; i++)
        cycle();
    assert_int_equal(sent(32), 4);
}

/* ---- sending
 * ---------------------------------------------------------------------------------------------------------- */

static void a_cyclic_message_has_its_period(void **state)
{
    (void)state;
    set("Command.control", 0x000F);
    set("Command.target", -1.5);
    set("Command.brake", 1);
    for (unsigned i = 0; i < 100; i++)
        cycle();
    assert_int_equal(sent(16), 10);
    assert_memory_equal(bus.out[0].data, "\x0F\x00\x24\xFA\xFF\xFF\x01\x00", 8);
    expect("Command.tx-count", 10);
    now_ns += 1000 * MS; /* a pause is not made up for */
    cycle();
    cycle();
    assert_int_equal(sent(16), 11);
}

static void a_message_is_sent_when_it_changes(void **state)
{
    (void)state;
    cycle();
    assert_int_equal(sent(17), 1); /* the first value is news */
    cycle();
    assert_int_equal(sent(17), 1);
    set("Change.tx-inhibit-ms", 5);
    set("Change.level", -2);
    for (unsigned i = 0; i < 3; i++)
        cycle();
    assert_int_equal(sent(17), 1);
    set("Change.level", -3);
    for (unsigned i = 0; i < 10; i++)
        cycle();
    assert_int_equal(sent(17), 2);
    assert_memory_equal(bus.out[bus.out_count - 1u].id == 17 ? bus.out[bus.out_count - 1u].data : bus.out[2].data,
                        "\xFF\xFD", 2);
}

static void a_trigger_sends_once_and_a_disabled_message_never(void **state)
{
    (void)state;
    set("Sync.tx-trigger", 1);
    cycle();
    cycle();
    assert_int_equal(sent(128), 1);
    expect("Sync.tx-trigger", 0);
    set("Sync.tx-enable", 0);
    set("Command.tx-enable", 0);
    set("Sync.tx-trigger", 1);
    const unsigned before = bus.out_count;
    for (unsigned i = 0; i < 50; i++)
        cycle();
    assert_int_equal(bus.out_count, before);
}

static void sync_comes_in_every_cycle_and_after_the_commands(void **state)
{
    (void)state;
    set("Command.tx-period-ms", 0);
    set("Command.tx-every", 1);
    set("Sync.tx-every", 1);
    for (unsigned i = 0; i < 10; i++)
        cycle();
    assert_int_equal(sent(128), 10);
    assert_int_equal(sent(16), 10);
    assert_int_equal(bus.out[bus.out_count - 2u].id, 16);
    assert_int_equal(bus.out[bus.out_count - 1u].id, 128);
    set("Sync.tx-every", 4);
    for (unsigned i = 0; i < 8; i++)
        cycle();
    assert_int_equal(sent(128), 12);
}

static void what_is_no_number_is_not_sent(void **state)
{
    (void)state;
    set("Command.target", 2);
    cycle();
    set("Command.target", NAN);
    for (unsigned i = 0; i < 10; i++)
        cycle();
    assert_int_equal(sent(16), 2);
    for (unsigned i = 0; i < bus.out_count; i++)
        if (bus.out[i].id == 16)
            assert_memory_equal(bus.out[i].data, "\x00\x00\xD0\x07\x00\x00\x00\x00", 8);
}

static void a_full_queue_is_tried_again_with_the_newest_value(void **state)
{
    (void)state;
    bus.send_result = HM2_ERR_NOSPACE;
    set("Change.level", 1);
    cycle();
    cycle();
    expect("Change.tx-errors", 2);
    expect("interface-down", 0);
    set("Change.level", 2);
    bus.send_result = 0;
    cycle();
    assert_int_equal(sent(17), 1);
    for (unsigned i = 0; i < bus.out_count; i++)
        if (bus.out[i].id == 17)
            assert_memory_equal(bus.out[i].data, "\x00\x02", 2);
}

/* ---- faults
 * ----------------------------------------------------------------------------------------------------------- */

static void an_interface_that_is_down_is_told_and_comes_back(void **state)
{
    (void)state;
    bus.receive_result = bus.send_result = HM2_ERR_IO;
    cycle();
    expect("interface-down", 1);
    bus.receive_result = bus.send_result = 0;
    for (unsigned i = 0; i < 10; i++)
        cycle();
    expect("interface-down", 0);
}

static void error_frames_tell_the_controllers_state(void **state)
{
    (void)state;
    comes(0x204, "\0\x20\0\0\0\0\x88\x07", 8);
    bus.in[0].error = true;
    cycle();
    expect("error-passive", 1);
    expect("error-warning", 1);
    expect("tx-error-counter", 0x88);
    expect("rx-error-counter", 7);
    comes(0x40, "\0\0\0\0\0\0\0\0", 8);
    bus.in[1].error = true;
    cycle();
    expect("bus-off", 1);
    comes(0x100, "\0\0\0\0\0\0\0\0", 8);
    bus.in[2].error = true;
    cycle();
    expect("bus-off", 0);
    expect("error-passive", 0);
    expect("error-frames", 3);
    expect("frames-received", 0);
}

static void what_was_lost_is_flagged_and_sent_again(void **state)
{
    (void)state;
    set("Status.rx-timeout-ms", 0);
    comes(32, "\x01\x00\x00\x00", 4);
    cycle();
    expect("Status.rx-timed-out", 0);
    assert_int_equal(sent(17), 1);
    bus.receive_result = HM2_ERR_IO;
    cycle();
    expect("Status.rx-timed-out", 1);
    expect("Status.word", 1);
    bus.receive_result = 0;
    cycle();
    assert_int_equal(sent(17), 2);
    expect("Status.rx-timed-out", 1);
    comes(32, "\x02\x00\x00\x00", 4);
    cycle();
    expect("Status.rx-timed-out", 0);
    assert_int_equal(sent(17), 2);
    hm2_can_tell_bus_off(can, true);
    cycle();
    expect("Status.rx-timed-out", 1);
    const unsigned before = sent(17);
    hm2_can_tell_bus_off(can, false);
    cycle();
    assert_int_equal(sent(17), before + 1u); /* the controller has dropped what was sent meanwhile */
}

static struct hm2_can_bus other;
static unsigned other_sent, other_closed;

static int other_receive(struct hm2_can_bus *const base, struct hm2_can_frame *const frames, const unsigned max)
{
    (void)base;
    (void)frames;
    (void)max;
    return 0;
}

static int other_send(struct hm2_can_bus *const base, const struct hm2_can_frame *const frame)
{
    (void)base;
    other_sent += frame->id == 17u;
    return 0;
}

static void other_close(struct hm2_can_bus *const base)
{
    (void)base;
    other_closed++;
}

static const struct hm2_can_bus_ops other_ops = {other_receive, other_send, other_close};

static void an_interface_that_comes_back_takes_the_place_of_the_old_one(void **state)
{
    (void)state;
    other = (struct hm2_can_bus){.ops = &other_ops, .overruns = 3};
    other_sent = other_closed = 0;
    bus.base.overruns = 2;
    comes(32, "\x01\x00\x00\x00", 4);
    cycle();
    hm2_can_close_old(can); /* there is none */
    hm2_can_replace_bus(can, &other);
    assert_false(bus.closed);
    cycle();
    expect("Status.rx-timed-out", 1);
    expect("frames-lost", 5);
    expect("interface-down", 0);
    assert_int_equal(other_sent, 1);
    hm2_can_close_old(can);
    assert_true(bus.closed);
    hm2_can_close_old(can);
    /* One that no cycle took is closed by the next one, and by the end. */
    struct hm2_can_bus more = {.ops = &other_ops}, most = {.ops = &other_ops};
    hm2_can_replace_bus(can, &more);
    hm2_can_replace_bus(can, &most);
    assert_int_equal(other_closed, 1);
    hm2_can_free(can);
    can = NULL;
    assert_int_equal(other_closed, 3);
}

static void freed_close(struct hm2_can_bus *const base)
{
    free(base);
}

static const struct hm2_can_bus_ops freed_ops = {other_receive, other_send, freed_close};

static void *run_cycles(void *const done)
{
    for (unsigned i = 0; i < 20000; i++)
        cycle();
    atomic_store((atomic_bool *)done, true);
    return NULL;
}

/* A bus that is used after it was closed, or lost, is for the sanitizers to see. */
static void buses_are_replaced_while_cycles_run(void **state)
{
    (void)state;
    pthread_t thread;
    atomic_bool done = false;
    other = (struct hm2_can_bus){.ops = &other_ops};
    hm2_can_replace_bus(can, &other); /* the test's own has room for some frames only */
    cycle();
    assert_int_equal(pthread_create(&thread, NULL, run_cycles, &done), 0);
    do {
        struct hm2_can_bus *const bus_of_heap = calloc(1, sizeof *bus_of_heap);
        assert_non_null(bus_of_heap);
        bus_of_heap->ops = &freed_ops;
        hm2_can_close_old(can);
        hm2_can_replace_bus(can, bus_of_heap);
        hm2_can_tell_bus_off(can, false);
    } while (!atomic_load(&done));
    assert_int_equal(pthread_join(thread, NULL), 0);
    expect("interface-down", 0);
}

static void the_end_of_bus_off_can_be_told(void **state)
{
    (void)state;
    comes(0x40, "\0\0\0\0\0\0\0\0", 8);
    bus.in[0].error = true;
    cycle();
    expect("bus-off", 1);
    hm2_can_tell_bus_off(can, false);
    cycle();
    expect("bus-off", 0);
    hm2_can_tell_bus_off(can, true);
    cycle();
    cycle();
    expect("bus-off", 1);
}

#define WITH_DRIVE(test) cmocka_unit_test_setup_teardown(test, start, stop)

int main(void)
{
    const struct CMUnitTest tests[] = {
        WITH_DRIVE(a_node_has_the_messages_that_are_its_own),
        cmocka_unit_test(without_a_node_everything_is_received),
        cmocka_unit_test(an_unknown_node_is_refused_with_those_there_are),
        WITH_DRIVE(the_newest_frame_is_on_the_pins),
        WITH_DRIVE(every_page_of_a_multiplexed_message_arrives),
        WITH_DRIVE(a_short_frame_and_a_float_that_is_none_are_dropped),
        WITH_DRIVE(age_and_time_out_tell_what_is_old),
        WITH_DRIVE(a_flood_is_worked_off_in_bounded_cycles),
        WITH_DRIVE(the_interval_is_that_of_the_time_stamps),
        WITH_DRIVE(a_message_can_be_asked_for),
        WITH_DRIVE(a_cyclic_message_has_its_period),
        WITH_DRIVE(a_message_is_sent_when_it_changes),
        WITH_DRIVE(a_trigger_sends_once_and_a_disabled_message_never),
        WITH_DRIVE(sync_comes_in_every_cycle_and_after_the_commands),
        WITH_DRIVE(what_is_no_number_is_not_sent),
        WITH_DRIVE(a_full_queue_is_tried_again_with_the_newest_value),
        WITH_DRIVE(an_interface_that_is_down_is_told_and_comes_back),
        WITH_DRIVE(error_frames_tell_the_controllers_state),
        WITH_DRIVE(what_was_lost_is_flagged_and_sent_again),
        WITH_DRIVE(an_interface_that_comes_back_takes_the_place_of_the_old_one),
        WITH_DRIVE(buses_are_replaced_while_cycles_run),
        WITH_DRIVE(the_end_of_bus_off_can_be_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
