/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <hm2/lbp.h>

#include <string.h>

#include <hm2/bytes.h>

#define TRIES         3u
#define REPLY_NS      INT64_C(250000000) /* writing eight bytes of an EEPROM takes most of it */
#define GAP_FACTOR    2
#define MAX_STALE     64u
#define NAME_BYTES    4u
#define NOTHING_WRONG 0u

void lbp_client_init(struct lbp_client *const client, struct link *const link, const char *const name,
                     const uint32_t baud, struct hm2_diag *const diag)
{
    *client = (struct lbp_client){.link = link,
                                  .name = name,
                                  .diag = diag,
                                  .reply_ns = REPLY_NS,
                                  .gap_ns = GAP_FACTOR * lbp_gap_ns(LBP_LONGEST_TIMEOUT, baud)};
}

/* Pass over what arrives until nothing has for silence_ns: answers that came too late, noise. */
static int quiet(const struct lbp_client *const client, const int64_t silence_ns)
{
    uint8_t stale[LBP_MESSAGE_BYTES];
    for (unsigned i = 0; i < MAX_STALE; i++) {
        const int64_t deadline_ns = silence_ns > 0 ? link_now_ns(client->link) + silence_ns : INT64_MIN;
        const int got = link_recv(client->link, stale, sizeof stale, deadline_ns);
        if (got == HM2_ERR_TIMEOUT)
            return 0;
        if (got < 0 && got != HM2_ERR_NOSPACE)
            return got;
    }
    return HM2_ERR_MALFORMED; /* the line never rests */
}

/* An answer may come in pieces. */
static int receive(const struct lbp_client *const client, uint8_t *const message, const size_t bytes)
{
    const int64_t deadline_ns = link_now_ns(client->link) + client->reply_ns;
    size_t len = 0;
    while (len < bytes) {
        const int got = link_recv(client->link, message + len, bytes - len, deadline_ns);
        if (got < 0)
            return got == HM2_ERR_NOSPACE ? HM2_ERR_MALFORMED : got;
        len += (size_t)got;
    }
    return 0;
}

static int exchange_once(const struct lbp_client *const client, const uint8_t *const message, const size_t len,
                         uint8_t *const reply, const size_t bytes)
{
    int err = quiet(client, 0);
    if (!err)
        err = link_send(client->link, message, len);
    if (!err)
        err = receive(client, reply, bytes + 1);
    return err ? err : lbp_check_reply(reply, bytes + 1, bytes);
}

static int refuse(const struct lbp_client *const client, const struct lbp_command *const command, const int err)
{
    static const char no_answer[] = "no remote answers (is it in set-up mode, and the baud rate right?)";
    const char *const what = err == HM2_ERR_TIMEOUT     ? no_answer
                             : err == HM2_ERR_MALFORMED ? "the CRC of the answer is wrong"
                                                        : "the line is gone";
    if (lbp_address_bytes(command->code) > 0)
        return hm2_diag_add(client->diag, err, "%s: LBP command 0x%02X at address 0x%04X: %s.", client->name,
                            command->code, command->address, what);
    return hm2_diag_add(client->diag, err, "%s: LBP command 0x%02X: %s.", client->name, command->code, what);
}

static bool moves_pointer(const uint8_t code)
{
    return ((code & LBP_KIND) == LBP_DATA && code & LBP_INCREMENT) || code == LBP_ADD_ADDRESS;
}

int lbp_client_exchange(struct lbp_client *const client, const struct lbp_command *const command, uint8_t *const reply,
                        const size_t bytes)
{
    uint8_t message[LBP_MESSAGE_BYTES], answer[LBP_MAX_DATA + 1];
    const int len = lbp_encode(command, message, sizeof message);
    if (len < 0 || bytes > LBP_MAX_DATA)
        return hm2_diag_add(client->diag, HM2_ERR_RANGE, "%s: no LBP command 0x%02X has %u bytes of data, %zu back.",
                            client->name, command->code, command->len, bytes);
    const unsigned tries = moves_pointer(command->code) ? 1 : TRIES;
    int err = exchange_once(client, message, (size_t)len, answer, bytes);
    for (unsigned i = 1; i < tries && (err == HM2_ERR_TIMEOUT || err == HM2_ERR_MALFORMED); i++) {
        client->repeated++;
        err = quiet(client, client->gap_ns);
        if (!err)
            err = exchange_once(client, message, (size_t)len, answer, bytes);
    }
    if (err)
        return refuse(client, command, err);
    if (bytes > 0)
        memcpy(reply, answer, bytes);
    return 0;
}

int lbp_client_read(struct lbp_client *const client, const uint16_t address, const unsigned bytes,
                    uint64_t *const value)
{
    const struct lbp_command command = {.code = lbp_data_code(bytes), .address = address};
    uint8_t reply[sizeof(uint64_t)] = {0};
    *value = 0;
    const int err = lbp_client_exchange(client, &command, reply, lbp_returned_bytes(command.code));
    if (!err)
        *value = hm2_get_le32(reply) | (uint64_t)hm2_get_le32(reply + 4) << 32;
    return err;
}

int lbp_client_write(struct lbp_client *const client, const uint16_t address, const unsigned bytes,
                     const uint64_t value)
{
    const uint8_t code = lbp_data_code(bytes);
    struct lbp_command command = {
        .code = (uint8_t)(code ? code | LBP_WRITE : 0), .address = address, .len = (uint8_t)bytes};
    hm2_put_le32(command.data, (uint32_t)value);
    hm2_put_le32(command.data + 4, (uint32_t)(value >> 32));
    return lbp_client_exchange(client, &command, NULL, 0);
}

int lbp_client_get(struct lbp_client *const client, const enum lbp_local code, uint8_t *const value)
{
    const struct lbp_command command = {.code = (uint8_t)code};
    *value = 0;
    return lbp_client_exchange(client, &command, value, lbp_returned_bytes(command.code));
}

int lbp_client_set(struct lbp_client *const client, const enum lbp_local code, const uint8_t value)
{
    const struct lbp_command command = {.code = (uint8_t)code, .len = 1, .data = {value}};
    return lbp_client_exchange(client, &command, NULL, 0);
}

/* ---- who is there? ------------------------------------------------------------------------------------------------
 */

static int greet(struct lbp_client *const client)
{
    uint8_t cookie, status;
    int err = lbp_client_get(client, LBP_GET_COOKIE, &cookie);
    if (!err && cookie != LBP_COOKIE)
        return hm2_diag_add(client->diag, HM2_ERR_MISMATCH, "%s: cookie 0x%02X found, 0x%02X expected: no LBP remote.",
                            client->name, cookie, LBP_COOKIE);
    if (!err)
        err = lbp_client_set(client, LBP_SET_TIMEOUT, LBP_LONGEST_TIMEOUT);
    if (!err)
        err = lbp_client_set(client, LBP_SET_STATUS, NOTHING_WRONG);
    return err ? err : lbp_client_get(client, LBP_GET_STATUS, &status);
}

static int get_unit(struct lbp_client *const client, struct lbp_identity *const identity)
{
    const struct lbp_command command = {.code = LBP_RPC_UNIT};
    uint8_t unit[4] = {0};
    const int err = lbp_client_exchange(client, &command, unit, sizeof unit);
    identity->unit = hm2_get_le32(unit);
    return err;
}

static int get_name(struct lbp_client *const client, struct lbp_identity *const identity)
{
    int err = 0;
    for (unsigned i = 0; !err && i < NAME_BYTES; i++) {
        uint8_t c = 0;
        const struct lbp_command command = {.code = (uint8_t)(LBP_GET_NAME + i)};
        err = lbp_client_exchange(client, &command, &c, 1);
        identity->name[i] = (char)(c > ' ' && c <= '~' ? c : '-');
    }
    return err;
}

static int get_tables(struct lbp_client *const client, struct lbp_identity *const identity)
{
    const struct lbp_command command = {.code = LBP_RPC_DISCOVERY};
    uint8_t found[6] = {0};
    const int err = lbp_client_exchange(client, &command, found, sizeof found);
    identity->in_bytes = found[0];
    identity->out_bytes = found[1];
    identity->ptoc = hm2_get_le16(found + 2);
    identity->gtoc = hm2_get_le16(found + 4);
    return err;
}

int lbp_client_identify(struct lbp_client *const client, const uint8_t mode, struct lbp_identity *const identity)
{
    *identity = (struct lbp_identity){.unit = 0};
    int err = greet(client);
    if (!err)
        err = get_unit(client, identity);
    if (!err)
        err = get_name(client, identity);
    if (!err)
        err = lbp_client_set(client, LBP_SET_MODE, mode);
    return err ? err : get_tables(client, identity);
}
