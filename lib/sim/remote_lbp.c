/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "remote_lbp.h"

#include <string.h>

#include <hm2/bytes.h>

#define VERSION   3u
#define RPC_PITCH 8u
#define WATCHDOG  REMOTE_FAULT_WATCHDOG

/* Addresses while the flash is meant, and what is written to the last one. */
enum { FLASH_OFFSET = 0x8000, FLASH_BLOCK_LOG2 = 0x8004, FLASH_PAGE_LOG2 = 0x8005, FLASH_COMMIT = 0x8007 };
#define COMMIT_ERASE 0xFEu
#define COMMIT_WRITE 0xFDu
#define ERASED       0xFFu

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
    line->memory = LBP_MEMORY_WORKING;
    line->pointer = 0;
    lbp_parser_init(&line->parser, lbp_gap_ns(LBP_LONGEST_TIMEOUT, line->baud));
    expect_process_data(line);
}

void remote_lbp_init(struct remote_lbp *const line, struct remote *const remote, const uint32_t baud)
{
    *line = (struct remote_lbp){.remote = remote, .baud = baud};
    memset(line->flash.bytes, ERASED, sizeof line->flash.bytes);
    power_up(line);
}

/* ---- memory -------------------------------------------------------------------------------------------------------
 */

static bool commit(struct remote_flash *const flash, const uint8_t how)
{
    const uint32_t block = 1u << REMOTE_BLOCK_LOG2, page = sizeof flash->page;
    const uint32_t unit = how == COMMIT_ERASE ? block : page;
    if ((how != COMMIT_ERASE && how != COMMIT_WRITE) || flash->offset % unit != 0 || flash->offset < block ||
        flash->offset >= REMOTE_FLASH_BYTES)
        return false;
    for (uint32_t i = 0; i < unit; i++)
        flash->bytes[flash->offset + i] =
            how == COMMIT_ERASE ? (uint8_t)ERASED : flash->bytes[flash->offset + i] & flash->page[i];
    return true;
}

static bool flash_write(struct remote_flash *const flash, const uint16_t address, const uint8_t value)
{
    if (address == FLASH_COMMIT)
        return commit(flash, value);
    if (address >= FLASH_OFFSET && address < FLASH_BLOCK_LOG2) {
        const unsigned shift = 8u * (address - FLASH_OFFSET);
        flash->offset = (flash->offset & ~(UINT32_C(0xFF) << shift)) | (uint32_t)value << shift;
        return true;
    }
    if (address >= sizeof flash->page)
        return false;
    flash->page[address] = value;
    return true;
}

static uint8_t flash_read(const struct remote_flash *const flash, const uint16_t address)
{
    if (address == FLASH_BLOCK_LOG2)
        return REMOTE_BLOCK_LOG2;
    if (address == FLASH_PAGE_LOG2)
        return REMOTE_PAGE_LOG2;
    return address < sizeof flash->page ? flash->page[address] : 0;
}

static uint8_t read_byte(struct remote_lbp *const line, const uint16_t address)
{
    return line->memory == LBP_MEMORY_FLASH ? flash_read(&line->flash, address) : remote_read(line->remote, address);
}

static void write_byte(struct remote_lbp *const line, const uint16_t address, const uint8_t value)
{
    const bool good = line->memory == LBP_MEMORY_FLASH ? flash_write(&line->flash, address, value)
                                                       : remote_write(line->remote, address, value);
    if (!good)
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
            answer[i] = read_byte(line, (uint16_t)(line->pointer + i));
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
        line->memory = value;
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
