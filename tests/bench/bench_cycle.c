/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * One servo cycle of a driver, measured from inside: wall time of read and write, or the user instructions they take.
 *
 *     bench_cycle time  DRIVER PREFIX CYCLES FOLDER [component arguments...]
 *     bench_cycle count DRIVER PREFIX CYCLES FOLDER [component arguments...]
 *     bench_cycle misses DRIVER PREFIX CYCLES FOLDER [component arguments...]
 *     bench_cycle echo  ADDRESS PORT REQUEST_BYTES REPLY_BYTES WRITE_BYTES CYCLES
 *     bench_cycle same  ADDRESS PORT REQUEST_BYTES REPLY_BYTES WRITE_BYTES CYCLES INTERFACE
 *                       DRIVER PREFIX FOLDER [component arguments...]
 *     bench_cycle serve ADDRESS PORT REQUEST_BYTES REPLY_BYTES
 *
 * DRIVER is hm2_lbp16, or hm2_eth (LinuxCNC's, with hostmot2 before it). PREFIX names the first card, "hm2_7i93.0", or
 * with "*N" behind it the first of N cards of its kind, whose .read and then .write stand in one thread. The component
 * is loaded into the small HAL host in this process; a 1 kHz thread calls PREFIX.read and PREFIX.write with marks of
 * our own around them. Instructions are counted by single-stepping that thread from another process: exact, and without
 * the kernel's share. `misses` counts the cycles that failed, with the driver's own deadline. `echo` exchanges packets
 * of the same sizes with `serve`, with nothing but the system calls; `same` exchanges the very packets of a cycle of
 * the driver with the card, so that the card's work is the same.
 */
#include <arpa/inet.h>
#include <errno.h>
#include <linux/if_packet.h>
#include <net/ethernet.h>
#include <net/if.h>
#include <netinet/ip.h>
#include <netinet/udp.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "halhost.h"
#include "session.h"
#include "state.h"
#include "steps.h"
#include "table.h"
#include "timing.h"

#define MAX_CARDS 16

/* ---- results ----------------------------------------------------------------------------------------------------- */

static void print_cycle_times(int64_t *const read_ns, int64_t *const write_ns, const int cycles)
{
    int64_t *const both = malloc((size_t)cycles * sizeof *both);
    if (!both)
        exit(1);
    for (int i = 0; i < cycles; i++)
        both[i] = read_ns[i] + write_ns[i];
    print_times("cycle", both, cycles);
    print_times("read", read_ns, cycles);
    print_times("write", write_ns, cycles);
    free(both);
}

/* ---- the driver under test --------------------------------------------------------------------------------------- */

static void print_message(const void *const context, const enum halhost_stream stream, const char *const text)
{
    (void)context;
    (void)stream;
    fputs(text, stderr);
}

static void load(const char *const name, char **const arguments, const int count)
{
    struct hm2_diag diag = {0};
    const char *list[16];
    for (int i = 0; i < count && i < 16; i++)
        list[i] = arguments[i];
    if (halhost_load(name, list, (size_t)count, &diag) != 0) {
        fprintf(stderr, "bench_cycle: %s", diag.text);
        exit(1);
    }
}

/* ---- marks: functions of our own around the driver's in the thread ----------------------------------------------- */

struct shared {
    _Atomic int thread;      /* kernel's number of the realtime thread */
    _Atomic int cycle;       /* complete ones */
    _Atomic unsigned errors; /* the driver's packet-error-total */
    struct step_code code;   /* of the driver */
};

static struct shared *shared;
static int64_t mark_ns[3], mark_thread_ns;
static int64_t *read_times, *write_times, *read_thread_times;
static int wanted_cycles, seen_cycles;
static hal_u32_t **errors; /* of each card */
static unsigned cards = 1;
static bool own_deadline;
static unsigned first_errors; /* of the warm-up */

static void mark_begin(void *const arg, const long period)
{
    (void)arg;
    (void)period;
    shared->thread = (int)gettid();
    mark_thread_ns = thread_ns();
    mark_ns[0] = now_ns();
}

static void mark_middle(void *const arg, const long period)
{
    (void)arg;
    (void)period;
    mark_ns[1] = now_ns();
    mark_thread_ns = thread_ns() - mark_thread_ns;
    mark_ns[2] = now_ns();
}

static void mark_end(void *const arg, const long period)
{
    (void)arg;
    (void)period;
    const int64_t end_ns = now_ns();
    const int at = seen_cycles++ - WARM_UP;
    if (at >= 0 && at < wanted_cycles) {
        read_times[at] = mark_ns[1] - mark_ns[0];
        read_thread_times[at] = mark_thread_ns;
        write_times[at] = end_ns - mark_ns[2];
    }
    unsigned sum = 0;
    for (unsigned i = 0; i < cards; i++)
        sum += *errors[i];
    shared->errors = sum;
    if (at < 0)
        first_errors = sum;
    shared->cycle++;
}

static int marks_id;

static int marks_main(void *const block)
{
    (void)block;
    marks_id = hal_init("marks");
    errors = marks_id < 0 ? NULL : hal_malloc(MAX_CARDS * (long)sizeof *errors);
    for (unsigned i = 0; errors && i < cards; i++) {
        char name[32];
        snprintf(name, sizeof name, "mark.errors.%u", i);
        if (hal_pin_u32_new(name, HAL_IN, &errors[i], marks_id) != 0)
            return -1;
    }
    if (!errors)
        return -1;
    hal_export_funct("mark.begin", mark_begin, NULL, 1, 0, marks_id);
    hal_export_funct("mark.middle", mark_middle, NULL, 1, 0, marks_id);
    hal_export_funct("mark.end", mark_end, NULL, 1, 0, marks_id);
    return hal_ready(marks_id);
}

static void marks_exit(void *const block)
{
    (void)block;
    hal_exit(marks_id);
}

static const struct halhost_builtin marks = {.name = "marks", .main = marks_main, .exit = marks_exit};

static void add(const char *const prefix, const char *const suffix)
{
    char name[64];
    snprintf(name, sizeof name, "%s%s", prefix, suffix);
    if (hal_add_funct_to_thread(name, "servo", -1) != 0) {
        fprintf(stderr, "bench_cycle: no function %s\n", name);
        exit(1);
    }
}

static void command(const char *const text)
{
    const struct hal_session_options options = {.threads = false};
    struct hal_session *const session = hal_session_new(&options);
    struct hm2_diag diag = {0};
    if (!session || hal_session_run_text(session, "settings", text, strlen(text), &diag) != 0) {
        fprintf(stderr, "bench_cycle: %s", diag.text);
        exit(1);
    }
    hal_session_free(session);
}

static void setp(const char *const prefix, const char *const name, const char *const value)
{
    char text[128];
    snprintf(text, sizeof text, "setp %s.%s %s\n", prefix, name, value);
    command(text);
}

static void enable_all(const char *const prefix, const char *const module)
{
    char name[64], full[128];
    for (unsigned i = 0; i < 100; i++) {
        snprintf(name, sizeof name, "%s.%02u.enable", module, i);
        snprintf(full, sizeof full, "%s.%s", prefix, name);
        if (!hh_table_find(&hh_host()->pins, full))
            return;
        setp(prefix, name, "1");
    }
}

/* All that the driver has is in use: axes under position control, PWM on. Replies may take as long as they want (where
 * misses are counted, any number may be missed), and nothing bites, because a driver that is stepped through is slow
 * and a busy machine is late. */
static void put_to_work(const char *const prefix, const unsigned card)
{
    char text[128];
    setp(prefix, own_deadline ? "packet-error-limit" : "packet-read-timeout", "2000000000");
    setp(prefix, "watchdog.timeout_ns", "4000000000");
    snprintf(text, sizeof text, "net errors.%u %s.packet-error-total => mark.errors.%u\n", card, prefix, card);
    command(text);
    enable_all(prefix, "stepgen");
    enable_all(prefix, "pwmgen");
    snprintf(text, sizeof text, "%s.sserial.port-0.fault-inc", prefix);
    if (hh_table_find(&hh_host()->params, text))
        setp(prefix, "sserial.port-0.fault-inc", "0");
}

static uintptr_t code_of(const char *const prefix, const char *const suffix)
{
    char name[64];
    snprintf(name, sizeof name, "%s%s", prefix, suffix);
    const struct hh_funct *const funct = hh_table_find(&hh_host()->functs, name);
    return funct ? (uintptr_t)funct->code : 0;
}

/* "hm2_7i93.0*4": the prefixes of the cards, and how many there are. */
static void take_prefixes(const char *const text, char prefixes[MAX_CARDS][64])
{
    const char *const star = strchr(text, '*');
    const char *const dot = strrchr(text, '.');
    cards = star ? (unsigned)strtoul(star + 1, NULL, 10) : 1;
    if (!dot || cards < 1 || cards > MAX_CARDS) {
        fprintf(stderr, "bench_cycle: %s is no prefix of 1 to %d cards\n", text, MAX_CARDS);
        exit(2);
    }
    for (unsigned i = 0; i < cards; i++)
        snprintf(prefixes[i], sizeof prefixes[i], "%.*s.%u", (int)(dot - text), text, i);
}

static void add_all(char prefixes[MAX_CARDS][64], const char *const suffix)
{
    for (unsigned i = 0; i < cards; i++)
        add(prefixes[i], suffix);
}

static void start_driver(const char *const name, const char *const text, const char *const folder,
                         char **const arguments, const int count)
{
    char prefixes[MAX_CARDS][64];
    const char *const prefix = prefixes[0];
    take_prefixes(text, prefixes);
    static const char *folders[3];
    char name_argument[] = "name1=servo", period_argument[] = "period1=1000000";
    char *thread_arguments[] = {name_argument, period_argument};
    struct hm2_diag diag = {0};
    folders[0] = folder;
    folders[1] = "/usr/lib/linuxcnc/modules";
    const struct halhost_options options = {
        .message = print_message, .folders = folders, .builtins = &marks, .builtin_count = 1, .cpu = CLIENT_CPU};
    if (halhost_open(&options, &diag) != 0) {
        fprintf(stderr, "bench_cycle: %s", diag.text);
        exit(1);
    }
    load("threads", thread_arguments, 2);
    load("marks", NULL, 0);
    if (strcmp(name, "hm2_eth") == 0)
        load("hostmot2", NULL, 0);
    load(name, arguments, count);
    for (unsigned i = 0; i < cards; i++)
        put_to_work(prefixes[i], i);
    shared->code = (struct step_code){.read = code_of(prefix, ".read"), .write = code_of(prefix, ".write")};
    add("mark", ".begin");
    add_all(prefixes, ".read");
    add("mark", ".middle");
    add_all(prefixes, ".write");
    add("mark", ".end");
    if (halhost_start(&diag) != 0) {
        fprintf(stderr, "bench_cycle: %s", diag.text);
        exit(1);
    }
}

static void wait_for_cycles(const int cycles)
{
    while (shared->cycle < cycles)
        usleep(1000);
}

static void stop_driver(void)
{
    struct hm2_diag diag = {0};
    (void)halhost_close(&diag);
}

static int measure_time(const int cycles, char **const argv, const int count)
{
    wanted_cycles = cycles;
    read_times = calloc((size_t)cycles, sizeof *read_times);
    write_times = calloc((size_t)cycles, sizeof *write_times);
    read_thread_times = calloc((size_t)cycles, sizeof *read_thread_times);
    if (!read_times || !write_times || !read_thread_times)
        return 1;
    start_driver(argv[0], argv[1], argv[3], argv + 4, count - 4);
    wait_for_cycles(cycles + WARM_UP);
    stop_driver();
    if (shared->errors > 0) {
        fprintf(stderr, "bench_cycle: %u packet errors, so this is no measurement\n", shared->errors);
        return 1;
    }
    print_cycle_times(read_times, write_times, cycles);
    print_times("read_thread", read_thread_times, cycles);
    return 0;
}

static int count_misses(const int cycles, char **const argv, const int count)
{
    own_deadline = true;
    start_driver(argv[0], argv[1], argv[3], argv + 4, count - 4);
    wait_for_cycles(cycles + WARM_UP);
    stop_driver();
    printf("missed=%u\n", shared->errors - first_errors);
    return 0;
}

/* A process in which the driver has warmed up and runs on. */
static pid_t run_apart(const char *const name, const char *const text, const char *const folder, char **const arguments,
                       const int count)
{
    const pid_t child = fork();
    if (child == 0) {
        wanted_cycles = 0;
        start_driver(name, text, folder, arguments, count);
        for (;;)
            pause();
    }
    while (shared->cycle < WARM_UP && waitpid(child, NULL, WNOHANG) == 0)
        usleep(1000);
    return child;
}

/* ---- instructions ------------------------------------------------------------------------------------------------ */

static int measure_instructions(const int cycles, char **const argv, const int count)
{
    struct step_counts counts = {0};
    const pid_t child = run_apart(argv[0], argv[1], argv[3], argv + 4, count - 4);
    const bool failed =
        steps_stop(shared->thread) != 0 || steps_count(shared->thread, shared->code, cycles, &counts) != 0;
    if (failed)
        perror("bench_cycle: single-stepping");
    kill(child, SIGKILL);
    if (shared->errors > 0)
        fprintf(stderr, "bench_cycle: %u packet errors, so this is no measurement\n", shared->errors);
    if (failed || shared->errors > 0)
        return 1;
    steps_print(&counts);
    return 0;
}

/* ---- bare echo --------------------------------------------------------------------------------------------------- */

static int serve(char **const argv)
{
    const struct sockaddr_in self = address_of(argv[0], argv[1]);
    const ssize_t request = (ssize_t)strtoul(argv[2], NULL, 10), reply = (ssize_t)strtoul(argv[3], NULL, 10);
    const int fd = socket(AF_INET, SOCK_DGRAM, 0);
    char buffer[2048] = {0};
    take_processor(SERVER_CPU);
    if (fd < 0 || bind(fd, (const struct sockaddr *)&self, sizeof self) != 0 || reply > (ssize_t)sizeof buffer) {
        perror("bench_cycle: serve");
        return 1;
    }
    for (;;) {
        struct sockaddr_in from;
        socklen_t len = sizeof from;
        if (recvfrom(fd, buffer, sizeof buffer, 0, (struct sockaddr *)&from, &len) == request)
            (void)sendto(fd, buffer, (size_t)reply, 0, (struct sockaddr *)&from, len);
    }
}

struct packet {
    size_t len;
    char bytes[1500];
};

static int64_t exchange(const int fd, const struct packet *const request, const size_t reply)
{
    char buffer[2048];
    struct pollfd ready = {.fd = fd, .events = POLLIN};
    const struct timespec limit = {.tv_nsec = 100000000};
    const int64_t start = now_ns();
    if (send(fd, request->bytes, request->len, 0) < 0 || ppoll(&ready, 1, &limit, NULL) != 1 ||
        recv(fd, buffer, sizeof buffer, MSG_DONTWAIT) != (ssize_t)reply)
        fprintf(stderr, "bench_cycle: an echo was lost\n");
    return now_ns() - start;
}

static int measure_exchanges(const struct sockaddr_in *const peer, const struct packet *const request,
                             const size_t reply, const struct packet *const write, const int cycles)
{
    const int fd = socket(AF_INET, SOCK_DGRAM, 0);
    int64_t *const reads = calloc((size_t)cycles, sizeof *reads);
    int64_t *const writes = calloc((size_t)cycles, sizeof *writes);
    if (!reads || !writes || fd < 0 || connect(fd, (const struct sockaddr *)peer, sizeof *peer) != 0)
        exit(1);
    take_processor(CLIENT_CPU);
    int64_t next = now_ns();
    for (int i = -WARM_UP; i < cycles; i++) {
        sleep_until(next += PERIOD_NS);
        const int64_t read_ns = exchange(fd, request, reply);
        const int64_t start = now_ns();
        if (send(fd, write->bytes, write->len, 0) < 0)
            exit(1);
        if (i >= 0) {
            reads[i] = read_ns;
            writes[i] = now_ns() - start;
        }
    }
    print_cycle_times(reads, writes, cycles);
    free(reads);
    free(writes);
    (void)close(fd);
    return 0;
}

/* ---- what a driver sends ----------------------------------------------------------------------------------------- */

static int open_tap(const char *const interface)
{
    const struct sockaddr_ll all = {
        .sll_family = AF_PACKET, .sll_protocol = htons(ETH_P_ALL), .sll_ifindex = (int)if_nametoindex(interface)};
    const int tap = socket(AF_PACKET, SOCK_DGRAM, htons(ETH_P_ALL));
    if (tap < 0 || bind(tap, (const struct sockaddr *)&all, sizeof all) != 0) {
        perror("bench_cycle: capture");
        exit(1);
    }
    return tap;
}

/* The next datagram to a card that has the wanted length. */
static void capture(const int tap, struct packet *const wanted)
{
    for (;;) {
        char bytes[2048];
        struct sockaddr_ll from = {.sll_pkttype = PACKET_HOST};
        socklen_t len = sizeof from;
        const ssize_t got = recvfrom(tap, bytes, sizeof bytes, 0, (struct sockaddr *)&from, &len);
        const size_t headers = sizeof(struct iphdr) + sizeof(struct udphdr);
        if (got < 0)
            exit(1);
        if (from.sll_pkttype != PACKET_OUTGOING || (size_t)got != headers + wanted->len ||
            ((const struct iphdr *)(const void *)bytes)->protocol != IPPROTO_UDP)
            continue;
        memcpy(wanted->bytes, bytes + headers, wanted->len);
        return;
    }
}

/* Let the driver run, and take the packets of one of its cycles. */
static void capture_cycle(const char *const interface, struct packet *const request, struct packet *const write,
                          char **const argv, const int count)
{
    const pid_t child = run_apart(argv[0], argv[1], argv[2], argv + 3, count - 3);
    const int tap = open_tap(interface);
    capture(tap, request);
    capture(tap, write);
    (void)close(tap);
    kill(child, SIGKILL);
    (void)waitpid(child, NULL, 0);
}

int main(const int argc, char **const argv)
{
    shared = mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (shared == MAP_FAILED)
        return 1;
    if (argc >= 6 && strcmp(argv[1], "time") == 0)
        return measure_time((int)strtol(argv[4], NULL, 10), argv + 2, argc - 2);
    if (argc >= 6 && strcmp(argv[1], "misses") == 0)
        return count_misses((int)strtol(argv[4], NULL, 10), argv + 2, argc - 2);
    if (argc >= 6 && strcmp(argv[1], "count") == 0)
        return measure_instructions((int)strtol(argv[4], NULL, 10), argv + 2, argc - 2);
    const bool same = argc >= 12 && strcmp(argv[1], "same") == 0;
    if (same || (argc == 8 && strcmp(argv[1], "echo") == 0)) {
        const struct sockaddr_in peer = address_of(argv[2], argv[3]);
        struct packet request = {.len = strtoul(argv[4], NULL, 10)}, write = {.len = strtoul(argv[6], NULL, 10)};
        if (request.len > sizeof request.bytes || write.len > sizeof write.bytes)
            return 2;
        if (same)
            capture_cycle(argv[8], &request, &write, argv + 9, argc - 9);
        return measure_exchanges(&peer, &request, strtoul(argv[5], NULL, 10), &write, (int)strtol(argv[7], NULL, 10));
    }
    if (argc == 6 && strcmp(argv[1], "serve") == 0)
        return serve(argv + 2);
    fprintf(stderr, "bench_cycle: see the comment at the top of bench_cycle.c, or run `make bench`\n");
    return 2;
}
