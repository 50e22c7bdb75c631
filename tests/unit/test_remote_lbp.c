/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A simulated remote on a serial line: the recorded exchange byte for byte, errors, and its flash. */
#include "unit.h"

#include "hex.h"
#include "remote_lbp.h"

#define US 1000

static struct remote *remote;
static struct remote_lbp line;
static int64_t now_ns;

static void plug(const char *const name, const uint32_t serial)
{
    struct hm2_diag diag = {.len = 0};
    if (remote_new(&remote, name, serial, &diag) != 0)
        fail_msg("%s", diag.text);
    remote_lbp_init(&line, remote, LBP_SETUP_BAUD);
    now_ns = INT64_C(1000000000);
}

/* Send a message; its answer must be this ("" = none). */
static void say(const char *const message, const char *const expected)
{
    uint8_t bytes[64], wanted[64], answer[LBP_MESSAGE_BYTES] = {0};
    const size_t len = hex_bytes(message, bytes, sizeof bytes), want = hex_bytes(expected, wanted, sizeof wanted);
    size_t got = 0;
    for (size_t i = 0; i < len; i++) {
        assert_int_equal(got, 0);
        now_ns += 87 * US;
        got = remote_lbp_take(&line, bytes[i], now_ns, answer);
    }
    if (got != want || memcmp(answer, wanted, got) != 0)
        fail_msg("answer to %s: %zu bytes, the first 0x%02X", message, got, answer[0]);
}

static void the_recorded_start_is_answered_as_recorded(void **state)
{
    (void)state;
    plug("7i90", 0x345678);
    say("DF 16", "5A A5");
    say("EB 28 B7", "00");
    say("E1 00 B1", "00");
    say("BC 91", "78 56 34 12 29");
    say("D0 57", "37 3D");
    say("D1 09", "49 DA");
    say("D2 EB", "39 22");
    say("D3 B5", "30 BE");
    say("E6 00 DF", "00");
    say("BB 12", "0A 09 00 02 20 02 0E");
    say("45 00 02 B8", "80 02 93");
    say("47 00 03 A9", "A0 18 01 00 00 00 00 00 07");
    say("44 00 03 4D", "A0 AF");
    say("E7 FF 2E", "00");
    say("C7 49", "00 00");
    remote_free(remote);
}

static void errors_are_not_answered_and_can_be_asked_for(void **state)
{
    (void)state;
    plug("7i77-field", 1);
    say("E7 FF 2E", "00");
    say("DF 17", "");
    now_ns += 3000 * US;
    say("C1 94", "01 5E");
    say("C3 28", "01 5E");
    say("E1 00 B1", "00");
    say("44 00", ""); /* and a gap */
    now_ns += 3000 * US;
    say("C1 94", "40 46");
    say("E1 00 B1", "00");
    say("64 00 01 55 BE", "00"); /* into its tables */
    say("C1 94", "20 23");
    assert_int_equal(line.bad, 2);
    remote_free(remote);
}

static void a_reset_makes_nonvolatile_settings_work(void **state)
{
    (void)state;
    plug("7i77-field", 1);
    say("EC 01 66", "00");
    remote_lbp_init(&line, remote, LBP_SETUP_BAUD);
    remote_set_nv_access(remote, LBP_MEMORY_EEPROM);
    assert_true(remote_write(remote, 0x6C8, 100));
    remote_set_nv_access(remote, LBP_MEMORY_WORKING);
    say("44 84 06 66", "32 02");
    say("FE 5A E0", "00");
    say("44 84 06 66", "64 04");
    remote_free(remote);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_recorded_start_is_answered_as_recorded),
        cmocka_unit_test(errors_are_not_answered_and_can_be_asked_for),
        cmocka_unit_test(a_reset_makes_nonvolatile_settings_work),
    };
    return cmocka_run_group_tests_name("remote_lbp", tests, NULL, NULL);
}
