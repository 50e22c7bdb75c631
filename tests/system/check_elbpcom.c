/* SPDX-License-Identifier: GPL-2.0-or-later */
/* elbpcom with a simulated card: the sample runs of the manuals (seeds 000 and 001, "ELBPCOM"), typed and scripted. */
#include <check.h>
#include <poll.h>
#include <pty.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "process.h"
#include "simulator.h"
#include "suite.h"

#define END_MS   20000
#define REPLY_MS 10000
/* Replies on loopback come at once; a busy machine may take its time. */
#define PATIENT "10"

static struct simulator sim;
static struct process console;

/* Run it with these lines as its standard input; returns its status. */
static int run_script(const char *const *options, const char *const lines)
{
    const char *argv[16] = {process_built("elbpcom")};
    for (unsigned i = 0; options[i]; i++)
        argv[i + 1] = options[i];
    process_start_listening(&console, argv);
    process_say(&console, lines);
    process_hush(&console);
    ck_assert_msg(process_wait_end(&console, END_MS), "%s", console.text);
    return console.status;
}

/* The card's address as its EEPROM holds it: the last byte first. */
static const char *address_hex(const unsigned card)
{
    static char text[16];
    unsigned a, b, c, d;
    ck_assert_int_eq(sscanf(sim.address[card], "%u.%u.%u.%u", &a, &b, &c, &d), 4);
    snprintf(text, sizeof text, "%02x%02x%02x%02x", d, c, b, a);
    return text;
}

START_TEST(the_sample_run_of_the_manuals_works_as_a_script)
{
    static const char *const cards[] = {"7i96s", "7i93"};
    char expected[128];
    simulator_start(&sim, (const char *const[]){"--card", cards[_i], NULL});
    const char *const options[] = {"--ip", sim.address[0], "--timeout", PATIENT, NULL};
    const int status = run_script(options, "01420001 ; read hostmot2 cookie at 0x100\n"
                                           "\n"
                                           "82492000 ; read EEPROM IP address at 0x0020\n"
                                           "01D91A00025A82C920000100a8C0; write EEPROM IP address\n"
                                           "82492000\n");
    ck_assert_msg(status == 0, "%s", console.text);
    snprintf(expected, sizeof expected, "fecaaa55\n%s\n0100a8c0\n", address_hex(0));
    ck_assert_str_eq(console.text, expected);
    simulator_stop(&sim);
}
END_TEST

/* What a terminal shows until it shows `text` after what it has shown already, or until the program ends (NULL). */
static void read_terminal(const int terminal, char shown[1024], const char *const text)
{
    size_t len = strlen(shown);
    const size_t seen = len;
    struct pollfd ready = {.fd = terminal, .events = POLLIN};
    while (!text || !strstr(shown + seen, text)) {
        ck_assert_msg(poll(&ready, 1, REPLY_MS) == 1, "%s", shown);
        const ssize_t got = read(terminal, shown + len, 1023 - len);
        if (got <= 0 && !text)
            return;
        ck_assert_msg(got > 0, "%s", shown);
        len += (size_t)got;
        shown[len] = '\0';
    }
}

static void type(const int terminal, const char *const text)
{
    ck_assert_int_eq(write(terminal, text, strlen(text)), (ssize_t)strlen(text));
}

START_TEST(a_terminal_gets_prompts_and_may_go_on_after_mistakes)
{
    char shown[1024] = "", expected[256];
    int terminal, status;
    simulator_start(&sim, NULL);
    const char *const program = process_built("elbpcom");
    const pid_t pid = forkpty(&terminal, NULL, NULL, NULL);
    ck_assert_int_ge(pid, 0);
    if (pid == 0) {
        execl(program, program, "--ip", sim.address[0], "--timeout", PATIENT, (char *)NULL);
        _exit(127);
    }
    read_terminal(terminal, shown, ">");
    type(terminal, "01420001\n");
    read_terminal(terminal, shown, "55\r\n>");
    type(terminal, "0142000\n");
    read_terminal(terminal, shown, "01420001\r\n>"); /* the end of the complaint */
    type(terminal, "82492000\n");
    read_terminal(terminal, shown, "7f\r\n>");
    type(terminal, "\x04");
    read_terminal(terminal, shown, NULL);
    ck_assert_int_eq(waitpid(pid, &status, 0), pid);
    ck_assert_int_eq(status, 0);
    close(terminal);
    snprintf(expected, sizeof expected,
             ">01420001\r\n> fecaaa55\r\n>0142000\r\nelbpcom: line 2 \"0142000\": an odd number of hexadecimal "
             "digits, e.g. 01420001\r\n>82492000\r\n> %s\r\n>\r\n",
             address_hex(0));
    ck_assert_str_eq(shown, expected);
    simulator_stop(&sim);
}
END_TEST

START_TEST(arguments_are_datagrams_too)
{
    simulator_start(&sim, NULL);
    const char *const argv[] = {
        process_built("elbpcom"), "--ip", sim.address[0], "--timeout", PATIENT, "0142 0001", "01420401", NULL};
    ck_assert_int_eq(process_run(&console, argv, END_MS), 0);
    ck_assert_str_eq(console.text, "fecaaa55\n484f5354\n");
    simulator_stop(&sim);
}
END_TEST

START_TEST(silence_of_the_card_ends_a_script_with_1)
{
    simulator_start(&sim, NULL);
    simulator_do(&sim, "freeze on");
    const char *const options[] = {"--ip", sim.address[0], "--timeout", "0.05", NULL};
    ck_assert_int_eq(run_script(options, "01420001\n01420001\n"), 1);
    ck_assert_str_eq(console.text, "No answer\n");
    simulator_stop(&sim);
}
END_TEST

static const struct {
    const char *line, *complaint;
} mistakes[] = {
    {"0142000", "odd number"},
    {"0142zz", "expected hexadecimal"},
    {"hello", "expected hexadecimal"},
};

START_TEST(what_is_not_hexadecimal_is_not_sent_and_ends_a_script_with_2)
{
    simulator_start(&sim, NULL);
    char lines[64];
    const char *const options[] = {"--ip", sim.address[0], "--timeout", PATIENT, NULL};
    snprintf(lines, sizeof lines, "01420001\n%s\n01420001\n", mistakes[_i].line);
    ck_assert_int_eq(run_script(options, lines), 2);
    ck_assert_msg(strstr(console.text, mistakes[_i].complaint) && strstr(console.text, "line 2"), "%s", console.text);
    ck_assert_msg(strstr(simulator_ask(&sim, "stats"), "requests 1 "), "%s", console.text);
    simulator_stop(&sim);
}
END_TEST

START_TEST(wrong_options_are_refused)
{
    const char *const timeout[] = {process_built("elbpcom"), "--timeout", "soon", NULL};
    ck_assert_int_eq(process_run(&console, timeout, END_MS), 2);
    ck_assert_msg(strstr(console.text, "expected seconds"), "%s", console.text);
    const char *const nowhere[] = {process_built("elbpcom"), "--ip", "10.0.0", "01420001", NULL};
    ck_assert_int_eq(process_run(&console, nowhere, END_MS), 3);
    ck_assert_msg(strstr(console.text, "A.B.C.D"), "%s", console.text);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("elbpcom");
    TCase *const tests = tcase_create("program");
    tcase_set_timeout(tests, 60);
    tcase_add_loop_test(tests, the_sample_run_of_the_manuals_works_as_a_script, 0, 2);
    tcase_add_test(tests, a_terminal_gets_prompts_and_may_go_on_after_mistakes);
    tcase_add_test(tests, arguments_are_datagrams_too);
    tcase_add_test(tests, silence_of_the_card_ends_a_script_with_1);
    tcase_add_loop_test(tests, what_is_not_hexadecimal_is_not_sent_and_ends_a_script_with_2, 0,
                        (int)(sizeof mistakes / sizeof mistakes[0]));
    tcase_add_test(tests, wrong_options_are_refused);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
