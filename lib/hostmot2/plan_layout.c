/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Set-up of the transfer plan: collect windows and sections, sort, merge, lay out. */
#include <hm2/plan.h>

#include <string.h>

#include "plan_internal.h"

#define REGISTER_SPACE_BYTES 0x10000u
#define RANK_MOVABLE         ((uint8_t)HM2_RANK_LAST + 1u)
#define RANK_QUEUE           ((uint8_t)HM2_RANK_LAST + 2u)

size_t hm2_plan_size(void)
{
    return sizeof(struct hm2_plan);
}

void hm2_plan_init(struct hm2_plan *const plan, const uint32_t session)
{
    memset(plan, 0, sizeof *plan);
    plan->session = session == 0 || session == UINT32_MAX ? 1 : session;
    plan->session_state = PLAN_DIRTY;
    plan->facts.write_confirmed = true;
    plan->facts.session_kept = true;
}

static int check_registers(const struct hm2_plan *const plan, const uint16_t address, const unsigned words,
                           struct hm2_diag *const diag)
{
    if (plan->frozen)
        return hm2_diag_add(diag, HM2_ERR_STATE, "Registers at 0x%04X come too late: the packets are laid out already.",
                            address);
    if (words < 1 || words > LBP16_MAX_COUNT)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "Registers at 0x%04X: %u words asked for, one command holds 1 to %u.",
                            address, words, LBP16_MAX_COUNT);
    if (address % 4u != 0 || address + 4u * words > REGISTER_SPACE_BYTES)
        return hm2_diag_add(diag, HM2_ERR_RANGE,
                            "Registers at 0x%04X, %u words: addresses are multiples of 4 and end at 0xFFFF.", address,
                            words);
    return 0;
}

static int add_window(struct hm2_plan *const plan, struct plan_list *const list, const struct plan_window *const added,
                      struct hm2_diag *const diag)
{
    const int err = check_registers(plan, added->address, added->words, diag);
    if (err)
        return err;
    if (list->count == HM2_PLAN_MAX_WINDOWS)
        return hm2_diag_add(diag, HM2_ERR_NOSPACE,
                            "Registers at 0x%04X: more than %u register windows in one direction; use fewer module "
                            "instances (config string).",
                            added->address, HM2_PLAN_MAX_WINDOWS);
    *added->window = (struct hm2_window){.words = added->words};
    list->at[list->count++] = *added;
    return 0;
}

/* 16 bits are enough for every number of words that check_registers() lets pass. */
static uint16_t clamped(const unsigned words)
{
    return (uint16_t)(words <= UINT16_MAX ? words : UINT16_MAX);
}

int hm2_plan_add_read(struct hm2_plan *const plan, struct hm2_window *const window, const enum hm2_rank rank,
                      const uint16_t address, const unsigned words, struct hm2_diag *const diag)
{
    const struct plan_window added = {
        .window = window, .address = address, .words = clamped(words), .rank = (uint8_t)rank};
    return add_window(plan, &plan->reads, &added, diag);
}

int hm2_plan_add_read_movable(struct hm2_plan *const plan, struct hm2_window *const window, struct hm2_diag *const diag)
{
    const struct plan_window added = {.window = window, .words = 1, .rank = RANK_MOVABLE, .movable = true};
    return add_window(plan, &plan->reads, &added, diag);
}

/* Equal addresses keep the order of registration; where a queue begins is told apart. */
static struct plan_window queue(struct hm2_window *const window, const uint16_t address, const unsigned words)
{
    return (struct plan_window){.window = window,
                                .words = clamped(words),
                                .rank = RANK_QUEUE,
                                .movable = true,
                                .queue = true,
                                .aimed = address};
}

int hm2_plan_add_queue_read(struct hm2_plan *const plan, struct hm2_window *const window, const uint16_t address,
                            const unsigned words, struct hm2_diag *const diag)
{
    const struct plan_window added = queue(window, address, words);
    return add_window(plan, &plan->reads, &added, diag);
}

int hm2_plan_add_queue_write(struct hm2_plan *const plan, struct hm2_window *const window, const uint16_t address,
                             const unsigned words, struct hm2_diag *const diag)
{
    const struct plan_window added = queue(window, address, words);
    return add_window(plan, &plan->writes, &added, diag);
}

int hm2_plan_add_write(struct hm2_plan *const plan, struct hm2_window *const window, const enum hm2_rank rank,
                       const uint16_t address, const unsigned words, struct hm2_diag *const diag)
{
    const struct plan_window added = {
        .window = window, .address = address, .words = clamped(words), .rank = (uint8_t)rank};
    return add_window(plan, &plan->writes, &added, diag);
}

int hm2_plan_add_setup(struct hm2_plan *const plan, struct hm2_section *const section, const enum hm2_rank rank,
                       const uint16_t address, const unsigned words, const unsigned flags, struct hm2_diag *const diag)
{
    const struct lbp16_command command = {.write = true,
                                          .has_address = true,
                                          .space = LBP16_SPACE_HM2,
                                          .size = LBP16_SIZE_32,
                                          .increment = (flags & HM2_SECTION_FIFO) == 0,
                                          .count = words,
                                          .address = address};
    struct lbp16_builder builder;
    size_t data_at;
    int err = check_registers(plan, address, words, diag);
    if (err)
        return err;
    lbp16_builder_init(&builder, plan->setup + plan->setup_len, sizeof plan->setup - plan->setup_len);
    err = plan->section_count < HM2_PLAN_MAX_SECTIONS ? lbp16_add_write(&builder, &command, NULL, &data_at)
                                                      : HM2_ERR_NOSPACE;
    if (err)
        return hm2_diag_add(diag, err,
                            "Set-up registers at 0x%04X: no room for %u words more; a plan holds %u sections and %u "
                            "bytes, it has %u and %zu. Use fewer module instances (config string).",
                            address, words, HM2_PLAN_MAX_SECTIONS, HM2_PLAN_SETUP_BYTES, plan->section_count,
                            plan->setup_len);
    const unsigned number = plan->section_count++;
    *section = (struct hm2_section){
        .plan = plan, .bytes = builder.data + data_at, .words = (uint16_t)words, .number = (uint16_t)number};
    plan->sections[number] = (struct plan_section){.section = section,
                                                   .at = (uint16_t)plan->setup_len,
                                                   .len = (uint16_t)builder.used,
                                                   .rank = (uint8_t)rank,
                                                   .on_demand = (flags & HM2_SECTION_ON_DEMAND) != 0};
    plan->setup_len += builder.used;
    if (!plan->sections[number].on_demand)
        plan->in_state[PLAN_DIRTY].bits[number / 64u] |= UINT64_C(1) << number % 64u;
    return 0;
}

/* ---- freeze ------------------------------------------------------------------------------------------------------ */

static void sort_windows(struct plan_list *const list)
{
    for (unsigned i = 1; i < list->count; i++) {
        const struct plan_window moved = list->at[i];
        unsigned at = i;
        for (; at > 0; at--) {
            const struct plan_window *const before = &list->at[at - 1];
            if (before->rank < moved.rank || (before->rank == moved.rank && before->address <= moved.address))
                break;
            list->at[at] = *before;
        }
        list->at[at] = moved;
    }
}

/* Stable, by rank; numbers and state bits follow. */
static void sort_sections(struct hm2_plan *const plan)
{
    for (unsigned i = 1; i < plan->section_count; i++) {
        const struct plan_section moved = plan->sections[i];
        unsigned at = i;
        for (; at > 0 && plan->sections[at - 1].rank > moved.rank; at--)
            plan->sections[at] = plan->sections[at - 1];
        plan->sections[at] = moved;
    }
    struct plan_set states[PLAN_STATES] = {{{0}}};
    for (unsigned i = 0; i < plan->section_count; i++) {
        struct hm2_section *const section = plan->sections[i].section;
        const unsigned before = section->number;
        for (unsigned state = 0; state < PLAN_STATES; state++)
            if (plan->in_state[state].bits[before / 64u] >> before % 64u & 1u)
                states[state].bits[i / 64u] |= UINT64_C(1) << i % 64u;
        section->number = (uint16_t)i;
    }
    memcpy(plan->in_state, states, sizeof states);
}

/* Number of windows from `first` on that share one command, and their words. */
static unsigned run_length(const struct plan_list *const list, const unsigned first, unsigned *const words)
{
    unsigned end = first + 1;
    *words = list->at[first].words;
    while (end < list->count) {
        const struct plan_window *const last = &list->at[end - 1], *const next = &list->at[end];
        if (next->movable || last->movable || next->rank != last->rank ||
            next->address != last->address + 4u * last->words || *words + next->words > LBP16_MAX_COUNT)
            break;
        *words += next->words;
        end++;
    }
    return end - first;
}

/* Commands and data bytes of a sorted list. */
static size_t count_commands(struct plan_list *const list)
{
    size_t data_bytes = 0;
    list->commands = 0;
    for (unsigned first = 0; first < list->count; list->commands++) {
        unsigned words;
        first += run_length(list, first, &words);
        data_bytes += 4u * words;
    }
    return data_bytes;
}

static int check_overlap(const struct plan_list *const writes, struct hm2_diag *const diag)
{
    for (unsigned i = 1; i < writes->count; i++) {
        const struct plan_window *const last = &writes->at[i - 1], *const next = &writes->at[i];
        if (!next->movable && next->rank == last->rank && next->address < last->address + 4u * last->words)
            return hm2_diag_add(diag, HM2_ERR_MISMATCH,
                                "The register at 0x%04X would be written twice in every cycle: two modules of this "
                                "firmware share an address.",
                                next->address);
    }
    return 0;
}

/* They are sorted to the end. Only their owners ask for the card's count of replies. */
static bool reads_queues(const struct hm2_plan *const plan)
{
    return plan->reads.count > 0 && plan->reads.at[plan->reads.count - 1u].queue;
}

static int check_sizes(const struct hm2_plan *const plan, const size_t read_bytes, const size_t write_bytes,
                       struct hm2_diag *const diag)
{
    const bool queues = reads_queues(plan);
    const size_t request =
        PLAN_COMMAND_BYTES * plan->reads.commands + PLAN_REQUEST_BYTES + (queues ? PLAN_COMMAND_BYTES : 0u);
    const size_t reply = read_bytes + PLAN_TRAILER_BYTES + (queues ? PLAN_REPLIES_BYTES : 0u);
    const size_t fixed = PLAN_COMMAND_BYTES * plan->writes.commands + write_bytes;
    size_t longest = PLAN_SESSION_BYTES;
    for (unsigned i = 0; i < plan->section_count; i++)
        longest = plan->sections[i].len > longest ? plan->sections[i].len : longest;
    int err = 0;
    if (request > LBP16_MAX_REQUEST_BYTES || reply > LBP16_MAX_REPLY_BYTES)
        err = hm2_diag_add(diag, HM2_ERR_NOSPACE,
                           "A cycle would read %zu bytes with a request of %zu bytes; one datagram holds %u. Use fewer "
                           "module instances (config string).",
                           reply, request, LBP16_MAX_REQUEST_BYTES);
    if (fixed + longest + PLAN_NUMBER_BYTES > LBP16_MAX_REQUEST_BYTES)
        err = hm2_diag_add(diag, HM2_ERR_NOSPACE,
                           "A cycle would write %zu bytes, of which %zu must stay free for set-up; one datagram holds "
                           "%u. Use fewer module instances (config string).",
                           fixed + longest + PLAN_NUMBER_BYTES, longest, LBP16_MAX_REQUEST_BYTES);
    return err;
}

static struct lbp16_command command_of(const struct plan_window *const first, const unsigned words, const bool write)
{
    return (struct lbp16_command){.write = write,
                                  .has_address = true,
                                  .space = LBP16_SPACE_HM2,
                                  .size = LBP16_SIZE_32,
                                  .increment = !first->queue,
                                  .count = words,
                                  .address = first->movable ? first->aimed : first->address};
}

static int lay_out_reads(struct hm2_plan *const plan)
{
    static const uint16_t zero[2] = {0};
    struct plan_list *const list = &plan->reads;
    struct lbp16_builder builder;
    lbp16_builder_init(&builder, plan->request, sizeof plan->request);
    (void)lbp16_add_write16(&builder, LBP16_SPACE_TIMER, PLAN_SCRATCH_REQUEST, 2, zero, NULL);
    plan->arrival_len = plan->arrival_bytes = 0;
    plan->repeatable = true;
    for (unsigned first = 0; first < list->count;) {
        unsigned words;
        size_t at;
        const unsigned end = first + run_length(list, first, &words);
        uint8_t *const address = plan->request + builder.used + 2u;
        const struct lbp16_command command = command_of(&list->at[first], words, false);
        const int err = lbp16_add_read(&builder, &command, &at);
        if (err)
            return err;
        if (list->at[first].movable) {
            list->at[first].window->address = address;
            plan->repeatable = false;
        }
        if (list->at[first].rank == HM2_RANK_ARRIVAL) {
            plan->arrival_len = builder.used - PLAN_NUMBER_BYTES;
            plan->arrival_bytes = builder.reply_bytes;
        }
        for (; first < end; first++) {
            list->at[first].window->bytes = plan->reply + at;
            at += 4u * list->at[first].words;
        }
    }
    if (reads_queues(plan))
        (void)lbp16_add_read16(&builder, LBP16_SPACE_CONTROL, LBP16_CONTROL_TX_UDP, 1, NULL);
    (void)lbp16_add_read16(&builder, LBP16_SPACE_TIMER, PLAN_SCRATCH_REQUEST, PLAN_SCRATCH_WORDS, NULL);
    (void)lbp16_add_read16(&builder, LBP16_SPACE_CONTROL, LBP16_CONTROL_RX_UDP, 1, NULL);
    plan->request_len = builder.used;
    plan->reply_len = builder.reply_bytes;
    return builder.error;
}

static int lay_out_writes(struct hm2_plan *const plan)
{
    struct plan_list *const list = &plan->writes;
    struct lbp16_builder builder;
    lbp16_builder_init(&builder, plan->write, sizeof plan->write);
    for (unsigned first = 0; first < list->count;) {
        unsigned words;
        size_t at;
        const unsigned end = first + run_length(list, first, &words);
        uint8_t *const address = plan->write + builder.used + 2u;
        const struct lbp16_command command = command_of(&list->at[first], words, true);
        const int err = lbp16_add_write(&builder, &command, NULL, &at);
        if (err)
            return err;
        if (list->at[first].movable)
            list->at[first].window->address = address;
        for (; first < end; first++) {
            list->at[first].window->bytes = plan->write + at;
            at += 4u * list->at[first].words;
        }
    }
    plan->fixed_len = builder.used;
    return 0;
}

static int prepare_numbers(struct hm2_plan *const plan)
{
    static const uint16_t zeros[2] = {0};
    const uint16_t session[2] = {(uint16_t)plan->session, (uint16_t)(plan->session >> 16)};
    struct lbp16_builder builder;
    lbp16_builder_init(&builder, plan->session_commands, sizeof plan->session_commands);
    (void)lbp16_add_write16(&builder, LBP16_SPACE_TIMER, LBP16_TIMER_TIMEOUT_US, 1, zeros, NULL);
    int err = lbp16_add_write16(&builder, LBP16_SPACE_TIMER, PLAN_SCRATCH_SESSION, 2, session, NULL);
    lbp16_builder_init(&builder, plan->number_command, sizeof plan->number_command);
    if (!err)
        err = lbp16_add_write16(&builder, LBP16_SPACE_TIMER, PLAN_SCRATCH_WRITE, 2, zeros, NULL);
    return err;
}

static void note_places(struct plan_list *const list, const uint8_t *const base)
{
    for (unsigned i = 0; i < list->count; i++) {
        struct plan_window *const at = &list->at[i];
        at->was = (uint16_t)(at->window->bytes - base + 1);
        if (at->window->address)
            at->aimed = hm2_get_le16(at->window->address);
    }
}

static void carry_words(const struct plan_list *const list, const uint8_t *const before)
{
    for (unsigned i = 0; i < list->count; i++)
        if (list->at[i].was > 0)
            memcpy(list->at[i].window->bytes, before + list->at[i].was - 1, 4u * (size_t)list->at[i].words);
}

void hm2_plan_reopen(struct hm2_plan *const plan)
{
    if (!plan->frozen)
        return;
    plan->frozen = plan->outstanding = false;
    plan->requests_before = plan->requests; /* replies to these have another layout */
    note_places(&plan->reads, plan->reply);
    note_places(&plan->writes, plan->write);
}

int hm2_plan_freeze(struct hm2_plan *const plan, struct hm2_diag *const diag)
{
    if (plan->frozen)
        return hm2_diag_add(diag, HM2_ERR_STATE, "The packets are laid out already.");
    uint8_t reply[sizeof plan->reply], write[sizeof plan->write];
    memcpy(reply, plan->reply, sizeof reply);
    memcpy(write, plan->write, sizeof write);
    sort_windows(&plan->reads);
    sort_windows(&plan->writes);
    sort_sections(plan);
    int err = check_overlap(&plan->writes, diag);
    if (!err)
        err = check_sizes(plan, count_commands(&plan->reads), count_commands(&plan->writes), diag);
    if (!err)
        err = lay_out_reads(plan);
    if (!err)
        err = lay_out_writes(plan);
    if (!err)
        err = prepare_numbers(plan);
    if (!err) {
        carry_words(&plan->reads, reply);
        carry_words(&plan->writes, write);
        plan_prepare_turn(plan);
    }
    plan->frozen = !err;
    return err;
}

struct hm2_plan_sizes hm2_plan_sizes(const struct hm2_plan *const plan)
{
    return (struct hm2_plan_sizes){
        .request_bytes = plan->request_len,
        .reply_bytes = plan->reply_len,
        .write_bytes = plan->fixed_len + PLAN_NUMBER_BYTES,
        .setup_bytes = plan->setup_len,
        .read_commands = plan->reads.commands,
        .write_commands = plan->writes.commands,
        .sections = plan->section_count,
    };
}
