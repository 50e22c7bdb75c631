/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The serial link, on a pseudo-terminal whose other end is the test's. */
#include "unit.h"

#include <fcntl.h>
#include <termios.h>
#include <unistd.h>

#include <hm2/link.h>

#define NS_PER_MS INT64_C(1000000)
#define SOON_NS   (10000 * NS_PER_MS)

static int far_end;
static char path[64];
static struct hm2_diag diag;

static int open_pair(void **state)
{
    (void)state;
    hm2_diag_clear(&diag);
    far_end = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (far_end < 0 || grantpt(far_end) != 0 || unlockpt(far_end) != 0)
        return -1;
    return ptsname_r(far_end, path, sizeof path);
}

static int close_pair(void **state)
{
    (void)state;
    return close(far_end);
}

static struct link *open_link(void)
{
    struct link *link = NULL;
    if (link_tty_open(&link, path, 115200, &diag) != 0)
        fail_msg("%s", diag.text);
    return link;
}

static void every_byte_goes_both_ways_unchanged(void **state)
{
    (void)state;
    struct link *const link = open_link();
    uint8_t all[256], got[256];
    size_t len = 0;
    for (unsigned i = 0; i < sizeof all; i++)
        all[i] = (uint8_t)i;
    assert_int_equal(link_send(link, all, sizeof all), 0);
    while (len < sizeof got) {
        const ssize_t n = read(far_end, got + len, sizeof got - len);
        assert_true(n > 0);
        len += (size_t)n;
    }
    assert_memory_equal(got, all, sizeof all);
    memset(got, 0, sizeof got);
    assert_int_equal(write(far_end, all, sizeof all), sizeof all);
    for (len = 0; len < sizeof got;) {
        const int n = link_recv(link, got + len, sizeof got - len, link_now_ns(link) + SOON_NS);
        assert_true(n > 0);
        len += (size_t)n;
    }
    assert_memory_equal(got, all, sizeof all);
    link_close(link);
}

static void the_deadline_is_honoured_and_a_past_one_takes_what_is_there(void **state)
{
    (void)state;
    struct link *const link = open_link();
    uint8_t data[8];
    const int64_t deadline_ns = link_now_ns(link) + 5 * NS_PER_MS;
    assert_int_equal(link_recv(link, data, sizeof data, deadline_ns), HM2_ERR_TIMEOUT);
    assert_true(link_now_ns(link) >= deadline_ns);
    assert_int_equal(link_recv(link, data, sizeof data, INT64_MIN), HM2_ERR_TIMEOUT);
    assert_int_equal(write(far_end, "abc", 3), 3);
    assert_int_equal(link_recv(link, data, 1, link_now_ns(link) + SOON_NS), 1);
    assert_int_equal(link_recv(link, data, sizeof data, INT64_MIN), 2);
    assert_memory_equal(data, "bc", 2);
    link_close(link);
}

static void a_port_has_one_owner_and_gets_its_settings_back(void **state)
{
    (void)state;
    struct link *second = NULL;
    struct termios before, after;
    const int watch = open(path, O_RDWR | O_NOCTTY | O_CLOEXEC);
    assert_true(watch >= 0);
    assert_int_equal(tcgetattr(watch, &before), 0);
    struct link *const link = open_link();
    assert_int_equal(link_tty_open(&second, path, 115200, &diag), HM2_ERR_STATE);
    assert_non_null(strstr(diag.text, "another program has it"));
    assert_int_equal(tcgetattr(watch, &after), 0);
    assert_int_equal(cfgetospeed(&after), B115200);
    assert_int_equal(after.c_lflag & (tcflag_t)(ICANON | ECHO), 0);
    link_close(link);
    assert_int_equal(tcgetattr(watch, &after), 0);
    assert_int_equal(after.c_lflag, before.c_lflag);
    (void)close(watch);
    link_close(open_link());
}

static void what_is_no_port_is_refused(void **state)
{
    (void)state;
    struct link *link = NULL;
    assert_int_equal(link_tty_open(&link, path, 1250000, &diag), HM2_ERR_RANGE);
    assert_non_null(strstr(diag.text, "Baud rate 1250000"));
    assert_int_equal(link_tty_open(&link, "/dev/null", 115200, &diag), HM2_ERR_INVALID);
    assert_int_equal(link_tty_open(&link, "/dev/no-such-port", 115200, &diag), HM2_ERR_IO);
    assert_non_null(strstr(diag.text, "/dev/no-such-port: No such file"));
}

static void a_port_that_goes_away_is_an_error(void **state)
{
    (void)state;
    struct link *const link = open_link();
    uint8_t data[8];
    (void)close(far_end);
    assert_int_equal(link_recv(link, data, sizeof data, link_now_ns(link) + SOON_NS), HM2_ERR_IO);
    assert_int_equal(link_send(link, "a", 1), HM2_ERR_IO);
    link_close(link);
    assert_int_equal(open_pair(state), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(every_byte_goes_both_ways_unchanged, open_pair, close_pair),
        cmocka_unit_test_setup_teardown(the_deadline_is_honoured_and_a_past_one_takes_what_is_there, open_pair,
                                        close_pair),
        cmocka_unit_test_setup_teardown(a_port_has_one_owner_and_gets_its_settings_back, open_pair, close_pair),
        cmocka_unit_test_setup_teardown(what_is_no_port_is_refused, open_pair, close_pair),
        cmocka_unit_test_setup_teardown(a_port_that_goes_away_is_an_error, open_pair, close_pair),
    };
    return cmocka_run_group_tests_name("link_tty", tests, NULL, NULL);
}
