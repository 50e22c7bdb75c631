/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The page that hm2flash --report writes, as a browser (headless Chromium) understands it. */
#include <check.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "flash_rig.h"
#include "suite.h"

#define BROWSER_MS 120000

static struct simulator sim;
static struct process client;
static struct process browser; /* large */

static unsigned count(const char *text, const char *const what)
{
    unsigned found = 0;
    for (; (text = strstr(text, what)) != NULL; text += strlen(what))
        found++;
    return found;
}

static const char *make_report_of(const char *const *const options, const char *const device)
{
    const char *const page = flash_rig_path("report.html");
    simulator_start(&sim, options);
    const int status = flash_rig_run(&client, process_built("hm2flash"), device, sim.address[0],
                                     (const char *const[]){"--report", page, NULL});
    if (status != 0)
        ck_abort_msg("hm2flash --report: %d: %s", status, client.text);
    simulator_stop(&sim);
    return page;
}

static const char *make_report(const char *const type, const char *const device)
{
    return make_report_of((const char *const[]){"--card", type, NULL}, device);
}

/* Run the browser on the page with one more option; false when there is none. */
static bool browse(const char *const page, const char *const option)
{
    char profile[160], dir[200], url[200];
    snprintf(profile, sizeof profile, "/tmp/check-browser-%d-XXXXXX", (int)getpid());
    if (!process_find("chromium")) {
        printf("SKIP: chromium is not installed\n");
        return false;
    }
    ck_assert_ptr_nonnull(mkdtemp(profile));
    snprintf(dir, sizeof dir, "--user-data-dir=%s", profile);
    snprintf(url, sizeof url, "file://%s", page);
    const char *const argv[] = {"chromium",
                                "--headless",
                                "--no-sandbox",
                                "--disable-gpu",
                                "--disable-quic",
                                "--no-first-run",
                                "--disable-background-networking",
                                "--disable-component-update",
                                "--disable-sync",
                                dir,
                                option,
                                url,
                                NULL};
    const int status = process_run(&browser, argv, BROWSER_MS);
    const char *const clean[] = {"rm", "-rf", profile, NULL};
    ck_assert_int_eq(process_run(&client, clean, BROWSER_MS), 0);
    if (status != 0)
        ck_abort_msg("chromium: %d: %s", status, browser.text);
    return true;
}

static void shows(const char *const text)
{
    if (!strstr(browser.text, text))
        ck_abort_msg("\"%s\" is not on the page: %s", text, browser.text);
}

START_TEST(a_7i96s_is_shown_with_its_terminals_and_its_db25)
{
    const char *const page = make_report("7i96s", "7i96s");
    if (!browse(page, "--dump-dom"))
        return;
    shows("<h1>7I96S</h1>");
    shows("<title>7I96S</title>");
    shows("T20F256");
    shows("Efinix fallback image");
    shows("16Mb (id: 0x14)");
    shows("<td>StepGen</td><td class=\"n\">5</td>");
    shows("<td>TB3-13,14</td><td class=\"n\">11</td><td>SSR</td>");
    shows("1 channel on the connectors");
    shows("None answers.");
    ck_assert_uint_eq(count(browser.text, "<svg class=\"pinout\""), 3);
    ck_assert_uint_eq(count(browser.text, "<rect class=\"pin "), 34);
    ck_assert_uint_eq(count(browser.text, "<circle "), 25);
    ck_assert_uint_eq(count(browser.text, "<circle class=\"gnd\""), 8);
    ck_assert_uint_eq(count(browser.text, "<tr><td>P1-"), 17);
}
END_TEST

START_TEST(remotes_are_shown_with_their_modes)
{
    static const char *const options[] = {"--realtime", "--card", "7i96s_7i77d", "--remote", "0:0=7i77", NULL};
    const char *const page = make_report_of(options, "7i96s");
    if (!browse(page, "--dump-dom"))
        return;
    shows("<td class=\"n\">0</td><td class=\"n\">0</td><td>7I77 GPIO</td><td>0x1200");
    shows("<td>7I77 ANALOG</td><td>0x1100");
    shows("0: IO_Only, 1: IO_Ana,");
    shows("0: Analog</td>");
    ck_assert_ptr_null(strstr(browser.text, "could be asked"));
}
END_TEST

START_TEST(a_7i93_is_shown_with_its_headers)
{
    const char *const page = make_report("7i93", "7i93");
    if (!browse(page, "--dump-dom"))
        return;
    shows("<h1>7I93</h1>");
    shows("boot block");
    ck_assert_uint_eq(count(browser.text, "<circle "), 100);
    ck_assert_uint_eq(count(browser.text, "<circle class=\"gnd\""), 52);
    shows("<title>1: I/O 0 QCount 1 Quad-B</title>");
    shows("<title>47: I/O 47 PWM 6 /Enable</title>");
}
END_TEST

START_TEST(the_page_needs_nothing_beside_itself_and_can_be_drawn)
{
    char option[200];
    struct stat st;
    const char *const page = make_report("7i96s", "7i96s");
    size_t len;
    const char *const text = (const char *)flash_rig_read(page, &len);
    ck_assert_ptr_null(strstr(text, "http"));
    ck_assert_ptr_null(strstr(text, "src="));
    ck_assert_ptr_null(strstr(text, "<script"));
    ck_assert_ptr_null(strstr(text, "<link"));
    snprintf(option, sizeof option, "--screenshot=%s", flash_rig_path("page.png"));
    if (!browse(page, option))
        return;
    ck_assert_int_eq(stat(flash_rig_path("page.png"), &st), 0);
    ck_assert_int_gt((int)st.st_size, 5000); /* an empty page has fewer */
}
END_TEST

START_TEST(a_page_that_cannot_be_written_is_an_error_and_leaves_nothing)
{
    simulator_start(&sim, NULL);
    ck_assert_int_eq(flash_rig_run(&client, process_built("hm2flash"), "7i96s", sim.address[0],
                                   (const char *const[]){"--report", "/nowhere/page.html", NULL}),
                     1);
    ck_assert_ptr_nonnull(strstr(client.text, "Can't create file '/nowhere/page.html': No such file"));
    simulator_stop(&sim);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("report");
    TCase *const tests = tcase_create("page");
    tcase_set_timeout(tests, 300);
    tcase_add_checked_fixture(tests, NULL, flash_rig_clean);
    tcase_add_test(tests, a_7i96s_is_shown_with_its_terminals_and_its_db25);
    tcase_add_test(tests, remotes_are_shown_with_their_modes);
    tcase_add_test(tests, a_7i93_is_shown_with_its_headers);
    tcase_add_test(tests, the_page_needs_nothing_beside_itself_and_can_be_drawn);
    tcase_add_test(tests, a_page_that_cannot_be_written_is_an_error_and_leaves_nothing);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
