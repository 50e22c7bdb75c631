/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "engine.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <modbus/modbus.h>
#include <rtapi.h>

#include "common/messenger.h"
#include "slots.h"

#define NS_PER_MS       INT64_C(1000000)
#define NS_PER_S        INT64_C(1000000000)
#define REST_NS         (1 * NS_PER_MS)   /* between rounds: a link with no rate must not eat a processor */
#define BACK_OFF_MIN_NS (100 * NS_PER_MS) /* doubled with every failure */
#define BACK_OFF_MAX_NS (2 * NS_PER_S)
#define NAP_NS          (10 * NS_PER_MS) /* longest sleep without a look at whether to end */

struct transaction {
    const struct hm2_modbus_transaction *map;
    struct slots result_slots, order_slots;
    struct engine_result *results[3];
    uint16_t *orders[3];
    atomic_bool enabled;
    /* Of the link's thread alone. */
    struct engine_state state;
    uint16_t *words; /* read last, or confirmed by the device */
    bool ordered, confirmed;
    int64_t next_ns, confirmed_ns, back_off_ns;
};

struct line {
    const struct hm2_modbus_link *map;
    struct engine *engine;
    pthread_t thread;
    bool runs;
    modbus_t *modbus;
    char name[160];
    bool open, told;
    int64_t next_open_ns, back_off_ns;
};

struct engine {
    const struct hm2_modbus_map *map;
    struct transaction *transactions;
    struct line *lines;
    atomic_bool ends;
};

/* ---- the cycle ---------------------------------------------------------------------------------------------------*/

uint16_t *engine_order(struct engine *const engine, const unsigned transaction)
{
    struct transaction *const tx = &engine->transactions[transaction];
    return tx->orders[tx->order_slots.back];
}

void engine_send(struct engine *const engine, const unsigned transaction)
{
    slots_publish(&engine->transactions[transaction].order_slots);
}

void engine_enable(struct engine *const engine, const unsigned transaction, const bool enable)
{
    atomic_store_explicit(&engine->transactions[transaction].enabled, enable, memory_order_relaxed);
}

const struct engine_result *engine_result(struct engine *const engine, const unsigned transaction, bool *const fresh)
{
    struct transaction *const tx = &engine->transactions[transaction];
    *fresh = slots_take(&tx->result_slots);
    return tx->results[tx->result_slots.front];
}

/* ---- time --------------------------------------------------------------------------------------------------------*/

static int64_t now(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * NS_PER_S + t.tv_nsec;
}

static void sleep_ns(const struct engine *const engine, int64_t ns)
{
    while (ns > 0 && !atomic_load(&engine->ends)) {
        const int64_t nap = ns < NAP_NS ? ns : NAP_NS;
        (void)nanosleep(&(const struct timespec){.tv_nsec = nap}, NULL);
        ns -= nap;
    }
}

static int64_t longer(const int64_t back_off_ns)
{
    const int64_t next = back_off_ns ? 2 * back_off_ns : BACK_OFF_MIN_NS;
    return next < BACK_OFF_MAX_NS ? next : BACK_OFF_MAX_NS;
}

/* ---- one transaction ---------------------------------------------------------------------------------------------*/

static void publish(struct transaction *const tx)
{
    struct engine_result *const result = tx->results[tx->result_slots.back];
    result->state = tx->state;
    memcpy(result->words, tx->words, tx->map->words * sizeof *tx->words);
    slots_publish(&tx->result_slots);
}

static int bits(modbus_t *const modbus, const struct hm2_modbus_transaction *const map, uint16_t *const words)
{
    uint8_t bytes[HM2_MODBUS_MAX_COILS] = {0};
    const int first = (int)map->first, count = (int)map->words;
    for (unsigned i = 0; i < map->words; i++)
        bytes[i] = words[i] != 0;
    if (map->function == HM2_MODBUS_WRITE_SINGLE_COIL)
        return modbus_write_bit(modbus, first, bytes[0]);
    if (map->function == HM2_MODBUS_WRITE_MULTIPLE_COILS)
        return modbus_write_bits(modbus, first, count, bytes);
    const int result = map->function == HM2_MODBUS_READ_COILS ? modbus_read_bits(modbus, first, count, bytes)
                                                              : modbus_read_input_bits(modbus, first, count, bytes);
    for (unsigned i = 0; result >= 0 && i < map->words; i++)
        words[i] = bytes[i];
    return result;
}

static int registers(modbus_t *const modbus, const struct hm2_modbus_transaction *const map, uint16_t *const words)
{
    const int first = (int)map->first, count = (int)map->words;
    if (map->function == HM2_MODBUS_WRITE_SINGLE_REGISTER)
        return modbus_write_register(modbus, first, words[0]);
    if (map->function == HM2_MODBUS_WRITE_MULTIPLE_REGISTERS)
        return modbus_write_registers(modbus, first, count, words);
    uint16_t read[MODBUS_MAX_READ_REGISTERS];
    const int result = map->function == HM2_MODBUS_READ_HOLDING_REGISTERS
                           ? modbus_read_registers(modbus, first, count, read)
                           : modbus_read_input_registers(modbus, first, count, read);
    if (result >= 0)
        memcpy(words, read, map->words * sizeof *words);
    return result;
}

static void set_response_timeout(modbus_t *const modbus, const unsigned ms)
{
    (void)modbus_set_response_timeout(modbus, ms / 1000, ms % 1000 * 1000);
}

static int ask(modbus_t *const modbus, const struct hm2_modbus_transaction *const map, uint16_t *const words)
{
    if (modbus_set_slave(modbus, (int)map->unit) != 0)
        return -1;
    set_response_timeout(modbus, map->response_timeout_ms);
    (void)modbus_set_byte_timeout(modbus, map->byte_timeout_ms / 1000, map->byte_timeout_ms % 1000 * 1000);
    const int result = hm2_modbus_is_bits(map->function) ? bits(modbus, map, words) : registers(modbus, map, words);
    if (result >= 0 && result != (int)map->words) {
        errno = EMBBADDATA;
        return -1;
    }
    return result;
}

static bool is_exception(const int error)
{
    return error > MODBUS_ENOBASE && error < MODBUS_ENOBASE + MODBUS_EXCEPTION_MAX;
}

/* The link itself is as it was; what came was wrong, or nothing came. */
static bool is_answer_missing(const int error)
{
    return error == ETIMEDOUT || error == EMBBADCRC || error == EMBBADDATA || error == EMBBADEXC || error == EMBMDATA ||
           error == EMBBADSLAVE;
}

/* ---- a link ------------------------------------------------------------------------------------------------------*/

static bool of_line(const struct line *const line, const struct transaction *const tx)
{
    return &line->engine->map->links[tx->map->link] == line->map;
}

/* Nobody knows what a device that was away has kept: all is written to it again. */
static void forget(struct line *const line, const struct hm2_modbus_transaction *const of_unit)
{
    for (unsigned i = 0; i < line->engine->map->transaction_count; i++) {
        struct transaction *const tx = &line->engine->transactions[i];
        if (of_line(line, tx) && (!of_unit || tx->map->unit == of_unit->unit))
            tx->confirmed = false;
    }
}

static void fail(struct transaction *const tx, const bool connected)
{
    tx->state.good = false;
    tx->state.connected = connected;
    tx->state.errors++;
    tx->state.errors_in_row++;
    publish(tx);
}

static void tell(struct line *const line, const char *const what, const int error)
{
    if (!line->told)
        rtapi_print_msg(RTAPI_MSG_ERR, "modbus_io: %s: %s: %s; trying again\n", line->name, what,
                        modbus_strerror(error));
    line->told = true;
}

static void close_line(struct line *const line)
{
    modbus_close(line->modbus);
    line->open = false;
    line->back_off_ns = longer(line->back_off_ns);
    line->next_open_ns = now() + line->back_off_ns;
    forget(line, NULL);
}

/* NULL, or what went wrong, with errno. */
static const char *prepare_serial(const struct line *const line)
{
    if (line->map->rs485 && modbus_rtu_set_serial_mode(line->modbus, MODBUS_RTU_RS485) != 0)
        return "its driver has no RS-485 mode. Leave SERIAL_RS485 out for an adapter that turns its transmitter on by "
               "itself, and where RTS does that, say SERIAL_RTS=up or down";
    if (line->map->rts != HM2_MODBUS_RTS_NONE &&
        modbus_rtu_set_rts(line->modbus,
                           line->map->rts == HM2_MODBUS_RTS_UP ? MODBUS_RTU_RTS_UP : MODBUS_RTU_RTS_DOWN) != 0)
        return "RTS cannot be set";
    return NULL;
}

/* libmodbus waits for a connection as long as for an answer. A link's transactions may differ in that: the connection,
 * which serves all of them, has the longest time. */
static int connect_line(const struct line *const line)
{
    unsigned longest_ms = 1;
    for (unsigned i = 0; i < line->engine->map->transaction_count; i++) {
        const struct transaction *const tx = &line->engine->transactions[i];
        if (of_line(line, tx) && tx->map->response_timeout_ms > longest_ms)
            longest_ms = tx->map->response_timeout_ms;
    }
    set_response_timeout(line->modbus, longest_ms);
    if (modbus_connect(line->modbus) == 0)
        return 0;
    if (errno == EINPROGRESS) /* what some versions leave there when the time is over */
        errno = ETIMEDOUT;
    return -1;
}

static void open_line(struct line *const line)
{
    const char *problem = connect_line(line) == 0 ? NULL : "cannot be opened";
    if (!problem && !line->map->tcp)
        problem = prepare_serial(line);
    if (!problem) {
        line->open = true;
        (void)modbus_flush(line->modbus);
        return;
    }
    tell(line, problem, errno);
    close_line(line);
    for (unsigned i = 0; i < line->engine->map->transaction_count; i++)
        if (of_line(line, &line->engine->transactions[i]))
            fail(&line->engine->transactions[i], false);
}

/* Words that are to be written now; false when there are none. */
static bool take_order(struct transaction *const tx, uint16_t *const words)
{
    const size_t size = tx->map->words * sizeof *words;
    if (slots_take(&tx->order_slots))
        tx->ordered = true;
    if (!tx->ordered)
        return false;
    memcpy(words, tx->orders[tx->order_slots.front], size);
    if (!tx->map->on_change || !tx->confirmed || memcmp(words, tx->words, size) != 0)
        return true;
    return tx->map->refresh_s > 0.0 && (double)(now() - tx->confirmed_ns) >= tx->map->refresh_s * (double)NS_PER_S;
}

static void succeed(struct line *const line, struct transaction *const tx, const uint16_t *const words)
{
    memcpy(tx->words, words, tx->map->words * sizeof *words);
    tx->confirmed = true;
    tx->confirmed_ns = now();
    tx->back_off_ns = 0;
    line->back_off_ns = 0;
    if (line->told)
        rtapi_print("modbus_io: %s: answers again\n", line->name);
    line->told = false;
    tx->state.good = tx->state.connected = true;
    tx->state.goods++;
    tx->state.errors_in_row = 0;
    publish(tx);
}

/* On a serial line no answer says which request it is for. After one that did not come in time the line rests for as
 * long again, or until it comes, and what came is dropped. */
static void drop_late_answer(const struct line *const line, const struct transaction *const tx)
{
    struct pollfd ready = {.fd = modbus_get_socket(line->modbus), .events = POLLIN};
    const int64_t until = now() + (int64_t)tx->map->response_timeout_ms * NS_PER_MS;
    bool came = false;
    while (!came && now() < until && !atomic_load(&line->engine->ends))
        came = poll(&ready, 1, (int)(NAP_NS / NS_PER_MS)) > 0;
    if (came)
        sleep_ns(line->engine, (int64_t)tx->map->byte_timeout_ms * NS_PER_MS);
    (void)modbus_flush(line->modbus);
}

/* Whether another try may be made at once. */
static bool take_failure(struct line *const line, struct transaction *const tx, const int error)
{
    const bool answered = is_exception(error);
    tx->confirmed = false;
    fail(tx, answered);
    if (answered)
        return true;
    tx->back_off_ns = longer(tx->back_off_ns);
    tell(line, "no good answer", error);
    /* On TCP a late answer may still come, which must not be taken for another's. */
    if (line->map->tcp || !is_answer_missing(error)) {
        close_line(line);
        return false;
    }
    forget(line, tx->map);
    if (error == ETIMEDOUT || error == EMBBADSLAVE)
        drop_late_answer(line, tx);
    else
        (void)modbus_flush(line->modbus);
    return true;
}

static void run(struct line *const line, struct transaction *const tx)
{
    uint16_t words[HM2_MODBUS_MAX_COILS] = {0};
    if (hm2_modbus_writes(tx->map->function) && !take_order(tx, words))
        return;
    bool again = true;
    for (unsigned tries = 0; again && tries <= tx->map->retries && !atomic_load(&line->engine->ends); tries++)
        if (ask(line->modbus, tx->map, words) >= 0) {
            succeed(line, tx, words);
            again = false;
        } else {
            again = take_failure(line, tx, errno);
        }
    const int64_t period_ns = tx->map->rate_hz > 0.0 ? (int64_t)((double)NS_PER_S / tx->map->rate_hz) : 0;
    tx->next_ns = now() + (period_ns > tx->back_off_ns ? period_ns : tx->back_off_ns);
    sleep_ns(line->engine, (int64_t)tx->map->delay_ms * NS_PER_MS);
    sleep_ns(line->engine, (int64_t)(line->engine->map->slowdown_s * (double)NS_PER_S));
}

static void run_due(struct line *const line)
{
    for (unsigned i = 0; i < line->engine->map->transaction_count; i++) {
        struct transaction *const tx = &line->engine->transactions[i];
        if (!line->open || atomic_load(&line->engine->ends))
            return;
        if (of_line(line, tx) && now() >= tx->next_ns && atomic_load(&tx->enabled))
            run(line, tx);
    }
}

static void *line_main(void *const argument)
{
    struct line *const line = argument;
    while (!atomic_load(&line->engine->ends)) {
        if (!line->open && now() >= line->next_open_ns)
            open_line(line);
        if (line->open)
            run_due(line);
        sleep_ns(line->engine, REST_NS);
    }
    return NULL;
}

/* ---- set-up ------------------------------------------------------------------------------------------------------*/

static bool make_transaction(struct transaction *const tx, const struct hm2_modbus_transaction *const map)
{
    tx->map = map;
    atomic_init(&tx->enabled, !map->enable_pin);
    slots_init(&tx->result_slots);
    slots_init(&tx->order_slots);
    tx->words = calloc(map->words, sizeof *tx->words);
    bool all = tx->words != NULL;
    for (unsigned i = 0; i < 3; i++) {
        tx->results[i] = calloc(1, sizeof *tx->results[i] + map->words * sizeof *tx->words);
        tx->orders[i] = calloc(map->words, sizeof *tx->words);
        all = all && tx->results[i] && tx->orders[i];
    }
    return all;
}

static bool make_line(struct line *const line, const struct hm2_modbus_link *const map, struct engine *const engine)
{
    line->map = map;
    line->engine = engine;
    if (map->tcp) {
        char port[8];
        (void)snprintf(port, sizeof port, "%u", map->port);
        (void)snprintf(line->name, sizeof line->name, "%s:%u", map->host, map->port);
        line->modbus = modbus_new_tcp_pi(map->host, port);
    } else {
        (void)snprintf(line->name, sizeof line->name, "%s", map->device);
        line->modbus =
            modbus_new_rtu(map->device, (int)map->baud, map->parity, (int)map->data_bits, (int)map->stop_bits);
    }
    return line->modbus != NULL;
}

struct engine *engine_new(const struct hm2_modbus_map *const map)
{
    struct engine *const engine = calloc(1, sizeof *engine);
    if (!engine)
        return NULL;
    engine->map = map;
    engine->transactions = calloc(map->transaction_count, sizeof *engine->transactions);
    engine->lines = calloc(map->link_count, sizeof *engine->lines);
    bool all = engine->transactions && engine->lines;
    for (unsigned i = 0; all && i < map->transaction_count; i++)
        all = make_transaction(&engine->transactions[i], &map->transactions[i]);
    for (unsigned i = 0; all && i < map->link_count; i++)
        all = make_line(&engine->lines[i], &map->links[i], engine);
    if (all)
        return engine;
    engine_free(engine);
    return NULL;
}

int engine_start(struct engine *const engine)
{
    for (unsigned i = 0; i < engine->map->link_count; i++) {
        struct line *const line = &engine->lines[i];
        const int error = messenger_create(&line->thread, line_main, line);
        if (error)
            return -error;
        line->runs = true;
    }
    return 0;
}

static void free_transaction(const struct transaction *const tx)
{
    free(tx->words);
    for (unsigned i = 0; i < 3; i++) {
        free(tx->results[i]);
        free(tx->orders[i]);
    }
}

void engine_free(struct engine *const engine)
{
    if (!engine)
        return;
    atomic_store(&engine->ends, true);
    for (unsigned i = 0; engine->lines && i < engine->map->link_count; i++) {
        struct line *const line = &engine->lines[i];
        if (line->runs)
            (void)pthread_join(line->thread, NULL);
        if (line->modbus) {
            modbus_close(line->modbus);
            modbus_free(line->modbus);
        }
    }
    for (unsigned i = 0; engine->transactions && i < engine->map->transaction_count; i++)
        free_transaction(&engine->transactions[i]);
    free(engine->lines);
    free(engine->transactions);
    free(engine);
}
