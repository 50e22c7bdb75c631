/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The back ends of an EPP bus, each with simulated boards behind it: the registers of a parallel port, the kernel's
 * ppdev driver (whose calls are answered here), and the socket of a simulator, also of one that answers nonsense. */
#include "unit.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/parport.h>
#include <linux/ppdev.h>
#include <pthread.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

#include <hm2/epp.h>
#include <hm2/sim_ppmc.h>

#define FAKE_DEVICE "/dev/parport77"
#define FAKE_FD     9999
#define BASE        0x378

/* What a test works with; clean_up() releases it, also when the test has failed half-way. */
static struct sim_ppmc *bus;
static struct epp *epp;

static void new_bus(void)
{
    bus = sim_ppmc_new(NULL);
    assert_non_null(bus);
    assert_int_equal(sim_ppmc_add(bus, 2, 0x14), 0);
}

static void close_bus(void)
{
    epp_close(epp);
    epp = NULL;
}

static void free_bus(void)
{
    close_bus();
    sim_ppmc_free(bus);
    bus = NULL;
}

/* What every back end must do: identify the board, write and read blocks, stop at a cycle that nobody answers. */
static void works_like_a_bus(void)
{
    uint8_t id_at = 0x2F, base = 0x20, nowhere = 0x60, id = 0, value[3] = {0x11, 0x22, 0x33}, block[16] = {0};
    const struct epp_step identify[] = {{EPP_ADDRESS_WRITE, 1, &id_at}, {EPP_DATA_READ, 1, &id}};
    const struct epp_step assemble[] = {{EPP_ADDRESS_WRITE, 1, &base}, {EPP_DATA_WRITE, 3, value}};
    const struct epp_step all[] = {{EPP_ADDRESS_WRITE, 1, &base},
                                   {EPP_DATA_READ, 16, block},
                                   {EPP_ADDRESS_WRITE, 1, &nowhere},
                                   {EPP_DATA_READ, 4, value},
                                   {EPP_ADDRESS_WRITE, 1, &base}};
    uint8_t address = 0;
    const struct epp_step where[] = {{EPP_ADDRESS_WRITE, 1, &base}, {EPP_ADDRESS_READ, 1, &address}};
    struct epp_done done;
    assert_int_equal(epp_run(epp, identify, 2, &done), 0);
    assert_int_equal(id, 0x14);
    assert_int_equal(done.steps, 2);
    assert_int_equal(epp_run(epp, assemble, 2, &done), 0);
    assert_int_equal(sim_ppmc_registers(bus, 2).assembly, 0x332211);
    assert_int_equal(epp_run(epp, all, 5, &done), HM2_ERR_TIMEOUT);
    assert_int_equal(done.steps, 3);
    assert_int_equal(done.bytes, 0);
    assert_int_equal(block[15], 0x14);
    assert_int_equal(epp_run(epp, where, 2, &done), 0);
    assert_int_equal(address, 0x20);
    sim_ppmc_fault_at(bus, 6, 1, SIM_PPMC_FAULT_TIMEOUT);
    assert_int_equal(epp_run(epp, all, 2, &done), HM2_ERR_TIMEOUT); /* in the middle of a block */
    assert_int_equal(done.steps, 1);
    assert_int_equal(done.bytes, 5);
    id = 0;
    assert_int_equal(epp_run(epp, identify, 2, &done), 0); /* and goes on */
    assert_int_equal(id, 0x14);
}

/* ---- registers of a parallel port -------------------------------------------------------------------------------- */

static uint8_t direction_seen;

static uint8_t fake_in(void *const context, const uint16_t port)
{
    (void)context;
    if (port == BASE + 4)
        direction_seen = sim_ppmc_port_in(bus, 2);
    return sim_ppmc_port_in(bus, (unsigned)port - BASE);
}

static void fake_out(void *const context, const uint16_t port, const uint8_t value)
{
    (void)context;
    sim_ppmc_port_out(bus, (unsigned)port - BASE, value);
}

static void open_port(const bool reverse)
{
    static const struct epp_port_io io = {.in = fake_in, .out = fake_out};
    const struct epp_port_options options = {.base = BASE, .ecr_base = BASE + 0x400, .reverse = reverse, .io = &io};
    struct hm2_diag diag = {0};
    /* As a computer's firmware leaves a port: boards held in reset, an address strobe that never ends, SPP mode. */
    sim_ppmc_port_out(bus, 2, 0x0C);
    assert_int_equal(epp_port_open(&epp, &options, &diag), 0);
}

static void a_port_is_a_bus(void **state)
{
    (void)state;
    new_bus();
    open_port(false);
    works_like_a_bus();
    assert_int_equal(direction_seen, 0x04);
    assert_int_equal(sim_ppmc_port_in(bus, 1) & 1, 0); /* the time-out bit is cleared */
}

static void a_ports_direction_is_commanded_where_asked(void **state)
{
    (void)state;
    new_bus();
    open_port(true);
    works_like_a_bus();
    assert_int_equal(direction_seen, 0x24);
}

/* ---- ppdev: what the kernel does, as far as a program sees it (ppmc.md section 10.1) ------------------------------
 */

static struct {
    bool open, claimed, nonblocking, busy, refuse_mode;
    int modes, mode, reversed;
    unsigned calls; /* system calls */
    unsigned negotiations;
} device;

int open(const char *path, int flags, ...);
int close(int fd);
int ioctl(int fd, unsigned long request, ...);
ssize_t read(int fd, void *data, size_t size);
ssize_t write(int fd, const void *data, size_t size);

int open(const char *const path, const int flags, ...)
{
    if (strcmp(path, FAKE_DEVICE) != 0)
        return (int)syscall(SYS_openat, AT_FDCWD, path, flags, 0600);
    device.open = true;
    device.nonblocking = (flags & O_NONBLOCK) != 0;
    device.mode = IEEE1284_MODE_COMPAT;
    return FAKE_FD;
}

int close(const int fd)
{
    if (fd != FAKE_FD)
        return (int)syscall(SYS_close, fd);
    if (device.claimed && device.mode != IEEE1284_MODE_COMPAT)
        sim_ppmc_reset(bus); /* the kernel ends the mode, with a pulse of nInit */
    device.open = device.claimed = false;
    return 0;
}

static int answer_device(const unsigned long request, void *const argument)
{
    device.calls++;
    if (request == PPNEGOT)
        device.negotiations++;
    if (request == PPCLAIM) {
        if (device.busy)
            return EBUSY;
        device.claimed = true;
        sim_ppmc_port_out(bus, 2, 0x0C);
        sim_ppmc_port_out(bus, 0x402, 0x80);
    } else if (request == PPRELEASE) {
        if (device.mode != IEEE1284_MODE_COMPAT)
            sim_ppmc_reset(bus);
        device.claimed = false;
    } else if (request == PPGETMODES) {
        memcpy(argument, &device.modes, sizeof device.modes);
    } else if (request == PPSETMODE) {
        if (device.refuse_mode)
            return EINVAL;
        memcpy(&device.mode, argument, sizeof device.mode);
    } else if (request == PPDATADIR) {
        memcpy(&device.reversed, argument, sizeof device.reversed);
    } else if (request == PPWCONTROL) {
        uint8_t control;
        memcpy(&control, argument, 1);
        sim_ppmc_port_out(bus, 2, control);
    }
    return 0;
}

int ioctl(const int fd, const unsigned long request, ...)
{
    va_list args;
    va_start(args, request);
    void *const argument = va_arg(args, void *);
    va_end(args);
    if (fd != FAKE_FD)
        return (int)syscall(SYS_ioctl, fd, request, argument);
    const int error = answer_device(request, argument);
    if (error == 0)
        return 0;
    errno = error;
    return -1;
}

/* Bytes until a cycle is not answered. A blocking read would go on for ever when there are none. */
static ssize_t move(const bool reads, uint8_t *const data, const size_t size)
{
    const bool to_address = (device.mode & IEEE1284_ADDR) != 0;
    const unsigned offset = to_address ? 3 : 4;
    size_t moved = 0;
    device.calls++;
    for (; moved < size; moved++) {
        if (reads)
            data[moved] = sim_ppmc_port_in(bus, offset);
        else
            sim_ppmc_port_out(bus, offset, data[moved]);
        if (sim_ppmc_port_in(bus, 1) & 1u)
            break;
    }
    sim_ppmc_port_out(bus, 1, 1);
    if (moved > 0 || !reads)
        return (ssize_t)moved;
    assert_true(device.nonblocking);
    errno = EAGAIN;
    return -1;
}

ssize_t read(const int fd, void *const data, const size_t size)
{
    return fd == FAKE_FD ? move(true, data, size) : syscall(SYS_read, fd, data, size);
}

ssize_t write(const int fd, const void *const data, const size_t size)
{
    uint8_t copy[64];
    if (fd != FAKE_FD)
        return syscall(SYS_write, fd, data, size);
    assert_true(size <= sizeof copy);
    memcpy(copy, data, size);
    return move(false, copy, size);
}

static void reset_device(void)
{
    memset(&device, 0, sizeof device);
    device.modes = PARPORT_MODE_PCSPP | PARPORT_MODE_EPP;
}

static void the_kernels_driver_is_a_bus_and_is_left_without_a_reset(void **state)
{
    (void)state;
    for (unsigned reverse = 0; reverse < 2; reverse++) {
        struct hm2_diag diag = {0};
        new_bus();
        reset_device();
        assert_int_equal(epp_open(&epp, FAKE_DEVICE, reverse != 0, &diag), 0);
        works_like_a_bus();
        assert_int_equal(device.reversed, reverse);
        assert_int_equal(device.negotiations, 0);
        close_bus();
        assert_false(device.open || device.claimed);
        assert_int_equal(sim_ppmc_registers(bus, 2).assembly, 0x332211); /* no reset */
        free_bus();
    }
}

static void a_list_takes_one_call_a_step_and_one_a_change_of_mode(void **state)
{
    (void)state;
    uint8_t base = 0x20, block[16];
    const struct epp_step steps[] = {{EPP_ADDRESS_WRITE, 1, &base},
                                     {EPP_DATA_READ, 16, block},
                                     {EPP_ADDRESS_WRITE, 1, &base},
                                     {EPP_DATA_READ, 12, block}};
    struct epp_done done;
    new_bus();
    reset_device();
    assert_int_equal(epp_open(&epp, FAKE_DEVICE, false, NULL), 0);
    device.calls = 0;
    assert_int_equal(epp_run(epp, steps, 4, &done), 0);
    assert_int_equal(device.calls, 8);
}

static void a_port_that_cannot_be_had_is_refused_with_the_reason(void **state)
{
    (void)state;
    struct hm2_diag diag = {0};
    new_bus();
    reset_device();
    device.busy = true;
    assert_int_equal(epp_open(&epp, FAKE_DEVICE, false, &diag), HM2_ERR_IO);
    assert_non_null(strstr(diag.text, "cannot be claimed"));
    assert_false(device.open);
    reset_device();
    device.modes = PARPORT_MODE_PCSPP;
    assert_int_equal(epp_open(&epp, FAKE_DEVICE, false, &diag), HM2_ERR_UNSUPPORTED);
    assert_non_null(strstr(diag.text, "no EPP mode in hardware"));
    assert_false(device.open || device.claimed);
    reset_device();
    device.refuse_mode = true;
    assert_int_equal(epp_open(&epp, FAKE_DEVICE, false, &diag), HM2_ERR_IO);
    assert_int_equal(epp_open(&epp, "/dev/parport-that-is-not-there", false, &diag), HM2_ERR_IO);
}

/* ---- names --------------------------------------------------------------------------------------------------------
 */

static void names_of_no_bus_are_refused(void **state)
{
    (void)state;
    static const char *const names[] = {"",
                                        "parport0",
                                        "port:",
                                        "port:378",
                                        "port:0x",
                                        "port:0x0",
                                        "port:0x12345",
                                        "port:0x378:",
                                        "port:0xFFF9",
                                        "port:0x378:0x",
                                        "port:0x378x",
                                        "sim:",
                                        "sim:/"
                                        "012345678901234567890123456789012345678901234567890123456789012345678901234567"
                                        "8901234567890123456789012345678901234567890"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        struct hm2_diag diag = {0};
        if (epp_open(&epp, names[i], false, &diag) != HM2_ERR_INVALID || diag.problems != 1)
            fail_msg("\"%s\" is not refused: %s", names[i], diag.text);
    }
}

/* ---- the simulator's socket ---------------------------------------------------------------------------------------
 */

/* What a peer answers, as a change of the right reply. */
enum nonsense { HONEST, SILENT, SHORT, LONG, MANY_STEPS, HALF, WRONG_NUMBER_FIRST, ENDS };

static struct {
    enum nonsense how;
    int listener; /* -1 = none */
    bool runs;
    char folder[32], path[64];
    pthread_t thread;
} peer = {.listener = -1};

static size_t distort(const enum nonsense how, uint8_t *const reply, const size_t len)
{
    if (how == SHORT)
        return len - 1;
    if (how == LONG)
        return len + 1;
    if (how == MANY_STEPS)
        reply[3] = 200;
    if (how == HALF)
        reply[4] = 31;
    return len;
}

static void *peer_main(void *const context)
{
    (void)context;
    uint8_t request[EPP_WIRE_MAX_BYTES], reply[EPP_WIRE_MAX_BYTES + 1];
    const int fd = accept(peer.listener, NULL, NULL);
    for (;;) {
        const ssize_t len = recv(fd, request, sizeof request, 0);
        if (len <= 0 || peer.how == ENDS)
            break;
        size_t answer = sim_ppmc_serve(bus, request, (size_t)len, reply);
        if (peer.how == SILENT || answer == 0)
            continue;
        answer = distort(peer.how, reply, answer);
        if (peer.how == WRONG_NUMBER_FIRST) {
            reply[0]++;
            (void)send(fd, reply, answer, MSG_NOSIGNAL);
            reply[0]--;
        }
        (void)send(fd, reply, answer, MSG_NOSIGNAL);
    }
    close(fd);
    return NULL;
}

/* A clock that jumps, as a virtual machine's may, must not end a wait for an answer that will come. */
#define NO_LIMIT_NS INT64_C(1000000000000000)

static void start_peer(const enum nonsense how)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    (void)snprintf(peer.folder, sizeof peer.folder, "/tmp/test-epp-XXXXXX");
    assert_non_null(mkdtemp(peer.folder));
    (void)snprintf(peer.path, sizeof peer.path, "%s/bus", peer.folder);
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s", peer.path);
    peer.how = how;
    peer.listener = socket(AF_UNIX, SOCK_SEQPACKET, 0);
    assert_int_equal(bind(peer.listener, (const struct sockaddr *)&address, sizeof address), 0);
    assert_int_equal(listen(peer.listener, 1), 0);
    assert_int_equal(pthread_create(&peer.thread, NULL, peer_main, NULL), 0);
    peer.runs = true;
    assert_int_equal(epp_socket_open(&epp, peer.path, how == SILENT ? 20000000 : NO_LIMIT_NS, NULL), 0);
}

static void end_peer(void)
{
    close_bus();
    if (peer.listener < 0)
        return;
    (void)shutdown(peer.listener, SHUT_RDWR); /* nobody may have connected */
    if (peer.runs)
        pthread_join(peer.thread, NULL);
    close(peer.listener);
    unlink(peer.path);
    rmdir(peer.folder);
    peer.listener = -1;
    peer.runs = false;
}

static void a_simulators_socket_is_a_bus(void **state)
{
    (void)state;
    new_bus();
    start_peer(HONEST);
    works_like_a_bus();
    end_peer();
    assert_int_equal(epp_socket_open(&epp, peer.path, 1, NULL), HM2_ERR_IO);
}

static void a_peer_that_answers_nonsense_is_an_error_and_reads_nothing(void **state)
{
    (void)state;
    static const struct {
        enum nonsense how;
        int want;
    } rows[] = {{SILENT, HM2_ERR_TIMEOUT}, {SHORT, HM2_ERR_MALFORMED},
                {LONG, HM2_ERR_MALFORMED}, {MANY_STEPS, HM2_ERR_MALFORMED},
                {HALF, HM2_ERR_MALFORMED}, {WRONG_NUMBER_FIRST, 0},
                {ENDS, HM2_ERR_IO}};
    new_bus();
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        uint8_t at = 0x2F, id = 0;
        const struct epp_step steps[] = {{EPP_ADDRESS_WRITE, 1, &at}, {EPP_DATA_READ, 1, &id}};
        struct epp_done done;
        start_peer(rows[i].how);
        assert_int_equal(epp_run(epp, steps, 2, &done), rows[i].want);
        assert_int_equal(id, rows[i].want == 0 ? 0x14 : 0);
        assert_int_equal(done.steps, rows[i].want == 0 ? 2 : 0);
        end_peer();
    }
}

static void a_server_takes_eight_clients_and_no_other_server_at_its_path(void **state)
{
    (void)state;
    struct sim_ppmc_server *server = NULL, *second = NULL;
    struct hm2_diag diag = {0};
    struct epp *clients[9] = {NULL};
    char folder[] = "/tmp/test-epp-XXXXXX", path[64], longest[200];
    uint8_t at = 0x2F;
    const struct epp_step step = {EPP_ADDRESS_WRITE, 1, &at};
    struct epp_done done;
    int refused = 0;
    assert_non_null(mkdtemp(folder));
    (void)snprintf(path, sizeof path, "%s/bus", folder);
    memset(longest, 'x', sizeof longest - 1);
    longest[sizeof longest - 1] = '\0';
    new_bus();
    assert_int_equal(sim_ppmc_server_open(&server, longest, &diag), HM2_ERR_INVALID);
    assert_int_equal(sim_ppmc_server_open(&server, "", &diag), HM2_ERR_INVALID);
    assert_int_equal(sim_ppmc_server_open(&server, path, NULL), 0);
    assert_int_equal(sim_ppmc_server_open(&second, path, &diag), HM2_ERR_IO);
    for (unsigned i = 0; i < 9; i++) {
        assert_int_equal(epp_socket_open(&clients[i], path, 1, NULL), 0);
        sim_ppmc_server_run(server, bus); /* accepts one, at first the second server, which had tried who listens */
        sim_ppmc_server_run(server, bus);
    }
    for (unsigned i = 0; i < 9; i++) { /* the first eight are heard, and nobody is there to answer them in time */
        refused += epp_run(clients[i], &step, 1, &done) == HM2_ERR_IO;
        epp_close(clients[i]);
    }
    assert_int_equal(refused, 1);
    sim_ppmc_server_run(server, bus);
    assert_int_equal(sim_ppmc_stats(bus).cycles, 8);
    sim_ppmc_server_close(server);
    assert_int_equal(rmdir(folder), 0); /* it has removed its socket */
}

static void a_socket_that_a_killed_server_left_is_replaced(void **state)
{
    (void)state;
    struct sim_ppmc_server *server = NULL;
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    char folder[] = "/tmp/test-epp-XXXXXX";
    const int fd = socket(AF_UNIX, SOCK_SEQPACKET, 0);
    assert_non_null(mkdtemp(folder));
    (void)snprintf(address.sun_path, sizeof address.sun_path, "%s/bus", folder);
    assert_int_equal(bind(fd, (const struct sockaddr *)&address, sizeof address), 0);
    close(fd);
    assert_int_equal(sim_ppmc_server_open(&server, address.sun_path, NULL), 0);
    sim_ppmc_server_close(server);
    assert_int_equal(rmdir(folder), 0);
}

static void requests_that_are_none_are_not_answered(void **state)
{
    (void)state;
    static const struct {
        size_t len;
        uint8_t bytes[8];
    } rows[] = {{0, {0}},
                {2, {1, 0}},
                {3, {1, 0, 1}},          /* one step, which is not there */
                {5, {1, 0, 1, 4, 1}},    /* unknown kind */
                {5, {1, 0, 1, 3, 0}},    /* no bytes */
                {5, {1, 0, 1, 3, 33}},   /* too many */
                {6, {1, 0, 1, 2, 2, 5}}, /* one byte of two */
                {6, {1, 0, 1, 3, 1, 9}}, /* a byte too many */
                {3, {1, 0, 129}}};
    uint8_t reply[EPP_WIRE_MAX_BYTES];
    new_bus();
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        assert_int_equal(sim_ppmc_serve(bus, rows[i].bytes, rows[i].len, reply), 0);
    assert_int_equal(sim_ppmc_stats(bus).cycles, 0);
}

static int clean_up(void **state)
{
    (void)state;
    end_peer();
    free_bus();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(a_port_is_a_bus, clean_up),
        cmocka_unit_test_teardown(a_ports_direction_is_commanded_where_asked, clean_up),
        cmocka_unit_test_teardown(the_kernels_driver_is_a_bus_and_is_left_without_a_reset, clean_up),
        cmocka_unit_test_teardown(a_list_takes_one_call_a_step_and_one_a_change_of_mode, clean_up),
        cmocka_unit_test_teardown(a_port_that_cannot_be_had_is_refused_with_the_reason, clean_up),
        cmocka_unit_test_teardown(names_of_no_bus_are_refused, clean_up),
        cmocka_unit_test_teardown(a_simulators_socket_is_a_bus, clean_up),
        cmocka_unit_test_teardown(a_peer_that_answers_nonsense_is_an_error_and_reads_nothing, clean_up),
        cmocka_unit_test_teardown(a_server_takes_eight_clients_and_no_other_server_at_its_path, clean_up),
        cmocka_unit_test_teardown(a_socket_that_a_killed_server_left_is_replaced, clean_up),
        cmocka_unit_test_teardown(requests_that_are_none_are_not_answered, clean_up),
    };
    return cmocka_run_group_tests_name("EPP", tests, NULL, NULL);
}
