/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "remote_lbp.h"

#include <string.h>

#include <hm2/bytes.h>

#define VERSION   3u
#define RPC_PITCH 8u
#define WATCHDOG  REMOTE_FAULT_WATCHDOG

static uint8_t *local(struct remote_lbp *const line, const enum lbp_local code)
{
    return &line->local[(unsigned)code % REMOTE_LOCALS];
}

static void expect_process_data(struct remote_lbp *const line)
{
    line->parser.rpc_bytes[LBP_RPC_PROCESS % LBP_RPCS] = (uint8_t)remote_out_bytes(line->remote);
}

static void power_up(struct remote_lbp *const line)
{
    memset(line->local, 0, sizeof line->local);
    for (unsigned i = 0; i < 4; i++)
        line->local[LBP_GET_NAME % REMOTE_LOCALS + i] = (uint8_t)remote_card_name(line->remote)[i];
    *local(line, LBP_GET_CRC_ENABLE) = 1;
    *local(line, LBP_GET_TIMEOUT) = LBP_LONGEST_TIMEOUT;
    *local(line, LBP_GET_VERSION) = VERSION;
    *local(line, LBP_GET_RPC_PITCH) = RPC_PITCH;
    *local(line, LBP_GET_COOKIE) = LBP_COOKIE;
    line->pointer = 0;
    lbp_parser_init(&line->parser, lbp_gap_ns(LBP_LONGEST_TIMEOUT, line->baud));
    expect_process_data(line);
}

void remote_lbp_init(struct remote_lbp *const line, struct remote *const remote, const uint32_t baud)
{
    *line = (struct remote_lbp){.remote = remote, .baud = baud};
    power_up(line);
}

/* ---- memory -------------------------------------------------------------------------------------------------------
 */

static void write_byte(struct remote_lbp *const line, const uint16_t address, const uint8_t value)
{
    if (!remote_write(line->remote, address, value))
        *local(line, LBP_GET_STATUS) |= LBP_STATUS_WRITE;
}

/* ---- commands: what comes back, without the CRC -------------------------------------------------------------------
 */

static size_t access_data(struct remote_lbp *const line, const struct lbp_command *const command, uint8_t *const answer)
{
    const unsigned bytes = 1u << (command->code & LBP_SIZE);
    if (command->code & LBP_ADDRESS)
        line->pointer = command->address;
    for (unsigned i = 0; i < bytes; i++) {
        if (command->code & LBP_WRITE)
            write_byte(line, (uint16_t)(line->pointer + i), command->data[i]);
        else
            answer[i] = remote_read(line->remote, (uint16_t)(line->pointer + i));
    }
    if (command->code & LBP_INCREMENT)
        line->pointer = (uint16_t)(line->pointer + bytes);
    return lbp_returned_bytes(command->code);
}

static size_t call(struct remote_lbp *const line, const struct lbp_command *const command, const int64_t now_ns,
                   uint8_t *const answer)
{
    switch (command->code) {
    case LBP_RPC_UNIT:
        hm2_put_le32(answer, remote_unit_number(line->remote));
        return 4;
    case LBP_RPC_DISCOVERY:
        answer[0] = (uint8_t)(remote_in_bytes(line->remote) + 1u);
        answer[1] = (uint8_t)remote_out_bytes(line->remote);
        hm2_put_le16(answer + 2, remote_ptoc(line->remote));
        hm2_put_le16(answer + 4, remote_gtoc(line->remote));
        return 6;
    case LBP_RPC_PROCESS:
        remote_exchange(line->remote, now_ns, command->data, answer);
        return remote_in_bytes(line->remote) + 1u;
    default:
        return 0; /* its list of stored commands is empty */
    }
}

static void set_local(struct remote_lbp *const line, const uint8_t code, const uint8_t value, const int64_t now_ns)
{
    switch (code) {
    case LBP_SET_MODE:
        remote_set_mode(line->remote, value);
        expect_process_data(line);
        break;
    case LBP_CLEAR_FAULTS:
        remote_clear_faults(line->remote, value);
        break;
    case LBP_SET_NV_ACCESS:
        remote_set_nv_access(line->remote, value);
        break;
    case LBP_SET_TIMEOUT:
        *local(line, LBP_GET_TIMEOUT) = value;
        line->parser.gap_ns = lbp_gap_ns(value, line->baud);
        break;
    case LBP_SET_LOW_ADDRESS:
        line->pointer = (uint16_t)((line->pointer & 0xFF00u) | value);
        break;
    case LBP_SET_HIGH_ADDRESS:
        line->pointer = (uint16_t)((line->pointer & 0x00FFu) | (unsigned)value << 8);
        break;
    case LBP_ADD_ADDRESS:
        line->pointer = (uint16_t)(line->pointer + value);
        break;
    case LBP_SET_UNIT_ID:
        *local(line, LBP_GET_UNIT_ID) = value;
        break;
    case LBP_RESET:
        if (value == LBP_COOKIE) {
            remote_power_up(line->remote, now_ns);
            power_up(line);
        }
        break;
    case LBP_SET_STATUS:
    case LBP_SET_CRC_ERRORS:
    case LBP_SET_RPC_ACCESS:
        line->local[code % REMOTE_LOCALS] = value;
        break;
    default:
        break; /* CRCs are always on; LEDs and reserved codes */
    }
}

static uint8_t get_local(struct remote_lbp *const line, const uint8_t code)
{
    const bool bitten = remote_faults(line->remote) & WATCHDOG;
    switch (code) {
    case LBP_GET_STATUS:
        return (uint8_t)(line->local[code % REMOTE_LOCALS] | (bitten ? LBP_STATUS_WATCHDOG : 0));
    case LBP_GET_FAULTS:
        return remote_faults(line->remote);
    case LBP_GET_LOW_ADDRESS:
        return (uint8_t)line->pointer;
    case LBP_GET_HIGH_ADDRESS:
        return (uint8_t)(line->pointer >> 8);
    default:
        return line->local[code % REMOTE_LOCALS];
    }
}

static size_t obey(struct remote_lbp *const line, const struct lbp_command *const command, const int64_t now_ns,
                   uint8_t *const answer)
{
    remote_feed(line->remote, now_ns);
    if ((command->code & LBP_KIND) == LBP_DATA)
        return access_data(line, command, answer);
    if ((command->code & LBP_KIND) == LBP_RPC)
        return call(line, command, now_ns, answer);
    if (command->code & LBP_WRITE)
        set_local(line, command->code, command->data[0], now_ns);
    else
        answer[0] = get_local(line, command->code);
    return lbp_returned_bytes(command->code);
}

static void note_error(struct remote_lbp *const line, const int error)
{
    line->bad++;
    if (error == HM2_ERR_TIMEOUT) {
        *local(line, LBP_GET_STATUS) |= LBP_STATUS_TIMEOUT;
        return;
    }
    *local(line, LBP_GET_STATUS) |= LBP_STATUS_CRC;
    if (*local(line, LBP_GET_CRC_ERRORS) < UINT8_MAX)
        (*local(line, LBP_GET_CRC_ERRORS))++;
}

size_t remote_lbp_take(struct remote_lbp *const line, const uint8_t byte, const int64_t now_ns,
                       uint8_t answer[const LBP_MESSAGE_BYTES])
{
    struct lbp_command command;
    const int taken = lbp_parser_take(&line->parser, byte, now_ns, &command);
    if (taken < 0)
        note_error(line, taken);
    if (taken != 1)
        return 0;
    line->commands++;
    const size_t len = obey(line, &command, now_ns, answer);
    answer[len] = lbp_crc8(0, answer, len);
    return len + 1;
}
