/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include <hm2/link.h>

struct echo {
    int error;
    unsigned copies;
    int64_t delay_ns;
};

static int echo(void *const context, struct link *const mock, const uint8_t *const data, const size_t len)
{
    const struct echo *const how = context;
    for (unsigned i = 0; i < how->copies; i++) {
        const struct link_mock_reply reply = {data, len, how->delay_ns * (int64_t)(i + 1)};
        assert_int_equal(link_mock_push(mock, &reply), 0);
    }
    return how->error;
}

static void replies_arrive_at_their_virtual_time_and_not_before(void **state)
{
    (void)state;
    struct echo how = {.copies = 2, .delay_ns = 1000};
    struct link *link;
    char data[16];
    assert_int_equal(link_mock_open(&link, echo, &how), 0);
    assert_int_equal(link_now_ns(link), 0);
    assert_int_equal(link_send(link, "ab", 2), 0);
    assert_int_equal(link_recv(link, data, sizeof data, 999), HM2_ERR_TIMEOUT);
    assert_int_equal(link_now_ns(link), 999);
    assert_int_equal(link_recv(link, data, sizeof data, 5000), 2);
    assert_memory_equal(data, "ab", 2);
    assert_int_equal(link_now_ns(link), 1000);
    link_mock_advance(link, 1500);
    assert_int_equal(link_recv(link, data, sizeof data, 0), 2); /* queued already: a past deadline gets it */
    assert_int_equal(link_now_ns(link), 2500);
    assert_int_equal(link_recv(link, data, sizeof data, 0), HM2_ERR_TIMEOUT);
    assert_int_equal(link_now_ns(link), 2500);
    assert_int_equal(link->counters.sent, 1);
    assert_int_equal(link->counters.received, 2);
    link_close(link);
}

static void datagrams_are_ordered_by_arrival_then_by_sending(void **state)
{
    (void)state;
    static const struct link_mock_reply replies[] = {{"c", 1, 30}, {"a", 1, 10}, {"b", 1, 20}, {"A", 1, 10}};
    struct echo how = {0};
    struct link *link;
    char data[5] = {0};
    assert_int_equal(link_mock_open(&link, echo, &how), 0);
    for (size_t i = 0; i < 4; i++)
        assert_int_equal(link_mock_push(link, &replies[i]), 0);
    for (size_t i = 0; i < 4; i++)
        assert_int_equal(link_recv(link, data + i, 1, 100), 1);
    assert_string_equal(data, "aAbc");
    link_close(link);
}

static void limits_of_a_mock_are_errors_and_not_overruns(void **state)
{
    (void)state;
    static uint8_t bytes[2049];
    struct echo how = {.error = HM2_ERR_IO};
    struct link *link;
    uint8_t data[10];
    assert_int_equal(link_mock_open(&link, echo, &how), 0);
    assert_int_equal(link_send(link, bytes, 1472), HM2_ERR_IO);
    assert_int_equal(link_send(link, bytes, 1473), HM2_ERR_NOSPACE);
    assert_int_equal(link->counters.send_errors, 2);
    struct link_mock_reply reply = {bytes, sizeof bytes, 0};
    assert_int_equal(link_mock_push(link, &reply), HM2_ERR_NOSPACE);
    reply = (struct link_mock_reply){bytes, 11, -1};
    assert_int_equal(link_mock_push(link, &reply), HM2_ERR_RANGE);
    reply.delay_ns = 0;
    for (unsigned i = 0; i < 64; i++)
        assert_int_equal(link_mock_push(link, &reply), 0);
    assert_int_equal(link_mock_push(link, &reply), HM2_ERR_NOSPACE);
    assert_int_equal(link_recv(link, data, sizeof data, 0), HM2_ERR_NOSPACE); /* longer than cap: consumed */
    assert_int_equal(link_mock_push(link, &reply), 0);
    link_close(link);
    assert_int_equal(link_mock_open(&link, NULL, NULL), HM2_ERR_INVALID);
    link_close(NULL);
}

/* ---- scripts ----------------------------------------------------------------------------------------------------- */

static struct link *script(const char *const text)
{
    struct link *link = NULL;
    struct hm2_diag diag = {0};
    if (link_mock_script(&link, text, &diag) != 0)
        fail_msg("%s", diag.text);
    return link;
}

static void a_script_answers_what_it_expects(void **state)
{
    (void)state;
    struct hm2_diag diag = {0};
    uint8_t data[16];
    struct link *const link = script("# the cookie\n> 01420001\n< FECA AA55 # little endian\n\n>-\n<-");
    assert_int_equal(link_send(link, "\x01\x42\x00\x01", 4), 0);
    assert_int_equal(link_recv(link, data, sizeof data, 0), 4);
    assert_memory_equal(data, "\xfe\xca\xaa\x55", 4);
    assert_int_equal(link_mock_finish(link, &diag), HM2_ERR_MISMATCH); /* the second exchange is missing */
    assert_string_equal(diag.text, "Line 5: expected 0 bytes -, but nothing more was sent.\n");
    assert_int_equal(link_send(link, "", 0), 0);
    assert_int_equal(link_recv(link, data, sizeof data, 0), 0);
    assert_int_equal(link_mock_finish(link, &diag), 0);
    link_close(link);
}

static void every_fault_of_a_script_does_what_its_name_says(void **state)
{
    (void)state;
    struct hm2_diag diag = {0};
    uint8_t data[16];
    struct link *const link = script("! senderr\n"
                                     "> 01\n! lose\n< 11\n"
                                     "> 02\n! dup\n< 22\n"
                                     "> 03\n! delay 500\n< 33\n"
                                     "> 04\n! cut 2\n! garble 1\n< 445566\n< 77\n"
                                     "> 05\n! dup\n! delay 7\n! cut 0\n< 88\n");
    assert_int_equal(link_send(link, "\x01", 1), HM2_ERR_IO);
    assert_int_equal(link_send(link, "\x01", 1), 0);
    assert_int_equal(link_recv(link, data, sizeof data, 100), HM2_ERR_TIMEOUT);
    assert_int_equal(link_send(link, "\x02", 1), 0);
    assert_int_equal(link_recv(link, data, sizeof data, 100), 1);
    assert_int_equal(link_recv(link, data, sizeof data, 100), 1);
    assert_int_equal(data[0], 0x22);
    assert_int_equal(link_recv(link, data, sizeof data, 100), HM2_ERR_TIMEOUT);
    assert_int_equal(link_send(link, "\x03", 1), 0);
    assert_int_equal(link_recv(link, data, sizeof data, 599), HM2_ERR_TIMEOUT);
    assert_int_equal(link_recv(link, data, sizeof data, 600), 1);
    assert_int_equal(link_send(link, "\x04", 1), 0);
    assert_int_equal(link_recv(link, data, sizeof data, 0), 2);
    assert_int_equal(data[0], 0x44);
    assert_int_equal(data[1], 0x55 ^ 0x10);
    assert_int_equal(link_recv(link, data, sizeof data, 0), 1);
    assert_int_equal(data[0], 0x77); /* faults end with the reply that they met */
    assert_int_equal(link_send(link, "\x05", 1), 0);
    assert_int_equal(link_recv(link, data, sizeof data, 607), 0);
    assert_int_equal(link_recv(link, data, sizeof data, 607), 0);
    assert_int_equal(link_now_ns(link), 607);
    assert_int_equal(link_mock_finish(link, &diag), 0);
    assert_int_equal(link->counters.send_errors, 1);
    assert_int_equal(link->counters.sent, 5);
    link_close(link);
}

static void a_send_that_differs_is_refused_and_told_with_its_line(void **state)
{
    (void)state;
    struct hm2_diag diag = {0};
    struct link *link = script("> 0102\n> 030405\n");
    assert_int_equal(link_send(link, "\x01\x02", 2), 0);
    assert_int_equal(link_send(link, "\x03\x44\x05", 3), HM2_ERR_MISMATCH);
    assert_int_equal(link_send(link, "\x03\x04\x05", 3), HM2_ERR_MISMATCH); /* the first failure sticks */
    assert_int_equal(link_mock_finish(link, &diag), HM2_ERR_MISMATCH);
    assert_string_equal(diag.text,
                        "Line 2: expected 3 bytes 030405, but 3 bytes 034405 were sent; they differ from byte 1 on.\n");
    link_close(link);
    hm2_diag_clear(&diag);
    link = script("> 01\n");
    assert_int_equal(link_send(link, "\x01", 1), 0);
    assert_int_equal(link_send(link, "\x02", 1), HM2_ERR_MISMATCH);
    assert_int_equal(link_mock_finish(link, &diag), HM2_ERR_MISMATCH);
    assert_string_equal(diag.text, "After the last line: 1 bytes 02 were sent, nothing was expected.\n");
    link_close(link);
}

static void replies_before_the_first_request_come_unasked(void **state)
{
    (void)state;
    uint8_t data[16];
    struct link *const link = script("! delay 3\n< aa\n> 01\n");
    assert_int_equal(link_recv(link, data, sizeof data, 2), HM2_ERR_TIMEOUT);
    assert_int_equal(link_recv(link, data, sizeof data, 3), 1);
    link_close(link);
}

static void more_replies_than_can_wait_are_told(void **state)
{
    (void)state;
    struct hm2_diag diag = {0};
    struct link *link = NULL;
    char text[1024] = "> 01\n";
    for (unsigned i = 0; i < 65; i++)
        memcpy(text + 5 + 5 * i, "< aa\n", 6);
    link = script(text);
    assert_int_equal(link_send(link, "\x01", 1), HM2_ERR_NOSPACE);
    assert_int_equal(link_mock_finish(link, &diag), HM2_ERR_NOSPACE);
    assert_string_equal(diag.text, "Line 66: more than 64 replies wait to be received.\n");
    link_close(link);
    link = NULL;
    hm2_diag_clear(&diag);
    assert_int_equal(link_mock_script(&link, text + 5, &diag), HM2_ERR_NOSPACE);
    assert_null(link);
}

static void a_wrong_script_is_refused_with_its_line(void **state)
{
    (void)state;
    static const struct {
        const char *text, *says;
    } wrong[] = {
        {"> 01\n= 02\n", "Script line 2: expected \">\""},
        {"> 0\n", "Script line 1: odd number"},
        {"> 0g\n", "Script line 1: hexadecimal digits expected"},
        {">\n", "Script line 1: hexadecimal digits expected"},
        {"\n\n!\n", "Script line 3: \"!\" needs the name"},
        {"! explode\n", "Script line 1: unknown fault"},
        {"! lose 3\n< aa", "Script line 1: delay needs nanoseconds"},
        {"! delay\n< aa", "Script line 1: delay needs nanoseconds"},
        {"! delay -1\n< aa", "Script line 1: number out of range"},
        {"! delay 99999999999999999999999\n< aa", "Script line 1: number out of range"},
        {"! delay 1 2\n< aa", "Script line 1: nothing may follow"},
        {"! senderr 1\n", "Script line 1: senderr takes no number"},
        {"! cut 2\n< aa\n", "Script line 2: \"! cut\" asks for more"},
        {"! garble 1\n< aa\n", "Script line 2: \"! garble\" names a byte"},
        {"! cut 0\n! garble 0\n< aa\n", "Script line 3: \"! garble\" names a byte"},
        {"! dup\n> 01\n", "Script line 1: a fault, but no reply"},
        {"> 01\n! dup\n", "Script line 2: a fault, but no reply"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        struct link *link = NULL;
        struct hm2_diag diag = {0};
        const int err = link_mock_script(&link, wrong[i].text, &diag);
        if (err != HM2_ERR_MALFORMED || link || strncmp(diag.text, wrong[i].says, strlen(wrong[i].says)) != 0)
            fail_msg("row %zu: %d \"%s\"", i, err, diag.text);
    }
}

static void a_datagram_longer_than_a_client_can_send_is_refused(void **state)
{
    (void)state;
    static char text[2 * 2049 + 3];
    struct link *link = NULL;
    struct hm2_diag diag = {0};
    memset(text, '0', sizeof text - 1);
    text[0] = '<';
    assert_int_equal(link_mock_script(&link, text, &diag), HM2_ERR_MALFORMED); /* 2049 bytes of reply */
    assert_non_null(strstr(diag.text, "longer than a datagram"));
    hm2_diag_clear(&diag);
    text[0] = '>';
    text[1 + 2 * 1473] = '\0';
    assert_int_equal(link_mock_script(&link, text, &diag), HM2_ERR_MALFORMED);
    assert_non_null(strstr(diag.text, "more than 1472 bytes"));
}

static void finish_of_a_link_without_script_is_an_error_not_a_crash(void **state)
{
    (void)state;
    struct echo how = {0};
    struct link *link;
    assert_int_equal(link_mock_open(&link, echo, &how), 0);
    assert_int_equal(link_mock_finish(link, NULL), HM2_ERR_STATE);
    link_close(link);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(replies_arrive_at_their_virtual_time_and_not_before),
        cmocka_unit_test(datagrams_are_ordered_by_arrival_then_by_sending),
        cmocka_unit_test(limits_of_a_mock_are_errors_and_not_overruns),
        cmocka_unit_test(a_script_answers_what_it_expects),
        cmocka_unit_test(every_fault_of_a_script_does_what_its_name_says),
        cmocka_unit_test(a_send_that_differs_is_refused_and_told_with_its_line),
        cmocka_unit_test(replies_before_the_first_request_come_unasked),
        cmocka_unit_test(more_replies_than_can_wait_are_told),
        cmocka_unit_test(a_wrong_script_is_refused_with_its_line),
        cmocka_unit_test(a_datagram_longer_than_a_client_can_send_is_refused),
        cmocka_unit_test(finish_of_a_link_without_script_is_an_error_not_a_crash),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
