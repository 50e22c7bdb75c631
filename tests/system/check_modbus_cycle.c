/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The inside of modbus_io. Its cycle: no allocation, no lock, no formatting (libc/watch.h), and no system call: the
 * thread that runs it has given them up. Its serial ports: what is asked of a driver for RS-485, from an ioctl(2) of
 * this program's own.
 */
#include <check.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <linux/serial.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <hm2/points.h>
#include <modbus/modbus.h>

#include "../../components/modbus_io/instance.h"
#include "libc/watch.h"
#include "process.h"
#include "suite.h"

#define PORT      1502
#define TABLE     32
#define PERIOD_NS 1000000
#define STEP_US   1000

static char file[64], address[16];
static struct instance instance;
static struct hm2_plain_binder *plain;

/* ---- a driver of a serial port that has RS-485 --------------------------------------------------------------------*/

static atomic_bool has_rs485, no_lines;
static atomic_uint rs485_flags, rts_raised, rts_lowered;
static atomic_int lines; /* modem lines of the port */

/* libmodbus finds it before the C library's. */
__attribute__((visibility("default"))) int ioctl(const int fd, const unsigned long request, ...)
{
    va_list arguments;
    va_start(arguments, request);
    void *const argument = va_arg(arguments, void *);
    va_end(arguments);
    if (request == TIOCSRS485 && atomic_load(&has_rs485)) {
        atomic_store(&rs485_flags, ((const struct serial_rs485 *)argument)->flags);
        return 0;
    }
    if (request == TIOCGRS485 && atomic_load(&has_rs485)) {
        memset(argument, 0, sizeof(struct serial_rs485));
        return 0;
    }
    if (request == TIOCMGET && !atomic_load(&no_lines)) {
        *(int *)argument = atomic_load(&lines);
        return 0;
    }
    if (request == TIOCMSET && !atomic_load(&no_lines)) {
        const int before = atomic_exchange(&lines, *(const int *)argument), now = *(const int *)argument;
        atomic_fetch_add(&rts_raised, (before & TIOCM_RTS) == 0 && (now & TIOCM_RTS) != 0);
        atomic_fetch_add(&rts_lowered, (before & TIOCM_RTS) != 0 && (now & TIOCM_RTS) == 0);
        return 0;
    }
    return (int)syscall(SYS_ioctl, fd, request, argument);
}

/* ---- a device and a map -------------------------------------------------------------------------------------------*/

/* Its first holding register counts the requests. */
static void serve(modbus_t *const modbus)
{
    uint8_t query[MODBUS_MAX_ADU_LENGTH];
    modbus_mapping_t *const mapping = modbus_mapping_new(TABLE, TABLE, TABLE, TABLE);
    for (;;) {
        const int length = modbus_receive(modbus, query);
        if (length < 0)
            _exit(0);
        mapping->tab_registers[0]++;
        if (length > 0)
            (void)modbus_reply(modbus, query, length, mapping);
    }
}

static pid_t start_device(void)
{
    test_address(0, address);
    modbus_t *const modbus = modbus_new_tcp(address, PORT);
    int listener = modbus_tcp_listen(modbus, 1);
    ck_assert_int_ge(listener, 0);
    (void)fflush(NULL);
    const pid_t device = fork();
    ck_assert_int_ge(device, 0);
    if (device == 0) {
        (void)prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (modbus_tcp_accept(modbus, &listener) >= 0)
            serve(modbus);
        _exit(1);
    }
    (void)close(listener);
    modbus_free(modbus);
    return device;
}

static void load(const char *const text)
{
    FILE *const out = fopen(file, "we");
    ck_assert_ptr_nonnull(out);
    ck_assert(fputs(text, out) >= 0 && fclose(out) == 0);
    plain = hm2_plain_binder_new();
    ck_assert_ptr_nonnull(plain);
    ck_assert_int_eq(instance_read(&instance, file), 0);
    ck_assert_int_eq(instance_make(&instance, file, hm2_plain_binder(plain)), 0);
    ck_assert_int_eq(engine_start(instance.engine), 0);
}

static void unload(void)
{
    instance_free(&instance);
    hm2_plain_binder_free(plain);
}

static void set_up(void)
{
    snprintf(file, sizeof file, "/tmp/check-modbus-cycle-XXXXXX");
    const int fd = mkstemp(file);
    ck_assert_int_ge(fd, 0);
    close(fd);
}

static void tear_down(void)
{
    (void)unlink(file);
}

/* ---- a thread without system calls --------------------------------------------------------------------------------*/

static atomic_int refused_call = -1; /* number of the last system call that was refused, -1 = none */

static void on_refused(const int number, siginfo_t *const info, void *const context)
{
    (void)number;
    (void)context;
    atomic_store(&refused_call, info->si_syscall);
}

/* From now on every system call of this thread is a signal, but the return from that and the end of the thread. False
 * where the kernel does not do that. */
static bool give_up_system_calls(void)
{
    static struct sock_filter program[] = {
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_exit, 2, 0),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_rt_sigreturn, 1, 0),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
    };
    const struct sock_fprog filter = {.len = sizeof program / sizeof program[0], .filter = program};
    const struct sigaction action = {.sa_sigaction = on_refused, .sa_flags = SA_SIGINFO};
    return sigaction(SIGSYS, &action, NULL) == 0 && prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
           prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
}

static atomic_bool cannot, ends;
static atomic_uint cycles, steps; /* steps: new values of the register that counts */
static unsigned long made_calls[WATCH_KINDS];
static const char *last_calls[WATCH_KINDS];

static void cycle(const unsigned n)
{
    static uint32_t before;
    (void)hm2_plain_set(plain, "mb2hal.out.speed.float", n % 1000);
    (void)hm2_plain_set(plain, "mb2hal.out.word.bit-03", n / 50 % 2);
    (void)hm2_plain_set(plain, "mb2hal.plain.00.float", n % 3 ? 1e30 : -1e30);
    (void)hm2_plain_set(plain, "mb2hal.coils.01.bit", n / 100 % 2);
    (void)hm2_plain_set(plain, "mb2hal.coils.enable", n / 1000 % 2);
    watch_begin();
    pins_update(instance.pins, PERIOD_NS);
    watch_end();
    const uint32_t now = (uint32_t)hm2_plain_get(plain, "mb2hal.in.count.int", NULL);
    atomic_fetch_add(&steps, now != before);
    before = now;
    atomic_fetch_add(&cycles, 1);
}

static void *cycle_main(void *const unused)
{
    (void)unused;
    if (!give_up_system_calls()) {
        atomic_store(&cannot, true);
        return NULL;
    }
    for (unsigned n = 0; !atomic_load(&ends); n++)
        cycle(n);
    for (enum watch_kind kind = 0; kind < WATCH_KINDS; kind++) {
        made_calls[kind] = watch_calls(kind);
        last_calls[kind] = watch_last(kind);
    }
    syscall(SYS_exit, 0); /* pthread_exit() would make others */
    return NULL;
}

/* A link that works and one that never opens; all kinds of pins. */
static void load_all_kinds(void)
{
    char text[2000];
    snprintf(
        text, sizeof text,
        "[MB2HAL_INIT]\nVERSION=1.1\nTOTAL_TRANSACTIONS=6\n"
        "[TRANSACTION_00]\nLINK_TYPE=tcp\nTCP_IP=%s\nTCP_PORT=%d\nMB_SLAVE_ID=1\nHAL_TX_NAME=in\n"
        "MB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=0\nPIN_NAMES=count,f[*2+1],b\n"
        "ELEMENT_TYPES=u16,f32,bits\n"
        "[TRANSACTION_01]\nMB_TX_CODE=fnct_16_write_multiple_registers\nFIRST_ELEMENT=4\nPIN_NAMES=speed[*0.1],word\n"
        "ELEMENT_TYPES=s32,bits\nHAL_TX_NAME=out\nWRITE_MODE=change\n"
        "[TRANSACTION_02]\nMB_TX_CODE=fnct_06_write_single_register\nFIRST_ELEMENT=8\nNELEMENTS=1\nHAL_TX_NAME=plain\n"
        "[TRANSACTION_03]\nMB_TX_CODE=fnct_15_write_multiple_coils\nFIRST_ELEMENT=2\nNELEMENTS=2\nHAL_TX_NAME=coils\n"
        "ENABLE_PIN=1\n"
        "[TRANSACTION_04]\nMB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=5000\nNELEMENTS=1\n"
        "HAL_TX_NAME=refused\n"
        "[TRANSACTION_05]\nMB_TX_CODE=fnct_02_read_discrete_inputs\nFIRST_ELEMENT=0\nNELEMENTS=3\nTCP_PORT=%d\n"
        "HAL_TX_NAME=dead\n",
        address, PORT, PORT + 1);
    load(text);
}

static bool has_cycled_enough(void)
{
    return atomic_load(&cycles) >= 20000 && atomic_load(&steps) >= 50 &&
           hm2_plain_get(plain, "mb2hal.dead.errors", NULL) >= 2;
}

START_TEST(the_cycle_allocates_locks_formats_and_calls_nothing)
{
    pthread_t thread;
    if (!WATCH_WORKS) {
        printf("SKIP: a sanitizer brings its own allocator and its own system calls\n");
        return;
    }
    const pid_t device = start_device();
    load_all_kinds();
    ck_assert_int_eq(pthread_create(&thread, NULL, cycle_main, NULL), 0);
    while (!has_cycled_enough() && !atomic_load(&cannot) && atomic_load(&refused_call) < 0)
        usleep(STEP_US);
    atomic_store(&ends, true);

    ck_assert_int_eq(pthread_join(thread, NULL), 0);
    if (atomic_load(&cannot))
        printf("SKIP: no thread can give up system calls here (seccomp)\n");
    ck_assert_int_eq(atomic_load(&refused_call), -1);
    for (enum watch_kind kind = 0; kind < WATCH_KINDS; kind++)
        if (made_calls[kind] > 0)
            ck_abort_msg("%lu calls in %u cycles, the last one of %s", made_calls[kind], cycles, last_calls[kind]);
    unload();
    kill(device, SIGKILL);
    waitpid(device, NULL, 0);
}
END_TEST

static void *ask_for_its_number(void *const unused)
{
    (void)unused;
    if (give_up_system_calls())
        (void)syscall(SYS_getpid);
    else
        atomic_store(&cannot, true);
    syscall(SYS_exit, 0);
    return NULL;
}

START_TEST(a_system_call_of_such_a_thread_is_seen)
{
    pthread_t thread;
    if (!WATCH_WORKS)
        return;
    ck_assert_int_eq(pthread_create(&thread, NULL, ask_for_its_number, NULL), 0);
    ck_assert_int_eq(pthread_join(thread, NULL), 0);
    if (!atomic_load(&cannot))
        ck_assert_int_eq(atomic_load(&refused_call), SYS_getpid);
}
END_TEST

/* ---- RS-485 -------------------------------------------------------------------------------------------------------*/

/* A terminal on which a device answers that has the number of requests in its first register. */
static pid_t start_serial_device(char terminal[const 64])
{
    struct termios raw;
    const int master = posix_openpt(O_RDWR | O_NOCTTY);
    ck_assert(master >= 0 && grantpt(master) == 0 && unlockpt(master) == 0);
    ck_assert_int_eq(ptsname_r(master, terminal, 64), 0);
    const int slave = open(terminal, O_RDWR | O_NOCTTY); /* stays open, so that nobody sees a hang-up */
    ck_assert(slave >= 0 && tcgetattr(slave, &raw) == 0);
    cfmakeraw(&raw);
    ck_assert_int_eq(tcsetattr(slave, TCSANOW, &raw), 0);
    (void)fflush(NULL);
    const pid_t device = fork();
    ck_assert_int_ge(device, 0);
    if (device == 0) {
        (void)prctl(PR_SET_PDEATHSIG, SIGKILL);
        modbus_t *const modbus = modbus_new_rtu(terminal, 19200, 'N', 8, 1);
        modbus_set_socket(modbus, master);
        modbus_set_slave(modbus, 1);
        serve(modbus);
    }
    (void)close(master);
    return device;
}

static pid_t load_serial(const char *const setting)
{
    char text[1000], terminal[64];
    const pid_t device = start_serial_device(terminal);
    snprintf(text, sizeof text,
             "[MB2HAL_INIT]\nVERSION=1.1\nTOTAL_TRANSACTIONS=1\n[TRANSACTION_00]\nLINK_TYPE=serial\nSERIAL_PORT=%s\n"
             "SERIAL_BAUD=19200\nSERIAL_BITS=8\nSERIAL_PARITY=none\nSERIAL_STOP=1\n%s\nMB_SLAVE_ID=1\n"
             "MB_TX_CODE=fnct_03_read_holding_registers\nFIRST_ELEMENT=0\nNELEMENTS=1\n",
             terminal, setting);
    load(text);
    return device;
}

static void cycle_until(const char *const pin, const double least)
{
    while (hm2_plain_get(plain, pin, NULL) < least) { /* the test has a time limit */
        pins_update(instance.pins, PERIOD_NS);
        usleep(STEP_US);
    }
}

static void end(const pid_t device)
{
    unload();
    kill(device, SIGKILL);
    waitpid(device, NULL, 0);
}

START_TEST(a_driver_that_has_rs485_is_asked_for_it)
{
    atomic_store(&has_rs485, true);
    const pid_t device = load_serial("SERIAL_RS485=1");
    cycle_until("mb2hal.00.00.int", 3);
    ck_assert_uint_eq(atomic_load(&rs485_flags) & SER_RS485_ENABLED, SER_RS485_ENABLED);
    end(device);
}
END_TEST

START_TEST(a_port_without_rs485_is_not_used_when_it_is_asked_for)
{
    const pid_t device = load_serial("SERIAL_RS485=1");
    cycle_until("mb2hal.00.errors", 2);
    ck_assert_double_eq(hm2_plain_get(plain, "mb2hal.00.connected", NULL), 0);
    ck_assert_double_eq(hm2_plain_get(plain, "mb2hal.00.stale", NULL), 1);
    ck_assert_double_eq(hm2_plain_get(plain, "mb2hal.00.00.int", NULL), 0);
    end(device);
}
END_TEST

/* Up while it sends: once for each request, and down in between. */
START_TEST(rts_is_raised_for_each_request)
{
    const pid_t device = load_serial("SERIAL_RTS=up");
    cycle_until("mb2hal.00.00.int", 5);
    ck_assert_uint_ge(atomic_load(&rts_raised), 5);
    ck_assert_uint_ge(atomic_load(&rts_lowered) + 1, atomic_load(&rts_raised));
    end(device);
}
END_TEST

START_TEST(a_port_without_modem_lines_works_with_rts_as_well)
{
    atomic_store(&no_lines, true);
    const pid_t device = load_serial("SERIAL_RTS=down");
    cycle_until("mb2hal.00.00.int", 5);
    end(device);
}
END_TEST

int main(void)
{
    Suite *const suite = suite_create("modbus_io, inside");
    TCase *const tests = tcase_create("inside");
    tcase_set_timeout(tests, 90);
    tcase_add_checked_fixture(tests, set_up, tear_down);
    tcase_add_test(tests, the_cycle_allocates_locks_formats_and_calls_nothing);
    tcase_add_test(tests, a_system_call_of_such_a_thread_is_seen);
    tcase_add_test(tests, a_driver_that_has_rs485_is_asked_for_it);
    tcase_add_test(tests, a_port_without_rs485_is_not_used_when_it_is_asked_for);
    tcase_add_test(tests, rts_is_raised_for_each_request);
    tcase_add_test(tests, a_port_without_modem_lines_works_with_rts_as_well);
    suite_add_tcase(suite, tests);
    return run_suite(suite);
}
