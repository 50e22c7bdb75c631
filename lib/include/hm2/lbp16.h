/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * LBP16, the register protocol of the Ethernet cards (seed 000 and 001, chapter "LBP16"; firmware behaviour from the
 * recorded exchanges, tests/data/lbp16). Pure: works on the caller's bytes, makes no system call, allocates nothing;
 * every function is realtime and thread safe.
 *
 * A datagram holds commands back to back. A command is a 16-bit word, then a 16-bit address when A is set, then data
 * when W is set. The reply is the data of all reads back to back, nothing else; a datagram without reads gets none.
 */
#ifndef HM2_LBP16_H
#define HM2_LBP16_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>

#define LBP16_UDP_PORT          27181
#define LBP16_MAX_COUNT         127u  /* N field, 1..127; 0 is an error (seed 000, "LBP16 COMMANDS") */
#define LBP16_MAX_REQUEST_BYTES 1472u /* one unfragmented UDP payload */
#define LBP16_MAX_REPLY_BYTES   1472u /* the firmware sends up to 1490, UDP on Ethernet carries 1472 */

/* Command word fields (seed 000, "LBP16 COMMANDS"): W A C MMM SS I NNNNNNN. */
#define LBP16_W 0x8000u
#define LBP16_A 0x4000u
#define LBP16_C 0x2000u
#define LBP16_I 0x0080u

enum lbp16_space {
    LBP16_SPACE_HM2 = 0,      /* HostMot2 registers, 32 bit */
    LBP16_SPACE_ETHERNET = 1, /* KSZ8851 registers, 16 bit */
    LBP16_SPACE_EEPROM = 2,   /* MAC, card name, IP address, 16 bit */
    LBP16_SPACE_FLASH = 3,    /* configuration flash, 32 bit */
    LBP16_SPACE_TIMER = 4,    /* time stamp, waits, scratch, 16 bit */
    LBP16_SPACE_UNUSED = 5,
    LBP16_SPACE_CONTROL = 6, /* status and control, 16 bit */
    LBP16_SPACE_INFO = 7,    /* card information, read only, 16 bit */
};

enum lbp16_size { LBP16_SIZE_8 = 0, LBP16_SIZE_16 = 1, LBP16_SIZE_32 = 2, LBP16_SIZE_64 = 3 };

struct lbp16_command {
    bool write, has_address, info, increment;
    enum lbp16_space space;
    enum lbp16_size size;
    unsigned count;   /* 1..127 */
    uint16_t address; /* byte address; valid when has_address */
};

/* Bytes of one item (1, 2, 4, 8) and of the whole data of a command. */
static inline size_t lbp16_item_bytes(const enum lbp16_size size)
{
    return (size_t)1 << (unsigned)size;
}

static inline size_t lbp16_data_bytes(const struct lbp16_command *const command)
{
    return command->count * lbp16_item_bytes(command->size);
}

/* Command word for these fields; HM2_ERR_RANGE for a count outside 1..127 or fields outside their width. */
HM2_API int HM2_MUST_CHECK lbp16_encode(const struct lbp16_command *command, uint16_t *word);
/* Fields of a command word; HM2_ERR_MALFORMED for count 0. address is left 0. */
HM2_API int HM2_MUST_CHECK lbp16_decode(uint16_t word, struct lbp16_command *command);

/* ---- client: build a request ----------------------------------------------------------------------------------- */

/* Builder over the caller's buffer. The first error sticks and makes every later call fail with it, so a sequence
 * of calls may be checked once at its end. reply_bytes is what the card will answer. */
struct lbp16_builder {
    uint8_t *data;
    size_t capacity; /* at most LBP16_MAX_REQUEST_BYTES */
    size_t used;
    size_t reply_bytes;
    int error;
};

HM2_API void lbp16_builder_init(struct lbp16_builder *builder, void *data, size_t capacity);

/* Append a read. When it succeeds *reply_offset (may be NULL) is where its data will stand in the reply. Fails with
 * HM2_ERR_NOSPACE when request or reply would become too long. */
HM2_API int lbp16_add_read(struct lbp16_builder *builder, const struct lbp16_command *command, size_t *reply_offset);
/* Append a write with its data (already little endian), or with zeros when data is NULL; *data_offset (may be NULL)
 * is where the data stand in the request, to be overwritten later. */
HM2_API int lbp16_add_write(struct lbp16_builder *builder, const struct lbp16_command *command, const void *data,
                            size_t *data_offset);

/* Common commands: 32-bit HostMot2 registers, incrementing, with address (0x42/0xC2). */
HM2_API int lbp16_add_read_hm2(struct lbp16_builder *builder, uint16_t address, unsigned count, size_t *reply_offset);
HM2_API int lbp16_add_write_hm2(struct lbp16_builder *builder, uint16_t address, unsigned count, const void *data,
                                size_t *data_offset);
/* 16-bit items of any space, incrementing, with address. */
HM2_API int lbp16_add_read16(struct lbp16_builder *builder, enum lbp16_space space, uint16_t address, unsigned count,
                             size_t *reply_offset);
HM2_API int lbp16_add_write16(struct lbp16_builder *builder, enum lbp16_space space, uint16_t address, unsigned count,
                              const uint16_t *values, size_t *data_offset);
/* Information area of a space (cookie, sizes, ranges, pointer, name: 8 words). */
HM2_API int lbp16_add_read_info(struct lbp16_builder *builder, enum lbp16_space space, size_t *reply_offset);

/* ---- server: parse a request ----------------------------------------------------------------------------------- */

/* Walks over a request; the simulated card uses it. */
struct lbp16_parser {
    const uint8_t *data;
    size_t left;
};

HM2_API void lbp16_parser_init(struct lbp16_parser *parser, const void *data, size_t len);
/* Next command: 1 = *command filled, *payload points at its write data (NULL for reads) and *payload_len bytes of
 * them are present (the firmware accepts fewer than announced: the caller decides), 0 = end (a single stray byte at
 * the end is ignored, as the firmware does), HM2_ERR_MALFORMED = count 0 (stop then: the firmware does too). A missing
 * address yields address 0, fewer data than announced a shorter payload; both set *truncated. An empty datagram has
 * no commands; that the firmware counts it as a parse error is the caller's business. */
HM2_API int HM2_MUST_CHECK lbp16_parser_next(struct lbp16_parser *parser, struct lbp16_command *command,
                                             const uint8_t **payload, size_t *payload_len, bool *truncated);

/* ---- information area ------------------------------------------------------------------------------------------ */

enum lbp16_memory_type {
    LBP16_TYPE_REGISTER = 0x01,
    LBP16_TYPE_MEMORY = 0x02,
    LBP16_TYPE_EEPROM = 0x0E,
    LBP16_TYPE_FLASH = 0x0F
};

#define LBP16_INFO_BYTES 16u

struct lbp16_info {
    uint16_t cookie; /* 0x5A00 + space */
    bool writable;
    unsigned type;                             /* enum lbp16_memory_type, 7 bits */
    bool access[4];                            /* 8, 16, 32, 64 bit allowed */
    unsigned erase_log2, page_log2, size_log2; /* bytes as powers of two; 0 = none */
    uint16_t pointer;                          /* live address pointer */
    char name[9];                              /* up to 8 characters, NUL terminated */
};

/* Decode the 16 bytes of an information area. HM2_ERR_MISMATCH when the cookie is not that of the space. */
HM2_API int HM2_MUST_CHECK lbp16_info_decode(enum lbp16_space space, const uint8_t *data, size_t len,
                                             struct lbp16_info *info);
HM2_API void lbp16_info_encode(const struct lbp16_info *info, uint8_t data[LBP16_INFO_BYTES]);

/* ---- register addresses ---------------------------------------------------------------------------------------- */

/* Space 2, EEPROM (seed 000, "ETHERNET EEPROM LAYOUT"), byte addresses. */
enum {
    LBP16_EEPROM_MAC = 0x0002,
    LBP16_EEPROM_NAME = 0x0010,
    LBP16_EEPROM_IP = 0x0020,
    LBP16_EEPROM_NETMASK = 0x0024,
    LBP16_EEPROM_LED_MODE = 0x0028,
    LBP16_EEPROM_BYTES = 0x0080
};
/* Space 3, flash (seed 000, "FLASH MEMORY REGISTERS"). */
enum { LBP16_FLASH_ADDRESS = 0x0000, LBP16_FLASH_DATA = 0x0004, LBP16_FLASH_ID = 0x0008, LBP16_FLASH_ERASE = 0x000C };
/* Space 4, timers (seed 000, "MEMORY SPACE 4 LAYOUT"). */
enum {
    LBP16_TIMER_STAMP_US = 0x0000,
    LBP16_TIMER_WAIT_US = 0x0002,
    LBP16_TIMER_TIMEOUT_US = 0x0004,
    LBP16_TIMER_WAIT_REF = 0x0006,
    LBP16_TIMER_WAIT_1 = 0x0008,
    LBP16_TIMER_WAIT_4 = 0x000E,
    LBP16_TIMER_SCRATCH = 0x0010,
    LBP16_TIMER_BYTES = 0x0020
};
/* Space 6, control (seed 000, "MEMORY SPACE 6 LAYOUT"). */
enum {
    LBP16_CONTROL_ERROR = 0x0000,
    LBP16_CONTROL_PARSE_ERRORS = 0x0002,
    LBP16_CONTROL_MEM_ERRORS = 0x0004,
    LBP16_CONTROL_WRITE_ERRORS = 0x0006,
    LBP16_CONTROL_RX_PACKETS = 0x0008,
    LBP16_CONTROL_RX_UDP = 0x000A,
    LBP16_CONTROL_RX_BAD = 0x000C,
    LBP16_CONTROL_TX_PACKETS = 0x000E,
    LBP16_CONTROL_TX_UDP = 0x0010,
    LBP16_CONTROL_TX_BAD = 0x0012,
    LBP16_CONTROL_LED_MODE = 0x0014,
    LBP16_CONTROL_LED_POINTER = 0x0016,
    LBP16_CONTROL_SCRATCH = 0x0018,
    LBP16_CONTROL_WRITE_ENABLE = 0x001A,
    LBP16_CONTROL_RESET = 0x001C,
    LBP16_CONTROL_ICAP = 0x001E,
    LBP16_CONTROL_BYTES = 0x0020
};
/* Bits of LBP16_CONTROL_ERROR (seed 000, "ERROR REGISTER FORMAT"). */
enum {
    LBP16_ERROR_PARSE = 0x01,
    LBP16_ERROR_MEM = 0x02,
    LBP16_ERROR_WRITE = 0x04,
    LBP16_ERROR_RX = 0x08,
    LBP16_ERROR_TX = 0x10,
    LBP16_ERROR_HM2_TIMEOUT = 0x20
};
/* Space 7, card information (seed 000, "SPACE 7: LBP READ ONLY AREA"). */
enum {
    LBP16_INFO_NAME = 0x0000,
    LBP16_INFO_NAME_BYTES = 16,
    LBP16_INFO_LBP_VERSION = 0x0010,
    LBP16_INFO_FIRMWARE = 0x0012,
    LBP16_INFO_JUMPERS = 0x0014,
    LBP16_INFO_RECV_START = 0x0018,
    LBP16_INFO_RECV_DONE = 0x001A,
    LBP16_INFO_SEND_START = 0x001C,
    LBP16_INFO_SEND_DONE = 0x001E
};

#endif
