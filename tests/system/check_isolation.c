/* SPDX-License-Identifier: GPL-2.0-or-later */
/* What hm2_lbp16 does to the network of its cards, and what it leaves of that (tests/system/isolation-peer). */
#include <check.h>
#include <stdio.h>
#include <string.h>

#include "process.h"
#include "suite.h"

#define LIMIT_MS   60000
#define CANNOT_RUN 77

static const struct {
    const char *name;
    bool closed, pinned; /* while it runs */
    bool stays_pinned;   /* afterwards */
    const char *warning; /* NULL = nothing is said */
} cases[] = {
    {"alone", true, true, false, NULL},
    {"shared", false, true, false, "interface host has further addresses, so other programs are not kept off it"},
    {"shared-nft", true, true, false, NULL},
    {"shared-none", false, true, false, NULL},
    {"unprivileged", false, false, false, "without CAP_NET_ADMIN neither hardware addresses are pinned nor"},
    {"killed", true, true, true, NULL},
};

static struct process run;

static void expect(const char *const line)
{
    if (strstr(run.text, line))
        return;
    printf("%s\n", run.text);
    fflush(stdout);
    ck_abort_msg("not \"%s\"", line);
}

START_TEST(a_cards_network_is_closed_to_others_where_that_is_right_and_opened_at_the_end)
{
    const char *const argv[] = {TEST_SOURCE "/tests/system/isolation-peer", TEST_BUILD, cases[_i].name, NULL};
    const char *skip;
    process_run(&run, argv, LIMIT_MS);
    if (run.status == CANNOT_RUN && process_wait_line(&run, "SKIP: ", 0, &skip)) {
        printf("%.*s\n", (int)strcspn(skip, "\n"), skip);
        return;
    }
    expect("loaded\n");
    expect(cases[_i].closed ? "during: rules 1\nduring: other packets: stopped\n"
                            : "during: rules 0\nduring: other packets: passes\n");
    expect(cases[_i].pinned ? "during: card pinned: 1\n" : "during: card pinned: 0\n");
    expect("after: rules 0\nafter: other packets: passes\n");
    expect(cases[_i].stays_pinned ? "after: card pinned: 1\n" : "after: card pinned: 0\n");
    if (cases[_i].warning)
        expect(cases[_i].warning);
    else
        ck_assert_msg(!strstr(run.text, "network: "), "%s", run.text);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("isolation");
    TCase *const tests = tcase_create("network");
    tcase_set_timeout(tests, 90);
    tcase_add_loop_test(tests, a_cards_network_is_closed_to_others_where_that_is_right_and_opened_at_the_end, 0,
                        (int)(sizeof cases / sizeof cases[0]));
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
