/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What the servo thread asks of the kernel. hm2host runs hm2_lbp16 against the simulated card, and every system call of
 * its servo thread is seen by ptrace: one send for each packet, one wait and one receive for the reply, and the
 * thread's own sleep.
 */
#include <check.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "process.h"
#include "suite.h"

#define READY_MS     10000
#define WARM_UP      300 /* cycles: the DPLL sends its set-up for a while */
#define CYCLES       2000
#define MAX_THREADS  32
#define MAX_CALLS    64 /* of a cycle */
#define SYSCALL_STOP (SIGTRAP | 0x80)

/* One system call of the servo thread: its letter, the socket, and the bytes to send. */
struct call {
    char letter;
    long fd, bytes;
};

struct cycle {
    unsigned count;
    struct call calls[MAX_CALLS];
    char letters[MAX_CALLS + 1];
};

struct tracer {
    pid_t leader;
    pid_t asleep[MAX_THREADS]; /* threads whose last call was clock_nanosleep */
    pid_t servo;
    unsigned cycles;
    struct cycle now;
    void (*judge)(const struct cycle *cycle);
};

static struct process sim;
static char address[2][16];

/* ---- one traced thread --------------------------------------------------------------------------------------------
 */

static char letter_of(const long number)
{
    switch (number) {
    case SYS_clock_nanosleep:
        return 'N';
    case SYS_sendto:
        return 'S';
    case SYS_ppoll:
        return 'P';
    case SYS_recvfrom:
        return 'R';
    default:
        return '?';
    }
}

/* The servo thread is the one, other than the program's first, that sends after it has slept. */
static bool is_servo(struct tracer *const t, const pid_t thread, const char letter)
{
    unsigned i = 0;
    if (t->servo || thread == t->leader)
        return thread == t->servo;
    while (i < MAX_THREADS - 1 && t->asleep[i] != thread && t->asleep[i] != 0)
        i++;
    const bool slept = t->asleep[i] == thread;
    t->asleep[i] = letter == 'N' || slept ? thread : 0;
    if (slept && letter == 'S')
        t->servo = thread;
    return slept && letter == 'S';
}

static void end_cycle(struct tracer *const t)
{
    if (t->cycles >= WARM_UP && t->now.count > 0)
        t->judge(&t->now);
    t->cycles++;
    t->now.count = 0;
}

static void add_call(struct tracer *const t, const long number, const unsigned long *const args)
{
    const char letter = letter_of(number);
    if (letter == 'N')
        end_cycle(t);
    /* A thread that spins receives as often as it can; half a list of that is enough. */
    if (letter == 'R' && t->now.count > MAX_CALLS / 2 && t->now.calls[t->now.count - 1].letter == 'R')
        return;
    if (t->now.count == MAX_CALLS)
        ck_abort_msg("cycle %u has more than %d system calls: %s", t->cycles, MAX_CALLS, t->now.letters);
    if (letter == '?' && t->cycles > WARM_UP)
        ck_abort_msg("cycle %u makes system call %ld", t->cycles, number);
    t->now.letters[t->now.count] = letter;
    t->now.letters[t->now.count + 1] = '\0';
    t->now.calls[t->now.count++] = (struct call){letter, (long)args[0], (long)args[2]};
}

/* ---- the traced program -------------------------------------------------------------------------------------------
 */

static void become_traced(const char *const *const argv)
{
    const int nothing = open("/dev/null", O_RDWR);
    dup2(nothing, STDIN_FILENO);
    dup2(nothing, STDOUT_FILENO);
    if (ptrace(PTRACE_TRACEME, 0, NULL, NULL) == 0)
        execv(argv[0], (char *const *)(uintptr_t)argv);
    _exit(127);
}

/* False when ptrace(2) is not permitted. */
static bool start_traced(struct tracer *const t, const char *const *const argv)
{
    int status;
    t->leader = fork();
    if (t->leader == 0)
        become_traced(argv);
    ck_assert_int_eq(waitpid(t->leader, &status, 0), t->leader);
    if (!WIFSTOPPED(status))
        return false;
    const unsigned long options = PTRACE_O_TRACESYSGOOD | PTRACE_O_TRACECLONE | PTRACE_O_EXITKILL;
    return ptrace(PTRACE_SETOPTIONS, t->leader, NULL, options) == 0 &&
           ptrace(PTRACE_SYSCALL, t->leader, NULL, NULL) == 0;
}

static void look(struct tracer *const t, const pid_t thread)
{
    struct __ptrace_syscall_info info;
    if (ptrace(PTRACE_GET_SYSCALL_INFO, thread, sizeof info, &info) <= 0 || info.op != PTRACE_SYSCALL_INFO_ENTRY)
        return;
    const long number = (long)info.entry.nr;
    if (is_servo(t, thread, letter_of(number))) {
        unsigned long args[6];
        for (unsigned i = 0; i < 6; i++)
            args[i] = (unsigned long)info.entry.args[i];
        add_call(t, number, args);
    }
}

static void trace_cycles(struct tracer *const t, const unsigned cycles)
{
    while (t->cycles < WARM_UP + cycles) {
        int status;
        const pid_t thread = waitpid(-1, &status, __WALL);
        if (thread < 0 || thread == sim.pid)
            ck_abort_msg("nothing left to trace, or hm2sim has ended");
        if (!WIFSTOPPED(status)) {
            if (thread == t->leader)
                ck_abort_msg("hm2host has ended with status 0x%X after %u cycles", (unsigned)status, t->cycles);
            continue;
        }
        const int signal = WSTOPSIG(status);
        if (signal == SYSCALL_STOP)
            look(t, thread);
        /* A new thread begins with SIGSTOP; events are reported as SIGTRAP. */
        const bool ours = signal == SYSCALL_STOP || signal == SIGSTOP || signal == SIGTRAP;
        (void)ptrace(PTRACE_SYSCALL, thread, NULL, ours ? 0 : signal);
    }
}

static void start_sim(const char *const faults)
{
    char first[32], second[32];
    test_address(0, address[0]);
    test_address(1, address[1]);
    snprintf(first, sizeof first, "7i96s@%s", address[0]);
    snprintf(second, sizeof second, "7i93@%s", address[1]);
    const char *const argv[] = {
        process_built("hm2sim"), "--realtime", "--faults", faults, "--card", first, "--card", second, NULL};
    process_start(&sim, argv);
    if (!process_wait_line(&sim, "ready ", READY_MS, NULL))
        ck_abort_msg("hm2sim is not ready: %.1000s", sim.text);
    ck_assert_int_eq(setenv("CARD_0", address[0], 1), 0);
    ck_assert_int_eq(setenv("CARD_1", address[1], 1), 0);
}

/* False when it cannot be done here. */
static bool trace_file(const char *const hal_file, const char *const read_timeout, const char *const faults,
                       const unsigned cycles, void (*const judge)(const struct cycle *cycle))
{
    static struct tracer tracer;
    char path[512];
    snprintf(path, sizeof path, "%s/tests/system/hal/%s", TEST_SOURCE, hal_file);
    const char *const argv[] = {process_built("hm2host"), path, NULL};
    ck_assert_int_eq(setenv("READ_TIMEOUT", read_timeout, 1), 0);
    ck_assert_int_eq(setenv("RECEIVE", "wait", 0), 0);
    start_sim(faults);
    tracer = (struct tracer){.judge = judge};
    if (!start_traced(&tracer, argv)) {
        printf("SKIP: system calls cannot be traced here (ptrace)\n");
        process_stop(&sim, SIGKILL, 1000);
        return false;
    }
    trace_cycles(&tracer, cycles);
    kill(tracer.leader, SIGKILL);
    process_stop(&sim, SIGKILL, 1000);
    return true;
}

/* ---- what is expected ---------------------------------------------------------------------------------------------
 */

static long request_bytes, write_bytes;

static void expect_one_card(const struct cycle *const c)
{
    if (strcmp(c->letters, "NSPRS") != 0)
        ck_abort_msg("a cycle calls %s instead of NSPRS (sleep, send, wait, receive, send)", c->letters);
    request_bytes = request_bytes ? request_bytes : c->calls[1].bytes;
    write_bytes = write_bytes ? write_bytes : c->calls[4].bytes;
    ck_assert_int_eq(c->calls[1].bytes, request_bytes);
    ck_assert_int_eq(c->calls[4].bytes, write_bytes);
    ck_assert_int_eq(c->calls[1].fd, c->calls[4].fd);
    ck_assert_int_eq(c->calls[1].fd, c->calls[3].fd);
}

START_TEST(a_cycle_is_one_send_for_each_packet_and_one_wait_and_receive_for_the_reply)
{
    (void)trace_file("cyclic-1.hal", "500000000", "none", CYCLES, expect_one_card);
}
END_TEST

static unsigned long spun_receives;

/* N S R+ S: never a wait. */
static void expect_no_sleep(const struct cycle *const c)
{
    const bool begins = strncmp(c->letters, "NSR", 3) == 0;
    const size_t receives = begins ? strspn(c->letters + 2, "R") : 0;
    if (!begins || strcmp(c->letters + 2 + receives, "S") != 0)
        ck_abort_msg("a cycle calls %s instead of NSR...RS (sleep, send, receives, send)", c->letters);
    spun_receives += receives;
}

START_TEST(spinning_is_receives_alone)
{
    ck_assert_int_eq(setenv("RECEIVE", "spin", 1), 0);
    if (trace_file("cyclic-1.hal", "500000000", "delay=300", CYCLES, expect_no_sleep))
        ck_assert_uint_gt(spun_receives, CYCLES);
}
END_TEST

static void expect_two_cards(const struct cycle *const c)
{
    if (strcmp(c->letters, "NSSPRPRSS") != 0)
        ck_abort_msg("a cycle calls %s instead of NSSPRPRSS", c->letters);
    const long first = c->calls[1].fd, second = c->calls[2].fd;
    ck_assert_int_ne(first, second);
    ck_assert_int_eq(c->calls[4].fd, first);
    ck_assert_int_eq(c->calls[6].fd, second);
    ck_assert_int_eq(c->calls[7].fd, first);
    ck_assert_int_eq(c->calls[8].fd, second);
}

/* Flight recorders ask the kernel for nothing. */
START_TEST(all_cards_are_asked_before_the_first_reply_is_awaited)
{
    ck_assert_int_eq(setenv("FLIGHT_FOLDER", "/tmp", 1), 0);
    (void)trace_file("cyclic-2.hal", "500000000", "none", CYCLES, expect_two_cards);
}
END_TEST

static unsigned extra_receives;

/* Several datagrams may have to be looked at, and a wait may end without any: N S (P? R)+ S */
static void expect_a_bad_network(const struct cycle *const c)
{
    const char *at = c->letters;
    unsigned receives = 0;
    if (strncmp(at, "NS", 2) == 0)
        for (at += 2; *at == 'R' || (at[0] == 'P' && at[1] == 'R'); at += *at == 'P' ? 2 : 1)
            receives++;
    if (receives == 0 || strcmp(at, "S") != 0)
        ck_abort_msg("a cycle calls %s", c->letters);
    extra_receives += receives > 1;
}

START_TEST(a_bad_network_costs_receives_and_nothing_else)
{
    if (trace_file("cyclic-1.hal", "800000", "loss=0.05,dup=0.1,reorder=0.05,truncate=0.05,delay=0-300", CYCLES,
                   expect_a_bad_network))
        ck_assert_uint_gt(extra_receives, CYCLES / 100);
}
END_TEST

static unsigned pipelined_cycles;

/* Receive, send. A reply that is late on a busy machine is waited for; before there is room, and after a return to
 * plain cycles, a cycle is a plain one. */
static void expect_read_ahead(const struct cycle *const c)
{
    pipelined_cycles += strcmp(c->letters, "NRS") == 0;
    if (strcmp(c->letters, "NRS") != 0 && strcmp(c->letters, "NRPRS") != 0 && strcmp(c->letters, "NSPRS") != 0)
        ck_abort_msg("a pipelined cycle calls %s instead of NRS (sleep, receive, send)", c->letters);
}

START_TEST(a_pipelined_cycle_is_one_receive_and_one_send)
{
    enum { FEW = 500, PERIOD_MS = 20 };
    _Static_assert((WARM_UP + FEW) * PERIOD_MS < 20000, "takes less than 20 s");
    if (trace_file("cyclic-pipelined.hal", "500000000", "none", FEW, expect_read_ahead))
        ck_assert_uint_gt(pipelined_cycles, 0); /* how many is a matter of how busy the machine is */
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("cyclic path");
    TCase *const tests = tcase_create("system calls");
    tcase_set_timeout(tests, 90);
    tcase_add_test(tests, a_cycle_is_one_send_for_each_packet_and_one_wait_and_receive_for_the_reply);
    tcase_add_test(tests, spinning_is_receives_alone);
    tcase_add_test(tests, all_cards_are_asked_before_the_first_reply_is_awaited);
    tcase_add_test(tests, a_bad_network_costs_receives_and_nothing_else);
    tcase_add_test(tests, a_pipelined_cycle_is_one_receive_and_one_send);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
