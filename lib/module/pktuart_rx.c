/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "pktuart_rx.h"

#define DATA_BLOCKS    6u
#define WORDS          63u
#define COUNT_BLOCKS   3u
#define COUNTS         7u
#define STATES         2u
#define SIZE_MASK      0x3FFu
#define SIZE_ERRORS    (7u << 14)
#define MODE_FRAMES(m) ((m) >> 16 & 0x1Fu)
#define MODE_DATA      (1u << 21)
#define MODE_ACTIVE    (1u << 7)
#define MODE_ERROR     (1u << 4)
#define WORD_BYTES     4u
#define VAIN_MAX       8u
#define CLEAR_BYTES    (1024u + 1023u) /* a full buffer, and a frame */

static unsigned smaller(const unsigned a, const unsigned b)
{
    return a < b ? a : b;
}

static unsigned words_of(const unsigned bytes)
{
    return (bytes + WORD_BYTES - 1u) / WORD_BYTES;
}

int pkt_rx_add(struct pkt_rx *const rx, const struct hm2_serial *const port, struct hm2_diag *const diag)
{
    rx->data.fifo = port->rx_reg[SERIAL_DATA];
    rx->counts.fifo = port->rx_reg[SERIAL_COUNT];
    rx->data.nowhere = rx->counts.nowhere = port->rx_reg[SERIAL_RATE]; /* to read it does nothing */
    int err = queue_add_reads(&rx->data, port->plan, DATA_BLOCKS, diag);
    if (!err)
        err = queue_add_reads(&rx->counts, port->plan, COUNT_BLOCKS, diag);
    if (!err)
        err = hm2_plan_add_queue_read(port->plan, &rx->state, port->rx_reg[SERIAL_MODE], STATES, diag);
    return err;
}

/* ---- frames -------------------------------------------------------------------------------------------------------
 */

static void add_frame(struct pkt_rx *const rx, const unsigned bytes, const bool bad)
{
    const unsigned place = (rx->first + rx->frames++) % PKT_RX_FRAMES;
    rx->size[place] = (uint16_t)bytes;
    rx->bad[place] = bad;
}

/* Bytes in the next word of the oldest frame, which is taken from it. */
static unsigned next_word(struct pkt_rx *const rx)
{
    uint16_t *const size = &rx->size[rx->first];
    const unsigned len = rx->frames > 0 ? smaller(*size, WORD_BYTES) : 0;
    *size = (uint16_t)(*size - len);
    if (len > 0 && *size == 0) {
        rx->first = (rx->first + 1u) % PKT_RX_FRAMES;
        rx->frames--;
    }
    return len;
}

static unsigned frame_words(const struct pkt_rx *const rx)
{
    unsigned words = 0;
    for (unsigned i = 0; i < rx->frames; i++)
        words += words_of(rx->size[(rx->first + i) % PKT_RX_FRAMES]);
    return words;
}

static unsigned frame_bytes(const struct pkt_rx *const rx)
{
    unsigned bytes = 0;
    for (unsigned i = 0; i < rx->frames; i++)
        bytes += rx->size[(rx->first + i) % PKT_RX_FRAMES];
    return bytes;
}

/* What the port has of the oldest frame is all that it gets. */
static void end_frame(struct pkt_rx *const rx, struct hm2_serial *const port, const bool good)
{
    if (port->settings.frames && rx->kept > 0) {
        frames_put(&port->rx_frames, good ? rx->kept : rx->kept | FRAME_SPOILT);
        port->counts.rx_bytes -= good ? 0 : rx->kept;
        port->counts.rx_uncertain += good ? 0 : rx->kept;
    }
    rx->kept = 0;
    rx->spoilt = false;
}

/* The next word of the oldest frame, for the port or only counted. */
static void hand_over(struct pkt_rx *const rx, struct hm2_serial *const port, const uint32_t word, const bool good)
{
    uint8_t bytes[WORD_BYTES];
    const unsigned frames = rx->frames;
    const bool keep = good && !rx->skips, bad = rx->bad[rx->first];
    const unsigned len = next_word(rx), put = keep ? len : 0;
    hm2_put_le32(bytes, word);
    (void)ring_put(&port->rx, bytes, put);
    port->counts.rx_bytes += put;
    port->counts.rx_uncertain += len - put;
    rx->kept += put;
    rx->spoilt = rx->spoilt || put < len;
    if (rx->frames == frames)
        return;
    rx->skips = false;
    end_frame(rx, port, !bad && !rx->spoilt);
}

static void deliver(struct pkt_rx *const rx, struct hm2_serial *const port, const uint32_t word)
{
    hand_over(rx, port, word, true);
}

/* ---- after a loss -------------------------------------------------------------------------------------------------
 */

/* What was asked for will not come any more. */
static void lose(struct pkt_rx *const rx)
{
    struct pkt_hunt *const hunt = &rx->hunt;
    if (!hunt->on) {
        hunt->on = true;
        hunt->losses = hunt->lost_sizes = hunt->lost_words = hunt->taken_words = hunt->held = 0;
        hunt->surplus = 0;
        hunt->vain = 0;
        hunt->known_words = hunt->lost_at = frame_words(rx);
        hunt->known_bytes = frame_bytes(rx);
    }
    hunt->losses++;
    hunt->lost_sizes += rx->asked_counts;
    hunt->lost_words += rx->asked_words;
    hunt->surplus -= (int)rx->asked_words;
    rx->asked_words = rx->asked_counts = 0;
    rx->unanswered = false;
}

static int taken_beyond(const struct pkt_hunt *const hunt)
{
    return (int)hunt->taken_words - (int)hunt->known_words;
}

/* The line rests: a word that is there belongs to a frame that has ended. */
static void note_surplus(struct pkt_hunt *const hunt)
{
    const int least = taken_beyond(hunt) + 1;
    if (hunt->surplus >= least)
        return;
    hunt->surplus = least;
    hunt->vain = 0;
}

/* One request for words alone: it has taken all of them or none, so one word too many tells. */
static bool did_not_arrive(const struct pkt_hunt *const hunt)
{
    return hunt->losses == 1 && hunt->lost_sizes == 0 && hunt->surplus > -(int)hunt->lost_words;
}

/* Of the buffer, at most: words that are held were taken from it, whichever frames they belong to. */
static unsigned hunt_words(const struct pkt_rx *const rx, const int64_t now_ns)
{
    const unsigned known =
        rx->hunt.known_words > rx->hunt.taken_words ? rx->hunt.known_words - rx->hunt.taken_words : 0;
    return known + pkt_crowd_words(&rx->crowd, now_ns);
}

static void hold_word(struct pkt_hunt *const hunt, const uint32_t word)
{
    if (hunt->held < PKT_RX_HOLD_WORDS)
        hunt->hold[hunt->held++] = word;
    hunt->taken_words++;
}

/* A line that never rests for long enough, or more than can be held. */
static bool is_hopeless(const struct pkt_rx *const rx)
{
    return rx->hunt.vain > VAIN_MAX || rx->hunt.held == PKT_RX_HOLD_WORDS || rx->frames + COUNTS > PKT_RX_FRAMES;
}

static void release(struct pkt_rx *const rx, struct hm2_serial *const port, const unsigned from, const unsigned to)
{
    for (unsigned i = from; i < to; i++)
        deliver(rx, port, rx->hunt.hold[i]);
}

/* What is known to have been received does not reach the port. */
static void give_up(struct pkt_rx *const rx, struct hm2_serial *const port)
{
    const struct pkt_hunt *const hunt = &rx->hunt;
    const unsigned most = hunt->taken_words + hunt->lost_words;
    port->counts.rx_uncertain += hunt->known_bytes;
    if (hunt->lost_sizes > 0 && most > hunt->known_words)
        port->counts.rx_uncertain += WORD_BYTES * (most - hunt->known_words);
    rx->frames = 0;
    end_frame(rx, port, false);
}

/* Everything that the card had is here: what is missing? The last word of a frame whose size was lost holds one byte to
 * four: it counts as four. */
static void resolve(struct pkt_rx *const rx, struct hm2_serial *const port)
{
    struct pkt_hunt *const hunt = &rx->hunt;
    const int beyond = taken_beyond(hunt);
    const unsigned extra = beyond > 0 ? (unsigned)beyond : 0, missing = beyond < 0 ? (unsigned)-beyond : 0;
    hunt->on = false;
    if (hunt->losses > 1 || (missing > 0 && missing != hunt->lost_words) || hunt->lost_at + extra > hunt->held ||
        (extra > 0 && hunt->lost_sizes == 0)) {
        give_up(rx, port);
        return;
    }
    for (unsigned i = 0; i < missing; i++)
        hand_over(rx, port, 0, false);
    if (extra > 0) {
        port->counts.rx_uncertain += WORD_BYTES * extra;
        release(rx, port, 0, hunt->lost_at);
    }
    release(rx, port, extra > 0 ? hunt->lost_at + extra : 0, hunt->held);
}

static void learn(struct pkt_rx *const rx, struct hm2_serial *const port, const bool data)
{
    struct pkt_hunt *const hunt = &rx->hunt;
    if (!data) {
        resolve(rx, port);
        return;
    }
    note_surplus(hunt);
    if (!did_not_arrive(hunt))
        return;
    hunt->on = false;
    release(rx, port, 0, hunt->held);
}

/* ---- a buffer that may have run over ------------------------------------------------------------------------------
 */

unsigned pkt_rx_most_words(const struct pkt_rx *const rx, const int64_t now_ns)
{
    return frame_words(rx) + pkt_crowd_words(&rx->crowd, now_ns);
}

static void begin_doubt(struct pkt_rx *const rx, const int64_t now_ns)
{
    rx->doubt = (struct pkt_doubt){.on = true,
                                   .awaited = rx->asked_counts + MODE_FRAMES(rx->mode) + 1u,
                                   .most_bytes = WORD_BYTES * pkt_crowd_words(&rx->crowd, now_ns),
                                   .known_bytes = frame_bytes(rx)};
    rx->hunt.held = 0;
}

/* A frame that was longer than its size can tell shows as a shorter one: so many bytes may be missing. */
static unsigned untold_bytes(const struct pkt_rx *const rx)
{
    const unsigned told = frame_bytes(rx) - rx->doubt.known_bytes;
    return told > 0 && rx->doubt.most_bytes > told ? (rx->doubt.most_bytes - told) & ~(PKT_FRAME_MODULUS - 1u) : 0;
}

static enum pkt_rx_health decide(struct pkt_rx *const rx, struct hm2_serial *const port)
{
    if (rx->doubt.awaited > 0 && !rx->still)
        return PKT_RX_GOOD;
    if (frame_words(rx) > PKT_BUFFER_WORDS)
        return PKT_RX_OVERRUN;
    port->counts.rx_uncertain += untold_bytes(rx);
    rx->doubt.on = false;
    release(rx, port, 0, rx->hunt.held);
    return PKT_RX_GOOD;
}

void pkt_rx_forget(struct pkt_rx *const rx, struct hm2_serial *const port)
{
    if (rx->hunt.on)
        give_up(rx, port);
    else
        port->counts.rx_uncertain += frame_bytes(rx);
    end_frame(rx, port, false);
    rx->hunt.on = rx->unanswered = rx->skips = rx->doubt.on = false;
    rx->frames = rx->asked_words = rx->asked_counts = 0;
}

void pkt_rx_clear(struct pkt_rx *const rx, struct hm2_serial *const port)
{
    const unsigned most = WORD_BYTES * pkt_crowd_words(&rx->crowd, port->now_ns);
    pkt_rx_forget(rx, port);
    port->counts.rx_uncertain += most > CLEAR_BYTES ? most : CLEAR_BYTES;
    rx->clearing = rx->skips = true;
}

/* ---- reply --------------------------------------------------------------------------------------------------------
 */

static void take_words(struct pkt_rx *const rx, struct hm2_serial *const port)
{
    for (unsigned n = 0; n < rx->asked_words; n++) {
        const struct queue_place at = queue_place(&rx->data, rx->asked_words, n);
        const uint32_t word = hm2_window_get(at.window, at.word);
        if (rx->hunt.on || rx->doubt.on)
            hold_word(&rx->hunt, word);
        else
            deliver(rx, port, word);
    }
    rx->asked_words = 0;
}

static void take_sizes(struct pkt_rx *const rx, struct hm2_serial *const port)
{
    for (unsigned n = 0; n < rx->asked_counts; n++) {
        const struct queue_place at = queue_place(&rx->counts, rx->asked_counts, n);
        const uint32_t count = hm2_window_get(at.window, at.word);
        if (count & SIZE_ERRORS)
            port->counts.rx_errors++;
        if ((count & SIZE_MASK) == 0)
            continue;
        add_frame(rx, count & SIZE_MASK, (count & SIZE_ERRORS) != 0);
        rx->hunt.known_words += words_of(count & SIZE_MASK);
        rx->hunt.known_bytes += count & SIZE_MASK;
    }
    rx->doubt.awaited -= smaller(rx->doubt.awaited, rx->asked_counts);
    rx->asked_counts = 0;
}

/* At its very end a frame shows neither that it is under way nor its size, for a clock: so the mode is read twice. */
static void take_state(struct pkt_rx *const rx)
{
    const uint32_t before = hm2_window_get(&rx->state, 0);
    rx->mode = hm2_window_get(&rx->state, 1);
    rx->still = !((before | rx->mode) & MODE_ACTIVE) && MODE_FRAMES(before) == 0 && MODE_FRAMES(rx->mode) == 0;
}

static void look_at_crowd(struct pkt_rx *const rx, const struct hm2_serial *const port, const unsigned sizes)
{
    const struct pkt_sight sight = {.sent_ns = port->sent_ns,
                                    .received_ns = port->now_ns,
                                    .taken = sizes,
                                    .frames = MODE_FRAMES(rx->mode),
                                    .still = rx->still,
                                    .cleared = rx->clearing};
    pkt_crowd_see(&rx->crowd, &sight);
}

static void take_all(struct pkt_rx *const rx, struct hm2_serial *const port)
{
    const unsigned sizes = rx->asked_counts, most = WORD_BYTES * pkt_crowd_words(&rx->crowd, port->now_ns);
    take_state(rx);
    if (rx->doubt.on && most > rx->doubt.most_bytes)
        rx->doubt.most_bytes = most;
    if (!rx->hunt.on && !rx->doubt.on && pkt_rx_most_words(rx, port->now_ns) > PKT_BUFFER_WORDS)
        begin_doubt(rx, port->now_ns);
    take_words(rx, port);
    take_sizes(rx, port);
    look_at_crowd(rx, port, sizes);
}

/* What was asked for without an answer is still in the card for certain, or may have been taken from it. */
static void judge_unanswered(struct pkt_rx *const rx, const struct serial_passage *const passage)
{
    if (!passage->unheard) {
        lose(rx);
        return;
    }
    rx->unheard_request = rx->request;
    rx->asked_words = rx->asked_counts = 0;
    rx->unanswered = false;
}

/* Words and sizes do not belong together any longer when a request has taken some unseen, nor may there have been any
 * to take, which spoils the buffer. When it is not certain that it was a request which came twice, what it may have
 * taken is only counted. */
HM2_RARE static bool is_torn(const struct pkt_rx *const rx, struct hm2_serial *const port)
{
    if (!port->passage.stray)
        port->counts.rx_uncertain += WORD_BYTES * rx->popped_words * port->passage.twice;
    return port->passage.stray;
}

static void note_popped(struct pkt_rx *const rx)
{
    rx->popped_request = rx->request;
    rx->popped_words = rx->asked_words;
    rx->popped_counts = rx->asked_counts;
}

enum pkt_rx_health pkt_rx_take(struct pkt_rx *const rx, struct hm2_serial *const port)
{
    const bool torn = port->passage.told && is_torn(rx, port);
    note_popped(rx);
    if (!rx->clearing && (torn || (rx->unanswered && rx->doubt.on && !port->passage.unheard)))
        return PKT_RX_LOST;
    if (rx->unanswered)
        judge_unanswered(rx, &port->passage);
    if (rx->clearing) {
        take_state(rx);
        look_at_crowd(rx, port, 0);
        return PKT_RX_GOOD;
    }
    rx->hunt.vain++;
    const bool crowded = rx->hunt.on && hunt_words(rx, port->now_ns) > PKT_BUFFER_WORDS;
    take_all(rx, port);
    const bool data = (rx->mode & MODE_DATA) != 0;
    if (rx->hunt.on && rx->still)
        learn(rx, port, data);
    const bool left_over = !rx->hunt.on && rx->still && rx->frames == 0 && data;
    if (left_over || (rx->mode & MODE_ERROR) != 0 || pkt_crowd_is_endless(&rx->crowd))
        return PKT_RX_OVERRUN;
    if (rx->doubt.on)
        return decide(rx, port);
    return rx->hunt.on && (crowded || is_hopeless(rx)) ? PKT_RX_LOST : PKT_RX_GOOD;
}

bool pkt_rx_late(struct pkt_rx *const rx, struct hm2_serial *const port, const uint64_t request)
{
    if (rx->clearing)
        return true;
    if (rx->request != request || (rx->asked_words == 0 && rx->asked_counts == 0))
        return request != rx->unheard_request &&
               (request != rx->popped_request || (rx->popped_words == 0 && rx->popped_counts == 0));
    port->sent_ns = rx->request_ns;
    take_all(rx, port);
    rx->unanswered = false;
    return true;
}

/* ---- request ------------------------------------------------------------------------------------------------------
 */

void pkt_rx_miss(struct pkt_rx *const rx)
{
    rx->unanswered = rx->asked_words > 0 || rx->asked_counts > 0;
}

/* Words that are there for certain. A pop beyond them may spoil the card's buffer. */
static unsigned words_there(const struct pkt_rx *const rx)
{
    if (rx->doubt.on)
        return 0;
    if (!rx->hunt.on)
        return frame_words(rx);
    const int there = rx->hunt.surplus - taken_beyond(&rx->hunt);
    return there > 0 ? (unsigned)there : rx->mode & MODE_DATA ? 1u : 0u;
}

/* What is held goes into the ring at once some time. */
static unsigned room_words(const struct pkt_rx *const rx, const struct hm2_serial *const port)
{
    const unsigned bytes = (RING_BYTES - ring_used(&port->rx)) / WORD_BYTES;
    const unsigned places = FRAME_PLACES - 1u - frames_used(&port->rx_frames); /* one is for what is cut off */
    const unsigned room = smaller(bytes, places), held = rx->hunt.on ? rx->hunt.held : 0;
    return room > held ? room - held : 0;
}

void pkt_rx_ask(struct pkt_rx *const rx, const struct hm2_serial *const port, const bool ready)
{
    unsigned words = 0, counts = 0;
    if (ready && !rx->unanswered) {
        const unsigned places = PKT_RX_FRAMES - rx->frames;
        words = smaller(smaller(words_there(rx), room_words(rx, port)), WORDS);
        counts = smaller(smaller(MODE_FRAMES(rx->mode), COUNTS), places);
        if (words > 0 && counts > 0 && (words == WORDS || rx->words_next))
            counts = 0;
        else if (counts > 0)
            words = 0;
        rx->words_next = counts > 0;
        rx->request = hm2_plan_requests(port->plan) + 1u;
        rx->request_ns = port->now_ns;
        rx->asked_words = words;
        rx->asked_counts = counts;
    }
    queue_aim(&rx->data, words);
    queue_aim(&rx->counts, counts);
}
