/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * hm2_lbp16: Mesa Ethernet cards as HAL pins and functions.
 *
 *     loadrt hm2_lbp16 board_ip=192.168.1.121[,...] config="num_stepgens=5 ..."[,...]
 *
 * HAL glue only: everything about cards is in libhm2. The module parameters are those of LinuxCNC's hostmot2 and
 * hm2_eth together, so that a HAL file needs no change but this line.
 */
#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <hal.h>
#include <rtapi.h>
#include <rtapi_app.h>

#include <hm2/board.h>
#include <hm2/link.h>

#include "cards.h"
#include "common/component.h"
#include "common/hal_binder.h"
#include "common/messenger.h"
#include "exports.h"
#include "flight_files.h"
#include "isolation.h"

MODULE_AUTHOR("libhm2 developers");
MODULE_DESCRIPTION("Mesa Electronics HostMot2 cards over Ethernet (LBP16)");
MODULE_LICENSE("GPL");

EXPORT_SYMBOL(hm2_bspi_setup_chan);
EXPORT_SYMBOL(hm2_bspi_set_read_function);
EXPORT_SYMBOL(hm2_bspi_set_write_function);
EXPORT_SYMBOL(hm2_bspi_write_chan);
EXPORT_SYMBOL(hm2_allocate_bspi_tram);
EXPORT_SYMBOL(hm2_bspi_clear_fifo);
EXPORT_SYMBOL(hm2_tram_add_bspi_frame);
EXPORT_SYMBOL(hm2_uart_setup);
EXPORT_SYMBOL(hm2_uart_send);
EXPORT_SYMBOL(hm2_uart_read);
EXPORT_SYMBOL(hm2_pktuart_setup);
EXPORT_SYMBOL(hm2_pktuart_send);
EXPORT_SYMBOL(hm2_pktuart_read);
EXPORT_SYMBOL(hm2_serial_use);

#define MAX_CARDS 16

static char *board_ip[MAX_CARDS];
RTAPI_MP_ARRAY_STRING(board_ip, MAX_CARDS, "IPv4 address of each card, optionally with :port");
static char *config[MAX_CARDS];
RTAPI_MP_ARRAY_STRING(config, MAX_CARDS, "configuration of each card, see hm2_lbp16(9)");
static int debug = 0;
RTAPI_MP_INT(debug, "1 = print the pin listing and packet sizes at load; 2 = and warnings of the cycle");
static int busy_poll = 0;
RTAPI_MP_INT(busy_poll, "SO_BUSY_POLL of the sockets in microseconds, up to 1000000; 0 = off");
static char *receive = 0;
RTAPI_MP_STRING(receive, "wait (default) sleeps until the reply is there, spin asks for it again and again");

static char *flight_folder = 0;
RTAPI_MP_STRING(flight_folder, "record the times of the last cycles and write them here when one is lost or slow");
static int flight_cycles = 4096;
RTAPI_MP_INT(flight_cycles, "cycles that the flight recorder keeps, 64 to 65536");
static int flight_slow_us = 0;
RTAPI_MP_INT(flight_slow_us, "cycles that take longer are slow; 0 = no limit");

/* Accepted so that load lines written for hostmot2 and hm2_eth work unchanged; hm2_lbp16(9) says what each does. */
static char *board_rtnet[MAX_CARDS];
RTAPI_MP_ARRAY_STRING(board_rtnet, MAX_CARDS, "accepted for compatibility; sockets are always ordinary ones");
static char *firewall = 0;
RTAPI_MP_STRING(firewall, "auto (default), none, or nft: keep other programs off the cards' interfaces");
static int debug_idrom = 0;
RTAPI_MP_INT(debug_idrom, "print the IDROM header at load");
static int debug_module_descriptors = 0;
RTAPI_MP_INT(debug_module_descriptors, "print the module descriptors at load");
static int debug_pin_descriptors = 0;
RTAPI_MP_INT(debug_pin_descriptors, "print the pin listing at load");
static int debug_modules = 0;
RTAPI_MP_INT(debug_modules, "print what each module uses at load");
static int use_serial_numbers = 0;
RTAPI_MP_INT(use_serial_numbers, "name smart-serial remotes by unit number");
static int sserial_baudrate = -1;
RTAPI_MP_INT(sserial_baudrate, "force the smart-serial baud rate; -1 = as the firmware has it");

#define NO_THREAD        (-1)
#define MAX_BUSY_POLL_US 1000000
#define NS_PER_US        1000

struct card {
    struct hm2_board *board;
    atomic_bool busy;  /* one of its functions runs */
    atomic_bool held;  /* its functions leave the board alone */
    atomic_int thread; /* the realtime thread that called .read last */
    unsigned cycle;    /* calls of .read so far; only that thread looks at it */
};

static int component_id;
static struct card cards[MAX_CARDS];
static unsigned card_count;
static struct hal_binder hal;
static struct isolation isolation;
static atomic_bool closing; /* no function may touch a board any more */

/* ---- functions of a card ------------------------------------------------------------------------------------------
 */

/* A host may unload the component while its functions are still in a thread (LinuxCNC's does): what is announced here
 * is waited for in close_functions(). Both sides are sequentially consistent, so either the function sees that
 * everything closes, or the other side sees it run. */
static bool enter(struct card *const card)
{
    atomic_store(&card->busy, true);
    if (!atomic_load(&closing) && !atomic_load(&card->held))
        return true;
    atomic_store_explicit(&card->busy, false, memory_order_release);
    return false;
}

static void leave(struct card *const card)
{
    atomic_store_explicit(&card->busy, false, memory_order_release);
}

/* A HAL file may schedule only .read for several cards. The first .read of a cycle then sends the requests of all
 * cards that the same thread reads, so that they travel in parallel; a card that has left the thread lags behind in
 * its count and is no longer served. */
static void request_all(const struct card *const caller, const int thread, const long period)
{
    for (unsigned i = 0; i < card_count; i++) {
        struct card *const other = &cards[i];
        const bool same_turn =
            atomic_load_explicit(&other->thread, memory_order_relaxed) == thread && other->cycle == caller->cycle;
        if (same_turn && !hm2_board_request_outstanding(other->board))
            hm2_board_request(other->board, period);
    }
}

static void card_read_request(void *const arg, const long period)
{
    struct card *const card = arg;
    if (!enter(card))
        return;
    if (!hm2_board_request_outstanding(card->board))
        hm2_board_request(card->board, period);
    leave(card);
}

static void card_read(void *const arg, const long period)
{
    struct card *const card = arg;
    if (!enter(card))
        return;
    if (card_count > 1) {
        const int thread = rtapi_task_self();
        atomic_store_explicit(&card->thread, thread, memory_order_relaxed);
        if (!hm2_board_request_outstanding(card->board))
            request_all(card, thread, period);
        card->cycle++;
    }
    hm2_board_read(card->board, period);
    leave(card);
}

static void card_write(void *const arg, const long period)
{
    struct card *const card = arg;
    if (!enter(card))
        return;
    hm2_board_write(card->board, period);
    leave(card);
}

#define CLOSE_STEP_NS 1000000L
#define CLOSE_STEPS   2000u /* a read waits for its reply, at most for packet-read-timeout */

static void await_functions(struct card *const card)
{
    const struct timespec step = {.tv_nsec = CLOSE_STEP_NS};
    for (unsigned steps = 0; atomic_load(&card->busy) && steps < CLOSE_STEPS; steps++)
        nanosleep(&step, NULL);
}

/* Afterwards no function touches a board. */
static void close_functions(void)
{
    atomic_store(&closing, true);
    for (unsigned i = 0; i < card_count; i++)
        await_functions(&cards[i]);
}

/* ---- for the functions that other components call -----------------------------------------------------------------
 */

/* One change at a time: hm2_pty follows its terminals in a thread of its own, while others are loaded. */
static pthread_mutex_t changes = PTHREAD_MUTEX_INITIALIZER;

void card_pause(struct card *const card)
{
    (void)pthread_mutex_lock(&changes);
    atomic_store(&card->held, true);
    await_functions(card);
}

void card_resume(struct card *const card)
{
    atomic_store(&card->held, false);
    (void)pthread_mutex_unlock(&changes);
}

struct hm2_board *card_board(struct card *const card)
{
    return card->board;
}

struct card *card_of_port(const char *const name, const char *const kind, unsigned *const unit)
{
    for (unsigned i = 0; name && i < card_count; i++) {
        char prefix[HAL_NAME_LEN + 1];
        const int len = rtapi_snprintf(prefix, sizeof prefix, "%s.%s.", hm2_board_prefix(cards[i].board), kind);
        if (len <= 0 || strncmp(name, prefix, (size_t)len) != 0)
            continue;
        char *end;
        const unsigned long number = strtoul(name + len, &end, 10);
        *unit = (unsigned)number;
        if (end != name + len && *end == '\0' && number <= 255)
            return &cards[i];
    }
    rtapi_print_msg(RTAPI_MSG_ERR, "hm2_lbp16: there is no %s \"%s\"; the ports of the first card are %s.%s.0 and on\n",
                    kind, name ? name : "", card_count ? hm2_board_prefix(cards[0].board) : "hm2_<card>.0", kind);
    return NULL;
}

static const struct {
    const char *name;
    void (*function)(void *arg, long period);
} functions[] = {
    {"read-request", card_read_request},
    {"read", card_read},
    {"write", card_write},
};

static int export_functions(struct card *const card)
{
    for (size_t i = 0; i < sizeof functions / sizeof functions[0]; i++) {
        char name[HAL_NAME_LEN + 1];
        const char *const prefix = hm2_board_prefix(card->board);
        const int len = rtapi_snprintf(name, sizeof name, "%s.%s", prefix, functions[i].name);
        if (len < 0 || (size_t)len >= sizeof name) {
            rtapi_print_msg(RTAPI_MSG_ERR, "hm2_lbp16: function name %s.%s is longer than HAL allows (%d)\n", prefix,
                            functions[i].name, HAL_NAME_LEN);
            return -EINVAL;
        }
        const int result = hal_export_funct(name, functions[i].function, card, 1, 0, component_id);
        if (result < 0) {
            rtapi_print_msg(RTAPI_MSG_ERR, "hm2_lbp16: HAL did not take the function %s (%d)\n", name, result);
            return result;
        }
    }
    return 0;
}

/* ---- messages: formatted and printed outside the realtime threads ------------------------------------------------ */

static void print_messages(void)
{
    char text[1024];
    bool error;
    for (unsigned i = 0; i < card_count; i++)
        for (unsigned n = 0; n < 32 && hm2_board_next_message(cards[i].board, text, sizeof text, &error) == 1; n++)
            rtapi_print_msg(error ? RTAPI_MSG_ERR : RTAPI_MSG_WARN, "hm2_lbp16: %s\n", text);
}

static void write_flights(void)
{
    char text[512];
    for (unsigned i = 0; i < card_count; i++)
        if (flight_file_write(cards[i].board, flight_folder, text, sizeof text))
            rtapi_print("hm2_lbp16: %s\n", text);
}

static void look_after_cards(void)
{
    print_messages();
    write_flights();
}

/* ---- load and unload --------------------------------------------------------------------------------------------- */

static void print_listing(const struct card *const card)
{
    static char text[16384];
    const char *rest = text;
    char line[MESSENGER_LINE];
    const struct hm2_plan_sizes sizes = hm2_board_sizes(card->board);
    hm2_board_describe_pins(card->board, text, sizeof text);
    rtapi_print("%s: payload of a cycle: request %u, reply %u, write %u bytes; set-up up to %u bytes in %u sections\n",
                hm2_board_prefix(card->board), (unsigned)sizes.request_bytes, (unsigned)sizes.reply_bytes,
                (unsigned)sizes.write_bytes, (unsigned)sizes.setup_bytes, sizes.sections);
    while (messenger_next_line(&rest, line))
        rtapi_print("%s\n", line);
}

/* Cards are numbered by the name in their prefix, which different types may share (7I80DB and 7I80HD). */
static unsigned cards_of_same_name(const struct card *const card)
{
    const char *const stem = hm2_board_type(card->board)->stem;
    unsigned count = 0;
    for (const struct card *other = cards; other < card; other++)
        count += strcmp(hm2_board_type(other->board)->stem, stem) == 0;
    return count;
}

#define CONFIG_SIZE 2048

/* The card's configuration, and what hostmot2 takes as module parameters and the library as words of it. */
static int complete_config(char text[const CONFIG_SIZE], const char *const configuration, struct hm2_diag *const diag)
{
    char baudrate[48] = "";
    if (sserial_baudrate > 0)
        rtapi_snprintf(baudrate, sizeof baudrate, " sserial_baudrate=%d", sserial_baudrate);
    const int len = rtapi_snprintf(text, CONFIG_SIZE, "%s%s%s", configuration ? configuration : "", baudrate,
                                   use_serial_numbers ? " use_serial_numbers" : "");
    return len < CONFIG_SIZE ? HM2_OK
                             : hm2_diag_add(diag, HM2_ERR_NOSPACE, "config: %d characters found, at most %d expected",
                                            len, CONFIG_SIZE - 1);
}

static bool spins(void)
{
    return receive && strcmp(receive, "spin") == 0;
}

static int bring_up(struct card *const card, const char *const address, const char *const configuration,
                    struct hm2_diag *const diag)
{
    const struct link_udp_options options = {
        .address = address, .busy_poll_us = (unsigned)busy_poll, .spin = spins(), .watch_strangers = true};
    char config_text[CONFIG_SIZE];
    struct link *link;
    int err = complete_config(config_text, configuration, diag);
    if (err == HM2_OK)
        err = link_udp_open(&link, &options, diag);
    if (err == HM2_OK)
        err = hm2_board_identify(card->board, link, diag);
    if (err == HM2_OK && flight_folder && flight_folder[0])
        err = hm2_board_record(card->board, flight_cycles < 0 ? 0 : (unsigned)flight_cycles,
                               (int64_t)flight_slow_us * NS_PER_US, diag);
    if (err == HM2_OK)
        err = hm2_board_setup(card->board, cards_of_same_name(card), &hal.binder, config_text, diag);
    if (err == HM2_OK)
        err = hm2_board_start(card->board, diag);
    return err;
}

static int load_card(const char *const address, const char *const configuration)
{
    struct card *const card = &cards[card_count];
    struct hm2_diag diag;
    char subject[64];

    hm2_diag_clear(&diag);
    card->board = hm2_board_new();
    if (!card->board) {
        rtapi_print_msg(RTAPI_MSG_ERR, "hm2_lbp16: card %s: not loaded: %s\n", address, hm2_strerror(HM2_ERR_NOMEM));
        return -ENOMEM;
    }
    atomic_store(&card->busy, false);
    atomic_store(&card->held, false);
    atomic_store(&card->thread, NO_THREAD);
    card->cycle = 0;
    card_count++;
    const int err = bring_up(card, address, configuration, &diag);
    rtapi_snprintf(subject, sizeof subject, "card %s", address);
    messenger_print_diag("hm2_lbp16", subject, &diag);
    if (err != HM2_OK) {
        rtapi_print_msg(RTAPI_MSG_ERR, "hm2_lbp16: card %s: not loaded: %s\n", address, hm2_strerror(err));
        return -EINVAL;
    }
    if (debug || debug_pin_descriptors || debug_modules || debug_idrom || debug_module_descriptors)
        print_listing(card);
    return export_functions(card);
}

/* Length of an address without the port that is meant anyway. */
static size_t address_len(const char *const address)
{
    static const char usual[] = ":27181";
    const size_t len = strlen(address), port_len = sizeof usual - 1;
    return len > port_len && strcmp(address + len - port_len, usual) == 0 ? len - port_len : len;
}

static bool same_address(const char *const a, const char *const b)
{
    return address_len(a) == address_len(b) && strncmp(a, b, address_len(a)) == 0;
}

/* Mistakes that no card can tell: two boards at one card would fight over it, and a comma within a configuration cuts
 * it (the loader knows no quotes), which leaves a configuration without a card. */
static int check_lists(const unsigned given)
{
    for (unsigned i = 0; i < given; i++)
        for (unsigned k = 0; k < i; k++)
            if (same_address(board_ip[i], board_ip[k])) {
                rtapi_print_msg(RTAPI_MSG_ERR,
                                "hm2_lbp16: board_ip: cards %u and %u both have the address %s; give "
                                "each card its own\n",
                                k, i, board_ip[i]);
                return -EINVAL;
            }
    for (unsigned i = given; i < MAX_CARDS; i++)
        if (config[i] && config[i][0])
            rtapi_print(
                "hm2_lbp16: warning: config: \"%s\" is for card %u, but board_ip has %u; it is ignored (words of a "
                "configuration are separated by blanks, configurations by commas)\n",
                config[i], i, given);
    return 0;
}

static bool is_one_of(const char *const text, const char *const *const words)
{
    for (const char *const *word = words; *word; word++)
        if (strcmp(text, *word) == 0)
            return true;
    return false;
}

static int check_receive_path(void)
{
    static const char *const ways[] = {"wait", "spin", "", NULL};
    if (receive && !is_one_of(receive, ways)) {
        rtapi_print_msg(RTAPI_MSG_ERR, "hm2_lbp16: receive=%s: expected wait or spin\n", receive);
        return -EINVAL;
    }
    if (busy_poll < 0 || busy_poll > MAX_BUSY_POLL_US) {
        rtapi_print_msg(RTAPI_MSG_ERR, "hm2_lbp16: busy_poll=%d: expected 0 to %d microseconds\n", busy_poll,
                        MAX_BUSY_POLL_US);
        return -EINVAL;
    }
    return 0;
}

static void tell_no_effect(const char *const parameter, const char *const value, const char *const why)
{
    rtapi_print("hm2_lbp16: warning: %s=%s has no effect: %s\n", parameter, value, why);
}

/* Parameters of LinuxCNC's drivers that ask for what this component does not do. */
static void tell_what_has_no_effect(void)
{
    static const char *const ordinary[] = {"", "posix", NULL};
    for (unsigned i = 0; i < MAX_CARDS; i++)
        if (board_rtnet[i] && !is_one_of(board_rtnet[i], ordinary))
            tell_no_effect("board_rtnet", board_rtnet[i], "the sockets are those of the kernel (posix)");
}

static const struct {
    const char *word;
    enum isolation_mode mode;
} firewalls[] = {
    {"auto", ISOLATION_AUTO},       {"none", ISOLATION_NONE},       {"nft", ISOLATION_FORCED}, {"", ISOLATION_AUTO},
    {"nftables", ISOLATION_FORCED}, {"iptables", ISOLATION_FORCED}, /* LinuxCNC's other word; the rules are the same */
};

static int find_isolation(enum isolation_mode *const mode)
{
    const char *const wanted = firewall ? firewall : "auto";
    for (size_t i = 0; i < sizeof firewalls / sizeof firewalls[0]; i++)
        if (strcmp(wanted, firewalls[i].word) == 0) {
            *mode = firewalls[i].mode;
            return 0;
        }
    rtapi_print_msg(RTAPI_MSG_ERR, "hm2_lbp16: firewall=%s: expected auto, none or nft\n", wanted);
    return -EINVAL;
}

static void isolate(const unsigned count, const enum isolation_mode mode)
{
    const char *addresses[MAX_CARDS];
    struct hm2_diag diag;
    hm2_diag_clear(&diag);
    for (unsigned i = 0; i < count; i++)
        addresses[i] = board_ip[i];
    isolation_begin(&isolation, addresses, count, mode, &diag);
    messenger_print_diag("hm2_lbp16", "network", &diag);
}

/* The message level of LinuxCNC 2.9's realtime components is not the one that its halcmd sets. */
static void let_warnings_through(void)
{
    if (rtapi_get_msg_level() < RTAPI_MSG_WARN)
        (void)rtapi_set_msg_level(RTAPI_MSG_WARN);
}

static int load_cards(void)
{
    enum isolation_mode mode;
    if (debug > 1)
        let_warnings_through();
    tell_what_has_no_effect();
    if (!board_ip[0] || !board_ip[0][0]) {
        rtapi_print_msg(RTAPI_MSG_ERR,
                        "hm2_lbp16: no card given; load with: loadrt hm2_lbp16 board_ip=192.168.1.121\n");
        return -EINVAL;
    }
    unsigned given = 0;
    while (given < MAX_CARDS && board_ip[given] && board_ip[given][0])
        given++;
    int result = find_isolation(&mode);
    if (result == 0)
        result = check_lists(given);
    if (result == 0)
        result = check_receive_path();
    for (unsigned i = 0; result == 0 && i < given; i++)
        result = load_card(board_ip[i], config[i]);
    if (result == 0)
        isolate(given, mode);
    return result;
}

/* Outputs go to their safe state before the memory that HAL's functions use goes away. */
void rtapi_app_exit(void)
{
    close_functions();
    for (unsigned i = 0; i < card_count; i++)
        hm2_board_stop(cards[i].board);
    messenger_stop();
    look_after_cards();
    hal_exit(component_id);
    isolation_end(&isolation);
    for (unsigned i = 0; i < card_count; i++)
        hm2_board_free(cards[i].board);
    card_count = 0;
}

static int load(void)
{
    hal_binder_init(&hal, component_id);
    atomic_store(&closing, false);
    const int result = load_cards();
    return result ? result : messenger_start("hm2_lbp16", look_after_cards, MESSENGER_PRINTS_NS);
}

int rtapi_app_main(void)
{
    return component_load("hm2_lbp16", &component_id, load, rtapi_app_exit);
}
