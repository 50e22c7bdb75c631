/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "unit.h"

#include <inttypes.h>
#include <unistd.h>

#include <hm2/link.h>

/* A file that the test may write, removed by the caller. */
static void temporary_path(char path[const 64])
{
    (void)snprintf(path, 64, "/tmp/hm2capture.XXXXXX");
    const int fd = mkstemp(path);
    assert_true(fd >= 0);
    assert_int_equal(close(fd), 0);
}

static void read_text(const char *const path, char *const text, const size_t size)
{
    FILE *const file = fopen(path, "r");
    assert_non_null(file);
    text[fread(text, 1, size - 1, file)] = '\0';
    assert_int_equal(fclose(file), 0);
}

/* The session that is recorded, and that must go the same way when it is replayed. */
static void session(struct link *const link)
{
    uint8_t data[16];
    const int64_t start_ns = link_now_ns(link);
    assert_int_equal(link_send(link, "\x01\x42\x00\x01", 4), 0);
    assert_int_equal(link_recv(link, data, sizeof data, start_ns + 1000000), 4);
    assert_memory_equal(data, "\xfe\xca\xaa\x55", 4);
    assert_int_equal(link_now_ns(link) - start_ns, 118000);
    assert_int_equal(link_recv(link, data, sizeof data, start_ns + 1000000), HM2_ERR_TIMEOUT);
    assert_int_equal(link_send(link, "\x02", 1), HM2_ERR_IO);
    assert_int_equal(link_send(link, "", 0), 0);
    assert_int_equal(link_recv(link, data, sizeof data, start_ns + 2000000), 0);
    assert_int_equal(link_recv(link, data, sizeof data, start_ns + 2000000), 1);
    assert_int_equal(link->counters.sent, 2);
    assert_int_equal(link->counters.received, 3);
    assert_int_equal(link->counters.send_errors, 1);
}

static void a_recorded_session_replays_with_the_same_bytes_and_times(void **state)
{
    (void)state;
    char path[64], text[1024];
    struct hm2_diag diag = {0};
    struct link *inner, *link;
    temporary_path(path);
    assert_int_equal(link_mock_script(&inner,
                                      "> 01420001\n! delay 118000\n< fecaaa55\n! senderr\n"
                                      "> -\n< -\n! delay 2500\n< 77\n",
                                      &diag),
                     0);
    link_mock_advance(inner, 5000000); /* times in the capture count from its begin */
    assert_int_equal(link_record_open(&link, inner, path, &diag), 0);
    session(link);
    link_close(link);
    read_text(path, text, sizeof text);
    assert_string_equal(text, "hm2capture 1\n"
                              "0 > 01420001\n"
                              "118000 < fecaaa55\n"
                              "1000000 ! input/output error\n"
                              "1000000 > -\n"
                              "1000000 < -\n"
                              "1002500 < 77\n");
    assert_int_equal(link_replay_open(&link, path, &diag), 0);
    session(link);
    assert_int_equal(link_mock_finish(link, &diag), 0);
    link_close(link);
    assert_int_equal(unlink(path), 0);
}

static void a_request_that_differs_from_the_recorded_one_is_told_with_its_line(void **state)
{
    (void)state;
    static const char text[] = "hm2capture 1\n0 > 01\n5 < aa\n10 > 02\n";
    struct hm2_diag diag = {0};
    struct link *link;
    assert_int_equal(link_replay_text(&link, text, strlen(text), &diag), 0);
    assert_int_equal(link_send(link, "\x01", 1), 0);
    assert_int_equal(link_send(link, "\x03", 1), HM2_ERR_MISMATCH);
    assert_int_equal(link_mock_finish(link, &diag), HM2_ERR_MISMATCH);
    assert_string_equal(diag.text,
                        "Line 4: expected 1 bytes 02, but 1 bytes 03 were sent; they differ from byte 0 on.\n");
    link_close(link);
}

static void a_datagram_too_long_for_the_reader_leaves_a_comment(void **state)
{
    (void)state;
    char path[64], text[256], data[2];
    struct link *inner, *link;
    temporary_path(path);
    assert_int_equal(link_mock_script(&inner, "< 010203\n", NULL), 0);
    assert_int_equal(link_record_open(&link, inner, path, NULL), 0);
    assert_int_equal(link_recv(link, data, sizeof data, 0), HM2_ERR_NOSPACE);
    link_close(link);
    read_text(path, text, sizeof text);
    assert_string_equal(text, "hm2capture 1\n# 0 < longer than the 2 bytes that were asked for\n");
    assert_int_equal(unlink(path), 0);
}

static void a_wrong_capture_is_refused_with_its_line(void **state)
{
    (void)state;
    static const struct {
        const char *text, *says;
    } wrong[] = {
        {"", "The capture is empty"},
        {"# nothing\n", "The capture is empty"},
        {"0 > 01\n", "Capture line 1: this is no capture"},
        {"hm2capture\n", "Capture line 1: this version"},
        {"hm2capture 2\n", "Capture line 1: this version"},
        {"hm2capture 1 x\n", "Capture line 1: this version"},
        {"hm2capture 1\nnow > 01\n", "Capture line 2: expected a time"},
        {"hm2capture 1\n1152921504606846977 > 01\n", "Capture line 2: expected a time"},
        {"hm2capture 1\n-5 > 01\n", "Capture line 2: expected a time"},
        {"hm2capture 1\n5\n", "Capture line 2: expected \">\" (sent)"},
        {"hm2capture 1\n5 >01\n", "Capture line 2: expected \">\" (sent)"},
        {"hm2capture 1\n5 > 01\n4 < 02\n", "Capture line 3: this line is earlier"},
        {"hm2capture 1\n5 > 0\n", "Capture line 2: odd number"},
        {"hm2capture 1\n5 >\n", "Capture line 2: hexadecimal digits"},
        {"hm2capture 1\n5 > xx\n", "Capture line 2: hexadecimal digits"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        struct link *link = NULL;
        struct hm2_diag diag = {0};
        const int err = link_replay_text(&link, wrong[i].text, strlen(wrong[i].text), &diag);
        if (err != HM2_ERR_MALFORMED || link || strncmp(diag.text, wrong[i].says, strlen(wrong[i].says)) != 0)
            fail_msg("row %zu: %d \"%s\"", i, err, diag.text);
    }
}

static void a_capture_of_too_many_datagrams_is_refused(void **state)
{
    (void)state;
    enum { LINES = (1 << 22) + 1, HEADER = 13, LINE = 4 };
    struct hm2_diag diag = {0};
    struct link *link = NULL;
    char *const text = malloc(HEADER + (size_t)LINES * LINE);
    assert_non_null(text);
    memcpy(text, "hm2capture 1\n", HEADER);
    for (size_t i = 0; i < LINES; i++)
        memcpy(text + HEADER + i * LINE, "0 !\n", LINE);
    assert_int_equal(link_replay_text(&link, text, HEADER + (size_t)LINES * LINE, &diag), HM2_ERR_NOSPACE);
    assert_string_equal(diag.text, "Line 4194306: more than 4194304 datagrams.\n");
    assert_null(link);
    free(text);
}

static void files_that_cannot_be_opened_are_named(void **state)
{
    (void)state;
    struct hm2_diag diag = {0};
    struct link *inner, *link = NULL;
    assert_int_equal(link_replay_open(&link, "/nonexistent/file", &diag), HM2_ERR_IO);
    assert_non_null(strstr(diag.text, "/nonexistent/file"));
    hm2_diag_clear(&diag);
    assert_int_equal(link_mock_script(&inner, "", NULL), 0);
    assert_int_equal(link_record_open(&link, inner, "/nonexistent/file", &diag), HM2_ERR_IO);
    assert_non_null(strstr(diag.text, "/nonexistent/file"));
    hm2_diag_clear(&diag);
    assert_int_equal(link_replay_open(&link, "/", &diag), HM2_ERR_IO); /* a folder */
    assert_null(link);
    link_close(inner);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_recorded_session_replays_with_the_same_bytes_and_times),
        cmocka_unit_test(a_request_that_differs_from_the_recorded_one_is_told_with_its_line),
        cmocka_unit_test(a_datagram_too_long_for_the_reader_leaves_a_comment),
        cmocka_unit_test(a_wrong_capture_is_refused_with_its_line),
        cmocka_unit_test(a_capture_of_too_many_datagrams_is_refused),
        cmocka_unit_test(files_that_cannot_be_opened_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
