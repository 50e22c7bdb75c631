/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* From frame to frame: reception, the walk over a packet's commands, errors and counters, transmission. */
#include "lbp16_engine.h"

#include <stdlib.h>
#include <string.h>

#include <hm2/bytes.h>

#include "card_state.h"
#include "prng.h"
#include "profiles.h"

#define NS_PER_S           1000000000
#define CLOCK_NS           10
#define LBP_START_NS       500000000  /* seed 000, "LBPReset": unresponsive for as much as half a second */
#define CONFIGURE_START_NS 1000000000 /* FPGA configuration, then the same */
#define FRAME_LIMIT_BYTES  0x600u     /* longer frames are neither taken nor sent */
#define SMALLEST_CHIP      0x11u      /* flash tool reference 2.2: room for a boot sector and two areas */
#define LARGEST_CHIP       0x16u      /* one that no table of flash tools has */
#define FLASH_BYTES_OF(id) (1u << ((id) + 1u))
#define JUMPERS_FALLBACK   3u /* Efinix (flash tool reference 2.4) */
#define EFINIX_USER_IMAGE  1u
#define FACTORY_BYTES      1024u /* of the fallback image that a card is made with: small, it is made every time */
#define RX_TRAILER_BYTES   6u    /* two bytes of padding in front, four of checksum behind */
#define ETHERTYPE_IP       0x0800u
#define ETHERTYPE_ARP      0x0806u
#define PROTOCOL_ICMP      0x01u
#define PROTOCOL_UDP       0x11u
#define ARP_REPLY_BYTES    64u
#define IP_HEADER_BYTES    20u
#define UDP_HEADER_BYTES   8u

/* Clocks of the stages, from the recorded times: 11.7 us for one word is 2.9 us to notice and take the frame and
 * 0.2 us per four bytes of it, 0.8 us for headers, 1.9 us to hand over the reply and 0.2 us per four bytes of it. */
enum {
    CLOCKS_NOTICE = 60,
    CLOCKS_RECEIVE = 230,
    CLOCKS_COPY = 20, /* four bytes, either way */
    CLOCKS_COMMAND = 36,
    CLOCKS_HEADERS = 60,
    CLOCKS_SEND = 188,
    CLOCKS_ARP = 340,
    CLOCKS_ICMP = 25
};

/* Words of a frame (its first word is 0). */
enum {
    W_DESTINATION = 0,
    W_SOURCE = 3,
    W_ETHERTYPE = 6,
    W_IP = 7,
    W_IP_LENGTH = 8,
    W_IP_FLAGS = 10,
    W_IP_PROTOCOL = 11,
    W_IP_SOURCE = 13,
    W_IP_DESTINATION = 15,
    W_UDP_SOURCE = 17,
    W_UDP_DESTINATION = 18,
    W_UDP_LENGTH = 19,
    W_ICMP = 17,
    W_ARP = 7,
    W_ARP_SENDER = 11,
    W_ARP_TARGET_IP = 19
};

#define CONTROL(address) control[(address) / 2]

/* ---- time ---------------------------------------------------------------------------------------------------------
 */

void sim_lbp16_spend(struct sim_lbp16 *const e, const unsigned clocks)
{
    if (!e->instant)
        e->now_ns += (int64_t)clocks * CLOCK_NS;
}

uint16_t sim_lbp16_stamp(const struct sim_lbp16 *const e)
{
    return (uint16_t)(((uint64_t)e->now_ns + e->stamp_zero) / 1000u);
}

int64_t sim_lbp16_clk(const struct sim_lbp16 *const e, const int64_t ns)
{
    const int64_t hz = sim_clock_low_hz(e->card);
    const int64_t gone = ns - e->epoch_ns;
    return e->epoch_clk + gone / NS_PER_S * hz + gone % NS_PER_S * hz / NS_PER_S;
}

/* ---- registers and memory -----------------------------------------------------------------------------------------
 */

uint16_t sim_lbp16_get(struct sim_lbp16 *const e)
{
    return e->memory[e->y++ % SIM_MEMORY_WORDS];
}

/* Behind the end of its memory the real processor destroys its own variables; here such words are lost, and the
 * reply is too long to be sent anyway. */
void sim_lbp16_put(struct sim_lbp16 *const e, const uint16_t word)
{
    if (e->x < SIM_MEMORY_WORDS)
        e->memory[e->x] = word;
    e->x++;
}

void sim_lbp16_flag(struct sim_lbp16 *const e, const uint16_t error_bit)
{
    e->CONTROL(LBP16_CONTROL_ERROR) |= error_bit;
}

static void count_error(struct sim_lbp16 *const e, const uint16_t error_bit, const unsigned counter)
{
    sim_lbp16_flag(e, error_bit);
    if (e->control[counter / 2] < UINT16_MAX) /* error counters stop (lbp16 traces, "Further runs") */
        e->control[counter / 2]++;
}

static uint16_t swap(const uint16_t word)
{
    return (uint16_t)(word << 8 | word >> 8);
}

/* Ethernet's byte order, for words of memory, which are little endian. */
static uint16_t rx_word(const struct sim_lbp16 *const e, const unsigned word)
{
    return swap(e->memory[SIM_RX_FRAME + word]);
}

/* ---- the packet ---------------------------------------------------------------------------------------------------
 */

static enum sim_verdict one_command(struct sim_lbp16 *const e)
{
    struct lbp16_command command;
    sim_lbp16_spend(e, CLOCKS_COMMAND);
    if (lbp16_decode(sim_lbp16_get(e), &command))
        return SIM_PARSE_ERROR;
    return sim_lbp16_command(e, &command);
}

/* Returns the bytes of the reply. The first command is looked at before the length: an empty packet is an error. */
static size_t run_packet(struct sim_lbp16 *const e, const unsigned words)
{
    const unsigned payload = SIM_RX_FRAME + SIM_HEADER_WORDS;
    const unsigned reply = SIM_TX_FRAME + SIM_HEADER_WORDS;
    e->y = payload;
    e->x = reply;
    enum sim_verdict verdict;
    do {
        verdict = one_command(e);
    } while (verdict == SIM_DONE && !e->stopped && e->y < payload + words);
    if (e->stopped)
        return 0;
    e->CONTROL(LBP16_CONTROL_WRITE_ENABLE) = 0;
    switch (verdict) {
    case SIM_DONE:
        e->CONTROL(LBP16_CONTROL_RX_UDP)++;
        return (size_t)(e->x - reply) * 2;
    case SIM_PARSE_ERROR:
        count_error(e, LBP16_ERROR_PARSE, LBP16_CONTROL_PARSE_ERRORS);
        break;
    case SIM_MEM_ERROR:
        count_error(e, LBP16_ERROR_MEM, LBP16_CONTROL_MEM_ERRORS);
        break;
    case SIM_WRITE_ERROR:
        count_error(e, LBP16_ERROR_WRITE, LBP16_CONTROL_WRITE_ERRORS);
        break;
    }
    return 0;
}

/* ---- transmission and reception -----------------------------------------------------------------------------------
 */

/* Hand a frame to the Ethernet chip; returns its length, 0 when it is too long. */
static size_t send_frame(struct sim_lbp16 *const e, const size_t bytes)
{
    const size_t rounded = (bytes + 3) / 4 * 4;
    if (rounded >= FRAME_LIMIT_BYTES) {
        count_error(e, LBP16_ERROR_TX, LBP16_CONTROL_TX_BAD);
        return 0;
    }
    sim_lbp16_spend(e, CLOCKS_SEND + (unsigned)(rounded / 4) * CLOCKS_COPY);
    e->CONTROL(LBP16_CONTROL_TX_PACKETS)++;
    return bytes;
}

/* Make ready for something that arrives at now_ns; false when nobody listens. */
static bool listening(struct sim_lbp16 *const e, const int64_t now_ns)
{
    if (e->stopped || now_ns < e->ready_ns)
        return false;
    if (!e->has_epoch)
        sim_card_set_time(e->card, now_ns);
    if (e->now_ns < now_ns)
        e->now_ns = now_ns;
    return true;
}

/* The frame's bytes are in memory: account for taking them. False when the frame is too long. */
static bool receive(struct sim_lbp16 *const e, const size_t bytes)
{
    sim_lbp16_spend(e, CLOCKS_NOTICE);
    e->info[LBP16_INFO_RECV_START / 2] = sim_lbp16_stamp(e);
    const size_t rounded = (bytes + RX_TRAILER_BYTES + 3) / 4 * 4;
    if (rounded >= FRAME_LIMIT_BYTES) {
        sim_lbp16_flag(e, LBP16_ERROR_RX);
        e->CONTROL(LBP16_CONTROL_RX_BAD)++;
        return false;
    }
    sim_lbp16_spend(e, CLOCKS_RECEIVE + (unsigned)(rounded / 4) * CLOCKS_COPY);
    e->CONTROL(LBP16_CONTROL_RX_PACKETS)++;
    e->asked_ns = 0;
    return true;
}

/* Copy to memory from a frame's word on; four zero bytes stand for the checksum behind it. */
static void store(struct sim_lbp16 *const e, const unsigned word, const uint8_t *const bytes, const size_t len,
                  const size_t padded_len)
{
    const size_t words = (padded_len + 4 + 1) / 2;
    for (size_t i = 0; i < words; i++) {
        const unsigned low = 2 * i < len ? bytes[2 * i] : 0;
        const unsigned high = 2 * i + 1 < len ? bytes[2 * i + 1] : 0;
        e->memory[SIM_RX_FRAME + word + i] = (uint16_t)(low | high << 8);
    }
}

/* Everything between the two stamps of reception and of transmission. Returns the reply's payload bytes. */
static size_t serve_udp(struct sim_lbp16 *const e, const unsigned words)
{
    e->info[LBP16_INFO_RECV_DONE / 2] = sim_lbp16_stamp(e);
    const size_t bytes = run_packet(e, words);
    if (bytes == 0)
        return 0;
    e->CONTROL(LBP16_CONTROL_TX_UDP)++;
    sim_lbp16_spend(e, CLOCKS_HEADERS);
    e->info[LBP16_INFO_SEND_START / 2] = sim_lbp16_stamp(e);
    const size_t sent = send_frame(e, bytes + SIM_HEADER_WORDS * 2);
    e->info[LBP16_INFO_SEND_DONE / 2] = sim_lbp16_stamp(e);
    return sent > 0 ? bytes : 0;
}

static void restart(struct sim_lbp16 *e, int64_t deaf_ns);

/* What a packet asked for happens after its reply has gone. */
static void after_packet(struct sim_lbp16 *const e)
{
    if (e->flash.dead)
        sim_card_power_off(e->card);
    else if (e->stopped)
        e->running = SIM_BOOT_NOTHING;
    else if (e->icap.reload)
        sim_card_reload(e->card);
    else if (e->CONTROL(LBP16_CONTROL_RESET) != 0)
        restart(e, LBP_START_NS);
}

static void copy_out(const struct sim_lbp16 *const e, const unsigned word, uint8_t *const out, const size_t len)
{
    for (size_t i = 0; i < len; i++)
        out[i] = (uint8_t)(e->memory[word + i / 2] >> (8 * (i % 2)));
}

size_t sim_card_packet(struct sim_card *const card, const int64_t now_ns, const uint8_t *const request,
                       const size_t request_len, uint8_t *const reply, const size_t capacity, int64_t *const reply_ns)
{
    struct sim_lbp16 *const e = card->lbp16;
    if (!listening(e, now_ns))
        return 0;
    const size_t headers = SIM_HEADER_WORDS * 2;
    const size_t frame = request_len + headers > SIM_MIN_FRAME_BYTES ? request_len + headers : SIM_MIN_FRAME_BYTES;
    if (!receive(e, frame))
        return 0;
    store(e, SIM_HEADER_WORDS, request, request_len, frame - headers);
    const size_t bytes = serve_udp(e, (unsigned)(request_len / 2));
    if (reply_ns)
        *reply_ns = e->now_ns;
    const size_t copied = bytes < capacity ? bytes : capacity;
    copy_out(e, SIM_TX_FRAME + SIM_HEADER_WORDS, reply, copied);
    after_packet(e);
    return copied;
}

/* ---- whole frames -------------------------------------------------------------------------------------------------
 */

static bool my_address(const struct sim_lbp16 *const e, const unsigned word)
{
    return rx_word(e, word) == (e->ip[0] << 8 | e->ip[1]) && rx_word(e, word + 1) == (e->ip[2] << 8 | e->ip[3]);
}

static void set_bytes(struct sim_lbp16 *const e, const unsigned word, const uint8_t *const bytes, const unsigned words)
{
    for (unsigned i = 0; i < words; i++)
        e->memory[word + i] = hm2_get_le16(bytes + 2 * i);
}

static void set_word(struct sim_lbp16 *const e, const unsigned word, const unsigned value)
{
    e->memory[word] = swap((uint16_t)value);
}

/* Ethernet and, for IP, network headers back to where the request came from; `frame` is where the reply is built. */
static void answer_header(struct sim_lbp16 *const e, const unsigned frame, const unsigned ethertype)
{
    memmove(&e->memory[frame + W_DESTINATION], &e->memory[SIM_RX_FRAME + W_SOURCE], 6);
    set_bytes(e, frame + W_SOURCE, e->mac, 3);
    set_word(e, frame + W_ETHERTYPE, ethertype);
}

static void answer_ip(struct sim_lbp16 *const e, const unsigned frame, const size_t ip_bytes, const unsigned protocol)
{
    uint16_t asker[2];
    memcpy(asker, &e->memory[SIM_RX_FRAME + W_IP_SOURCE], sizeof asker);
    answer_header(e, frame, ETHERTYPE_IP);
    set_word(e, frame + W_IP, 0x4500);
    set_word(e, frame + W_IP_LENGTH, (unsigned)ip_bytes);
    set_word(e, frame + W_IP_LENGTH + 1, 0);               /* identification */
    set_word(e, frame + W_IP_FLAGS, 0x4000);               /* do not fragment */
    set_word(e, frame + W_IP_PROTOCOL, 0x4000 | protocol); /* 64 hops */
    set_word(e, frame + W_IP_PROTOCOL + 1, 0);             /* the chip's checksum */
    set_bytes(e, frame + W_IP_SOURCE, e->ip, 2);
    memcpy(&e->memory[frame + W_IP_DESTINATION], asker, sizeof asker);
}

static size_t serve_arp(struct sim_lbp16 *const e)
{
    static const uint16_t ethernet_ip_reply[] = {1, ETHERTYPE_IP, 0x0604, 2};
    if (!my_address(e, W_ARP_TARGET_IP))
        return 0;
    memset(&e->memory[SIM_TX_FRAME], 0, ARP_REPLY_BYTES);
    answer_header(e, SIM_TX_FRAME, ETHERTYPE_ARP);
    for (unsigned i = 0; i < 4; i++)
        set_word(e, SIM_TX_FRAME + W_ARP + i, ethernet_ip_reply[i]);
    set_bytes(e, SIM_TX_FRAME + W_ARP_SENDER, e->mac, 3);
    set_bytes(e, SIM_TX_FRAME + W_ARP_SENDER + 3, e->ip, 2);
    memcpy(&e->memory[SIM_TX_FRAME + W_ARP_SENDER + 5], &e->memory[SIM_RX_FRAME + W_ARP_SENDER], 10);
    sim_lbp16_spend(e, CLOCKS_ARP);
    return send_frame(e, ARP_REPLY_BYTES);
}

/* The echo is made in place of the request. */
static size_t serve_icmp(struct sim_lbp16 *const e, const size_t frame_len)
{
    const size_t ip_bytes = frame_len - W_IP * 2u;
    answer_ip(e, SIM_RX_FRAME, ip_bytes, PROTOCOL_ICMP);
    set_word(e, SIM_RX_FRAME + W_ICMP, 0);
    set_word(e, SIM_RX_FRAME + W_ICMP + 1, 0);
    sim_lbp16_spend(e, CLOCKS_ICMP);
    return send_frame(e, frame_len);
}

static size_t serve_udp_frame(struct sim_lbp16 *const e)
{
    const unsigned udp_bytes = rx_word(e, W_UDP_LENGTH);
    if (rx_word(e, W_UDP_DESTINATION) != LBP16_UDP_PORT)
        return 0;
    const uint16_t asker = rx_word(e, W_UDP_SOURCE);
    /* A length that is too small, or negative to the processor, ends the packet behind its first command. */
    const unsigned payload_bytes = (udp_bytes - UDP_HEADER_BYTES) & 0xFFFFu;
    const size_t bytes = serve_udp(e, payload_bytes < 0x8000u ? payload_bytes / 2 : 0);
    if (bytes == 0)
        return 0;
    answer_ip(e, SIM_TX_FRAME, bytes + IP_HEADER_BYTES + UDP_HEADER_BYTES, PROTOCOL_UDP);
    set_word(e, SIM_TX_FRAME + W_UDP_SOURCE, LBP16_UDP_PORT);
    set_word(e, SIM_TX_FRAME + W_UDP_DESTINATION, asker);
    set_word(e, SIM_TX_FRAME + W_UDP_LENGTH, (unsigned)bytes + UDP_HEADER_BYTES);
    set_word(e, SIM_TX_FRAME + W_UDP_LENGTH + 1, 0);
    return bytes + SIM_HEADER_WORDS * 2;
}

/* Looks at nothing but ethertype, addresses, protocol and port, as the firmware does. */
static size_t serve_frame(struct sim_lbp16 *const e, const size_t frame_len, unsigned *const reply_frame)
{
    *reply_frame = SIM_TX_FRAME;
    if (rx_word(e, W_ETHERTYPE) == ETHERTYPE_ARP)
        return serve_arp(e);
    if (rx_word(e, W_ETHERTYPE) != ETHERTYPE_IP || !my_address(e, W_IP_DESTINATION))
        return 0;
    const unsigned protocol = rx_word(e, W_IP_PROTOCOL) & 0xFFu;
    if (protocol == PROTOCOL_ICMP) {
        *reply_frame = SIM_RX_FRAME;
        return serve_icmp(e, frame_len);
    }
    return protocol == PROTOCOL_UDP ? serve_udp_frame(e) : 0;
}

size_t sim_card_frame(struct sim_card *const card, const int64_t now_ns, const uint8_t *const frame,
                      const size_t frame_len, uint8_t *const reply, const size_t capacity, int64_t *const reply_ns)
{
    struct sim_lbp16 *const e = card->lbp16;
    unsigned reply_frame;
    if (frame_len < W_IP * 2u || !listening(e, now_ns) || !receive(e, frame_len))
        return 0;
    store(e, 0, frame, frame_len, frame_len);
    const size_t bytes = serve_frame(e, frame_len, &reply_frame);
    if (reply_ns)
        *reply_ns = e->now_ns;
    const size_t copied = bytes < capacity ? bytes : capacity;
    copy_out(e, reply_frame, reply, copied);
    after_packet(e);
    return copied;
}

/* ---- start --------------------------------------------------------------------------------------------------------
 */

static uint16_t pair(const uint8_t *const p)
{
    return (uint16_t)(p[0] << 8 | p[1]);
}

/* KSZ8851 registers as the firmware leaves them after its start (data sheet addresses). */
static void start_chip(struct sim_lbp16 *const e)
{
    static const struct {
        uint16_t address, value;
    } set[] = {{0x70, 0x01EF}, {0x74, 0x7CE1}, {0x76, 0x0016}, {0x82, 0x0230}, {0x84, 0x4000},
               {0x86, 0x4000}, {0x90, 0x2800}, {0x9C, 0x0001}, {0xC0, 0x8872}, {0xF6, 0x20FF}};
    memset(e->chip, 0, sizeof e->chip);
    for (size_t i = 0; i < sizeof set / sizeof set[0]; i++)
        e->chip[set[i].address / 2] = set[i].value;
    for (unsigned i = 0; i < 3; i++)
        e->chip[0x10 / 2 + i] = pair(e->mac + 4 - 2 * i);
}

/* The processor begins again: its memory is cleared, EEPROM settings are read. The hardware's time stamp runs on. */
static void restart(struct sim_lbp16 *const e, const int64_t deaf_ns)
{
    memset(e->memory, 0, sizeof e->memory);
    memset(e->pointer, 0, sizeof e->pointer);
    memset(e->control, 0, sizeof e->control);
    memset(e->timer, 0, sizeof e->timer);
    memset(e->info, 0, sizeof e->info);
    e->info_pointer = 0;
    e->icap = (struct sim_icap){0};
    e->info[LBP16_INFO_JUMPERS / 2] = (uint16_t)e->jumpers;
    memcpy(e->info, e->eeprom.words + LBP16_EEPROM_NAME / 2, LBP16_INFO_NAME_BYTES);
    e->info[LBP16_INFO_LBP_VERSION / 2] = e->profile->lbp_version;
    e->info[LBP16_INFO_FIRMWARE / 2] = e->profile->firmware_version;
    e->CONTROL(LBP16_CONTROL_LED_MODE) = e->eeprom.words[LBP16_EEPROM_LED_MODE / 2];
    e->CONTROL(LBP16_CONTROL_LED_POINTER) = LBP16_CONTROL_RX_PACKETS;
    sim_lbp16_flash_start(e);
    start_chip(e);
    if (deaf_ns > 0)
        e->ready_ns = e->now_ns + deaf_ns;
}

/* Time of the outside world at the card's present clock. */
static int64_t card_ns(const struct sim_lbp16 *const e)
{
    const int64_t hz = sim_clock_low_hz(e->card);
    const int64_t gone = e->card->clk - e->epoch_clk;
    return e->epoch_ns + gone / hz * NS_PER_S + gone % hz * NS_PER_S / hz;
}

static void catch_up(struct sim_lbp16 *const e)
{
    if (e->has_epoch && card_ns(e) > e->now_ns)
        e->now_ns = card_ns(e);
}

static struct sim_boot_flash boot_flash(const struct sim_lbp16 *const e)
{
    return (struct sim_boot_flash){
        .profile = e->profile, .bytes = e->flash.bytes, .size = e->flash.size, .trust = e->trust};
}

/* The FPGA loads an image and the processor in it begins, or nothing does. */
static void configure(struct sim_lbp16 *const e, const uint32_t start, const bool want_user)
{
    const struct sim_boot_flash flash = boot_flash(e);
    e->boot_registers.start = start;
    e->running = e->profile->efinix ? sim_boot_efinix(&flash, want_user) : sim_boot_xilinx(&flash, &e->boot_registers);
    e->stopped = e->running != SIM_BOOT_USER && e->running != SIM_BOOT_FALLBACK;
}

static bool jumpers_want_user(const struct sim_lbp16 *const e)
{
    return e->jumpers != JUMPERS_FALLBACK;
}

void sim_lbp16_power_up(struct sim_lbp16 *const e)
{
    catch_up(e);
    sim_spi_flash_power_up(&e->flash);
    e->boot_registers = (struct sim_boot_registers){0};
    configure(e, 0, jumpers_want_user(e));
    restart(e, CONFIGURE_START_NS);
}

void sim_lbp16_reload(struct sim_lbp16 *const e)
{
    const struct sim_icap asked = e->icap;
    catch_up(e);
    configure(e, asked.start, asked.image == EFINIX_USER_IMAGE);
    restart(e, CONFIGURE_START_NS);
}

void sim_lbp16_power_off(struct sim_lbp16 *const e)
{
    e->stopped = true;
    e->running = SIM_BOOT_NOTHING;
}

static bool all_zero(const uint8_t *const bytes, const size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (bytes[i])
            return false;
    return true;
}

static void set_identity(struct sim_lbp16 *const e, const struct sim_card_options *const options)
{
    uint64_t random = options->seed;
    const uint64_t serial = sim_prng_next(&random);
    const uint8_t mac[6] = {0x00, 0x60, 0x1B, (uint8_t)serial, (uint8_t)(serial >> 8), (uint8_t)(serial >> 16)};
    memcpy(e->mac, all_zero(options->mac, 6) ? mac : options->mac, sizeof e->mac);
    const bool own_ip = all_zero(options->ip, 4);
    memcpy(e->ip, own_ip ? e->profile->ip : options->ip, sizeof e->ip);
    e->stamp_zero = sim_prng_next(&random) >> 16;
    sim_eeprom_factory(&e->eeprom, e->profile, options->card_name, e->mac,
                       own_ip ? e->profile->eeprom_ip : options->ip);
}

int sim_lbp16_new(struct sim_lbp16 **const engine, struct sim_card *const card,
                  const struct sim_card_options *const options, struct hm2_diag *const diag)
{
    struct sim_lbp16 *const e = calloc(1, sizeof *e);
    if (!e)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for a simulated card");
    *engine = e;
    e->card = card;
    e->profile = card->profile;
    e->ready_ns = INT64_MIN;
    const uint8_t id = options->flash_id ? options->flash_id : e->profile->flash_id;
    if (id < SMALLEST_CHIP || id > LARGEST_CHIP)
        return hm2_diag_add(diag, HM2_ERR_RANGE, "flash ID 0x%02X: the simulated chips are 0x%02X to 0x%02X", id,
                            SMALLEST_CHIP, LARGEST_CHIP);
    if (sim_spi_flash_new(&e->flash, id, FLASH_BYTES_OF(id)))
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory for the %u bytes of a simulated flash",
                            (unsigned)FLASH_BYTES_OF(id));
    e->flash.times = *sim_flash_times_of("none");
    if (!e->profile->efinix)
        sim_boot_block(e->flash.size, e->flash.bytes);
    const struct sim_flash_file factory = {
        .profile = e->profile->name, .area = SIM_AREA_FALLBACK, .bytes = FACTORY_BYTES};
    (void)sim_card_install(card, &factory);
    e->running = SIM_BOOT_FALLBACK;
    set_identity(e, options);
    restart(e, 0);
    return 0;
}

void sim_lbp16_free(struct sim_lbp16 *const engine)
{
    if (!engine)
        return;
    sim_spi_flash_release(&engine->flash);
    free(engine);
}

void sim_card_set_time(struct sim_card *const card, const int64_t now_ns)
{
    struct sim_lbp16 *const e = card->lbp16;
    e->has_epoch = true;
    e->epoch_ns = now_ns;
    e->epoch_clk = card->clk;
    e->now_ns = now_ns;
}

int64_t sim_card_clock_at(const struct sim_card *const card, const int64_t now_ns)
{
    return sim_lbp16_clk(card->lbp16, now_ns);
}

void sim_card_set_instant(struct sim_card *const card, const bool instant)
{
    card->lbp16->instant = instant;
}

int64_t sim_card_asked_ns(const struct sim_card *const card)
{
    return card->lbp16->asked_ns;
}

void sim_card_mac(const struct sim_card *const card, uint8_t mac[6])
{
    memcpy(mac, card->lbp16->mac, 6);
}

void sim_card_ip(const struct sim_card *const card, uint8_t ip[4])
{
    memcpy(ip, card->lbp16->ip, 4);
}

/* ---- flash and power, for hm2/sim_flash.h -------------------------------------------------------------------------
 */

const struct sim_flash_times *sim_flash_times_of(const char *const name)
{
    static const struct sim_flash_times rows[] = {
        {"none", 0, 0},
        {"m25p16", 640000, 600000000},
        {"m25p16-max", 5000000, 3000000000},
        {"w25q16", 400000, 150000000},
        {"w25q16-max", 3000000, 2000000000},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        if (strcmp(rows[i].name, name) == 0)
            return &rows[i];
    return NULL;
}

void sim_card_flash_times(struct sim_card *const card, const struct sim_flash_times *const times)
{
    card->lbp16->flash.times = *times;
}

int sim_card_flash_memory(struct sim_card *const card, uint8_t *const bytes, const size_t size)
{
    struct sim_spi_flash *const flash = &card->lbp16->flash;
    if (size != flash->size)
        return HM2_ERR_RANGE;
    sim_spi_flash_release(flash);
    flash->bytes = bytes;
    sim_lbp16_power_up(card->lbp16);
    card->lbp16->ready_ns = INT64_MIN;
    return 0;
}

void sim_card_flash_faults(struct sim_card *const card, const struct sim_flash_faults *const faults)
{
    struct sim_spi_flash *const flash = &card->lbp16->flash;
    flash->faults = *faults;
    if (flash->faults.bad_count > SIM_FLASH_BAD_BITS)
        flash->faults.bad_count = SIM_FLASH_BAD_BITS;
    flash->counts.operations = 0;
}

struct sim_flash_counts sim_card_flash_counts(const struct sim_card *const card)
{
    return card->lbp16->flash.counts;
}

enum sim_boot sim_card_would_boot(const struct sim_card *const card)
{
    const struct sim_lbp16 *const e = card->lbp16;
    const struct sim_boot_flash flash = boot_flash(e);
    struct sim_boot_registers registers = {0};
    return e->profile->efinix ? sim_boot_efinix(&flash, jumpers_want_user(e)) : sim_boot_xilinx(&flash, &registers);
}

enum sim_boot sim_card_running(const struct sim_card *const card)
{
    return card->lbp16->running;
}

const char *sim_boot_name(const enum sim_boot boot)
{
    static const char *const names[] = {"nothing", "user", "fallback", "other-board"};
    return names[boot];
}

void sim_card_jumpers(struct sim_card *const card, const unsigned jumpers)
{
    card->lbp16->jumpers = jumpers & JUMPERS_FALLBACK;
    if (!card->lbp16->stopped)
        card->lbp16->info[LBP16_INFO_JUMPERS / 2] = (uint16_t)card->lbp16->jumpers;
}

void sim_card_trust_images(struct sim_card *const card, const bool trust)
{
    card->lbp16->trust = trust;
}

uint8_t *sim_card_flash(struct sim_card *const card, size_t *const size)
{
    if (size)
        *size = card->lbp16->flash.size;
    return card->lbp16->flash.bytes;
}

uint16_t *sim_card_eeprom(struct sim_card *const card, size_t *const words)
{
    if (words)
        *words = SIM_EEPROM_WORDS;
    return card->lbp16->eeprom.words;
}
